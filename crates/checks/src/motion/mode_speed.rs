//! `motion/mode-speed`: the semiautomatic mode is not faster than the automatic one, on the same edge.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{SHARE, found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic, View};

/// `motion/mode-speed`.
pub(crate) const MODE_SPEED: Check = Check {
    name: "motion/mode-speed",
    decides: &["MODE-03"],
    doc: "On an edge that was driven in both modes, the vehicle reports no higher velocity in SEMIAUTOMATIC than in \
          AUTOMATIC, with a margin of a tenth, if it was also over the edge in less time: states are samples, and \
          either alone can be chance. Without reported velocities, and unless `alike` says that the drives differ in \
          nothing else, it is a warning. Edges are compared under the same maxSpeed.",
    arguments: &["alike"],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[StateView::operating_mode],
    start: |_| Box::new(ModeSpeed::default()),
};

/// How many edges are kept in mind.
const EDGES: usize = 1024;
/// What sensors see wrong, in metres per second.
const NOISE: f64 = 0.05;

/// How an edge was driven.
#[derive(Clone, Copy, Debug, Default)]
struct Drive {
    /// The highest velocity reported on it.
    reported: Option<f64>,
    /// The shortest time over it.
    took: Option<Duration>,
}

impl Drive {
    fn saw(&mut self, speed: Option<f64>) {
        self.reported = match (self.reported, speed) {
            (Some(old), Some(new)) => Some(old.max(new)),
            (old, new) => old.or(new),
        };
    }
}

/// Names of the nodes an edge leads from and to, and the speed it permits, in mm/s.
type Ends = (String, String, Option<i64>);

#[derive(Default)]
struct ModeSpeed {
    /// The fastest drive in AUTOMATIC, by edge.
    automatic: BTreeMap<Ends, Drive>,
    /// The edge being driven: its first state, its mode, and what was seen since.
    present: Option<(View, String, Drive)>,
}

fn ends(view: &View) -> Option<Ends> {
    let lane = view.lane.as_ref()?;
    #[expect(clippy::cast_possible_truncation, reason = "read below 1e9")]
    let permitted = lane.demands.max_speed.map(|speed| (speed * 1000.0) as i64);
    Some((lane.from.id.clone(), lane.to.id.clone(), permitted))
}

impl ModeSpeed {
    /// The present edge was driven to its end.
    fn driven(&mut self, now: &View, alike: bool, findings: &mut Vec<CheckFinding>) -> bool {
        let Some((entered, mode, mut drive)) = self.present.take() else {
            return false;
        };
        let Some(ends) = ends(&entered).filter(|_| now.node.sequence == entered.node.sequence + 2) else {
            return false;
        };
        drive.took = Some(now.time_since(&entered));
        if mode == "AUTOMATIC" {
            if self.automatic.len() < EDGES || self.automatic.contains_key(&ends) {
                let known = self.automatic.entry(ends).or_default();
                known.saw(drive.reported);
                known.took = [known.took, drive.took].into_iter().flatten().min();
            }
            return false;
        }
        let Some(usual) = self.automatic.get(&ends) else {
            return false;
        };
        let (Some(took), Some(usually)) = (drive.took, usual.took) else {
            return false;
        };
        // A drive of which the states show only where it stood says nothing about its speed.
        if usual.reported.is_some_and(|speed| speed <= NOISE) {
            return false;
        }
        let sooner = took.as_secs_f64() * SHARE < usually.as_secs_f64();
        match (drive.reported, usual.reported) {
            (Some(speed), Some(limit)) if sooner && speed > limit * SHARE + NOISE => {
                let text = format!("{speed:.2} m/s in SEMIAUTOMATIC on an edge driven at {limit:.2} m/s in AUTOMATIC");
                findings.push(if alike {
                    found(now.seq, text)
                } else {
                    softly(now.seq, text)
                });
            }
            (Some(_), Some(_)) => {}
            _ if sooner => {
                let (took, usually) = (took.as_secs_f64(), usually.as_secs_f64());
                let text = format!("{took:.2} s in SEMIAUTOMATIC over an edge that took {usually:.2} s in AUTOMATIC");
                findings.push(softly(now.seq, text));
            }
            _ => {}
        }
        true
    }
}

impl Running for ModeSpeed {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(step) = context.world.way().step(record) else {
            return false;
        };
        let now = &step.now;
        let mode = record.state().map(|state| state.operating_mode.or_empty().to_owned());
        let mode = mode.filter(|mode| matches!(mode.as_str(), "AUTOMATIC" | "SEMIAUTOMATIC"));
        let Some(mode) = mode.filter(|_| step.before.is_some() || now.lane.is_some()) else {
            self.present = None;
            return false;
        };
        let same = |(entered, was, _): &(View, String, Drive)| now.same_lane(entered) && *was == mode;
        if let Some((_, _, drive)) = self.present.as_mut().filter(|present| same(present)) {
            drive.saw(now.velocity.speed());
            return false;
        }
        let went_on = self
            .present
            .as_ref()
            .is_some_and(|(entered, was, _)| now.order == entered.order && *was == mode);
        let alike = context.with.get("alike") == Some(&serde_json::Value::Bool(true));
        let judged = went_on && self.driven(now, alike, findings);
        let drive = Drive {
            reported: now.velocity.speed(),
            took: None,
        };
        self.present = now.lane.is_some().then(|| (now.clone(), mode, drive));
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::{Trace, merged};

    const CHECK: &str = "motion/mode-speed";

    /// A drive over one edge of four metres, with the velocity reported half way.
    fn drive(trace: &mut Trace, mode: &str, seconds: f64, velocity: Option<f64>) {
        let order = format!("{mode}-{seconds}");
        let node =
            |id: &str, sequence: u64| json!({ "nodeId": id, "sequenceId": sequence, "released": true, "actions": [] });
        let edge = json!({ "edgeId": "e", "sequenceId": 1, "released": true, "actions": [] });
        trace.sent(
            "order",
            &json!({ "orderId": order, "orderUpdateId": 0, "nodes": [node("a", 0), node("b", 2)], "edges": [edge] }),
        );
        let on = |velocity: Option<f64>| {
            let state = json!({
                "orderId": order, "operatingMode": mode, "lastNodeId": "a", "lastNodeSequenceId": 0, "driving": true,
                "nodeStates": [node("b", 2)], "edgeStates": [edge],
            });
            match velocity {
                Some(vx) => merged(state, &json!({ "velocity": { "vx": vx, "vy": 0.0, "omega": 0.0 } })),
                None => state,
            }
        };
        let end: Value = json!({
            "orderId": order, "operatingMode": mode, "lastNodeId": "b", "lastNodeSequenceId": 2,
            "nodeStates": [], "edgeStates": [],
        });
        let start = velocity.map(|_| 0.0);
        trace.state(&on(start)).wait(seconds / 2.0).state(&on(velocity));
        trace.wait(seconds / 2.0).state(&end);
    }

    fn judge(automatic: (f64, Option<f64>), semiautomatic: (f64, Option<f64>)) -> (Vec<String>, usize) {
        let mut trace = Trace::subscriber();
        trace.with.insert("alike".into(), json!(true));
        drive(&mut trace, "AUTOMATIC", automatic.0, automatic.1);
        drive(&mut trace, "SEMIAUTOMATIC", semiautomatic.0, semiautomatic.1);
        let outcome = trace.judge(CHECK);
        (outcome.summary(), outcome.judged)
    }

    #[test]
    fn slower_and_as_fast_are_right() {
        assert_eq!(judge((4.0, Some(1.0)), (8.0, Some(0.5))), (Vec::new(), 1));
        assert_eq!(judge((4.0, Some(1.0)), (3.9, Some(1.05))), (Vec::new(), 1));
    }

    #[test]
    fn one_fast_sample_or_one_slow_drive_before_is_no_proof() {
        assert_eq!(judge((4.0, Some(0.2)), (4.0, Some(1.0))), (Vec::new(), 1));
        assert_eq!(judge((9.0, Some(1.0)), (4.0, Some(1.0))), (Vec::new(), 1));
    }

    #[test]
    fn faster_is_found() {
        assert_eq!(judge((4.0, Some(1.0)), (2.0, Some(2.0))).0, ["-"]);
        assert_eq!(judge((4.0, None), (2.0, None)).0, ["- warning"]);
    }
}
