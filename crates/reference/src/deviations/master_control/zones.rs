//! Deviations of zones: the sets that are sent, their use, and orders through them (section 6.4).

use super::prelude::*;

records! {
    fault "zones-by-download" ["ZSET-02"] "It has vehicles fetch each set of zones instead of sending it on its topic."
        because "It breaks a recommendation only."
        => forbidding(|_, _, what| matches!(what, Permission::SendZones));
    fault "zone-set-without-map" ["ZSET-04"] "The set does not say which map it is for."
        => set(|set| set.unset("mapId"));
    fault "zone-set-id-as-number" ["ZSET-04"] "zoneSetId is a number."
        => set(|set| set.change("zoneSetId", |id| *id = json!(7)));
    fault "zones-in-an-object" ["ZSET-04"] "The zones of a set stand in an object, by their ids, and not in a list."
        => set(|set| {
            let zones: Object = set.list("zones").iter().map(|zone| (zone["zoneId"].as_str().unwrap_or_default().to_owned(), zone.clone())).collect();
            set.set("zones", zones);
        });
    fault "zone-set-of-a-map-version" ["ZSET-05"] "The set names a mapVersion."
        => set(|set| set.set("mapVersion", "1"));
    fault "zone-set-id-of-the-map" ["ZSET-06"] "It calls every set of a map by the id of the first one, whatever zones it has."
        => allowing(|_, what, usual| match what {
            Permission::SameSet(set, content) => set["mapId"] == content["mapId"],
            _ => usual,
        });
    fault "zone-set-changes-on-its-way" ["ZSET-06"] "A set that is sent once more has other borders under the same id."
        => fleet::<u32>().sends(|count, _, _, outgoing| {
            if outgoing.name == "zoneSet" {
                *count += 1;
                let by = f64::from(*count) / 100.0;
                outgoing.message.part("zoneSet", |set| set.each("zones", |zone| move_by(zone, by)));
            }
            true
        });
    fault "zones-never-enabled" ["ZSET-08"] "It sends sets of zones and orders, and enables no set."
        => allowing(|_, what, usual| match what {
            Permission::EnableZones => false,
            Permission::ZonesReady => true,
            _ => usual,
        });
    fault "orders-before-zones" ["ZSET-08"] "It sends an order while the zones of its map are on their way to the vehicle."
        => letting(|_, _, what| matches!(what, Permission::ZonesReady));
    fault "zone-sets-to-the-first-vehicle" ["TOPIC-04", "HDR-05"] "It publishes sets of zones for any vehicle on the topic of the first vehicle of its fleet."
        => sending(|site, _, out| if out.name == "zoneSet" {
            let first = site.config.vehicles.first().and_then(|first| first.topics.get("zoneSet"));
            first.into_iter().for_each(|topic| out.topic.clone_from(topic));
        });
    fault "zone-ids-repeated" ["ZSET-19"] "All zones of a set have the same id."
        => zone(|zone| zone.set("zoneId", "zone"));
    fault "zone-ids-counted-by-type" ["ZSET-19"] "It numbers the zones of a set from 1 for each type, so that two zones of different types have the same zoneId."
        => fleet::<BTreeMap<String, Vec<(String, String)>>>().sends(|known, _, _, outgoing| {
            outgoing.message.part("zoneSet", |set| {
                let (mut counts, mut names) = (BTreeMap::<String, u32>::new(), Vec::new());
                set.each("zones", |zone| {
                    let count = counts.entry(zone.text("zoneType").to_owned()).or_default();
                    *count += 1;
                    names.push((count.to_string(), zone.text("zoneId").to_owned()));
                    zone.set("zoneId", count.to_string());
                });
                known.insert(set.text("zoneSetId").to_owned(), names);
            });
            true
        }).hears(|known, _, _, heard| {
            // It reads its own numbers back, as those of zones that are asked for.
            if let Some(state) = heard.message.as_object_mut().filter(|_| heard.name == "state") {
                state.each("zoneRequests", |request| {
                    let names = known.get(request.text("zoneSetId")).map(Vec::as_slice).unwrap_or_default();
                    let mut same = names.iter().filter(|(number, _)| number == request.text("zoneId"));
                    let asked = same.clone().find(|(_, name)| name.starts_with("release") || name.starts_with("coordinated"));
                    if let Some((_, name)) = asked.or_else(|| same.next()) { request.set("zoneId", name.as_str()); }
                });
            }
            true
        });
    fault "zone-type-unknown" ["ZSET-19"] "It writes types of zones in small letters."
        => zone(|zone| zone.change("zoneType", |kind| *kind = json!(kind.as_str().unwrap_or_default().to_ascii_lowercase())));
    fault "zone-without-id" ["ZSET-19"] "Zones have no id."
        => zone(|zone| zone.unset("zoneId"));
    fault "speed-limit-without-speed" ["ZSET-20"] "A SPEED_LIMIT zone does not say how fast a vehicle may be."
        => zone(|zone| zone.unset("maximumSpeed"));
    fault "direction-left-out" ["ZSET-20"] "Zones that say where to drive have no direction."
        => zone(|zone| zone.unset("direction"));
    fault "factors-in-percent" ["ZSET-20"] "priorityFactor and penaltyFactor go up to 100."
        => zone(|zone| ["priorityFactor", "penaltyFactor"].into_iter().for_each(|key| scale(zone, key, 100.0)));
    fault "loss-behavior-unknown" ["ZSET-20"] "RELEASE zones name a releaseLossBehavior that there is not."
        => zone(|zone| zone.change("releaseLossBehavior", |behavior| *behavior = json!("HALT")));
    fault "limitation-unknown" ["ZSET-20"] "directedLimitation is NONE."
        => zone(|zone| zone.change("directedLimitation", |limitation| *limitation = json!("NONE")));
    fault "limitation-as-in-the-schema" ["ZSET-20"]
        "It names directedLimitation and bidirectedLimitation of zones limitation, as the schema of 3.0.0 does by mistake."
        => zone(|zone| for key in ["directedLimitation", "bidirectedLimitation"] { zone.rename(key, "limitation") });
    fault "exit-actions-left-out" ["ZSET-20"] "It leaves lists of zone actions out that are empty."
        => zone(|zone| ["duringActions", "exitActions"].into_iter().for_each(|key| if zone.list(key).is_empty() { zone.unset(key) }));
    fault "members-of-all-types" ["ZSET-20"] "Every zone has a maximumSpeed, whatever its type."
        because "The ruling of ZSET-20 has members of other types ignored with a warning."
        => zone(|zone| zone.supply("maximumSpeed", 1.0));
    fault "zone-actions-without-type" ["ZSET-21"] "Actions of zones have no actionType."
        => zone(|zone| zone.each("entryActions", |action| action.unset("actionType")));
    fault "zone-actions-without-blocking" ["ZSET-21"] "Actions of zones have no blockingType."
        => zone(|zone| zone.each("entryActions", |action| action.unset("blockingType")));
    fault "zone-actions-numbered" ["ZSET-21"] "Actions of zones have actionIds."
        because "An actionId of a zone action is a warning by the catalogue."
        => zone(|zone| zone.each("entryActions", |action| action.set("actionId", "zone-action-1")));
    fault "zones-clockwise" ["ZSET-22"] "The corners of its zones go round clockwise."
        => zone(|zone| zone.list("vertices").reverse());
    fault "zones-crossed" ["ZSET-22"] "The borders of its zones cross themselves."
        => zone(|zone| { if let [_, second, third, ..] = zone.list("vertices") { std::mem::swap(second, third); } });
    fault "zones-of-two-corners" ["ZSET-22"] "It describes a zone by two opposite corners."
        => zone(|zone| {
            let corners = zone.list("vertices").iter().step_by(2).take(2).cloned().collect::<Vec<_>>();
            zone.set("vertices", corners);
        });
    fault "zones-closed-twice" ["ZSET-22"] "The last corner of a zone is its first one again."
        because "A repeated closing corner is a warning by the catalogue."
        => zone(|zone| { if let Some(first) = zone.list("vertices").first().cloned() { zone.add("vertices", first); } });
    fault "directed-zones-overlap" ["ZSET-24"] "Zones that say where to drive overlap."
        => zone(|zone| if !zone.text("directedLimitation").is_empty() { move_by(zone, 1.0) });
    fault "unknown-types-of-zones" ["ZSET-25"] "It sends all zones to every vehicle that knows some."
        => letting(|_, _, what| matches!(what, Permission::ZoneType));
    fault "zones-to-everybody" ["ZSET-25"] "It sends zones to vehicles that know none."
        => letting(|_, _, what| matches!(what, Permission::GiveZones | Permission::ZoneType));
    fault "actions-of-zones-not-offered" ["ZSET-25"] "It sends zone actions that the vehicle does not offer in zones."
        => letting(|_, _, what| matches!(what, Permission::Offer(_, "ZONE")));
    fault "too-many-zones" ["ZSET-27"] "It sends as many zones as there are, whatever the vehicle takes."
        => unlimited(|what| matches!(what, Measure::Zones));
    fault "no-trajectory-in-line-guided-zones" ["ZONE-09"] "It sends no trajectory in zones where a vehicle keeps to one."
        => edge(|edge| edge.unset("trajectory"));
    fault "unreachable-node-ignored" ["ZERR-03"] "It does nothing when a vehicle says that it cannot come to a node."
        because "What a master control does about it may not be visible; that nothing is seen is a warning."
        => forbidding(|_, _, what| matches!(what, Permission::GiveUp));
    tolerance "alarm-only-when-a-vehicle-is-stuck" ["ZERR-03", "CORR-23"]
        "After NODE_UNREACHABLE or OUTSIDE_OF_CORRIDOR it shows an alarm and sends nothing for the order until somebody decides."
        => allowing(|vehicle, what, usual| {
            let stuck = vehicle.state.as_ref().is_some_and(|state| state.has_error("NODE_UNREACHABLE") || state.has_error("OUTSIDE_OF_CORRIDOR"));
            usual && !(stuck && matches!(what, Permission::GiveUp | Permission::Extend(_)))
        });
    tolerance "zones-described" ["ZSET-04"] "It describes its sets and zones."
        => zone_set(|m| m.part("zoneSet", |set| {
            set.set("zoneSetDescriptor", "allée");
            set.each("zones", |zone| zone.set("zoneDescriptor", "here"));
        }));
    tolerance "each-set-has-its-own-id" ["ZSET-06"] "It gives each vehicle a set of its own, also where the zones are the same."
        => forbidding(|_, _, what| matches!(what, Permission::SameSet(..)));
    tolerance "has-no-zones" ["TOPIC-17", "ZSET-25"] "It has no zones, and sends nobody any."
        => forbidding(|_, _, what| matches!(what, Permission::GiveZones));
    tolerance "zones-concave-and-touching" ["ZSET-22", "ZSET-24"] "The border of its zones has a notch; zones that say where to drive share a side."
        => zone(|zone| {
            let directed = !(zone.text("directedLimitation").is_empty() && zone.text("bidirectedLimitation").is_empty());
            zone.change("vertices", |corners| if let Some(corners) = corners.as_array_mut() {
                if directed { widen(corners) } else { notch(corners) }
            });
        });
}

/// Changes each set.
fn set(change: fn(&mut Object)) -> Box<dyn Deviation> {
    holding(change).sends(|change, _, _, outgoing| {
        if outgoing.name == "zoneSet" {
            outgoing.message.part("zoneSet", |set| change(set));
        }
        true
    })
}

/// Moves the border of a zone to the left.
fn move_by(zone: &mut Object, metres: f64) {
    zone.each("vertices", |corner| shift(corner, "x", -metres));
}

/// Makes a zone reach a metre to the left and to the right of its middle.
fn widen(corners: &mut [Value]) {
    let x = |corner: &Value| corner["x"].as_f64().unwrap_or_default();
    let least = corners.iter().map(x).fold(f64::INFINITY, f64::min);
    let most = corners.iter().map(x).fold(f64::NEG_INFINITY, f64::max);
    let middle = ((least + most) * 50.0).round() / 100.0;
    for corner in corners {
        let side = if x(corner) < middle { -1.0 } else { 1.0 };
        corner["x"] = json!(middle + side);
    }
}

/// Makes a notch in the upper side of a rectangle.
fn notch(corners: &mut Vec<Value>) {
    let at = |corner: &Value, axis: &str| corner[axis].as_f64().unwrap_or_default();
    if let [first, _, third, fourth] = corners.as_slice() {
        let x = f64::midpoint(at(third, "x"), at(fourth, "x"));
        let y = at(third, "y") - (at(third, "y") - at(first, "y")) / 4.0;
        corners.insert(3, json!({ "x": x, "y": y }));
    }
}
