//! What people and tests ask of the master control.

use serde_json::Value;

use super::config::SiteMap;
use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Transport, Vehicle};
use super::{MasterControl, Site};

/// The commands of [`crate::reference::Input::Command`]; unknown ones are ignored.
///
/// All but the last four take `vehicle`, a serial number; without it the first vehicle is meant. `dispatch {from, to,
/// loadType, action, parameters}`, `reroute {to}`, `instant-action {action, parameters}`, `init-position {nodeId}` or
/// `{x, y, theta, mapId, lastNodeId}`, `download-map {mapId, mapVersion, mapDownloadLink, mapHash}`, `enable-map` and
/// `delete-map {mapId, mapVersion}`, `block-edge` and `unblock-edge {from, to}`, `configure {what}` with the name of a
/// tolerance; the others take nothing.
pub const COMMANDS: &[&str] = &[
    "dispatch",
    "reroute",
    "cancel",
    "pause",
    "resume",
    "instant-action",
    "request-factsheet",
    "request-state",
    "init-position",
    "download-map",
    "enable-map",
    "delete-map",
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
        match name {
            "start" => self.start(),
            "shutdown" => self.shut_down(),
            "configure" => {
                let what = arguments.get("what").and_then(Value::as_str).unwrap_or_default();
                // What it has no setting for leaves it as it is.
                let _ = self.site.config.tolerate(what);
            }
            _ => {
                let serial = text(arguments, "vehicle");
                let mut named = self.fleet.iter().enumerate().filter(|(_, vehicle)| {
                    serial
                        .as_ref()
                        .is_none_or(|serial| *serial == vehicle.config.serial_number)
                });
                let index = named.next().map(|(index, _)| index);
                if matches!(name, "pause" | "resume") && self.site.faults.has(F::PauseForAll) {
                    for vehicle in &mut self.fleet {
                        self.site.vehicle_command(vehicle, name, arguments);
                        vehicle.at(self.site.now.moment);
                    }
                    return;
                }
                if let Some(vehicle) = index.and_then(|index| self.fleet.get_mut(index)) {
                    self.site.vehicle_command(vehicle, name, arguments);
                    vehicle.at(self.site.now.moment);
                }
            }
        }
    }
}

impl Site {
    fn vehicle_command(&mut self, vehicle: &mut Vehicle, name: &str, arguments: &Value) {
        let text = |key: &str| text(arguments, key);
        let pair = |a: &str, b: &str| Some((text(a)?, text(b)?));
        match name {
            "dispatch" => self.order_transport(vehicle, arguments),
            "reroute" => {
                if let Some(to) = text("to") {
                    self.reroute(vehicle, &to);
                }
            }
            "cancel" if vehicle.running.is_some() && self.takes(T::R4CancelsAfterTwoSeconds) => {
                let due = self.now.moment + std::time::Duration::from_secs(2);
                let order = vehicle.running.as_ref().map(|running| running.id.clone());
                vehicle.r4_cancel_at = order.map(|order| (due, order));
            }
            "cancel" => self.call_off(vehicle),
            "pause" => {
                self.instant(vehicle, "startPause", &Value::Null);
                if self.takes(T::R5PauseTogetherWithStateRequest) {
                    self.instant(vehicle, "stateRequest", &Value::Null);
                }
                if self.takes(T::R4PauseSentTwice) {
                    self.send_instants(vehicle);
                    self.instant(vehicle, "startPause", &Value::Null);
                }
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
            "init-position" => self.init_position(vehicle, arguments),
            "download-map" if vehicle.running.is_some() && self.faults.has(F::R3DownloadRefusedDuringOrder) => {}
            "download-map" if !self.faults.has(F::MapNotPreloaded) => {
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
            "block-edge" if vehicle.blocked.len() < MAX_BLOCKED => {
                if let Some((from, to)) = pair("from", "to") {
                    self.block(vehicle, &from, &to);
                }
            }
            "unblock-edge" => {
                if let Some(edge) = pair("from", "to") {
                    vehicle.blocked.remove(&edge);
                    if self.faults.has(F::R2UnblockFreesBothWays) {
                        let (from, to) = edge;
                        vehicle.blocked.remove(&(to, from));
                    }
                }
            }
            _ => {}
        }
    }

    fn order_transport(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let text = |key: &str| text(arguments, key);
        let action = text("action");
        let here = || vehicle.state.as_ref().map(|state| state.last_node_id.clone());
        // An action alone is performed where the vehicle stands.
        let Some(to) = text("to").or_else(|| here().filter(|_| action.is_some())) else {
            return;
        };
        let transport = Transport {
            from: text("from"),
            to,
            load_type: text("loadType"),
            action,
            parameters: parameters(arguments),
            ..Transport::default()
        };
        vehicle.r1_blind = false;
        let apart = transport.action.is_none() && self.takes(T::R1PickAndDropApart);
        if let Some(from) = transport.from.clone().filter(|_| apart) {
            let pick = Transport {
                from: None,
                to: from,
                action: Some("pick".into()),
                parameters: Value::Null,
                ..transport.clone()
            };
            let drop = Transport {
                from: None,
                action: Some("drop".into()),
                r1_follows: true,
                ..transport
            };
            self.dispatch(vehicle, pick);
            self.dispatch(vehicle, drop);
            return;
        }
        if let Some(halfway) = self.halfway(vehicle, &transport) {
            let first = Transport {
                to: halfway,
                ..transport.clone()
            };
            self.dispatch(vehicle, first);
            let rest = Transport {
                r1_follows: true,
                ..transport
            };
            self.dispatch(vehicle, rest);
            return;
        }
        self.dispatch(vehicle, transport);
        let waits = vehicle.queue.front().is_some_and(|next| next.r1_follows);
        if self.takes(T::R2LatestTransportFirst)
            && !waits
            && let Some(latest) = vehicle.queue.pop_back()
        {
            vehicle.queue.push_front(latest);
        }
    }

    /// `r3-long-ways-in-two-orders`: the node where the first of two orders ends.
    fn halfway(&self, vehicle: &Vehicle, transport: &Transport) -> Option<String> {
        let plain = transport.from.is_none() && transport.action.is_none() && transport.load_type.is_none();
        let idle = vehicle.running.is_none() && vehicle.queue.is_empty();
        if !(plain && idle && self.takes(T::R3LongWaysInTwoOrders)) {
            return None;
        }
        let last = &vehicle.state.as_ref()?.last_node_id;
        let way = self.config.way(last, &transport.to, &vehicle.blocked)?;
        let middle = way.get((way.len() / 2).saturating_sub(1)).filter(|_| way.len() > 2)?;
        Some(middle.to.clone())
    }

    /// The running transport, or the next one, is not wanted any more.
    fn call_off(&mut self, vehicle: &mut Vehicle) {
        if vehicle.running.is_some() {
            if vehicle.queue.front().is_some_and(|next| next.r1_follows) {
                vehicle.queue.pop_front();
            }
            self.cancel(vehicle, None);
        } else if vehicle.queue.pop_front().is_none() && vehicle.cancel.is_none() {
            let foreign = vehicle.state.as_ref().is_some_and(|state| !state.route_empty());
            let now = self.online && self.commandable(vehicle);
            if foreign || (now && self.takes(T::R3CancelSentToIdle)) {
                self.instant(vehicle, "cancelOrder", &Value::Null);
            }
        }
    }

    /// `r4-cancels-after-two-seconds`: calls off what was to be called off a while ago.
    pub(super) fn r4_call_off(&mut self, vehicle: &mut Vehicle) {
        match vehicle.r4_cancel_at.take() {
            Some((due, order)) if due > self.now.moment => {
                vehicle.at(due);
                vehicle.r4_cancel_at = Some((due, order));
            }
            Some((_, order)) if vehicle.running.as_ref().is_some_and(|running| running.id == order) => {
                self.call_off(vehicle);
            }
            _ => {}
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

/// A parameter of a command that is there and not empty.
fn text(arguments: &Value, key: &str) -> Option<String> {
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
