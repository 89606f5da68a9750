//! Actions: what one is made of, and whether a vehicle offers it (sections 6.8 and 6.15).
//!
//! A factsheet that lists no action at all leaves the table of predefined ones (the ruling of FACT-15).

use serde_json::{Map, Value, json};

use super::Site;
use super::hooks::Permission;
use super::seen::ActionOffer;
use super::vehicle::Vehicle;

/// Where the table of predefined actions allows each (ACT-08).
const SCOPES: &[(&str, &[&str])] = &[
    ("startPause", &["INSTANT"]),
    ("stopPause", &["INSTANT"]),
    ("startCharging", &["INSTANT", "NODE"]),
    ("stopCharging", &["INSTANT", "NODE"]),
    ("initPosition", &["INSTANT", "NODE"]),
    ("enableMap", &["INSTANT", "NODE"]),
    ("downloadMap", &["INSTANT"]),
    ("deleteMap", &["INSTANT"]),
    ("downloadZoneSet", &["INSTANT"]),
    ("enableZoneSet", &["INSTANT", "NODE"]),
    ("deleteZoneSet", &["INSTANT"]),
    ("stateRequest", &["INSTANT"]),
    ("logReport", &["INSTANT"]),
    ("pick", &["NODE", "EDGE"]),
    ("drop", &["NODE", "EDGE"]),
    ("detectObject", &["NODE", "EDGE"]),
    ("finePositioning", &["NODE", "EDGE"]),
    ("waitForTrigger", &["NODE"]),
    ("cancelOrder", &["INSTANT"]),
    ("factsheetRequest", &["INSTANT"]),
    ("startHibernation", &["INSTANT"]),
    ("stopHibernation", &["INSTANT"]),
    ("shutdown", &["INSTANT"]),
    ("clearInstantActions", &["INSTANT", "NODE"]),
    ("clearZoneActions", &["INSTANT", "NODE"]),
    ("trigger", &["INSTANT"]),
    ("retry", &["INSTANT"]),
    ("skipRetry", &["INSTANT"]),
    ("updateCertificate", &["INSTANT"]),
];

/// Actions that only versions with a feature have.
const SINCE: &[(&str, &str)] = &[
    ("startHibernation", "hibernation"),
    ("stopHibernation", "hibernation"),
    ("shutdown", "hibernation"),
    ("clearInstantActions", "instantActionStates"),
    ("clearZoneActions", "zones"),
    ("trigger", "triggers"),
    ("retry", "retry"),
    ("skipRetry", "retry"),
    ("updateCertificate", "certificates"),
];

/// Parameters the text demands, whatever the factsheet says (ACT-31).
const MANDATORY: &[(&str, &[&str])] = &[
    ("initPosition", &["x", "y", "theta", "mapId", "lastNodeId"]),
    ("enableMap", &["mapId", "mapVersion"]),
    ("downloadMap", &["mapId", "mapVersion", "mapDownloadLink"]),
    ("deleteMap", &["mapId", "mapVersion"]),
    ("downloadZoneSet", &["zoneSetId", "zoneSetDownloadLink"]),
    ("enableZoneSet", &["zoneSetId"]),
    ("deleteZoneSet", &["zoneSetId"]),
    ("logReport", &["reason"]),
    ("pick", &["stationType", "loadType"]),
    ("waitForTrigger", &["triggerType"]),
    ("retry", &["actionId"]),
    ("skipRetry", &["actionId"]),
    (
        "updateCertificate",
        &["service", "keyDownloadLink", "certificateDownloadLink"],
    ),
];

impl Site {
    /// Whether a vehicle takes an action in a scope (FACT-15).
    pub(crate) fn offers(&self, vehicle: &Vehicle, kind: &str, scope: &str) -> bool {
        let predefined = SCOPES.iter().find(|(name, _)| *name == kind);
        let listed = vehicle.factsheet.as_ref().and_then(|sheet| sheet.actions.as_ref());
        let usual = match listed {
            _ if predefined.is_some_and(|(_, scopes)| !scopes.contains(&scope)) => false,
            Some(actions) => {
                let offer = actions.get(kind);
                offer.is_some_and(|offer| offer.action_scopes.iter().any(|listed| listed == scope))
                    // cancelOrder and the pauses are obligatory, so that a factsheet without them has forgotten them.
                    || (offer.is_none() && kind == "cancelOrder")
            }
            None => predefined.is_some() && knows(vehicle, kind),
        };
        self.allows(vehicle, Permission::Offer(kind, scope), usual)
    }

    /// An action of an order with all parameters it needs, those handed over first.
    pub(crate) fn action(&mut self, vehicle: &Vehicle, kind: &str, given: &Value) -> Value {
        self.made_action(vehicle, kind, given, false)
    }

    /// An action of an order or an instant action, with all parameters it needs, those handed over first.
    pub(crate) fn made_action(&mut self, vehicle: &Vehicle, kind: &str, given: &Value, instant: bool) -> Value {
        let offer = vehicle.offer(kind);
        let listed = offer.and_then(|offer| offer.action_parameters.as_deref());
        let mut parameters = Map::new();
        for (key, value) in given.as_object().into_iter().flatten() {
            let known = listed.is_none_or(|list| list.iter().any(|parameter| parameter.key == *key));
            if (known || demanded(vehicle, kind).contains(&key.as_str())) && !value.is_null() {
                parameters.insert(key.clone(), value.clone());
            }
        }
        let demanded = demanded(vehicle, kind).iter().map(|key| (*key, "STRING"));
        let required = listed.into_iter().flatten();
        let required = required.filter(|parameter| parameter.is_optional != Some(true));
        let required = required.map(|parameter| (parameter.key.as_str(), parameter.value_data_type.as_str()));
        for (key, data_type) in demanded.chain(required) {
            if !parameters.contains_key(key) {
                parameters.insert(key.to_owned(), self.supplied(vehicle, key, data_type));
            }
        }
        // Which of several devices handles the load has to be said (ACT-32).
        let devices = vehicle.factsheet.as_ref().map_or(&[][..], |sheet| &sheet.devices);
        if matches!(kind, "pick" | "drop") && devices.len() > 1 && !parameters.contains_key("lhd") {
            parameters.insert("lhd".into(), json!(devices[0]));
        }
        let mut action = json!({
            "actionType": kind,
            "actionId": self.next_id(vehicle, "action"),
            "blockingType": if instant && vehicle.config.has("instantActionsNeverBlock") { "NONE".to_owned() } else { blocking(offer) },
        });
        if !parameters.is_empty() {
            let list = parameters.into_iter();
            action["actionParameters"] = list.map(|(key, value)| json!({ "key": key, "value": value })).collect();
        }
        if let Value::Object(action) = &mut action {
            self.makes(vehicle, action, given, instant);
        }
        action
    }

    /// A value for a parameter nobody handed over.
    pub(crate) fn supplied(&self, vehicle: &Vehicle, key: &str, data_type: &str) -> Value {
        match (key, data_type) {
            ("stationType", _) => json!(self.config.station_type),
            ("loadType", _) => {
                let listed = vehicle.factsheet.as_ref().and_then(|sheet| sheet.load_types.first());
                json!(listed.unwrap_or(&self.config.load_type))
            }
            ("triggerType", _) if vehicle.config.has("triggers") => json!(["LOCAL"]),
            ("triggerType", _) => json!("button"),
            ("reason", _) => json!("requested"),
            ("duration", _) | (_, "NUMBER" | "FLOAT") => json!(1.0),
            (_, "BOOL") => json!(true),
            (_, "INTEGER") => json!(1),
            (_, "OBJECT") => json!({}),
            (_, "ARRAY") => json!([]),
            _ => json!("default"),
        }
    }
}

impl Vehicle {
    /// Entry of the factsheet about an action.
    pub(crate) fn offer(&self, kind: &str) -> Option<&ActionOffer> {
        self.factsheet.as_ref()?.actions.as_ref()?.get(kind)
    }
}

/// The blocking type: HARD, or one the vehicle lists.
fn blocking(offer: Option<&ActionOffer>) -> String {
    let listed = offer
        .and_then(|offer| offer.blocking_types.as_deref())
        .unwrap_or_default();
    let wanted = listed.iter().find(|kind| *kind == "HARD");
    let known = || {
        listed
            .iter()
            .find(|kind| matches!(kind.as_str(), "NONE" | "SINGLE" | "SOFT" | "HARD"))
    };
    wanted.or_else(known).map_or("HARD", String::as_str).to_owned()
}

/// Whether the version of a vehicle has a predefined action.
fn knows(vehicle: &Vehicle, kind: &str) -> bool {
    let since = SINCE.iter().find(|(name, _)| *name == kind);
    since.is_none_or(|(_, feature)| vehicle.config.has(feature))
}

/// The parameters that the version of a vehicle demands.
fn demanded(vehicle: &Vehicle, kind: &str) -> &'static [&'static str] {
    match kind {
        "pick" if vehicle.config.has("optionalLoadParameters") => &[],
        _ => mandatory(kind),
    }
}

/// The parameters the text demands.
pub(crate) fn mandatory(kind: &str) -> &'static [&'static str] {
    let demanded = MANDATORY.iter().find(|(name, _)| *name == kind);
    demanded.map_or(&[][..], |(_, keys)| *keys)
}

/// Whether an action is one of the table.
pub(crate) fn is_predefined(kind: &str) -> bool {
    SCOPES.iter().any(|(name, _)| *name == kind)
}

/// Whether the table allows an action in this scope.
pub(crate) fn is_predefined_in(kind: &str, scope: &str) -> bool {
    SCOPES
        .iter()
        .any(|(name, scopes)| *name == kind && scopes.contains(&scope))
}
