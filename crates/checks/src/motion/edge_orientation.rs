//! `motion/edge-orientation`: the orientation an edge asks for, against the map or against the way.

use super::{TURNED, found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, StateView};
use tck_world::{Fact, Listen, Observation, Topic, apart};

/// `motion/edge-orientation`.
pub(crate) const EDGE_ORIENTATION: Check = Check {
    name: "motion/edge-orientation",
    decides: &["ORD-MSG-22", "ORD-MSG-23", "OPT-01"],
    doc: "On a straight edge with an orientation, theta is that orientation (GLOBAL), or that orientation against the \
          line between the nodes (TANGENTIAL, and without a type). More than 0.2 rad beside it is a warning, more \
          than 0.35 rad is another orientation. Judged on the line and away from the nodes only; where the edge \
          permits rotation, only in its second half, while the vehicle does not turn, and not if the end node asks \
          for an orientation of its own.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::orientation, StateView::position],
    start: |_| Box::new(EdgeOrientation),
};

/// A theta this near is right, in radians.
const RIGHT: f64 = 0.2;
/// A vehicle that turns slower does not turn, in radians per second, and between two states in radians.
const STEADY: f64 = 0.05;

struct EdgeOrientation;

impl Running for EdgeOrientation {
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
        let Some((lane, pose)) = now.lane.as_ref().zip(now.pose.as_ref()) else {
            return false;
        };
        let Some(wanted) = lane.wanted_orientation().filter(|_| lane.is_mid_edge(pose)) else {
            return false;
        };
        if lane.demands.rotation_allowed != Some(false) {
            let past_half = lane.along(pose).is_some_and(|along| along.made > along.length / 2.0);
            let before = step.before.as_ref().filter(|before| now.same_lane(before));
            let steady = match (now.velocity.omega, before.and_then(|before| before.pose.as_ref())) {
                (Some(omega), _) => omega.abs() <= STEADY,
                (None, Some(then)) => apart(then.theta, pose.theta) <= STEADY,
                (None, None) => false,
            };
            let turns_for_node = lane.to.place.as_ref().is_none_or(|place| place.theta.is_some());
            if !past_half || !steady || turns_for_node {
                return false;
            }
        }
        let off = apart(pose.theta, wanted);
        let text = format!("theta is {:.2} on an edge where {wanted:.2} was asked for", pose.theta);
        if off > TURNED {
            findings.push(found(now.seq, text));
        } else if off > RIGHT {
            findings.push(softly(now.seq, text));
        }
        true
    }
}
