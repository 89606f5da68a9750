//! LIF, the layout interchange format of the VDMA: what of a layout one type of vehicle may drive on. Version 1.0 is read, and
//! the drafts of version 2 as far as they say the same; what is not read is named.
//!
//! A vehicle will drive by these numbers, so a file that looks wrong is refused rather than guessed at: degrees
//! where radians should be, millimetres where metres should be.

mod file;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde_json::Value;

use self::file::{EdgeProperties, File, FileEdge, FileLayout, FileNode, Position, Requirement, about_driving};
use super::demand::Demand;
use super::layout::{Edge, Layout, Node};
use tck_base::diagnostic::{self, Diagnostic, Source, Span};

/// No floor is larger than this from its origin, in metres; beyond it, the file is in other units.
const LARGEST: f64 = 10_000.0;

/// A file in the wrong unit has one mistake per node; nobody reads more of them than this.
const MOST_MISTAKES: usize = 20;

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
        Ok(types.into_iter().collect())
    }

    /// How many nodes and edges a layout file has, whatever vehicle they are for.
    ///
    /// # Errors
    /// When it is no layout.
    pub fn written_in(source: &Arc<Source>) -> Result<(usize, usize), Vec<Diagnostic>> {
        let file = File::read(source)?;
        let nodes: BTreeSet<&str> = file
            .layouts()
            .flat_map(|layout| layout.nodes.iter().map(|node| node.node_id.as_str()))
            .collect();
        let edges: BTreeSet<&str> = file
            .layouts()
            .flat_map(|layout| layout.edges.iter().map(|edge| edge.edge_id.as_str()))
            .collect();
        Ok((nodes.len(), edges.len()))
    }

    /// Reads what `vehicle_type` may drive on; the one type in the file unless said. Nodes and edges of other
    /// types and what an empty vehicle must not use are left out, which [`Layout::left_out`] tells. What demands an action is
    /// there, until [`Layout::fitted`] says whether the vehicle can do it.
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
            unread: BTreeMap::new(),
            wrong: Vec::new(),
        };
        reader.check_ids(&file);
        for layout in file.layouts() {
            reader.layout(layout);
        }
        if !reader.wrong.is_empty() {
            return Err(reader.wrong);
        }
        // Of parallel edges the first one counts: rather one that demands nothing.
        reader.edges.sort_by_key(|edge| !edge.demands.is_empty());
        let unread = reader.unread.into_iter().map(Unread::sentence).collect();
        Ok(Self::assemble(reader.nodes, reader.edges, reader.left_out).read_from(&source.name, unread))
    }
}

/// What of nodes or edges is not read or not sent, and what is said about it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Unread {
    what: String,
    of: &'static str,
    why: &'static str,
}

impl Unread {
    fn sentence((this, count): (Self, usize)) -> String {
        let Self { what, of, why } = this;
        let s = if count == 1 { "" } else { "s" };
        format!("{what} of {count} {of}{s} {why}")
    }
}

/// Nothing here knows the member.
const NOT_READ: &str = "is not read";
/// Orders have no member for it.
const NO_WORD: &str = "goes into no order, for orders have no word for it";
/// Orders have a member for one of them.
const ONE_WORD: &str = "goes into no order, for an order has one";
/// Nobody can know when.
const NOT_SENT: &str = "goes into no order, for it depends on more than the layout says";

impl File {
    fn read(source: &Arc<Source>) -> Result<Self, Vec<Diagnostic>> {
        let version = named_version(&source.text);
        let major = version.as_deref().and_then(|version| version.split('.').next());
        if let Some(version) = version.as_deref().filter(|_| !matches!(major, Some("0" | "1" | "2"))) {
            let title = format!("a layout of LIF {version}; LIF 1.0 is read, and drafts of LIF 2");
            return Err(vec![Diagnostic::new(
                "lif",
                Span::new(source, 0, 0),
                title,
                "in this file",
            )]);
        }
        let format = if major == Some("2") { "LIF 2" } else { "LIF 1.0" };
        let no_layout = |span: Span, label: &str| {
            let title = format!("this is not a layout in the format {format}");
            vec![Diagnostic::new("lif", span, title, label)]
        };
        let file: Self = serde_json::from_str(&source.text).map_err(|error| {
            let at = offset(&source.text, error.line(), error.column());
            let message = error.to_string();
            let label = message
                .rsplit_once(" at line ")
                .map_or(message.as_str(), |(label, _)| label);
            no_layout(Span::new(source, at.saturating_sub(1), at), label)
        })?;
        if file.has_layouts() {
            Ok(file)
        } else {
            Err(no_layout(Span::new(source, 0, 0), "missing field `layouts`"))
        }
    }

    /// The vehicle types that some node is for.
    fn vehicle_types(&self) -> BTreeSet<String> {
        let nodes = self.layouts().flat_map(|layout| &layout.nodes);
        let properties = nodes.flat_map(|node| &node.vehicle_type_node_properties);
        properties.flat_map(file::NodeProperties::types).collect()
    }
}

/// The version that a file names.
fn named_version(text: &str) -> Option<String> {
    #[derive(serde::Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Head {
        meta_information: Meta,
    }
    #[derive(serde::Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Meta {
        lif_version: String,
    }
    let head: Head = serde_json::from_str(text).ok()?;
    Some(head.meta_information.lif_version.chars().take(32).collect())
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
            diagnostic::did_you_mean(wanted, types.iter().map(String::as_str)),
        )),
        (None, Some(only)) if types.len() == 1 => Ok(only.clone()),
        (None, None) => Err(refuse(
            "no node has vehicleTypeNodeProperties".to_owned(),
            "a node needs `vehicleTypeNodeProperties` for the vehicle to use it".to_owned(),
        )),
        (None, Some(_)) => Err(refuse(
            "the layout is for several vehicle types".to_owned(),
            format!(
                "name one with `vehicle-type`: {}",
                types.iter().map(String::as_str).collect::<Vec<_>>().join(", ")
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
    /// How many nodes or edges have it.
    unread: BTreeMap<Unread, usize>,
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
        for node in file.layouts().flat_map(|layout| &layout.nodes) {
            if !seen.insert(node.node_id.as_str()) && !self.is_enough() {
                let title = format!("there are two nodes `{}`", node.node_id);
                let span = self.span("nodeId", &node.node_id, 1);
                self.wrong.push(Diagnostic::new("lif", span, title, "the second one"));
            }
        }
        for edge in file.layouts().flat_map(|layout| &layout.edges) {
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

    fn not_read(&mut self, what: impl Into<String>, of: &'static str, why: &'static str) {
        let what = what.into();
        *self.unread.entry(Unread { what, of, why }).or_default() += 1;
    }

    /// The actions that are demanded there; the others are counted.
    fn demands(&mut self, actions: Vec<(Requirement, Demand)>, of: &'static str) -> Vec<Demand> {
        let mut demands = Vec::new();
        for (requirement, action) in actions {
            match requirement {
                Requirement::Required => demands.push(action),
                other => {
                    let what = format!("the {} action {}", other.word(), action.action_type);
                    self.not_read(what, of, NOT_SENT);
                }
            }
        }
        demands
    }

    fn layout(&mut self, layout: &FileLayout) {
        for name in about_driving(&layout.unknown) {
            self.not_read(name, "layout", NOT_READ);
        }
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
        let mine = |one: &&file::NodeProperties| one.types().iter().any(|name| name == self.vehicle_type);
        let Some(properties) = all.iter().find(mine) else {
            self.left_out.push(format!("node {id} is not for this vehicle type"));
            return;
        };
        if properties.load_restriction.as_ref().is_some_and(|load| !load.unloaded) {
            self.left_out.push(format!("node {id} is not for an empty vehicle"));
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
        for name in about_driving(&node.unknown).chain(about_driving(&properties.unknown)) {
            self.not_read(name, "node", NOT_READ);
        }
        let demands = self.demands(properties.actions(), "node");
        self.nodes.push(Node {
            id: id.clone(),
            map_id,
            x,
            y,
            theta: properties.theta,
            deviation_xy: None,
            deviation_theta: None,
            // Courses avoid it, so that as few tests as possible take the time of the actions.
            station: station || !demands.is_empty(),
            demands,
        });
    }

    fn edge(&mut self, edge: &FileEdge) {
        let id = &edge.edge_id;
        let all = &edge.vehicle_type_edge_properties;
        let mine = |one: &&EdgeProperties| one.types().iter().any(|name| name == self.vehicle_type);
        let Some(properties) = all.iter().find(mine) else {
            self.left_out.push(format!("edge {id} is not for this vehicle type"));
            return;
        };
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
        let orientations = properties.orientations();
        if let Some(angle) = orientations.iter().find(|angle| !is_angle(**angle)) {
            let title = format!("vehicleOrientation of edge `{id}` is {angle}");
            self.complain(
                "edgeId",
                id,
                title,
                "not an angle from -π to π",
                "angles are in radians",
            );
        }
        self.count_unread(edge, properties);
        if orientations.len() > 1 {
            self.not_read("every orientation but the first", "edge", ONE_WORD);
        }
        let demands = self.demands(properties.actions(), "edge");
        let line = properties.physical_line_guided_property.as_ref();
        self.edges.push(Edge {
            id: id.clone(),
            start: edge.start_node_id.clone(),
            end: edge.end_node_id.clone(),
            max_speed: properties.max_speed,
            max_rotation_speed: properties.max_rotation_speed,
            orientation: orientations.first().copied(),
            orientation_type: properties.orientation_type.clone(),
            rotation_allowed: properties.rotation_allowed(),
            max_height: properties.max_height,
            min_height: properties.min_height,
            direction: line.and_then(|line| line.direction.clone()),
            trajectory: properties.trajectory(),
            demands,
            told: Vec::new(),
        });
    }

    /// Counts what an edge says and nobody reads, or no order can say.
    fn count_unread(&mut self, edge: &FileEdge, properties: &EdgeProperties) {
        let line = properties.physical_line_guided_property.as_ref();
        let of_line = line.into_iter().flat_map(|line| about_driving(&line.unknown));
        let of_edge = about_driving(&edge.unknown).chain(about_driving(&properties.unknown));
        for name in of_edge.chain(of_line) {
            self.not_read(name, "edge", NOT_READ);
        }
        for (name, rotation) in [
            ("rotationAtStartNodeAllowed", &properties.rotation_at_start_node_allowed),
            ("rotationAtEndNodeAllowed", &properties.rotation_at_end_node_allowed),
        ] {
            // Both directions are what goes without saying.
            if rotation.as_deref().is_some_and(|allowed| allowed != "BOTH") {
                self.not_read(name, "edge", NO_WORD);
            }
        }
    }
}

/// Whether it is an angle; a little beyond π is rounding.
fn is_angle(radians: f64) -> bool {
    radians.abs() <= std::f64::consts::PI + 0.001
}
