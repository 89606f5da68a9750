//! What must be known about one device and site (PIXIT): `device.toml`, its defaults, and where each
//! effective value came from.
//!
//! [`load`] lays flags over environment, profile, project file, user file and defaults, and hands back one
//! [`Effective`] profile, or every mistake in any of them. Whether the protocol version, the requirements of
//! the deviations and the files named exist is left to those who use them: [`Effective::complain`] gives
//! them the caret.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod claim;
mod effective;
mod hook_action;
mod hooks;
mod issue_key;
mod key;
mod layer;
mod load;
mod placeholder;
mod read;
mod secret;
mod surroundings;
#[cfg(test)]
mod tests;
mod value;
mod vehicle;
mod written;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::{Map, Value, json};

pub use claim::Claim;
pub use effective::Effective;
pub use hook_action::{Hook, HookAction, NATURAL_TRAFFIC, RESTART_DEVICE, START_DEVICE, STOP_DEVICE};
pub use hooks::HookExample;
pub use issue_key::IssueKey;
pub use key::{
    COMMON_PLACEHOLDERS, FOUND, KEYS, Key, Kind, PASSWORD_VARIABLE, Place, SAMPLE_ACTIONS, STATEMENTS, SampleKind,
    Statement,
};
pub use load::{check, load};
pub use placeholder::{fill, placeholders};
pub use secret::{PasswordError, PasswordSource, SecretText};
pub use surroundings::Surroundings;
pub use tck_base::secrets::{Password, Secrets};
use tck_base::time;
pub use tck_base::time::{Contract, TimeLimits, WILL_UNKNOWN, parse as parse_duration, show as show_duration};
pub use tck_journal::event::Setting;
pub use vehicle::{VEHICLE_WORDS, VehicleEffect, VehicleWord, find as find_vehicle_word};
pub use written::profile as written;

use tck_base::diagnostic::Span;
use tck_pack::{RequirementId, Role};

/// Every setting with its default, and a comment on each.
pub const DEFAULT_TOML: &str = include_str!("default.toml");

/// The JSON schema of profiles, for editors.
pub const SCHEMA: &str = include_str!("../../../schemas/profile.schema.json");

/// One device and site.
#[derive(Clone, Debug)]
pub struct Profile {
    /// `[device]`.
    pub device: Device,
    /// `[bench]`.
    pub bench: Bench,
    /// `[motion]`.
    pub motion: Motion,
    /// `[layout]`.
    pub layout: Layout,
    /// `[vehicles]`.
    pub vehicles: Vehicles,
    /// `[time]`.
    pub time: TimeLimits,
    /// `[maps]`: files the device can read.
    pub maps: Vec<PathBuf>,
    /// `[deviations]`, in the order of the file.
    pub deviations: Vec<Deviation>,
    /// `[known]`, in the order of the file.
    pub known: Vec<KnownFailure>,
    /// `[hooks]` by name; all are for the role of the device.
    pub hooks: BTreeMap<String, Hook>,
}

/// `[device]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// Which side is tested.
    pub role: Role,
    /// Manufacturer in topics and headers.
    pub manufacturer: Option<String>,
    /// Serial number in topics and headers.
    pub serial_number: Option<String>,
    /// Version the device is judged by; a version by its form, not necessarily a known one.
    pub protocol: Option<String>,
    /// How its topics begin, with `{majorVersion}`, `{manufacturer}` and `{serialNumber}`.
    pub topic_template: Option<String>,
    /// Program and arguments that start the device itself, with [`COMMON_PLACEHOLDERS`].
    pub command: Option<Vec<String>>,
    /// Actions that tests may use, by names of [`SAMPLE_ACTIONS`].
    pub sample_actions: SampleActions,
    /// What the vehicle is like; a name of [`STATEMENTS`] or [`SAMPLE_ACTIONS`] that is missing is not known.
    pub statements: BTreeMap<String, bool>,
    /// What it can do, beside its factsheet or against it.
    pub claims: Vec<Claim>,
}

impl Device {
    /// Whether the vehicle is like that; `None` when the profile does not say.
    #[must_use]
    pub fn states(&self, statement: &str) -> Option<bool> {
        self.statements.get(statement).copied()
    }

    /// What suites know as `device.…` from the profile alone: `manufacturer`, `serialNumber`, and the sample
    /// actions. What is not known is absent.
    #[must_use]
    pub fn bindings(&self) -> Map<String, Value> {
        let texts = [
            ("manufacturer", &self.manufacturer),
            ("serialNumber", &self.serial_number),
        ];
        let texts = texts
            .into_iter()
            .filter_map(|(name, text)| Some((name, Value::from(text.as_deref()?))));
        let mut all: Map<String, Value> = texts.map(|(name, value)| (name.to_owned(), value)).collect();
        all.extend(self.sample_actions.bindings());
        all
    }
}

/// Sample actions by their names in a profile.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleActions(pub BTreeMap<&'static str, SampleAction>);

impl SampleActions {
    /// The sample actions that are known, with what kind each is of.
    pub fn iter(&self) -> impl Iterator<Item = (&'static SampleKind, &SampleAction)> {
        SAMPLE_ACTIONS
            .iter()
            .filter_map(|kind| Some((kind, self.0.get(kind.name)?)))
    }

    /// `longAction: { type, parameters }` and so on, as suites know them below `device`.
    #[must_use]
    pub fn bindings(&self) -> Map<String, Value> {
        self.iter()
            .map(|(kind, action)| {
                let mut value = action.value();
                if kind.place == Place::Zone {
                    value["list"] = action.list();
                }
                (kind.variable.to_owned(), value)
            })
            .collect()
    }
}

/// An action of the vehicle that tests may use.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleAction {
    /// actionType.
    pub action_type: String,
    /// Key and value of each of its actionParameters.
    pub parameters: Map<String, Value>,
    /// nodeId of where it can be performed.
    pub node: Option<String>,
    /// edgeId of where it can be performed.
    pub edge: Option<String>,
    /// infoType of the information that shows its effect.
    pub shows: Option<String>,
}

impl SampleAction {
    /// An action without parameters that can be performed anywhere.
    #[must_use]
    pub fn plain(action_type: &str) -> Self {
        Self {
            action_type: action_type.to_owned(),
            parameters: Map::new(),
            node: None,
            edge: None,
            shows: None,
        }
    }

    /// `{ type, parameters }`, and `node`, `edge` and `shows` where it has them.
    #[must_use]
    pub fn value(&self) -> Value {
        let mut value = json!({ "type": self.action_type, "parameters": self.parameters });
        for (name, text) in [("node", &self.node), ("edge", &self.edge), ("shows", &self.shows)] {
            if let Some(text) = text {
                value[name] = text.as_str().into();
            }
        }
        value
    }

    /// Its parameters as a zone has them.
    fn list(&self) -> Value {
        let all = self.parameters.iter();
        all.map(|(key, value)| json!({ "key": key, "value": value })).collect()
    }

    /// In one line: `pick at P1 {…}`.
    fn shown(&self) -> String {
        let mut text = self.action_type.clone();
        if let Some(place) = self.node.as_ref().or(self.edge.as_ref()) {
            text = format!("{text} at {place}");
        }
        if !self.parameters.is_empty() {
            text = format!("{text} {}", Value::Object(self.parameters.clone()));
        }
        text
    }
}

/// `[bench]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bench {
    /// Where the device connects, as `host:port`.
    pub listen: String,
    /// Whether the device connects through the tap.
    pub tap: bool,
    /// A broker other than the built-in one, as `mqtt://…`, `mqtts://…`, `ws://…` or `wss://…`.
    pub broker: Option<String>,
    /// Addresses of other nodes of the cluster that this broker is one of.
    pub cluster: Vec<String>,
    /// How the topics begin that the harness keeps for itself.
    pub own_topics: String,
    /// How the client ids of the harness begin.
    pub client_id: String,
    /// Where map files are served, as `host:port`.
    pub maps_listen: String,
    /// Host name in the links to map files; that of `maps_listen` when absent.
    pub maps_host: Option<String>,
    /// Where the page for the people beside the vehicle is served, as `host:port`.
    pub page: Option<String>,
    /// Certificate the tap shows the device (PEM).
    pub tls_cert: Option<PathBuf>,
    /// Its key (PEM).
    pub tls_key: Option<PathBuf>,
    /// Whom to trust at the broker (PEM).
    pub tls_ca: Option<PathBuf>,
    /// Certificate the harness shows a broker that asks for one (PEM).
    pub client_cert: Option<PathBuf>,
    /// Its key (PEM).
    pub client_key: Option<PathBuf>,
    /// User name at the broker.
    pub username: Option<String>,
    /// Where the password is.
    pub password: PasswordSource,
}

/// `[motion]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Whether the vehicle may drive.
    pub allowed: bool,
    /// Speed cap in m/s.
    pub max_speed: Option<f64>,
}

/// `[vehicles]`: the mock AGVs that a master control is tested with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vehicles {
    /// Manufacturer, as in their topics and headers.
    pub manufacturer: String,
    /// Serial numbers; the first vehicle is the one that tests talk about.
    pub serial_numbers: Vec<String>,
    /// Where the first one stands at the beginning; the first node of the layout when absent.
    pub start_node: Option<String>,
    /// Vehicles of other makers and versions beside them.
    pub others: Vec<VehicleGroup>,
}

/// `[[vehicles.others]]`: vehicles of one maker that speak one version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VehicleGroup {
    /// Manufacturer, as in their topics and headers.
    pub manufacturer: String,
    /// Serial numbers.
    pub serial_numbers: Vec<String>,
    /// Protocol version they speak; that of the device when absent.
    pub protocol: Option<String>,
    /// Where they are written.
    pub span: Span,
}

/// `[layout]`.
#[derive(Clone, Debug, Default)]
pub struct Layout {
    /// Where nodes and edges come from.
    pub source: LayoutSource,
    /// The only nodes the vehicle may use; all of them when absent.
    pub allow_list: Option<Vec<String>>,
}

/// Where nodes and edges come from.
#[derive(Clone, Debug, Default)]
pub enum LayoutSource {
    /// The profile says nothing.
    #[default]
    None,
    /// A LIF file.
    Lif {
        /// The file.
        file: PathBuf,
        /// vehicleTypeId in it.
        vehicle_type: Option<String>,
    },
    /// A short list in the profile.
    List(LayoutList),
}

/// `layout.nodes` and `layout.edges`. Ids are unique, and edges join nodes of the list.
#[derive(Clone, Debug)]
pub struct LayoutList {
    /// Nodes.
    pub nodes: Vec<LayoutNode>,
    /// Edges, one-way.
    pub edges: Vec<LayoutEdge>,
    /// Where it begins.
    pub span: Span,
}

/// One element of `layout.nodes`.
#[derive(Clone, Debug)]
pub struct LayoutNode {
    /// nodeId.
    pub id: String,
    /// mapId.
    pub map_id: String,
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians, from -π to π.
    pub theta: Option<f64>,
    /// Metres.
    pub deviation_xy: Option<f64>,
    /// Radians.
    pub deviation_theta: Option<f64>,
    /// Where it is written.
    pub span: Span,
}

/// One element of `layout.edges`.
#[derive(Clone, Debug)]
pub struct LayoutEdge {
    /// edgeId.
    pub id: String,
    /// Id of the node it begins at.
    pub start: String,
    /// Id of the node it ends at.
    pub end: String,
    /// What a line-guided vehicle is told at the junction where it begins.
    pub direction: Option<String>,
    /// Where it is written.
    pub span: Span,
}

/// A failure that a pipeline knows: the verdict stays, and so does the report; only the exit code changes.
#[derive(Clone, Debug)]
pub struct KnownFailure {
    /// A requirement, a test or a monitor; not necessarily one that is there.
    pub id: String,
    /// Why it is borne.
    pub reason: String,
    /// The last day on which it is, such as `2030-12-31`.
    pub until: String,
    /// Where it is written.
    pub span: Span,
}

/// A declared deviation: the verdict stays, the report shows the reason.
#[derive(Clone, Debug)]
pub struct Deviation {
    /// The requirement; an id by its form, not necessarily a known one.
    pub requirement: RequirementId,
    /// Why.
    pub reason: String,
    /// Where it is written.
    pub span: Span,
}
