//! What one state says of a vehicle at rest: whether it has an order, drives, or is held.

use tck_view::{ActionState, StateView};

/// Whether it lists nodes or edges of an order.
#[must_use]
pub fn has_order(state: &StateView) -> bool {
    !state.node_states.is_empty() || !state.edge_states.is_empty()
}

/// Whether it shows no order and no motion.
#[must_use]
pub fn is_idle(state: &StateView) -> bool {
    !has_order(state) && !state.driving.is(true)
}

/// Whether a node ahead is released.
#[must_use]
pub fn may_drive(state: &StateView) -> bool {
    state.node_states.iter().any(|node| node.released.is(true))
}

/// The actions that are not over.
pub fn open_actions(state: &StateView) -> impl Iterator<Item = &ActionState> {
    state.all_action_states().filter(|action| !action.is_over())
}

/// Whether it reports an emergency stop, in whatever word.
#[must_use]
pub fn is_stopped(state: &StateView) -> bool {
    state.emergency_stop().is_some_and(|stop| stop != "NONE")
}

/// x and y as they are written, whether the vehicle vouches for them or not: to look for it, not to judge it.
#[must_use]
pub fn place(state: &StateView) -> Option<(f64, f64)> {
    let spot = state.spot()?;
    Some((spot.x, spot.y))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use serde_json::{Value, json};
    use tck_view::{MessageView, Names, Topic};

    use super::*;

    fn state(message: &Value) -> Arc<StateView> {
        let view = MessageView::of_value(Topic::State, message, &Names::default());
        Arc::clone(view.state().unwrap())
    }

    #[test]
    fn a_vehicle_with_nodes_or_in_motion_is_not_idle() {
        assert!(is_idle(&state(&json!({}))), "what is missing is no order");
        assert!(is_idle(&state(
            &json!({ "nodeStates": [], "edgeStates": [], "driving": false })
        )));
        assert!(!is_idle(&state(&json!({ "edgeStates": [{}] }))));
        assert!(!is_idle(&state(&json!({ "driving": true }))));
    }

    #[test]
    fn an_action_without_a_known_end_is_open() {
        let actions = json!({ "actionStates": [
            { "actionId": "a", "actionStatus": "FINISHED" },
            { "actionId": "b", "actionStatus": "finished" },
            { "actionId": "c" },
        ] });
        let state = state(&actions);
        let open: Vec<&str> = open_actions(&state).map(|action| action.action_id.or_empty()).collect();
        assert_eq!(open, ["b", "c"]);
    }
}
