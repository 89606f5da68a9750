//! What somebody on a site wants to be told at once, whether or not it breaks a requirement: a vehicle that is gone, that cannot go
//! on, or that says nothing any more.

use std::fmt;
use std::time::Duration;

use tck_base::clock::{Moment, Stamp};
use tck_view::{ConnectionView, ErrorView, StateView};

/// A vehicle that is ONLINE and says nothing for so long has fallen silent: the standard allows 30 s between two states, and a
/// second is left to the transport.
pub const SILENT: Duration = Duration::from_secs(31);
/// How long a text of a message may be that is shown.
const TEXT: usize = 64;
/// How many errors of a state are looked at.
const ERRORS: usize = 64;

/// What happened to a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub enum Alarm {
    /// Its connection broke off.
    Broken,
    /// It has an error with which it cannot go on, of this type.
    Fatal(String),
    /// Its emergency stop is active, of this kind.
    EmergencyStop(String),
    /// Its connection topic says ONLINE, and no state came for so long.
    Silent(Duration),
    /// A state comes again, after so long.
    Back(Duration),
}

impl Alarm {
    /// The word for programs.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Broken => "connection-broken",
            Self::Fatal(_) => "fatal",
            Self::EmergencyStop(_) => "emergency-stop",
            Self::Silent(_) => "silent",
            Self::Back(_) => "back",
        }
    }
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Broken => f.write_str("its connection is broken (CONNECTIONBROKEN)"),
            Self::Fatal(kind) => write!(f, "has a FATAL error: {kind}"),
            Self::EmergencyStop(kind) => write!(f, "its emergency stop is active: {kind}"),
            Self::Silent(time) => write!(
                f,
                "says ONLINE, and no state came for {:.0} s",
                time.as_secs_f64().floor()
            ),
            Self::Back(time) => write!(f, "sends states again, after {:.0} s", time.as_secs_f64().floor()),
        }
    }
}

/// An alarm of a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Alarmed {
    /// Manufacturer.
    pub manufacturer: String,
    /// Serial number.
    pub serial_number: String,
    /// When.
    pub at: jiff::Timestamp,
    /// What.
    pub alarm: Alarm,
}

/// What of a vehicle can give an alarm.
#[derive(Clone, Debug, Default)]
pub(crate) struct Alarms {
    broken: bool,
    fatal: Vec<String>,
    stopped: Option<String>,
    /// The last state that came live.
    state: Option<Stamp>,
    /// From when on a state is due; nothing is while the vehicle is not ONLINE.
    due_since: Option<Moment>,
    silent: bool,
}

impl Alarms {
    /// The last state that came live, and not out of the store of a broker.
    pub(crate) fn last_state(&self) -> Option<Stamp> {
        self.state
    }

    /// Whether it is ONLINE and says nothing.
    pub(crate) fn is_silent(&self) -> bool {
        self.silent
    }

    /// What its connection topic says; `stored` ones tell of the past.
    pub(crate) fn connection(&mut self, said: &ConnectionView, at: Stamp, stored: bool) -> Option<Alarm> {
        let broken = said.is_broken();
        let is_news = broken && !self.broken && !stored;
        self.broken = broken;
        if said.is_online() {
            self.due_since.get_or_insert(at.moment);
        } else {
            (self.due_since, self.silent) = (None, false);
        }
        is_news.then_some(Alarm::Broken)
    }

    /// A state that came live.
    pub(crate) fn state(&mut self, state: &StateView, at: Stamp) -> Vec<Alarm> {
        let mut all = Vec::new();
        if std::mem::take(&mut self.silent) {
            let since = self.due_since.unwrap_or(at.moment);
            all.push(Alarm::Back(at.moment.since(since)));
        }
        self.state = Some(at);
        if self.due_since.is_some() {
            self.due_since = Some(at.moment);
        }
        let errors = state.errors.iter().take(ERRORS);
        let fatal = errors.filter(|error| error.error_level.is("FATAL"));
        let kind = |error: &ErrorView| cut(error.error_type.text().unwrap_or("?"));
        let mut fatal: Vec<String> = fatal.map(kind).collect();
        fatal.dedup();
        let news = fatal.iter().filter(|kind| !self.fatal.contains(kind));
        all.extend(news.cloned().map(Alarm::Fatal));
        self.fatal = fatal;
        let stop = state.emergency_stop().filter(|stop| *stop != "NONE").map(cut);
        if let Some(kind) = stop.as_ref().filter(|_| self.stopped.is_none()) {
            all.push(Alarm::EmergencyStop(kind.clone()));
        }
        self.stopped = stop;
        all
    }

    /// Time goes by.
    pub(crate) fn pass(&mut self, now: Moment) -> Option<Alarm> {
        let silent = now.since(self.due_since?);
        if self.silent || silent <= SILENT {
            return None;
        }
        self.silent = true;
        Some(Alarm::Silent(silent))
    }

    /// Nothing could be seen until now.
    pub(crate) fn unseen(&mut self, now: Moment) {
        self.silent = false;
        if let Some(since) = &mut self.due_since {
            *since = now;
        }
    }
}

/// The beginning of a text of a message.
pub(crate) fn cut(text: &str) -> String {
    text.chars().take(TEXT).collect()
}
