//! What the reference master control is told: its fleet, its site and its manners; what a vehicle can do comes from the
//! vehicle's factsheet (section 6.15).
//!
//! Everything that differs between protocol versions is handed in by the caller, who takes it from the pack.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::Value;
use tck_view::{Names, Topic};

/// One vehicle of the fleet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VehicleConfig {
    /// Manufacturer as in the header.
    pub manufacturer: String,
    /// Serial number as in the header.
    pub serial_number: String,
    /// Protocol version it is spoken to in, as in the header; it comes from the pack.
    pub version: String,
    /// Features of this version, by the names the packs use: `mapActions`, `factsheetRequest`, `corridors`.
    pub features: BTreeSet<String>,
    /// What this version calls the members of messages: the master control thinks by their usual names.
    pub names: Names,
    /// How many digits a timestamp has behind the second.
    pub timestamp_digits: usize,
    /// Full topic by topic name. A topic that is missing is neither subscribed nor published.
    pub topics: BTreeMap<String, String>,
}

/// A node of the layout.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SiteNode {
    /// nodeId.
    pub id: String,
    /// Position in metres.
    pub x: f64,
    /// Position in metres.
    pub y: f64,
    /// Orientation of a vehicle placed here, in radians.
    pub theta: Option<f64>,
    /// The map the position is on.
    pub map_id: String,
    /// allowedDeviationXY in metres.
    pub deviation_xy: Option<f64>,
    /// allowedDeviationTheta in radians.
    pub deviation_theta: Option<f64>,
}

/// A way from one node of the layout to another, in this direction only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SiteEdge {
    /// edgeId.
    pub id: String,
    /// Node where it begins.
    pub from: String,
    /// Node where it ends.
    pub to: String,
    /// maxSpeed in metres per second.
    pub max_speed: Option<f64>,
    /// maxHeight in metres.
    pub max_height: Option<f64>,
    /// minHeight in metres.
    pub min_height: Option<f64>,
    /// direction, for vehicles that follow a line.
    pub direction: Option<String>,
    /// leftWidth and rightWidth of a corridor, in metres.
    pub corridor: Option<(f64, f64)>,
}

/// A map the master control has for its vehicles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SiteMap {
    /// mapId.
    pub map_id: String,
    /// mapVersion.
    pub map_version: String,
    /// mapDownloadLink.
    pub link: String,
    /// mapHash.
    pub hash: Option<String>,
}

/// Configuration of the reference master control.
#[derive(Clone, Debug, PartialEq)]
pub struct MasterControlConfig {
    /// Its own name, and MQTT client identifier.
    pub name: String,
    /// The fleet.
    pub vehicles: Vec<VehicleConfig>,
    /// Nodes of the layout.
    pub nodes: Vec<SiteNode>,
    /// Ways between the nodes.
    pub edges: Vec<SiteEdge>,
    /// Maps it can roll out.
    pub maps: Vec<SiteMap>,
    /// The zone set it plans with, if it uses zones.
    pub zone_set: Option<String>,
    /// MQTT keep-alive.
    pub keep_alive: Duration,
    /// Time from a lost connection to the next attempt.
    pub reconnect_delay: Duration,
    /// An order or action that is not seen in a state by then is sent again.
    pub resend_after: Duration,
    /// Number of times it is sent again at most.
    pub resend_limit: u32,
    /// A waitForTrigger that runs longer is called off.
    pub trigger_timeout: Duration,
    /// Number of nodes released ahead of the vehicle.
    pub base_length: usize,
    /// Number of nodes shown behind the base.
    pub horizon_length: usize,
    /// Time a message lies before it is looked at.
    pub answers_after: Duration,
    /// Battery charge in percent below which no new order is begun, unless the vehicle charges.
    pub low_battery: f64,
    /// stationType of pick and drop.
    pub station_type: String,
    /// loadType where none is asked for.
    pub load_type: String,
    /// For how long something is given that a vehicle asks for; for good if nothing is said.
    pub lease: Option<Duration>,
}

impl Default for MasterControlConfig {
    fn default() -> Self {
        let (nodes, edges) = floor();
        Self {
            name: "reference-master-control".into(),
            vehicles: Vec::new(),
            nodes,
            edges,
            maps: Vec::new(),
            zone_set: None,
            keep_alive: Duration::from_secs(15),
            reconnect_delay: Duration::from_secs(1),
            resend_after: Duration::from_secs(5),
            resend_limit: 3,
            trigger_timeout: Duration::from_secs(60),
            base_length: 2,
            horizon_length: 3,
            answers_after: Duration::ZERO,
            low_battery: 15.0,
            station_type: "floor".into(),
            load_type: "EPAL".into(),
            lease: Some(Duration::from_secs(20)),
        }
    }
}

/// A ring of six nodes that is driven both ways: the floor the reference AGV knows.
fn floor() -> (Vec<SiteNode>, Vec<SiteEdge>) {
    let corners = [
        ("n1", 0.0, 0.0),
        ("n2", 3.0, 0.0),
        ("n3", 6.0, 0.0),
        ("n4", 6.0, 3.0),
        ("n5", 3.0, 3.0),
        ("n6", 0.0, 3.0),
    ];
    let node = |(id, x, y): &(&str, f64, f64)| SiteNode {
        id: (*id).to_owned(),
        x: *x,
        y: *y,
        map_id: "hall".into(),
        ..SiteNode::default()
    };
    let neighbours = corners.iter().zip(corners.iter().cycle().skip(1));
    let edges = neighbours.flat_map(|((a, ..), (b, ..))| [(*a, *b), (*b, *a)]);
    let edge = |(from, to): (&str, &str)| SiteEdge {
        id: format!("{from}-{to}"),
        from: from.to_owned(),
        to: to.to_owned(),
        max_speed: Some(1.5),
        ..SiteEdge::default()
    };
    (corners.iter().map(node).collect(), edges.map(edge).collect())
}

impl VehicleConfig {
    /// Whether the protocol version it is spoken to in has a feature.
    pub(crate) fn has(&self, feature: &str) -> bool {
        self.features.contains(feature)
    }

    /// A message for the vehicle, as its version writes it.
    pub(crate) fn spell(&self, topic: &str, message: &mut Value) {
        self.names.spell(Topic::of_name(topic).object(), message);
    }

    /// A message of the vehicle, by the usual names.
    pub(crate) fn understand(&self, topic: &str, message: &mut Value) {
        self.names.unspell(Topic::of_name(topic).object(), message);
    }

    /// The usual path of an optional parameter, such as `order.edges.maxSpeed`, that the factsheet of the vehicle calls as its
    /// version does; `None` if the version has no such member.
    pub(crate) fn usual_parameter(&self, own: &str) -> Option<String> {
        let (topic, path) = own.split_once('.')?;
        let depth = path.split('.').count();
        let nested = |inner: Value, name: &str| Value::Object([(name.to_owned(), inner)].into_iter().collect());
        let mut message = path.rsplit('.').fold(Value::Null, nested);
        self.understand(topic, &mut message);
        let mut usual = vec![topic.to_owned()];
        let mut here = &message;
        while let Some((name, inner)) = here.as_object().and_then(|members| members.iter().next()) {
            usual.push(name.clone());
            here = inner;
        }
        (usual.len() == depth + 1).then(|| usual.join("."))
    }
}

impl MasterControlConfig {
    /// The node of that id in the layout.
    pub(crate) fn node(&self, id: &str) -> Option<&SiteNode> {
        self.nodes.iter().find(|node| node.id == id)
    }
}
