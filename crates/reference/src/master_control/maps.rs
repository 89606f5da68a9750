//! Maps: rolled out ahead of their use, deleted before a repeated download, enabled before an order needs them (section
//! 6.7).
//!
//! That maps are on board early is called essential, and so done (the ruling of MAP-10); mapVersion is always given
//! (that of MAP-16).

use serde_json::{Value, json};

use super::Site;
use super::config::SiteMap;
use super::hooks::{Event, Permission};
use super::vehicle::{MapJob, Running, Stage, Vehicle};

/// More roll-outs than this are not under way at a vehicle.
const MAX_JOBS: usize = 20;

impl Site {
    /// Begins to roll a map out.
    pub(crate) fn download_map(&mut self, vehicle: &mut Vehicle, map: SiteMap) {
        let same = |job: &MapJob| (&job.map.map_id, &job.map.map_version) == (&map.map_id, &map.map_version);
        if vehicle.jobs.iter().any(same) || vehicle.jobs.len() >= MAX_JOBS || !vehicle.config.has("mapActions") {
            return;
        }
        let mut done = false;
        self.happens(vehicle, &mut Event::RollOut(&map, &mut done));
        if done {
            return;
        }
        if let Some(action_id) = self.send_download(vehicle, &map) {
            let stage = Stage::Download;
            vehicle.jobs.push(MapJob { map, stage, action_id });
        }
    }

    pub(crate) fn send_download(&mut self, vehicle: &mut Vehicle, map: &SiteMap) -> Option<String> {
        let mut given = json!({
            "mapId": map.map_id,
            "mapVersion": map.map_version,
            "mapDownloadLink": map.link,
        });
        if let Some(hash) = &map.hash {
            given["mapHash"] = json!(hash);
        }
        self.instant(vehicle, "downloadMap", &given)
    }

    /// Enables or deletes a map version.
    pub(crate) fn map_action(
        &mut self,
        vehicle: &mut Vehicle,
        kind: &str,
        map_id: &str,
        version: &str,
    ) -> Option<String> {
        if !vehicle.config.has("mapActions") {
            return None;
        }
        self.instant(vehicle, kind, &json!({ "mapId": map_id, "mapVersion": version }))
    }

    /// Follows the roll-outs. A duplicate is deleted before the download is repeated, once (MAP-28).
    pub(super) fn watch_maps(&mut self, vehicle: &mut Vehicle) {
        for mut job in std::mem::take(&mut vehicle.jobs) {
            let Some(finished) = vehicle.ended(&job.action_id) else {
                vehicle.jobs.push(job);
                continue;
            };
            let mut next = None;
            let mut done = false;
            self.happens(vehicle, &mut Event::RolledOut(&mut job, finished, &mut next, &mut done));
            let map = job.map.clone();
            match (job.stage, finished) {
                _ if done => {}
                (Stage::Download, false) if is_duplicate(vehicle, &job) => {
                    job.stage = Stage::Delete;
                    next = self.map_action(vehicle, "deleteMap", &map.map_id, &map.map_version);
                }
                (Stage::Delete, true) => {
                    job.stage = Stage::DownloadAgain;
                    next = self.send_download(vehicle, &map);
                }
                _ => {}
            }
            if let Some(action_id) = next {
                job.action_id = action_id;
                vehicle.jobs.push(job);
            }
        }
        let enabling: Vec<(String, String)> = vehicle.enabling.clone().into_iter().collect();
        for (map_id, action_id) in enabling {
            if vehicle.state.as_ref().is_some_and(|state| state.map_enabled(&map_id)) {
                vehicle.enabling.remove(&map_id);
            } else if !action_id.is_empty()
                && let Some(finished) = vehicle.ended(&action_id)
            {
                // Not asked again on its own, even if the vehicle says it is done and shows no map.
                self.happens(vehicle, &mut Event::Enabled(&map_id, finished));
                vehicle.enabling.insert(map_id, String::new());
            }
        }
    }

    /// Whether every map of this part of a way can be used; sees to it where not (MAP-09).
    pub(super) fn maps_ready(
        &mut self,
        vehicle: &mut Vehicle,
        running: &Running,
        part: std::ops::Range<usize>,
    ) -> bool {
        if !vehicle.config.has("mapActions") {
            return true;
        }
        let mut ready = true;
        for map_id in running.stops[part].iter().map(|stop| stop.map_id.as_str()) {
            let enabled = vehicle.state.as_ref().is_some_and(|state| state.map_enabled(map_id));
            if enabled {
                vehicle.enabling.remove(map_id);
            }
            if !self.allows(vehicle, Permission::UseMap(map_id, running), enabled) {
                ready = false;
                self.provide(vehicle, map_id);
            }
        }
        ready
    }

    /// Has a map enabled that is on board, or brings it there.
    fn provide(&mut self, vehicle: &mut Vehicle, map_id: &str) {
        let maps = vehicle.state.iter().flat_map(|state| &state.maps).flatten();
        let on_board = maps.filter(|map| map.map_id == map_id);
        let mut versions: Vec<String> = on_board.map(|map| map.map_version.clone()).collect();
        versions.sort();
        let known = self.config.maps.iter().find(|map| map.map_id == map_id).cloned();
        let preferred = known.as_ref().map(|map| map.map_version.clone());
        let preferred = preferred.filter(|version| versions.contains(version));
        match (preferred.or(versions.pop()), known) {
            (Some(version), _) if !vehicle.enabling.contains_key(map_id) => {
                let action = self.map_action(vehicle, "enableMap", map_id, &version);
                vehicle.enabling.insert(map_id.to_owned(), action.unwrap_or_default());
            }
            (None, Some(map)) if !map.link.is_empty() && vehicle.fetched.insert(map.map_id.clone()) => {
                self.download_map(vehicle, map);
            }
            _ => {}
        }
    }

    /// Sets the vehicle to a place: a node, or what is told of it, or where it says to be (MAP-27).
    pub(crate) fn init_position(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let node = arguments.get("nodeId").and_then(Value::as_str);
        let node = node.and_then(|id| self.config.node(id)).cloned();
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.clone());
        let place = |key: &str, node: Option<f64>, reported: Option<f64>| {
            let given = arguments.get(key).and_then(|given| {
                let text = || given.as_str().and_then(|text| text.parse().ok());
                given.as_f64().or_else(text)
            });
            let given = given.filter(|number: &f64| number.is_finite());
            given.or(node).or(reported).unwrap_or(0.0)
        };
        let (of_node, seen) = (node.as_ref(), position.as_ref());
        let x = place("x", of_node.map(|node| node.x), seen.map(|seen| seen.x));
        let y = place("y", of_node.map(|node| node.y), seen.map(|seen| seen.y));
        let theta = place(
            "theta",
            of_node.and_then(|node| node.theta),
            seen.map(|seen| seen.theta),
        );
        let text = |key: &str| arguments.get(key).and_then(Value::as_str);
        let map_id = text("mapId").filter(|id| !id.is_empty());
        let map_id = map_id.or(of_node.map(|node| node.map_id.as_str()));
        let map_id = map_id.or(seen.map(|seen| seen.map_id.as_str())).unwrap_or_default();
        let nearest = || self.config.nearest(x, y, map_id).map(|(node, _)| node.id.as_str());
        let last = text("lastNodeId")
            .or(of_node.map(|node| node.id.as_str()))
            .or_else(nearest);
        let mut given = json!({
            "x": x,
            "y": y,
            "theta": theta.sin().atan2(theta.cos()),
            "mapId": map_id,
            "lastNodeId": last.unwrap_or_default(),
        });
        let mut done = false;
        self.happens(vehicle, &mut Event::Placing(&mut given, &mut done));
        if !done {
            self.instant(vehicle, "initPosition", &given);
        }
    }
}

/// Whether a download failed because the map is on board already.
pub(crate) fn is_duplicate(vehicle: &Vehicle, job: &MapJob) -> bool {
    let Some(state) = &vehicle.state else { return false };
    let mut types = state.errors.iter().map(|error| error.error_type.to_ascii_lowercase());
    types.any(|kind| kind.contains("duplicate")) || state.has_map(&job.map.map_id, &job.map.map_version)
}
