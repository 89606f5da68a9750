//! The time limits of a run: what `${time.NAME}` stands for.
//!
//! The standard sets no reaction time but 30 s for the state, so every other number here is a choice of this
//! tool, shown in the report. A profile may change them as a contract between the parties.

use std::time::Duration;

use serde_json::{Map, Value};

/// How long the device and the bench may take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimeLimits {
    /// What must happen has happened by then: accepted, refused, cancelled.
    pub react: Duration,
    /// Slower than this is a warning.
    pub slow: Duration,
    /// A state that an event asks for comes within this.
    pub event: Duration,
    /// A state that an event asks for comes within this with a warning; later is a failure.
    pub event_warning: Duration,
    /// Driving one route of a test.
    pub drive: Duration,
    /// Downloading a map.
    pub download: Duration,
    /// The first connection of the device.
    pub connect: Duration,
    /// The next connection after the link was cut.
    pub reconnect: Duration,
    /// The broker publishes the last will; reckoned from the keep-alive of the device when absent.
    pub will: Option<Duration>,
    /// How long nothing may happen when nothing should.
    pub quiet: Duration,
    /// The broker's own part: delivering a probe or a retained message.
    pub broker: Duration,
    /// The longest time between two states.
    pub state_period: Duration,
    /// How long the device is left alone until it counts as settled.
    pub settle: Duration,
    /// How long a message may be under way to a master control and lie there unread.
    pub notice: Duration,
}

/// The last will when the keep-alive of the device is not known.
pub const WILL_UNKNOWN: Duration = Duration::from_secs(45);

impl Default for TimeLimits {
    fn default() -> Self {
        Self {
            react: Duration::from_secs(31),
            slow: Duration::from_secs(5),
            event: Duration::from_secs(1),
            event_warning: Duration::from_secs(5),
            drive: Duration::from_secs(120),
            download: Duration::from_secs(60),
            connect: Duration::from_secs(60),
            reconnect: Duration::from_secs(90),
            will: None,
            quiet: Duration::from_secs(3),
            broker: Duration::from_secs(5),
            state_period: Duration::from_secs(31),
            settle: Duration::from_secs(2),
            notice: Duration::from_secs(1),
        }
    }
}

/// Whether a longer limit asks less or more of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loosened {
    ByLonger,
    ByShorter,
    Never,
}

impl TimeLimits {
    /// Name in suites, value, and in which direction it gets looser.
    fn named(&self) -> [(&'static str, Duration, Loosened); 14] {
        use Loosened::{ByLonger, ByShorter, Never};
        [
            ("react", self.react, ByLonger),
            ("slow", self.slow, ByLonger),
            ("event", self.event, ByLonger),
            ("eventWarning", self.event_warning, ByLonger),
            ("drive", self.drive, ByLonger),
            ("download", self.download, ByLonger),
            ("connect", self.connect, ByLonger),
            ("reconnect", self.reconnect, ByLonger),
            ("will", self.will.unwrap_or(WILL_UNKNOWN), ByLonger),
            ("quiet", self.quiet, ByShorter),
            ("broker", self.broker, Never),
            ("statePeriod", self.state_period, ByLonger),
            ("settle", self.settle, ByShorter),
            ("notice", self.notice, ByLonger),
        ]
    }

    /// The limits among the bindings of a run; those that it does not name are the usual ones.
    #[must_use]
    pub fn of_bindings(bindings: &Map<String, Value>) -> Self {
        let named = bindings.get("time").and_then(Value::as_object);
        let of = |name: &str| named.and_then(|all| all.get(name)?.as_u64()).map(Duration::from_millis);
        let usual = Self::default();
        Self {
            react: of("react").unwrap_or(usual.react),
            slow: of("slow").unwrap_or(usual.slow),
            event: of("event").unwrap_or(usual.event),
            event_warning: of("eventWarning").unwrap_or(usual.event_warning),
            drive: of("drive").unwrap_or(usual.drive),
            download: of("download").unwrap_or(usual.download),
            connect: of("connect").unwrap_or(usual.connect),
            reconnect: of("reconnect").unwrap_or(usual.reconnect),
            will: of("will"),
            quiet: of("quiet").unwrap_or(usual.quiet),
            broker: of("broker").unwrap_or(usual.broker),
            state_period: of("statePeriod").unwrap_or(usual.state_period),
            settle: of("settle").unwrap_or(usual.settle),
            notice: of("notice").unwrap_or(usual.notice),
        }
    }

    /// These limits with those among the arguments of a check, such as `statePeriod: 5 s`; `None` when there are none among
    /// them.
    #[must_use]
    pub fn with_own(&self, arguments: &Map<String, Value>) -> Option<Self> {
        let mut named = self.bindings();
        if self.will.is_none() {
            named.remove("will");
        }
        let mut has_own = false;
        for name in Self::names() {
            let own = match arguments.get(name) {
                Some(Value::String(text)) => parse(text).ok().and_then(|own| u64::try_from(own.as_millis()).ok()),
                Some(value) => value.as_u64(),
                None => None,
            };
            if let Some(own) = own {
                named.insert(name.to_owned(), own.into());
                has_own = true;
            }
        }
        let bindings = Map::from_iter([("time".to_owned(), Value::Object(named))]);
        has_own.then(|| Self::of_bindings(&bindings))
    }

    /// The shortest time within which the device has to do anything; none that is nothing.
    #[must_use]
    pub fn shortest(&self) -> Duration {
        let all = self.named().into_iter();
        let deadlines = all.filter(|(_, limit, loosened)| *loosened == Loosened::ByLonger && !limit.is_zero());
        deadlines.map(|(_, limit, _)| limit).min().unwrap_or(self.react)
    }

    /// The names a suite may use after `time.`.
    #[must_use]
    pub fn names() -> Vec<&'static str> {
        Self::default().named().into_iter().map(|(name, ..)| name).collect()
    }

    /// The limits in milliseconds, by the names suites use.
    #[must_use]
    pub fn bindings(&self) -> Map<String, Value> {
        self.named()
            .into_iter()
            .map(|(name, limit, _)| {
                let millis = u64::try_from(limit.as_millis()).unwrap_or(u64::MAX);
                (name.to_owned(), Value::from(millis))
            })
            .collect()
    }

    /// One sentence for every limit that differs from the default: an agreement between the parties, which
    /// the report has to show. A looser one says so, since it restricts what a pass means.
    #[must_use]
    pub fn contract(&self) -> Vec<Contract> {
        self.named()
            .into_iter()
            .zip(Self::default().named())
            .filter(|((_, agreed, _), (_, default, _))| agreed != default)
            .map(|((name, agreed, direction), (_, default, _))| Contract {
                name,
                agreed,
                default,
                looser: match direction {
                    Loosened::ByLonger => agreed > default,
                    Loosened::ByShorter => agreed < default,
                    Loosened::Never => false,
                },
            })
            .collect()
    }
}

/// A time limit that differs from the default.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contract {
    /// Name as suites use it.
    pub name: &'static str,
    /// What the profile says.
    pub agreed: Duration,
    /// What it would be.
    pub default: Duration,
    /// Whether it asks less of the device than the default.
    pub looser: bool,
}

impl std::fmt::Display for Contract {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "time.{} is {} by contract, {} the default of {}",
            self.name,
            show(self.agreed),
            if self.looser { "looser than" } else { "instead of" },
            show(self.default)
        )
    }
}

/// Reads `5 s`, `800 ms` or `2 min`.
///
/// # Errors
/// What is wrong with the text, to stand at a caret.
pub fn parse(text: &str) -> Result<Duration, String> {
    let text = text.trim();
    let unit_at = text
        .find(|c: char| !c.is_ascii_digit() && c != '.')
        .unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    let number: f64 = number
        .parse()
        .map_err(|_| "a duration begins with a number".to_owned())?;
    let unit = match unit.trim() {
        "ms" => 0.001,
        "s" => 1.0,
        "min" => 60.0,
        "" => return Err("a duration needs a unit".to_owned()),
        other => return Err(format!("`{other}` is not a unit of time")),
    };
    let seconds = number * unit;
    if seconds < 0.001 {
        return Err("a time limit is at least 1 ms".to_owned());
    }
    if seconds > 86_400.0 {
        return Err("a time limit is at most a day".to_owned());
    }
    Ok(Duration::from_secs_f64(seconds))
}

/// The duration as a profile would say it.
#[must_use]
pub fn show(duration: Duration) -> String {
    let millis = duration.as_millis();
    if millis.is_multiple_of(1000) {
        format!("{} s", millis / 1000)
    } else {
        format!("{millis} ms")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_time_is_one_that_the_device_has_to_keep() {
        let mut limits = TimeLimits::default();
        assert_eq!(limits.shortest(), limits.event);
        limits.settle = Duration::from_millis(1);
        limits.notice = Duration::ZERO;
        limits.event = Duration::from_secs(9);
        assert_eq!(limits.shortest(), limits.slow);
    }

    #[test]
    fn durations_are_read_in_three_units() {
        assert_eq!(parse("800 ms"), Ok(Duration::from_millis(800)));
        assert_eq!(parse("5 s"), Ok(Duration::from_secs(5)));
        assert_eq!(parse("1.5s"), Ok(Duration::from_millis(1500)));
        assert_eq!(parse("2 min"), Ok(Duration::from_secs(120)));
    }

    #[test]
    fn a_duration_without_unit_or_number_or_length_is_refused() {
        for text in ["5", "s", "", "5 h", "0 s", "-5 s", "1.2.3 s", "2000 min"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_shown_duration_reads_back() {
        for millis in [1, 999, 1000, 1500, 31_000, 86_400_000] {
            let duration = Duration::from_millis(millis);
            assert_eq!(parse(&show(duration)), Ok(duration));
        }
    }

    #[test]
    fn bindings_are_milliseconds_by_the_names_of_the_suites() {
        let bindings = TimeLimits::default().bindings();
        assert_eq!(bindings["react"], 31_000);
        assert_eq!(bindings["statePeriod"], 31_000);
        assert_eq!(bindings["will"], 45_000);
        assert_eq!(bindings.len(), TimeLimits::names().len());
    }

    #[test]
    fn the_defaults_are_no_contract() {
        assert_eq!(TimeLimits::default().contract(), []);
    }

    #[test]
    fn looser_is_told_from_tighter() {
        let limits = TimeLimits {
            react: Duration::from_secs(60),
            slow: Duration::from_secs(1),
            quiet: Duration::from_secs(1),
            ..TimeLimits::default()
        };
        let said: Vec<String> = limits.contract().iter().map(ToString::to_string).collect();
        assert_eq!(
            said,
            [
                "time.react is 60 s by contract, looser than the default of 31 s",
                "time.slow is 1 s by contract, instead of the default of 5 s",
                "time.quiet is 1 s by contract, looser than the default of 3 s",
            ]
        );
    }
}
