//! The built-in reference AGV as a device under test: its floor, its profile, its configuration.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value, json};

use tck_course::{BUILT_IN_MAP, BUILT_IN_UPPER_MAP, Edge, Layout};
use tck_pack::Participant;
use tck_pack::{Pack, Role};
use tck_profile::{Place, SAMPLE_ACTIONS, SampleAction, SampleActions, TimeLimits};
use tck_reference::agv::{AgvConfig, ErrorEnd, ErrorNames, ErrorRule, LayoutNode, OnboardMap, ZONE_TYPES};
use tck_reference::deviations::agv::UnknownTolerance;
use tck_view::Names;

/// The reference AGV and everything a run must know about it.
#[derive(Clone, Debug)]
pub struct ReferenceAgv {
    /// Who it says it is.
    pub subject: Participant,
    /// The floor, which a whole fleet shares.
    pub layout: Arc<Layout>,
    /// How it is configured.
    pub config: AgvConfig,
    /// Its part of the timing contract.
    pub time: TimeLimits,
    /// The actions tests may use for their own ends, and where they can be performed.
    pub actions: Arc<SampleActions>,
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
        ("brief-action", "beep", "", json!({ "duration": 0.05 })),
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
        ("zone-action", "beep", "", json!({ "duration": 0.05 })),
        ("long-zone-action", "beep", "", json!({ "duration": 0.5 })),
        ("lift", "initPosition", LIFT, pose),
    ];
    let sample = |(name, action_type, place, parameters): (&str, &str, &str, Value)| {
        let kind = SAMPLE_ACTIONS.iter().find(|kind| kind.name == name)?;
        let mut action = SampleAction::plain(action_type);
        action.parameters = parameters.as_object().cloned().unwrap_or_default();
        match kind.place {
            Place::Anywhere | Place::Zone => {}
            Place::Shown => action.shows = Some(place.to_owned()),
            Place::Node => action.node = Some(place.to_owned()),
            Place::Edge => action.edge = Some(place.to_owned()),
        }
        Some((kind.name, action))
    };
    SampleActions(all.into_iter().filter_map(sample).collect())
}

/// What a version says of the errors that it names.
fn error_rules(pack: &Pack) -> BTreeMap<String, ErrorRule> {
    let named = pack.vocabulary().get("predefinedError").and_then(Value::as_object);
    let rule = |(name, said): (&String, &Value)| {
        let word = |key: &str| said.get(key).and_then(Value::as_str);
        let rule = ErrorRule {
            level: word("level")?.to_owned(),
            until: ErrorEnd::of_word(word("until")?),
        };
        Some((name.clone(), rule))
    };
    named.into_iter().flatten().filter_map(rule).collect()
}

/// Kinds of reference AGVs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Vehicle {
    /// On virtual lines, as most vehicles are
    #[default]
    Usual,
    /// Follows a line on the floor, knows no coordinates, and stops on nodes only
    LineGuided,
    /// Plans its own way, follows trajectories, and keeps to corridors
    Free,
    /// Carries no load, and does not charge on the course
    WithoutLoads,
    /// Knows nothing of maps
    WithoutMaps,
    /// Says as little as it may in its factsheet
    Terse,
}

impl Vehicle {
    /// Every kind; the usual one first.
    pub const ALL: [Self; 6] = [
        Self::Usual,
        Self::LineGuided,
        Self::Free,
        Self::WithoutLoads,
        Self::WithoutMaps,
        Self::Terse,
    ];

    /// Its name, and what it is in one line.
    #[must_use]
    pub fn named(self) -> (&'static str, &'static str) {
        match self {
            Self::Usual => ("usual", "On virtual lines, as most vehicles are"),
            Self::LineGuided => (
                "line-guided",
                "Follows a line on the floor, knows no coordinates, and stops on nodes only",
            ),
            Self::Free => (
                "free",
                "Plans its own way, follows trajectories, and keeps to corridors",
            ),
            Self::WithoutLoads => ("without-loads", "Carries no load, and does not charge on the course"),
            Self::WithoutMaps => ("without-maps", "Knows nothing of maps"),
            Self::Terse => ("terse", "Says as little as it may in its factsheet"),
        }
    }
}

impl ReferenceAgv {
    /// A reference AGV for a protocol version.
    #[must_use]
    pub fn new(pack: &Pack) -> Self {
        let subject = Participant {
            role: Role::Agv,
            manufacturer: "vda5050-tck".to_owned(),
            serial_number: "reference-agv".to_owned(),
            topic_template: None,
        };
        let layout = Layout::built_in();
        let actions = sample_actions(&layout);
        let layout = layout.with_stations(&actions);
        let nodes = layout_nodes(&layout);
        let first = nodes.first().map(|node| node.id.clone()).unwrap_or_default();
        let config = AgvConfig {
            manufacturer: subject.manufacturer.clone(),
            serial_number: subject.serial_number.clone(),
            version: pack.version.to_string(),
            names: Names::clone(pack.names()),
            timestamp_digits: pack.timestamp_digits(),
            errors: ErrorNames::from_vocabulary(|path| pack.word(path)),
            error_rules: error_rules(pack),
            topics: subject.topics(pack),
            features: pack
                .features()
                .filter(|(_, on)| *on)
                .map(|(name, _)| name.to_owned())
                .collect(),
            nodes: nodes.into(),
            chargers: BTreeSet::from([CHARGER.to_owned()]),
            stations: [SHELF, TAKEN_SHELF].map(|node| (node.to_owned(), true)).into(),
            // Six more fit, which tests rely on.
            map_capacity: 8,
            start_node: first,
            zone_set: Some("hall-zones".to_owned()),
            zone_types: ZONE_TYPES.map(str::to_owned).into(),
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
            layout: Arc::new(layout),
            config,
            time,
            actions: Arc::new(actions),
        }
    }

    /// Every kind of vehicle, so that what only applies to some is proven as well, and so that nobody
    /// is blamed for what they need not have. The usual one is the first.
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
                this.config.zone_types.insert("COORDINATED_REPLANNING".to_owned());
            }
            Vehicle::WithoutLoads => this.without_loads(),
            Vehicle::WithoutMaps => this.without_maps(),
            Vehicle::Terse => this.config.minimal_factsheet = true,
        }
        this
    }

    fn follow_a_line(&mut self) {
        self.layout = Arc::new(Layout::clone(&self.layout).with_directions());
        self.config.stops_between_nodes = false;
        // It knows no coordinates, so it has no use for a pose, a map or a zone.
        let without = ["initPosition", "downloadMap", "enableMap", "deleteMap"];
        self.config.without_actions = without.map(str::to_owned).into();
        self.config.zone_types.clear();
        let branch = |edge: &Edge| Some((edge.start.clone(), edge.direction.clone()?, edge.end.clone()));
        self.config.branches = Some(self.layout.edges().filter_map(branch).collect());
    }

    /// It carries nothing, gets its power from the floor, and offers no action that needs a station.
    fn without_loads(&mut self) {
        self.config.permanently_powered = true;
        self.config
            .zone_types
            .retain(|kind| matches!(kind.as_str(), "BLOCKED" | "SPEED_LIMIT"));
        let simple = [
            "long-action",
            "brief-action",
            "uninterruptible-action",
            "zone-action",
            "long-zone-action",
        ];
        Arc::make_mut(&mut self.actions)
            .0
            .retain(|name, _| simple.contains(name));
        let of_stations = [
            "pick",
            "drop",
            "detectObject",
            "finePositioning",
            "startCharging",
            "stopCharging",
        ];
        self.config.without_actions = of_stations.map(str::to_owned).into();
    }

    fn without_maps(&mut self) {
        self.config.zone_types.clear();
        self.config
            .features
            .retain(|feature| feature != "maps" && feature != "mapActions");
    }

    /// Whether its version knows certificates of vehicles.
    fn has_certificates(&self) -> bool {
        self.config.features.iter().any(|feature| feature == "certificates")
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
            ("instant-actions", true),
            ("small-map-storage", true),
            ("carries-load", !self.config.without_actions.contains("pick")),
            ("map-hash", true),
            ("line-guided", self.config.branches.is_some()),
            ("free-navigation", self.config.plans),
            ("straight-lines", !self.config.plans && self.config.branches.is_none()),
            ("permanently-powered", self.config.permanently_powered),
            ("room-beside-edges", true),
            ("zones-on-course", self.config.branches.is_none()),
        ]
        .into_iter()
        .chain(self.has_certificates().then_some(("certificate-may-change", true)))
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

    /// Makes the vehicle hurry, for runs over real sockets, where every metre costs time: as fast as tests that have to
    /// catch it between two nodes allow.
    pub fn hurry(&mut self) {
        const TIMES: f64 = 3.2;
        self.config.speed *= TIMES;
        self.config.rotation_speed *= TIMES;
        self.config.action_duration = self.config.action_duration.div_f64(TIMES);
        self.config.state_interval = Duration::from_millis(500);
        self.config.reconnect_delay = Duration::from_millis(100);
        for (name, seconds) in [
            ("long-action", 0.2),
            ("uninterruptible-action", 0.2),
            ("brief-action", 0.02),
        ] {
            if let Some(action) = Arc::make_mut(&mut self.actions).0.get_mut(name) {
                action.parameters.insert("duration".to_owned(), json!(seconds));
            }
        }
        self.time.drive = Duration::from_secs(2);
        // Longer than the moment after which some faults show.
        self.time.quiet = Duration::from_millis(80);
        self.time.settle = Duration::from_millis(150);
    }

    /// Lets it take a liberty, and gives it the time it then needs.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let speed = self.config.speed;
        self.config.tolerate(name)?;
        // Many small delays on one way are a long one.
        let usual = self.time.drive + Duration::from_millis(500);
        self.time.drive = usual.mul_f64((speed / self.config.speed).max(1.0));
        let latency = self.config.answers_after + self.config.min_state_interval;
        self.time.quiet = self.time.quiet.max(latency * 2);
        // Long enough for what a test does meanwhile.
        let seconds = 0.5 + 3.0 * (self.config.answers_after + self.config.min_state_interval).as_secs_f64();
        for name in ["long-action", "uninterruptible-action", "long-zone-action"] {
            if let Some(action) = Arc::make_mut(&mut self.actions).0.get_mut(name) {
                action.parameters.insert("duration".to_owned(), json!(seconds));
            }
        }
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

    /// Puts it on another floor, where it knows no stations.
    pub fn live_on(&mut self, layout: Layout) {
        self.config.nodes = layout_nodes(&layout).into();
        self.config.start_node = self
            .config
            .nodes
            .first()
            .map(|node| node.id.clone())
            .unwrap_or_default();
        let maps: BTreeSet<&str> = self.config.nodes.iter().map(|node| node.map_id.as_str()).collect();
        let on_board = maps.into_iter().map(|map| OnboardMap {
            map_id: map.to_owned(),
            map_version: "1".to_owned(),
            enabled: true,
        });
        self.config.maps = on_board.collect();
        self.layout = Arc::new(layout);
    }

    /// Puts on its floor what the actions of a profile find there: loads, free places, chargers.
    pub fn furnish(&mut self, actions: &SampleActions) {
        for (kind, action) in actions.iter() {
            let edge = action.edge.as_ref();
            let leads_to = |id: &String| {
                self.layout
                    .edges()
                    .find(|edge| edge.id == *id)
                    .map(|edge| edge.end.clone())
            };
            let Some(node) = action.node.clone().or_else(|| edge.and_then(leads_to)) else {
                continue;
            };
            match kind.name {
                "pick" | "edge-pick" | "failing-drop" | "detect-object" | "edge-detect-object" => {
                    self.config.stations.insert(node, true);
                }
                "drop" | "edge-drop" | "fine-positioning" | "edge-fine-positioning" => {
                    self.config.stations.entry(node).or_insert(false);
                }
                "start-charging" => {
                    self.config.chargers.insert(node);
                }
                _ => {}
            }
        }
    }

    /// The nodes it can stand on without being in the way of a station.
    #[must_use]
    pub fn places(&self) -> Vec<&str> {
        let all = self.layout.nodes().filter(|node| !node.station);
        let floor = self.layout.nodes().next().map(|node| node.map_id.as_str());
        all.filter(|node| Some(node.map_id.as_str()) == floor)
            .map(|node| node.id.as_str())
            .collect()
    }

    /// The hooks it understands as commands.
    pub const HOOKS: &'static [&'static str] = &[
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
        "block-pause",
        "unblock-pause",
        "block-hibernation",
        "unblock-hibernation",
        "lose-position",
        "find-position",
        "lock-charger",
        "unlock-charger",
        "use-lift",
        "enable-map",
        "enter-field",
        "leave-field",
        "push-out",
        "shift-position",
        "place-obstacle",
        "remove-obstacle",
    ];
}

/// The floor as the vehicle knows it.
fn layout_nodes(layout: &Layout) -> Vec<LayoutNode> {
    let all = layout.nodes().map(|node| LayoutNode {
        id: node.id.clone(),
        x: node.x,
        y: node.y,
        theta: node.theta,
        map_id: node.map_id.clone(),
    });
    all.collect()
}
