//! Ways over the layout: the graph of nodes and edges that orders are cut from (section 6.6.1).
//!
//! No sentence says which way to take; an edge that is closed to a vehicle is on none of its ways (ORD-12).

use std::collections::{BTreeMap, BTreeSet};

use super::config::{MasterControlConfig, SiteEdge, SiteNode};

impl MasterControlConfig {
    /// The shortest way from one node to another without the blocked edges, as edges; empty if they are one.
    pub(crate) fn way(&self, from: &str, to: &str, blocked: &BTreeSet<(String, String)>) -> Option<Vec<&SiteEdge>> {
        let mut open: BTreeMap<&str, f64> = BTreeMap::from([(self.node(from)?.id.as_str(), 0.0)]);
        let mut closed: BTreeSet<&str> = BTreeSet::new();
        let mut via: BTreeMap<&str, &SiteEdge> = BTreeMap::new();
        loop {
            let nearest = open.iter().min_by(|a, b| a.1.total_cmp(b.1));
            let (here, length) = nearest.map(|(id, length)| (*id, *length))?;
            if here == to {
                break;
            }
            open.remove(here);
            closed.insert(here);
            for edge in self.edges.iter().filter(|edge| edge.from == here) {
                let (Some(start), Some(end)) = (self.node(&edge.from), self.node(&edge.to)) else {
                    continue;
                };
                let free = !blocked.contains(&(edge.from.clone(), edge.to.clone()));
                let reached = length + distance((start.x, start.y), (end.x, end.y)).max(0.001);
                let better = open.get(end.id.as_str()).is_none_or(|known| reached < *known);
                if free && better && !closed.contains(end.id.as_str()) {
                    open.insert(&end.id, reached);
                    via.insert(&end.id, edge);
                }
            }
        }
        let mut way = Vec::new();
        let mut here = to;
        while here != from {
            let edge = *via.get(here)?;
            way.push(edge);
            here = &edge.from;
        }
        way.reverse();
        Some(way)
    }

    /// The shortest way between two nodes, over blocked edges where there is no other.
    pub(crate) fn any_way(&self, from: &str, to: &str, blocked: &BTreeSet<(String, String)>) -> Option<Vec<&SiteEdge>> {
        self.way(from, to, blocked)
            .or_else(|| self.way(from, to, &BTreeSet::new()))
    }

    /// The node of a map next to a place, and how far it is.
    pub(crate) fn nearest(&self, x: f64, y: f64, map_id: &str) -> Option<(&SiteNode, f64)> {
        let here = self.nodes.iter().filter(|node| node.map_id == map_id);
        here.map(|node| (node, distance((node.x, node.y), (x, y))))
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

pub(crate) fn distance(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0).hypot(a.1 - b.1)
}
