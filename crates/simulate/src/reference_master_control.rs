//! The built-in reference master control as a device under test: its fleet, its floor, its configuration.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};

use super::fleet::{Fleet, USUAL_FLEET};
use super::reference_agv::ReferenceAgv;
use super::unknown_name::UnknownName;
use tck_course::{Layout, Node};
use tck_pack::Participant;
use tck_pack::{Pack, Role};
use tck_profile::TimeLimits;
use tck_reference::deviations::master_control as deviations;
use tck_reference::master_control::{COMMANDS, MasterControlConfig, SiteEdge, SiteNode, VehicleConfig};

/// How many edges a transport of the tests has (`course.d` is so far from `course.a`).
const WAY: usize = 3;

/// The reference master control and everything a run must know about it.
#[derive(Clone, Debug)]
pub struct ReferenceMasterControl {
    /// Who it says it is.
    pub subject: Participant,
    /// The mock AGVs it commands.
    pub fleet: Fleet,
    /// The floor.
    pub layout: Arc<Layout>,
    /// How it is configured.
    pub config: MasterControlConfig,
    /// The liberties it takes beside what is configured, by name.
    pub liberties: Vec<&'static str>,
    /// Its part of the timing contract.
    pub time: TimeLimits,
}

impl ReferenceMasterControl {
    /// The hooks it understands as commands.
    pub const HOOKS: &'static [&'static str] = COMMANDS;

    /// A reference master control for a protocol version, with the usual fleet.
    #[must_use]
    pub fn new(pack: &Pack) -> Self {
        Self::with_vehicles(USUAL_FLEET, pack)
    }

    /// A reference master control for a protocol version, with `count` mock AGVs.
    #[must_use]
    pub fn with_vehicles(count: usize, pack: &Pack) -> Self {
        let like = ReferenceAgv::new(pack);
        let fleet = Fleet::new(&like, "vda5050-tck", &[], count, pack);
        Self::commanding(fleet, like.layout)
    }

    /// One that commands these vehicles on this floor.
    #[must_use]
    pub fn commanding(fleet: Fleet, layout: Arc<Layout>) -> Self {
        let vehicles = fleet.vehicles.iter().map(|vehicle| VehicleConfig {
            manufacturer: vehicle.subject.manufacturer.clone(),
            serial_number: vehicle.subject.serial_number.clone(),
            version: vehicle.config.version.clone(),
            features: vehicle.config.features.clone(),
            names: vehicle.config.names.clone(),
            timestamp_digits: vehicle.config.timestamp_digits,
            topics: vehicle.config.topics.clone(),
        });
        let config = MasterControlConfig {
            vehicles: vehicles.collect(),
            nodes: layout.nodes().map(site_node).collect(),
            edges: layout.edges().map(site_edge).collect(),
            reconnect_delay: Duration::from_millis(300),
            resend_after: Duration::from_secs(2),
            trigger_timeout: Duration::from_secs(10),
            lease: Some(Duration::from_secs(8)),
            ..MasterControlConfig::default()
        };
        Self {
            subject: Participant {
                role: Role::MasterControl,
                manufacturer: "vda5050-tck".to_owned(),
                serial_number: config.name.clone(),
                topic_template: None,
            },
            time: TimeLimits {
                drive: Duration::from_secs(6),
                quiet: Duration::from_millis(500),
                settle: Duration::from_millis(300),
                notice: Duration::from_millis(200),
                reconnect: Duration::from_secs(20),
                connect: Duration::from_secs(20),
                ..TimeLimits::default()
            },
            layout,
            fleet,
            config,
            liberties: Vec::new(),
        }
    }

    /// What a profile would state about it.
    #[must_use]
    pub fn statements(&self) -> BTreeMap<String, bool> {
        let vehicle = self.fleet.vehicles.first();
        let mut all = vehicle.map(ReferenceAgv::statements).unwrap_or_default();
        all.insert("extends-base".to_owned(), self.config.base_length < WAY);
        all
    }

    /// `device.*` beside its name: the actions of the floor that a transport may consist of.
    #[must_use]
    pub fn device_bindings(&self) -> Map<String, Value> {
        let vehicle = self.fleet.vehicles.first();
        vehicle.map(ReferenceAgv::device_bindings).unwrap_or_default()
    }

    /// Makes the vehicles hurry, for runs over real sockets.
    pub fn hurry(&mut self) {
        for vehicle in &mut self.fleet.vehicles {
            vehicle.hurry();
        }
        self.time.drive = Duration::from_secs(3);
        self.time.quiet = Duration::from_millis(200);
        // What the tests let pass so that nobody is accused of what was under way; here nothing is for long.
        self.time.slow = Duration::from_millis(400);
        self.time.settle = Duration::from_millis(70);
        self.time.notice = Duration::from_millis(50);
        self.config.reconnect_delay = Duration::from_millis(100);
        self.config.resend_after = Duration::from_millis(1_200);
        self.config.trigger_timeout = Duration::from_secs(3);
    }

    /// Lets it take a liberty, and gives it the time it then needs.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownName> {
        let before = self.config.answers_after;
        deviations::tolerate(&mut self.config, &mut self.liberties, name)
            .map_err(|unknown| UnknownName(unknown.to_string()))?;
        let later = self.config.answers_after.saturating_sub(before);
        self.time.quiet += later * 2;
        self.time.settle += later * 2;
        self.time.notice += later;
        self.time.drive += later * 8;
        Ok(())
    }
}

fn site_node(node: &Node) -> SiteNode {
    SiteNode {
        id: node.id.clone(),
        x: node.x,
        y: node.y,
        theta: node.theta,
        map_id: node.map_id.clone(),
        deviation_xy: node.deviation_xy,
        deviation_theta: node.deviation_theta,
    }
}

fn site_edge(edge: &tck_course::Edge) -> SiteEdge {
    SiteEdge {
        id: edge.id.clone(),
        from: edge.start.clone(),
        to: edge.end.clone(),
        max_speed: edge.max_speed,
        max_height: edge.max_height,
        min_height: edge.min_height,
        direction: edge.direction.clone(),
        corridor: None,
    }
}
