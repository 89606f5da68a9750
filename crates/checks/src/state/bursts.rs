//! `state/bursts`: states that say the same, one right after the other.

use std::collections::VecDeque;
use std::time::Duration;

use crate::finding::broken;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::Print;
use tck_world::{Listen, Observation, Topic};

/// States that say the same, one right after the other.
pub(crate) const BURSTS: Check = Check {
    name: "state/bursts",
    decides: &["STATE-11"],
    doc: "No more than four states within a quarter of a second say the same but for header, position, velocity and \
          battery. Messages to the vehicle, hooks and a disturbed link begin the count anew, and states that only \
          arrived together by their timestamps do not count.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Hook,
        Listen::Answer,
        Listen::Lag,
        Listen::Fault,
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Bursts::default()),
};

/// How many equal states are a burst, if they come within [`WITHIN`].
const BURST: usize = 5;
/// The time within which the states of a burst come.
const WITHIN: Duration = Duration::from_millis(250);

#[derive(Default)]
struct Bursts {
    last: Option<Print>,
    /// Arrival and timestamp of the states equal to the last one.
    equal: VecDeque<(Moment, Option<jiff::Timestamp>)>,
}

impl Running for Bursts {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let asked = record.is_to_vehicle(Topic::Order) || record.is_to_vehicle(Topic::InstantActions);
        if asked || record.outside_influence() || record.lag().is_some() || record.link.disturbed {
            self.equal.clear();
        }
        let Some(state) = record.state().filter(|_| !record.link.disturbed) else {
            return false;
        };
        if self.last.replace(state.essence) != Some(state.essence) {
            self.equal.clear();
        }
        let stamped: Option<jiff::Timestamp> = state.header.timestamp.or_empty().parse().ok();
        self.equal.push_back((record.at().moment, stamped));
        if self.equal.len() < BURST {
            return true;
        }
        let first = self.equal.pop_front();
        let Some((arrived, then)) = first else { return true };
        let sent = stamped
            .zip(then)
            .and_then(|(now, then)| Duration::try_from(now.duration_since(then)).ok());
        let span = record.at().moment.since(arrived).max(sent.unwrap_or_default());
        if span <= WITHIN {
            let text = format!("{BURST} states within {:.3} s say the same", span.as_secs_f64());
            findings.push(broken("STATE-11", record.seq(), text));
            self.equal.clear();
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    fn states(gap: f64, changing: bool) -> Trace {
        let mut trace = Trace::subscriber();
        for number in 0..8 {
            let speed = f64::from(number);
            let order = if changing { format!("o{number}") } else { "o".to_owned() };
            trace
                .wait(gap)
                .state(&json!({ "orderId": order, "velocity": { "vx": speed } }));
        }
        trace
    }

    #[test]
    fn equal_states_in_a_burst_are_found() {
        assert_eq!(states(0.01, false).judge("state/bursts").summary(), ["STATE-11"]);
    }

    #[test]
    fn states_that_say_something_or_take_their_time_are_right() {
        assert!(states(0.01, true).judge("state/bursts").summary().is_empty());
        assert!(states(0.1, false).judge("state/bursts").summary().is_empty());
    }

    #[test]
    fn what_waited_for_the_harness_is_no_burst() {
        let mut trace = Trace::subscriber();
        for _ in 0..3 {
            trace.late(0.3);
            for _ in 0..4 {
                trace.state(&json!({}));
            }
        }
        assert!(trace.judge("state/bursts").summary().is_empty());
    }

    #[test]
    fn what_is_asked_for_is_no_burst() {
        let mut trace = Trace::subscriber();
        for number in 0..8 {
            trace.instant("stateRequest", &format!("r{number}"), &json!([]));
            trace.state(&json!({}));
        }
        assert!(trace.judge("state/bursts").summary().is_empty());
    }
}
