//! What people and tests ask of the master control; each leads to an order (section 6.6), an instant action (6.9) or a
//! map (6.7).

use serde_json::{Value, json};

use super::config::SiteMap;
use super::vehicle::{Transport, Vehicle};
use super::{MasterControl, Site};

/// The commands of [`crate::Input::Command`]; unknown ones are ignored.
///
/// All but the last four take `vehicle`, a serial number; without it the first vehicle is meant. `dispatch {from, to,
/// loadType, action, parameters}`, `reroute {to}`, `instant-action {action, parameters}`, `init-position {nodeId}` or
/// `{x, y, theta, mapId, lastNodeId}`, `update-certificate {service, keyDownloadLink, certificateDownloadLink}`, `download-map {mapId, mapVersion, mapDownloadLink, mapHash}`, `enable-map` and
/// `delete-map {mapId, mapVersion}`, `distribute-zones {what, nodeId}`, `download-zones {mapId, zoneSetId, zoneSetDownloadLink}`,
/// `answer-requests {how}`, `revoke-grant {requestId}`, `block-edge` and `unblock-edge {from, to}`, `configure {what}` with what it is to do
/// otherwise; the others take nothing.
pub const COMMANDS: &[&str] = &[
    "dispatch",
    "reroute",
    "cancel",
    "pause",
    "resume",
    "instant-action",
    "retry",
    "skip-retry",
    "give-trigger",
    "update-certificate",
    "request-factsheet",
    "request-state",
    "init-position",
    "download-map",
    "enable-map",
    "delete-map",
    "distribute-zones",
    "withdraw-zones",
    "download-zones",
    "answer-requests",
    "revoke-grant",
    "block-edge",
    "unblock-edge",
    "configure",
    "start",
    "shutdown",
    "confirm",
];

/// More ways than this are not blocked for a vehicle.
const MAX_BLOCKED: usize = 1000;

impl MasterControl {
    pub(super) fn command(&mut self, name: &str, arguments: &Value) {
        let index = self.meant(arguments);
        if !self.site.commanded(&mut self.fleet, name, arguments) {
            return;
        }
        if let Some(vehicle) = index.and_then(|index| self.fleet.get_mut(index))
            && !self.site.asked(vehicle, name, arguments)
        {
            return;
        }
        match name {
            "start" => self.site.start(),
            "shutdown" => self.site.shut_down(),
            _ => {
                if let Some(vehicle) = index.and_then(|index| self.fleet.get_mut(index)) {
                    self.site.vehicle_command(vehicle, name, arguments);
                }
            }
        }
    }
}

impl MasterControl {
    /// Which vehicle of the fleet a command is about.
    pub(super) fn meant(&self, arguments: &Value) -> Option<usize> {
        let serial = text(arguments, "vehicle");
        let mut fleet = self.fleet.iter();
        fleet.position(|vehicle| {
            serial
                .as_ref()
                .is_none_or(|serial| *serial == vehicle.config.serial_number)
        })
    }
}

impl Site {
    /// Does what is asked for a vehicle.
    pub(crate) fn vehicle_command(&mut self, vehicle: &mut Vehicle, name: &str, arguments: &Value) {
        let text = |key: &str| text(arguments, key);
        let pair = |a: &str, b: &str| Some((text(a)?, text(b)?));
        match name {
            "dispatch" => {
                if let Some(transport) = transport(vehicle, arguments) {
                    self.dispatch(vehicle, transport);
                }
            }
            "reroute" => {
                if let Some(to) = text("to") {
                    self.reroute(vehicle, &to);
                }
            }
            "cancel" => self.call_off(vehicle),
            "pause" => {
                self.instant(vehicle, "startPause", &Value::Null);
            }
            "resume" => {
                self.instant(vehicle, "stopPause", &Value::Null);
            }
            "request-factsheet" => {
                self.instant(vehicle, "factsheetRequest", &Value::Null);
            }
            "request-state" => {
                self.instant(vehicle, "stateRequest", &Value::Null);
            }
            "instant-action" => self.instant_asked(vehicle, arguments),
            "retry" => self.decide_retriable(vehicle, "retry"),
            "skip-retry" => self.decide_retriable(vehicle, "skipRetry"),
            "give-trigger" => {
                self.instant(vehicle, "trigger", &Value::Null);
            }
            "update-certificate" => self.update_certificate(vehicle, arguments),
            "init-position" => self.init_position(vehicle, arguments),
            "download-map" => {
                if let Some(map) = self.map_named(arguments) {
                    self.download_map(vehicle, map);
                }
            }
            "enable-map" | "delete-map" => {
                let kind = if name == "enable-map" { "enableMap" } else { "deleteMap" };
                if let Some((map_id, version)) = pair("mapId", "mapVersion") {
                    self.map_action(vehicle, kind, &map_id, &version);
                }
            }
            "distribute-zones" => self.distribute_zones(vehicle, arguments),
            "withdraw-zones" => self.withdraw_zones(vehicle),
            "download-zones" => self.download_zones(vehicle, arguments),
            "answer-requests" => self.answer_otherwise(&text("how").unwrap_or_default()),
            "revoke-grant" => self.revoke(vehicle, text("requestId").as_deref()),
            "block-edge" if vehicle.blocked.len() < MAX_BLOCKED => {
                if let Some((from, to)) = pair("from", "to") {
                    self.block(vehicle, &from, &to);
                }
            }
            "unblock-edge" => {
                if let Some(edge) = pair("from", "to") {
                    vehicle.blocked.remove(&edge);
                }
            }
            _ => {}
        }
        vehicle.at(self.now.moment);
    }

    /// The running transport, or the next one, is not wanted any more.
    pub(crate) fn call_off(&mut self, vehicle: &mut Vehicle) {
        if vehicle.running.is_some() {
            if vehicle.queue.front().is_some_and(|next| next.follows) {
                vehicle.queue.pop_front();
            }
            self.cancel(vehicle, None);
        } else if vehicle.queue.pop_front().is_none() && vehicle.cancel.is_none() {
            let foreign = vehicle.state.as_ref().is_some_and(|state| !state.route_empty());
            if foreign {
                self.instant(vehicle, "cancelOrder", &Value::Null);
            }
        }
    }

    fn instant_asked(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let Some(kind) = text(arguments, "action") else { return };
        let parameters = parameters(arguments);
        match kind.as_str() {
            "cancelOrder" => self.call_off(vehicle),
            "initPosition" => self.init_position(vehicle, &parameters),
            _ => {
                self.instant(vehicle, &kind, &parameters);
            }
        }
    }

    /// Has the vehicle fetch a certificate, over a link that nobody can read along (CERT-05).
    fn update_certificate(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let link = |key: &str| text(arguments, key).filter(|link| link.starts_with("https://"));
        let links = (link("keyDownloadLink"), link("certificateDownloadLink"));
        let (Some(key), Some(certificate)) = links else { return };
        let service = text(arguments, "service").unwrap_or_else(|| "MQTT".into());
        let given = json!({ "service": service, "keyDownloadLink": key, "certificateDownloadLink": certificate });
        self.instant(vehicle, "updateCertificate", &given);
    }

    /// The map of a command, completed from the maps of the site.
    fn map_named(&self, arguments: &Value) -> Option<SiteMap> {
        let map_id = text(arguments, "mapId")?;
        let version = text(arguments, "mapVersion");
        let known = self
            .config
            .maps
            .iter()
            .find(|map| map.map_id == map_id && version.as_ref().is_none_or(|version| *version == map.map_version));
        let link = text(arguments, "mapDownloadLink").or(known.map(|map| map.link.clone()));
        Some(SiteMap {
            map_version: version
                .or(known.map(|map| map.map_version.clone()))
                .unwrap_or_else(|| "1".into()),
            link: link.filter(|link| !link.is_empty())?,
            hash: text(arguments, "mapHash").or(known.and_then(|map| map.hash.clone())),
            map_id,
        })
    }
}

/// The transport of a command; an action alone is performed where the vehicle stands.
pub(crate) fn transport(vehicle: &Vehicle, arguments: &Value) -> Option<Transport> {
    let text = |key: &str| text(arguments, key);
    let action = text("action");
    let here = || vehicle.state.as_ref().map(|state| state.last_node_id.clone());
    Some(Transport {
        from: text("from"),
        to: text("to").or_else(|| here().filter(|_| action.is_some()))?,
        load_type: text("loadType"),
        parameters: parameters(arguments),
        action,
        ..Transport::default()
    })
}

/// A parameter of a command that is there and not empty.
pub(crate) fn text(arguments: &Value, key: &str) -> Option<String> {
    let text = arguments.get(key)?.as_str()?;
    (!text.is_empty()).then(|| text.to_owned())
}

/// The parameters of an action: an object, or the text of one, as hooks hand it over.
fn parameters(arguments: &Value) -> Value {
    match arguments.get("parameters") {
        Some(Value::String(text)) => serde_json::from_str(text).unwrap_or_default(),
        Some(object) => object.clone(),
        None => Value::Null,
    }
}
