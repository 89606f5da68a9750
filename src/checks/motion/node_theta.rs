//! `motion/node-theta`: the orientation in which a node is reported traversed.

use super::lane::apart;
use super::node_tolerance::margin;
use super::way;
use super::{TURNED, found, softly};
use crate::checks::{Check, CheckContext, CheckFinding, Running};
use crate::journal::Entry;

/// `motion/node-theta`.
pub(in crate::checks) const NODE_THETA: Check = Check {
    name: "motion/node-theta",
    decides: &["ORD-MSG-14", "ORD-MSG-10", "ORD-MSG-11", "NODE-01", "OPT-01"],
    doc: "When a node with theta is reported traversed, the vehicle has that orientation within allowedDeviationTheta, \
          or within 0.1 rad where that is absent or 0. A small excess is a warning, more than 0.35 rad is not. Judged \
          by the first state that shows the node, with a margin for what the vehicle may have turned since the state \
          before, but at the end of the base only for 0.2 s of late reports. Not judged on nodes with actions, \
          which may move the vehicle.",
    arguments: &[],
    start: |_| Box::new(NodeTheta),
};

/// What vehicles usually reach where nothing is said, in radians.
const USUAL: f64 = 0.1;
/// How far an orientation may be wrong, in radians.
const SLACK: f64 = 0.02;

struct NodeTheta;

impl Running for NodeTheta {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(step) = way::step(entry, context) else {
            return false;
        };
        let now = &step.now;
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
        let Some(theta) = place.theta.filter(|_| pose.map == place.map) else {
            return false;
        };
        let allowed = place.deviation_theta.filter(|allowed| *allowed > 0.0).unwrap_or(USUAL);
        let off = apart(pose.theta, theta);
        if off <= allowed + SLACK {
            return true;
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
