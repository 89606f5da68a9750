//! `motion/trajectory-disregarded`: a freely navigating vehicle takes the trajectory that it was sent, and no way of its own.

use crate::finding::{broken, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `motion/trajectory-disregarded`.
pub(crate) const FOLLOWED: Check = Check {
    name: "motion/trajectory-disregarded",
    decides: &["ORD-18"],
    doc: "On an edge with a trajectory and without a corridor the reported position is within 0.25 m of the curve, where that is \
          more than 0.3 m away from the straight line; more is a warning. Who is seen on the straight line in two places, and \
          nowhere on the curve, disregards it. Judged away from the nodes only.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::trajectory, StateView::position],
    start: |_| Box::new(Followed::default()),
};

/// How far beside its curve a vehicle follows it, in metres.
const NEAR: f64 = 0.25;
/// How far the curve has to be from the straight line to be told from it, in metres.
const ASIDE: f64 = 0.3;
/// How near to the straight line a vehicle drives straight on, in metres.
const STRAIGHT: f64 = 0.15;
/// Two places so far apart are two, in metres.
const APART: f64 = 0.1;

#[derive(Default)]
struct Followed {
    /// It was seen on the curve, where that is no straight line.
    curved: bool,
    /// Where it was seen on the straight line.
    straight: Option<(f64, f64)>,
    told: bool,
    failed: bool,
}

impl Running for Followed {
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
        let bend = lane.bend(pose);
        let Some(bend) = bend.filter(|bend| bend.is_mid_edge && lane.demands.corridor.is_none()) else {
            return false;
        };
        if bend.beside.distance <= NEAR {
            self.curved |= bend.aside > ASIDE;
            return bend.aside > ASIDE;
        }
        let text = format!(
            "the vehicle is {:.2} m away from the trajectory that its edge was sent with",
            bend.beside.distance
        );
        if !self.told {
            self.told = true;
            findings.push(remark("ORD-18", now.seq, text.clone()));
        }
        if lane.along(pose).is_some_and(|along| along.off <= STRAIGHT) {
            let first = *self.straight.get_or_insert((pose.x, pose.y));
            let apart = (first.0 - pose.x).hypot(first.1 - pose.y) >= APART;
            if apart && !self.curved && !self.failed {
                self.failed = true;
                findings.push(broken("ORD-18", now.seq, format!("{text}, and goes straight on")));
            }
        }
        true
    }
}
