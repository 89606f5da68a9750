//! Where an update begins: at the last released node, as it was sent before.

use std::collections::BTreeMap;

use serde_json::Value;

use super::{Found, in_sequence, released, short};
use crate::finding::quote;
use tck_world::members::{ELEMENTS, elements, number, text};
use tck_world::print;

/// The released elements of a message: sequenceId and id.
pub(super) fn base(order: &Value) -> impl Iterator<Item = (u64, String)> {
    [("nodes", "nodeId"), ("edges", "edgeId")]
        .into_iter()
        .flat_map(move |(list, id)| {
            let all = elements(order, list).take(ELEMENTS);
            let base = all.filter(|element| released(element) == Some(true));
            base.filter_map(move |element| Some((number(element, "sequenceId")?, short(element, id)?)))
        })
}

/// Finds an update that does not begin with the last released node; `known` are the released elements so far.
pub(super) fn elsewhere(
    known: &BTreeMap<u64, String>,
    (end_id, end_sequence): (&str, u64),
    message: &Value,
    first: &Value,
    found: &mut Found<'_>,
) {
    let shown = quote(text(first, "nodeId"));
    let Some(sequence) = number(first, "sequenceId") else {
        return;
    };
    let wanted = format!("{} with sequenceId {}", quote(end_id), end_sequence);
    let text_of = |what: &str| format!("the update begins with node {shown}, sequenceId {sequence}, {what} {wanted}");
    found.broken("ORD-UPD-05", text_of("and not with"));
    if text(first, "nodeId") == end_id {
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
pub(super) fn counted_back(message: &Value, first: &Value, found: &mut Found<'_>) {
    let (nodes, edges) = (in_sequence(message, "nodes"), in_sequence(message, "edges"));
    let Some(begins) = number(first, "sequenceId").filter(|_| nodes.len() == edges.len() + 1) else {
        return;
    };
    let back = edges
        .into_iter()
        .find_map(|edge| Some((edge, number(edge, "sequenceId").filter(|sequence| *sequence < begins)?)));
    if let Some((edge, sequence)) = back {
        let id = quote(text(edge, "edgeId"));
        let text = format!("edge {id} of an update that begins with sequenceId {begins} has sequenceId {sequence}");
        found.broken("ORD-UPD-12", text);
    }
}

/// A stitching node against its first transmission.
pub(super) fn stitched(before: &Value, now: &Value, found: &mut Found<'_>) {
    let id = quote(text(now, "nodeId"));
    if released(now) != Some(true) {
        found.broken("ORD-UPD-06", format!("stitching node {id} is not released any more"));
    }
    let position = |node: &Value| {
        node.get("nodePosition")
            .filter(|position| position.is_object())
            .cloned()
    };
    match (position(before), position(now)) {
        (Some(before), Some(now)) => {
            for name in [
                "x",
                "y",
                "theta",
                "allowedDeviationXY",
                "allowedDeviationTheta",
                "mapId",
            ] {
                let (old, new) = (before.get(name), now.get(name));
                let differ = match (old.and_then(Value::as_f64), new.and_then(Value::as_f64)) {
                    (Some(old), Some(new)) => (old - new).abs() > 1.0e-6,
                    _ => old != new,
                };
                if !differ {
                    continue;
                }
                let text = format!("{name} of stitching node {id} has changed");
                if old.is_some() && new.is_some() {
                    found.broken("ORD-UPD-06", text);
                } else {
                    found.remark("ORD-UPD-06", text);
                }
            }
        }
        (None, None) => {}
        _ => found.remark(
            "ORD-UPD-06",
            format!("nodePosition of stitching node {id} came or went"),
        ),
    }
    let prints = |node: &Value| -> Vec<u64> {
        elements(node, "actions")
            .take(ELEMENTS)
            .map(|action| print::without(action, &["actionDescription"]))
            .collect()
    };
    let (old, new) = (prints(before), prints(now));
    if new.iter().any(|action| !old.contains(action)) {
        found.broken(
            "ORD-UPD-06",
            format!("stitching node {id} has other actions than before"),
        );
    } else if old.iter().any(|action| !new.contains(action)) {
        found.remark("ORD-UPD-06", format!("stitching node {id} has lost actions"));
    }
}
