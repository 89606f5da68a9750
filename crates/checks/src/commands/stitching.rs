//! Where an update begins: at the last released node, as it was sent before.

use std::collections::BTreeMap;

use super::{Found, edges_in_sequence, elements, nodes_in_sequence, short};
use crate::finding::quote;
use tck_view::{Deviation, Field, Member, Node, NodePosition, Number, OrderView, Print};
use tck_world::ordered::ELEMENTS;

/// The released elements of a message: sequenceId and id.
pub(super) fn base(order: &OrderView) -> impl Iterator<Item = (u64, String)> {
    let base = elements(order).filter(|element| element.released().is(true));
    base.filter_map(|element| Some((element.sequence_id().whole()?, short(element.id())?)))
}

/// Finds an update that does not begin with the last released node; `known` are the released elements so far.
pub(super) fn elsewhere(
    known: &BTreeMap<u64, String>,
    (end_id, end_sequence): (&str, u64),
    message: &OrderView,
    first: &Node,
    found: &mut Found<'_>,
) {
    let shown = quote(first.node_id.or_empty());
    let Some(sequence) = first.sequence_id.whole() else {
        return;
    };
    let wanted = format!("{} with sequenceId {}", quote(end_id), end_sequence);
    let text_of = |what: &str| format!("the update begins with node {shown}, sequenceId {sequence}, {what} {wanted}");
    found.broken("ORD-UPD-05", text_of("and not with"));
    if first.node_id.or_empty() == end_id {
        found.broken("ORD-UPD-12", text_of("which was"));
        return;
    }
    let repeats = base(message).any(|(sequence, _)| sequence < end_sequence && known.contains_key(&sequence));
    let replaces = sequence == end_sequence;
    if repeats || replaces {
        found.broken("ORD-UPD-03", text_of("though the base ended with"));
    }
}

/// Edges of an update that have numbers from before its first node, which other elements had already.
pub(super) fn counted_back(message: &OrderView, first: &Node, found: &mut Found<'_>) {
    let (nodes, edges) = (nodes_in_sequence(message), edges_in_sequence(message));
    let Some(begins) = first.sequence_id.whole().filter(|_| nodes.len() == edges.len() + 1) else {
        return;
    };
    let back = edges
        .into_iter()
        .find_map(|edge| Some((edge, edge.sequence_id.whole().filter(|sequence| *sequence < begins)?)));
    if let Some((edge, sequence)) = back {
        let id = quote(edge.edge_id.or_empty());
        let text = format!("edge {id} of an update that begins with sequenceId {begins} has sequenceId {sequence}");
        found.broken("ORD-UPD-12", text);
    }
}

/// What became of a member.
#[derive(Clone, Copy)]
enum Change {
    No,
    /// It has another value.
    Other,
    /// It was not there before, or is not there any more.
    CameOrWent,
}

impl Change {
    fn of<T: PartialEq>(old: &Member<T>, new: &Member<T>, number: impl Fn(&T) -> Option<f64>) -> Self {
        let float = |member: &Member<T>| member.there().and_then(&number);
        let differ = match (float(old), float(new)) {
            (Some(old), Some(new)) => (old - new).abs() > 1.0e-6,
            _ => old != new,
        };
        match differ {
            false => Self::No,
            true if old.is_absent() || new.is_absent() => Self::CameOrWent,
            true => Self::Other,
        }
    }
}

/// What became of the place of a node.
fn moved(old: &NodePosition, new: &NodePosition) -> [(Field, Change); 6] {
    let float = |number: &Number| Some(number.float());
    let (xy, theta) = (&old.allowed_deviation_xy, &old.allowed_deviation_theta);
    [
        (NodePosition::x, Change::of(&old.x, &new.x, float)),
        (NodePosition::y, Change::of(&old.y, &new.y, float)),
        (NodePosition::theta, Change::of(&old.theta, &new.theta, float)),
        (
            NodePosition::allowed_deviation_xy,
            Change::of(xy, &new.allowed_deviation_xy, Deviation::farthest),
        ),
        (
            NodePosition::allowed_deviation_theta,
            Change::of(theta, &new.allowed_deviation_theta, float),
        ),
        (NodePosition::map_id, Change::of(&old.map_id, &new.map_id, |_| None)),
    ]
}

/// A stitching node against its first transmission, all of which has to be repeated where that is `strict`.
pub(super) fn stitched(before: &Node, now: &Node, strict: bool, found: &mut Found<'_>) {
    let tell = |found: &mut Found<'_>, text: String| match strict {
        true => found.broken("ORD-UPD-06", text),
        false => found.remark("ORD-UPD-06", text),
    };
    let id = quote(now.node_id.or_empty());
    if !now.released.is(true) {
        found.broken("ORD-UPD-06", format!("stitching node {id} is not released any more"));
    }
    match (before.node_position.there(), now.node_position.there()) {
        (Some(before), Some(now)) => {
            for (field, change) in moved(before, now) {
                let text = format!("{} of stitching node {id} has changed", field.usual_name());
                match change {
                    Change::No => {}
                    Change::Other => found.broken("ORD-UPD-06", text),
                    Change::CameOrWent => tell(found, text),
                }
            }
        }
        (None, None) => {}
        _ => tell(found, format!("nodePosition of stitching node {id} came or went")),
    }
    let prints = |node: &Node| -> Vec<Print> {
        let actions = node.actions.iter().take(ELEMENTS);
        actions.map(|action| action.essence).collect()
    };
    let (old, new) = (prints(before), prints(now));
    if new.iter().any(|action| !old.contains(action)) {
        if strict {
            let text = format!("further actions are put into the stitching node {id}, and not into a node behind it");
            found.broken("ORD-UPD-15", text);
        }
        found.broken(
            "ORD-UPD-06",
            format!("stitching node {id} has other actions than before"),
        );
    } else if old.iter().any(|action| !new.contains(action)) {
        tell(found, format!("stitching node {id} has lost actions"));
    }
}
