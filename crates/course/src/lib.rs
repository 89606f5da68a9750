//! Layouts and courses: the nodes and edges a test may use, mapped onto the real floor.
//!
//! A [`Layout`] is what may be driven; it comes from a LIF file, from a short list in the profile, or is the
//! floor of the reference AGV. [`Layout::assign`] gives the names a test speaks of (a, b, c …) to nodes of it,
//! beginning where the vehicle stands. Building orders from a [`Course`] is left to the engine.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod assign;
mod curve;
mod demand;
mod doubts;
mod drawing;
mod fit;
mod graph;
mod layout;
mod lif;
mod outward;
pub mod picture;
#[cfg(test)]
mod tests;
mod trail;
mod ways;

use std::collections::BTreeMap;

use serde_json::{Map, Value};

pub use demand::Demand;
pub use fit::{Scope, Taken, Takes, Unheard};
pub use layout::{BUILT_IN_MAP, BUILT_IN_UPPER_MAP, Edge, Layout, Node, demanded_in_order, told_in_order};
pub use trail::{GivesUp, Trail};
pub use ways::Station;

use tck_base::diagnostic::{Diagnostic, Source};
use tck_profile::{LayoutSource, Profile, SampleKind};

/// How much larger than an edge the range around its start is that is called `beyond`: between one and two.
const BEYOND: f64 = 1.4;

/// What a test asks of the course.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CourseNeed {
    /// Names of nodes, in order of first use. `a` is where the vehicle stands.
    pub nodes: Vec<String>,
    /// Pairs of names that must be joined by an edge.
    pub edges: Vec<(String, String)>,
    /// Whether every edge must say in which direction it leaves a junction.
    pub directed: bool,
    /// Pairs of names, one of them a station, that must be joined by a way of any length.
    pub ways: Vec<(String, String)>,
}

/// Whether this names a place of the profile, such as `pick`: the variable of a sample action with a place of its own.
#[must_use]
pub fn is_station(name: &str) -> bool {
    SampleKind::of_variable(name).is_some_and(SampleKind::is_station)
}

impl CourseNeed {
    /// The names of stations, in order of first use.
    pub fn stations(&self) -> impl Iterator<Item = &str> {
        self.nodes.iter().map(String::as_str).filter(|name| is_station(name))
    }
}

impl Layout {
    /// The layout a profile describes, within its allow-list and its speed cap; `None` when it describes none.
    /// Reads the LIF file, if one is named.
    ///
    /// # Errors
    /// What is wrong with the file or the allow-list.
    pub fn of_profile(profile: &Profile) -> Result<Option<Self>, Vec<Diagnostic>> {
        let mut layout = match &profile.layout.source {
            LayoutSource::None => return Ok(None),
            LayoutSource::List(list) => Self::from_list(list),
            LayoutSource::Lif { file, vehicle_type } => {
                let name = file.display().to_string();
                let text = std::fs::read_to_string(file).map_err(|error| {
                    vec![Diagnostic::whole(
                        "unreadable",
                        format!("the layout {name} cannot be read: {error}"),
                    )]
                })?;
                Self::from_lif(&Source::new(name, text), vehicle_type.as_deref())?
            }
        };
        if let Some(allowed) = &profile.layout.allow_list {
            layout = layout.only(allowed).map_err(|error| {
                vec![Diagnostic::whole(
                    "unknown-node",
                    format!("`layout.allow-list`: {error}"),
                )]
            })?;
        }
        let layout = layout.with_stations(&profile.device.sample_actions);
        Ok(Some(match profile.motion.max_speed {
            Some(cap) => layout.slower_than(cap),
            None => layout,
        }))
    }
}

/// The name of the node where the vehicle stands.
pub const HERE: &str = "a";

/// The name of a node far away, which no edge joins to where the vehicle stands, if the layout has one.
pub const FAR: &str = "far";

/// Where the vehicle stands.
#[derive(Clone, Debug, PartialEq)]
pub enum Standing {
    /// On a node, by its own account.
    Node(String),
    /// At a place; the nearest node of that map counts if it is near enough.
    Pose {
        /// mapId.
        map: String,
        /// Metres.
        x: f64,
        /// Metres.
        y: f64,
    },
}

/// Why no course could be found. What the device says about itself is shown escaped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CourseError {
    /// A node that is not in the layout.
    #[error("there is no node {id:?} in the layout; {hint}")]
    UnknownNode {
        /// The id.
        id: String,
        /// What may have been meant.
        hint: String,
    },
    /// The vehicle stands on no node.
    #[error("the vehicle stands at x = {x}, y = {y} on map {map:?}, and {nearest}")]
    OnNoNode {
        /// mapId.
        map: String,
        /// Metres.
        x: f64,
        /// Metres.
        y: f64,
        /// The nearest node, in words.
        nearest: String,
    },
    /// The layout cannot give what the test asks.
    #[error("no {nodes} nodes of the layout from {start:?} on are joined as the test asks{edges}")]
    Unsatisfiable {
        /// How many nodes are asked for.
        nodes: usize,
        /// Where the vehicle stands.
        start: String,
        /// The edges that are asked for, in brackets behind a space; nothing where any will do.
        edges: String,
    },
    /// A station of the profile cannot be used.
    #[error("the place of `{setting}` cannot be used: {reason}")]
    Station {
        /// Such as `device.pick`.
        setting: String,
        /// Why not.
        reason: String,
    },
    /// No way leads to a station, or back.
    #[error("no way leads from {from:?} to {to:?} in the layout")]
    NoWay {
        /// nodeId.
        from: String,
        /// nodeId.
        to: String,
    },
    /// No node is as far away as the test asks.
    #[error("no node of the layout is {steps} edges away from {start:?}, where the vehicle stands")]
    TooNear {
        /// Where the vehicle stands.
        start: String,
        /// How many edges are asked for.
        steps: usize,
    },
    /// A node is as far away, and no way leads back from it.
    #[error(
        "from no node of the layout that is {steps} edges away from {start:?} a way leads back there; add the edges back"
    )]
    NoWayBack {
        /// Where the vehicle stands.
        start: String,
        /// How many edges are asked for.
        steps: usize,
    },
    /// The search was given up.
    #[error(
        "the layout is too big to say whether it has a course as the test asks; name a few nodes in `layout.allow-list`"
    )]
    GivenUp,
}

/// Names of a test, given to nodes of the layout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    nodes: BTreeMap<String, Node>,
    edges: BTreeMap<(String, String), Edge>,
    /// By the names it joins: the names of the nodes after the first one.
    ways: BTreeMap<(String, String), Vec<String>>,
}

impl Course {
    /// The names of the nodes on the way between two names, without the first. Empty where both are one node.
    #[must_use]
    pub fn way(&self, from: &str, to: &str) -> Option<&[String]> {
        self.ways.get(&(from.to_owned(), to.to_owned())).map(Vec::as_slice)
    }

    /// Whether a way between a station and another node is no way, because both are the same node.
    #[must_use]
    pub fn collapses(&self) -> bool {
        let mut ways = self.ways.iter();
        ways.any(|((from, to), names)| names.is_empty() && !(is_station(from) && is_station(to)))
    }

    /// The node of a name.
    #[must_use]
    pub fn node(&self, name: &str) -> Option<&Node> {
        self.nodes.get(name)
    }

    /// The edge between two names.
    #[must_use]
    pub fn edge(&self, from: &str, to: &str) -> Option<&Edge> {
        self.edges.get(&(from.to_owned(), to.to_owned()))
    }

    /// Names and nodes.
    pub fn nodes(&self) -> impl Iterator<Item = (&str, &Node)> {
        self.nodes.iter().map(|(name, node)| (name.as_str(), node))
    }

    /// What is known of an edge, with `length` of the straight line from node to node in metres, `beyond`, a range around
    /// its start that holds its end and, read as a diameter, does not, `heading`, its
    /// direction, and `back`, the direction back, both in radians against the map; `line` and `curve` are trajectories.
    fn edge_value(&self, from: &str, to: &str, edge: &Edge) -> Value {
        let mut value = edge.value();
        let ends = self.nodes.get(from).zip(self.nodes.get(to));
        if let Some((start, end)) = ends.filter(|(start, end)| start.distance(end.x, end.y) > 0.0)
            && let Value::Object(members) = &mut value
        {
            let heading = (end.y - start.y).atan2(end.x - start.x);
            let back = (start.y - end.y).atan2(start.x - end.x);
            let length = start.distance(end.x, end.y);
            members.insert("length".into(), length.into());
            members.insert("beyond".into(), (length * BEYOND).into());
            members.insert("heading".into(), heading.into());
            members.insert("back".into(), back.into());
            let (from, to) = ((start.x, start.y), (end.x, end.y));
            members.insert("line".into(), curve::line(from, to));
            members.extend(curve::waves(from, to).map(|curve| ("curve".to_owned(), curve)));
        }
        value
    }

    /// The value of `course`: `a` is a nodeId, `a-b` an edgeId; everything else about them stands below
    /// `nodes` and `edges`, where `course.a.x` is to be looked up as `course.nodes.a.x`. `ways` has for `a-pick` the
    /// names of the nodes behind `a`.
    #[must_use]
    pub fn bindings(&self) -> Value {
        let mut all = Map::new();
        let mut nodes = Map::new();
        let mut edges = Map::new();
        for (name, node) in &self.nodes {
            all.insert(name.clone(), node.id.as_str().into());
            nodes.insert(name.clone(), node.value());
        }
        for ((from, to), edge) in &self.edges {
            all.insert(format!("{from}-{to}"), edge.id.as_str().into());
            edges.insert(format!("{from}-{to}"), self.edge_value(from, to, edge));
        }
        all.insert("nodes".into(), nodes.into());
        all.insert("edges".into(), edges.into());
        let ways = self.ways.iter();
        let ways = ways.map(|((from, to), names)| (format!("{from}-{to}"), names.clone().into()));
        all.insert("ways".into(), Value::Object(ways.collect()));
        all.into()
    }
}
