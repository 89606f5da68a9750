//! `motion/node-tolerance`: where the vehicle is when it reports a node traversed.

use super::softly;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Node, StateView};
use tck_world::{Fact, Listen, Observation, Topic, View};

/// `motion/node-tolerance`.
pub(crate) const NODE_TOLERANCE: Check = Check {
    name: "motion/node-tolerance",
    decides: &["NODE-01", "ORD-MSG-13", "ORD-MSG-32"],
    doc: "When a node with allowedDeviationXY is reported traversed, the reported position is within it; with 0, within \
          the usual tolerance of the vendor, 0.1 m unless `tolerance` says otherwise. Where it is left out, `absent` is what is meant. Judged by the first state that \
          shows the node: with a margin for the way since the state before, but at the end of the base only for 0.2 s of \
          late reports. Not judged on nodes with actions, which may move the \
          vehicle. Always a warning.",
    arguments: &["tolerance", "absent"],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Node::node_position, StateView::position],
    start: |context| {
        let stated = |name| context.with.get(name).and_then(serde_json::Value::as_f64);
        Box::new(NodeTolerance {
            usual: stated("tolerance").unwrap_or(0.1),
            absent: stated("absent"),
        })
    },
};

/// How far a position may be wrong, in metres.
const SLACK: f64 = 0.05;
/// How late what a state shows may be, in seconds.
const LATE: f64 = 0.2;

struct NodeTolerance {
    /// Tolerance of the vendor, in metres.
    usual: f64,
    /// What a node without allowedDeviationXY allows, in metres; not judged unless said.
    absent: Option<f64>,
}

/// How far the vehicle may have come between passing the node and this state; `None` when nobody can know.
pub(super) fn margin(now: &View, before: &View, speed: impl Fn(&View) -> Option<f64>) -> Option<f64> {
    if now.base_done {
        // It had nowhere else to go: it can only be still on its way to the node.
        return if now.stands() {
            Some(0.0)
        } else {
            Some(speed(now)?.abs() * LATE)
        };
    }
    let fastest = speed(now)?.abs().max(speed(before)?.abs());
    Some(fastest * (now.time_since(before).as_secs_f64() + LATE))
}

impl Running for NodeTolerance {
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
        // Only what was seen to be traversed; where an order begins is another matter.
        let Some(before) = step
            .before
            .as_ref()
            .filter(|before| before.node.sequence < now.node.sequence)
        else {
            return false;
        };
        let Some((pose, place)) = now
            .pose
            .as_ref()
            .zip(now.node.place.as_ref())
            .filter(|_| !now.node.acts)
        else {
            return false;
        };
        let Some(allowed) = place.deviation.or(self.absent).filter(|_| pose.map_id == place.map) else {
            return false;
        };
        let limit = allowed.max(self.usual) + SLACK;
        let distance = place.distance(pose.x, pose.y);
        if distance <= limit {
            return true;
        }
        let Some(margin) = margin(now, before, |view| view.velocity.speed()) else {
            return false;
        };
        if distance <= limit + margin {
            return false;
        }
        findings.push(softly(
            now.seq,
            format!(
                "the node is reported traversed {distance:.2} m away from it; {:.2} m are allowed",
                allowed.max(self.usual)
            ),
        ));
        true
    }
}
