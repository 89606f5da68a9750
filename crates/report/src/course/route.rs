//! An order as a way on the floor: what its last message says, behind the base that was released before.

use std::collections::BTreeMap;

use super::picture::{Stop, Stretch, name, round};
use tck_base::nurbs::Curve;
use tck_view::{Edge, Member, Node, OrderView, Text, Trajectory};
use tck_world::ordered;

/// How many nodes of an order are kept, and how many edges; of a longer one the newest.
const PARTS: usize = 200;
/// How many places of nodes are known at most.
const PLACES: usize = 1_000;
/// Curves with more control points are not calculated.
const CONTROL_POINTS: usize = 256;
/// How many points of a curve are drawn.
const POINTS: usize = 48;

/// A place on a map; the map is empty where the message names none.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spot {
    pub x: f64,
    pub y: f64,
    pub map: String,
}

/// Where nodes are, as orders have said so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Places(BTreeMap<String, Spot>);

impl Places {
    pub fn of(&self, node: &str) -> Option<&Spot> {
        self.0.get(node)
    }

    fn learn(&mut self, node: &str, spot: &Spot) {
        if self.0.len() < PLACES || self.0.contains_key(node) {
            self.0.insert(node.to_owned(), spot.clone());
        }
    }
}

#[derive(Clone, Debug)]
struct RouteNode {
    sequence: Option<u64>,
    id: String,
    released: bool,
    spot: Option<Spot>,
}

#[derive(Clone, Debug)]
struct RouteEdge {
    sequence: Option<u64>,
    id: String,
    released: bool,
    /// Empty where its ends or its curve are not known.
    line: Vec<(f64, f64)>,
    map: Option<String>,
}

/// An order as it is after one of its messages.
#[derive(Clone, Debug)]
pub(super) struct Route {
    /// Number of the message.
    pub message: u64,
    pub order: String,
    pub update: Option<u64>,
    /// Number of the first message in which the vehicle names it.
    pub named: Option<u64>,
    nodes: Vec<RouteNode>,
    edges: Vec<RouteEdge>,
}

impl Route {
    /// The order after this message. Of what the message before it says, the base up to where this one begins still holds.
    pub fn after(message: u64, order: &OrderView, before: Option<&Self>, places: &mut Places) -> Self {
        let id = name(order.order_id.or_empty());
        let nodes = order.nodes_in_sequence().into_iter().take(PARTS);
        let mut nodes: Vec<RouteNode> = nodes.map(|node| RouteNode::of(node, places)).collect();
        let edges = order.edges_in_sequence().into_iter().take(PARTS);
        let mut edges: Vec<RouteEdge> = edges.map(|edge| RouteEdge::of(edge, &nodes, places)).collect();
        let begins = nodes.iter().filter_map(|node| node.sequence).min();
        let before = before.filter(|before| before.order == id);
        if let (Some(before), Some(begins)) = (before, begins) {
            let holds = |sequence: Option<u64>, released: bool| released && sequence.is_some_and(|own| own < begins);
            let old = before.nodes.iter().filter(|node| holds(node.sequence, node.released));
            nodes.splice(0..0, old.cloned());
            let old = before.edges.iter().filter(|edge| holds(edge.sequence, edge.released));
            edges.splice(0..0, old.cloned());
        }
        nodes.drain(..nodes.len().saturating_sub(PARTS));
        edges.drain(..edges.len().saturating_sub(PARTS));
        Self {
            message,
            order: id,
            update: order.order_update_id.whole(),
            named: None,
            nodes,
            edges,
        }
    }

    /// A map that it leads over; the one of its first node that has a place.
    pub fn map(&self) -> Option<&str> {
        self.nodes
            .iter()
            .find_map(|node| Some(node.spot.as_ref()?.map.as_str()))
    }

    /// Its nodes, with places where they lie on this map.
    pub fn stops(&self, map: &str) -> Vec<Stop> {
        let stops = self.nodes.iter().map(|node| {
            let spot = node.spot.as_ref().filter(|spot| spot.map == map);
            Stop {
                id: node.id.clone(),
                released: node.released,
                place: spot.map(|spot| (spot.x, spot.y)),
            }
        });
        stops.collect()
    }

    /// Its edges on this map; without a line where that is not known.
    pub fn stretches(&self, map: &str) -> Vec<Stretch> {
        let here = |edge: &&RouteEdge| edge.map.as_deref().is_none_or(|own| own == map);
        let stretches = self.edges.iter().filter(here).map(|edge| Stretch {
            id: edge.id.clone(),
            released: edge.released,
            line: edge.line.clone(),
        });
        stretches.collect()
    }
}

impl RouteNode {
    fn of(node: &Node, places: &mut Places) -> Self {
        let id = name(node.node_id.or_empty());
        let spot = node.node_position.there().and_then(|position| position.spot());
        let spot = spot.map(|spot| Spot {
            x: round(spot.x),
            y: round(spot.y),
            map: name(spot.map_id.as_str()),
        });
        if let Some(spot) = &spot {
            places.learn(&id, spot);
        }
        Self {
            sequence: node.sequence_id.whole(),
            released: node.released.is(true),
            spot: spot.or_else(|| places.of(&id).cloned()),
            id,
        }
    }
}

impl RouteEdge {
    fn of(edge: &Edge, nodes: &[RouteNode], places: &Places) -> Self {
        let sequence = edge.sequence_id.whole();
        let end = |member: &Member<Text>, beside: Option<u64>| {
            let id = name(member.or_empty());
            let there = |node: &&RouteNode| node.id == id && node.sequence == beside;
            let node = nodes.iter().find(there).and_then(|node| node.spot.as_ref());
            node.or_else(|| places.of(&id)).cloned()
        };
        let start = end(&edge.start_node_id, sequence.and_then(|own| own.checked_sub(1)));
        let end = end(&edge.end_node_id, sequence.and_then(|own| own.checked_add(1)));
        let map = start.as_ref().or(end.as_ref()).map(|spot| spot.map.clone());
        let straight = || match (&start, &end) {
            (Some(start), Some(end)) if start.map == end.map => vec![(start.x, start.y), (end.x, end.y)],
            _ => Vec::new(),
        };
        let line = match &edge.trajectory {
            Member::Absent | Member::Null => straight(),
            Member::There(trajectory) if !is_long(trajectory) => {
                let curve = ordered::curve(&edge.trajectory).and_then(|(curve, _)| curve);
                curve.map_or_else(Vec::new, |curve| drawn(&curve))
            }
            // What is no curve, or too much of one, is not drawn as something else.
            _ => Vec::new(),
        };
        Self {
            sequence,
            id: name(edge.edge_id.or_empty()),
            released: edge.released.is(true),
            line,
            map,
        }
    }
}

fn is_long(trajectory: &Trajectory) -> bool {
    trajectory.control_points.total() > CONTROL_POINTS
}

/// A curve by a few of its points, both ends among them.
fn drawn(curve: &Curve) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = curve.path().points().collect();
    let step = points.len().div_ceil(POINTS).max(1);
    let last = points.len().saturating_sub(1);
    let some = points.iter().enumerate();
    let some = some.filter(|(at, _)| at % step == 0 || *at == last);
    some.map(|(_, (x, y))| (round(*x), round(*y))).collect()
}
