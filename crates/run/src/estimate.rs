//! How long a run will take, roughly: said before the first test, so that nobody waits in vain.
//!
//! It adds up what can be known beforehand: the ways to be driven, the moments of watching, the silence that makes a
//! keep-alive run out. A device that keeps the harness waiting takes longer.

use std::time::Duration;

use serde_json::Value;

use super::pace::Pace;
use tck_base::pattern::TermKind;
use tck_course::Layout;
use tck_journal::event::LinkFault;
use tck_suite::model::{Extent, Step, Test, TimeTerm, Verb};
use tck_view::FactsheetView;

/// From a message to its answer, by a device that is not slow.
const EXCHANGE: Duration = Duration::from_millis(50);
/// Half again as long as the usual keep-alive of 15 s.
const KEEP_ALIVE: Duration = Duration::from_millis(22_500);
/// Of a vehicle that does not say how fast it is, in metres per second.
const SPEED: f64 = 1.0;
/// Of an edge nobody knows, in metres.
pub(super) const EDGE: f64 = 2.0;

/// What is known of device and floor.
pub(super) struct Estimate<'a> {
    /// `time.*`, in milliseconds.
    pub(super) time: Option<&'a Value>,
    /// Mean time from one node to the next.
    pub(super) edge: Duration,
    /// Of a hook, when nobody has to be asked.
    pub(super) hook: Duration,
}

impl<'a> Estimate<'a> {
    /// From the time limits, the factsheet and the floor.
    pub(super) fn of(
        time: Option<&'a Value>,
        factsheet: Option<&FactsheetView>,
        layout: Option<&Layout>,
        hook: Duration,
    ) -> Self {
        let fastest = Pace::of(factsheet).fastest().unwrap_or(SPEED);
        let mut seconds = Vec::new();
        for edge in layout.into_iter().flat_map(Layout::edges) {
            let ends = layout.and_then(|layout| Some((layout.node(&edge.start)?, layout.node(&edge.end)?)));
            let length = ends.map_or(EDGE, |(start, end)| start.distance(end.x, end.y));
            let speed = edge.max_speed.map_or(fastest, |cap| cap.min(fastest)).max(0.01);
            seconds.push(length / speed);
        }
        let mean = if seconds.is_empty() {
            EDGE / fastest
        } else {
            seconds.iter().sum::<f64>() / seconds.len() as f64
        };
        Self {
            time,
            edge: Duration::from_secs_f64(mean.clamp(0.0, 3_600.0)),
            hook,
        }
    }

    /// How long these tests take.
    pub(super) fn of_tests<'t>(&self, tests: impl Iterator<Item = &'t Test>) -> Duration {
        tests
            .flat_map(|test| test.sections().map(|(_, steps)| steps))
            .flatten()
            .map(|step| self.step(step))
            .sum()
    }

    fn step(&self, step: &Step) -> Duration {
        match &*step.verb {
            Verb::Send(send) => {
                let nodes = send.route.as_ref().map_or(0, |route| route.base.len());
                self.edge * u32::try_from(nodes.saturating_sub(1)).unwrap_or(u32::MAX)
            }
            Verb::Never(never) => self.limit(&never.during),
            Verb::Always(always) => match &always.extent {
                Extent::During(time) => self.limit(time),
                Extent::Until(_) => EXCHANGE,
            },
            Verb::Link(link) if matches!(link.fault, LinkFault::Silence { .. }) => KEEP_ALIVE,
            Verb::Operator(_) => self.hook,
            Verb::Expect(_) | Verb::Action(_) | Verb::Retained(_) => EXCHANGE,
            Verb::Link(_) | Verb::Serve(_) | Verb::Vehicle(_) => Duration::ZERO,
        }
    }

    fn limit(&self, time: &TimeTerm) -> Duration {
        let millis = match &time.term.kind {
            TermKind::Literal(value) => value.as_u64(),
            TermKind::Variable(name) => {
                let limit = name.strip_prefix("time.").and_then(|name| self.time?.get(name));
                limit.and_then(Value::as_u64)
            }
            _ => None,
        };
        Duration::from_millis(millis.unwrap_or(0))
    }
}

/// How long a run will still take, by what was planned and by what this device has taken so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outlook {
    /// What the tests that are still to come were to take, and how many they are.
    planned: Duration,
    tests: u32,
    /// What those that are over took more than planned, and how many they are.
    more: Duration,
    over: u32,
}

impl Outlook {
    /// Before the first of so many tests.
    pub(super) fn of(planned: Duration, tests: u32) -> Self {
        Self {
            planned,
            tests,
            ..Self::default()
        }
    }

    /// One of the tests is over: what it was to take, and what it took with all that came after it.
    pub(super) fn is_over(&mut self, planned: Duration, took: Duration) {
        self.planned = self.planned.saturating_sub(planned);
        self.tests = self.tests.saturating_sub(1);
        self.more += took.saturating_sub(planned);
        self.over += 1;
    }

    /// How long a test takes that was to take so long.
    pub(super) fn of_one(&self, planned: Duration) -> Duration {
        planned + self.more.checked_div(self.over).unwrap_or_default()
    }

    /// What is left.
    pub(super) fn left(&self) -> Duration {
        let each = self.more.checked_div(self.over).unwrap_or_default();
        self.planned + each * self.tests
    }
}

/// The estimate in words: no more exact than it is.
#[must_use]
pub fn in_words(estimate: Duration) -> String {
    let seconds = estimate.as_secs();
    match seconds {
        0..=9 => "a few seconds".to_owned(),
        10..=89 => format!("about {} s", seconds.div_ceil(10) * 10),
        _ => format!("about {} min", seconds.div_ceil(60)),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use tck_pack::Role;

    #[test]
    fn a_slow_vehicle_takes_longer_and_standing_still_takes_no_driving() {
        let library = tck_testing::library();
        let tests = library.tests(Role::Agv, &library.rules.packs.latest().id);
        let layout = Layout::built_in();
        let time = json!({ "quiet": 200 });
        let of = |speed: f64, moving: bool| {
            let sheet = json!({ "physicalParameters": { "speedMax": speed } });
            let sheet = crate::Sheet::read(&sheet, library.rules.packs.latest().names());
            let estimate = Estimate::of(Some(&time), Some(&sheet), Some(&layout), Duration::from_secs(1));
            estimate.of_tests(tests.iter().map(|test| &**test).filter(|test| test.moves == moving))
        };
        assert!(of(0.5, true) > of(2.0, true) * 2);
        assert!(of(2.0, true) > Duration::from_secs(30));
        assert_eq!(of(0.5, false), of(2.0, false));
    }

    #[test]
    fn what_a_device_has_taken_so_far_corrects_what_is_left() {
        let second = Duration::from_secs(1);
        let mut outlook = Outlook::of(second * 10, 10);
        assert_eq!(outlook.left(), second * 10);
        assert_eq!(outlook.of_one(second), second);
        outlook.is_over(second, second * 31);
        assert_eq!(outlook.of_one(second), second * 31);
        assert_eq!(outlook.left(), second * (9 + 9 * 30));
        outlook.is_over(second, second / 2);
        assert_eq!(outlook.left(), second * (8 + 8 * 15));
    }

    #[test]
    fn it_is_told_no_more_exactly_than_it_is() {
        let told = [3, 41, 130].map(|seconds| in_words(Duration::from_secs(seconds)));
        assert_eq!(told, ["a few seconds", "about 50 s", "about 3 min"]);
    }
}
