//! Deviations of what is checked before an order is taken over (section 6.6.4, ORD-REJ-04 to ORD-REJ-16).

use super::prelude::*;

records! {
    fault "new-order-with-update-id-taken" ["ORD-FLOW-13"] "Takes over a new order that begins with another orderUpdateId than 0."
        => overlooking(|_, what| matches!(what, Objection::UpdateId));
    fault "other-content-overlooked" ["ORD-REJ-20", "ORD-REJ-17"] "Takes an order for a copy whenever its ids are those of the one that it has, whatever it says."
        => overlooking(|_, what| matches!(what, Objection::OtherContent));
    fault "graph-unchecked" ["ORD-11"] "Takes over orders whose releases and counts make no sense."
        => overlooking(|_, what| match what {
            Objection::Graph(order, _) => !order.nodes.is_empty(),
            what => matches!(what, Objection::Begin),
        });
    fault "edge-ends-unchecked" ["ORD-11"] "Takes edges that name other nodes than those around them." because "No sentence obliges a vehicle to check startNodeId and endNodeId; a remark."
        => overlooking(|_, what| matches!(what, Objection::Graph(_, defect) if defect.path.ends_with(".startNodeId") || defect.path.ends_with(".endNodeId")));
    fault "sequence-unchecked" ["ORD-11"] "Takes nodes and edges with doubled or missing sequenceIds." because "Gaps and repetitions of sequenceIds are for the master control to avoid; no vehicle has to refuse them."
        => overlooking(|_, what| matches!(what, Objection::Graph(_, defect) if defect.path.ends_with(".sequenceId")));
    fault "update-graph-unchecked" ["ORD-11"] "It checks node and edge counts and release flags only in new orders and adopts an update that breaks them."
        => overlooking(|agv, what| matches!(what, Objection::Graph(order, _) if order.id == agv.order.order_id && !order.nodes.is_empty()));
    fault "split-base-taken" ["ORD-11"] "It takes an order whose base goes on behind an unreleased node."
        => overlooking(|_, what| matches!(what, Objection::Graph(_, defect) if defect.reason == "is true behind the horizon's begin"));
    fault "counts-checked-in-base-only" ["ORD-11"] "It checks the number of edges against the number of nodes in the base only, so that an order with an edge missing in the horizon is accepted."
        => overlooking(|_, what| matches!(what, Objection::Graph(order, defect) if defect.reason.ends_with("one less than the nodes") && counts_in_base(order)));
    fault "parameters-unchecked" ["ORD-REJ-04"] "Takes over orders whatever the parameters of their actions are."
        => overlooking(|_, what| matches!(what, Objection::Action(_, Lack::Parameter(_))));
    fault "missing-parameter-taken" ["ORD-REJ-04", "ORD-REJ-09"] "It takes over an order with an action that lacks a required parameter."
        => overlooking(|_, what| matches!(what, Objection::Action(_, Lack::Parameter(reason)) if reason.ends_with("missing")));
    fault "unknown-action-accepted" ["ORD-REJ-04", "ORD-REJ-09"] "Accepts orders with unknown actions and fails the action."
        => overlooking(|_, what| matches!(what, Objection::Action(_, Lack::Kind)));
    fault "scope-unchecked" ["ACT-10"] "Performs actions of an order that are only for instantActions."
        => overlooking(|_, what| matches!(what, Objection::Action(_, Lack::Scope(_))));
    fault "requests-on-nodes-taken" ["ACT-10"] "stateRequest, factsheetRequest and logReport are performed as node and edge actions."
        => overlooking(|_, what| matches!(what, Objection::Action(_, Lack::Scope(kind)) if matches!(kind.effect, Effect::StateRequest | Effect::FactsheetRequest | Effect::LogReport)));
    fault "edge-scope-not-checked" ["ACT-10"] "It takes over an order with waitForTrigger on an edge, because it checks the scope of node actions only."
        => overlooking(|_, what| matches!(what, Objection::Action(asked, Lack::Scope(_)) if asked.of_edge));
    fault "charging-on-edge-accepted" ["ACT-10"] "It accepts startCharging as an edge action."
        => overlooking(|_, what| matches!(what, Objection::Action(asked, Lack::Scope(kind)) if asked.of_edge && kind.effect == Effect::StartCharging));
    fault "update-actions-not-checked" ["ORD-REJ-04", "ORD-REJ-09"] "It checks the actions of a new order but takes over an order update with an action that it cannot perform and later reports it FAILED."
        => overlooking(|_, what| matches!(what, Objection::Action(asked, _) if asked.update));
    fault "horizon-actions-unchecked" ["ORD-REJ-04", "ORD-REJ-09"] "An order is taken over although an action in its horizon cannot be performed."
        => overlooking(|_, what| matches!(what, Objection::Action(asked, _) if !asked.released));
    fault "edge-actions-unchecked" ["ORD-REJ-04", "ORD-REJ-09"] "It checks the actions of nodes only: an order with an impossible action on an edge is taken over, and the action fails later."
        => overlooking(|_, what| matches!(what, Objection::Action(asked, _) if asked.of_edge));
    fault "listed-action-refused" ["ACT-01", "ACT-35", "ACT-36"] "Refuses finePositioning and detectObject although its factsheet lists them."
        => objecting(|_, order, relation| {
            let listed = |name: &str| matches!(name, "finePositioning" | "detectObject");
            let refused = order.actions().find(|action| relation != Relation::Known && listed(&action.action_type))?;
            let refusal = Refusal::at_field(Rule::Unable, "the action is not possible here", &refused.path);
            Some(refusal.naming("actionId", &refused.id).naming("actionType", &refused.action_type))
        });
    fault "no-route-named-otherwise" ["ORD-REJ-22"] "Reports the refusal of an order with a node out of reach as that of an order with an action it cannot perform."
        because "When a vehicle finds that a node is out of reach, and what it then calls it, is its own matter by the ruling of ORD-REJ-22."
        => refusal(|agv, _, _, error| {
            if agv.config.has("unreachableRefused") && error.error_type == agv.config.errors.no_route {
                error.error_type.clone_from(&agv.config.errors.order);
            }
            true
        });
    fault "no-route-critical" ["ORD-REJ-22"] "Reports the refusal of an order with a node out of reach as CRITICAL."
        => error(|agv, error, words| if agv.config.has("unreachableRefused") && error.error_type == agv.config.errors.no_route {
            words.set("errorLevel", "CRITICAL");
        });
    fault "no-route-brief" ["ORD-REJ-22"] "Takes the error of an order with a node out of reach back after one state."
        => plain().happens(|_, agv, event| if event == Event::StateSent && agv.config.has("unreachableRefused") {
            let name = agv.config.errors.no_route.clone();
            agv.errors.active.retain(|error| error.error_type != name);
        });
    fault "unsupported-field-ignored" ["ORD-REJ-05", "OPT-02"] "Ignores fields of an order it has no use for."
        because "Whether a vehicle ignores a field that its factsheet does not list, or honours it, cannot be seen; the ruling of OPT-02 is a warning."
        => overlooking(|_, what| matches!(what, Objection::Unused(..)));
    fault "min-height-ignored" ["OPT-02", "ORD-REJ-05"] "An order with minHeight is accepted although the vehicle does not know the field."
        because "Whether a vehicle ignores a field that its factsheet does not list, or honours it, cannot be seen; the ruling of OPT-02 is a warning."
        => overlooking(|_, what| matches!(what, Objection::Unused(path, _) if path.ends_with("minHeight")));
    fault "unsupported-field-in-update-ignored" ["OPT-02", "ORD-REJ-05"] "It refuses unsupported optional fields in new orders only and takes over an order update with such a field, ignoring the field."
        => updating(|agv, order| if !agv.config.trajectories {
            for edge in &mut order.edges {
                (edge.trajectory, edge.corridor) = (None, None);
            }
        })
        .allows(|_, _, what, usual| usual || matches!(what, Permission::Overlook(Objection::Unused(_, true))));
    fault "node-position-demanded" ["OPT-04"] "It rejects orders whose nodes have no nodePosition, although it knows the nodes and its factsheet does not list the parameter as REQUIRED."
        => objecting(|_, order, relation| {
            let node = order.nodes.iter().find(|node| relation != Relation::Known && node.position.is_none())?;
            let path = format!("{}.nodePosition", node.path);
            let refusal = Refusal::at_field(Rule::Unable, "the vehicle needs the position of the node", &path);
            Some(refusal.naming("nodeId", &node.id))
        });
    fault "memory-unchecked" ["ORD-REJ-15", "STATE-12"] "Takes over orders larger than its stated limits, cut to what fits."
        => adopting(|agv, order| {
            order.nodes.truncate(agv.config.max_nodes);
            order.edges.truncate(agv.config.max_nodes.saturating_sub(1));
        })
        .allows(|_, _, what, usual| usual || matches!(what, Permission::Overlook(Objection::Nodes | Objection::Actions)));
    fault "surplus-actions-dropped" ["ORD-REJ-15", "ASTATE-01"] "Of a node with more actions than it can store it takes as many as fit, and forgets the others."
        => adopting(|agv, order| {
            let most = agv.config.max_actions;
            order.nodes.iter_mut().for_each(|node| node.actions.truncate(most));
            order.edges.iter_mut().for_each(|edge| edge.actions.truncate(most));
        })
        .allows(|_, _, what, usual| usual || matches!(what, Permission::Overlook(Objection::Actions)));
    fault "max-height-ignored" ["ORD-MSG-21", "OPT-02"] "Accepts edges too low for it."
        => overlooking(|_, what| matches!(what, Objection::Height));
    fault "orientation-unchecked" ["ORD-REJ-16"] "Accepts edges with an orientation it cannot take."
        => overlooking(|_, what| matches!(what, Objection::Orientation));
    fault "zone-set-unchecked" ["STATE-MSG-03"] "Takes over orders with zone sets it does not have, and goes on with its own."
        => overlooking(|_, what| matches!(what, Objection::ZoneSet));
    fault "unknown-map-accepted" ["MAP-08"] "Accepts orders on maps it does not have."
        => letting(|agv, what| match what {
            Permission::Overlook(what) => matches!(what, Objection::Map(..) | Objection::DisabledMap(..)),
            what => begins_here(agv, what),
        });
    fault "disabled-map-used" ["MAP-13"] "Drives on maps that are disabled."
        => letting(|agv, what| match what {
            Permission::Overlook(what) => matches!(what, Objection::DisabledMap(..)),
            what => begins_here(agv, what),
        });
    fault "map-check-skipped-in-update" ["MAP-08"] "It checks the maps of a new order but takes over an order update with a node on a map that is not on board."
        => overlooking(|_, what| matches!(what, Objection::Map(_, _, true) | Objection::DisabledMap(_, _, true)));
    fault "map-of-horizon-unchecked" ["MAP-08"] "The map of nodes in the horizon is not checked when an order is accepted."
        => overlooking(|_, what| matches!(what, Objection::Map(node, ..) | Objection::DisabledMap(node, ..) if !node.released));
    fault "only-first-map-checked" ["MAP-08"] "It checks only for the first node of an order whether the map is on board, and accepts orders with an unknown map on later nodes."
        => keep::<Option<String>>()
            .allows(|_, _, what, usual| usual || matches!(what, Permission::Overlook(Objection::Map(_, index, _) | Objection::DisabledMap(_, index, _)) if index > 0))
            .happens(|map, agv, event| if matches!(event, Event::NodeReached(_)) {
                let here = agv.motion.pose(agv.moment()).map_id;
                if agv.maps.on_board(&here) {
                    *map = Some(here);
                } else if let Some(map) = map {
                    agv.motion.set_map(map.clone());
                }
            });
    tolerance "altered-joint-rejected" ["ORD-UPD-07"] "It rejects an update whose stitching node has an action that it did not have before."
        => objecting(|agv, order, relation| {
            let first = &order.nodes[0];
            let mut actions = first.actions.iter().filter(|_| relation == Relation::Update && agv.joins(first));
            let altered = actions.find(|action| agv.actions.get(&action.id).is_none())?;
            let reason = "the stitching node has another action than before";
            Some(Refusal::at_field(Rule::Unable, reason, &altered.path).naming("actionId", &altered.id))
        });
}

/// Whether the edges of the base are one less than its nodes, and a horizon follows.
fn counts_in_base(order: &Order) -> bool {
    let nodes = order.nodes.iter().filter(|node| node.released).count();
    let edges = order.edges.iter().filter(|edge| edge.released).count();
    nodes < order.nodes.len() && edges + 1 == nodes
}

/// Whether it stands where an order begins, on whatever map.
fn begins_here(agv: &Agv, what: Permission<'_>) -> bool {
    let Permission::BeginAt(node) = what else { return false };
    let range = node.position.as_ref().and_then(|position| position.allowed_deviation);
    agv.is_within(node, range.unwrap_or(0.0), false)
}
