//! Deviations of what updates of an order say: numbers, stitching node, what was sent before (section 6.6.2).

use crate::master_control::commands::transport;

use super::prelude::*;

records! {
    fault "order-id-per-update" ["ORD-UPD-04"] "Gives every update an orderId of its own."
        => update(|m| m.set("orderId", format!("{}-{}", m.text("orderId"), m["orderUpdateId"])))
            .allows(|_, _, _, what, usual| usual && !matches!(what, Permission::Gone));
    fault "update-id-kept" ["ORD-UPD-04"] "Does not raise orderUpdateId."
        => order(|m| m.set("orderUpdateId", 0));
    fault "update-id-falls" ["ORD-UPD-04", "ORD-UPD-14"] "Counts orderUpdateId down."
        => order(|m| m.set("orderUpdateId", 1000_u64.saturating_sub(m["orderUpdateId"].as_u64().unwrap_or_default())));
    fault "stitching-missing" ["ORD-UPD-05"] "Begins updates with the first new node."
        => update(|m| for list in ["nodes", "edges"] {
            m.change(list, |elements| if let Some(elements) = elements.as_array_mut() && elements.len() > usize::from(list == "nodes") { elements.remove(0); });
        });
    fault "stitching-moved" ["ORD-UPD-06"] "Rounds the position of the stitching node to decimetres, and shifts it."
        => stitching(|node, _| node.part("nodePosition", |place| shift(place, "x", 0.3)));
    fault "stitching-node-placed-at-the-vehicle" ["ORD-UPD-06", "ORD-MSG-07"]
        "In each update it gives the stitching node the x, y and theta that the vehicle reports at that moment."
        => composing(|_, vehicle, worded, m| {
            let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
            let Some(here) = position.filter(|_| worded.is_update()) else { return };
            worded.nodes(m, |index, _, node| if index == worded.window.first {
                node.part("nodePosition", |place| {
                    place.set("x", here.x);
                    place.set("y", here.y);
                    place.change("theta", |theta| *theta = json!(here.theta));
                });
            });
        });
    fault "stitching-action-added" ["ORD-UPD-06", "ORD-UPD-15"] "Adds an action to the stitching node."
        => stitching(|node, id| node.add("actions", json!({ "actionType": "beep", "actionId": id, "blockingType": "NONE" })));
    fault "stitching-node-without-actions" ["ORD-UPD-06"] "The stitching node of an update has no actions, also where it had some before."
        => stitching(|node, _| node.set("actions", json!([])));
    fault "further-action-on-the-stitching-node" ["ORD-UPD-15", "ORD-UPD-06"]
        "What is to be done besides where the vehicle waits at the end of its base it adds to the actions of the stitching node, and sends no further node."
        => asked("dispatch", |site, vehicle, arguments| {
            let Some(action) = further_action(site, vehicle, arguments) else { return true };
            let running = vehicle.running.as_mut();
            running.into_iter().for_each(|running| {
                if let Some(end) = running.stops.get_mut(running.released.saturating_sub(1)) { end.actions.push(action.clone()); }
                running.changed = true;
            });
            vehicle.at(site.now.moment);
            false
        });
    tolerance "further-actions-on-a-further-node" ["ORD-UPD-15"]
        "What is to be done besides where the base of an order ends it puts on a further node of the same id at the same place."
        => further_node();
    fault "further-node-with-the-same-number" ["ORD-UPD-11", "ORD-UPD-12"]
        "What is to be done besides where the base ends it puts on a further node that has the sequenceId of the stitching node."
        => further_node().words(|(), _, _, worded, m| {
            let first = worded.window.first;
            let stays = worded.running.stops.get(first).zip(worded.running.stops.get(first + 1)).is_some_and(|(end, next)| end.id == next.id);
            if worded.is_update() && stays { worded.nodes(m, |index, _, node| if index == first + 1 { node.set("sequenceId", 2 * first); }); }
        });
    fault "stitching-actions-renamed" ["ORD-UPD-06"] "The actions of the stitching node have other actionIds in an order update than before."
        => stitching(|node, id| node.each("actions", |action| action.set("actionId", format!("{}-{id}", action.text("actionId")))));
    fault "stitching-deviation-widened" ["ORD-UPD-06", "OPT-03"] "The stitching node has an allowedDeviationXY of 1 m in order updates, whatever it had before."
        because "ORD-UPD-06 fails altered positions and added actions; how close the vehicle has to pass may be corrected."
        => stitching(|node, _| node.part("nodePosition", |place| place.set("allowedDeviationXY", 1.0)));
    fault "stitching-node-deviation-reset" ["ORD-UPD-06"]
        "It sends the stitching node of an update with the deviation of a stop (zero), although it was first sent with the deviation of a pass-through node."
        => stitching(|node, _| node.part("nodePosition", |place| place.change("allowedDeviationXY", |metres| *metres = json!(0.0))));
    fault "stitching-theta-dropped" ["ORD-UPD-06"] "It leaves the theta of the stitching node out of an update, as the vehicle no longer stops there."
        => stitching(|node, _| node.part("nodePosition", |place| place.unset("theta")));
    fault "stitching-node-unreleased" ["ORD-UPD-06", "ORD-09"] "It marks the first node of an update as not released."
        => stitching(|node, _| node.set("released", false));
    fault "stitching-theta-towards-next" ["ORD-UPD-06", "OPT-03"] "It gives the first node of an update a theta that points along the next edge."
        because "ORD-UPD-06 fails altered positions and added actions; an angle where none was given is warned of."
        => composing(|_, _, worded, m| {
            let stops = &worded.running.stops;
            worded.nodes(m, |index, here, node| {
                if worded.is_update() && index == worded.window.first && let Some(next) = stops.get(index + 1) {
                    node.part("nodePosition", |place| place.set("theta", (next.y - here.y).atan2(next.x - here.x)));
                }
            });
        });
    fault "base-taken-back-on-destination-change" ["ORD-UPD-03"] "It sends the stitching node as not released in the update that changes the destination."
        => keep::<bool>().happens(|led, _, _, event| match event {
            Event::Led(_) => *led = true,
            Event::Begun => *led = false,
            _ => {}
        }).words(|led, _, _, worded, m| if *led && worded.is_update() && worded.running.changed { m.list("nodes")[0]["released"] = json!(false); });
    fault "sequence-from-one" ["ORD-UPD-11"] "Numbers nodes and edges from 1."
        => numbered(|sequence, _| sequence + 1);
    fault "sequence-per-kind" ["ORD-UPD-11"] "Numbers nodes and edges separately."
        => numbered(|sequence, _| sequence / 2);
    fault "sequence-restarts" ["ORD-UPD-12", "ORD-UPD-05"] "Numbers nodes and edges from 0 again in every update."
        => numbered(|sequence, first| sequence - first);
    fault "stitching-numbered-again" ["ORD-UPD-12", "ORD-UPD-05", "ORD-UPD-06"]
        "The first order update gives the stitching node the next sequenceId instead of its own and counts on from there."
        => numbered(|sequence, first| if first > 0 { sequence + 2 } else { sequence });
    fault "edges-share-number-of-start-node" ["ORD-UPD-11"] "It gives each edge the sequenceId of the node where it begins."
        => edge(|e| e.change("sequenceId", |id| *id = json!(id.as_u64().unwrap_or_default() - 1)));
    fault "update-edges-numbered-from-one" ["ORD-UPD-12", "ORD-UPD-11"] "It numbers the edges of each update from 1 on again, while the nodes keep their numbers."
        => edges(|_, worded, index, _, edge| if worded.is_update() { edge.set("sequenceId", 2 * (index - worded.window.first) + 1); });
    fault "loop-numbered-by-node" ["ORD-UPD-11"] "Gives a node that the way passes twice the sequenceId of the first time."
        => numbered_by_node();
    fault "edge-into-last-base-node-unreleased" ["ORD-09"] "It leaves the edge into the last base node of an update unreleased, although the node is released."
        => edges(|_, worded, index, _, edge| if worded.is_update() && index + 2 == worded.window.released { edge.set("released", false); });
    fault "update-keeps-incoming-edge" ["ORD-02", "ORD-UPD-05"] "It begins the edges of an update with the edge that leads to the first node."
        => composing(|_, _, worded, m| {
            let before = worded.window.first.checked_sub(1);
            let leg = before.and_then(|before| Some((before, worded.running.legs.get(before)?)));
            if let Some((before, leg)) = leg && let Some(edges) = m.get_mut("edges").and_then(Value::as_array_mut) {
                let edge = json!({
                    "edgeId": leg.id, "sequenceId": 2 * before + 1, "released": true,
                    "startNodeId": leg.from, "endNodeId": leg.to, "actions": leg.actions,
                });
                edges.insert(0, edge);
            }
        });
    fault "no-lhd-in-updates" ["ACT-32", "FACT-15"] "It names the load handling device for a pick in a new order, but not for a pick that comes with an update."
        => update(|m| for list in ["nodes", "edges"] {
            let added = m.list(list).iter_mut().skip(usize::from(list == "nodes")).filter_map(Value::as_object_mut);
            added.for_each(|element| element.each("actions", |action| {
                if action.says("actionType", "pick") { action.keep("actionParameters", |parameter| !parameter.says("key", "lhd")); }
            }));
        });
}

/// Changes the first node of updates; the text is another for each of them.
fn stitching(change: fn(&mut Object, &str)) -> Box<dyn Deviation> {
    holding(change).sends(|change, _, _, out| {
        let id = format!("added-{}", out.message.get("orderUpdateId").unwrap_or(&Value::Null));
        if out.is_update()
            && let Some(Value::Object(node)) = out.message.list("nodes").first_mut()
        {
            change(node, &id);
        }
        true
    })
}

/// Numbers nodes and edges otherwise, knowing the number of the first node.
fn numbered(number: fn(u64, u64) -> u64) -> Box<dyn Deviation> {
    holding(number).sends(|number, _, _, out| {
        let first = out
            .message
            .list("nodes")
            .first()
            .and_then(|node| node["sequenceId"].as_u64());
        each_element(&mut out.message, |element| {
            element.change("sequenceId", |id| {
                *id = json!(number(id.as_u64().unwrap_or_default(), first.unwrap_or_default()));
            });
        });
        true
    })
}

fn numbered_by_node() -> Box<Hooks<()>> {
    plain().words(|(), _, _, worded, m| {
        worded.nodes(m, |_, stop, node| {
            let first = worded.running.stops.iter().position(|known| known.id == stop.id);
            node.set("sequenceId", 2 * first.unwrap_or_default());
        })
    })
}

/// An action that is asked for where the vehicle waits at the end of the base of its order.
fn further_action(site: &mut Site, vehicle: &Vehicle, arguments: &Value) -> Option<Value> {
    let transport = transport(vehicle, arguments).filter(|transport| transport.from.is_none())?;
    let kind = transport.action.as_deref()?;
    let running = vehicle
        .running
        .as_ref()
        .filter(|running| running.confirmed && !running.is_whole())?;
    let state = vehicle.state.as_ref().filter(|_| vehicle.cancel.is_none())?;
    let end = running.stops.get(running.released.checked_sub(1)?)?;
    let waits =
        !state.node_states.iter().any(|node| node.released) && running.reached(Some(state)) + 1 == running.released;
    if !waits || end.id != transport.to || !site.offers(vehicle, kind, "NODE") {
        return None;
    }
    Some(site.action(vehicle, kind, &transport.parameters))
}

/// Leads the way behind the base to a further node at the same place, where something is done.
fn stay(running: &mut Running, way: String, actions: Vec<Value>) {
    let base = running.released;
    let Some(end) = base.checked_sub(1).and_then(|last| running.stops.get(last)) else {
        return;
    };
    let leg = Leg {
        id: way,
        from: end.id.clone(),
        to: end.id.clone(),
        ..Leg::default()
    };
    let stop = Stop { actions, ..end.clone() };
    running.stops.insert(base, stop);
    running.legs.insert(base - 1, leg);
    running.changed = true;
}

/// Puts what is to be done besides where the base ends on a further node.
fn further_node() -> Box<Hooks<()>> {
    plain()
        .asked(|(), site, vehicle, command, arguments| {
            if command != "dispatch" {
                return true;
            }
            let Some(action) = further_action(site, vehicle, arguments) else {
                return true;
            };
            let way = site.next_id(vehicle, "way");
            vehicle
                .running
                .as_mut()
                .into_iter()
                .for_each(|running| stay(running, way.clone(), vec![action.clone()]));
            vehicle.at(site.now.moment);
            false
        })
        .happens(|(), site, vehicle, event| {
            if let Event::NotLed(running, way, transport, done) = event
                && way.stops.len() == 1
            {
                let added = std::mem::take(&mut way.stops[0].actions);
                if added.is_empty() || running.released == 0 {
                    return;
                }
                running.stops.truncate(running.released);
                running.legs.truncate(running.released - 1);
                let way = site.next_id(vehicle, "way");
                stay(running, way, added);
                running.transport = Transport {
                    loaded: running.transport.loaded,
                    ..transport.clone()
                };
                **done = true;
            }
        })
}
