//! Deviations of what updates of an order say: numbers, stitching node, what was sent before (section 6.6.2).

use super::prelude::*;

records! {
    fault "order-id-per-update" ["ORD-UPD-04"] "Gives every update an orderId of its own."
        => update(|m| m.set("orderId", format!("{}-{}", m.text("orderId"), m["orderUpdateId"])))
            .allows(|_, _, _, what, usual| usual && !matches!(what, Permission::Gone));
    fault "update-id-kept" ["ORD-UPD-04"] "Does not raise orderUpdateId."
        => order(|m| m.set("orderUpdateId", 0));
    fault "update-id-falls" ["ORD-UPD-04"] "Counts orderUpdateId down."
        => order(|m| m.set("orderUpdateId", 1000_u64.saturating_sub(m["orderUpdateId"].as_u64().unwrap_or_default())));
    fault "stitching-missing" ["ORD-UPD-05"] "Begins updates with the first new node."
        => update(|m| for list in ["nodes", "edges"] {
            m.change(list, |elements| if let Some(elements) = elements.as_array_mut() && elements.len() > usize::from(list == "nodes") { elements.remove(0); });
        });
    fault "stitching-moved" ["ORD-UPD-06"] "Rounds the position of the stitching node to decimetres, and shifts it."
        => stitching(|node, _| node.part("nodePosition", |place| shift(place, "x", 0.3)));
    fault "stitching-action-added" ["ORD-UPD-06", "ORD-UPD-15"] "Adds an action to the stitching node."
        => stitching(|node, id| node.add("actions", json!({ "actionType": "beep", "actionId": id, "blockingType": "NONE" })));
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
