//! Deviations of the way ahead, as a state lists it: nodeStates and edgeStates (section 6.10).

use super::prelude::*;

records! {
    fault "route-omitted-when-idle" ["STATE-13", "STATE-MSG-01"] "It leaves nodeStates and edgeStates out when nothing is to be traversed."
        => state(|agv, m| if agv.order.nodes.is_empty() {
            m.unset("nodeStates");
            m.unset("edgeStates");
        });
    fault "cancel-hides-next-node" ["ORD-CANCEL-09"] "While it drives to the next node to end a cancelled order it lists no node at all."
        => state(|agv, m| if agv.order.cancel.as_ref().is_some_and(|cancel| cancel.to_node) { m.set("nodeStates", json!([])) });
    fault "traversed-nodes-listed" ["STATE-12", "NODE-03"] "Keeps listing the node it has reached last."
        => state(|agv, m| if !is_done(agv) { list_last_node(agv, m) });
    fault "first-node-listed-until-the-second" ["ORD-15", "NODE-03", "STATE-12"] "Lists the first node of an order until it has traversed the second one."
        => state(|agv, m| if !is_done(agv) && agv.order.left.0.as_ref().is_some_and(|stop| stop.node.sequence_id == 0) {
            list_last_node(agv, m);
        });
    fault "finished-order-listed" ["STATE-13"] "Keeps the last node in its states when the order is complete."
        => state(|agv, m| if is_done(agv) && agv.order.has_order() { list_last_node(agv, m) });
    fault "last-route-listed" ["STATE-13", "NODE-03"] "Keeps the last node and the last edge in its states when the order is complete."
        => state(|agv, m| if is_done(agv) && agv.order.has_order() {
            list_last_node(agv, m);
            list_last_edge(agv, m);
        });
    fault "last-edge-listed" ["STATE-13"] "Keeps the last edge in its states when the order is complete."
        => state(|agv, m| if is_done(agv) && agv.order.has_order() { list_last_edge(agv, m) });
    fault "edge-states-stay" ["NODE-05", "STATE-12"] "Keeps the edge it has left in its states."
        => state(|agv, m| if !is_done(agv) { list_last_edge(agv, m) });
    fault "route-repeated-on-request" ["STATE-13"] "Answers a stateRequest with the last node of an order that is done."
        => state(|agv, m| if agv.report.answers_request() && agv.order.nodes.is_empty() { m.set("nodeStates", agv.last_node_state()) });
    fault "horizon-not-reported" ["ORD-FLOW-06", "STATE-12"] "Leaves the horizon out of its node and edge states."
        => route(|_, _, m| m.says("released", true));
    fault "horizon-cut-to-one" ["STATE-12", "ORD-FLOW-06"] "Of the horizon it lists only the first node in its node states."
        => state(|_, m| {
            let mut planned = 0;
            m.keep("nodeStates", |node| {
                planned += u32::from(node.says("released", false));
                planned < 2
            });
        });
    fault "loop-nodes-merged" ["ORD-UPD-13", "STATE-12"] "A node that it has to visit several times appears in its node states only once."
        => state(|_, m| {
            let mut listed = Vec::new();
            m.keep("nodeStates", |node| {
                let id = node.text("nodeId").to_owned();
                let first = !listed.contains(&id);
                listed.push(id);
                first
            });
        });
    fault "route-lists-capped" ["STATE-12", "ORD-FLOW-06"] "nodeStates and edgeStates never list more than three elements, however long the order is."
        => state(|_, m| ["nodeStates", "edgeStates"].into_iter().for_each(|list| cut(m, list, 3)));
    fault "node-states-show-ten-at-most" ["STATE-12", "ORD-FLOW-06"] "It lists at most the next ten nodes in nodeStates, although the accepted order has more."
        => state(|_, m| cut(m, "nodeStates", 10));
    fault "edge-states-reversed" ["STATE-12", "ORD-FLOW-06"] "It lists edgeStates from the last edge to the next one."
        => state(|_, m| m.list("edgeStates").reverse());
    fault "entered-edge-unlisted" ["STATE-12", "NODE-05"] "It removes the state of an edge as soon as it enters that edge."
        => edge(|agv, edge, _| {
            let ahead = agv.order.edge_ahead().filter(|_| agv.order.entered);
            ahead.is_none_or(|ahead| ahead.sequence_id != edge.sequence_id)
        });

    fault "horizon-reported-released" ["STATE-MSG-13"] "Reports the nodes and edges of the horizon as released."
        => route(|_, _, m| {
            m.set("released", true);
            true
        });
    fault "released-not-updated" ["STATE-MSG-13"] "Nodes and edges that were in the horizon once are still listed with released false after an update has released them."
        => once_planned(true);
    fault "released-flag-stale-after-update" ["STATE-MSG-13", "ORD-FLOW-09"] "It keeps released false for edges that an update has moved from the horizon into the base."
        => once_planned(false);
    fault "far-edges-unreleased" ["STATE-MSG-13"] "Of its released edges it reports only the next one as released."
        => edge(|agv, edge, m| {
            if !is_next(agv, edge.sequence_id) {
                m.set("released", false);
            }
            true
        });
    fault "released-numeric" ["JSON-07", "STATE-MSG-13"] "The field released of the edgeStates is 1 or 0."
        => edge(|_, _, m| {
            m.change("released", |released| *released = json!(u8::from(*released == true)));
            true
        });
    fault "edge-id-misspelled" ["JSON-01", "STATE-MSG-13", "JSON-10"] "The edgeStates name their edge in a field edgeID."
        => edge(|_, _, m| {
            m.rename("edgeId", "edgeID");
            true
        });
    fault "planned-path-of-next-edge-only" ["STATE-14"] "A self-planning vehicle reports the trajectory of the next edge only."
        => edge(|agv, edge, m| {
            if !is_next(agv, edge.sequence_id) {
                m.unset("trajectory");
            }
            true
        });
    fault "sequence-ids-as-text" ["STATE-MSG-13", "JSON-06"] "It writes sequenceId in nodeStates as a string."
        => node(|_, _, m| {
            m.change("sequenceId", |id| *id = Value::String(id.to_string()));
            true
        });
    fault "node-states-without-sequence" ["STATE-MSG-13", "STATE-12"] "Leaves the sequenceId out of its node states."
        => node(|_, _, m| {
            m.unset("sequenceId");
            true
        });
    fault "horizon-positions-copied" ["ORD-FLOW-06"] "Gives the nodes of the horizon in its states the place of the first node that is listed."
        => node(|agv, stop, m| {
            if let Some(first) = agv.order.nodes.front().filter(|_| !stop.node.released) {
                match first.node.sent_position.clone().filter(|_| !agv.config.line_guided()) {
                    Some(position) => m.set("nodePosition", position),
                    None => m.unset("nodePosition"),
                }
            }
            true
        });
}

/// Whether an edge is the next one.
fn is_next(agv: &Agv, sequence_id: u32) -> bool {
    agv.order
        .edges
        .front()
        .is_some_and(|next| next.sequence_id == sequence_id)
}

/// Lists the node traversed last as if it were still ahead.
fn list_last_node(agv: &Agv, state: &mut Object) {
    put_in_front(state, "nodeStates", agv.last_node_state());
}

/// Lists the edge left last as if it were still ahead.
fn list_last_edge(agv: &Agv, state: &mut Object) {
    put_in_front(state, "edgeStates", agv.last_edge_state());
}

fn put_in_front(state: &mut Object, list: &str, last: Value) {
    state.change(list, |listed| {
        if let (Value::Array(listed), Value::Array(last)) = (listed, last) {
            listed.splice(0..0, last);
        }
    });
}

/// Lists so many at most.
fn cut(state: &mut Object, list: &str, most: usize) {
    state.change(list, |listed| {
        if let Value::Array(listed) = listed {
            listed.truncate(most);
        }
    });
}

/// Still calls planned what was in the horizon once: edges, and nodes too.
fn once_planned(nodes_too: bool) -> Box<Hooks<(bool, BTreeSet<u32>)>> {
    holding((nodes_too, BTreeSet::new()))
        .happens(|(_, planned), agv, event| {
            if event == Event::Begun {
                planned.clear();
            }
            if matches!(event, Event::Begun | Event::Updated) {
                let nodes = agv.order.nodes.iter().filter(|stop| !stop.node.released);
                planned.extend(nodes.map(|stop| stop.node.sequence_id));
                let edges = agv.order.edges.iter().filter(|edge| !edge.released);
                planned.extend(edges.map(|edge| edge.sequence_id));
            }
        })
        .says(|(nodes_too, planned), _, part, m| {
            let sequence_id = match part {
                Part::Node(stop) if *nodes_too => stop.node.sequence_id,
                Part::Edge(edge) => edge.sequence_id,
                _ => return true,
            };
            if planned.contains(&sequence_id) {
                m.set("released", false);
            }
            true
        })
}
