//! Deviations of maps: their roll-out, their use, and the position on a new one (section 6.7).

use std::f64::consts::PI;

use crate::master_control::config::SiteMap;
use crate::master_control::maps::is_duplicate;
use crate::master_control::seen::MapSeen;
use crate::master_control::vehicle::{MapJob, Stage};

use super::prelude::*;

records! {
    fault "map-not-enabled" ["MAP-09"] "Sends orders on maps that are not enabled."
        => uses(|_, _, _| true);
    fault "map-enabled-blindly" ["MAP-09"] "Takes a map for enabled once it has sent enableMap."
        => uses(|vehicle, map_id, _| vehicle.enabling.contains_key(map_id));
    fault "map-on-board-is-enough" ["MAP-09"] "It takes a map for usable that is on board of the vehicle but DISABLED."
        => uses(|vehicle, map_id, _| on_board(vehicle).any(|map| map.map_id == map_id));
    fault "absent-map-used" ["MAP-09"] "It sends an order on a map the vehicle does not have at all."
        => uses(|vehicle, map_id, _| on_board(vehicle).all(|map| map.map_id != map_id));
    fault "map-not-checked-in-updates" ["MAP-09"] "An order update releases nodes on a map that is not enabled any more; only new orders are checked."
        because "The map was enabled when the order began; that an update counts anew is a matter of reading MAP-09."
        => uses(|_, _, running| running.released > 0);
    fault "checks-the-first-map-only" ["MAP-09"] "It checks only the map of the first node before an order that leads over two maps."
        => uses(|_, map_id, running| running.stops.first().is_some_and(|first| first.map_id != map_id));
    fault "map-check-only-at-first-order" ["MAP-09"]
        "It checks the maps of a vehicle before its first order only; if the map is disabled later, it still sends the next order."
        => keep::<bool>().happens(|begun, _, _, event| *begun |= matches!(event, Event::Begun))
            .allows(|begun, _, _, what, usual| usual || (*begun && matches!(what, Permission::UseMap(..))));
    fault "enabled-for-fleet" ["MAP-09"] "Takes a map for enabled on every vehicle once one of them has enabled it."
        => fleet::<BTreeSet<String>>().happens(|enabled, _, vehicle, event| if let Event::State(_) = event { enabled.extend(enabled_maps(vehicle)); }).allows(remembered);
    fault "map-enabled-for-ever" ["MAP-09"] "It takes a map for enabled that a vehicle once reported as ENABLED, also after it reports it as DISABLED."
        => keep::<BTreeSet<String>>().happens(|enabled, _, vehicle, event| if let Event::State(_) = event { enabled.extend(enabled_maps(vehicle)); }).allows(remembered);
    fault "map-remembered-over-reconnect" ["MAP-09"] "It remembers a map as ENABLED over a reconnect of the vehicle and does not look at maps again."
        => keep::<BTreeSet<String>>().happens(|enabled, _, vehicle, event| if let Event::Online(Presence::Away) = event { enabled.extend(enabled_maps(vehicle)); }).allows(remembered);
    fault "enable-map-taken-for-done" ["MAP-09"] "Once enableMap was reported FINISHED it sends orders on that map although the state shows it as disabled."
        => keep::<BTreeSet<String>>().happens(|enabled, _, _, event| if let Event::Enabled(map_id, true) = event { enabled.insert((*map_id).to_owned()); }).allows(remembered);
    fault "order-after-failed-enable-map" ["MAP-09"] "It sends the order although enableMap was reported FAILED."
        => keep::<BTreeSet<String>>().happens(|enabled, _, _, event| if let Event::Enabled(map_id, false) = event { enabled.insert((*map_id).to_owned()); }).allows(remembered);
    fault "map-not-preloaded" ["MAP-10"] "Rolls a map out when an order needs it."
        because "It breaks a recommendation only."
        => plain().asked(|(), _, _, command, _| command != "download-map");
    fault "download-refused-during-order" ["MAP-10"] "It drops the roll-out of a map to a vehicle that drives an order."
        because "It breaks a recommendation only."
        => plain().asked(|(), _, vehicle, command, _| command != "download-map" || vehicle.running.is_none());
    fault "enable-before-download" ["MAP-10"] "It sends enableMap for a map it rolls out before downloadMap."
        because "MAP-10 recommends that a map is on board before it is activated, and obliges nobody."
        => happening(|site, vehicle, event| if let Event::RollOut(map, _) = event { site.map_action(vehicle, "enableMap", &map.map_id, &map.map_version); });
    fault "order-before-the-download-has-ended" ["MAP-10", "MAP-09"]
        "It sends enableMap, and an order on the map, right after downloadMap and does not wait for the end of that."
        because "Only an order on a map that is not on board fails by the ruling of MAP-10, and no test asks for one so early; enableMap leaves a warning."
        => keep::<BTreeSet<String>>().happens(|enabled, site, vehicle, event| if let Event::Looked = event {
            let loading: Vec<MapJob> = vehicle.jobs.iter().filter(|job| is_loading(vehicle, job) && !enabled.contains(&job.action_id)).cloned().collect();
            for job in loading {
                enabled.insert(job.action_id);
                site.map_action(vehicle, "enableMap", &job.map.map_id, &job.map.map_version);
                site.send_instants(vehicle);
            }
        }).allows(|_, _, vehicle, what, usual| {
            usual || matches!(what, Permission::UseMap(map_id, _) if vehicle.jobs.iter().any(|job| job.map.map_id == map_id && is_loading(vehicle, job)))
        });
    fault "map-downloaded-by-the-order" ["ACT-08", "FACT-15"]
        "It sends an order on a map that the vehicle does not have, with downloadMap as an action of its first node."
        => plain().plans(|(), site, vehicle, way, _, fresh| {
            let missing = way.stops.iter().map(|stop| &stop.map_id).find(|map_id| fresh && is_missing(vehicle, map_id));
            let Some(map_id) = missing.cloned() else { return };
            let known = site.config.maps.iter().find(|map| map.map_id == map_id);
            let (version, link) = known.map_or_else(|| ("1".to_owned(), format!("http://127.0.0.1:8090/maps/{map_id}")), |map| (map.map_version.clone(), map.link.clone()));
            let given = json!({ "mapId": map_id, "mapVersion": version, "mapDownloadLink": link });
            let action = site.action(vehicle, "downloadMap", &given);
            way.stops[0].actions.push(action);
        }).allows(|(), _, vehicle, what, usual| usual || matches!(what, Permission::UseMap(map_id, _) if is_missing(vehicle, map_id)));
    tolerance "on-board-map-deleted-first" ["MAP-28"]
        "It deletes a disabled map that is on board already before it has it downloaded again, without waiting for a rejection."
        => happening(|site, vehicle, event| if let Event::RollOut(map, done) = event {
            let same = |seen: &&MapSeen| seen.map_id == map.map_id && seen.map_version == map.map_version;
            let unused = on_board(vehicle).find(same).is_some_and(|seen| seen.map_status == "DISABLED");
            let deletes = unused.then(|| site.map_action(vehicle, "deleteMap", &map.map_id, &map.map_version)).flatten();
            if let Some(action_id) = deletes {
                vehicle.jobs.push(MapJob { map: (*map).clone(), stage: Stage::Delete, action_id });
                **done = true;
            }
        });
    fault "download-link-relative" ["MAP-16"] "mapDownloadLink is a path without protocol and host."
        because "MAP-16 asks for a link; what a link must hold so that the vehicle can follow it is not said."
        => made_of("downloadMap", |_, a| {
            link(a, |link| match link.split_once("://") {
                Some((_, rest)) => rest.find('/').map_or(rest, |at| &rest[at..]).to_owned(),
                None => link.to_owned(),
            });
        });
    fault "download-link-to-disk" ["MAP-16"] "It sends a path on its own disk as mapDownloadLink."
        because "MAP-16 asks for a link; whose disk it points to cannot be seen."
        => made_of("downloadMap", |_, a| link(a, |link| format!("file:///var/maps/{}", link.rsplit('/').next().unwrap_or_default())));
    tolerance "map-hash-left-out" ["MAP-16", "ACT-31"] "It leaves the optional mapHash out of downloadMap."
        => made_of("downloadMap", |_, a| a.keep("actionParameters", |parameter| !parameter.says("key", "mapHash")));
    fault "download-repeated" ["MAP-28"] "Repeats a download that was refused as a duplicate without deleting the map."
        => on_duplicate(|site, vehicle, job| download_again(site, vehicle, job));
    fault "download-repeated-every-ten-seconds" ["MAP-28"]
        "It sends a download that was refused as a duplicate again every ten seconds and never deletes the map."
        => keep::<Vec<(Moment, SiteMap)>>().happens(|again, site, vehicle, event| match event {
            Event::RolledOut(job, false, next, done) if job.stage != Stage::Delete && is_duplicate(vehicle, job) => {
                again.push((site.now.moment + Duration::from_secs(10), job.map.clone()));
                **next = None;
                **done = true;
            }
            Event::Looked => {
                let now = site.now.moment;
                let (due, later): (Vec<_>, Vec<_>) = std::mem::take(again).into_iter().partition(|(at, _)| *at <= now);
                for (_, map) in due {
                    let sent = site.send_download(vehicle, &map);
                    if let Some(action_id) = sent { vehicle.jobs.push(MapJob { map, stage: Stage::Download, action_id }); }
                }
                later.iter().for_each(|(at, _)| vehicle.at(*at));
                *again = later;
            }
            _ => {}
        });
    fault "duplicate-kept-during-order" ["MAP-28"]
        "It repeats a download that was rejected as a duplicate without deleting the map first if the vehicle drives an order."
        => happening(|site, vehicle, event| if let Event::RolledOut(job, false, next, done) = event {
            if job.stage == Stage::Download && vehicle.running.is_some() && is_duplicate(vehicle, job) {
                **next = download_again(site, vehicle, job);
                **done = true;
            }
        });
    fault "download-before-delete" ["MAP-28"] "After a download was rejected as a duplicate it repeats the download first and deletes the map after it."
        => on_duplicate(|site, vehicle, job| {
            let next = download_again(site, vehicle, job);
            site.map_action(vehicle, "deleteMap", &job.map.map_id, &job.map.map_version);
            next
        });
    tolerance "duplicate-left-alone" ["MAP-28"] "It gives a download up that was rejected as a duplicate."
        => on_duplicate(|_, _, _| None);
    fault "duplicate-other-version-deleted" ["MAP-28"]
        "After a download was rejected as a duplicate it deletes another version of that map and then repeats the download."
        => on_duplicate(|site, vehicle, job| {
            let map = job.map.clone();
            let other = on_board(vehicle).find(|seen| seen.map_id == map.map_id && seen.map_version != map.map_version);
            let version = other.map_or_else(|| "latest".to_owned(), |seen| seen.map_version.clone());
            job.stage = Stage::Delete;
            site.map_action(vehicle, "deleteMap", &map.map_id, &version)
        });
    fault "duplicate-deletes-enabled-version" ["MAP-28"]
        "It deletes the enabled version of the map after a duplicate rejection instead of the version that it wants to download again."
        => on_duplicate(|site, vehicle, job| {
            let version = enabled_version(vehicle, &job.map.map_id).unwrap_or_else(|| job.map.map_version.clone());
            job.stage = Stage::Delete;
            site.map_action(vehicle, "deleteMap", &job.map.map_id, &version)
        });
    fault "download-after-failed-delete" ["MAP-28"] "It repeats a rejected download although the deletion of the duplicate was reported FAILED."
        => happening(|site, vehicle, event| if let Event::RolledOut(job, false, next, done) = event && job.stage == Stage::Delete {
            **next = download_again(site, vehicle, job);
            **done = true;
        });
    fault "repeated-download-without-link" ["MAP-16", "ACT-31", "FACT-15"] "The downloadMap that is repeated after a duplicate was deleted has no mapDownloadLink."
        => happening(|site, vehicle, event| if let Event::RolledOut(job, true, next, done) = event && job.stage == Stage::Delete {
            **next = download_again(site, vehicle, job);
            **done = true;
            let again = vehicle.instants.back_mut().and_then(|instant| instant.action.as_object_mut());
            again.into_iter().for_each(|again| again.keep("actionParameters", |parameter| !parameter.says("key", "mapDownloadLink")));
        });
    fault "delete-map-under-running-order" ["IACT-02"] "It sends deleteMap for the old version of a map whilst the vehicle still drives an order on it."
        => happening(|site, vehicle, event| if let Event::RolledOut(job, true, _, _) = event && job.stage != Stage::Delete {
            let map = job.map.clone();
            let version = enabled_version(vehicle, &map.map_id).filter(|version| *version != map.map_version);
            let driven = vehicle.running.as_ref().is_some_and(|running| running.stops.iter().any(|stop| stop.map_id == map.map_id));
            if let Some(version) = version.filter(|_| driven) { site.map_action(vehicle, "deleteMap", &map.map_id, &version); }
        });
    tolerance "enables-after-download" ["MAP-09", "MAP-10"] "It enables a map of which no version is enabled as soon as its download has ended, while no order runs."
        => happening(|site, vehicle, event| if let Event::RolledOut(job, true, _, _) = event && job.stage != Stage::Delete {
            let map = job.map.clone();
            let enabled = vehicle.state.as_ref().is_none_or(|state| state.map_enabled(&map.map_id));
            let free = vehicle.running.is_none() && !vehicle.enabling.contains_key(&map.map_id);
            if !enabled && free && let Some(id) = site.map_action(vehicle, "enableMap", &map.map_id, &map.map_version) { vehicle.enabling.insert(map.map_id, id); }
        });
    tolerance "enables-on-nodes" ["ACT-08", "MAP-36"] "It has maps and sets of zones enabled by an action of an order, where the vehicle offers that and has nothing to do."
        => keep::<BTreeSet<String>>().asked(|_, site, vehicle, command, arguments| {
            let here = node_at_rest(site, vehicle, "enableMap").filter(|_| command == "enable-map");
            let Some(to) = here else { return true };
            let given = json!({ "mapId": arguments["mapId"], "mapVersion": arguments["mapVersion"] });
            site.dispatch(vehicle, Transport { to, action: Some("enableMap".into()), parameters: given, ..Transport::default() });
            false
        }).happens(|asked, site, vehicle, event| if let Event::Looked = event {
            let wanted = vehicle.zone_sets.iter().find(|set| vehicle.zone_set_status(&set.id) == Some("DISABLED"));
            let Some(id) = wanted.map(|set| set.id.clone()).filter(|id| !asked.contains(id)) else { return };
            let Some(to) = node_at_rest(site, vehicle, "enableZoneSet") else { return };
            asked.insert(id.clone());
            let given = json!({ "zoneSetId": id });
            vehicle.queue.push_front(Transport { to, action: Some("enableZoneSet".into()), parameters: given, ..Transport::default() });
        }).allows(|_, _, vehicle, what, usual| {
            let enables = |transport: &Transport| transport.action.as_deref() == Some("enableZoneSet");
            let waits = vehicle.queue.front().is_some_and(enables);
            match what {
                Permission::EnableZones => usual && !waits && !vehicle.running.as_ref().is_some_and(|running| enables(&running.transport)),
                Permission::ZonesReady => usual || waits,
                _ => usual,
            }
        });
    tolerance "preloads-maps" ["MAP-10", "MAP-16"] "It sends downloadMap unasked for each map of the site that the vehicle does not have."
        => looked(|site, vehicle| if site.commandable(vehicle) {
            for map in site.config.maps.clone() {
                let maps = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
                let missing = maps.is_some_and(|maps| maps.iter().all(|seen| seen.map_id != map.map_id));
                if missing && !map.link.is_empty() && vehicle.fetched.insert(map.map_id.clone()) { site.download_map(vehicle, map); }
            }
        });
    tolerance "enables-map-before-each-order" ["MAP-09"] "It sends enableMap for the map of the first node before every order, even if it is enabled."
        => happening(|site, vehicle, event| if let Event::Begins(running) = event {
            let map_id = running.stops[0].map_id.clone();
            // A map has a name and a version.
            let fits = site.most(vehicle, Measure::Parameters, "actions.actionsParameters") >= 2;
            if let Some(version) = enabled_version(vehicle, &map_id).filter(|_| fits) {
                site.map_action(vehicle, "enableMap", &map_id, &version);
                site.send_instants(vehicle);
            }
        });
    fault "no-position-on-new-map" ["MAP-27"] "Does not set the position of a vehicle on a new map."
        => happening(|_, vehicle, event| if let Event::Placing(given, done) = event { **done = given["mapId"] != reported(vehicle); });
    fault "new-map-only-enabled" ["MAP-27"] "It only enables a new map, and sends no initPosition, when a vehicle is to be set to a position on it."
        => happening(|site, vehicle, event| if let Event::Placing(given, done) = event {
            let (map_id, known) = (given["mapId"].as_str().unwrap_or_default().to_owned(), reported(vehicle));
            if map_id != known && !known.is_empty() {
                let seen = on_board(vehicle).find(|seen| seen.map_id == map_id);
                let version = seen.map_or_else(|| "1".to_owned(), |seen| seen.map_version.clone());
                site.map_action(vehicle, "enableMap", &map_id, &version);
                **done = true;
            }
        });
    fault "init-position-on-old-map" ["MAP-27"] "initPosition names the map the vehicle reports already, not the new one that was asked for."
        => happening(|_, vehicle, event| if let Event::Placing(given, _) = event && !reported(vehicle).is_empty() { given["mapId"] = json!(reported(vehicle)); });
    fault "init-position-in-degrees" ["MAP-02"] "theta of initPosition is in degrees."
        => places(|given| scale(given, "theta", 180.0 / PI));
    fault "init-theta-clockwise" ["MAP-01"] "It counts theta of initPosition clockwise."
        => places(|given| scale(given, "theta", -1.0));
}

/// Uses maps then, too.
fn uses(when: fn(&Vehicle, &str, &Running) -> bool) -> Box<dyn Deviation> {
    holding(when).allows(|when, _, vehicle, what, usual| {
        usual || matches!(what, Permission::UseMap(map_id, running) if when(vehicle, map_id, running))
    })
}

fn remembered(enabled: &BTreeSet<String>, _: &Site, _: &Vehicle, what: Permission<'_>, usual: bool) -> bool {
    usual || matches!(what, Permission::UseMap(map_id, _) if enabled.contains(map_id))
}

/// Sets vehicles to another place.
fn places(change: fn(&mut Object)) -> Box<dyn Deviation> {
    holding(change).happens(|change, _, _, event| {
        if let Event::Placing(Value::Object(given), _) = event {
            change(given);
        }
    })
}

type AfterDuplicate = fn(&mut Site, &mut Vehicle, &mut MapJob) -> Option<String>;

/// Does something else when a download was rejected as a duplicate; gives the actionId of the next step.
fn on_duplicate(does: AfterDuplicate) -> Box<dyn Deviation> {
    holding(does).happens(|does, site, vehicle, event| {
        if let Event::RolledOut(job, false, next, done) = event
            && job.stage == Stage::Download
            && is_duplicate(vehicle, job)
        {
            **next = does(site, vehicle, job);
            **done = true;
        }
    })
}

fn download_again(site: &mut Site, vehicle: &mut Vehicle, job: &mut MapJob) -> Option<String> {
    job.stage = Stage::DownloadAgain;
    site.send_download(vehicle, &job.map)
}

/// Whether a download was sent and has not ended.
fn is_loading(vehicle: &Vehicle, job: &MapJob) -> bool {
    let mut instants = vehicle.instants.iter();
    job.stage != Stage::Delete && instants.any(|instant| instant.id() == job.action_id && instant.sent_at.is_some())
}

/// Whether the vehicle says which maps it has, and this is none of them.
fn is_missing(vehicle: &Vehicle, map_id: &str) -> bool {
    let maps = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
    vehicle.config.has("mapActions") && maps.is_some_and(|maps| maps.iter().all(|map| map.map_id != map_id))
}

fn on_board(vehicle: &Vehicle) -> impl Iterator<Item = &MapSeen> {
    vehicle.state.iter().flat_map(|state| &state.maps).flatten()
}

fn enabled_maps(vehicle: &Vehicle) -> impl Iterator<Item = String> {
    on_board(vehicle)
        .filter(|map| map.map_status == "ENABLED")
        .map(|map| map.map_id.clone())
}

/// The version of a map that is enabled.
fn enabled_version(vehicle: &Vehicle, map_id: &str) -> Option<String> {
    let enabled = on_board(vehicle).find(|seen| seen.map_id == map_id && seen.map_status == "ENABLED");
    enabled.map(|seen| seen.map_version.clone())
}

/// The map the vehicle says to be on.
fn reported(vehicle: &Vehicle) -> String {
    let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
    position.map(|position| position.map_id.clone()).unwrap_or_default()
}

fn link(action: &mut Object, written: fn(&str) -> String) {
    action.each("actionParameters", |parameter| {
        if parameter.says("key", "mapDownloadLink") {
            parameter.set("value", written(parameter.text("value")));
        }
    });
}

/// The node of the layout where a vehicle with nothing to do can be given an action.
fn node_at_rest(site: &Site, vehicle: &Vehicle, kind: &str) -> Option<String> {
    let state = vehicle.state.as_ref().filter(|state| state.route_empty())?;
    let rests = vehicle.running.is_none() && vehicle.cancel.is_none() && site.commandable(vehicle);
    let here = site.config.node(&state.last_node_id).map(|node| node.id.clone());
    here.filter(|_| rests && site.offers(vehicle, kind, "NODE"))
}
