//! What the vehicles say, read leniently: a message that lacks what is needed is ignored as a whole.

#![expect(clippy::struct_field_names, reason = "the names are those of the messages")]

use std::collections::BTreeMap;

use serde::{Deserialize, Deserializer};
use serde_json::Value;

/// A longer message is not looked at.
pub(super) const MAX_MESSAGE: usize = 4 << 20;

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

/// The header, for whom a message is from.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Header {
    #[serde(default)]
    pub(super) timestamp: String,
    #[serde(default)]
    pub(super) manufacturer: Option<String>,
    #[serde(default)]
    pub(super) serial_number: Option<String>,
}

/// A node or an edge still to be traversed.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ElementState {
    #[serde(default)]
    pub(super) sequence_id: Option<u32>,
    #[serde(default)]
    pub(super) released: bool,
}

/// An action and how far it is.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ActionState {
    pub(super) action_id: String,
    /// Looked at by faulty master controls.
    #[serde(default)]
    pub(super) action_type: String,
    pub(super) action_status: String,
}

impl ActionState {
    pub(super) fn is_terminal(&self) -> bool {
        matches!(self.action_status.as_str(), "FINISHED" | "FAILED")
    }
}

/// agvPosition.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Position {
    pub(super) x: f64,
    pub(super) y: f64,
    #[serde(default)]
    pub(super) theta: f64,
    #[serde(default)]
    pub(super) map_id: String,
    #[serde(default = "yes")]
    pub(super) position_initialized: bool,
    /// For logging and visualization only; looked at by faulty master controls.
    #[serde(default)]
    pub(super) localization_score: Option<f64>,
    /// The same.
    #[serde(default)]
    pub(super) deviation_range: Option<f64>,
}

impl Position {
    /// A place, with no more told about it.
    pub(super) fn of(x: f64, y: f64, map_id: String) -> Self {
        Self {
            x,
            y,
            theta: 0.0,
            map_id,
            position_initialized: true,
            localization_score: None,
            deviation_range: None,
        }
    }
}

fn yes() -> bool {
    true
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Reference {
    pub(super) reference_key: String,
    pub(super) reference_value: String,
}

/// An error the vehicle reports.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ErrorSeen {
    pub(super) error_type: String,
    pub(super) error_level: String,
    #[serde(default)]
    pub(super) error_references: Option<Vec<Reference>>,
}

impl ErrorSeen {
    /// The value of a reference.
    pub(super) fn reference(&self, key: &str) -> Option<&str> {
        let references = self.error_references.as_deref().unwrap_or_default();
        let found = references.iter().find(|reference| reference.reference_key == key);
        found.map(|reference| reference.reference_value.as_str())
    }
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MapSeen {
    pub(super) map_id: String,
    pub(super) map_version: String,
    pub(super) map_status: String,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Battery {
    #[serde(default)]
    pub(super) battery_charge: Option<f64>,
    #[serde(default)]
    pub(super) charging: bool,
}

#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Safety {
    #[serde(default)]
    pub(super) e_stop: String,
}

/// A state.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct State {
    pub(super) order_id: String,
    #[serde(deserialize_with = "whole")]
    pub(super) order_update_id: u32,
    pub(super) last_node_id: String,
    #[serde(deserialize_with = "whole")]
    pub(super) last_node_sequence_id: u32,
    pub(super) node_states: Vec<ElementState>,
    pub(super) edge_states: Vec<ElementState>,
    #[serde(default)]
    pub(super) agv_position: Option<Position>,
    #[serde(default)]
    pub(super) loads: Option<Vec<Value>>,
    pub(super) driving: bool,
    /// Looked at by faulty master controls.
    #[serde(default)]
    pub(super) paused: Option<Value>,
    #[serde(default)]
    pub(super) new_base_request: Option<bool>,
    pub(super) action_states: Vec<ActionState>,
    #[serde(default)]
    pub(super) battery_state: Battery,
    pub(super) operating_mode: String,
    pub(super) errors: Vec<ErrorSeen>,
    /// For visualization and debugging only; looked at by faulty master controls.
    #[serde(default)]
    pub(super) information: Option<Vec<Value>>,
    #[serde(default)]
    pub(super) safety_state: Safety,
    #[serde(default)]
    pub(super) maps: Option<Vec<MapSeen>>,
}

impl State {
    /// How far an action is.
    pub(super) fn action(&self, id: &str) -> Option<&ActionState> {
        self.action_states.iter().find(|action| action.action_id == id)
    }

    /// Whether master control may command the vehicle (MODE-04).
    pub(super) fn takes_orders(&self) -> bool {
        matches!(self.operating_mode.as_str(), "AUTOMATIC" | "SEMIAUTOMATIC")
    }

    /// Whether it is paused.
    pub(super) fn is_paused(&self) -> bool {
        self.paused == Some(Value::Bool(true))
    }

    /// Whether it gives any information.
    pub(super) fn informs(&self) -> bool {
        self.information.as_ref().is_some_and(|list| !list.is_empty())
    }

    /// Whether nothing is left to be traversed.
    pub(super) fn route_empty(&self) -> bool {
        self.node_states.is_empty() && self.edge_states.is_empty()
    }

    /// The sequenceId of a node that is passed cannot be higher than this.
    pub(super) fn before_next_node(&self) -> u32 {
        let ahead = self.node_states.iter().filter_map(|node| node.sequence_id).min();
        ahead.map_or(u32::MAX, |next| next.saturating_sub(2))
    }

    /// Whether something keeps the vehicle from being given new work.
    pub(super) fn is_fit(&self, low_battery: f64) -> bool {
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
    pub(super) fn map_enabled(&self, map_id: &str) -> bool {
        let Some(maps) = &self.maps else { return true };
        maps.iter()
            .any(|map| map.map_id == map_id && map.map_status == "ENABLED")
    }

    /// Whether a map version is on board.
    pub(super) fn has_map(&self, map_id: &str, version: &str) -> bool {
        let maps = self.maps.as_deref().unwrap_or_default();
        maps.iter()
            .any(|map| map.map_id == map_id && map.map_version == version)
    }
}

/// A parameter of an action in the factsheet.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ParameterOffer {
    pub(super) key: String,
    #[serde(default)]
    pub(super) value_data_type: String,
    #[serde(default)]
    pub(super) is_optional: Option<bool>,
}

/// An action in the factsheet.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct ActionOffer {
    pub(super) action_type: String,
    #[serde(default)]
    pub(super) action_scopes: Vec<String>,
    #[serde(default)]
    pub(super) action_parameters: Option<Vec<ParameterOffer>>,
    #[serde(default)]
    pub(super) blocking_types: Option<Vec<String>>,
}

/// The factsheet, as far as master control goes by it.
#[derive(Clone, Debug, Default)]
pub(super) struct Factsheet {
    /// Action by type; `None` if the factsheet lists none at all.
    pub(super) actions: Option<BTreeMap<String, ActionOffer>>,
    /// Support by optional parameter.
    pub(super) optional: BTreeMap<String, String>,
    /// Limits of arrays by their name.
    pub(super) arrays: BTreeMap<String, usize>,
    /// Longest message in bytes.
    pub(super) message: Option<usize>,
    /// Longest id.
    pub(super) id_length: Option<usize>,
    /// Ids consist of digits.
    pub(super) ids_numerical: bool,
    /// Seconds between order messages.
    pub(super) order_interval: f64,
    /// Names of load handling devices.
    pub(super) devices: Vec<String>,
    /// Types of loads.
    pub(super) load_types: Vec<String>,
    /// Whether a limit is 0 (`zero-is-a-limit`).
    pub(super) has_zeros: bool,
}

impl Factsheet {
    /// Reads a factsheet; what is missing or strange limits nothing.
    pub(super) fn read(message: &Value) -> Self {
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
            Some((text("parameter")?.to_owned(), text("support")?.to_owned()))
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
            has_zeros: at("/protocolLimits/maxArrayLens").is_some_and(|limits| limits["order.nodes"] == 0),
        }
    }

    /// What the vehicle says to an optional parameter, such as `order.edges.maxSpeed`.
    pub(super) fn support(&self, parameter: &str) -> Option<&str> {
        self.optional.get(parameter).map(String::as_str)
    }

    /// Whether a list of what it supports, if there is one, has the positions of nodes in it.
    pub(super) fn knows_positions(&self) -> bool {
        self.optional.is_empty() || self.optional.keys().any(|name| name.contains("nodePosition"))
    }

    /// The smaller of the limits of these names.
    pub(super) fn limit(&self, names: &[&str]) -> usize {
        let limits = names.iter().filter_map(|name| self.arrays.get(*name));
        limits.min().copied().unwrap_or(usize::MAX)
    }
}
