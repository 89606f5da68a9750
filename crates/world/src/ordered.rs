//! Nodes and edges of an order as checks go through them, bounded.

use tck_base::nurbs::{Curve, Flaw, Written, WrittenPoint};
use tck_view::{ControlPoint, Deviation, Edge, Element, List, Member, Node, Number, OrderView, Text, Trajectory};

/// How many elements of one list are looked at.
pub const ELEMENTS: usize = 2048;

/// The nodes, and the edges, that are looked at.
pub fn elements(order: &OrderView) -> impl Iterator<Item = Element<'_>> {
    let nodes = order.nodes.iter().take(ELEMENTS).map(Element::Node);
    nodes.chain(order.edges.iter().take(ELEMENTS).map(Element::Edge))
}

/// The nodes by sequenceId, where all have one; as they stand otherwise.
#[must_use]
pub fn nodes_in_sequence(order: &OrderView) -> Vec<&Node> {
    in_sequence(order.nodes.elements(), |node| &node.sequence_id)
}

/// The edges by sequenceId, where all have one; as they stand otherwise.
#[must_use]
pub fn edges_in_sequence(order: &OrderView) -> Vec<&Edge> {
    in_sequence(order.edges.elements(), |edge| &edge.sequence_id)
}

fn in_sequence<T>(list: &[T], sequence: impl Fn(&T) -> &Member<Number>) -> Vec<&T> {
    let mut all: Vec<&T> = list.iter().take(ELEMENTS).collect();
    if all.iter().all(|element| sequence(element).whole().is_some()) {
        all.sort_by_key(|element| sequence(element).whole());
    }
    all
}

/// x, y and mapId of a node; without a map, the mapId is empty.
#[must_use]
pub fn place_of(node: &Node) -> Option<(f64, f64, &str)> {
    let position = node.node_position.there()?;
    Some((position.x.float()?, position.y.float()?, position.map_id.or_empty()))
}

/// How far off a vehicle may be where it has reached a node.
#[must_use]
pub fn allowed(node: &Node) -> Option<&Deviation> {
    node.node_position.there()?.allowed_deviation_xy.there()
}

/// Metres by which a vehicle may be off at most where it has reached a node.
#[must_use]
pub fn allowed_deviation(node: &Node) -> Option<f64> {
    allowed(node)?.farthest()
}

/// A short copy of a text; `None` when it is missing or no text.
#[must_use]
pub fn short(member: &Member<Text>) -> Option<String> {
    Some(member.text()?.chars().take(256).collect())
}

/// A number; not a number where something else stands there, and `None` where nothing does.
fn written(member: &Member<Number>) -> Option<f64> {
    (!member.is_absent()).then(|| member.float().unwrap_or(f64::NAN))
}

/// The trajectory of an edge: what is wrong with it, and the curve if it can be calculated with all the same; `None` where there is
/// none. One that is too long to be kept is not calculated with, and one that is no object lacks everything.
#[must_use]
pub fn curve(trajectory: &Member<Box<Trajectory>>) -> Option<(Option<Curve>, Vec<Flaw>)> {
    match trajectory {
        Member::Absent | Member::Null => None,
        Member::Other(_) => Some(read(&Trajectory::default())),
        Member::There(trajectory) => Some(read(trajectory)),
    }
}

fn read(trajectory: &Trajectory) -> (Option<Curve>, Vec<Flaw>) {
    let is_cut = trajectory.knot_vector.there().is_some_and(List::is_cut);
    if is_cut || trajectory.control_points.there().is_some_and(List::is_cut) {
        return (None, Vec::new());
    }
    let point = |point: &ControlPoint| WrittenPoint {
        x: point.x.float(),
        y: point.y.float(),
        weight: written(&point.weight),
    };
    let points = trajectory.control_points.there();
    Curve::read(Written {
        degree: written(&trajectory.degree).filter(|_| !trajectory.degree.is_null()),
        points: points.map(|points| points.iter().map(point).collect()),
        knots: (!trajectory.knot_vector.is_absent() && !trajectory.knot_vector.is_null())
            .then(|| trajectory.knot_vector.floats().unwrap_or_else(|| vec![f64::NAN])),
    })
}
