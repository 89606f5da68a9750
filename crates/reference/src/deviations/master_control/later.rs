//! Deviations of what only later versions ask of a master control: sleep, triggers, retries, lists that are cleared, orders that
//! begin with update 0, certificates.

use crate::master_control::seen::ActionState;

use super::prelude::*;

records! {
    fault "new-order-counts-from-one" ["ORD-UPD-14"] "Its orders begin with orderUpdateId 1."
        => planned(|_, _, running| running.update_id = 1);
    fault "new-order-counts-on" ["ORD-UPD-14"] "orderUpdateId counts on over all orders of a vehicle instead of beginning with 0."
        => keep::<u32>().happens(|count, _, _, event| match event {
            Event::Planned(running) => running.update_id = *count,
            Event::Ended(running, _) => *count = running.update_id + 1,
            _ => {}
        });
    fault "first-node-not-released" ["ORD-14", "ORD-09"] "The first node of a new order is not released."
        => new_order(|m| m.each("nodes", |node| if node.says("sequenceId", 0) { node.set("released", false); }));
    fault "cancel-names-another-order" ["ORD-CANCEL-23"] "The orderId that cancelOrder names has a letter too many."
        because "The ruling of ORD-CANCEL-23 makes an orderId that the vehicle does not report a warning."
        => naming_in("cancelOrder", "orderId", |id| json!(format!("{}x", id.as_str().unwrap_or_default())));
    fault "instant-action-blocks-all" ["IACT-08"] "Its instant actions have the blockingType HARD."
        => action_of("instantActions", |a| a.set("blockingType", "HARD"));
    fault "instant-action-blocks-softly" ["IACT-08"] "cancelOrder has the blockingType SOFT."
        => typed("cancelOrder", |a| a.set("blockingType", "SOFT"));
    fault "retriable-as-text" ["ORD-MSG-35"] "Says retriable of actions as a text."
        => action(|a| a.change("retriable", |retriable| *retriable = json!(retriable.to_string())));
    fault "turned-before-every-edge" ["ORD-MSG-34", "OPT-03"] "It has every vehicle turn to its orientation before each edge."
        => edge(|e| e.set("reachOrientationBeforeEntering", true));
    fault "turned-to-the-map-before-every-edge" ["ORD-MSG-34"]
        "It sends orientationType GLOBAL with reachOrientationBeforeEntering on every edge, also to a DIFFERENTIAL vehicle that does not list them."
        => edge(|e| {
            e.set("orientation", 0.0);
            e.set("orientationType", "GLOBAL");
            e.set("reachOrientationBeforeEntering", true);
        });
    fault "orientation-always-global" ["ORD-MSG-34"] "Edges have an orientation on the map for every kind of vehicle."
        => edge(|e| {
            e.set("orientation", 0.0);
            e.set("orientationType", "GLOBAL");
        });
    fault "ellipse-lies-across" ["ORD-MSG-09"] "The half axis a of allowedDeviationXY is less than b."
        because "The ruling of ORD-MSG-09 makes an a that is less than b a warning."
        => position(|p| p.change("allowedDeviationXY", |allowed| if let Some(radius) = allowed.as_f64() {
            *allowed = json!({ "a": radius, "b": radius * 2.0, "theta": 0.0 });
        }));
    fault "ellipse-without-direction" ["ORD-MSG-09"] "allowedDeviationXY has half axes and no theta."
        => elliptic(json!({ "a": 0.4, "b": 0.2 }));
    fault "ellipse-in-degrees" ["ORD-MSG-09"] "The theta of allowedDeviationXY is in degrees."
        because "The document gives no range for it; the ruling of ORD-MSG-09 makes what the schema excludes a warning."
        => elliptic(json!({ "a": 0.4, "b": 0.2, "theta": 90.0 }));
    fault "deviation-as-plain-number" ["ORD-MSG-09"] "allowedDeviationXY is a number, as in 2.x, and no ellipse."
        => writing("order", |text| {
            let Ok(mut message) = serde_json::from_slice::<Value>(text) else { return };
            let nodes = message["nodes"].as_array_mut().into_iter().flatten();
            let positions = nodes.filter_map(|node| node.get_mut("nodePosition")?.as_object_mut());
            positions.for_each(|place| place.change("allowedDeviationXY", |allowed| if let Some(radius) = allowed.get("a").cloned() { *allowed = radius; }));
            *text = message.to_string().into_bytes();
        });
    fault "orders-to-the-sleeping" ["HIB-13"] "It sends orders to a vehicle that sleeps."
        => letting(|_, vehicle, what| asleep(vehicle) && matches!(what, Permission::Reach));
    fault "actions-to-the-sleeping" ["HIB-13"] "It sends instant actions to a vehicle that sleeps, as to one that is awake."
        => letting(|_, vehicle, what| asleep(vehicle) && matches!(what, Permission::Tell(_)));
    fault "sleep-taken-for-a-fault" ["HIB-14", "HIB-13"] "It calls off what a vehicle has to do when that sleeps and is silent."
        => keep::<bool>().happens(|done, site, vehicle, event| if let Event::Looked = event {
            if asleep(vehicle) && !std::mem::replace(done, true) {
                site.instant_all_the_same(vehicle, "cancelOrder", &Value::Null);
            }
            *done &= asleep(vehicle);
        }).allows(|_, _, vehicle, what, usual| usual || asleep(vehicle) && matches!(what, Permission::Tell("cancelOrder")));
    fault "sleep-taken-for-a-fault-after-a-minute" ["HIB-14", "HIB-13"]
        "When a vehicle that sleeps has sent no state for a minute it sends cancelOrder and stateRequest, and again every ten seconds."
        => keep::<Option<Moment>>().happens(|due, site, vehicle, event| match event {
            Event::State(_) => *due = None,
            Event::Looked if !asleep(vehicle) => *due = None,
            Event::Looked => {
                let now = site.now.moment;
                let at = *due.get_or_insert(vehicle.state_at + Duration::from_secs(60));
                if at <= now {
                    let actions = ["cancelOrder", "stateRequest"].map(|kind| site.made_action(vehicle, kind, &Value::Null, true));
                    site.publish(vehicle, "instantActions", &json!({ "actions": actions }));
                    *due = Some(now + Duration::from_secs(10));
                }
                due.iter().for_each(|at| vehicle.at(*at));
            }
            _ => {}
        });
    fault "shuts-down-the-sleeping" ["SHUT-03", "HIB-13"] "It sends shutdown to a vehicle that sleeps without waking it."
        => allowing(|vehicle, what, usual| match what {
            Permission::Tell("shutdown") if asleep(vehicle) => true,
            Permission::Wake if vehicle.instants.iter().any(|instant| instant.kind() == "shutdown") => false,
            _ => usual,
        });
    fault "lists-never-cleared" ["IACT-STATE-07"] "It never has the list of instant actions cleared."
        because "IACT-STATE-07 is a recommendation."
        => forbidding(|_, _, what| matches!(what, Permission::Clear("clearInstantActions")));
    fault "zone-lists-never-cleared" ["ZACT-STATE-08"] "It never has the list of actions in zones cleared."
        because "ZACT-STATE-08 is a recommendation."
        => forbidding(|_, _, what| matches!(what, Permission::Clear("clearZoneActions")));
    fault "position-under-its-old-name" ["ACT-08", "FACT-15"] "It calls initializePosition by the name of earlier versions, initPosition."
        => writing("instantActions", |text| {
            let old = String::from_utf8_lossy(text).replace("initializePosition", "initPosition");
            *text = old.into_bytes();
        });
    fault "certificate-over-http" ["CERT-05"] "The links of updateCertificate are without TLS."
        => parameter(|kind, p| if kind == "updateCertificate" {
            p.change("value", |link| *link = json!(link.as_str().unwrap_or_default().replace("https:", "http:")));
        });
    fault "certificate-for-its-own-service" ["CERT-05"] "updateCertificate names the service of the broker connection BROKER."
        => parameter(|kind, p| if kind == "updateCertificate" && p.says("key", "service") { p.set("value", "BROKER"); });
    fault "certificate-without-key" ["CERT-05", "ACT-31", "FACT-15"] "updateCertificate comes without keyDownloadLink."
        => typed("updateCertificate", |a| a.keep("actionParameters", |parameter| !parameter.says("key", "keyDownloadLink")));
    fault "retry-names-no-action" ["RETRY-08", "ACT-31", "FACT-15"] "retry and skipRetry name no action."
        => action(|a| if matches!(a.text("actionType"), "retry" | "skipRetry") { a.unset("actionParameters"); });
    fault "retry-names-itself" ["RETRY-08"] "retry names its own actionId."
        => typed("retry", |a| {
            let own = a["actionId"].clone();
            a.each("actionParameters", |parameter| parameter.set("value", own.clone()));
        });
    fault "skip-names-another-action" ["RETRY-08"] "skipRetry names an action that there is not."
        => typed("skipRetry", |a| a.each("actionParameters", |parameter| parameter.set("value", "action-0")));
    fault "retry-of-what-has-failed-for-good" ["RETRY-08"] "It sends retry for an action that is FAILED and cannot be tried again."
        => keep::<BTreeSet<String>>().happens(|tried, site, vehicle, event| if let Event::State(_) = event {
            let Some((state, running)) = vehicle.state.as_ref().zip(vehicle.running.as_ref()) else { return };
            let failed = |id: &&str| state.action(id).is_some_and(|action| action.action_status == "FAILED");
            let failed: Vec<String> = running.action_ids().filter(failed).map(str::to_owned).collect();
            for id in failed {
                if tried.insert(id.clone()) { site.instant(vehicle, "retry", &json!({ "actionId": id })); }
            }
        });
    fault "fleet-trigger-called-host" ["TRIG-03", "ACT-31"] "It calls its own trigger HOST, and writes that as a text and not as a list."
        => parameter_of("triggerType", |p| p.change("value", |value| {
            if value.as_array().is_some_and(|types| types.contains(&json!("FLEET_CONTROL"))) { *value = json!("HOST"); }
        }));
    fault "trigger-type-as-text" ["ACT-31", "BP-05", "FACT-15"] "triggerType is a text and not a list of texts."
        => parameter_of("triggerType", |p| p.change("value", |value| if let Some(first) = value.get(0).cloned() { *value = first; }));
    fault "trigger-type-in-its-own-words" ["TRIG-03"] "It calls its own trigger FLEET and that at the vehicle BUTTON."
        => parameter_of("triggerType", |p| p.change("value", |value| for name in value.as_array_mut().into_iter().flatten() {
            match name.as_str() {
                Some("FLEET_CONTROL") => *name = json!("FLEET"),
                Some("LOCAL") => *name = json!("BUTTON"),
                _ => {}
            }
        }));
    fault "trigger-never-given" ["TRIG-04"] "It does not send trigger when the process is done that was awaited."
        => asked("give-trigger", |_, _, _| false);
    fault "trigger-with-the-order" ["TRIG-04"]
        "It sends trigger once, directly after an order with a waitForTrigger, and not when the process is done that was awaited."
        => plain().happens(|(), site, vehicle, event| if let Event::Begun = event {
            let stops = vehicle.running.iter().flat_map(|running| &running.stops);
            let waits = stops.flat_map(|stop| &stop.actions).any(|action| action["actionType"] == "waitForTrigger");
            if waits { site.instant(vehicle, "trigger", &Value::Null); }
        }).asked(|(), _, _, command, _| command != "give-trigger");
    fault "trigger-by-the-order-topic" ["TRIG-04"] "It ends the wait for a trigger by calling the order off."
        => asked("give-trigger", |site, vehicle, _| {
            site.call_off(vehicle);
            false
        });
    fault "commands-a-vehicle-in-someones-hands" ["MODE-11"] "It sends instant actions to a vehicle in INTERVENED."
        => letting(|_, vehicle, what| mode(vehicle) == "INTERVENED" && matches!(what, Permission::Tell(_)));
    fault "pauses-a-vehicle-in-someones-hands" ["MODE-11"] "It sends startPause as soon as a vehicle reports INTERVENED, and stopPause when it is back."
        => happening(|site, vehicle, event| if let Event::State(Some(before)) = event {
            let (was, is) = (before.operating_mode == "INTERVENED", mode(vehicle) == "INTERVENED");
            let kind = if is { "startPause" } else { "stopPause" };
            if was != is && site.reachable(vehicle) && site.offers(vehicle, kind, "INSTANT") {
                let action = site.made_action(vehicle, kind, &Value::Null, true);
                site.publish(vehicle, "instantActions", &json!({ "actions": [action] }));
            }
        });
    tolerance "orders-in-someones-hands" ["MODE-11", "MODE-04"] "It sends orders, updates and cancelOrder, and no other instant action, to a vehicle in INTERVENED."
        => allowing(|vehicle, what, usual| match what {
            Permission::Command => usual || mode(vehicle) == "INTERVENED",
            Permission::Tell(kind) if mode(vehicle) == "INTERVENED" => usual && kind == "cancelOrder",
            _ => usual,
        });
    fault "startup-ignored" ["MODE-04"] "It takes STARTUP for AUTOMATIC."
        => letting(|_, vehicle, what| mode(vehicle) == "STARTUP" && matches!(what, Permission::Command));
    fault "critical-charge-ignored" ["FACT-17"] "It begins a transport however low the battery is."
        because "FACT-17 is a recommendation."
        => forbidding(|_, _, what| matches!(what, Permission::Starve));
    tolerance "lists-cleared-late" ["IACT-STATE-07"] "It has the list of instant actions cleared only when the vehicle has nothing to do."
        => forbidding(|_, vehicle, what| vehicle.running.is_some() && matches!(what, Permission::Clear(_)));
    tolerance "lists-cleared-on-nodes" ["ACT-08", "IACT-STATE-07", "ZACT-STATE-08"]
        "It has the lists of actions cleared by actions on the first node of the next order, where the vehicle offers that."
        => plain().allows(|(), site, vehicle, what, usual| match what {
            Permission::Clear(kind) => usual && !site.offers(vehicle, kind, "NODE"),
            _ => usual,
        }).plans(|(), site, vehicle, way, _, fresh| {
            // What was sent and not seen yet would vanish from the list unseen.
            let settled = fresh && vehicle.instants.is_empty() && vehicle.config.has("instantActionStates");
            let Some(state) = vehicle.state.as_ref().filter(|_| settled) else { return };
            let lists = [("clearInstantActions", &state.instant_action_states), ("clearZoneActions", &state.zone_action_states)];
            let ended = |list: &[ActionState]| !list.is_empty() && list.iter().all(ActionState::is_terminal);
            let kinds: Vec<&str> = lists.into_iter().filter(|(kind, list)| ended(list) && site.offers(vehicle, kind, "NODE")).map(|(kind, _)| kind).collect();
            for kind in kinds {
                let action = site.action(vehicle, kind, &Value::Null);
                if let Some(first) = way.stops.first_mut() { first.actions.insert(0, action); }
            }
        });
    tolerance "trigger-types-mixed" ["TRIG-03", "ACT-31"] "Its triggerType has a word of its own beside FLEET_CONTROL and LOCAL."
        => parameter_of("triggerType", |p| p.change("value", |value| if value.is_array() { *value = json!(["FLEET_CONTROL", "LOCAL", "DOOR_OPEN"]); }));
    tolerance "cancels-without-name" ["ORD-CANCEL-23"] "cancelOrder names no order."
        => typed("cancelOrder", |a| a.unset("actionParameters"));
    tolerance "never-asks-for-retries" ["ORD-MSG-35"] "It sends no action as retriable."
        => action(|a| a.unset("retriable"));
}

/// Whether the vehicle sleeps.
fn asleep(vehicle: &Vehicle) -> bool {
    vehicle.presence == Presence::Asleep
}

type Naming = (&'static str, &'static str, fn(&Value) -> Value);

/// Gives one parameter of one type of action another value.
fn naming_in(kind: &'static str, key: &'static str, change: fn(&Value) -> Value) -> Box<dyn Deviation> {
    let held: Naming = (kind, key, change);
    holding(held).sends(|(kind, key, change), _, _, outgoing| {
        each_action(&mut outgoing.message, |action| {
            if action.says("actionType", *kind) {
                action.each("actionParameters", |parameter| {
                    if parameter.says("key", *key) {
                        parameter.change("value", |value| *value = change(value));
                    }
                });
            }
        });
        true
    })
}

/// Says where a vehicle may be beside a node by this ellipse, where a version has ellipses.
fn elliptic(ellipse: Value) -> Box<dyn Deviation> {
    holding(ellipse).sends(|ellipse, _, vehicle, outgoing| {
        if vehicle.config.has("requests") {
            outgoing.message.each("nodes", |node| {
                node.part("nodePosition", |place| {
                    place.change("allowedDeviationXY", |allowed| *allowed = ellipse.clone())
                });
            });
        }
        true
    })
}
