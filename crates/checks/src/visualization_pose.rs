//! `visualization/position`: the visualization says where the vehicle is, as the state does.
//!
//! The form of its members is left to `message/schema`, how often it comes to `visualization/rate`.

use std::time::Duration;
use tck_journal::event::Event;

use super::state::driving::stays;
use crate::finding::{broken, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Pose, StateView, VisualizationView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How far it may be from the states of a vehicle at rest, in metres and radians.
const BESIDE: f64 = 0.5;
/// What comes so soon after a state may have been sent before it.
const OVERTAKING: Duration = Duration::from_millis(500);
/// How far from the origin, in metres, millimetres cannot be taken for metres.
const FROM_ORIGIN: f64 = 0.5;
/// How far, in metres, no vehicle gets and comes back between two states; ten times the way between them is added.
const OUT_OF_REACH: f64 = 100.0;
/// How many visualizations wait for the next state.
const WAITING: usize = 64;

/// The visualization says where the vehicle is, as the state does.
pub(super) const POSITION: Check = Check {
    name: "visualization/position",
    decides: &["VIS-01", "MAP-02"],
    doc: "A visualization between two states of a vehicle that stood still from one to the other names the position they \
          name, within half a metre and half a radian, on the same map; a thousand times their coordinates are \
          millimetres, also while it drives. One without a position, although the states have one, is a warning. Judged when it happens twice.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Visualization),
    ],
    reads: &[Fact::Displaced],
    needs: &[StateView::position, VisualizationView::position],
    start: |_| Box::new(Position::default()),
};

#[derive(Default)]
struct Position {
    /// The last state: when it came, where the vehicle stood.
    stood: Option<(Moment, Pose)>,
    /// The pose of the last state, and the visualizations since.
    last: Option<Pose>,
    on_the_way: Vec<(u64, Pose)>,
    /// Visualizations of a vehicle that stands: entry and pose.
    since: Vec<(u64, Pose)>,
    /// Whether the states have a position, and how many visualizations had none.
    known: bool,
    without: u32,
    beside: u32,
    millimetres: u32,
}

impl Position {
    fn compare(&mut self, at: &Pose, findings: &mut Vec<CheckFinding>) -> bool {
        let shown = std::mem::take(&mut self.since);
        let judged = !shown.is_empty();
        for (seq, pose) in shown {
            if is_in_millimetres(at, at, &pose) {
                continue;
            }
            let (far, turned) = at.apart(&pose);
            if pose.map_id == at.map_id && far <= BESIDE && turned <= BESIDE {
                continue;
            }
            self.beside += 1;
            if self.beside == 2 {
                let text = format!(
                    "the visualization says x {}, y {}, theta {}, the states before and after it x {}, y {}, theta {}",
                    pose.x, pose.y, pose.theta, at.x, at.y, at.theta
                );
                findings.push(broken("VIS-01", seq, text));
            }
        }
        judged
    }
}

impl Position {
    /// Looks for millimetres among what was shown between two states, wherever the vehicle was going.
    fn measure(&mut self, to: Option<&Pose>, findings: &mut Vec<CheckFinding>) -> bool {
        let shown = std::mem::take(&mut self.on_the_way);
        let Some((from, to)) = self.last.as_ref().zip(to) else {
            return false;
        };
        let mut found = false;
        for (seq, pose) in shown {
            if !is_in_millimetres(from, to, &pose) {
                continue;
            }
            found = true;
            self.millimetres += 1;
            if self.millimetres == 2 {
                let text = format!("x {} and y {} of the visualization are millimetres", pose.x, pose.y);
                findings.push(broken("MAP-02", seq, text));
            }
        }
        found
    }
}

/// Whether what is shown is a thousand times where the vehicle was between two states: nobody gets there in between.
fn is_in_millimetres(from: &Pose, to: &Pose, shown: &Pose) -> bool {
    let thousandth = Pose {
        x: shown.x / 1000.0,
        y: shown.y / 1000.0,
        ..shown.clone()
    };
    let (way, _) = from.apart(to);
    let is_out_of_reach = |at: &&Pose| at.apart(shown).0 > OUT_OF_REACH + 10.0 * way;
    thousandth.x.hypot(thousandth.y) > FROM_ORIGIN
        && from.apart(&thousandth).0 <= way + BESIDE / 2.0
        && [from, to].iter().all(is_out_of_reach)
}

impl Running for Position {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.displaced().now(record)
            || record.link.disturbed
            || matches!(record.event(), Event::Fault { .. })
        {
            self.stood = None;
            self.last = None;
            self.since.clear();
            self.on_the_way.clear();
        }
        let now = record.at().moment;
        if let Some(state) = record.state() {
            let seen = state.pose();
            let pose = seen.clone().filter(|_| state.driving.is(false));
            self.known = seen.is_some();
            let measured = self.measure(seen.as_ref(), findings);
            self.last = seen;
            let before = self.stood.take();
            self.stood = pose.clone().map(|pose| (now, pose));
            return match (before, pose) {
                (Some((_, before)), Some(pose)) if stays(&before, &pose) => self.compare(&pose, findings),
                _ => {
                    self.since.clear();
                    measured
                }
            };
        }
        let Some(message) = record.visualization() else {
            return false;
        };
        if message.position.is_absent() {
            self.without += u32::from(self.known);
            if self.without == 2 {
                let text = "the visualization has no agvPosition, although the states have one";
                findings.push(remark("VIS-01", record.seq(), text));
            }
            return self.known;
        }
        if let Some(pose) = message.pose().filter(|_| self.on_the_way.len() < WAITING) {
            self.on_the_way.push((record.seq(), pose));
        }
        let stood = self.stood.as_ref().is_some_and(|(at, _)| now.since(*at) > OVERTAKING);
        if let Some(pose) = message.pose().filter(|_| stood && self.since.len() < WAITING) {
            self.since.push((record.seq(), pose));
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn at(x: f64, y: f64) -> Value {
        json!({ "agvPosition": { "x": x, "y": y, "theta": 0.0, "mapId": "m", "positionInitialized": true } })
    }

    fn judge(shown: &Value, driving: bool) -> Vec<String> {
        let mut trace = Trace::subscriber();
        let mut state = at(2.0, 1.0);
        state["driving"] = json!(driving);
        for _ in 0..3 {
            trace.state(&state).wait(1.0).message("visualization", shown).wait(1.0);
        }
        trace.state(&state);
        trace.judge("visualization/position").summary()
    }

    #[test]
    fn the_position_of_the_states_is_right() {
        assert!(judge(&at(2.0, 1.01), false).is_empty());
        assert!(judge(&at(9.0, 1.0), true).is_empty(), "it drives");
        assert!(
            judge(&at(2000.0, 400.0), true).is_empty(),
            "elsewhere, and not in millimetres"
        );
    }

    #[test]
    fn another_position_millimetres_and_none_are_found() {
        assert_eq!(judge(&at(4.0, 1.0), false), ["VIS-01"]);
        assert_eq!(judge(&at(2000.0, 1000.0), false), ["MAP-02"]);
        assert_eq!(judge(&at(2000.0, 1000.0), true), ["MAP-02"], "also while it drives");
        assert_eq!(judge(&json!({}), false), ["VIS-01 warning"]);
    }
}
