//! Deviations of how it reads what vehicles say: what is odd but legal, what is for display only, what is old (sections
//! 6.10, 6.12, 6.13 and 6.15).

use crate::master_control::layout::distance;

use super::prelude::*;

records! {
    fault "empty-last-node-shunned" ["TOPIC-13"] "Serves a vehicle no more that once knew no last node."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, _, heard| nowhere(heard));
    fault "foreign-action-shunned" ["TOPIC-13"] "Serves a vehicle no more that has listed an action nobody sent."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, site, heard| {
            let session = site.session.to_string();
            actions(heard).any(|action| !action["actionId"].as_str().unwrap_or_default().contains(&session))
        });
    fault "nameless-action-shunned" ["TOPIC-13"] "Serves a vehicle no more that has listed an action without its type."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, _, heard| actions(heard).any(|action| action.get("actionType").is_none()));
    fault "pause-shunned" ["TOPIC-13"] "Serves a vehicle no more that was paused for more than one state."
        => shuns(|past, _, _| past.paused > 1);
    fault "non-ascii-shunned" ["TOPIC-13"] "Serves a vehicle no more that has sent a letter beyond ASCII."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, _, heard| !heard.payload.is_ascii());
    fault "exponent-shunned" ["TOPIC-13"] "Serves a vehicle no more that has written a number with an exponent."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, _, heard| has_exponent(heard.payload));
    fault "gap-shunned" ["TOPIC-13"] "Serves a vehicle no more that has left a headerId out."
        => shuns(|past, _, heard| {
            let count = heard.message["headerId"].as_u64().filter(|_| heard.name == "state");
            past.header.zip(count).is_some_and(|(old, new)| new > old + 1)
        });
    fault "empty-payload-shunned" ["TOPIC-13"] "Serves a vehicle no more after a message of no bytes."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, _, heard| heard.payload.is_empty());
    fault "minimal-factsheet-shunned" ["TOPIC-13"] "Serves a vehicle no more whose factsheet has left optional members out."
        => shuns(|_, _, heard| heard.name == "factsheet" && heard.message.pointer("/protocolLimits/maxArrayLens/order.nodes").is_none());
    fault "wrong-type-shunned" ["TOPIC-13"] "Serves a vehicle no more that has written a number as text."
        because "No sentence says within what time a vehicle is served."
        => shuns(|_, _, heard| heard.name == "state" && heard.message["orderUpdateId"].is_string());
    fault "dies-of-null" ["TOPIC-14"] "Ends when a member of a state is null."
        => dies(|heard| {
            let members = heard.message.as_object().filter(|_| heard.name == "state");
            members.is_some_and(|members| members.values().any(Value::is_null))
        });
    fault "dies-of-empty-last-node" ["TOPIC-14"] "Ends when a vehicle knows no last node."
        => dies(nowhere);
    fault "zero-is-a-limit" ["TOPIC-13"] "Takes a limit of 0 in a factsheet for one."
        because "No sentence says within what time a vehicle is served."
        => forbidding(|_, vehicle, what| {
            let zero = vehicle.factsheet.as_ref().is_some_and(|sheet| sheet.has_zeros);
            zero && matches!(what, Permission::Name(_))
        });
    fault "version-of-the-vehicle" ["HDR-04"] "Copies the version of the last state into its own header."
        => keep::<Option<Value>>().hears(|version, _, _, heard| {
            if heard.name == "state" { *version = heard.message.get("version").cloned(); }
            true
        }).sends(|version, _, _, out| {
            if let Some(version) = version { out.message.set("version", version.clone()); }
            true
        });
    fault "drops-states-with-low-header-id" ["MQTT-10", "ORD-UPD-02"]
        "It drops every state whose headerId is not higher than the last one, also after the vehicle has started anew and counts from the beginning."
        because "MQTT-10 describes how wireless links are, and obliges nobody to get over them."
        => keep::<Option<u64>>().hears(|last, _, _, heard| {
            let count = heard.message["headerId"].as_u64().filter(|_| heard.name == "state");
            let low = count.zip(*last).is_some_and(|(new, last)| new <= last);
            if !low { *last = count.or(*last); }
            !low
        });
    fault "lost-state-stops-progress" ["MQTT-10", "ORD-UPD-02"] "It follows the vehicle node by node and sends no further base once the state of one node was lost."
        => keep::<(usize, bool)>().happens(|(reached, skipped), _, vehicle, event| match event {
            Event::State(_) => {
                let state = vehicle.state.as_ref();
                let running = vehicle.running.as_ref().filter(|running| state.is_some_and(|state| state.order_id == running.id));
                if let Some(now) = running.map(|running| running.reached(state)) {
                    *skipped |= now > *reached + 1;
                    *reached = now.max(*reached);
                }
            }
            Event::Begun => (*reached, *skipped) = (0, false),
            _ => {}
        }).allows(|(_, skipped), _, _, what, usual| usual && !(*skipped && matches!(what, Permission::Extend(_))));
    fault "missing-paused-is-paused" ["ORD-UPD-02", "STATE-17"] "Takes a vehicle that does not say whether it is paused for paused."
        because "It breaks a recommendation only."
        => forbidding(|_, vehicle, what| {
            let told = vehicle.state.as_ref().is_some_and(|state| state.paused.is_some());
            !told && matches!(what, Permission::Extend(_))
        });
    fault "visualization-obeyed" ["VIS-03"] "Takes the position of a vehicle from the visualization."
        => keep::<Option<(String, Value)>>().hears(|shown, site, vehicle, heard| {
            match heard.name {
                "state" if vehicle.running.is_none() => {
                    if let Some((node, position)) = shown {
                        heard.message["lastNodeId"] = json!(node);
                        heard.message["agvPosition"] = position.clone();
                    }
                }
                "visualization" => {
                    believe(shown, site, vehicle, heard);
                    vehicle.at(site.now.moment);
                }
                _ => {}
            }
            true
        });
    fault "visualization-aside-means-pause" ["VIS-03"] "It pauses a vehicle that the visualization shows more than a metre from where its state does."
        => keep::<bool>().hears(|before, site, vehicle, heard| {
            let told = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
            if let (Some(shown), Some(told)) = (shown(heard), told) {
                let aside = distance((shown.x, shown.y), (told.x, told.y)) > 1.0;
                if aside && !*before { site.instant(vehicle, "startPause", &Value::Null); }
                *before = aside;
            }
            true
        });
    fault "visualization-holds-dispatch" ["VIS-03"] "It begins no new order while the visualization shows a velocity, whatever the state says."
        => keep::<bool>().hears(|moving, site, vehicle, heard| {
            if heard.name == "visualization" {
                let speed = |key: &str| heard.message.pointer(key).and_then(Value::as_f64).unwrap_or(0.0).abs();
                *moving = speed("/velocity/vx") + speed("/velocity/vy") + speed("/velocity/omega") > 0.0;
                vehicle.at(site.now.moment);
            }
            true
        }).allows(|moving, _, _, what, usual| usual && !(*moving && matches!(what, Permission::Begin)));
    fault "start-from-visualization" ["VIS-03", "ORD-03"]
        "It chooses the start of a new order by the position in the newest visualization message rather than by the state."
        => keep::<Option<Position>>().hears(|seen, _, _, heard| {
            *seen = shown(heard).or(seen.take());
            true
        }).stands(|seen, site, _, pose, _| {
            let near = seen.as_ref().and_then(|seen| site.config.nearest(seen.x, seen.y, &seen.map_id));
            if let Some((node, _)) = near {
                pose.node.clone_from(&node.id);
                pose.position.clone_from(seen);
            }
        });
    fault "temporary-start-from-visualization" ["VIS-03", "ORD-CANCEL-17"]
        "It puts the temporary node at which an order begins between two nodes where the visualization shows the vehicle, not where the state does."
        => keep::<Option<Position>>().hears(|seen, _, _, heard| {
            if heard.name == "visualization" { *seen = shown(heard); }
            true
        }).plans(|seen, site, _, way, _, _| if let Some(seen) = seen && let Some(first) = temporary(site, way) { (first.x, first.y) = (seen.x, seen.y); });
    fault "information-obeyed" ["INFO-02"] "Pauses vehicles that report an information."
        => state_taken(|site, vehicle| {
            let paused = vehicle.instants.iter().any(|instant| instant.kind() == "startPause");
            if informs(vehicle) && !paused { site.instant(vehicle, "startPause", &Value::Null); }
        });
    fault "information-asks-for-state" ["INFO-02"] "It sends a stateRequest when a vehicle begins to give information entries."
        => keep::<bool>().happens(|before, site, vehicle, event| if let Event::State(_) = event {
            if informs(vehicle) && !*before { site.instant(vehicle, "stateRequest", &Value::Null); }
            *before = informs(vehicle);
        });
    fault "information-cancels-order" ["INFO-02"] "It calls the running order off as soon as the state of the vehicle holds any information."
        => looked(|site, vehicle| if informs(vehicle) && vehicle.cancel.is_none() { site.cancel(vehicle, None); });
    fault "battery-trend-cancels-order" ["INFO-02"] "It calls the running order off when the vehicle publishes an information with the infoType batteryTrend."
        => looked(|site, vehicle| {
            let mut told = vehicle.state.iter().flat_map(|state| &state.information).flatten();
            if told.any(|entry| entry["infoType"] == "batteryTrend") && vehicle.cancel.is_none() { site.cancel(vehicle, None); }
        });
    fault "information-holds-base" ["INFO-02", "ORD-UPD-02", "STATE-17"] "It does not extend the base while the state carries information."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Extend(_)) && informs(vehicle));
    fault "information-holds-dispatch" ["INFO-02"] "It begins no new order while the state carries information."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Begin) && informs(vehicle));
    fault "information-blocks-dispatch" ["INFO-02"] "It dispatches no order to a vehicle that reports an information entry of level INFO."
        => forbidding(|_, vehicle, what| {
            let mut told = vehicle.state.iter().flat_map(|state| &state.information).flatten();
            matches!(what, Permission::Begin) && told.any(|entry| entry["infoLevel"] == "INFO")
        });
    fault "localization-obeyed" ["INFO-03"] "Gives no work to vehicles with a low localizationScore."
        => forbidding(|_, vehicle, what| {
            let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
            let wide = position.and_then(|position| position.deviation_range).is_some_and(|range| range > 1.0);
            matches!(what, Permission::Begin | Permission::Extend(_)) && (wide || is_unsure(vehicle))
        });
    fault "low-score-blocks-dispatch" ["INFO-03"] "It dispatches no order to a vehicle whose localizationScore is below one half."
        => forbidding(|_, vehicle, what| matches!(what, Permission::Begin) && is_unsure(vehicle));
    fault "low-score-starts-beside" ["INFO-03"] "It begins an order at a temporary node instead of the node the vehicle stands on when the localizationScore is low."
        => standing(|_, vehicle, pose| if is_unsure(vehicle) { pose.standing = Standing::Between; });
    fault "low-score-relocated" ["INFO-03"] "It sends initPosition to an idle vehicle whose localizationScore is low."
        => keep::<bool>().happens(|before, site, vehicle, event| if let Event::State(_) = event {
            let low = is_unsure(vehicle);
            if low && !*before && vehicle.running.is_none() { site.init_position(vehicle, &Value::Null); }
            *before = low;
        });
    fault "deviation-range-at-start" ["INFO-03"] "It adds the reported deviationRange to the allowedDeviationXY of the first node of an order."
        => planning_new(|_, vehicle, way| {
            let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
            let range = position.and_then(|position| position.deviation_range);
            if let Some(range) = range && let Some(first) = way.stops.first_mut() { first.deviation_xy = Some(first.deviation_xy.unwrap_or(0.0) + range.abs()); }
        });
    fault "first-factsheet-forever" ["FACT-15", "FACT-12", "FACT-13", "OPT-03", "OPT-05"]
        "It goes by the first factsheet it got from a vehicle and ignores every later one."
        => hearing(|_, vehicle, heard| heard.name != "factsheet" || vehicle.factsheet.is_none());
    fault "factsheet-shared-by-fleet" ["OPT-03", "FACT-12", "FACT-15"] "It takes the factsheet heard last from any vehicle for the factsheet of all vehicles."
        => fleet::<Option<Factsheet>>().happens(|last, _, vehicle, event| match event {
            Event::Factsheet => last.clone_from(&vehicle.factsheet),
            Event::Looked if last.is_some() => vehicle.factsheet.clone_from(last),
            _ => {}
        });
    fault "optional-fields-by-the-first-factsheet" ["OPT-03", "FACT-15", "OPT-05"] "It judges all vehicles by the factsheet of the vehicle that came first."
        => fleet::<Option<(String, Factsheet)>>().happens(|first, _, vehicle, event| if let Event::Factsheet = event {
            let serial = &vehicle.config.serial_number;
            match first {
                Some((known, sheet)) if known != serial => vehicle.factsheet = Some(sheet.clone()),
                _ => *first = vehicle.factsheet.clone().map(|sheet| (serial.clone(), sheet)),
            }
        });
    fault "factsheet-published-again" ["TOPIC-15"] "It publishes the first factsheet of a vehicle again on the factsheet topic, retained."
        => keep::<bool>().hears(|published, site, _, heard| {
            if heard.name == "factsheet" && !std::mem::replace(published, true) { site.push(heard.topic.to_owned(), heard.payload.to_vec(), 0, true); }
            true
        });
    tolerance "state-asked-when-quiet" ["ACT-08"] "It sends stateRequest when no state has come for six seconds."
        => keep::<Option<Moment>>().happens(|asked, site, vehicle, event| if let Event::Looked = event && vehicle.state.is_some() && site.commandable(vehicle) {
            let due = vehicle.state_at + Duration::from_secs(6);
            if due > site.now.moment {
                vehicle.at(due);
            } else if *asked != Some(vehicle.state_at) {
                *asked = Some(vehicle.state_at);
                site.instant(vehicle, "stateRequest", &Value::Null);
            }
        });
}

/// What it has heard of a vehicle.
#[derive(Clone, Default)]
struct Past {
    /// headerId of the last state.
    header: Option<u64>,
    /// States in a row that were paused.
    paused: u32,
    /// It is given no work any more.
    shunned: bool,
}

/// Gives a vehicle no work any more that has sent something.
fn shuns(odd: fn(&Past, &Site, &Heard<'_>) -> bool) -> Box<dyn Deviation> {
    each((odd, Past::default()))
        .hears(|(odd, past), site, _, heard| {
            let state = heard.name == "state";
            if state {
                past.paused = if heard.message["paused"] == true {
                    past.paused + 1
                } else {
                    0
                };
            }
            past.shunned |= odd(past, site, heard);
            if state {
                past.header = heard.message["headerId"].as_u64().or(past.header);
            }
            true
        })
        .allows(|(_, past), _, _, what, usual| usual && !(past.shunned && matches!(what, Permission::Begin)))
}

/// Ends because of a message.
fn dies(of: fn(&Heard<'_>) -> bool) -> Box<dyn Deviation> {
    holding(of).hears(|of, site, _, heard| {
        let dies = of(heard);
        if dies {
            site.shut_down();
        }
        !dies
    })
}

fn nowhere(heard: &Heard<'_>) -> bool {
    heard.name == "state" && heard.message["lastNodeId"] == ""
}

fn actions<'a>(heard: &'a Heard<'_>) -> impl Iterator<Item = &'a Value> {
    heard.message["actionStates"]
        .as_array()
        .into_iter()
        .flatten()
        .filter(|_| heard.name == "state")
}

/// Whether a number is written with an exponent.
fn has_exponent(payload: &[u8]) -> bool {
    let exponent = |window: &[u8]| {
        window[0].is_ascii_digit()
            && matches!(window[1], b'e' | b'E')
            && (window[2].is_ascii_digit() || matches!(window[2], b'+' | b'-'))
    };
    let mut quoted = false;
    payload.windows(3).any(|window| {
        quoted ^= window[0] == b'"';
        !quoted && exponent(window)
    })
}

/// Where the visualization shows a vehicle.
fn shown(heard: &Heard<'_>) -> Option<Position> {
    let position = heard
        .message
        .get("agvPosition")
        .filter(|_| heard.name == "visualization")?;
    serde_json::from_value(position.clone()).ok()
}

/// The vehicle is where the visualization shows it, whatever its state says.
fn believe(known: &mut Option<(String, Value)>, site: &Site, vehicle: &mut Vehicle, heard: &Heard<'_>) {
    let (Some(position), Some(state)) = (shown(heard), &mut vehicle.state) else {
        return;
    };
    let Some(running) = &vehicle.running else {
        if let Some((node, _)) = site.config.nearest(position.x, position.y, &position.map_id) {
            *known = Some((node.id.clone(), heard.message["agvPosition"].clone()));
            state.last_node_id.clone_from(&node.id);
            state.agv_position = Some(position);
        }
        return;
    };
    let mut released = running.stops.iter().take(running.released);
    let near = released.rposition(|stop| distance((stop.x, stop.y), (position.x, position.y)) < 0.5);
    if let Some(index) = near {
        let sequence = u32::try_from(2 * index).unwrap_or(u32::MAX);
        state.last_node_sequence_id = state.last_node_sequence_id.max(sequence);
        state
            .node_states
            .retain(|node| node.sequence_id.is_some_and(|id| id > sequence));
    }
}
