//! What the vehicles say, read leniently: a message that lacks what is needed is ignored as a whole (sections 6.10 and
//! 6.14).
//!
//! Informations, the localization score and the deviation range are for people, and decide nothing (INFO-02 and
//! INFO-03).

#![expect(clippy::struct_field_names, reason = "the names are those of the messages")]

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer};
use serde_json::Value;

use super::requests::Wish;

/// A longer message is not looked at.
pub(crate) const MAX_MESSAGE: usize = 4 << 20;

/// A whole number of 32 bits; `5.0` counts as whole.
fn whole<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if number.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&number) {
        return Err(serde::de::Error::custom("no whole number of 32 bits"));
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be a whole uint32 above"
    )]
    Ok(number as u32)
}

/// What can be read of a list. In versions that do not have it, a manufacturer may mean something else by its name.
fn readable<'de, D: Deserializer<'de>, T: serde::de::DeserializeOwned>(deserializer: D) -> Result<Vec<T>, D::Error> {
    let value = Value::deserialize(deserializer)?;
    let list = value.as_array().map(Vec::as_slice).unwrap_or_default();
    Ok(list
        .iter()
        .take(1000)
        .filter_map(|entry| T::deserialize(entry).ok())
        .collect())
}

/// The header, for whom a message is from.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Header {
    #[serde(default)]
    pub(crate) manufacturer: Option<String>,
    #[serde(default)]
    pub(crate) serial_number: Option<String>,
}

/// A node or an edge still to be traversed.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ElementState {
    #[serde(default)]
    pub(crate) sequence_id: Option<u32>,
    #[serde(default)]
    pub(crate) released: bool,
}

/// An action and how far it is.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ActionState {
    pub(crate) action_id: String,
    #[serde(default)]
    pub(crate) action_type: String,
    pub(crate) action_status: String,
}

impl ActionState {
    pub(crate) fn is_terminal(&self) -> bool {
        matches!(self.action_status.as_str(), "FINISHED" | "FAILED")
    }
}

/// agvPosition.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Position {
    pub(crate) x: f64,
    pub(crate) y: f64,
    #[serde(default)]
    pub(crate) theta: f64,
    #[serde(default)]
    pub(crate) map_id: String,
    #[serde(default = "yes")]
    pub(crate) position_initialized: bool,
    /// For logging and visualization only (INFO-03).
    #[serde(default)]
    pub(crate) localization_score: Option<f64>,
    /// In metres, for logging and visualization only (INFO-03).
    #[serde(default)]
    pub(crate) deviation_range: Option<f64>,
}

fn yes() -> bool {
    true
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Reference {
    pub(crate) reference_key: String,
    pub(crate) reference_value: String,
}

/// An error the vehicle reports.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ErrorSeen {
    pub(crate) error_type: String,
    pub(crate) error_level: String,
    #[serde(default)]
    pub(crate) error_references: Option<Vec<Reference>>,
}

impl ErrorSeen {
    /// Whether it is that of this name, however it is written.
    pub(crate) fn is(&self, name: &str) -> bool {
        let plain = |text: &str| text.replace('_', "").to_ascii_lowercase();
        plain(&self.error_type) == plain(name)
    }

    /// The value of a reference.
    pub(crate) fn reference(&self, key: &str) -> Option<&str> {
        let references = self.error_references.as_deref().unwrap_or_default();
        let found = references.iter().find(|reference| reference.reference_key == key);
        found.map(|reference| reference.reference_value.as_str())
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct MapSeen {
    pub(crate) map_id: String,
    pub(crate) map_version: String,
    pub(crate) map_status: String,
}

/// A set of zones on board.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ZoneSetSeen {
    pub(crate) zone_set_id: String,
    pub(crate) zone_set_status: String,
}

/// Something a vehicle asks for.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct RequestSeen {
    pub(crate) request_id: String,
    #[serde(default)]
    pub(crate) request_type: String,
    pub(crate) request_status: String,
    #[serde(default)]
    pub(crate) zone_id: String,
    #[serde(default)]
    pub(crate) zone_set_id: String,
    #[serde(default)]
    pub(crate) edge_id: String,
    #[serde(default)]
    pub(crate) sequence_id: Value,
    #[serde(default)]
    pub(crate) trajectory: Value,
}

impl RequestSeen {
    /// What is asked for.
    pub(crate) fn wish(&self) -> Wish {
        if self.edge_id.is_empty() {
            return Wish::Zone {
                set_id: self.zone_set_id.clone(),
                zone_id: self.zone_id.clone(),
                kind: self.request_type.clone(),
                way: self.trajectory.is_object(),
            };
        }
        Wish::Corridor {
            edge_id: self.edge_id.clone(),
            sequence: self.sequence_id.as_u64().unwrap_or(u64::MAX),
        }
    }
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Battery {
    #[serde(default)]
    pub(crate) battery_charge: Option<f64>,
    #[serde(default)]
    pub(crate) charging: bool,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Safety {
    #[serde(default)]
    pub(crate) e_stop: String,
}

/// A state.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct State {
    pub(crate) order_id: String,
    #[serde(deserialize_with = "whole")]
    pub(crate) order_update_id: u32,
    pub(crate) last_node_id: String,
    #[serde(deserialize_with = "whole")]
    pub(crate) last_node_sequence_id: u32,
    pub(crate) node_states: Vec<ElementState>,
    pub(crate) edge_states: Vec<ElementState>,
    #[serde(default)]
    pub(crate) agv_position: Option<Position>,
    #[serde(default)]
    pub(crate) loads: Option<Vec<Value>>,
    pub(crate) driving: bool,
    #[serde(default)]
    pub(crate) paused: Option<Value>,
    #[serde(default)]
    pub(crate) new_base_request: Option<bool>,
    pub(crate) action_states: Vec<ActionState>,
    #[serde(default, deserialize_with = "readable")]
    pub(crate) instant_action_states: Vec<ActionState>,
    #[serde(default, deserialize_with = "readable")]
    pub(crate) zone_action_states: Vec<ActionState>,
    #[serde(default)]
    pub(crate) battery_state: Battery,
    pub(crate) operating_mode: String,
    pub(crate) errors: Vec<ErrorSeen>,
    /// For visualization and debugging only (INFO-02).
    #[serde(default)]
    pub(crate) information: Option<Vec<Value>>,
    #[serde(default)]
    pub(crate) safety_state: Safety,
    #[serde(default)]
    pub(crate) maps: Option<Vec<MapSeen>>,
    #[serde(default)]
    pub(crate) zone_sets: Option<Vec<ZoneSetSeen>>,
    #[serde(default, deserialize_with = "readable")]
    zone_requests: Vec<RequestSeen>,
    #[serde(default, deserialize_with = "readable")]
    edge_requests: Vec<RequestSeen>,
}

impl State {
    /// Reported state of an action.
    pub(crate) fn action(&self, id: &str) -> Option<&ActionState> {
        let mut all = self.action_states.iter().chain(&self.instant_action_states);
        all.find(|action| action.action_id == id)
    }

    /// Everything the vehicle asks for.
    pub(crate) fn requests(&self) -> impl Iterator<Item = &RequestSeen> {
        self.zone_requests.iter().chain(&self.edge_requests)
    }

    /// Whether the vehicle reports an error of this name, however it is written.
    pub(crate) fn has_error(&self, name: &str) -> bool {
        self.errors.iter().any(|error| error.is(name))
    }

    /// An action of the order that may be tried again.
    pub(crate) fn retriable(&self) -> Option<&ActionState> {
        self.action_states
            .iter()
            .find(|action| action.action_status == "RETRIABLE")
    }

    /// Whether master control may command the vehicle (MODE-04).
    pub(crate) fn takes_orders(&self) -> bool {
        matches!(self.operating_mode.as_str(), "AUTOMATIC" | "SEMIAUTOMATIC")
    }

    /// Whether it is paused.
    pub(crate) fn is_paused(&self) -> bool {
        self.paused == Some(Value::Bool(true))
    }

    /// Whether it gives any information.
    pub(crate) fn informs(&self) -> bool {
        self.information.as_ref().is_some_and(|list| !list.is_empty())
    }

    /// Whether nothing is left to be traversed.
    pub(crate) fn route_empty(&self) -> bool {
        self.node_states.is_empty() && self.edge_states.is_empty()
    }

    /// The sequenceId of a node that is passed cannot be higher than this.
    pub(crate) fn before_next_node(&self) -> u32 {
        let ahead = self.node_states.iter().filter_map(|node| node.sequence_id).min();
        ahead.map_or(u32::MAX, |next| next.saturating_sub(2))
    }

    /// Whether the battery is so low that the vehicle has to charge (FACT-17).
    pub(crate) fn is_critical(&self, level: Option<f64>) -> bool {
        let charge = self.battery_state.battery_charge;
        charge.zip(level).is_some_and(|(charge, level)| charge <= level)
    }

    /// Whether something keeps the vehicle from being given new work.
    pub(crate) fn is_fit(&self, low_battery: f64) -> bool {
        let fatal = self.errors.iter().any(|error| error.error_level == "FATAL");
        let stopped = !matches!(self.safety_state.e_stop.as_str(), "NONE" | "");
        let lost = self
            .agv_position
            .as_ref()
            .is_some_and(|position| !position.position_initialized);
        let charge = self.battery_state.battery_charge;
        let empty = charge.is_some_and(|charge| charge < low_battery) && !self.battery_state.charging;
        !(fatal || stopped || lost || empty)
    }

    /// The maps on board that are enabled; `None` if the vehicle does not tell.
    pub(crate) fn map_enabled(&self, map_id: &str) -> bool {
        let Some(maps) = &self.maps else { return true };
        maps.iter()
            .any(|map| map.map_id == map_id && map.map_status == "ENABLED")
    }

    /// Whether a map version is on board.
    pub(crate) fn has_map(&self, map_id: &str, version: &str) -> bool {
        let maps = self.maps.as_deref().unwrap_or_default();
        maps.iter()
            .any(|map| map.map_id == map_id && map.map_version == version)
    }
}

/// A parameter of an action in the factsheet.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ParameterOffer {
    pub(crate) key: String,
    #[serde(default)]
    pub(crate) value_data_type: String,
    #[serde(default)]
    pub(crate) is_optional: Option<bool>,
}

/// An action in the factsheet.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct ActionOffer {
    pub(crate) action_type: String,
    #[serde(default)]
    pub(crate) action_scopes: Vec<String>,
    #[serde(default)]
    pub(crate) action_parameters: Option<Vec<ParameterOffer>>,
    #[serde(default)]
    pub(crate) blocking_types: Option<Vec<String>>,
}

/// The factsheet, as far as master control goes by it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Factsheet {
    /// Action by type; `None` if the factsheet lists none at all.
    pub(crate) actions: Option<BTreeMap<String, ActionOffer>>,
    /// Support by optional parameter.
    pub(crate) optional: BTreeMap<String, String>,
    /// Limits of arrays by their name.
    pub(crate) arrays: BTreeMap<String, usize>,
    /// Longest message in bytes.
    pub(crate) message: Option<usize>,
    /// Longest id.
    pub(crate) id_length: Option<usize>,
    /// Ids consist of digits.
    pub(crate) ids_numerical: bool,
    /// Seconds between order messages.
    pub(crate) order_interval: f64,
    /// Names of load handling devices.
    pub(crate) devices: Vec<String>,
    /// Types of loads.
    pub(crate) load_types: Vec<String>,
    /// Whether the limit of nodes is 0, which is none.
    pub(crate) has_zeros: bool,
    /// Charge in percent at and below which it has to charge.
    pub(crate) critical_charge: Option<f64>,
    /// Types of zones that it keeps to.
    pub(crate) zones: Vec<String>,
}

impl Factsheet {
    /// Reads a factsheet; what is missing or strange limits nothing.
    ///
    /// `usual` tells the usual path of an optional parameter by that of the version of the vehicle.
    pub(crate) fn read(message: &Value, usual: impl Fn(&str) -> Option<String>) -> Self {
        let at = |pointer: &str| message.pointer(pointer);
        let size = |value: &Value| {
            value
                .as_u64()
                .and_then(|size| usize::try_from(size).ok())
                .filter(|size| *size > 0)
        };
        let list = |pointer: &str| at(pointer).and_then(Value::as_array).cloned().unwrap_or_default();
        let texts = |values: Vec<Value>| values.iter().filter_map(Value::as_str).map(str::to_owned).collect();
        let actions = at("/protocolFeatures/agvActions").and_then(Value::as_array);
        let actions = actions.filter(|list| !list.is_empty()).map(|list| {
            let offers = list.iter().take(500);
            let offers = offers.filter_map(|action| serde_json::from_value::<ActionOffer>(action.clone()).ok());
            offers.map(|offer| (offer.action_type.clone(), offer)).collect()
        });
        let optional = list("/protocolFeatures/optionalParameters");
        let optional = optional.iter().take(500).filter_map(|entry| {
            let text = |key: &str| entry.get(key).and_then(Value::as_str);
            Some((usual(text("parameter")?)?, text("support")?.to_owned()))
        });
        let arrays = at("/protocolLimits/maxArrayLens").and_then(Value::as_object);
        let arrays = arrays
            .into_iter()
            .flatten()
            .filter_map(|(key, value)| Some((key.clone(), size(value)?)));
        let strings = "/protocolLimits/maxStringLens";
        let load_sets = list("/loadSpecification/loadSets");
        let load_types = load_sets.iter().filter_map(|set| set.get("loadType")?.as_str());
        Self {
            actions,
            optional: optional.collect(),
            arrays: arrays.take(500).collect(),
            message: at(&format!("{strings}/msgLen")).and_then(size),
            id_length: at(&format!("{strings}/idLen")).and_then(size),
            ids_numerical: at(&format!("{strings}/idNumericalOnly")).and_then(Value::as_bool) == Some(true),
            order_interval: at("/protocolLimits/timing/minOrderInterval")
                .and_then(Value::as_f64)
                .map_or(0.0, |seconds| seconds.clamp(0.0, 3600.0)),
            devices: texts(list("/loadSpecification/loadPositions")),
            load_types: load_types.map(str::to_owned).collect(),
            critical_charge: at("/vehicleConfig/batteryCharging/criticalLowChargingLevel").and_then(Value::as_f64),
            zones: texts(list("/typeSpecification/supportedZones")),
            has_zeros: at("/protocolLimits/maxArrayLens").is_some_and(|limits| limits["order.nodes"] == 0),
        }
    }

    /// Support the factsheet states for an optional parameter, such as `order.edges.maxSpeed`.
    pub(crate) fn support(&self, parameter: &str) -> Option<&str> {
        self.optional.get(parameter).map(String::as_str)
    }

    /// Whether a list of what it supports, if there is one, has the positions of nodes in it.
    pub(crate) fn knows_positions(&self) -> bool {
        self.optional.is_empty() || self.optional.keys().any(|name| name.contains("nodePosition"))
    }

    /// The smaller of the limits of these names.
    pub(crate) fn limit(&self, names: &[&str]) -> usize {
        let limits = names.iter().filter_map(|name| self.arrays.get(*name));
        limits.min().copied().unwrap_or(usize::MAX)
    }
}
