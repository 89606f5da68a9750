//! `motion/rotation-place`: no turning on an edge that forbids rotation, or wants it done before.

use super::{TURNED, found};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic, View, apart};

/// `motion/rotation-place`.
pub(crate) const ROTATION_PLACE: Check = Check {
    name: "motion/rotation-place",
    decides: &["ORD-MSG-24", "ORD-MSG-12", "ORD-MSG-11"],
    doc: "On a straight edge with rotationAllowed false, or with reachOrientationBeforeEntering true and an orientation, theta stays what it was, and where the edge asks for an \
          orientation, it is that from the start: the vehicle turns on the nodes. Judged on the line between the nodes \
          and away from both, with 0.35 rad for what following a line needs.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[StateView::position],
    start: |_| Box::new(RotationPlace::default()),
};

#[derive(Default)]
struct RotationPlace {
    /// The first state on the present edge alone.
    first: Option<View>,
}

impl Running for RotationPlace {
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
        if lane.demands.rotation_allowed != Some(false) || !lane.is_mid_edge(pose) {
            return false;
        }
        let first = self.first.as_ref().filter(|first| now.same_lane(first));
        let was = first.and_then(|first| first.pose.as_ref()).map(|pose| pose.theta);
        let wanted = lane.wanted_orientation();
        let text = match (was, wanted) {
            (Some(was), _) if apart(was, pose.theta) > TURNED => Some(format!(
                "theta was {was:.2} and is {:.2} on an edge that forbids rotation",
                pose.theta
            )),
            (_, Some(wanted)) if apart(wanted, pose.theta) > TURNED => Some(format!(
                "theta is {:.2} on an edge that forbids rotation and asks for {wanted:.2}",
                pose.theta
            )),
            _ => None,
        };
        let judged = was.is_some() || wanted.is_some();
        findings.extend(text.map(|text| found(now.seq, text)));
        if was.is_none() {
            self.first = Some(now.clone());
        }
        judged
    }
}
