//! `motion/velocity-sign`: vx is positive when the vehicle drives forwards.

use super::found;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic, View, apart};

/// `motion/velocity-sign`.
pub(crate) const VELOCITY_SIGN: Check = Check {
    name: "motion/velocity-sign",
    decides: &["MAP-03"],
    doc: "On a straight edge, the sign of velocity.vx agrees with the change of the reported position, seen in the \
          direction the vehicle points to. Two states in a row have to disagree, for a vehicle may shunt. Judged on \
          the line between the nodes and away from both, and only where the vehicle does not turn.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[StateView::velocity, StateView::position],
    start: |_| Box::new(VelocitySign::default()),
};

/// A shorter way tells nothing, in metres.
const WAY: f64 = 0.1;
/// A slower vehicle tells nothing, in metres per second.
const MOVING: f64 = 0.05;

#[derive(Default)]
struct VelocitySign {
    /// Where the way began that is looked at: some states before, where they come faster than the vehicle moves.
    start: Option<View>,
    suspicious: bool,
}

impl Running for VelocitySign {
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
        let start = self.start.replace(now.clone());
        let Some(start) = start.filter(|start| now.same_lane(start)) else {
            self.suspicious = false;
            return false;
        };
        let (Some(lane), Some(then), Some(pose), Some(vx)) = (&now.lane, &start.pose, &now.pose, now.velocity.vx)
        else {
            return false;
        };
        let steady = apart(then.theta, pose.theta) <= 0.2;
        if !lane.is_mid_edge(pose) || !steady || vx.abs() < MOVING {
            return false;
        }
        let (x, y) = (pose.x - then.x, pose.y - then.y);
        let forwards = x * pose.theta.cos() + y * pose.theta.sin();
        let made = x.hypot(y);
        if made < WAY {
            // So little is looked at together with what follows, if the vehicle goes on in the same direction.
            let turned = start.velocity.vx.is_some_and(|then| then * vx < 0.0);
            self.start = Some(if turned { now.clone() } else { start });
            return false;
        }
        // Sideways it says nothing about forwards.
        if forwards.abs() < 0.7 * made {
            return false;
        }
        let disagrees = (forwards > 0.0) != (vx > 0.0);
        let confirmed = disagrees && self.suspicious;
        if confirmed {
            findings.push(found(
                now.seq,
                format!("vx is {vx:.2} m/s while the vehicle moved {forwards:.2} m in the direction it points to"),
            ));
        }
        self.suspicious = disagrees;
        // One disagreement alone decides nothing.
        !disagrees || confirmed
    }
}
