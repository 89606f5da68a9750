//! Deviations of the order message: its ids, nodes, edges and positions (sections 6.6.1 and 7).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::prelude::*;

records! {
    fault "order-update-id-missing" ["ORD-MSG-01"] "Leaves orderUpdateId out of its first message."
        => new_order(|m| m.unset("orderUpdateId"));
    fault "order-id-reused" ["ORD-MSG-02"] "Gives the same orderId to all orders of a vehicle."
        => order(|m| m.set("orderId", "transport"));
    fault "order-id-with-space" ["JSON-04"] "Writes orderIds with a space."
        because "The characters of ids are a recommendation."
        => naming("order", |site, _| format!("Order {}-{}", site.session, site.ids));
    fault "order-id-with-blank-and-slash" ["JSON-04"] "It forms the orderId with a blank and a slash, such as \"Transport 12/1\"."
        because "JSON-04, which letters an identifier has, is a recommendation; the vehicle takes the orderId as it is."
        => naming("order", |site, _| format!("Transport {}/{}", site.session, site.ids));
    fault "order-id-of-the-minute" ["ORD-MSG-02"] "It makes the orderId of the current minute, so that two orders begun within one minute share it."
        => naming("order", |site, _| site.now.utc.as_second().div_euclid(60).to_string());
    fault "order-ids-from-the-start-after-reconnect" ["ORD-MSG-02"]
        "It counts its order numbers from the start after its own connection to the broker was lost, so that an orderId returns for another order."
        => counting("order", |event| matches!(event, Event::Connected(true)));
    fault "order-ids-from-one-after-each-start" ["ORD-MSG-02"]
        "It counts its orderIds from order-1 on after each start, so that one returns for another order after a restart."
        => fleet::<u64>().commanded(|count, _, _, command, _| {
            if command == "start" { *count = 0; }
            true
        }).names(|count, site, vehicle, what, id| if what == "order" {
            *count += 1;
            *id = site.fitting(vehicle, what, format!("order-{count}"), *count);
        });
    tolerance "plain-number-ids" ["ORD-MSG-02", "ORD-MSG-17", "JSON-04"] "It makes orderIds and actionIds of digits only."
        => plain().names(|(), site, vehicle, what, id| *id = site.fitting(vehicle, what, format!("{}{:05}", site.session, site.ids), site.ids));
    tolerance "uuid-ids" ["ORD-MSG-17", "JSON-04"] "Ids of orders, actions and temporary elements look like UUIDs where the vehicle allows their length."
        => plain().names(|(), site, vehicle, what, id| {
            let kind = ["order", "action", "place"].iter().position(|known| *known == what).map_or(4, |at| at + 1);
            let (high, low) = (site.session >> 16 & 0xffff_ffff, site.session & 0xffff);
            let full = format!("{high:08x}-{low:04x}-4a{kind:02x}-9c3e-{:012x}", site.ids);
            *id = site.fitting(vehicle, what, full, site.ids);
        });
    tolerance "ids-with-punctuation" ["JSON-04"] "Ids contain colon, underscore, dot and hyphen."
        => plain().names(|(), site, vehicle, what, id| {
            let full = format!("{what}:{}{:05}_a.-", site.session, site.ids);
            *id = site.fitting(vehicle, what, full, site.ids);
        });
    fault "order-id-missing-in-updates" ["ORD-MSG-01", "ORD-UPD-04"] "It leaves the orderId out of order updates."
        => update(|m| m.unset("orderId"));
    fault "zone-set-empty" ["ORD-MSG-03", "OPT-03"] "Sends an empty zoneSetId."
        => order(|m| m.set("zoneSetId", ""));
    fault "empty-zone-set" ["ORD-MSG-03"] "It sends zoneSetId as an empty string in order updates, though no zones are used."
        => update(|m| m.set("zoneSetId", ""));
    fault "zone-set-null-in-updates" ["ORD-MSG-03", "JSON-06", "JSON-10"] "Order updates carry zoneSetId with the value null."
        => update(|m| m.set("zoneSetId", Value::Null));
    fault "zone-set-named-none" ["ORD-MSG-03", "OPT-03"] "It sends the text none as zoneSetId where no zones are used."
        => order(|m| m.supply("zoneSetId", json!("none")));
    fault "released-missing" ["ORD-MSG-05", "JSON-10"] "Leaves released out of the nodes of the horizon."
        => node(|n| if n.says("released", false) { n.unset("released"); });
    fault "map-id-missing" ["ORD-MSG-05", "JSON-10"] "Leaves mapId out of nodePosition."
        => position(|p| p.unset("mapId"));
    fault "zero-coordinates-omitted" ["ORD-MSG-05", "JSON-10"] "x and y of a node position are left out when they are zero."
        => position(|p| p.retain(|key, value| !matches!(key.as_str(), "x" | "y") || value.as_f64() != Some(0.0)));
    fault "horizon-without-actions" ["ORD-MSG-06", "ORD-MSG-05", "ORD-MSG-18", "JSON-10"] "Nodes and edges of the horizon have no actions array."
        => horizon(|element| element.unset("actions"));
    fault "no-action-list-in-the-horizon" ["ORD-MSG-05", "ORD-MSG-06", "JSON-10"] "It leaves the actions array out on horizon nodes that have no action."
        => node(|n| if n.says("released", false) && n.says("actions", json!([])) { n.unset("actions"); });
    fault "node-position-missing" ["OPT-05", "ORD-MSG-08"] "Leaves nodePosition out."
        => node(|n| n.unset("nodePosition"));
    fault "horizon-without-position" ["ORD-MSG-08", "OPT-05"] "Nodes of the horizon have no nodePosition."
        => node(|n| if n.says("released", false) { n.unset("nodePosition"); });
    fault "positions-only-in-first-message" ["ORD-MSG-08"] "It leaves nodePosition out of the nodes that come new with an update."
        => update(|m| m.list("nodes").iter_mut().skip(1).for_each(|node| if let Some(node) = node.as_object_mut() { node.unset("nodePosition"); }));
    fault "position-missing-at-start" ["ORD-MSG-08"] "It leaves the nodePosition of the first node of a new order out, since the vehicle stands there."
        => composing(|site, _, worded, m| {
            let starts = !worded.is_update() && worded.window.end > 1;
            worded.nodes(m, |index, stop, node| if starts && index == 0 && site.config.node(&stop.id).is_some() { node.unset("nodePosition"); });
        });
    tolerance "position-where-listed" ["ORD-MSG-08", "OPT-03"] "Leaves nodePosition out for a vehicle whose factsheet lists what it supports, and not this."
        => nodes(|vehicle, _, _, _, node| if vehicle.factsheet.as_ref().is_some_and(|sheet| !sheet.knows_positions()) { node.unset("nodePosition"); });
    fault "theta-in-degrees" ["ORD-MSG-09", "MAP-02"] "Gives orientations in degrees."
        => position(|p| p.set("theta", number(p, "theta").unwrap_or(FRAC_PI_2).to_degrees()));
    fault "theta-up-to-two-pi" ["ORD-MSG-09", "MAP-02"] "Node orientations are given between 0 and two pi, such as 4.71."
        => filling(|_, field, value| {
            if field.name.ends_with(".theta") && taken(field) {
                let theta = field.layout.as_ref().and_then(Value::as_f64).unwrap_or(-FRAC_PI_2);
                *value = Some(json!(theta.rem_euclid(TAU)));
            }
        });
    tolerance "theta-at-the-bound" ["ORD-MSG-09", "MAP-02"] "Node orientations, where the vehicle supports them, are exactly minus pi."
        => filling(|_, field, value| if field.name.ends_with(".theta") && taken(field) { *value = Some(json!(-PI)); });
    tolerance "no-theta-on-nodes" ["ORD-MSG-09", "MAP-02"] "It sends no theta and leaves the orientation to the vehicle."
        => filling(|_, field, value| if field.name.ends_with(".theta") && field.support != Some("REQUIRED") { *value = None; });
    fault "theta-not-normalised-on-reverse" ["ORD-MSG-09", "MAP-02"]
        "It adds pi to the theta of a node that is approached against the drawn direction and does not bring it back below pi."
        => nodes(|_, worded, index, stop, node| {
            // The layout is drawn from the lesser id to the greater.
            let before = index.checked_sub(1).and_then(|before| worded.running.stops.get(before));
            if before.is_some_and(|before| before.id > stop.id) {
                node.part("nodePosition", |place| place.change("theta", |theta| *theta = json!(theta.as_f64().unwrap_or_default() + PI)));
            }
        });
    fault "deviation-negative" ["ORD-MSG-09", "JSON-09"] "Uses -1 as allowedDeviationXY where none is wanted."
        => position(|p| p.supply("allowedDeviationXY", json!(-1.0)));
    fault "negative-deviation-for-no-limit" ["ORD-MSG-09"] "It sends allowedDeviationXY -1 on nodes through which the vehicle only passes."
        => composing(|_, vehicle, worded, m| {
            let stops = &worded.running.stops;
            let support = vehicle.factsheet.as_ref().map(|sheet| sheet.support("order.nodes.nodePosition.allowedDeviationXY"));
            worded.nodes(m, |index, stop, node| {
                let passed = index > 0 && index + 1 < stops.len() && stop.actions.is_empty();
                if passed && support != Some(None) { node.part("nodePosition", |place| place.set("allowedDeviationXY", -1.0)); }
            });
        });
    fault "deviation-theta-full-circle" ["ORD-MSG-09"] "Where the orientation does not matter, allowedDeviationTheta is two pi."
        => filling(|_, field, value| if field.name.ends_with("allowedDeviationTheta") && taken(field) { *value = Some(json!(TAU)); });
    tolerance "every-direction-allowed" ["ORD-MSG-09", "OPT-03"]
        "It sends an allowedDeviationTheta of pi for nodes where any direction will do, if the vehicle supports it."
        => filling(|_, field, value| if field.name.ends_with("allowedDeviationTheta") && taken(field) { value.get_or_insert(json!(PI)); });
    tolerance "zero-deviations" ["ORD-MSG-09", "OPT-03"]
        "It sends an allowedDeviationXY of 0 for nodes behind the first that have none in the layout, if the vehicle supports it."
        => filling(|_, field, value| {
            if field.name.ends_with("allowedDeviationXY") && taken(field) && field.index > 0 && field.layout.is_none() { *value = Some(json!(0.0)); }
        });
    fault "deviation-theta-in-degrees" ["ORD-MSG-09", "MAP-02"] "It gives allowedDeviationTheta in degrees."
        => position(|p| p.change("allowedDeviationTheta", |turn| *turn = json!(turn.as_f64().unwrap_or_default().to_degrees())));
    fault "mirrored-map" ["MAP-01", "ORD-MSG-30"] "Lets the y axis point the other way, as on a screen."
        => position(|p| scale(p, "y", -1.0));
    fault "millimetres" ["MAP-02", "MAP-01", "ORD-MSG-30"] "Gives coordinates in millimetres."
        => position(|p| ["x", "y"].iter().for_each(|axis| scale(p, axis, 1000.0)));
    fault "axes-swapped" ["MAP-01"] "It exchanges x and y in every nodePosition."
        => position(|p| {
            let (x, y) = (p["x"].clone(), p["y"].clone());
            p.set("x", y);
            p.set("y", x);
        });
    fault "station-moved-when-loaded" ["ORD-MSG-07"] "It moves the position of a node by the length of the fork when a load is dropped there, under the same nodeId."
        => node(|n| if n.list("actions").iter().any(|action| action["actionType"] == "drop") { n.part("nodePosition", |place| shift(place, "x", 0.4)); });
    fault "edge-without-ends" ["ORD-MSG-18"] "Leaves startNodeId and endNodeId out of edges."
        => edge(|e| {
            e.unset("startNodeId");
            e.unset("endNodeId");
        });
    fault "end-node-missing-in-horizon" ["ORD-MSG-18"] "It leaves endNodeId out of the edges of the horizon."
        => edge(|e| if e.says("released", false) { e.unset("endNodeId"); });
    fault "edge-id-missing" ["ORD-MSG-18"] "Leaves edgeId out."
        => edge(|e| e.unset("edgeId"));
    fault "edge-id-with-arrow" ["JSON-04"] "Edge ids contain an arrow with a greater-than sign."
        because "JSON-04, which letters an identifier has, is a recommendation; an arrow in an edgeId is warned of."
        => edge(|e| e.set("edgeId", e.text("edgeId").replacen('-', "->", 1)));
    tolerance "edge-ids-named-otherwise" ["ORD-MSG-18", "JSON-04"] "It names edges way, start node and end node with colons instead of by the ids of the layout."
        => composing(|site, vehicle, worded, m| {
            let free = vehicle.factsheet.as_ref().is_none_or(|sheet| sheet.id_length.is_none() && !sheet.ids_numerical);
            worded.edges(m, |_, leg, edge| {
                if free && site.config.edges.iter().any(|known| known.id == leg.id) { edge.set("edgeId", format!("way:{}:{}", leg.from, leg.to)); }
            });
        });
    fault "edge-ends-swapped" ["ORD-MSG-19"] "Swaps the start node and end node of edges."
        => edge(swap_ends);
    fault "reverse-edges-misdirected" ["ORD-MSG-19"] "An edge that leads to a node with a lesser id has startNodeId and endNodeId exchanged."
        => edge(|e| if e.text("startNodeId") > e.text("endNodeId") { swap_ends(e); });
    fault "edge-ends-of-order" ["ORD-MSG-19"] "Names the first and last node of the order in every edge."
        => order(|m| {
            let end = |node: Option<&Value>| node.map(|node| node["nodeId"].clone()).unwrap_or_default();
            let (start, end) = (end(m.list("nodes").first()), end(m.list("nodes").last()));
            m.each("edges", |edge| {
                edge.set("startNodeId", start.clone());
                edge.set("endNodeId", end.clone());
            });
        });
    fault "edge-ends-as-sequence-ids" ["ORD-MSG-18", "ORD-MSG-19", "JSON-06"] "It writes the sequenceIds of the nodes into startNodeId and endNodeId of edges."
        => edges(|_, _, index, _, edge| {
            edge.set("startNodeId", 2 * index);
            edge.set("endNodeId", 2 * index + 2);
        });
    fault "temporary-edge-from-last-node" ["ORD-MSG-19"] "It writes the last node of the vehicle as startNodeId of the edge that begins at a temporary node."
        => composing(|site, vehicle, worded, m| {
            let temporary = worded.running.stops.first().is_some_and(|start| site.config.node(&start.id).is_none());
            let last = vehicle.state.as_ref().map(|state| state.last_node_id.as_str()).unwrap_or_default();
            worded.edges(m, |index, _, edge| if index == 0 && temporary && !last.is_empty() { edge.set("startNodeId", last); });
        });
    fault "update-edge-starts-at-vehicle" ["ORD-MSG-19"] "It names the node the vehicle has passed last as startNodeId of the first edge of an update."
        => composing(|_, vehicle, worded, m| {
            let last = vehicle.state.as_ref().map(|state| state.last_node_id.as_str()).unwrap_or_default();
            worded.edges(m, |index, _, edge| if worded.is_update() && index == worded.window.first && !last.is_empty() { edge.set("startNodeId", last); });
        });
    fault "edge-missing" ["ORD-02", "ORD-MSG-19"] "Forgets the last edge."
        => order(|m| m.change("edges", |edges| drop(edges.as_array_mut().and_then(Vec::pop))));
    fault "dangling-edge" ["ORD-02", "ORD-MSG-19"] "It puts the edge that leads on from the last node into the message when the way goes on behind it."
        => dangling(|_| true);
    fault "cut-leaves-a-dangling-edge" ["ORD-02"] "It cuts an order that is too long for the vehicle behind the edge, so that the message has as many edges as nodes."
        => dangling(|worded| worded.cut);
    fault "closing-edge-in-round-trips" ["ORD-02"]
        "An order that leads back to where it begins ends with the edge to the first node, without that node once more, so that it has as many edges as nodes."
        => composing(|_, _, worded, m| {
            let stops = &worded.running.stops;
            let back = stops.len() > 2 && stops.first().map(|stop| &stop.id) == stops.last().map(|stop| &stop.id);
            if back && worded.window.end >= stops.len() { m.change("nodes", |nodes| drop(nodes.as_array_mut().and_then(Vec::pop))); }
        });
    fault "self-edge" ["ORD-02", "ORD-MSG-06"] "An order of one node has an edge from that node to itself."
        => composing(|_, _, worded, m| {
            if let [stop] = worded.running.stops.as_slice() && !worded.is_update() {
                let id = &stop.id;
                let edge = json!({ "edgeId": format!("{id}-{id}"), "sequenceId": 1, "released": true, "startNodeId": id, "endNodeId": id, "actions": [] });
                m.set("edges", json!([edge]));
            }
        });
    fault "edge-released-alone" ["ORD-08"] "Releases the edge that leads into the horizon."
        => order(|m| {
            let mut edges = m.list("edges").iter_mut();
            if let Some(edge) = edges.find(|edge| edge["released"] == false) { edge["released"] = json!(true); }
        });
    fault "released-behind-horizon" ["ORD-09", "ORD-08"] "Releases the last node of the horizon."
        => order(|m| if let Some(node) = m.list("nodes").last_mut() { node["released"] = json!(true); });
    fault "stations-always-released" ["ORD-09"] "A node with actions is released even if it lies in the horizon."
        => node(|n| if !n.list("actions").is_empty() { n.set("released", true); });
    fault "releases-the-reserved-station" ["ORD-09"] "It marks the destination node of the horizon as released, because the station is reserved for the vehicle."
        => nodes(|_, worded, index, _, node| if index + 1 == worded.running.stops.len() { node.set("released", true); });
    fault "loop-released-by-id" ["ORD-09"] "It releases a node in the horizon when the way has been released over a node of the same nodeId."
        => composing(|_, _, _, m| {
            let released: Vec<Value> = m.list("nodes").iter().filter(|node| node["released"] == true).map(|node| node["nodeId"].clone()).collect();
            m.each("nodes", |node| if released.contains(&node["nodeId"]) { node.set("released", true); });
        });
    fault "edges-released-after-reroute" ["ORD-08", "ORD-09"] "After a change of destination all edges of the order updates are released, also those of the horizon."
        => keep::<bool>().happens(rerouted).words(|rerouted, _, _, _, m| m.each("edges", |edge| if *rerouted { edge.set("released", true); }));
    tolerance "slow-last-edge" ["OPT-03"] "It limits the speed on the last edge of a way more than it does on the same edge elsewhere."
        => edges(|_, worded, index, _, edge| {
            if index + 2 == worded.running.stops.len() && let Some(speed) = number(edge, "maxSpeed") { edge.set("maxSpeed", speed.min(0.4)); }
        });
    tolerance "horizon-slower" ["ORD-UPD-03"] "It sends a lower maxSpeed for edges in the horizon than when they are released."
        => composing(|_, _, _, m| m.each("edges", |edge| if edge.says("released", false) { scale(edge, "maxSpeed", 0.5); }));
    tolerance "slower-when-loaded" ["ORD-UPD-03", "OPT-03"] "It sends half the maxSpeed for edges while the vehicle carries a load."
        => composing(|_, vehicle, _, m| m.each("edges", |edge| if is_loaded(vehicle) { scale(edge, "maxSpeed", 0.5); }));
    fault "low-score-slows-down" ["INFO-03"] "It sends a third of the maxSpeed to a vehicle with a low localizationScore."
        => composing(|_, vehicle, _, m| m.each("edges", |edge| if is_unsure(vehicle) { scale(edge, "maxSpeed", 1.0 / 3.0); }));
    tolerance "horizon-actions-open" ["ORD-UPD-03", "ORD-MSG-06"]
        "It sends the actions of nodes and edges only when they are released; in the horizon the lists are empty."
        => composing(|_, _, _, m| {
            for list in ["nodes", "edges"] { m.each(list, |element| if element.says("released", false) { element.set("actions", json!([])); }); }
        });
}

/// Whether the vehicle takes an optional field.
fn taken(field: &Field<'_>) -> bool {
    field.support.is_some() || field.harmless
}

fn swap_ends(edge: &mut Object) {
    let start = edge["startNodeId"].clone();
    edge.rename("endNodeId", "startNodeId");
    edge.set("endNodeId", start);
}

/// Adds the edge that leads on from the last node of a message.
fn dangling(when: fn(&Worded<'_>) -> bool) -> Box<dyn Deviation> {
    holding(when).words(|when, _, _, worded, message| {
        let (running, end) = (worded.running, worded.window.end);
        let ends = (
            running.stops.get(end - 1),
            running.stops.get(end),
            running.legs.get(end - 1),
        );
        if let (Some(from), Some(to), Some(leg)) = ends
            && when(worded)
        {
            let edge = json!({
                "edgeId": leg.id, "sequenceId": 2 * end - 1, "released": false,
                "startNodeId": from.id, "endNodeId": to.id, "actions": leg.actions,
            });
            message.add("edges", edge);
        }
    })
}
