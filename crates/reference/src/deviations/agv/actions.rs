//! Deviations of what a state says about actions (section 6.10.6).

use super::prelude::*;

records! {
    fault "action-states-omitted-when-empty" ["STATE-MSG-01", "STATE-01"] "It leaves actionStates out of the state when there are none."
        => state(|_, m| if m.says("actionStates", json!([])) { m.unset("actionStates") });
    fault "instant-action-listed-twice" ["STATE-MSG-09"] "Lists instant actions twice."
        => state(|agv, m| {
            let shown = m.list("actionStates").to_vec();
            let twice = |state: &Value| {
                let id = state["actionId"].as_str().unwrap_or_default();
                agv.actions.get(id).is_some_and(|action| !action.of_order())
            };
            let doubled = shown.into_iter().flat_map(|state| {
                let times = if twice(&state) { 2 } else { 1 };
                std::iter::repeat_n(state, times)
            });
            m.set("actionStates", doubled.collect::<Vec<_>>());
        });
    fault "far-actions-unlisted" ["ASTATE-01", "ORD-FLOW-06", "STATE-MSG-09"] "It lists the actions of a node or edge only once that node, or the node the edge leads to, is the next one."
        => action(|agv, action, _| {
            let next = agv.order.nodes.front().map_or(u32::MAX, |stop| stop.node.sequence_id);
            !is_behind(action, next)
        });
    fault "horizon-actions-missing" ["ASTATE-01"] "Lists the actions of the horizon only when they are released."
        => action(|agv, action, _| !is_behind(action, agv.order.base_end.1));
    fault "instant-action-unlisted" ["IACT-03", "STATE-MSG-09", "ORD-CANCEL-18"] "Performs instant actions without an action state."
        => action(|_, action, _| action.of_order());
    fault "failed-instant-unlisted" ["IACT-03", "STATE-MSG-09"] "It does not list instant actions that have failed."
        => action(|_, action, _| action.of_order() || action.status != Status::Failed);
    fault "edge-actions-unlisted" ["ASTATE-01"] "Lists the actions of an edge only when they begin."
        => action(|_, action, _| !matches!(action.origin, Origin::Edge(_)) || action.status != Status::Waiting);
    fault "single-node-action-unlisted" ["ASTATE-01"] "Does not list the actions of orders with one node."
        => action(|agv, action, _| !action.of_order() || agv.order.base_end.1 != 0);

    fault "running-from-start" ["ASTATE-02"] "Reports all actions RUNNING when the order is accepted."
        => action(|_, _, m| say(m, "WAITING", "RUNNING"));
    fault "initializing-from-start" ["ASTATE-03", "ASTATE-02"] "Reports all actions INITIALIZING when the order is accepted."
        => action(|_, _, m| say(m, "WAITING", "INITIALIZING"));
    fault "pick-prepared-as-running" ["ACT-33", "ASTATE-02"] "Reports a pick RUNNING while it only prepares for it."
        => action(|_, action, m| {
            let picks = action.kind.is_some_and(|kind| kind.effect == Effect::Pick);
            !picks || say(m, "WAITING", "RUNNING") && say(m, "INITIALIZING", "RUNNING")
        });
    fault "paused-without-pause" ["ASTATE-04"] "Reports actions PAUSED that only wait for others."
        => action(|agv, action, m| {
            let waits_here = action.origin == Origin::Node(agv.order.last_sequence) && !agv.holds.any();
            !waits_here || say(m, "WAITING", "PAUSED")
        });
    fault "pause-marks-waiting-actions-paused" ["ASTATE-05", "ASTATE-02"] "It reports actions that are still WAITING for their node as PAUSED during a pause."
        => action(|agv, action, m| !action.of_order() || !agv.holds.pause || say(m, "WAITING", "PAUSED"));
    fault "next-node-actions-initializing" ["ASTATE-02", "ASTATE-03"] "The actions of the node ahead are reported INITIALIZING from when the edge before it is entered."
        => action(|agv, action, m| !is_next(agv, action) || say(m, "WAITING", "INITIALIZING"));
    fault "paused-at-decision-point" ["ASTATE-04", "ASTATE-02"] "While the vehicle waits at the decision point it reports the actions of its horizon PAUSED."
        => action(|agv, action, m| {
            let held = is_behind(action, agv.order.base_end.1) && agv.waits_at_decision_point();
            !held || say(m, "WAITING", "PAUSED")
        });
    fault "cancel-shows-paused" ["ORD-CANCEL-05"] "An action that cannot be interrupted is reported PAUSED while the cancellation waits for it."
        because "ORD-CANCEL-05, that the action stays RUNNING, is a recommendation; PAUSED is a fault where it lasts though nothing holds the vehicle."
        => action(|agv, action, m| !action.of_order() || agv.order.cancel.is_none() || say(m, "RUNNING", "PAUSED"));
    fault "status-done" ["STATE-MSG-14", "ASTATE-05", "ACT-13"] "Says DONE where FINISHED is meant."
        => action(|_, _, m| say(m, "FINISHED", "DONE"));
    fault "initializing-spelled-british" ["STATE-MSG-14"] "It writes the actionStatus INITIALIZING as INITIALISING."
        => action(|_, _, m| say(m, "INITIALIZING", "INITIALISING"));
    fault "status-lower-case" ["STATE-MSG-14", "JSON-02", "JSON-10"] "Spells the statuses of actions in lower case."
        => action(|_, _, m| {
            text(m, "actionStatus", str::to_ascii_lowercase);
            true
        });
    fault "action-id-truncated" ["STATE-MSG-14", "STATE-MSG-09"] "The action states cut every actionId after 32 characters."
        => action(|_, _, m| {
            text(m, "actionId", |id| id.chars().take(32).collect());
            true
        });
}

/// Says another status in place of one, and lists the action all the same.
fn say(state: &mut Object, status: &str, instead: &str) -> bool {
    if state.says("actionStatus", status) {
        state.set("actionStatus", instead);
    }
    true
}

/// Whether the action belongs to a node or an edge behind this sequenceId.
fn is_behind(action: &Action, sequence_id: u32) -> bool {
    match action.origin {
        Origin::Node(own) | Origin::Edge(own) => own > sequence_id,
        Origin::Instant | Origin::Zone(_) => false,
    }
}

/// Whether the vehicle is on its way to the node of this action.
fn is_next(agv: &Agv, action: &Action) -> bool {
    let next = agv.order.nodes.front().map(|stop| stop.node.sequence_id);
    agv.order.entered && next.is_some_and(|next| action.origin == Origin::Node(next))
}
