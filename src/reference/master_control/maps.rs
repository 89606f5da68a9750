//! Maps: rolled out ahead of their use, deleted before a repeated download, enabled before an order needs them.

use serde_json::{Value, json};

use super::Site;
use super::config::SiteMap;
use super::faults::FaultName as F;
use super::instant::ended;
use super::tolerances::ToleranceName as T;
use super::vehicle::{MapJob, Stage, Vehicle};

/// More roll-outs than this are not under way at a vehicle.
const MAX_JOBS: usize = 20;

impl Site {
    /// Begins to roll a map out.
    pub(super) fn download_map(&mut self, vehicle: &mut Vehicle, map: SiteMap) {
        let same = |job: &MapJob| (&job.map.map_id, &job.map.map_version) == (&map.map_id, &map.map_version);
        if vehicle.jobs.iter().any(same) || vehicle.jobs.len() >= MAX_JOBS || !self.config.has("mapActions") {
            return;
        }
        if self.faults.has(F::R1EnableBeforeDownload) {
            self.map_action(vehicle, "enableMap", &map.map_id, &map.map_version);
        }
        let seen = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
        let unused = seen.into_iter().flatten().any(|seen| {
            let same = seen.map_id == map.map_id && seen.map_version == map.map_version;
            same && seen.map_status == "DISABLED"
        });
        if unused
            && self.takes(T::R3OnBoardMapDeletedFirst)
            && let Some(action_id) = self.map_action(vehicle, "deleteMap", &map.map_id, &map.map_version)
        {
            let stage = Stage::Delete;
            vehicle.jobs.push(MapJob { map, stage, action_id });
            return;
        }
        if let Some(action_id) = self.send_download(vehicle, &map) {
            let stage = Stage::Download;
            vehicle.jobs.push(MapJob { map, stage, action_id });
        }
    }

    fn send_download(&mut self, vehicle: &mut Vehicle, map: &SiteMap) -> Option<String> {
        let mut link = map.link.as_str();
        if self.faults.has(F::R1DownloadLinkRelative)
            && let Some((_, rest)) = link.split_once("://")
        {
            link = rest.find('/').map_or(rest, |at| &rest[at..]);
        }
        let local = format!("file:///var/maps/{}", link.rsplit('/').next().unwrap_or_default());
        if self.faults.has(F::R2DownloadLinkToDisk) {
            link = &local;
        }
        let mut given = json!({
            "mapId": map.map_id,
            "mapVersion": map.map_version,
            "mapDownloadLink": link,
        });
        if let Some(hash) = map.hash.as_ref().filter(|_| !self.takes(T::R2MapHashLeftOut)) {
            given["mapHash"] = json!(hash);
        }
        self.instant(vehicle, "downloadMap", &given)
    }

    /// Enables or deletes a map version.
    pub(super) fn map_action(
        &mut self,
        vehicle: &mut Vehicle,
        kind: &str,
        map_id: &str,
        version: &str,
    ) -> Option<String> {
        if !self.config.has("mapActions") {
            return None;
        }
        self.instant(vehicle, kind, &json!({ "mapId": map_id, "mapVersion": version }))
    }

    /// Follows the roll-outs. A duplicate is deleted before the download is repeated, once (MAP-28).
    pub(super) fn watch_maps(&mut self, vehicle: &mut Vehicle) {
        for mut job in std::mem::take(&mut vehicle.jobs) {
            let Some(finished) = ended(vehicle, &job.action_id) else {
                vehicle.jobs.push(job);
                continue;
            };
            let next = match (job.stage, finished) {
                (Stage::Download, false) if is_duplicate(vehicle, &job) && self.takes(T::R3DuplicateLeftAlone) => None,
                (Stage::Download, false)
                    if is_duplicate(vehicle, &job)
                        && vehicle.running.is_some()
                        && self.faults.has(F::R3DuplicateKeptDuringOrder) =>
                {
                    job.stage = Stage::DownloadAgain;
                    self.send_download(vehicle, &job.map)
                }
                (Stage::Download, false) if is_duplicate(vehicle, &job) => {
                    if self.faults.has(F::R1DownloadBeforeDelete) {
                        job.stage = Stage::DownloadAgain;
                        let again = self.send_download(vehicle, &job.map);
                        self.map_action(vehicle, "deleteMap", &job.map.map_id, &job.map.map_version);
                        again
                    } else if self.faults.has(F::DownloadRepeated) {
                        job.stage = Stage::DownloadAgain;
                        self.send_download(vehicle, &job.map)
                    } else {
                        job.stage = Stage::Delete;
                        let version = if self.faults.has(F::R1DuplicateOtherVersionDeleted) {
                            other_version(vehicle, &job.map)
                        } else if self.faults.has(F::R5DuplicateDeletesEnabledVersion) {
                            enabled_version(vehicle, &job.map)
                        } else {
                            job.map.map_version.clone()
                        };
                        self.map_action(vehicle, "deleteMap", &job.map.map_id, &version)
                    }
                }
                (Stage::Delete, deleted) if deleted || self.faults.has(F::R4DownloadAfterFailedDelete) => {
                    job.stage = Stage::DownloadAgain;
                    let id = self.send_download(vehicle, &job.map);
                    let again = vehicle
                        .instants
                        .iter_mut()
                        .find(|instant| Some(instant.id()) == id.as_deref());
                    if let Some(again) = again.filter(|_| self.faults.has(F::R1RepeatedDownloadWithoutLink))
                        && let Some(list) = again.action["actionParameters"].as_array_mut()
                    {
                        list.retain(|parameter| parameter["key"] != "mapDownloadLink");
                    }
                    id
                }
                (Stage::Download | Stage::DownloadAgain, true)
                    if vehicle.running.is_some() && self.faults.has(F::R6DeleteMapUnderRunningOrder) =>
                {
                    self.r6_tidy_up(vehicle, &job.map);
                    None
                }
                (Stage::Download | Stage::DownloadAgain, true) if self.takes(T::R2EnablesAfterDownload) => {
                    self.enable_after_download(vehicle, &job.map);
                    None
                }
                _ => None,
            };
            if let Some(action_id) = next {
                job.action_id = action_id;
                vehicle.jobs.push(job);
            }
        }
        let enabling: Vec<(String, String)> = vehicle.enabling.clone().into_iter().collect();
        for (map_id, action_id) in enabling {
            let enabled = vehicle.state.as_ref().is_some_and(|state| state.map_enabled(&map_id));
            if enabled {
                vehicle.enabling.remove(&map_id);
                continue;
            }
            if action_id.is_empty() {
                continue;
            }
            // Not asked again on its own, even if the vehicle says it is done and shows no map.
            if let Some(finished) = ended(vehicle, &action_id) {
                let usable = if finished {
                    F::R1EnableMapTakenForDone
                } else {
                    F::R4OrderAfterFailedEnableMap
                };
                if self.faults.has(usable) {
                    vehicle.r1_enabled.insert(map_id.clone());
                }
                vehicle.enabling.insert(map_id, String::new());
            }
        }
    }

    /// `r2-enables-after-download`: enables a new map of which no version is enabled.
    fn enable_after_download(&mut self, vehicle: &mut Vehicle, map: &SiteMap) {
        let enabled = vehicle
            .state
            .as_ref()
            .is_none_or(|state| state.map_enabled(&map.map_id));
        if !enabled
            && vehicle.running.is_none()
            && !vehicle.enabling.contains_key(&map.map_id)
            && let Some(id) = self.map_action(vehicle, "enableMap", &map.map_id, &map.map_version)
        {
            vehicle.enabling.insert(map.map_id.clone(), id);
        }
    }

    /// Whether every map of a way can be used; sees to it where not (MAP-09).
    pub(super) fn maps_ready<'a>(&mut self, vehicle: &mut Vehicle, maps: impl Iterator<Item = &'a str>) -> bool {
        if self.faults.has(F::MapNotEnabled) || !self.config.has("mapActions") {
            return true;
        }
        if vehicle.r5_maps_checked && self.faults.has(F::R5MapCheckOnlyAtFirstOrder) {
            return true;
        }
        let mut ready = true;
        for map_id in maps {
            let Some(state) = &vehicle.state else { return false };
            let sent = self.faults.has(F::MapEnabledBlindly) && vehicle.enabling.contains_key(map_id);
            if sent {
                continue;
            }
            if state.map_enabled(map_id) {
                vehicle.enabling.remove(map_id);
                continue;
            }
            let absent = !state.maps.iter().flatten().any(|map| map.map_id == map_id);
            if !absent && self.faults.has(F::R3MapOnBoardIsEnough) {
                continue;
            }
            if self.enabled_elsewhere(vehicle, map_id) || vehicle.r6_enabled.contains(map_id) {
                continue;
            }
            if vehicle.r1_enabled.contains(map_id) || (absent && self.faults.has(F::R1AbsentMapUsed)) {
                continue;
            }
            ready = false;
            let on_board = state.maps.iter().flatten().filter(|map| map.map_id == map_id);
            let mut versions: Vec<String> = on_board.map(|map| map.map_version.clone()).collect();
            versions.sort();
            let known = self.config.maps.iter().find(|map| map.map_id == map_id).cloned();
            let preferred = known.as_ref().map(|map| map.map_version.clone());
            let version = preferred
                .filter(|version| versions.contains(version))
                .or(versions.pop());
            match (version, known) {
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
        vehicle.r5_maps_checked |= ready;
        ready
    }

    /// `r1-preloads-maps`: brings the maps of the site on board ahead of their use.
    pub(super) fn preload_maps(&mut self, vehicle: &mut Vehicle) {
        if !self.takes(T::R1PreloadsMaps) || !self.commandable(vehicle) {
            return;
        }
        for map in self.config.maps.clone() {
            let missing = vehicle.state.as_ref().is_some_and(|state| {
                let maps = state.maps.as_ref();
                maps.is_some_and(|maps| maps.iter().all(|seen| seen.map_id != map.map_id))
            });
            if missing && !map.link.is_empty() && vehicle.fetched.insert(map.map_id.clone()) {
                self.download_map(vehicle, map);
            }
        }
    }

    /// Sets the vehicle to a place (MAP-27).
    pub(super) fn init_position(&mut self, vehicle: &mut Vehicle, arguments: &Value) {
        let node = arguments.get("nodeId").and_then(Value::as_str);
        let node = node.and_then(|id| self.config.node(id)).cloned();
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.clone());
        let number = |key: &str, node: Option<f64>, reported: Option<f64>| {
            let given = arguments.get(key).and_then(|value| {
                value
                    .as_f64()
                    .or_else(|| value.as_str().and_then(|text| text.parse().ok()))
            });
            given
                .filter(|number: &f64| number.is_finite())
                .or(node)
                .or(reported)
                .unwrap_or(0.0)
        };
        let x = number(
            "x",
            node.as_ref().map(|node| node.x),
            position.as_ref().map(|seen| seen.x),
        );
        let y = number(
            "y",
            node.as_ref().map(|node| node.y),
            position.as_ref().map(|seen| seen.y),
        );
        let theta = number(
            "theta",
            node.as_ref().and_then(|node| node.theta),
            position.as_ref().map(|seen| seen.theta),
        );
        let map_id = arguments
            .get("mapId")
            .and_then(Value::as_str)
            .filter(|id| !id.is_empty());
        let map_id = map_id
            .map(str::to_owned)
            .or(node.as_ref().map(|node| node.map_id.clone()));
        let reported = position.map(|seen| seen.map_id).unwrap_or_default();
        let map_id = map_id.unwrap_or_else(|| reported.clone());
        if self.faults.has(F::NoPositionOnNewMap) && map_id != reported {
            return;
        }
        if self.faults.has(F::R3NewMapOnlyEnabled) && map_id != reported && !reported.is_empty() {
            let seen = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
            let seen = seen.into_iter().flatten().find(|seen| seen.map_id == map_id);
            let version = seen.map_or_else(|| "1".to_owned(), |seen| seen.map_version.clone());
            self.map_action(vehicle, "enableMap", &map_id, &version);
            return;
        }
        let map_id = if self.faults.has(F::R1InitPositionOnOldMap) && !reported.is_empty() {
            reported
        } else {
            map_id
        };
        let last = arguments.get("lastNodeId").and_then(Value::as_str).map(str::to_owned);
        let nearest = || self.config.nearest(x, y, &map_id).map(|(node, _)| node.id.clone());
        let last = last.or(node.map(|node| node.id)).or_else(nearest).unwrap_or_default();
        let within = theta.sin().atan2(theta.cos());
        let within = if self.faults.has(F::R2InitThetaClockwise) {
            -within
        } else {
            within
        };
        let within = if self.faults.has(F::R1InitPositionInDegrees) {
            within.to_degrees()
        } else {
            within
        };
        let given = json!({ "x": x, "y": y, "theta": within, "mapId": map_id, "lastNodeId": last });
        let before = vehicle.state.as_ref();
        let before = before.map(|state| (state.last_node_id.clone(), state.agv_position.clone()));
        if self.instant(vehicle, "initPosition", &given).is_some() && vehicle.r3_before_init.is_none() {
            vehicle.r3_before_init = before;
        }
    }
}

/// `r1-duplicate-other-version-deleted`: a version of a map that was not meant.
fn other_version(vehicle: &Vehicle, map: &SiteMap) -> String {
    let maps = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
    let mut others = maps
        .into_iter()
        .flatten()
        .filter(|seen| seen.map_id == map.map_id && seen.map_version != map.map_version);
    others
        .next()
        .map_or_else(|| "latest".to_owned(), |seen| seen.map_version.clone())
}

/// `r5-duplicate-deletes-enabled-version`: the version of a map that is enabled, if there is one.
pub(super) fn enabled_version(vehicle: &Vehicle, map: &SiteMap) -> String {
    let maps = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
    let mut maps = maps.into_iter().flatten();
    let enabled = maps.find(|seen| seen.map_id == map.map_id && seen.map_status == "ENABLED");
    enabled.map_or(&map.map_version, |seen| &seen.map_version).clone()
}

/// Whether a download failed because the map is on board already.
fn is_duplicate(vehicle: &Vehicle, job: &MapJob) -> bool {
    let Some(state) = &vehicle.state else { return false };
    let named = state
        .errors
        .iter()
        .any(|error| error.error_type.to_ascii_lowercase().contains("duplicate"));
    named || state.has_map(&job.map.map_id, &job.map.map_version)
}
