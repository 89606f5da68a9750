//! Zones of the floor: made into sets for each vehicle, distributed, enabled before they count, and taken away (section 6.4).
//!
//! A vehicle gets the zones that its factsheet says it can keep, and not more than it takes. Sets with other zones have other
//! ids (ZSET-06), so that two vehicles share one only where they have the same zones.

use serde_json::{Map, Value, json};

use super::Site;
use super::commands::text;
use super::hooks::{Measure, Permission};
use super::vehicle::{Stop, Vehicle};
use tck_base::clock::Moment;
use tck_base::polygon::{Point, Polygon};

/// More sets than this are not remembered.
const MAX_SETS: usize = 200;
/// How far a zone about a node reaches, in metres.
const REACH: f64 = 0.7;

/// Actions about sets of zones.
const ACTIONS: [&str; 3] = ["downloadZoneSet", "enableZoneSet", "deleteZoneSet"];

/// How important a zone is where a vehicle does not take all of them.
const RANKS: [&str; 10] = [
    "BLOCKED",
    "LINE_GUIDED",
    "RELEASE",
    "COORDINATED_REPLANNING",
    "SPEED_LIMIT",
    "ACTION",
    "DIRECTED",
    "BIDIRECTED",
    "PENALTY",
    "PRIORITY",
];

/// A set of zones that a vehicle shall have.
#[derive(Clone, Debug)]
pub(crate) struct WantedSet {
    pub(crate) id: String,
    pub(crate) map_id: String,
    /// Where the vehicle gets it from, if it is not sent.
    pub(crate) link: Option<String>,
    /// When it was sent last, and how often.
    sent_at: Option<Moment>,
    sent: u32,
    /// actionId of its download.
    downloading: Option<String>,
    /// actionId of its enableZoneSet.
    enabling: Option<String>,
    tries: u32,
    /// The vehicle does not take it.
    given_up: bool,
}

impl WantedSet {
    /// actionIds it waits for the end of.
    pub(super) fn awaited(&self) -> impl Iterator<Item = &String> {
        self.downloading.iter().chain(&self.enabling)
    }
}

impl Site {
    /// Gives a vehicle zones about a node of the floor, and has them used.
    pub(super) fn distribute_zones(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let at = text(arguments, "nodeId").or_else(|| self.config.nodes.first().map(|node| node.id.clone()));
        let Some(node) = at.and_then(|id| self.config.node(&id).cloned()) else {
            return;
        };
        let what = text(arguments, "what").unwrap_or_else(|| "release".to_owned());
        let far = self.config.nodes.iter().filter(|other| other.map_id == node.map_id);
        let far = far.map(|other| other.y).fold(f64::NEG_INFINITY, f64::max) + 3.0;
        let zones = drawn(&what, (node.x, node.y), far);
        self.want_zones(vehicle, &node.map_id, &zones);
    }

    /// Takes the zones of a map away from a vehicle: it has an empty set there.
    pub(super) fn withdraw_zones(&mut self, vehicle: &mut Vehicle) {
        let maps: Vec<String> = vehicle.zone_sets.iter().map(|set| set.map_id.clone()).collect();
        for map_id in maps {
            self.want_zones(vehicle, &map_id, &[]);
        }
    }

    /// Has a vehicle fetch a set of zones.
    pub(super) fn download_zones(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let named = |key: &str| text(arguments, key);
        let (Some(id), Some(link)) = (named("zoneSetId"), named("zoneSetDownloadLink")) else {
            return;
        };
        let map = named("mapId").or_else(|| self.config.nodes.first().map(|node| node.map_id.clone()));
        if self.takes_zones(vehicle) {
            self.replace(vehicle, wanted(id, map.unwrap_or_default(), Some(link)));
        }
    }

    /// Whether a vehicle is given zones at all.
    fn takes_zones(&self, vehicle: &Vehicle) -> bool {
        let known = vehicle.factsheet.as_ref().is_some_and(|sheet| !sheet.zones.is_empty());
        vehicle.config.has("zones") && self.allows(vehicle, Permission::GiveZones, known)
    }

    /// Makes a set of these zones for a vehicle, as far as it keeps to them, and wants it to have that.
    fn want_zones(&mut self, vehicle: &mut Vehicle, map_id: &str, zones: &[Value]) {
        if !self.takes_zones(vehicle) {
            return;
        }
        let sheet = vehicle.factsheet.as_ref();
        let mut fitting: Vec<Value> = zones
            .iter()
            .filter_map(|zone| self.fitting_zone(vehicle, zone))
            .collect();
        let rank = |zone: &Value| RANKS.iter().position(|kind| zone["zoneType"] == *kind);
        let limit = sheet.map_or(usize::MAX, |sheet| sheet.limit(&["zoneSet.zones"]));
        let limit = self.measures(vehicle, Measure::Zones, limit);
        if fitting.len() > limit {
            fitting.sort_by_key(rank);
            fitting.truncate(limit);
        }
        let mut content = json!({ "mapId": map_id, "zones": fitting });
        let known = self.zone_sets.iter().find(|set| {
            let same = set["mapId"] == content["mapId"] && set["zones"] == content["zones"];
            self.allows(vehicle, Permission::SameSet(set, &content), same)
        });
        let id = known.and_then(|set| set["zoneSetId"].as_str()).map(str::to_owned);
        let id = id.unwrap_or_else(|| self.next_id(vehicle, "zones"));
        content["zoneSetId"] = json!(id);
        self.zone_sets.retain(|set| set["zoneSetId"] != content["zoneSetId"]);
        if self.zone_sets.len() >= MAX_SETS {
            self.zone_sets.remove(0);
        }
        self.zone_sets.push(content);
        let sends = self.allows(vehicle, Permission::SendZones, true);
        let link = (!sends).then(|| format!("http://127.0.0.1:8090/zones/{id}"));
        self.replace(vehicle, wanted(id, map_id.to_owned(), link));
    }

    /// Wants a vehicle to have a set in the place of the one of its map.
    fn replace(&mut self, vehicle: &mut Vehicle, set: WantedSet) {
        let (same, others): (Vec<_>, Vec<_>) = std::mem::take(&mut vehicle.zone_sets)
            .into_iter()
            .partition(|known| known.map_id == set.map_id);
        vehicle.zone_sets = others;
        let old = same.into_iter().filter(|old| old.id != set.id);
        vehicle.old_zone_sets.extend(old.map(|old| old.id));
        vehicle.old_zone_sets.retain(|old| *old != set.id);
        vehicle.zone_sets.push(set);
        vehicle.at(self.now.moment);
    }

    /// A zone as a vehicle takes it: none of a kind that it does not know, and no action that it does not perform in zones.
    fn fitting_zone(&self, vehicle: &Vehicle, zone: &Value) -> Option<Value> {
        let kind = zone["zoneType"].as_str()?;
        let sheet = vehicle.factsheet.as_ref();
        let known = sheet.is_some_and(|sheet| sheet.zones.iter().any(|known| known == kind));
        if !self.allows(vehicle, Permission::ZoneType, known) {
            return None;
        }
        let mut zone = zone.clone();
        for list in ["entryActions", "duringActions", "exitActions"] {
            if let Some(actions) = zone.get_mut(list).and_then(Value::as_array_mut) {
                actions
                    .retain(|action| self.offers(vehicle, action["actionType"].as_str().unwrap_or_default(), "ZONE"));
            }
        }
        Some(zone)
    }

    /// Sees to it that a vehicle has the sets it shall have, and that they are enabled (ZSET-08).
    pub(super) fn watch_zones(&mut self, vehicle: &mut Vehicle) {
        if !self.takes_zones(vehicle) {
            // It has another factsheet than before, and what waits is nothing to it.
            vehicle.instants.retain(|instant| !ACTIONS.contains(&instant.kind()));
            return;
        }
        if vehicle.zone_sets.is_empty() || !self.commandable(vehicle) {
            return;
        }
        for mut set in std::mem::take(&mut vehicle.zone_sets) {
            let has_old = vehicle
                .old_zone_sets
                .iter()
                .any(|old| vehicle.zone_set_status(old).is_some());
            match vehicle.zone_set_status(&set.id) {
                // Nothing is left to be taken away.
                None if !has_old && self.is_empty_set(&set.id) => continue,
                Some("ENABLED") => set.given_up = false,
                _ if set.given_up => {}
                Some(_) => self.enable_zones(vehicle, &mut set),
                None => self.send_zones(vehicle, &mut set),
            }
            vehicle.zone_sets.push(set);
        }
        self.clear_old_sets(vehicle);
    }

    /// Has an enabled set used; after some failures it is left as it is.
    fn enable_zones(&mut self, vehicle: &mut Vehicle, set: &mut WantedSet) {
        if !self.allows(vehicle, Permission::EnableZones, true) {
            return;
        }
        match &set.enabling {
            Some(action_id) => {
                let action_id = action_id.clone();
                if vehicle.ended(&action_id).is_some() {
                    set.enabling = None;
                    set.given_up = set.tries > self.config.resend_limit;
                    vehicle.at(self.now.moment + self.config.resend_after);
                }
            }
            None => {
                set.tries += 1;
                set.enabling = self.instant(vehicle, "enableZoneSet", &json!({ "zoneSetId": set.id }));
                set.given_up = set.enabling.is_none();
            }
        }
    }

    /// Sends a set that the vehicle does not list, or has it fetched.
    fn send_zones(&mut self, vehicle: &mut Vehicle, set: &mut WantedSet) {
        if let Some(link) = set.link.clone() {
            let ended = set.downloading.clone().map(|action_id| vehicle.ended(&action_id));
            match ended {
                None => {
                    let given = json!({ "zoneSetId": set.id, "zoneSetDownloadLink": link });
                    set.downloading = self.instant(vehicle, "downloadZoneSet", &given);
                    set.given_up = set.downloading.is_none();
                }
                Some(Some(false)) => set.given_up = true,
                Some(_) => {}
            }
            return;
        }
        let now = self.now.moment;
        if let Some(due) = set
            .sent_at
            .map(|at| self.lost_after(vehicle, at))
            .filter(|due| *due > now)
        {
            vehicle.at(due);
            return;
        }
        if set.sent > self.config.resend_limit {
            set.given_up = true;
            return;
        }
        let known = self.zone_sets.iter().find(|known| known["zoneSetId"] == *set.id);
        let Some(content) = known.cloned() else { return };
        // It may have another factsheet than when the set was made.
        let mut zones = content["zones"].as_array().into_iter().flatten();
        if zones.any(|zone| self.fitting_zone(vehicle, zone).is_none()) {
            set.given_up = true;
            return;
        }
        (set.sent, set.sent_at) = (set.sent + 1, Some(now));
        self.publish(vehicle, "zoneSet", &json!({ "zoneSet": content }));
        vehicle.at(self.lost_after(vehicle, now));
    }

    /// Deletes sets that are used no more, each once.
    fn clear_old_sets(&mut self, vehicle: &mut Vehicle) {
        if vehicle
            .zone_sets
            .iter()
            .any(|set| vehicle.zone_set_status(&set.id) != Some("ENABLED"))
        {
            return;
        }
        for id in std::mem::take(&mut vehicle.old_zone_sets) {
            match vehicle.zone_set_status(&id) {
                Some("DISABLED") => {
                    self.instant(vehicle, "deleteZoneSet", &json!({ "zoneSetId": id }));
                }
                Some(_) => vehicle.old_zone_sets.push(id),
                None => {}
            }
        }
    }

    /// Whether the zones of a vehicle are in force, or it does not take them.
    pub(super) fn zones_ready(&self, vehicle: &Vehicle) -> bool {
        let ready = |set: &WantedSet| set.given_up || vehicle.zone_set_status(&set.id) == Some("ENABLED");
        let usual = !self.takes_zones(vehicle) || vehicle.zone_sets.iter().all(ready);
        self.allows(vehicle, Permission::ZonesReady, usual)
    }

    /// The set of an id.
    fn zone_set(&self, id: &str) -> Option<&Value> {
        self.zone_sets.iter().find(|set| set["zoneSetId"] == *id)
    }

    /// Whether a set has no zones.
    fn is_empty_set(&self, id: &str) -> bool {
        self.zone_set(id)
            .is_some_and(|set| set["zones"].as_array().is_some_and(Vec::is_empty))
    }

    /// The map of a set.
    pub(super) fn map_of(&self, set_id: &str) -> Option<&str> {
        self.zone_set(set_id)?["mapId"].as_str()
    }

    /// The type of a zone.
    pub(super) fn zone_type(&self, set_id: &str, zone_id: &str) -> Option<&str> {
        let zones = self.zone_set(set_id)?["zones"].as_array()?;
        let zone = zones.iter().find(|zone| zone["zoneId"] == *zone_id)?;
        zone["zoneType"].as_str()
    }

    /// Whether the vehicle needs a trajectory between two places: the way touches a zone in which it keeps to one (ZONE-09).
    pub(super) fn is_guided(&self, vehicle: &Vehicle, from: &Stop, to: &Stop) -> bool {
        let here = vehicle.zone_sets.iter().filter(|set| set.map_id == from.map_id);
        let zones = here
            .filter_map(|set| self.zone_set(&set.id)?["zones"].as_array())
            .flatten();
        let guided = zones.filter(|zone| zone["zoneType"] == "LINE_GUIDED");
        let mut areas = guided.filter_map(|zone| Polygon::read(&zone["vertices"]).ok());
        let (from, to) = (Point::new(from.x, from.y), Point::new(to.x, to.y));
        areas.any(|area| area.contains(from) || area.contains(to) || !area.meets(from, to).is_empty())
    }
}

impl Vehicle {
    /// zoneSetStatus of a set in its last state.
    pub(crate) fn zone_set_status(&self, id: &str) -> Option<&str> {
        let sets = self.state.as_ref()?.zone_sets.as_deref()?;
        let set = sets.iter().find(|set| set.zone_set_id == id)?;
        Some(&set.zone_set_status)
    }
}

fn wanted(id: String, map_id: String, link: Option<String>) -> WantedSet {
    WantedSet {
        id,
        map_id,
        link,
        sent_at: None,
        sent: 0,
        downloading: None,
        enabling: None,
        tries: 0,
        given_up: false,
    }
}

/// A zone with a rectangle about a place.
fn zone(id: &str, kind: &str, (x, y): (f64, f64), reach: f64, more: &Value) -> Value {
    let corners = [(-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)];
    let vertices: Vec<Value> = corners
        .iter()
        .map(|(dx, dy)| json!({ "x": x + dx, "y": y + dy }))
        .collect();
    let mut zone = Map::new();
    zone.insert("zoneId".into(), json!(id));
    zone.insert("zoneType".into(), json!(kind));
    zone.insert("vertices".into(), json!(vertices));
    zone.extend(more.as_object().cloned().unwrap_or_default());
    Value::Object(zone)
}

/// What a zone of a type says beside its border.
fn members(kind: &str) -> Value {
    match kind {
        "SPEED_LIMIT" => json!({ "maximumSpeed": 0.5 }),
        "ACTION" => {
            let action = json!([{ "actionType": "beep", "blockingType": "NONE" }]);
            json!({ "entryActions": action, "duringActions": [], "exitActions": [] })
        }
        "RELEASE" => json!({ "releaseLossBehavior": "STOP" }),
        "PRIORITY" => json!({ "priorityFactor": 0.5 }),
        "PENALTY" => json!({ "penaltyFactor": 0.5 }),
        "DIRECTED" => json!({ "direction": 0.0, "directedLimitation": "RESTRICTED" }),
        "BIDIRECTED" => json!({ "direction": 0.0, "bidirectedLimitation": "SOFT" }),
        _ => json!({}),
    }
}

/// The zones somebody wants about a place, or beside all ways (`far`).
fn drawn(what: &str, at: (f64, f64), far: f64) -> Vec<Value> {
    let one = |kind: &str, reach: f64| {
        let id = format!("{}-1", kind.to_ascii_lowercase().replace('_', "-"));
        zone(&id, kind, at, reach, &members(kind))
    };
    let row = |kinds: &[&str]| {
        let places = (0_u32..).map(|place| (2.0 * f64::from(place), far));
        let all = kinds.iter().zip(places).zip(1..);
        all.map(|((kind, place), number)| {
            let id = format!("{}-{number}", kind.to_ascii_lowercase().replace('_', "-"));
            zone(&id, kind, place, REACH, &members(kind))
        })
        .collect::<Vec<_>>()
    };
    match what {
        "release-moved" => vec![one("RELEASE", REACH + 0.1)],
        "replanning" => vec![one("COORDINATED_REPLANNING", REACH)],
        "line-guided" => vec![one("LINE_GUIDED", REACH)],
        "every-type" => row(&RANKS),
        "directed" => row(&["DIRECTED", "BIDIRECTED", "DIRECTED"]),
        "many" => row(&["SPEED_LIMIT"; 12]),
        _ => vec![one("RELEASE", REACH)],
    }
}
