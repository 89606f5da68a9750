//! Nodes and edges of an order: how many, which are released, how they hang together and how they are counted.

use std::collections::BTreeSet;

use super::{Command, Each, Found, edges_in_sequence, elements, nodes_in_sequence, short};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Edge, Element, Node, OrderView};
use tck_world::{Listen, Observation, Topic};

/// `commands/nodes-and-edges`.
pub(crate) const NODES_AND_EDGES: Check = Check {
    name: "commands/nodes-and-edges",
    decides: &["ORD-02"],
    doc: "Every order has at least one node and exactly one edge fewer than nodes.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[OrderView::nodes, OrderView::edges],
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
    needs: &[Node::released, Edge::released],
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
    needs: &[Node::node_id, Edge::start_node_id, Edge::end_node_id],
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
    needs: &[Node::sequence_id, Edge::sequence_id],
    start: |_| Box::new(Sequence::default()),
};

/// How many orders are remembered.
const ORDERS: usize = 256;

fn nodes_and_edges(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    // What was meant for another topic is no order.
    if order.nodes.is_absent() && order.order_id.is_absent() {
        return false;
    }
    let (nodes, edges) = (order.nodes.total(), order.edges.total());
    if nodes == 0 {
        found.broken("ORD-02", "the order has no node");
    } else if edges + 1 != nodes {
        found.broken("ORD-02", format!("the order has {nodes} nodes and {edges} edges"));
    }
    true
}

/// Whether the sequenceIds of nodes and edges together alternate and count up by one. An order that is counted otherwise is a
/// mistake of its own, and no measure for what is sent after it.
pub(super) fn is_counted(order: &OrderView) -> bool {
    let place = |element: Element<'_>| Some((element.sequence_id().whole()?, element.is_edge()));
    let all: Option<Vec<(u64, bool)>> = elements(order).map(place).collect();
    let Some(mut all) = all else { return false };
    all.sort_unstable();
    let alternates = |pair: &[(u64, bool)]| pair[0].0.checked_add(1) == Some(pair[1].0) && pair[0].1 != pair[1].1;
    all.first().is_some_and(|(_, is_edge)| !is_edge) && all.windows(2).all(alternates)
}

/// Nodes and edges alternating, if there is one edge fewer.
fn chain(order: &OrderView) -> Option<Vec<Element<'_>>> {
    let (nodes, edges) = (nodes_in_sequence(order), edges_in_sequence(order));
    if nodes.len() != edges.len() + 1 {
        return None;
    }
    let mut chain = Vec::with_capacity(nodes.len() + edges.len());
    let mut edges = edges.into_iter();
    for node in nodes {
        chain.push(Element::Node(node));
        chain.extend(edges.next().map(Element::Edge));
    }
    Some(chain)
}

fn base_and_horizon(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(chain) = command.order().and_then(chain) else {
        return false;
    };
    let flags: Option<Vec<bool>> = chain.iter().map(|element| element.released().flag()).collect();
    let Some(flags) = flags else { return false };
    if flags.iter().all(|released| !released) {
        found.remark("ORD-09", "the order releases nothing");
        return true;
    }
    let touching = flags.windows(3).zip(&chain[1..]);
    for (flags, element) in touching {
        if element.is_edge() && flags[1] && !(flags[0] && flags[2]) {
            let id = quote(element.id().or_empty());
            found.broken("ORD-08", format!("edge {id} is released, and a node of it is not"));
        }
    }
    let horizon = flags.iter().position(|released| !released);
    if let Some(horizon) = horizon {
        // A released edge that leads into the horizon is the business of ORD-08; the horizon begins behind it.
        if let Some(at) = flags[horizon..].iter().position(|released| *released) {
            let id = chain[horizon + at].id().or_empty();
            found.broken("ORD-09", format!("{} is released behind the horizon", quote(id)));
        }
    }
    true
}

fn edge_ends(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    let (nodes, edges) = (nodes_in_sequence(order), edges_in_sequence(order));
    if edges.is_empty() || nodes.len() != edges.len() + 1 {
        return false;
    }
    let mut judged = false;
    for (edge, ends) in edges.iter().zip(nodes.windows(2)) {
        for (name, named, node) in [
            ("startNodeId", &edge.start_node_id, ends[0]),
            ("endNodeId", &edge.end_node_id, ends[1]),
        ] {
            let Some((named, is)) = named.text().zip(node.node_id.text()) else {
                continue;
            };
            judged = true;
            if named != is {
                let id = quote(edge.edge_id.or_empty());
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
        let is_known = short(&order.order_id).is_none_or(|id| {
            if self.known.len() == ORDERS {
                self.known.pop_first();
            }
            !self.known.insert(id)
        });
        let mut all = Vec::new();
        for element in elements(order) {
            let Some(written) = element.sequence_id().number() else {
                return false;
            };
            let Some(sequence) = written.whole() else {
                let text = format!("sequenceId {written} is no whole number");
                Found::new(record, findings).broken("ORD-UPD-11", text);
                return true;
            };
            all.push((sequence, element.is_edge()));
        }
        all.sort_unstable();
        let Some((first, begins_with_edge)) = all.first().copied() else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let begins = !is_known && order.order_update_id.whole().is_none_or(|update| update == 0);
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
