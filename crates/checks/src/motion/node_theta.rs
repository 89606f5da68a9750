//! `motion/node-theta`: the orientation in which a node is reported traversed.

use super::node_tolerance::margin;
use super::{TURNED, found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Node, StateView};
use tck_world::{Fact, Listen, Observation, Topic, View, apart};

/// `motion/node-theta`.
pub(crate) const NODE_THETA: Check = Check {
    name: "motion/node-theta",
    decides: &[
        "ORD-MSG-14",
        "ORD-MSG-10",
        "ORD-MSG-11",
        "ORD-MSG-33",
        "NODE-01",
        "OPT-01",
    ],
    doc: "When a node with theta is reported traversed, the vehicle has that orientation within allowedDeviationTheta, \
          or within 0.1 rad where that is absent or 0. A small excess is a warning, more than 0.35 rad is not. Judged \
          by the first state that shows the node, with a margin for what the vehicle may have turned since the state \
          before. A vehicle that still turns at the end of its base when it reports the node is judged by the first state \
          in which it stands there, and warned. Not judged on nodes with actions, which may move the vehicle.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Node::node_position, StateView::position],
    start: |_| Box::new(NodeTheta::default()),
};

/// What vehicles usually reach where nothing is said, in radians.
const USUAL: f64 = 0.1;
/// How far an orientation may be wrong, in radians.
const SLACK: f64 = 0.02;
/// A vehicle farther from the node than this, in metres, has left it again, and may have turned since.
const ON_NODE: f64 = 0.1;

#[derive(Default)]
struct NodeTheta {
    turning: Option<Turning>,
}

/// A vehicle that has reported the last node of its base and may still turn there.
struct Turning {
    order: String,
    sequence: u64,
    theta: f64,
    allowed: f64,
}

impl Turning {
    /// What the state in which it stands shows; whether this is such a state.
    fn end(&self, now: &View, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(pose) = now.pose.as_ref().filter(|_| now.stands()) else {
            return false;
        };
        let (theta, allowed) = (self.theta, self.allowed);
        let off = apart(pose.theta, theta);
        findings.push(if off <= allowed + SLACK {
            softly(
                now.seq,
                format!("the vehicle turned to theta {theta:.2} only after it had reported the node traversed"),
            )
        } else {
            let text = format!(
                "the vehicle stands on the node with theta {:.2} instead of {theta:.2} within {allowed:.2}",
                pose.theta
            );
            match off > allowed + TURNED {
                true => found(now.seq, text),
                false => softly(now.seq, text),
            }
        });
        true
    }
}

impl Running for NodeTheta {
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
        let turning = self.turning.take();
        self.turning = turning.filter(|one| one.order == now.order && one.sequence == now.node.sequence);
        if self.turning.as_ref().is_some_and(|turning| turning.end(now, findings)) {
            self.turning = None;
            return true;
        }
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
        let Some(theta) = place.theta.filter(|_| pose.map_id == place.map) else {
            return false;
        };
        let allowed = place.deviation_theta.filter(|allowed| *allowed > 0.0).unwrap_or(USUAL);
        let off = apart(pose.theta, theta);
        if off <= allowed + SLACK {
            return true;
        }
        if !now.base_done && (pose.x - place.x).hypot(pose.y - place.y) > ON_NODE {
            return false;
        }
        if now.base_done && !now.stands() {
            self.turning = Some(Turning {
                order: now.order.clone(),
                sequence: now.node.sequence,
                theta,
                allowed,
            });
            return false;
        }
        let Some(margin) = margin(now, before, |view| view.velocity.omega) else {
            return false;
        };
        if off <= allowed + SLACK + margin {
            return false;
        }
        let text = format!(
            "the node is reported traversed with theta {:.2} instead of {theta:.2} within {allowed:.2}",
            pose.theta
        );
        findings.push(if off > allowed + margin + TURNED {
            found(now.seq, text)
        } else {
            softly(now.seq, text)
        });
        true
    }
}
