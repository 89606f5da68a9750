//! `motion/axes`: positions in the coordinates of the project, not in mirrored or swapped ones.

use super::found;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Node, Pose, StateView};
use tck_world::{Fact, Listen, Observation, OrderedPlace, Topic};

/// `motion/axes`.
pub(crate) const AXES: Check = Check {
    name: "motion/axes",
    decides: &["MAP-01"],
    doc: "From one node where the vehicle came to rest to the next one, the reported position changes as the positions \
          of the nodes in the orders do, and not like a mirror image of that. A change that is like neither, or like \
          both, is not judged.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Way],
    needs: &[StateView::position, Node::node_position],
    start: |_| Box::new(Axes::default()),
};

/// Nodes nearer to each other, or wider than this share of the way, tell nothing, in metres.
const SHORTEST: f64 = 0.5;
/// How far the reported way may be from another one that it is taken for, as a share of its length.
const ALIKE: f64 = 0.3;
/// How far a mirror image must be from the right way to be told from it, as a share of its length.
const UNLIKE: f64 = 0.9;

#[derive(Default)]
struct Axes {
    /// Where the vehicle was at rest last, by the order and by its own account.
    rested: Option<(OrderedPlace, Pose)>,
}

/// Mirror images of a way and what they mean.
fn images((x, y): (f64, f64)) -> [((f64, f64), &'static str); 4] {
    [
        ((x, -y), "y mirrored"),
        ((-x, y), "x mirrored"),
        ((-x, -y), "both axes turned round"),
        ((y, x), "x and y swapped"),
    ]
}

fn distance(one: (f64, f64), other: (f64, f64)) -> f64 {
    (one.0 - other.0).hypot(one.1 - other.1)
}

impl Running for Axes {
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
        if !now.base_done || !now.stands() {
            return false;
        }
        let Some((place, pose)) = now
            .node
            .place
            .as_ref()
            .zip(now.pose.as_ref())
            .filter(|(place, pose)| place.map == pose.map_id)
        else {
            return false;
        };
        let Some((from, was)) = self.rested.replace((place.clone(), pose.clone())) else {
            return false;
        };
        let ordered = (place.x - from.x, place.y - from.y);
        let reported = (pose.x - was.x, pose.y - was.y);
        let length = ordered.0.hypot(ordered.1);
        let vague = |place: &OrderedPlace| place.deviation.is_some_and(|allowed| allowed > ALIKE / 2.0 * length);
        if from.map != place.map || length < SHORTEST || vague(&from) || vague(place) {
            return false;
        }
        // A way that looks the same in the mirror proves nothing.
        let images = images(ordered)
            .into_iter()
            .filter(|(image, _)| distance(*image, ordered) >= UNLIKE * length);
        let mut images = images.peekable();
        if distance(reported, ordered) <= ALIKE * length {
            return images.peek().is_some();
        }
        let Some((_, how)) = images.find(|(image, _)| distance(reported, *image) <= ALIKE * length) else {
            return false;
        };
        findings.push(found(
            now.seq,
            format!(
                "the vehicle drove by ({:.2}, {:.2}) m and reports ({:.2}, {:.2}) m: {how}",
                ordered.0, ordered.1, reported.0, reported.1
            ),
        ));
        true
    }
}
