//! The built-in reference AGV as a device under test: its floor, its profile, its configuration.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::header::Subject;
use crate::course::{BUILT_IN_MAP, BUILT_IN_UPPER_MAP, Layout};
use crate::pack::{Pack, Role};
use crate::profile::{Place, SAMPLE_ACTIONS, SampleAction, SampleActions, TimeLimits};
use crate::reference::agv::{AgvConfig, LayoutNode, OnboardMap};

/// The reference AGV and everything a run must know about it.
#[derive(Clone, Debug)]
pub struct ReferenceAgv {
    /// Who it says it is.
    pub subject: Subject,
    /// The floor.
    pub layout: Layout,
    /// How it is configured.
    pub config: AgvConfig,
    /// Its part of the timing contract.
    pub time: TimeLimits,
    /// The actions tests may use for their own ends, and where they can be performed.
    pub actions: SampleActions,
    /// Whether some tests are for a vehicle like this only, so that faults have to be tried on it as well.
    pub own_tests: bool,
}

/// Nodes of the built-in floor: a shelf with a load, a shelf that is taken, a lift, a charger.
const SHELF: &str = "E1";
const TAKEN_SHELF: &str = "E2";
const LIFT: &str = "E3";
const CHARGER: &str = "E4";
/// Where the vehicle comes out of the lift on the other floor.
const UPPER_LIFT: &str = "U3";

/// The actions of the built-in vehicle on the built-in floor.
fn sample_actions(layout: &Layout) -> SampleActions {
    let load = json!({ "stationType": "floor", "loadType": "EPAL" });
    let object = json!({ "objectType": "EPAL" });
    let lift = layout.node(UPPER_LIFT);
    let pose = json!({
        "x": lift.map(|node| node.x), "y": lift.map(|node| node.y), "theta": 0.0,
        "mapId": lift.map(|node| node.map_id.as_str()), "lastNodeId": UPPER_LIFT,
    });
    let edge = format!("D1-{SHELF}");
    let all = [
        ("long-action", "beep", "", json!({ "duration": 0.5 })),
        ("uninterruptible-action", "calibrate", "", json!({ "duration": 0.5 })),
        ("edge-condition", "warningLights", "warningLights", json!({})),
        ("pick", "pick", SHELF, load.clone()),
        ("drop", "drop", SHELF, load.clone()),
        ("edge-pick", "pick", &edge, load.clone()),
        ("edge-drop", "drop", &edge, load.clone()),
        ("failing-pick", "pick", LIFT, load.clone()),
        ("failing-drop", "drop", TAKEN_SHELF, load),
        ("detect-object", "detectObject", SHELF, object.clone()),
        ("edge-detect-object", "detectObject", &edge, object.clone()),
        ("failing-detect-object", "detectObject", LIFT, object),
        ("fine-positioning", "finePositioning", SHELF, json!({})),
        ("edge-fine-positioning", "finePositioning", &edge, json!({})),
        ("failing-fine-positioning", "finePositioning", LIFT, json!({})),
        ("start-charging", "startCharging", CHARGER, json!({})),
        ("failing-start-charging", "startCharging", SHELF, json!({})),
        ("lift", "initPosition", LIFT, pose),
    ];
    let sample = |(name, action_type, place, parameters): (&str, &str, &str, Value)| {
        let kind = SAMPLE_ACTIONS.iter().find(|kind| kind.name == name)?;
        let mut action = SampleAction::plain(action_type);
        action.parameters = parameters.as_object().cloned().unwrap_or_default();
        match kind.place {
            Place::Anywhere => {}
            Place::Shown => action.shows = Some(place.to_owned()),
            Place::Node => action.node = Some(place.to_owned()),
            Place::Edge => action.edge = Some(place.to_owned()),
        }
        Some((kind.name, action))
    };
    SampleActions(all.into_iter().filter_map(sample).collect())
}

impl ReferenceAgv {
    /// A reference AGV for a protocol version.
    #[must_use]
    pub fn new(pack: &Pack) -> Self {
        let subject = Subject {
            role: Role::Agv,
            manufacturer: "vda5050-tck".to_owned(),
            serial_number: "reference-agv".to_owned(),
            topic_template: None,
        };
        let layout = Layout::built_in();
        let actions = sample_actions(&layout);
        let layout = layout.with_stations(&actions);
        let nodes: Vec<LayoutNode> = layout
            .nodes()
            .map(|node| LayoutNode {
                id: node.id.clone(),
                x: node.x,
                y: node.y,
                theta: node.theta,
                map_id: node.map_id.clone(),
            })
            .collect();
        let first = nodes.first().map(|node| node.id.clone()).unwrap_or_default();
        let config = AgvConfig {
            manufacturer: subject.manufacturer.clone(),
            serial_number: subject.serial_number.clone(),
            version: pack.version.to_string(),
            topics: subject.topics(pack),
            features: pack
                .features()
                .filter(|(_, on)| *on)
                .map(|(name, _)| name.to_owned())
                .collect(),
            nodes,
            chargers: BTreeSet::from([CHARGER.to_owned()]),
            stations: [SHELF, TAKEN_SHELF].map(|node| (node.to_owned(), true)).into(),
            // Six more fit, which tests rely on.
            map_capacity: 8,
            start_node: first,
            maps: [BUILT_IN_MAP, BUILT_IN_UPPER_MAP]
                .map(|map| OnboardMap {
                    map_id: map.to_owned(),
                    map_version: "1".to_owned(),
                    enabled: true,
                })
                .to_vec(),
            // Brisk, so that a run over real sockets takes a minute; slow enough to be caught between two nodes.
            speed: 8.0,
            rotation_speed: 8.0 * std::f64::consts::PI,
            keep_alive: Duration::from_secs(10),
            reconnect_delay: Duration::from_millis(300),
            state_interval: Duration::from_secs(5),
            visualization_interval: Some(Duration::from_secs(1)),
            // Few, so that an order with too many of them can be written down.
            max_nodes: 12,
            ..AgvConfig::default()
        };
        let time = TimeLimits {
            drive: Duration::from_secs(10),
            quiet: Duration::from_millis(200),
            settle: Duration::from_millis(300),
            reconnect: Duration::from_secs(20),
            connect: Duration::from_secs(20),
            ..TimeLimits::default()
        };
        Self {
            subject,
            layout,
            config,
            time,
            actions,
            own_tests: true,
        }
    }

    /// The same vehicle as other vehicles are, so that what only applies to them is proven as well, and so that nobody
    /// is blamed for what they need not have: one that can stop on nodes only, one without loads and chargers, one
    /// without maps, and one that says as little as it may in its factsheet. The usual one is the first.
    #[must_use]
    pub fn variants(pack: &Pack) -> Vec<Self> {
        let usual = Self::new(pack);
        let mut node_bound = usual.clone();
        node_bound.config.stops_between_nodes = false;
        let mut without_loads = usual.clone();
        without_loads.own_tests = false;
        without_loads
            .actions
            .0
            .retain(|name, _| matches!(*name, "long-action" | "uninterruptible-action"));
        let of_stations = [
            "pick",
            "drop",
            "detectObject",
            "finePositioning",
            "startCharging",
            "stopCharging",
        ];
        without_loads.config.without_actions = of_stations.map(str::to_owned).into();
        let mut without_maps = usual.clone();
        without_maps.own_tests = false;
        without_maps
            .config
            .features
            .retain(|feature| feature != "maps" && feature != "mapActions");
        let mut terse = usual.clone();
        terse.own_tests = false;
        terse.config.minimal_factsheet = true;
        vec![usual, node_bound, without_loads, without_maps, terse]
    }

    /// What a profile would state about it.
    #[must_use]
    pub fn statements(&self) -> BTreeMap<String, bool> {
        let stops = self.config.stops_between_nodes;
        [
            ("stops-between-nodes", stops),
            ("node-bound", !stops),
            ("interruptible-actions", self.config.interruptible),
            ("uninterruptible-actions", true),
            ("edge-actions", true),
            ("small-map-storage", true),
            ("carries-load", !self.config.without_actions.contains("pick")),
            ("map-hash", true),
            ("line-guided", false),
            ("free-navigation", true),
        ]
        .into_iter()
        .chain(
            SAMPLE_ACTIONS
                .iter()
                .map(|kind| (kind.name, self.actions.0.contains_key(kind.name))),
        )
        .map(|(name, said)| (name.to_owned(), said))
        .collect()
    }

    /// `device.*` beside identity and factsheet: the actions tests may use for their own ends.
    #[must_use]
    pub fn device_bindings(&self) -> Map<String, Value> {
        self.actions.bindings()
    }

    /// Gives it another name.
    pub fn rename(&mut self, manufacturer: &str, serial_number: &str, topic_template: Option<&str>, pack: &Pack) {
        manufacturer.clone_into(&mut self.subject.manufacturer);
        serial_number.clone_into(&mut self.subject.serial_number);
        self.subject.topic_template = topic_template.map(str::to_owned);
        self.config.manufacturer.clone_from(&self.subject.manufacturer);
        self.config.serial_number.clone_from(&self.subject.serial_number);
        self.config.topics = self.subject.topics(pack);
    }

    /// The hooks it understands as commands.
    pub const HOOKS: [&'static str; 17] = [
        "power-cycle",
        "shutdown",
        "start",
        "set-mode",
        "emergency-stop",
        "release-emergency-stop",
        "trigger",
        "place-load",
        "remove-load",
        "press-pause",
        "release-pause",
        "block-pause",
        "unblock-pause",
        "use-lift",
        "enable-map",
        "enter-field",
        "leave-field",
    ];
}
