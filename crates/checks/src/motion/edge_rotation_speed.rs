//! `motion/edge-rotation-speed`: maxRotationSpeed of an edge.

use super::{SHARE, found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, StateView};
use tck_world::{Fact, Lane, Listen, Observation, Topic, View, apart};

/// `motion/edge-rotation-speed`.
pub(crate) const EDGE_ROTATION_SPEED: Check = Check {
    name: "motion/edge-rotation-speed",
    decides: &["ORD-MSG-25"],
    doc: "On an edge with maxRotationSpeed, neither omega nor the change of theta says that the vehicle turned \
          faster, with a margin of a tenth and 0.05 rad/s. At the start node the edge has to permit rotation and ask \
          for an orientation, so that the turn belongs to the edge; an excess there is a warning, for the place \
          cannot be told from the node. Not judged at the end node.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::max_rotation_speed, StateView::position],
    start: |_| Box::new(EdgeRotationSpeed::default()),
};

/// What sensors see wrong, in radians per second.
const NOISE: f64 = 0.05;
/// How late what a state shows may be, in seconds.
const LATE: f64 = 0.5;
/// How far an orientation may be wrong, in radians.
const SLACK: f64 = 0.1;

#[derive(Default)]
struct EdgeRotationSpeed {
    accused: Option<(String, u64)>,
}

/// Where a turn belongs.
#[derive(Clone, Copy, PartialEq)]
enum Owner {
    Edge,
    /// The edge by what was ordered, though it is done in the place of the node.
    Start,
}

fn owner(lane: &Lane, view: &View) -> Option<Owner> {
    let pose = view.pose.as_ref()?;
    let along = lane.along(pose)?;
    let belongs = lane.demands.rotation_allowed == Some(true) && lane.demands.orientation.is_some();
    if lane.is_mid_edge(pose) {
        Some(Owner::Edge)
    } else {
        (along.is_at_start() && belongs).then_some(Owner::Start)
    }
}

impl Running for EdgeRotationSpeed {
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
        let Some((lane, limit)) = now
            .lane
            .as_ref()
            .filter(|_| !now.fresh)
            .and_then(|lane| Some((lane, lane.demands.max_rotation_speed?)))
        else {
            return false;
        };
        let Some(mut place) = owner(lane, now) else {
            return false;
        };
        let mut judged = false;
        let mut excess = None;
        if let Some(omega) = now.velocity.omega {
            judged = true;
            if omega.abs() > limit * SHARE + NOISE {
                excess = Some(format!("turns at {:.2} rad/s", omega.abs()));
            }
        }
        if let Some(before) = step.before.as_ref().filter(|before| now.same_lane(before))
            && let Some((there, (then, at))) = owner(lane, before).zip(before.pose.as_ref().zip(now.pose.as_ref()))
        {
            judged = true;
            let turned = apart(then.theta, at.theta);
            let seconds = now.time_since(before).as_secs_f64();
            if turned > limit * SHARE * (seconds + LATE) + SLACK && excess.is_none() {
                excess = Some(format!("turned by {turned:.2} rad in {seconds:.2} s"));
                if there == Owner::Start {
                    place = Owner::Start;
                }
            }
        }
        if let Some(excess) = excess {
            let accused = Some((now.order.clone(), now.node.sequence));
            if self.accused != accused {
                let text = format!("the vehicle {excess} where the edge permits {limit:.2} rad/s");
                findings.push(match place {
                    Owner::Edge => found(now.seq, text),
                    Owner::Start => softly(now.seq, format!("{text}, at its start")),
                });
                self.accused = accused;
            }
        }
        judged
    }
}
