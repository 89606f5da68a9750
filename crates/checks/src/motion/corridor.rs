//! `motion/corridor`, `motion/corridor-point` and `motion/next-corridor`: how far the vehicle leaves its trajectory.

use serde_json::Value;

use super::node_tolerance::margin;
use super::{found, softly};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, FactsheetView, PhysicalParameters, Pose, StateView};
use tck_world::{Fact, Lane, Listen, Observation, Topic};

/// `motion/corridor`.
pub(crate) const CORRIDOR: Check = Check {
    name: "motion/corridor",
    decides: &["CORR-01", "CORR-03"],
    doc: "On an edge with a trajectory and a corridor, the reported position is not farther from the trajectory than \
          the corridor is wide on that side, with 0.1 m for wrong positions. Judged where the vehicle has left its \
          trajectory by more than 0.15 m: one that never does so proves nothing.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::corridor, Edge::trajectory, StateView::position],
    start: |_| Box::new(Boundaries::of(Point::Centre)),
};

/// `motion/corridor-point`.
pub(crate) const CORRIDOR_POINT: Check = Check {
    name: "motion/corridor-point",
    decides: &["CORR-03"],
    doc: "As motion/corridor, but with corridorRefPoint CONTOUR half the width of the vehicle, as its factsheet gives \
          it, has to be inside as well; without a width that is not judged.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::corridor, Edge::trajectory, StateView::position],
    start: |_| Box::new(Boundaries::of(Point::AsOrdered)),
};

/// `motion/next-corridor`.
pub(crate) const NEXT_CORRIDOR: Check = Check {
    name: "motion/next-corridor",
    decides: &["NODE-02"],
    doc: "When a node is reported traversed, the reported position is inside the corridor of the edge behind it, planned \
          or released, with 0.05 m for wrong positions and a margin for the way since the state before, but at the end \
          of the base only for 0.2 s of late reports. Not judged on nodes with actions. Always a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[Edge::corridor, Edge::trajectory, StateView::position],
    start: |_| Box::new(NextCorridor),
};

/// How far a position may be wrong, in metres.
const SLACK: f64 = 0.1;
/// How far a position on a node may be wrong, where the vehicle is slow, in metres.
const SLACK_ON_NODE: f64 = 0.05;
/// Nearer to its trajectory the vehicle has not left it, in metres.
const LEFT: f64 = 0.15;

/// What has to stay inside.
#[derive(Clone, Copy, PartialEq)]
enum Point {
    Centre,
    AsOrdered,
}

struct Boundaries {
    point: Point,
}

impl Boundaries {
    fn of(point: Point) -> Self {
        Self { point }
    }
}

/// Half the width of the vehicle by its factsheet, in metres.
fn half_width(context: &CheckContext<'_>) -> Option<f64> {
    let sheet = context.bindings.get("device")?.get("factsheet")?;
    let path = [FactsheetView::physical_parameters, PhysicalParameters::width];
    let width = context.pack.names().raw(sheet, &path).and_then(Value::as_f64)?;
    (0.0..100.0).contains(&width).then_some(width / 2.0)
}

/// How far a position is from the trajectory, and how wide the corridor is on that side, in metres.
fn lateral(lane: &Lane, pose: &Pose) -> Option<(f64, f64)> {
    let corridor = lane.demands.corridor?;
    let beside = lane.bend(pose)?.beside;
    Some((
        beside.distance,
        if beside.left { corridor.left } else { corridor.right },
    ))
}

impl Running for Boundaries {
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
        let Some((distance, width)) = lateral(lane, pose).filter(|(distance, _)| *distance > LEFT) else {
            return false;
        };
        let contour = self.point == Point::AsOrdered && lane.demands.corridor.is_some_and(|corridor| corridor.contour);
        let taken = if contour { half_width(context) } else { Some(0.0) };
        let Some(taken) = taken else { return false };
        if distance + taken > width + SLACK {
            let what = if contour {
                "the contour of the vehicle"
            } else {
                "the vehicle"
            };
            let reach = distance + taken;
            findings.push(found(
                now.seq,
                format!("{what} reaches {reach:.2} m beside the trajectory, in a corridor of {width:.2} m"),
            ));
        }
        true
    }
}

struct NextCorridor;

impl Running for NextCorridor {
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
            .filter(|before| before.node.sequence < now.node.sequence && !now.node.acts)
        else {
            return false;
        };
        let lateral = now
            .ahead
            .as_ref()
            .zip(now.pose.as_ref())
            .and_then(|(lane, pose)| lateral(lane, pose));
        let Some((distance, width)) = lateral else {
            return false;
        };
        if distance <= width + SLACK_ON_NODE {
            return true;
        }
        let Some(margin) = margin(now, before, |view| view.velocity.speed()) else {
            return false;
        };
        if distance <= width + SLACK_ON_NODE + margin {
            return false;
        }
        findings.push(softly(
            now.seq,
            format!(
                "the node is reported traversed {distance:.2} m beside the trajectory behind it, whose corridor is \
                 {width:.2} m wide there"
            ),
        ));
        true
    }
}
