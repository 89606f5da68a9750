//! `motion/back-on-edge`: behind a node with a wide deviation range the vehicle is on the line of its next edge again.

use super::found;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Node, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `motion/back-on-edge`.
pub(crate) const BACK_ON_EDGE: Check = Check {
    name: "motion/back-on-edge",
    decides: &["NODE-08"],
    doc: "Behind a node with a deviation range of half a metre or more, a position outside of it is within 0.3 m of the next edge: the \
          straight line to its end node, which has to be what the vehicle drives on. Judged on an edge without a trajectory and a \
          corridor, and from 0.1 m beyond the range on.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Node::node_position, StateView::position],
    start: |_| Box::new(BackOnEdge { told: false }),
};

/// A smaller range leaves no room for a corner to be cut, in metres.
const WIDE: f64 = 0.5;
/// How far beyond the range it is left for certain, in metres.
const LEFT: f64 = 0.1;
/// How far beside its line a vehicle is on it, in metres.
const BESIDE: f64 = 0.3;

struct BackOnEdge {
    told: bool,
}

impl Running for BackOnEdge {
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
        let straight = !lane.demands.curved && lane.demands.corridor.is_none();
        let place = lane.from.place.as_ref().filter(|_| straight && !lane.from.acts);
        let Some((place, range)) =
            place.and_then(|place| Some((place, place.deviation.filter(|range| *range >= WIDE)?)))
        else {
            return false;
        };
        let Some(along) = lane.along(pose) else { return false };
        if place.distance(pose.x, pose.y) <= range + LEFT || along.made >= along.length {
            return false;
        }
        if along.off > BESIDE && !self.told {
            self.told = true;
            let text = format!(
                "the vehicle has left the deviation range of its node, and is {:.2} m beside its next edge",
                along.off
            );
            findings.push(found(now.seq, text));
        }
        true
    }
}
