//! Ways to stations: the places where the profile says an action can be performed, however far they are.

use std::collections::BTreeMap;

use super::graph::Graph;
use super::{CourseError, CourseNeed, Layout, Node};
use tck_profile::{SampleActions, SampleKind};

/// Where an action of the profile can be performed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Station {
    /// On the node of this id.
    Node(String),
    /// On the edge of this id; a way to it ends with that edge.
    Edge(String),
}

/// A station of a test, on the map where the vehicle stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// The node a way leads to.
    pub node: usize,
    /// The node before it, where the last edge of the way is given.
    pub before: Option<usize>,
}

impl Layout {
    /// Adds the places of these actions, which courses avoid where they can.
    #[must_use]
    pub fn with_stations(mut self, actions: &SampleActions) -> Self {
        for (kind, action) in actions.iter() {
            let station = match (&action.node, &action.edge) {
                (Some(node), _) => Station::Node(node.clone()),
                (None, Some(edge)) => Station::Edge(edge.clone()),
                (None, None) => continue,
            };
            if let Station::Node(id) = &station {
                self.mark_station(id);
            }
            self.stations.insert(kind.variable.to_owned(), station);
        }
        self
    }

    /// The stations a test names, by name.
    pub(super) fn stops(&self, need: &CourseNeed, graph: &Graph<'_>) -> Result<BTreeMap<String, Stop>, CourseError> {
        let mut stops = BTreeMap::new();
        for name in need.stations() {
            let setting = SampleKind::of_variable(name).map_or(name, |kind| kind.name);
            let wrong = |reason: String| CourseError::Station {
                setting: format!("device.{setting}"),
                reason,
            };
            let station = self
                .stations
                .get(name)
                .ok_or_else(|| wrong("it is not set".to_owned()))?;
            let here = graph.nodes[0].map_id.as_str();
            let place = |id: &str| {
                let node = self.node(id).ok_or_else(|| wrong(self.unknown(id).to_string()))?;
                graph.place(id).ok_or_else(|| {
                    wrong(format!(
                        "node {id:?} is on map {:?}, and the vehicle on {here:?}",
                        node.map_id
                    ))
                })
            };
            let stop = match station {
                Station::Node(id) => Stop {
                    node: place(id)?,
                    before: None,
                },
                Station::Edge(id) => {
                    let edge = self
                        .edges()
                        .find(|edge| edge.id == *id)
                        .ok_or_else(|| wrong(format!("there is no edge {id:?} in the layout")))?;
                    Stop {
                        node: place(&edge.end)?,
                        before: Some(place(&edge.start)?),
                    }
                }
            };
            stops.insert(name.to_owned(), stop);
        }
        Ok(stops)
    }
}

/// The shortest way from one node to a stop: the nodes after the first one. Empty where the vehicle is there already.
pub(super) fn way(graph: &Graph<'_>, from: usize, stop: Stop) -> Option<Vec<usize>> {
    let mut way = shortest(graph, from, stop.before.unwrap_or(stop.node))?;
    way.extend(stop.before.map(|_| stop.node));
    Some(way)
}

/// Dijkstra's way: of equally short ones always the same.
fn shortest(graph: &Graph<'_>, from: usize, to: usize) -> Option<Vec<usize>> {
    let mut lengths: Vec<Option<(f64, usize)>> = vec![None; graph.nodes.len()];
    let mut done = vec![false; graph.nodes.len()];
    lengths[from] = Some((0.0, from));
    loop {
        let open = (0..lengths.len()).filter(|at| !done[*at]);
        let reached = open.filter_map(|at| Some((lengths[at]?.0, at)));
        let (length, at) = reached.min_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)))?;
        if at == to {
            break;
        }
        done[at] = true;
        for (next, more) in &graph.ways[at] {
            let longer = lengths[*next].is_some_and(|(known, _)| known <= length + more);
            if !longer {
                lengths[*next] = Some((length + more, at));
            }
        }
    }
    let mut way = Vec::new();
    let mut at = to;
    while at != from {
        way.push(at);
        at = lengths[at]?.1;
    }
    way.reverse();
    Some(way)
}

/// The name of the inner node of a way that is so many nodes behind its beginning.
pub(super) fn inner_name(from: &str, to: &str, number: usize) -> String {
    format!("{from}>{to}.{number}")
}

/// What a station is on the course, for messages.
pub(super) fn no_way(from: &Node, to: &Node) -> CourseError {
    CourseError::NoWay {
        from: from.id.clone(),
        to: to.id.clone(),
    }
}
