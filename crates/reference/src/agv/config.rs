//! What one reference AGV is told about itself: identity, site, capabilities and timing; most of it stands in its
//! factsheet (section 6.15).
//!
//! Everything that differs between protocol versions (version string, topics, error names, features) is handed in by
//! the caller, who takes it from the pack. Names of errors that the standard does not give are those of the rulings
//! (ORD-FLOW-01, ORD-FLOW-04, ORD-REJ-15, CORR-07).

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use tck_view::Names;

use super::read::MAX_STRING;

/// Names of the load handling devices.
pub(crate) const LOAD_POSITIONS: [&str; 1] = ["LHD1"];

/// At most this many actions of one instantActions message are taken.
pub(crate) const MAX_INSTANT_ACTIONS: usize = 50;

/// A node of the layout the vehicle knows.
#[derive(Clone, Debug, PartialEq)]
pub struct LayoutNode {
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
}

/// A map on board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OnboardMap {
    /// mapId.
    pub map_id: String,
    /// mapVersion.
    pub map_version: String,
    /// `mapStatus` ENABLED (else DISABLED).
    pub enabled: bool,
}

/// The errorType the vehicle reports for each kind of problem.
///
/// The default holds the names the standard gives; where it gives none, a name of its family.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ErrorNames {
    /// A message that is not well-formed (ORD-REJ-02).
    pub validation: String,
    /// An order with something the vehicle cannot do (ORD-REJ-06).
    pub order: String,
    /// An order update with an outdated orderUpdateId (ORD-REJ-12).
    pub outdated_update: String,
    /// An order update that does not continue the order (ORD-FLOW-08, ORD-FLOW-10).
    pub broken_update: String,
    /// A new order while another one is active (ORD-FLOW-01).
    pub other_order_active: String,
    /// A new order whose first node is too far away (ORD-FLOW-04).
    pub start_out_of_range: String,
    /// An order on a map that is not on board or not enabled (MAP-08).
    pub unknown_map: String,
    /// An order that exceeds the memory (ORD-REJ-15).
    pub memory: String,
    /// cancelOrder without an order (ORD-CANCEL-19).
    pub no_order_to_cancel: String,
    /// An instant action the vehicle cannot perform (IACT-06).
    pub instant_action: String,
    /// downloadMap, enableMap or deleteMap failed.
    pub map: String,
    /// The pose cannot be taken over.
    pub localization: String,
    /// Charging could not be started.
    pub charging: String,
    /// pick or drop failed.
    pub load: String,
    /// The emergency stop is active.
    pub emergency_stop: String,
    /// The vehicle is outside its corridor (CORR-07).
    pub outside_of_corridor: String,
    /// An optional field that the vehicle has no use for (OPT-02).
    pub unsupported: String,
    /// Other content under the ids of the order there is (ORD-REJ-13).
    pub same_update: String,
    /// An update of an order that was cancelled.
    pub after_cancel: String,
    /// An order in a mode that takes none (MODE-02).
    pub not_available: String,
    /// The vehicle cannot tell where it is (STATE-MSG-19).
    pub lost: String,
    /// An order with a node that cannot be reached.
    pub no_route: String,
    /// A map that is on board is to be downloaded (MAP-23).
    pub duplicate_map: String,
    /// A zone set is on board already (ZSET-13).
    pub duplicate_zone_set: String,
    /// A zone set cannot be used, or an action about one failed.
    pub zone_set: String,
    /// The vehicle is inside a blocked zone (ZONE-06).
    pub blocked_zone: String,
    /// An action of a zone would break the rule of another one (ZINT-03).
    pub zone_action_conflict: String,
    /// The release of a zone is lost, and the vehicle stops in it (ZONE-11).
    pub release_lost: String,
    /// The release of a zone is lost, and the vehicle drives out of it (ZREQ-13).
    pub release_loss: String,
    /// A node turns out to be out of reach on the way (ZERR-01).
    pub node_unreachable: String,
}

/// What a protocol version says of an error that it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ErrorRule {
    /// errorLevel.
    pub level: String,
    /// How long it stands.
    pub until: ErrorEnd,
}

/// What ends an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorEnd {
    /// A new order is accepted.
    NewOrder,
    /// A new instant action is accepted.
    InstantAction,
    /// An instant action about maps is accepted.
    MapAction,
    /// The mode allows orders.
    Mode,
    /// As its cause wants.
    Cause,
}

impl ErrorEnd {
    /// What a vocabulary calls it.
    #[must_use]
    pub fn of_word(word: &str) -> Self {
        match word {
            "new-order" => Self::NewOrder,
            "new-instant-action" => Self::InstantAction,
            "map-action" => Self::MapAction,
            "mode" => Self::Mode,
            _ => Self::Cause,
        }
    }
}

impl Default for ErrorNames {
    fn default() -> Self {
        let name = str::to_owned;
        Self {
            validation: name("validationError"),
            order: name("orderError"),
            outdated_update: name("orderUpdateError"),
            broken_update: name("orderUpdateError"),
            other_order_active: name("orderError"),
            start_out_of_range: name("noRouteError"),
            unknown_map: name("orderError"),
            memory: name("orderError"),
            no_order_to_cancel: name("noOrderToCancel"),
            instant_action: name("instantActionError"),
            map: name("mapError"),
            localization: name("localizationError"),
            charging: name("chargingError"),
            load: name("loadError"),
            emergency_stop: name("emergencyStop"),
            outside_of_corridor: name("outsideOfCorridor"),
            unsupported: name("orderError"),
            same_update: name("orderUpdateError"),
            after_cancel: name("orderUpdateError"),
            not_available: name("orderError"),
            duplicate_map: name("mapError"),
            duplicate_zone_set: name("zoneSetError"),
            zone_set: name("zoneSetError"),
            blocked_zone: name("zoneError"),
            zone_action_conflict: name("zoneError"),
            release_lost: name("zoneError"),
            release_loss: name("zoneReleaseError"),
            node_unreachable: name("noRouteError"),
            lost: name("localizationError"),
            no_route: name("noRouteError"),
        }
    }
}

impl ErrorNames {
    /// The names a vocabulary gives (such as `error.validation`), and the default where it gives none.
    #[must_use]
    pub fn from_vocabulary<'a>(word: impl Fn(&str) -> Option<&'a str>) -> Self {
        let mut names = Self::default();
        let entries = [
            (&mut names.validation, "error.validation"),
            (&mut names.order, "error.order"),
            (&mut names.outdated_update, "error.outdatedUpdate"),
            (&mut names.broken_update, "error.badContinuation"),
            (&mut names.other_order_active, "error.newOrderWhileBusy"),
            (&mut names.start_out_of_range, "error.startTooFar"),
            (&mut names.unknown_map, "error.unknownMap"),
            (&mut names.memory, "error.memoryExceeded"),
            (&mut names.no_order_to_cancel, "error.noOrderToCancel"),
            (&mut names.instant_action, "error.unknownInstantAction"),
            (&mut names.map, "error.mapDownload"),
            (&mut names.load, "error.actionFailed"),
            (&mut names.outside_of_corridor, "error.outsideCorridor"),
            (&mut names.unsupported, "error.unsupportedField"),
            (&mut names.same_update, "error.sameUpdate"),
            (&mut names.after_cancel, "error.updateAfterCancel"),
            (&mut names.not_available, "error.notAvailable"),
            (&mut names.duplicate_map, "error.duplicateMap"),
            (&mut names.duplicate_zone_set, "error.duplicateZoneSet"),
            (&mut names.zone_set, "error.zoneSet"),
            (&mut names.blocked_zone, "error.blockedZone"),
            (&mut names.zone_action_conflict, "error.zoneActionConflict"),
            (&mut names.release_lost, "error.releaseLost"),
            (&mut names.node_unreachable, "error.nodeUnreachable"),
            (&mut names.lost, "error.localization"),
            (&mut names.no_route, "error.noRoute"),
        ];
        for (name, path) in entries {
            if let Some(word) = word(path) {
                word.clone_into(name);
            }
        }
        names
    }
}

/// Configuration of a reference AGV.
#[derive(Clone, Debug, PartialEq)]
pub struct AgvConfig {
    /// Manufacturer as in the header.
    pub manufacturer: String,
    /// Serial number as in the header.
    pub serial_number: String,
    /// Protocol version as in the header. Empty by default: it comes from the pack.
    pub version: String,
    /// Full topic by topic name. A topic that is missing is neither subscribed nor published.
    pub topics: BTreeMap<String, String>,
    /// Features of the protocol version, by the names the packs use: `maps` (in the state), `mapActions`,
    /// `factsheetRequest`, `retainedFactsheet`, `vehicleConfig` and so on.
    pub features: BTreeSet<String>,
    /// What the protocol version calls the members of messages: the vehicle thinks by their usual names.
    pub names: Names,
    /// How many digits a timestamp has behind the second.
    pub timestamp_digits: usize,
    /// Names of errors.
    pub errors: ErrorNames,
    /// What the version says of errors, by their names; a WARNING that ends as its cause wants where it says nothing.
    pub error_rules: BTreeMap<String, ErrorRule>,
    /// The factsheet says only what it has to.
    pub minimal_factsheet: bool,
    /// Predefined actions this vehicle does *not* offer.
    pub without_actions: BTreeSet<String>,
    /// Nodes the vehicle knows the position of. Vehicles of one site share them.
    pub nodes: Arc<[LayoutNode]>,
    /// The node it stands on when it is switched on for the first time.
    pub start_node: String,
    /// The zone set it plans with, if it knows zones.
    pub zone_set: Option<String>,
    /// Kinds of zones it heeds, in a version that sends zone sets.
    pub zone_types: BTreeSet<String>,
    /// Driving speed in metres per second. Acceleration is ignored.
    pub speed: f64,
    /// Factor by which it is slower than usual for reasons of its own.
    pub slowness: f64,
    /// Turning speed in radians per second.
    pub rotation_speed: f64,
    /// Height of the vehicle in metres, against edge.maxHeight.
    pub height: f64,
    /// Distance from a node at which the vehicle is still on it, in metres, where the order does not say.
    pub reach: f64,
    /// Difference in orientation at which the vehicle is still on a node, in radians.
    pub reach_theta: f64,
    /// A state is sent at the latest after this time (STATE-02).
    pub state_interval: Duration,
    /// No state is sent sooner after another than this (FACT-14).
    pub min_state_interval: Duration,
    /// Time a message lies before it is looked at.
    pub answers_after: Duration,
    /// Interval of the visualization topic; off if `None`.
    pub visualization_interval: Option<Duration>,
    /// MQTT keep-alive (CONN-04).
    pub keep_alive: Duration,
    /// Time from a lost connection to the next attempt.
    pub reconnect_delay: Duration,
    /// Time an action runs.
    pub action_duration: Duration,
    /// Time actions of a type run, where it differs.
    pub action_durations: BTreeMap<String, Duration>,
    /// Whether running actions end when their order is cancelled. `calibrate` never does, `waitForTrigger` always.
    pub interruptible: bool,
    /// Whether the vehicle can stop between nodes when its order is cancelled.
    pub stops_between_nodes: bool,
    /// Whether it follows trajectories of orders, and keeps to corridors where the version has them.
    pub trajectories: bool,
    /// Whether it plans its path itself, and reports it (STATE-14).
    pub plans: bool,
    /// Whether it gets its power from the floor all the time.
    pub permanently_powered: bool,
    /// Whether it follows a line on the floor, knows places by their names only, and takes the branch it is told
    /// (ORD-MSG-27): start node, direction and end node of every branch.
    pub branches: Option<Vec<(String, String, String)>>,
    /// Nodes with a charger.
    pub chargers: BTreeSet<String>,
    /// Nodes where loads are handed over, and whether one stands there at first.
    pub stations: BTreeMap<String, bool>,
    /// Number of maps the vehicle can store.
    pub map_capacity: usize,
    /// Maps on board at first.
    pub maps: Vec<OnboardMap>,
    /// A download that has not ended by then has failed.
    pub download_timeout: Duration,
    /// Time an error without a rule for its end stays.
    pub error_duration: Duration,
    /// Largest number of nodes in an order, and in all its nodeStates.
    pub max_nodes: usize,
    /// Largest number of actions per node or edge.
    pub max_actions: usize,
    /// Largest number of actions in an instantActions message.
    pub max_instant_actions: usize,
    /// Most characters of an id.
    pub max_id: usize,
    /// It takes ids of digits only.
    pub numerical_ids: bool,
    /// Names of its load handling devices (loadSpecification.loadPositions).
    pub load_positions: Vec<String>,
    /// Largest message in bytes.
    pub max_message: usize,
    /// What is switched on at the hook points, by name.
    pub switched_on: Vec<&'static str>,
}

impl Default for AgvConfig {
    fn default() -> Self {
        let corners = [
            ("n1", 0.0, 0.0),
            ("n2", 3.0, 0.0),
            ("n3", 6.0, 0.0),
            ("n4", 6.0, 3.0),
            ("n5", 3.0, 3.0),
        ];
        let nodes: Vec<LayoutNode> = corners
            .into_iter()
            .chain([("n6", 0.0, 3.0)])
            .map(|(id, x, y)| LayoutNode {
                id: id.into(),
                x,
                y,
                theta: None,
                map_id: "hall".into(),
            })
            .collect();
        let chargers = nodes.iter().map(|node| node.id.clone()).collect();
        let stations = nodes.iter().map(|node| (node.id.clone(), true)).collect();
        Self {
            manufacturer: "Reference".into(),
            serial_number: "agv-1".into(),
            version: String::new(),
            topics: BTreeMap::new(),
            features: [
                "maps",
                "mapActions",
                "factsheetRequest",
                "retainedFactsheet",
                "vehicleConfig",
            ]
            .map(String::from)
            .into(),
            names: Names::default(),
            timestamp_digits: 2,
            errors: ErrorNames::default(),
            error_rules: BTreeMap::new(),
            minimal_factsheet: false,
            without_actions: BTreeSet::new(),
            nodes: nodes.into(),
            start_node: "n1".into(),
            zone_set: None,
            zone_types: BTreeSet::new(),
            speed: 2.0,
            slowness: 1.0,
            rotation_speed: std::f64::consts::PI,
            height: 1.0,
            reach: 0.1,
            reach_theta: 0.05,
            state_interval: Duration::from_secs(10),
            min_state_interval: Duration::ZERO,
            answers_after: Duration::ZERO,
            visualization_interval: None,
            keep_alive: Duration::from_secs(15),
            reconnect_delay: Duration::from_secs(1),
            action_duration: Duration::from_millis(300),
            action_durations: BTreeMap::new(),
            interruptible: true,
            stops_between_nodes: true,
            trajectories: false,
            plans: false,
            permanently_powered: false,
            branches: None,
            chargers,
            stations,
            map_capacity: 8,
            maps: vec![OnboardMap {
                map_id: "hall".into(),
                map_version: "1".into(),
                enabled: true,
            }],
            download_timeout: Duration::from_secs(20),
            error_duration: Duration::from_secs(2),
            max_nodes: 200,
            max_actions: 20,
            max_instant_actions: MAX_INSTANT_ACTIONS,
            max_id: MAX_STRING,
            numerical_ids: false,
            load_positions: LOAD_POSITIONS.map(str::to_owned).to_vec(),
            max_message: 1 << 20,
            switched_on: Vec::new(),
        }
    }
}

impl AgvConfig {
    /// The full topic of a topic name.
    pub(crate) fn topic(&self, name: &str) -> Option<&str> {
        self.topics.get(name).map(String::as_str)
    }

    /// Whether the protocol version has a feature.
    pub(crate) fn has(&self, feature: &str) -> bool {
        self.features.contains(feature)
    }

    /// Whether it listens to a topic.
    pub(crate) fn listens(&self, name: &str) -> bool {
        match name {
            "responses" => self.uses("releaseRequired") || self.asks_for_zones(),
            "zoneSet" => self.heeds_zones(),
            _ => true,
        }
    }

    /// Whether it knows zones that it may enter only when it is allowed to.
    pub(crate) fn asks_for_zones(&self) -> bool {
        self.heeds("RELEASE") || self.heeds("COORDINATED_REPLANNING")
    }

    /// Whether it takes zone sets.
    pub(crate) fn heeds_zones(&self) -> bool {
        self.has("zones") && !self.zone_types.is_empty()
    }

    /// Whether it does what zones of a kind ask for.
    pub(crate) fn heeds(&self, zone_type: &str) -> bool {
        self.has("zones") && self.zone_types.contains(zone_type)
    }

    /// Whether it follows a line and knows no coordinates.
    pub(crate) fn line_guided(&self) -> bool {
        self.branches.is_some()
    }

    /// Whether it can use an optional field of an edge.
    pub(crate) fn uses(&self, field: &str) -> bool {
        match field {
            "trajectory" => self.trajectories,
            "corridor" => self.trajectories && self.has("corridors"),
            "releaseRequired" => self.uses("corridor") && self.has("corridorRelease"),
            "direction" => self.line_guided(),
            _ => false,
        }
    }

    /// The node of that id in the layout.
    pub(crate) fn node(&self, id: &str) -> Option<&LayoutNode> {
        self.nodes.iter().find(|node| node.id == id)
    }
}
