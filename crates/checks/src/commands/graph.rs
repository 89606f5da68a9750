//! Nodes and edges of an order: how many, which are released, how they hang together and how they are counted.

use std::collections::BTreeSet;

use serde_json::Value;

use super::{Command, Each, Found, in_sequence, released, short};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::{elements, number, text};
use tck_world::{Listen, Observation, Topic};

/// `commands/nodes-and-edges`.
pub(crate) const NODES_AND_EDGES: Check = Check {
    name: "commands/nodes-and-edges",
    decides: &["ORD-02"],
    doc: "Every order has at least one node and exactly one edge fewer than nodes.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    start: |_| Each::start(nodes_and_edges),
};

/// `commands/released`.
pub(crate) const RELEASED: Check = Check {
    name: "commands/released",
    decides: &["ORD-08", "ORD-09"],
    doc: "No released edge touches a node that is not released, and behind the first element that is not released \
          none is. An order that releases nothing at all is a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    start: |_| Each::start(base_and_horizon),
};

/// `commands/edge-ends`.
pub(crate) const EDGE_ENDS: Check = Check {
    name: "commands/edge-ends",
    decides: &["ORD-MSG-19"],
    doc: "startNodeId and endNodeId of every edge name the nodes directly before and behind it. Judged where there is \
          one edge fewer than nodes.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    start: |_| Each::start(edge_ends),
};

/// `commands/sequence`.
pub(crate) const SEQUENCE: Check = Check {
    name: "commands/sequence",
    decides: &["ORD-UPD-11"],
    doc: "The sequenceIds of nodes and edges together alternate and count up by one, and a new orderId begins with 0. \
          Where an update begins is left to commands/updates.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    start: |_| Box::new(Sequence::default()),
};

/// How many orders are remembered.
const ORDERS: usize = 256;

fn nodes_and_edges(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    // What was meant for another topic is no order.
    if order.get("nodes").is_none() && order.get("orderId").is_none() {
        return false;
    }
    let (nodes, edges) = (elements(order, "nodes").count(), elements(order, "edges").count());
    if nodes == 0 {
        found.broken("ORD-02", "the order has no node");
    } else if edges + 1 != nodes {
        found.broken("ORD-02", format!("the order has {nodes} nodes and {edges} edges"));
    }
    true
}

/// Whether the sequenceIds of nodes and edges together alternate and count up by one. An order that is counted otherwise is a
/// mistake of its own, and no measure for what is sent after it.
pub(super) fn is_counted(order: &Value) -> bool {
    let of = |list, is_edge| {
        let all = elements(order, list).take(super::ELEMENTS);
        all.map(move |element| Some((number(element, "sequenceId")?, is_edge)))
    };
    let all: Option<Vec<(u64, bool)>> = of("nodes", false).chain(of("edges", true)).collect();
    let Some(mut all) = all else { return false };
    all.sort_unstable();
    let alternates = |pair: &[(u64, bool)]| pair[0].0.checked_add(1) == Some(pair[1].0) && pair[0].1 != pair[1].1;
    all.first().is_some_and(|(_, is_edge)| !is_edge) && all.windows(2).all(alternates)
}

/// Nodes and edges alternating, if there is one edge fewer.
fn chain(order: &Value) -> Option<Vec<(bool, &Value)>> {
    let (nodes, edges) = (in_sequence(order, "nodes"), in_sequence(order, "edges"));
    if nodes.len() != edges.len() + 1 {
        return None;
    }
    let mut chain = Vec::with_capacity(nodes.len() + edges.len());
    let mut edges = edges.into_iter();
    for node in nodes {
        chain.push((false, node));
        chain.extend(edges.next().map(|edge| (true, edge)));
    }
    Some(chain)
}

fn base_and_horizon(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(chain) = command.order().and_then(chain) else {
        return false;
    };
    let flags: Option<Vec<bool>> = chain.iter().map(|(_, element)| released(element)).collect();
    let Some(flags) = flags else { return false };
    if flags.iter().all(|released| !released) {
        found.remark("ORD-09", "the order releases nothing");
        return true;
    }
    let touching = flags.windows(3).zip(&chain[1..]);
    for (flags, (is_edge, element)) in touching {
        if *is_edge && flags[1] && !(flags[0] && flags[2]) {
            let id = quote(text(element, "edgeId"));
            found.broken("ORD-08", format!("edge {id} is released, and a node of it is not"));
        }
    }
    let horizon = flags.iter().position(|released| !released);
    if let Some(horizon) = horizon {
        // A released edge that leads into the horizon is the business of ORD-08; the horizon begins behind it.
        if let Some(at) = flags[horizon..].iter().position(|released| *released) {
            let id = text(
                chain[horizon + at].1,
                if chain[horizon + at].0 { "edgeId" } else { "nodeId" },
            );
            found.broken("ORD-09", format!("{} is released behind the horizon", quote(id)));
        }
    }
    true
}

fn edge_ends(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    let (nodes, edges) = (in_sequence(order, "nodes"), in_sequence(order, "edges"));
    if edges.is_empty() || nodes.len() != edges.len() + 1 {
        return false;
    }
    let mut judged = false;
    for (edge, ends) in edges.iter().zip(nodes.windows(2)) {
        for (name, node) in [("startNodeId", ends[0]), ("endNodeId", ends[1])] {
            let named = edge.get(name).and_then(Value::as_str);
            let Some((named, is)) = named.zip(node.get("nodeId").and_then(Value::as_str)) else {
                continue;
            };
            judged = true;
            if named != is {
                let id = quote(text(edge, "edgeId"));
                found.broken(
                    "ORD-MSG-19",
                    format!(
                        "{name} of edge {id} is {}, the node there is {}",
                        quote(named),
                        quote(is)
                    ),
                );
            }
        }
    }
    judged
}

#[derive(Default)]
struct Sequence {
    /// Orders that were begun before.
    known: BTreeSet<String>,
}

impl Running for Sequence {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let is_known = short(order, "orderId").is_none_or(|id| {
            if self.known.len() == ORDERS {
                self.known.pop_first();
            }
            !self.known.insert(id)
        });
        let mut all = Vec::new();
        for list in ["nodes", "edges"] {
            for element in elements(order, list).take(super::ELEMENTS) {
                let Some(written) = element.get("sequenceId") else {
                    return false;
                };
                let Some(sequence) = number(element, "sequenceId") else {
                    if written.is_number() {
                        let text = format!("sequenceId {written} is no whole number");
                        Found::new(record, findings).broken("ORD-UPD-11", text);
                    }
                    return written.is_number();
                };
                all.push((sequence, list == "edges"));
            }
        }
        all.sort_unstable();
        let Some((first, begins_with_edge)) = all.first().copied() else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let begins = !is_known && number(order, "orderUpdateId").is_none_or(|update| update == 0);
        if begins && first != 0 {
            found.broken(
                "ORD-UPD-11",
                format!("the sequenceIds of a new order begin with {first}"),
            );
        }
        let broken = all
            .windows(2)
            .find(|pair| pair[0].0.checked_add(1) != Some(pair[1].0) || pair[0].1 == pair[1].1);
        if let Some(pair) = broken {
            let text = format!("sequenceId {} follows {} along nodes and edges", pair[1].0, pair[0].0);
            found.broken("ORD-UPD-11", text);
        } else if begins_with_edge {
            found.broken("ORD-UPD-11", "the lowest sequenceId is that of an edge");
        }
        true
    }
}
