//! What may be driven: nodes, one-way edges, and the floor of the reference AGV.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value};

use super::demand::Demand;
use super::{CourseError, Station};
use tck_base::diagnostic;
use tck_profile::LayoutList;

/// mapId of [`Layout::built_in`].
pub const BUILT_IN_MAP: &str = "reference-floor";

/// mapId of the other floor of [`Layout::built_in`].
pub const BUILT_IN_UPPER_MAP: &str = "reference-upper-floor";

/// A place the vehicle can stand on.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// nodeId.
    pub id: String,
    /// mapId.
    pub map_id: String,
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians, from -π to π; absent where the vehicle may choose.
    pub theta: Option<f64>,
    /// allowedDeviationXY in metres.
    pub deviation_xy: Option<f64>,
    /// allowedDeviationTheta in radians.
    pub deviation_theta: Option<f64>,
    /// Whether loads are handed over here; courses avoid such nodes.
    pub station: bool,
    /// What every order has to do here.
    pub demands: Vec<Demand>,
}

impl Node {
    /// Metres to a point of the same map.
    #[must_use]
    pub fn distance(&self, x: f64, y: f64) -> f64 {
        (self.x - x).hypot(self.y - y)
    }

    /// What `${course.a.…}` can name.
    #[must_use]
    pub fn value(&self) -> Value {
        let mut value = Map::new();
        value.insert("id".into(), self.id.as_str().into());
        value.insert("mapId".into(), self.map_id.as_str().into());
        value.insert("x".into(), self.x.into());
        value.insert("y".into(), self.y.into());
        put(&mut value, "theta", self.theta);
        put(&mut value, "allowedDeviationXY", self.deviation_xy);
        put(&mut value, "allowedDeviationTheta", self.deviation_theta);
        put_demands(&mut value, &self.demands);
        value.into()
    }
}

fn put(value: &mut Map<String, Value>, name: &str, number: Option<f64>) {
    if let Some(number) = number {
        value.insert(name.into(), number.into());
    }
}

/// The actions that every order has to have, where there are any.
fn put_demands(value: &mut Map<String, Value>, demands: &[Demand]) {
    if !demands.is_empty() {
        value.insert("demands".into(), demands.iter().map(Demand::value).collect());
    }
}

/// What an order says of every edge of which it is known: a speed cap, and what a line-guided vehicle cannot do without.
const ALWAYS_TOLD: [&str; 2] = ["maxSpeed", "direction"];

/// A way from one node to another, and not back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Edge {
    /// edgeId.
    pub id: String,
    /// Id of the node it begins at.
    pub start: String,
    /// Id of the node it ends at.
    pub end: String,
    /// Metres per second.
    pub max_speed: Option<f64>,
    /// Radians per second.
    pub max_rotation_speed: Option<f64>,
    /// Radians.
    pub orientation: Option<f64>,
    /// `GLOBAL` or `TANGENTIAL`.
    pub orientation_type: Option<String>,
    /// Whether the vehicle may turn on it.
    pub rotation_allowed: Option<bool>,
    /// Metres.
    pub max_height: Option<f64>,
    /// Metres.
    pub min_height: Option<f64>,
    /// What a line-guided vehicle is told at the junction where the edge begins.
    pub direction: Option<String>,
    /// NURBS, as the layout has it.
    pub trajectory: Option<Value>,
    /// What every order has to do on it.
    pub demands: Vec<Demand>,
    /// The members that an order has beside those it always has, because the vehicle takes them.
    pub told: Vec<&'static str>,
}

impl Edge {
    /// What `${course.a-b.…}` can name.
    #[must_use]
    pub fn value(&self) -> Value {
        let mut value = Map::new();
        value.insert("id".into(), self.id.as_str().into());
        value.insert("startNodeId".into(), self.start.as_str().into());
        value.insert("endNodeId".into(), self.end.as_str().into());
        put(&mut value, "maxSpeed", self.max_speed);
        put(&mut value, "maxRotationSpeed", self.max_rotation_speed);
        put(&mut value, "orientation", self.orientation);
        put(&mut value, "maxHeight", self.max_height);
        put(&mut value, "minHeight", self.min_height);
        if let Some(kind) = &self.orientation_type {
            value.insert("orientationType".into(), kind.as_str().into());
        }
        if let Some(allowed) = self.rotation_allowed {
            value.insert("rotationAllowed".into(), allowed.into());
        }
        if let Some(direction) = &self.direction {
            value.insert("direction".into(), direction.as_str().into());
        }
        if let Some(trajectory) = &self.trajectory {
            value.insert("trajectory".into(), trajectory.clone());
        }
        put_demands(&mut value, &self.demands);
        if !self.told.is_empty() {
            let told = self.told.iter().map(|name| Value::from(*name));
            value.insert("told".into(), told.collect());
        }
        value.into()
    }
}

/// What an order says of an edge beside its ids and its ends, from the value of the edge.
#[must_use]
pub fn told_in_order(edge: &Value) -> Map<String, Value> {
    let told = edge.get("told").and_then(Value::as_array);
    let told = told.into_iter().flatten().filter_map(Value::as_str);
    let names = ALWAYS_TOLD.into_iter().chain(told);
    names
        .filter_map(|name| Some((name.to_owned(), edge.get(name)?.clone())))
        .collect()
}

/// The actions that an order has to have on a node or an edge, from its value; `id` gives each its actionId.
pub fn demanded_in_order(place: &Value, mut id: impl FnMut() -> String) -> Vec<Value> {
    let demands = place.get("demands").and_then(Value::as_array);
    let demands = demands.into_iter().flatten();
    demands.map(|demand| with_id(demand, id())).collect()
}

fn with_id(demand: &Value, id: String) -> Value {
    let mut action = demand.clone();
    if let Value::Object(members) = &mut action {
        members.insert("actionId".into(), id.into());
    }
    action
}

/// Everything one vehicle may drive on. Node ids are unique; edges join nodes of it, on one map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    pub(super) nodes: BTreeMap<String, Node>,
    /// By start and end; of parallel edges the first one counts.
    pub(super) edges: BTreeMap<(String, String), Edge>,
    /// Where actions of the profile can be performed, by their names in suites.
    pub(super) stations: BTreeMap<String, Station>,
    /// What the source has and the layout leaves out, one sentence each.
    pub(super) left_out: Vec<String>,
    /// The file it comes from; empty where it comes from none.
    pub(super) file: String,
    /// What the source says of nodes and edges and orders say, one sentence each, once that is known.
    pub(super) said: Vec<String>,
    /// What the source says of nodes and edges and no order says, one sentence each.
    pub(super) unsaid: Vec<String>,
}

impl Layout {
    /// A layout of these nodes and edges. What cannot be driven is left out, with a sentence about it.
    #[must_use]
    pub(super) fn assemble(nodes: Vec<Node>, edges: Vec<Edge>, left_out: Vec<String>) -> Self {
        let mut layout = Self {
            nodes: nodes.into_iter().map(|node| (node.id.clone(), node)).collect(),
            edges: BTreeMap::new(),
            stations: BTreeMap::new(),
            left_out,
            file: String::new(),
            said: Vec::new(),
            unsaid: Vec::new(),
        };
        for edge in edges {
            let (Some(start), Some(end)) = (layout.nodes.get(&edge.start), layout.nodes.get(&edge.end)) else {
                let sentence = format!("edge {} leads to or from a node the vehicle may not use", edge.id);
                layout.left_out.push(sentence);
                continue;
            };
            if start.map_id != end.map_id {
                layout.left_out.push(format!("edge {} leads to another map", edge.id));
                continue;
            }
            let ends = (edge.start.clone(), edge.end.clone());
            if layout.edges.contains_key(&ends) {
                layout
                    .left_out
                    .push(format!("edge {} is parallel to another one", edge.id));
                continue;
            }
            layout.edges.insert(ends, edge);
        }
        layout
    }

    /// The layout with the file it comes from, and with what that says and nobody reads, one sentence each.
    #[must_use]
    pub(super) fn read_from(mut self, file: &str, unread: Vec<String>) -> Self {
        file.clone_into(&mut self.file);
        self.unsaid = unread;
        self
    }

    /// The short list of a profile, which has been checked when it was read.
    #[must_use]
    pub fn from_list(list: &LayoutList) -> Self {
        let nodes = list.nodes.iter().map(|node| Node {
            id: node.id.clone(),
            map_id: node.map_id.clone(),
            x: node.x,
            y: node.y,
            theta: node.theta,
            deviation_xy: node.deviation_xy,
            deviation_theta: node.deviation_theta,
            station: false,
            demands: Vec::new(),
        });
        let edges = list.edges.iter().map(|edge| Edge {
            id: edge.id.clone(),
            start: edge.start.clone(),
            end: edge.end.clone(),
            direction: edge.direction.clone(),
            ..Edge::default()
        });
        Self::assemble(nodes.collect(), edges.collect(), Vec::new())
    }

    /// The floor of the reference AGV: four by four nodes, two metres apart, A1 to D4, and beside them E1 to E4, where
    /// there is something to do, with edges both ways to every neighbour, the diagonal ones included. Every path and
    /// every loop of up to six nodes can start at every node. Above E3 is U3, on another floor.
    #[must_use]
    pub fn built_in() -> Self {
        const COLUMNS: [(&str, f64); 5] = [("A", 0.0), ("B", 2.0), ("C", 4.0), ("D", 6.0), ("E", 8.0)];
        const ROWS: [(&str, f64); 4] = [("1", 0.0), ("2", 2.0), ("3", 4.0), ("4", 6.0)];
        let mut nodes = Vec::new();
        for (column, x) in COLUMNS {
            for (row, y) in ROWS {
                nodes.push(Node {
                    id: format!("{column}{row}"),
                    map_id: BUILT_IN_MAP.to_owned(),
                    x,
                    y,
                    theta: None,
                    deviation_xy: None,
                    deviation_theta: None,
                    station: column == "E",
                    demands: Vec::new(),
                });
            }
        }
        nodes.extend(nodes.iter().find(|node| node.id == "E3").cloned().map(|below| Node {
            id: "U3".to_owned(),
            map_id: BUILT_IN_UPPER_MAP.to_owned(),
            ..below
        }));
        let mut edges = Vec::new();
        for start in &nodes {
            for end in &nodes {
                if start.id != end.id && start.map_id == end.map_id && start.distance(end.x, end.y) < 3.0 {
                    edges.push(Edge {
                        id: format!("{}-{}", start.id, end.id),
                        start: start.id.clone(),
                        end: end.id.clone(),
                        ..Edge::default()
                    });
                }
            }
        }
        Self::assemble(nodes, edges, Vec::new())
    }

    /// Keeps these nodes only.
    ///
    /// # Errors
    /// When a node of the list is not in the layout.
    pub fn only(mut self, allowed: &[String]) -> Result<Self, CourseError> {
        for id in allowed {
            if !self.nodes.contains_key(id) {
                return Err(self.unknown(id));
            }
        }
        let allowed: BTreeSet<&String> = allowed.iter().collect();
        self.nodes.retain(|id, _| allowed.contains(id));
        self.edges
            .retain(|(start, end), _| allowed.contains(start) && allowed.contains(end));
        Ok(self)
    }

    /// The complaint about a node that is not there; a floor of thousands is not listed.
    pub(super) fn unknown(&self, id: &str) -> CourseError {
        let ids = || self.nodes.keys().map(String::as_str);
        let hint = match diagnostic::closest(id, ids()) {
            Some(close) => format!("did you mean `{close}`?"),
            None if self.nodes.len() > 12 => format!("it has {} others", self.nodes.len()),
            None => format!("it has {}", ids().collect::<Vec<_>>().join(", ")),
        };
        CourseError::UnknownNode {
            id: id.to_owned(),
            hint,
        }
    }

    /// Lets no edge be faster than `cap`, in m/s.
    #[must_use]
    pub fn slower_than(mut self, cap: f64) -> Self {
        for edge in self.edges.values_mut() {
            edge.max_speed = Some(edge.max_speed.map_or(cap, |speed| speed.min(cap)));
        }
        self
    }

    /// Makes it a layout for a line-guided vehicle: every edge says by the points of the compass where it leaves.
    #[must_use]
    pub fn with_directions(mut self) -> Self {
        const COMPASS: [&str; 8] = ["E", "NE", "N", "NW", "W", "SW", "S", "SE"];
        for edge in self.edges.values_mut() {
            let ends = self.nodes.get(&edge.start).zip(self.nodes.get(&edge.end));
            edge.direction = ends.map(|(start, end)| {
                let eighth = ((end.y - start.y).atan2(end.x - start.x) / std::f64::consts::FRAC_PI_4).rem_euclid(8.0);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 8")]
                let at = eighth.round() as usize;
                COMPASS[at % COMPASS.len()].to_owned()
            });
        }
        self
    }

    /// Leaves out edges that do not say their direction.
    #[must_use]
    pub fn directed(mut self) -> Self {
        self.edges.retain(|_, edge| edge.direction.is_some());
        self
    }

    /// Marks a node that courses avoid.
    pub(super) fn mark_station(&mut self, id: &str) {
        if let Some(node) = self.nodes.get_mut(id) {
            node.station = true;
        }
    }

    /// Nodes by id.
    pub fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.nodes.values()
    }

    /// Edges by start and end.
    pub fn edges(&self) -> impl Iterator<Item = &Edge> {
        self.edges.values()
    }

    /// The node of that id.
    #[must_use]
    pub fn node(&self, id: &str) -> Option<&Node> {
        self.nodes.get(id)
    }

    /// The edge from one node to another.
    #[must_use]
    pub fn edge(&self, start: &str, end: &str) -> Option<&Edge> {
        self.edges.get(&(start.to_owned(), end.to_owned()))
    }

    /// The way over an edge as points in metres, both ends included: along its curve where it has one that can be calculated with.
    #[must_use]
    pub fn line(&self, edge: &Edge) -> Vec<(f64, f64)> {
        if let Some((Some(curve), _)) = edge.curve() {
            return curve.path().points().collect();
        }
        let ends = [self.node(&edge.start), self.node(&edge.end)];
        ends.into_iter().flatten().map(|node| (node.x, node.y)).collect()
    }

    /// Whether it has a place for the station of this variable, such as `pick`.
    #[must_use]
    pub fn has_station(&self, name: &str) -> bool {
        self.stations.contains_key(name)
    }

    /// What the source says of nodes and edges and orders say, one sentence each; nothing before [`Layout::fitted`].
    #[must_use]
    pub fn said(&self) -> &[String] {
        &self.said
    }

    /// What the source says of nodes and edges and no order says, one sentence each.
    #[must_use]
    pub fn unsaid(&self) -> &[String] {
        &self.unsaid
    }

    /// What the source has and the layout leaves out, one sentence each, for the report.
    #[must_use]
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }
}
