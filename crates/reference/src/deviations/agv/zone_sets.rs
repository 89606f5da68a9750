//! Deviations of what is done with zone sets (section 6.4.2).

use crate::agv::zone_sets::ZoneSet;

use super::prelude::*;

/// Whether the action names a zone set that is on board.
fn known(agv: &Agv, action: &Action) -> bool {
    agv.zone_sets.get(action.text("zoneSetId")).is_some()
}

records! {
    fault "zone-set-ignored" ["ZSET-01", "ZSET-14"] "Takes no notice of what comes on the topic zoneSet."
        => plain().hears(|_, _, name, _| name != "zoneSet");
    fault "zone-set-not-subscribed" ["TOPIC-16", "ZSET-01"] "Does not subscribe to the topic zoneSet, although it declares zones."
        => joining(|_, options| options.subscriptions.retain(|(topic, _)| !topic.ends_with("/zoneSet")));
    fault "zone-set-enabled-at-once" ["ZSET-07"] "Enables a zone set as soon as it has received it."
        => when(Event::ZoneSetStored, |agv| if let Some(set) = agv.zone_sets.all.last_mut() {
            set.enabled = true;
        });
    fault "first-zone-set-of-a-map-enabled" ["ZSET-07"] "Enables a zone set that it receives when its map has no other one."
        => when(Event::ZoneSetStored, |agv| {
            let last = agv.zone_sets.all.last().map(|set| (set.id.clone(), set.map_id.clone()));
            if let Some((id, map)) = last && !agv.zone_sets.all.iter().any(|set| set.map_id == map && set.id != id) {
                agv.zone_sets.enable(&id);
            }
        });
    fault "downloaded-zone-set-enabled" ["ZSET-07"] "Enables a zone set as soon as it is downloaded."
        => succeeded(Effect::DownloadZoneSet, |agv, action| {
            agv.zone_sets.enable(action.text("zoneSetId"));
        });
    fault "two-zone-sets-enabled" ["ZSET-09", "ZSET-10"] "Leaves the old zone set of a map enabled beside the new one."
        => instead(Effect::EnableZoneSet, |agv, action| {
            let set = agv.zone_sets.all.iter_mut().find(|set| set.id == action.text("zoneSetId"))?;
            set.enabled = true;
            Some(Outcome::Done(None))
        });
    fault "zone-set-enabled-in-two-states" ["ZSET-10"] "Disables the old zone set of a map, says so, and enables the new one only then."
        => instead(Effect::EnableZoneSet, |agv, action| {
            let map = agv.zone_sets.get(action.text("zoneSetId"))?.map_id.clone();
            agv.zone_sets.all.iter_mut().filter(|set| set.map_id == map).for_each(|set| set.enabled = false);
            agv.flush();
            None
        });
    fault "enable-zone-set-without-effect" ["ZSET-10"] "Reports enableZoneSet FINISHED and enables nothing."
        => instead(Effect::EnableZoneSet, |agv, action| known(agv, action).then_some(Outcome::Done(None)));
    fault "enable-zone-set-disables-other-maps" ["ZSET-10"] "Enabling a zone set disables those of all other maps."
        => succeeded(Effect::EnableZoneSet, |agv, action| {
            agv.zone_sets.all.iter_mut().filter(|set| set.id != action.text("zoneSetId")).for_each(|set| set.enabled = false);
        });
    fault "enable-unknown-zone-set-finished" ["ZSET-11"] "Reports enableZoneSet FINISHED for a zone set it does not have."
        => fails_unseen(Effect::EnableZoneSet);
    fault "enable-unknown-zone-set-disables" ["ZSET-11"] "Disables its zone sets before it fails to enable one it does not have."
        => failed(Effect::EnableZoneSet, |agv, _| agv.zone_sets.all.iter_mut().for_each(|set| set.enabled = false));
    fault "enable-zone-set-said-to-fail" ["ZSET-10"] "Enables a zone set, and reports enableZoneSet FAILED."
        => after(Effect::EnableZoneSet, |_, action, outcome| match outcome {
            Outcome::Done(_) => Outcome::Failed(Problem::zone_set(action, "nobody knows why")),
            other => other,
        });
    fault "enable-zone-set-twice-fails" ["ACT-11"] "Reports enableZoneSet FAILED when the zone set is enabled already."
        => instead(Effect::EnableZoneSet, |agv, action| {
            let enabled = agv.zone_sets.get(action.text("zoneSetId")).is_some_and(|set| set.enabled);
            enabled.then(|| Outcome::Failed(Problem::zone_set(action, "the zone set is enabled already")))
        });
    fault "enable-zone-set-twice-toggles" ["ACT-11"] "Disables a zone set that is to be enabled and is so already."
        => instead(Effect::EnableZoneSet, |agv, action| {
            let set = agv.zone_sets.all.iter_mut().find(|set| set.id == action.text("zoneSetId") && set.enabled)?;
            set.enabled = false;
            Some(Outcome::Done(None))
        });
    fault "duplicate-zone-set-taken" ["ZSET-13"] "Takes a zone set over although it has one of that id, and says nothing."
        => letting(|_, what| matches!(what, Permission::TakeZoneSetAgain));
    fault "duplicate-zone-set-silent" ["ZSET-13"] "Refuses a zone set of an id that it has, and reports no error."
        => raising(|agv, _, error| error.error_type != agv.config.errors.duplicate_zone_set);
    fault "duplicate-zone-set-validation-failure" ["ZSET-13"] "Reports a zone set of an id that it has as malformed."
        => raising(|agv, cause, error| {
            if matches!(cause, Cause::ZoneSet) && error.error_type == agv.config.errors.duplicate_zone_set {
                error.error_type.clone_from(&agv.config.errors.validation);
            }
            true
        });
    fault "duplicate-zone-set-unnamed" ["ZSET-13"] "Does not say which zone set it has already."
        => raising(|agv, _, error| {
            if error.error_type == agv.config.errors.duplicate_zone_set {
                error.references.clear();
            }
            true
        });
    fault "duplicate-zone-set-downloaded" ["ZSET-13"] "Reports downloadZoneSet FINISHED for a zone set it has, and leaves that as it is."
        => fails_unseen(Effect::DownloadZoneSet);
    fault "duplicate-zone-set-deleted" ["ZSET-13"] "Deletes the zone set it has when another one of its id comes."
        => raising(|agv, cause, error| {
            if matches!(cause, Cause::ZoneSet) && error.error_type == agv.config.errors.duplicate_zone_set {
                let named: Vec<String> = error.references.iter().map(|(_, value)| value.clone()).collect();
                agv.zone_sets.all.retain(|set| !named.contains(&set.id));
            }
            true
        });
    fault "zone-sets-not-listed" ["ZSET-14", "ZSET-01"] "Never lists its zone sets."
        => state(|_, words| words.change("zoneSets", |sets| *sets = json!([])));
    fault "zone-sets-listed-when-enabled" ["ZSET-14", "ZSET-07", "ZSET-17"] "Lists only zone sets that are enabled."
        => state(|_, words| words.change("zoneSets", |sets| if let Value::Array(sets) = sets {
            sets.retain(|set| set["zoneSetStatus"] == "ENABLED");
        }));
    fault "zone-set-without-map" ["ZSET-14"] "Lists zone sets without their mapId."
        => state(|_, words| words.change("zoneSets", |sets| if let Value::Array(sets) = sets {
            sets.iter_mut().filter_map(Value::as_object_mut).for_each(|set| { set.remove("mapId"); });
        }));
    fault "deleted-zone-set-listed" ["ZSET-15"] "Reports deleteZoneSet FINISHED and keeps the zone set."
        => instead(Effect::DeleteZoneSet, |agv, action| known(agv, action).then_some(Outcome::Done(None)));
    fault "delete-zone-set-said-to-fail" ["ZSET-15"] "Deletes a zone set, and reports deleteZoneSet FAILED."
        => after(Effect::DeleteZoneSet, |_, action, outcome| match outcome {
            Outcome::Done(_) => Outcome::Failed(Problem::zone_set(action, "nobody knows why")),
            other => other,
        });
    fault "delete-takes-all-zone-sets" ["ZSET-15", "ZSET-03"] "Deletes every zone set of a map when one is to be deleted."
        => instead(Effect::DeleteZoneSet, |agv, action| {
            let map = agv.zone_sets.get(action.text("zoneSetId"))?.map_id.clone();
            agv.zone_sets.all.retain(|set| set.map_id != map);
            Some(Outcome::Done(None))
        });
    fault "used-zone-set-deleted" ["ZSET-16"] "Deletes the enabled zone set of the map it drives on."
        => forbidding(|_, what| matches!(what, Permission::KeepZoneSet));
    fault "used-zone-set-deletion-finished" ["ZSET-16"] "Reports deleteZoneSet FINISHED for the zone set in use, and keeps it."
        => after(Effect::DeleteZoneSet, |_, _, outcome| match outcome {
            Outcome::Failed(problem) if problem.reason == "the zone set is in use" => Outcome::Done(None),
            other => other,
        });
    fault "delete-unknown-zone-set-finished" ["ZSET-16"] "Reports deleteZoneSet FINISHED for a zone set it does not have." because "The action is marked idempotent; the ruling of ZSET-16 is a warning."
        => after(Effect::DeleteZoneSet, |_, _, outcome| match outcome {
            Outcome::Failed(problem) if problem.reason == "the zone set is not on board" => Outcome::Done(None),
            other => other,
        });
    fault "zone-sets-forgotten-with-the-order" ["ZSET-03"] "Forgets its zone sets when it takes over a new order."
        => when(Event::Begun, |agv| agv.zone_sets.all.clear());
    fault "zone-set-enabled-by-itself" ["ZSET-03"] "Enables the zone set that came last when it takes over a new order."
        => when(Event::Begun, |agv| {
            let last = agv.zone_sets.all.last().map(|set| set.id.clone());
            last.map(|id| agv.zone_sets.enable(&id));
        });

    fault "zone-set-not-fetched" ["ZSET-17"] "Reports downloadZoneSet FINISHED without asking the server for anything."
        => instead(Effect::DownloadZoneSet, |agv, action| {
            let map_id = agv.motion.pose(agv.moment()).map_id;
            let id = action.text("zoneSetId").to_owned();
            if !known(agv, action) {
                agv.zone_sets.all.push(ZoneSet { id, map_id, enabled: false, zones: Vec::new() });
            }
            Some(Outcome::Done(None))
        });
    fault "downloaded-zone-set-not-listed" ["ZSET-17", "ZSET-14"] "Reports downloadZoneSet FINISHED and has no zone set."
        => succeeded(Effect::DownloadZoneSet, |agv, action| agv.zone_sets.all.retain(|set| set.id != action.text("zoneSetId")));
    fault "zone-set-download-finished-at-once" ["ZSET-17"] "Reports downloadZoneSet FINISHED before the file is there."
        => action(|_, action, words| {
            if is(action, Effect::DownloadZoneSet) && !action.status.is_terminal() {
                words.set("actionStatus", "FINISHED");
            }
            true
        });
    fault "failed-zone-set-download-finished" ["ZSET-18"] "Reports downloadZoneSet FINISHED when the transfer has failed."
        => fails_unseen(Effect::DownloadZoneSet);
    fault "failed-zone-set-download-silent" ["ZSET-18"] "Reports a downloadZoneSet that has failed, and no error." because "The ruling of ZSET-18 makes a missing error a warning."
        => failure(|_, action, _| !is(action, Effect::DownloadZoneSet));
    fault "failed-zone-set-download-leaves-entry" ["ZSET-18"] "Lists an empty zone set when the transfer has failed."
        => failed(Effect::DownloadZoneSet, |agv, action| {
            let map_id = agv.motion.pose(agv.moment()).map_id;
            let id = action.text("zoneSetId").to_owned();
            if !known(agv, action) {
                agv.zone_sets.all.push(ZoneSet { id, map_id, enabled: false, zones: Vec::new() });
            }
        });
    fault "zone-set-hash-ignored" ["ZSET-18"] "Takes a zone set over whose file does not have the announced hash."
        => forbidding(|_, what| matches!(what, Permission::CheckHash));

    fault "bad-zone-silent" ["ZSET-23"] "Takes a zone set over with a zone of two corners, and says nothing." because "The ruling of ZSET-23 is a warning."
        => holding(()).hears(|_, agv, name, payload| {
            let Some(mut message) = (name == "zoneSet").then(|| serde_json::from_slice::<Value>(payload).ok()).flatten() else {
                return true;
            };
            let zones = message.pointer_mut("/zoneSet/zones").and_then(Value::as_array_mut);
            let Some(zones) = zones.filter(|zones| zones.iter().any(is_bad)) else {
                return true;
            };
            zones.retain(|zone| !is_bad(zone));
            agv.zone_set_received(message.to_string().as_bytes());
            false
        });
    fault "undeclared-zone-silent" ["ZSET-26"] "Takes a zone set over with a kind of zone that it does not declare, and says nothing." because "It breaks a recommendation only."
        => letting(|_, what| matches!(what, Permission::TakeZoneUnheeded));
    fault "unknown-zone-type-declared" ["ZONE-01"] "Declares a kind of zone that there is not."
        => factsheet(|_, words| words.change("typeSpecification", |kind| kind["supportedZones"] = json!(["BLOCKED", "SLOW"])));
}

/// Whether a zone of a message has not enough corners.
fn is_bad(zone: &Value) -> bool {
    zone["vertices"].as_array().is_none_or(|corners| corners.len() < 3)
}
