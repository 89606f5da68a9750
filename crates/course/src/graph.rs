//! A layout as a graph by numbers, for searching it.

use std::collections::{BTreeMap, BTreeSet};

use super::{Layout, Node};

/// Driving over a node where loads are handed over counts like this many metres.
const STATION_DETOUR: f64 = 100.0;

/// The layout by numbers, on the map where the vehicle stands. Node 0 is where it stands.
pub(super) struct Graph<'a> {
    pub(super) nodes: Vec<&'a Node>,
    /// Lengths of the edges from a node, by end.
    pub(super) ways: Vec<BTreeMap<usize, f64>>,
    /// Nodes from which the vehicle can come back to where it stands.
    pub(super) returning: BTreeSet<usize>,
}

impl<'a> Graph<'a> {
    pub(super) fn of(layout: &'a Layout, start: &str) -> Self {
        let mut nodes: Vec<&Node> = layout.nodes().collect();
        if let Some(at) = nodes.iter().position(|node| node.id == start) {
            nodes[..=at].rotate_right(1);
        }
        if let Some(map) = nodes.first().map(|node| node.map_id.as_str()) {
            nodes.retain(|node| node.map_id == map);
        }
        let numbers: BTreeMap<&str, usize> = nodes
            .iter()
            .enumerate()
            .map(|(at, node)| (node.id.as_str(), at))
            .collect();
        let mut ways = vec![BTreeMap::new(); nodes.len()];
        let mut back = vec![Vec::new(); nodes.len()];
        for edge in layout.edges() {
            if let (Some(&from), Some(&to)) = (numbers.get(edge.start.as_str()), numbers.get(edge.end.as_str())) {
                let detour = if nodes[to].station { STATION_DETOUR } else { 0.0 };
                ways[from].insert(to, nodes[from].distance(nodes[to].x, nodes[to].y) + detour);
                back[to].push(from);
            }
        }
        let mut returning = BTreeSet::from([0]);
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            open.extend(back[at].iter().copied().filter(|from| returning.insert(*from)));
        }
        Self { nodes, ways, returning }
    }

    /// The number of a node.
    pub(super) fn place(&self, id: &str) -> Option<usize> {
        self.nodes.iter().position(|node| node.id == id)
    }

    /// Whether the vehicle can come back from a node.
    pub(super) fn returns(&self, place: usize) -> bool {
        self.returning.contains(&place)
    }

    /// A node that is not taken, not next to where the vehicle stands if possible, and as far away as possible.
    pub(super) fn far(&self, taken: &[usize]) -> Option<&'a Node> {
        let here = self.nodes.first()?;
        (0..self.nodes.len())
            .filter(|place| !taken.contains(place))
            .max_by(|one, other| {
                let apart = |place: usize| !self.ways[0].contains_key(&place);
                let distance = |place: usize| self.nodes[place].distance(here.x, here.y);
                apart(*one)
                    .cmp(&apart(*other))
                    .then(distance(*one).total_cmp(&distance(*other)))
                    // Of equals the first one by id.
                    .then(other.cmp(one))
            })
            .map(|place| self.nodes[place])
    }
}
