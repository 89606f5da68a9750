//! `motion/trajectory` and `motion/curve-orientation`: edges that are no straight lines.

use super::{TURNED, found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, StateView};
use tck_world::{Fact, Listen, Observation, Topic, apart, wrapped};

/// `motion/trajectory`.
pub(crate) const TRAJECTORY: Check = Check {
    name: "motion/trajectory",
    decides: &["ORD-MSG-26"],
    doc: "On an edge with a trajectory and without a corridor, the reported position is within 0.25 m of the curve. \
          Judged away from the nodes only; a position near the curve proves something only where the curve is more \
          than 0.3 m away from the straight line.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::trajectory, StateView::position],
    start: |_| Box::new(Trajectory),
};

/// `motion/curve-orientation`.
pub(crate) const CURVE_ORIENTATION: Check = Check {
    name: "motion/curve-orientation",
    decides: &["ORD-MSG-23"],
    doc: "On an edge with a trajectory and a tangential orientation, theta is that orientation against the direction of \
          the curve. More than 0.25 rad beside it is a warning, more than 0.35 rad is another orientation. Judged on \
          the curve, in the second half of the edge and away from the nodes, where the curve points elsewhere than the \
          straight line, and not if the end node asks for an orientation of its own.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::trajectory, Edge::orientation, StateView::position],
    start: |_| Box::new(CurveOrientation),
};

/// How far beside its curve a vehicle follows it, in metres.
const NEAR: f64 = 0.25;
/// How far the curve has to be from the straight line to be told from it, in metres.
const ASIDE: f64 = 0.3;
/// A theta this near is right, in radians.
const RIGHT: f64 = 0.25;

struct Trajectory;

impl Running for Trajectory {
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
        let Some(bend) = lane
            .bend(pose)
            .filter(|bend| bend.is_mid_edge && lane.demands.corridor.is_none())
        else {
            return false;
        };
        if bend.beside.distance <= NEAR {
            return bend.aside > ASIDE;
        }
        let text = format!(
            "the vehicle is {:.2} m away from the trajectory of its edge",
            bend.beside.distance
        );
        findings.push(found(now.seq, text));
        true
    }
}

struct CurveOrientation;

impl Running for CurveOrientation {
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
        let orientation = lane.demands.orientation.filter(|_| !lane.demands.global);
        let Some((orientation, straight)) = orientation.zip(lane.heading()) else {
            return false;
        };
        let Some(bend) = lane
            .bend(pose)
            .filter(|bend| bend.is_mid_edge && bend.beside.distance <= NEAR)
        else {
            return false;
        };
        let turns_for_node = lane.to.place.as_ref().is_none_or(|place| place.theta.is_some());
        let telling = apart(bend.beside.heading, straight) > TURNED;
        if !telling || turns_for_node || bend.beside.made < bend.length / 2.0 {
            return false;
        }
        let wanted = wrapped(bend.beside.heading + orientation);
        let off = apart(pose.theta, wanted);
        let text = format!("theta is {:.2} where the curve asks for {wanted:.2}", pose.theta);
        if off > TURNED {
            findings.push(found(now.seq, text));
        } else if off > RIGHT {
            findings.push(softly(now.seq, text));
        }
        true
    }
}
