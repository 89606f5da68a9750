//! Deviations of what is sent again because it was lost or refused (sections 6.1 and 6.6.4).

use crate::master_control::driving::refusal;

use super::prelude::*;

records! {
    fault "lost-order-not-resent" ["MQTT-10", "ORD-REJ-18"] "Waits forever for a vehicle that never got its order."
        because "To send an order again is allowed, not demanded."
        => forbidding(|_, _, what| matches!(what, Permission::Resend(_)));
    fault "lost-update-not-resent" ["MQTT-10"] "Takes every update for accepted once it is sent."
        because "To send an update again is allowed, not demanded."
        => forbidding(|_, _, what| matches!(what, Permission::Resend(running) if running.is_updated()));
    fault "resent-changed" ["ORD-REJ-18", "ORD-UPD-04"] "Plans anew before it sends an order again under the same orderUpdateId."
        => resending(|_, _, running| slower(&mut running.message, running.resends));
    fault "resend-without-horizon" ["ORD-REJ-18", "ORD-UPD-04"] "It leaves the horizon out of an order message that it sends again."
        => resending(|_, _, running| for list in ["nodes", "edges"] {
            if let Some(list) = running.message[list].as_array_mut() { list.retain(|element| element["released"] == true); }
        });
    fault "resend-extends-base" ["ORD-UPD-04", "ORD-REJ-18"]
        "It releases one more node in an order that is sent again because it was lost, under the same orderUpdateId."
        => resending(|_, _, running| {
            let nodes = running.message["nodes"].as_array_mut().into_iter().flatten();
            let Some((index, node)) = nodes.enumerate().find(|(_, node)| node["released"] == false) else { return };
            node["released"] = json!(true);
            if let Some(edge) = index.checked_sub(1).and_then(|before| running.message["edges"].get_mut(before)) { edge["released"] = json!(true); }
            running.released += 1;
        });
    fault "resend-without-actions" ["ORD-UPD-04", "ORD-REJ-18"]
        "It leaves the actions out of an order that is sent again because it was lost, under the same orderUpdateId."
        => resending(|_, _, running| for list in ["nodes", "edges"] {
            running.message[list].as_array_mut().into_iter().flatten().for_each(|element| element["actions"] = json!([]));
        });
    fault "resend-as-update" ["ORD-REJ-18", "ORD-UPD-05", "ORD-UPD-03"] "An order that is sent again has a raised orderUpdateId."
        => resending(|_, _, running| {
            running.update_id += 1;
            running.message["orderUpdateId"] = json!(running.update_id);
        });
    fault "resend-with-new-action-ids" ["ORD-UPD-04", "ORD-REJ-18"] "An order that is sent again with the same orderUpdateId has new actionIds."
        => resending(|site, vehicle, running| {
            let mut renamed = BTreeMap::new();
            if let Some(message) = running.message.as_object_mut() {
                each_action(message, |action| {
                    let fresh = site.next_id(vehicle, "action");
                    renamed.insert(action.text("actionId").to_owned(), fresh.clone());
                    action.set("actionId", fresh);
                });
            }
            let on_nodes = running.stops.iter_mut().flat_map(|stop| &mut stop.actions);
            for action in on_nodes.chain(running.legs.iter_mut().flat_map(|leg| &mut leg.actions)) {
                if let Some(fresh) = renamed.get(action["actionId"].as_str().unwrap_or_default()) { action["actionId"] = json!(fresh); }
            }
        });
    fault "refused-order-repeated" ["ORD-REJ-18"] "Sends an order that was refused again and again, each time a little different."
        because "No sentence forbids to send a refused order again."
        => plain().judges(|(), site, vehicle, running, state, fate| {
            let refused = refusal(running, state).is_some() && !running.accepted;
            if fate != Fate::Over || !refused || running.resends >= 20 { return fate; }
            // Perhaps it likes it better this way.
            running.resends += 1;
            slower(&mut running.message, running.resends);
            running.sent_at = site.now.moment;
            site.publish(vehicle, "order", &running.message);
            Fate::Runs
        });
    fault "order-repeated-for-ever" ["FACT-13"] "Sends an order to a vehicle that wants time between orders hundreds of times in every second, for ever."
        => keep::<Option<(Value, Moment)>>().happens(|repeated, site, vehicle, event| if let Event::Looked = event {
            let now = site.now.moment;
            let spaced = vehicle.factsheet.as_ref().is_some_and(|sheet| sheet.order_interval > 0.0);
            if repeated.is_none() && spaced { *repeated = vehicle.running.as_ref().map(|running| (running.message.clone(), now)); }
            if let Some((message, due)) = repeated {
                if *due <= now {
                    *due = now + Duration::from_millis(2);
                    site.publish(vehicle, "order", message);
                }
                vehicle.at(*due);
            }
        });
    fault "lost-instant-not-resent" ["MQTT-10"] "It never repeats an instant action that no state shows."
        => forbidding(|_, _, what| matches!(what, Permission::TellAgain));
    tolerance "resends-late" ["ORD-REJ-18"] "It waits three times as long before it sends again what was lost."
        => plain().lasts(|(), _, _, what, usual| if let Span::Lost = what { usual * 3 } else { usual });
    tolerance "cancel-repeated-with-new-id" ["ORD-MSG-17", "IACT-02"]
        "It repeats a cancelOrder that did not appear in the state within some seconds, with a new actionId."
        => happening(|site, vehicle, event| if let Event::InstantLost(id) = event {
            let fresh = site.next_id(vehicle, "action");
            let lost = vehicle.instants.iter_mut().find(|instant| instant.id() == *id && instant.kind() == "cancelOrder");
            if let Some(lost) = lost {
                lost.action["actionId"] = json!(fresh);
                if let Some(cancel) = vehicle.cancel.as_mut().filter(|cancel| cancel.action_id == *id) { cancel.action_id = fresh; }
            }
        });
    tolerance "cancel-repeated-until-it-ends" ["ORD-MSG-17", "IACT-02"]
        "It sends cancelOrder again under the same actionId with every state that shows it and not its end."
        => happening(|site, vehicle, event| if let Event::State(_) = event {
            let Some(id) = vehicle.cancel.as_ref().map(|cancel| cancel.action_id.clone()) else { return };
            let seen = vehicle.state.as_ref().and_then(|state| state.action(&id));
            let runs = seen.is_some_and(|action| !action.is_terminal()) && site.commandable(vehicle);
            let sent = vehicle.instants.iter().find(|instant| instant.id() == id).map(|instant| instant.action.clone());
            if let Some(action) = sent.filter(|_| runs) { site.publish(vehicle, "instantActions", &json!({ "actions": [action] })); }
        });
}

/// Changes a message that must not be changed.
fn slower(message: &mut Value, times: u32) {
    let edges = message["edges"].as_array_mut().into_iter().flatten();
    edges.for_each(|edge| edge["maxSpeed"] = json!(1.0 / f64::from(times + 1)));
}
