//! Actions: what one is made of, and whether a vehicle offers it.

use serde_json::{Map, Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::seen::{ActionOffer, ActionState, Factsheet, ParameterOffer};
use super::tolerances::ToleranceName as T;
use super::vehicle::Vehicle;

/// Where the table of predefined actions allows each (ACT-08).
const SCOPES: [(&str, &[&str]); 17] = [
    ("startPause", &["INSTANT"]),
    ("stopPause", &["INSTANT"]),
    ("startCharging", &["INSTANT", "NODE"]),
    ("stopCharging", &["INSTANT", "NODE"]),
    ("initPosition", &["INSTANT", "NODE"]),
    ("enableMap", &["INSTANT", "NODE"]),
    ("downloadMap", &["INSTANT"]),
    ("deleteMap", &["INSTANT"]),
    ("stateRequest", &["INSTANT"]),
    ("logReport", &["INSTANT"]),
    ("pick", &["NODE", "EDGE"]),
    ("drop", &["NODE", "EDGE"]),
    ("detectObject", &["NODE", "EDGE"]),
    ("finePositioning", &["NODE", "EDGE"]),
    ("waitForTrigger", &["NODE"]),
    ("cancelOrder", &["INSTANT"]),
    ("factsheetRequest", &["INSTANT"]),
];

/// Parameters the text demands, whatever the factsheet says (ACT-31).
const MANDATORY: [(&str, &[&str]); 7] = [
    ("initPosition", &["x", "y", "theta", "mapId", "lastNodeId"]),
    ("enableMap", &["mapId", "mapVersion"]),
    ("downloadMap", &["mapId", "mapVersion", "mapDownloadLink"]),
    ("deleteMap", &["mapId", "mapVersion"]),
    ("logReport", &["reason"]),
    ("pick", &["stationType", "loadType"]),
    ("waitForTrigger", &["triggerType"]),
];

impl Site {
    /// Whether a vehicle takes an action in a scope.
    pub(super) fn offers(&self, sheet: Option<&Factsheet>, kind: &str, scope: &str) -> bool {
        let predefined = SCOPES.iter().find(|(name, _)| *name == kind);
        if self.faults.has(F::ScopeIgnored) {
            return true;
        }
        if predefined.is_some_and(|(_, scopes)| !scopes.contains(&scope)) {
            return false;
        }
        if predefined.is_some() && self.faults.has(F::R1PredefinedNeedNoFactsheet) {
            return true;
        }
        match sheet.and_then(|sheet| sheet.actions.as_ref()) {
            Some(actions) => {
                let offer = actions.get(kind);
                offer.is_some_and(|offer| offer.action_scopes.iter().any(|listed| listed == scope))
                    // cancelOrder and the pauses are obligatory, so that a factsheet without them has forgotten them.
                    || (offer.is_none() && kind == "cancelOrder")
            }
            None => predefined.is_some(),
        }
    }

    /// An action with all parameters it needs, those handed over first.
    pub(super) fn action(&mut self, vehicle: &Vehicle, kind: &str, given: &Value) -> Value {
        let offer = vehicle
            .factsheet
            .as_ref()
            .and_then(|sheet| sheet.actions.as_ref()?.get(kind));
        let mut parameters = Map::new();
        for (key, value) in given.as_object().into_iter().flatten() {
            let listed = offer.and_then(|offer| offer.action_parameters.as_ref());
            let known = listed.is_none_or(|list| list.iter().any(|parameter| parameter.key == *key));
            let known = known || self.faults.has(F::R1UnlistedParametersPassed);
            if (known || is_mandatory(kind, key)) && !value.is_null() {
                parameters.insert(key.clone(), value.clone());
            }
        }
        let mandatory = MANDATORY
            .iter()
            .find(|(name, _)| *name == kind)
            .map_or(&[][..], |(_, keys)| *keys);
        // Nobody has chosen one.
        let open = |key: &str| {
            let load = kind == "pick" && key == "loadType" && given.get(key).is_none();
            load && self.faults.has(F::R5PickWithoutLoadType)
        };
        for key in mandatory.iter().filter(|key| !open(key)) {
            self.supply(vehicle, &mut parameters, key, "STRING");
        }
        let offered: Vec<ParameterOffer> = offer
            .and_then(|offer| offer.action_parameters.clone())
            .unwrap_or_default();
        let generous = self.takes(T::R2OptionalParametersFilled) && SCOPES.iter().all(|(name, _)| *name != kind);
        for parameter in offered
            .iter()
            .filter(|parameter| generous || parameter.is_optional != Some(true))
            .filter(|parameter| !open(&parameter.key))
        {
            if kind == "drop" && self.faults.has(F::LoadParametersByTable) {
                continue;
            }
            if !self.faults.has(F::RequiredKeyMissing) || !mandatory.is_empty() {
                self.supply(vehicle, &mut parameters, &parameter.key, &parameter.value_data_type);
            }
        }
        let devices = vehicle.factsheet.as_ref().map_or(&[][..], |sheet| &sheet.devices);
        if matches!(kind, "pick" | "drop") && devices.len() > 1 && !parameters.contains_key("lhd") {
            let habit = self.faults.has(F::DeviceByHabit);
            parameters.insert("lhd".into(), if habit { json!("LHD1") } else { json!(devices[0]) });
        }
        if let Some(named) = parameters.get_mut("lhd")
            && let Some(index) = devices.iter().position(|device| *named == json!(device))
            && self.faults.has(F::R5LhdAsIndex)
        {
            *named = json!(index.to_string());
        }
        let vendor = SCOPES.iter().all(|(name, _)| *name != kind);
        if vendor && self.faults.has(F::R1VendorParametersDropped) {
            parameters.clear();
        }
        for (_, value) in &mut parameters {
            if vendor && !value.is_string() && self.faults.has(F::R1VendorValuesAsText) {
                *value = json!(value.to_string());
            }
        }
        if let Some(running) = vehicle.running.as_ref().filter(|_| kind == "cancelOrder")
            && self.faults.has(F::R5CancelWithOrderIdParameter)
        {
            parameters.insert("orderId".into(), json!(running.id));
        }
        let blocking = self.blocking(offer);
        let sent = if self.faults.has(F::VendorActionRenamed) && SCOPES.iter().all(|(name, _)| *name != kind) {
            capitalized(kind)
        } else if vendor && self.faults.has(F::R5VendorActionLowerCase) {
            kind.to_lowercase()
        } else {
            kind.to_owned()
        };
        let mut action = json!({
            "actionType": sent,
            "actionId": self.failed_id(vehicle, kind).unwrap_or_else(|| self.next_id(vehicle, "action")),
            "blockingType": blocking,
        });
        if vendor && self.faults.has(F::R3VendorActionWrapped) {
            action["actionType"] = json!("customAction");
            parameters.insert("name".into(), json!(kind));
        }
        if kind == "startPause" && self.faults.has(F::R1PauseIdRepeats) {
            action["actionId"] = json!("pause");
        }
        if !parameters.is_empty() || self.takes(T::R1EmptyParameterLists) {
            let mut list: Vec<Value> = parameters
                .into_iter()
                .map(|(key, value)| json!({ "key": key, "value": value }))
                .collect();
            if self.takes(T::R2ParametersReversed) {
                list.reverse();
            }
            action["actionParameters"] = Value::Array(list);
        }
        action
    }

    /// `failed-action-repeated`: the id of the action of this type that has failed.
    fn failed_id(&self, vehicle: &Vehicle, kind: &str) -> Option<String> {
        let actions = &vehicle.state.as_ref()?.action_states;
        let failed = |action: &&ActionState| action.action_type == kind && action.action_status == "FAILED";
        let failed = actions.iter().find(failed).map(|action| action.action_id.clone());
        failed.filter(|_| self.faults.has(F::FailedActionRepeated))
    }

    fn blocking(&self, offer: Option<&ActionOffer>) -> String {
        let listed = offer.and_then(|offer| offer.blocking_types.clone()).unwrap_or_default();
        let wanted = if self.takes(T::SoftActions) { "SOFT" } else { "HARD" };
        if self.faults.has(F::BlockingTypeUnlisted) || listed.is_empty() || listed.iter().any(|kind| kind == wanted) {
            return wanted.to_owned();
        }
        let known = listed
            .iter()
            .find(|kind| matches!(kind.as_str(), "NONE" | "SOFT" | "HARD"));
        known.map_or(wanted, String::as_str).to_owned()
    }

    /// A value for a parameter nobody handed over.
    fn supply(&self, vehicle: &Vehicle, parameters: &mut Map<String, Value>, key: &str, data_type: &str) {
        if parameters.contains_key(key) {
            return;
        }
        let value = match key {
            "stationType" => json!(self.config.station_type),
            "loadType" => json!(self.load_type(vehicle)),
            "triggerType" => json!("button"),
            "reason" => json!("requested"),
            "duration" => json!(1.0),
            _ if self.faults.has(F::R2SuppliedValuesAsText) => json!(match data_type {
                "BOOL" => "true",
                "NUMBER" | "FLOAT" | "INTEGER" => "1",
                "OBJECT" => "{}",
                "ARRAY" => "[]",
                _ => "default",
            }),
            _ => match data_type {
                "BOOL" => json!(true),
                "NUMBER" | "FLOAT" => json!(1.0),
                "INTEGER" => json!(1),
                "OBJECT" => json!({}),
                "ARRAY" => json!([]),
                _ => json!("default"),
            },
        };
        parameters.insert(key.to_owned(), value);
    }

    fn load_type(&self, vehicle: &Vehicle) -> String {
        let listed = vehicle
            .factsheet
            .as_ref()
            .and_then(|sheet| sheet.load_types.first().cloned());
        listed.unwrap_or_else(|| self.config.load_type.clone())
    }
}

/// Whether an action is one of the table.
pub(super) fn is_predefined(kind: &str) -> bool {
    SCOPES.iter().any(|(name, _)| *name == kind)
}

/// Whether the text demands a parameter.
fn is_mandatory(kind: &str, key: &str) -> bool {
    MANDATORY
        .iter()
        .any(|(name, keys)| *name == kind && keys.contains(&key))
}

fn capitalized(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first.into_iter().chain(letters).collect()
}
