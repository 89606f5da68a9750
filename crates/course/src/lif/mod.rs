//! LIF 1.0, the layout interchange format of the VDMA: what of a layout one type of vehicle may drive on.
//!
//! A vehicle will drive by these numbers, so a file that looks wrong is refused rather than guessed at: degrees
//! where radians should be, millimetres where metres should be.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::Value;

use super::layout::{Edge, Layout, Node};
use tck_base::diagnostic::{self, Diagnostic, Source, Span};

/// No floor is larger than this from its origin, in metres; beyond it, the file is in other units.
const LARGEST: f64 = 10_000.0;

/// A file in the wrong unit has one mistake per node; nobody reads more of them than this.
const MOST_MISTAKES: usize = 20;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct File {
    layouts: Vec<FileLayout>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct FileLayout {
    layout_id: String,
    nodes: Vec<FileNode>,
    edges: Vec<FileEdge>,
    #[serde(default)]
    stations: Vec<Station>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct FileNode {
    node_id: String,
    map_id: Option<String>,
    node_position: Position,
    vehicle_type_node_properties: Vec<NodeProperties>,
}

#[derive(Deserialize)]
struct Position {
    x: f64,
    y: f64,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct NodeProperties {
    vehicle_type_id: String,
    theta: Option<f64>,
    #[serde(default)]
    actions: Vec<Action>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Action {
    action_type: String,
    requirement_type: Option<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct FileEdge {
    edge_id: String,
    start_node_id: String,
    end_node_id: String,
    vehicle_type_edge_properties: Vec<EdgeProperties>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct EdgeProperties {
    vehicle_type_id: String,
    vehicle_orientation: Option<f64>,
    orientation_type: Option<String>,
    rotation_allowed: Option<bool>,
    max_speed: Option<f64>,
    max_rotation_speed: Option<f64>,
    min_height: Option<f64>,
    max_height: Option<f64>,
    load_restriction: Option<LoadRestriction>,
    #[serde(default)]
    actions: Vec<Action>,
    trajectory: Option<Value>,
}

#[derive(Deserialize)]
struct LoadRestriction {
    unloaded: bool,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Station {
    interaction_node_ids: Vec<String>,
}

impl Layout {
    /// The vehicle types a layout file is for. At least one, so that reading for each of them reads something.
    ///
    /// # Errors
    /// When it is no layout, or for no vehicle type.
    pub fn vehicle_types(source: &Arc<Source>) -> Result<Vec<String>, Vec<Diagnostic>> {
        let file = File::read(source)?;
        let types = file.vehicle_types();
        if types.is_empty() {
            choose_type(source, &file, None)?;
        }
        Ok(types.into_iter().map(str::to_owned).collect())
    }

    /// Reads what `vehicle_type` may drive on; the one type in the file unless said. Nodes and edges of other
    /// types, edges an empty vehicle must not use, and those that demand an action are left out, which
    /// [`Layout::left_out`] tells.
    ///
    /// # Errors
    /// The first mistakes, each naming its node or edge.
    pub fn from_lif(source: &Arc<Source>, vehicle_type: Option<&str>) -> Result<Self, Vec<Diagnostic>> {
        let file = File::read(source)?;
        let vehicle_type = choose_type(source, &file, vehicle_type)?;
        let mut reader = Reader {
            source,
            vehicle_type: &vehicle_type,
            nodes: Vec::new(),
            edges: Vec::new(),
            left_out: Vec::new(),
            wrong: Vec::new(),
        };
        reader.check_ids(&file);
        for layout in &file.layouts {
            reader.layout(layout);
        }
        if !reader.wrong.is_empty() {
            return Err(reader.wrong);
        }
        Ok(Self::assemble(reader.nodes, reader.edges, reader.left_out))
    }
}

impl File {
    fn read(source: &Arc<Source>) -> Result<Self, Vec<Diagnostic>> {
        serde_json::from_str(&source.text).map_err(|error| {
            if let Some(version) = other_version(&source.text) {
                let title = format!("a layout of LIF {version}; LIF 1.0 is read");
                return vec![Diagnostic::new("lif", Span::new(source, 0, 0), title, "in this file")];
            }
            let at = offset(&source.text, error.line(), error.column());
            let message = error.to_string();
            let label = message
                .rsplit_once(" at line ")
                .map_or(message.as_str(), |(label, _)| label);
            let span = Span::new(source, at.saturating_sub(1), at);
            vec![Diagnostic::new(
                "lif",
                span,
                "this is not a layout in the format LIF 1.0",
                label,
            )]
        })
    }

    /// The vehicle types that some node is for.
    fn vehicle_types(&self) -> BTreeSet<&str> {
        let nodes = self.layouts.iter().flat_map(|layout| &layout.nodes);
        nodes
            .flat_map(|node| &node.vehicle_type_node_properties)
            .map(|properties| properties.vehicle_type_id.as_str())
            .collect()
    }
}

/// The version a file names, where it is another one than is read.
fn other_version(text: &str) -> Option<String> {
    let file: Value = serde_json::from_str(text).ok()?;
    let version = file.pointer("/metaInformation/lifVersion")?.as_str()?;
    let is_read = version
        .split('.')
        .next()
        .is_some_and(|major| major == "0" || major == "1");
    (!is_read).then(|| version.chars().take(32).collect())
}

/// Byte offset of a line and a column, both counted from 1.
fn offset(text: &str, line: usize, column: usize) -> usize {
    let before: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum();
    (before + column).min(text.len())
}

fn choose_type(source: &Arc<Source>, file: &File, wanted: Option<&str>) -> Result<String, Vec<Diagnostic>> {
    let types = file.vehicle_types();
    let refuse = |title: String, hint: String| {
        let span = Span::new(source, 0, 0);
        vec![Diagnostic::new("lif", span, title, "in this file").hint(hint)]
    };
    match (wanted, types.first()) {
        (Some(wanted), _) if types.contains(wanted) => Ok(wanted.to_owned()),
        (Some(wanted), _) => Err(refuse(
            format!("no node has vehicleTypeNodeProperties for `{wanted}`"),
            diagnostic::did_you_mean(wanted, types.iter().copied()),
        )),
        (None, Some(only)) if types.len() == 1 => Ok((*only).to_owned()),
        (None, None) => Err(refuse(
            "no node has vehicleTypeNodeProperties".to_owned(),
            "a node needs `vehicleTypeNodeProperties` for the vehicle to use it".to_owned(),
        )),
        (None, Some(_)) => Err(refuse(
            "the layout is for several vehicle types".to_owned(),
            format!(
                "name one with `vehicle-type`: {}",
                types.iter().copied().collect::<Vec<_>>().join(", ")
            ),
        )),
    }
}

struct Reader<'s> {
    source: &'s Arc<Source>,
    vehicle_type: &'s str,
    nodes: Vec<Node>,
    edges: Vec<Edge>,
    left_out: Vec<String>,
    wrong: Vec<Diagnostic>,
}

impl Reader<'_> {
    /// Where `"<key>": "<id>"` stands for the `occurrence`th time, or the start of the file.
    fn span(&self, key: &str, id: &str, occurrence: usize) -> Span {
        let text = &self.source.text;
        let key = format!("\"{key}\"");
        let id = Value::from(id).to_string();
        let found = text.match_indices(&key).filter_map(|(at, _)| {
            let after = &text[at + key.len()..];
            let value = after.trim_start().strip_prefix(':')?.trim_start();
            value.starts_with(&id).then(|| {
                let start = text.len() - value.len();
                start..start + id.len()
            })
        });
        let range = found.into_iter().nth(occurrence).unwrap_or(0..0);
        Span::new(self.source, range.start, range.end)
    }

    /// Whether enough mistakes are known. To find the place of one takes a walk through the whole text.
    fn is_enough(&self) -> bool {
        self.wrong.len() >= MOST_MISTAKES
    }

    fn complain(&mut self, key: &str, id: &str, title: String, label: &str, hint: &str) {
        if self.is_enough() {
            return;
        }
        let diagnostic = Diagnostic::new("lif", self.span(key, id, 0), title, label);
        self.wrong.push(diagnostic.hint(hint));
    }

    fn check_ids(&mut self, file: &File) {
        let mut seen = BTreeSet::new();
        for node in file.layouts.iter().flat_map(|layout| &layout.nodes) {
            if !seen.insert(node.node_id.as_str()) && !self.is_enough() {
                let title = format!("there are two nodes `{}`", node.node_id);
                let span = self.span("nodeId", &node.node_id, 1);
                self.wrong.push(Diagnostic::new("lif", span, title, "the second one"));
            }
        }
        for edge in file.layouts.iter().flat_map(|layout| &layout.edges) {
            for end in [&edge.start_node_id, &edge.end_node_id] {
                if !seen.contains(end.as_str()) && !self.is_enough() {
                    let title = format!("edge `{}` ends at the unknown node `{end}`", edge.edge_id);
                    let hint = match diagnostic::closest(end, seen.iter().copied()) {
                        Some(close) => format!("did you mean `{close}`?"),
                        None => "an edge joins two nodes of the same file".to_owned(),
                    };
                    self.complain("edgeId", &edge.edge_id, title, "this edge", &hint);
                }
            }
        }
    }

    fn layout(&mut self, layout: &FileLayout) {
        let stations: BTreeSet<&str> = layout
            .stations
            .iter()
            .flat_map(|station| &station.interaction_node_ids)
            .map(String::as_str)
            .collect();
        for node in &layout.nodes {
            self.node(node, stations.contains(node.node_id.as_str()), &layout.layout_id);
        }
        for edge in &layout.edges {
            self.edge(edge);
        }
    }

    fn node(&mut self, node: &FileNode, station: bool, layout: &str) {
        let id = &node.node_id;
        let all = &node.vehicle_type_node_properties;
        let Some(properties) = all.iter().find(|one| one.vehicle_type_id == self.vehicle_type) else {
            self.left_out.push(format!("node {id} is not for this vehicle type"));
            return;
        };
        if let Some(action) = demanded(&properties.actions) {
            self.left_out.push(format!("node {id} demands the action {action}"));
            return;
        }
        let Position { x, y } = node.node_position;
        if x.abs() > LARGEST || y.abs() > LARGEST {
            let title = format!("node `{id}` of layout `{layout}` lies at ({x}, {y})");
            self.complain("nodeId", id, title, "more than 10 km away", "positions are in metres");
        }
        if let Some(theta) = properties.theta.filter(|theta| !is_angle(*theta)) {
            let title = format!("theta of node `{id}` is {theta}");
            self.complain(
                "nodeId",
                id,
                title,
                "not an angle from -π to π",
                "angles are in radians",
            );
        }
        let Some(map_id) = node.map_id.clone() else {
            let title = format!("node `{id}` has no `mapId`");
            self.complain(
                "nodeId",
                id,
                title,
                "on which map?",
                "the text of LIF 1.0 demands it, though its schema does not",
            );
            return;
        };
        self.nodes.push(Node {
            id: id.clone(),
            map_id,
            x,
            y,
            theta: properties.theta,
            deviation_xy: None,
            deviation_theta: None,
            station,
        });
    }

    fn edge(&mut self, edge: &FileEdge) {
        let id = &edge.edge_id;
        let all = &edge.vehicle_type_edge_properties;
        let Some(properties) = all.iter().find(|one| one.vehicle_type_id == self.vehicle_type) else {
            self.left_out.push(format!("edge {id} is not for this vehicle type"));
            return;
        };
        if let Some(action) = demanded(&properties.actions) {
            self.left_out.push(format!("edge {id} demands the action {action}"));
            return;
        }
        if properties.load_restriction.as_ref().is_some_and(|load| !load.unloaded) {
            self.left_out.push(format!("edge {id} is not for an empty vehicle"));
            return;
        }
        if edge.start_node_id == edge.end_node_id {
            self.left_out.push(format!("edge {id} ends where it begins"));
            return;
        }
        for (name, speed) in [
            ("maxSpeed", properties.max_speed),
            ("maxRotationSpeed", properties.max_rotation_speed),
        ] {
            if let Some(speed) = speed.filter(|speed| *speed <= 0.0) {
                let title = format!("{name} of edge `{id}` is {speed}");
                self.complain(
                    "edgeId",
                    id,
                    title,
                    "nothing moves at this speed",
                    "leave it out for no limit",
                );
            }
        }
        if let Some(speed) = properties.max_speed.filter(|speed| *speed > 50.0) {
            let title = format!("maxSpeed of edge `{id}` is {speed}");
            self.complain(
                "edgeId",
                id,
                title,
                "faster than any vehicle",
                "speeds are in metres per second",
            );
        }
        // LIF has this in degrees in the example everybody copies, and in radians in its text.
        if let Some(angle) = properties.vehicle_orientation.filter(|angle| !is_angle(*angle)) {
            let title = format!("vehicleOrientation of edge `{id}` is {angle}");
            self.complain(
                "edgeId",
                id,
                title,
                "not an angle from -π to π",
                "angles are in radians",
            );
        }
        self.edges.push(Edge {
            id: id.clone(),
            start: edge.start_node_id.clone(),
            end: edge.end_node_id.clone(),
            max_speed: properties.max_speed,
            max_rotation_speed: properties.max_rotation_speed,
            orientation: properties.vehicle_orientation,
            orientation_type: properties.orientation_type.clone(),
            rotation_allowed: properties.rotation_allowed,
            max_height: properties.max_height,
            min_height: properties.min_height,
            direction: None,
            trajectory: properties.trajectory.clone(),
        });
    }
}

/// The first action that a vehicle has to do there.
fn demanded(actions: &[Action]) -> Option<&str> {
    let demanded = |action: &&Action| action.requirement_type.as_deref() == Some("REQUIRED");
    actions.iter().find(demanded).map(|action| action.action_type.as_str())
}

/// Whether it is an angle; a little beyond π is rounding.
fn is_angle(radians: f64) -> bool {
    radians.abs() <= std::f64::consts::PI + 0.001
}
