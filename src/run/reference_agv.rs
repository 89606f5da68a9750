//! The built-in reference AGV as a device under test: its floor, its profile, its configuration.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::header::Subject;
use crate::course::Layout;
use crate::pack::{Pack, Role};
use crate::profile::TimeLimits;
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
        let first = nodes
            .first()
            .map(|node| (node.id.clone(), node.map_id.clone()))
            .unwrap_or_default();
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
            // Tests rely on it: there is nothing to charge at on the built-in floor.
            chargers: BTreeSet::new(),
            start_node: first.0,
            zone_set: Some("hall-zones".to_owned()),
            maps: vec![OnboardMap {
                map_id: first.1,
                map_version: "1".to_owned(),
                enabled: true,
            }],
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
        }
    }

    /// The same vehicle as other vehicles are, so that what only applies to them is proven as well: one that can
    /// stop on nodes only.
    #[must_use]
    pub fn variants(pack: &Pack) -> Vec<Self> {
        let usual = Self::new(pack);
        let mut node_bound = usual.clone();
        node_bound.config.stops_between_nodes = false;
        vec![usual, node_bound]
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
            ("long-action", true),
            ("brief-action", true),
            ("uninterruptible-action", true),
            ("edge-actions", true),
            ("instant-actions", true),
            ("no-charger-on-course", true),
            ("carries-load", true),
            ("map-hash", true),
            ("line-guided", false),
            ("free-navigation", true),
        ]
        .into_iter()
        .map(|(name, said)| (name.to_owned(), said))
        .collect()
    }

    /// `device.*` beside identity and factsheet: the actions tests may use for their own ends.
    #[must_use]
    pub fn device_bindings(&self) -> Map<String, Value> {
        let action = |name: &str, duration: f64| json!({ "type": name, "parameters": { "duration": duration } });
        let mut all = Map::new();
        all.insert("longAction".to_owned(), action("beep", 0.5));
        all.insert("briefAction".to_owned(), action("beep", 0.05));
        all.insert("uninterruptibleAction".to_owned(), action("calibrate", 0.5));
        all
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
    pub const HOOKS: [&'static str; 18] = [
        "power-cycle",
        "shutdown",
        "start",
        "set-mode",
        "drive-manually",
        "move-to",
        "provoke-error",
        "clear-error",
        "emergency-stop",
        "release-emergency-stop",
        "trigger",
        "place-load",
        "remove-load",
        "press-pause",
        "release-pause",
        "enable-map",
        "enter-field",
        "leave-field",
    ];
}
