//! The built-in reference AGV as a device under test: its floor, its profile, its configuration.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde_json::{Map, Value, json};

use super::header::Subject;
use crate::course::{Edge, Layout};
use crate::pack::{Pack, Role};
use crate::profile::TimeLimits;
use crate::reference::agv::tolerances::UnknownTolerance;
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

/// Kinds of reference AGVs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Vehicle {
    /// On virtual lines, as most vehicles are
    #[default]
    Usual,
    /// Follows a line on the floor, knows no coordinates, and stops on nodes only
    LineGuided,
    /// Plans its own way, follows trajectories, and keeps to corridors
    Free,
}

impl Vehicle {
    /// Every kind; the usual one first.
    pub const ALL: [Self; 3] = [Self::Usual, Self::LineGuided, Self::Free];
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
            state_interval: Duration::from_secs(3),
            visualization_interval: Some(Duration::from_secs(1)),
            // Few, so that an order with too many of them can be written down.
            max_nodes: 12,
            ..AgvConfig::default()
        };
        let time = TimeLimits {
            drive: Duration::from_secs(4),
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

    /// The same vehicle as other vehicles are, so that what only applies to them is proven as well: one that follows a
    /// line and can stop on nodes only, and one that plans its own way, follows trajectories and keeps to corridors.
    #[must_use]
    pub fn variants(pack: &Pack) -> Vec<Self> {
        Vehicle::ALL
            .into_iter()
            .map(|vehicle| Self::of(vehicle, pack))
            .collect()
    }

    /// One of them.
    #[must_use]
    pub fn of(vehicle: Vehicle, pack: &Pack) -> Self {
        let mut this = Self::new(pack);
        match vehicle {
            Vehicle::Usual => {}
            Vehicle::LineGuided => this.follow_a_line(),
            Vehicle::Free => {
                this.config.trajectories = true;
                this.config.plans = true;
            }
        }
        this
    }

    fn follow_a_line(&mut self) {
        self.layout = self.layout.clone().with_directions();
        self.config.stops_between_nodes = false;
        // It knows no coordinates, so it has no use for a pose or a map.
        let without = ["initPosition", "downloadMap", "enableMap", "deleteMap"];
        self.config.without_actions = without.map(str::to_owned).into();
        let branch = |edge: &Edge| Some((edge.start.clone(), edge.direction.clone()?, edge.end.clone()));
        self.config.branches = Some(self.layout.edges().filter_map(branch).collect());
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
            ("uninterruptible-action", true),
            ("edge-actions", true),
            ("no-charger-on-course", true),
            ("carries-load", true),
            ("map-hash", true),
            ("line-guided", self.config.branches.is_some()),
            ("free-navigation", self.config.plans),
            ("room-beside-edges", true),
        ]
        .into_iter()
        .map(|(name, said)| (name.to_owned(), said))
        .collect()
    }

    /// `device.*` beside identity and factsheet: the actions tests may use for their own ends.
    #[must_use]
    pub fn device_bindings(&self) -> Map<String, Value> {
        // Long enough for what a test does meanwhile.
        let seconds = 0.5 + 3.0 * (self.config.answers_after + self.config.min_state_interval).as_secs_f64();
        let action = |name: &str| json!({ "type": name, "parameters": { "duration": seconds } });
        let mut all = Map::new();
        all.insert("longAction".to_owned(), action("beep"));
        all.insert("uninterruptibleAction".to_owned(), action("calibrate"));
        all
    }

    /// Lets it take a liberty, and gives it the time it then needs.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let speed = self.config.speed;
        self.config.tolerate(name)?;
        self.time.drive = self.time.drive.mul_f64((speed / self.config.speed).max(1.0));
        Ok(())
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
        "move-to",
        "push-out",
        "place-obstacle",
        "remove-obstacle",
    ];
}
