use serde_json::{Value, json};

use crate::trace::{Trace, merged};

/// Nodes and edges over `names` from `from`; the first `base` nodes are released.
fn route(names: &[&str], from: usize, base: usize) -> (Vec<Value>, Vec<Value>) {
    let nodes = (0..names.len())
        .map(|at| json!({ "nodeId": names[at], "sequenceId": from + 2 * at, "released": at < base }))
        .collect();
    let edges = (1..names.len())
        .map(|at| json!({ "edgeId": format!("{}-{}", names[at - 1], names[at]), "sequenceId": from + 2 * at - 1, "released": at < base }))
        .collect();
    (nodes, edges)
}

fn order(update: u64, names: &[&str], from: usize, base: usize) -> Value {
    let (nodes, edges) = route(names, from, base);
    json!({ "orderId": "o", "orderUpdateId": update, "nodes": nodes, "edges": edges })
}

fn state(update: u64, last: (&str, u64), names: &[&str], from: usize, base: usize) -> Value {
    let (nodes, edges) = route(names, from, base);
    json!({
        "orderId": "o", "orderUpdateId": update, "lastNodeId": last.0, "lastNodeSequenceId": last.1,
        "nodeStates": nodes, "edgeStates": edges,
    })
}

/// A state that has left `names[0]` at `from`: what remains is the rest and the edge towards it.
fn under_way(update: u64, names: &[&str], from: usize, base: usize) -> Value {
    let mut state = state(update, (names[0], from as u64), names, from, base);
    state["nodeStates"].as_array_mut().unwrap().remove(0);
    state
}

fn route_of(build: impl Fn(&mut Trace)) -> Vec<String> {
    let mut trace = Trace::subscriber();
    trace.state(&json!({ "lastNodeId": "a", "lastNodeSequenceId": 4 }));
    build(&mut trace);
    trace.judge("state/remaining-route").summary()
}

#[test]
fn the_remainder_of_an_order_with_horizon_and_update_is_right() {
    let outcome = route_of(|trace| {
        trace
            .sent("order", &order(0, &["a", "b", "a"], 0, 2))
            // Not accepted yet: an old state.
            .state(&json!({ "lastNodeId": "a", "lastNodeSequenceId": 4 }))
            // Accepted; the last node still carries the number of the old order, which the new one has, too.
            .state(&state(0, ("a", 4), &["a", "b", "a"], 0, 2))
            .state(&state(0, ("a", 0), &["a", "b", "a"], 0, 2))
            .state(&under_way(0, &["a", "b", "a"], 0, 2))
            .sent("order", &order(1, &["b", "c", "d"], 2, 2))
            // The stitching node is still ahead, with the edge that leads to it.
            .state(&merged(under_way(1, &["a", "b", "c", "d"], 0, 3), &json!({})))
            .state(&under_way(1, &["b", "c", "d"], 2, 2))
            .state(&under_way(1, &["c", "d"], 4, 1));
    });
    assert_eq!(outcome, Vec::<String>::new());
}

#[test]
fn the_edge_just_left_may_go_one_state_later() {
    let outcome = route_of(|trace| {
        trace.sent("order", &order(0, &["a", "b", "c"], 0, 3));
        let mut late = under_way(0, &["b", "c"], 2, 2);
        let edge = json!({ "edgeId": "a-b", "sequenceId": 1, "released": true });
        late["edgeStates"].as_array_mut().unwrap().insert(0, edge);
        trace.state(&under_way(0, &["a", "b", "c"], 0, 3)).state(&late);
    });
    assert_eq!(outcome, Vec::<String>::new());
}

#[test]
fn missing_surplus_swapped_and_wrongly_released_elements_are_found() {
    let with = |change: fn(&mut Value)| {
        route_of(|trace| {
            trace.sent("order", &order(0, &["a", "b", "c"], 0, 2));
            let mut state = under_way(0, &["a", "b", "c"], 0, 2);
            change(&mut state);
            trace.state(&state);
        })
    };
    assert_eq!(with(|_| {}), Vec::<String>::new());
    // The horizon is left out.
    let lacks = with(|state| {
        state["nodeStates"].as_array_mut().unwrap().pop();
    });
    assert_eq!(lacks, ["STATE-12"]);
    let surplus = with(|state| {
        let more = json!({ "nodeId": "d", "sequenceId": 6, "released": false });
        state["nodeStates"].as_array_mut().unwrap().push(more);
    });
    assert_eq!(surplus, ["STATE-12"]);
    assert_eq!(
        with(|state| state["nodeStates"].as_array_mut().unwrap().reverse()),
        ["STATE-12"]
    );
    assert_eq!(
        with(|state| state["nodeStates"][1]["released"] = json!(true)),
        ["STATE-MSG-13"]
    );
    assert_eq!(with(|state| state["edgeStates"] = json!([])), ["STATE-12", "STATE-12"]);
}

#[test]
fn a_node_that_is_reached_and_still_listed_is_a_remark() {
    let outcome = route_of(|trace| {
        trace.sent("order", &order(0, &["a", "b", "c"], 0, 3));
        trace.state(&under_way(0, &["a", "b", "c"], 0, 3));
        trace.state(&state(0, ("b", 2), &["b", "c"], 2, 2));
    });
    assert_eq!(outcome, ["NODE-03 warning"]);
}

#[test]
fn a_traversal_told_in_two_states_is_a_remark_and_a_lost_node_is_not() {
    let told = |second: Value| {
        route_of(|trace| {
            trace.sent("order", &order(0, &["a", "b", "c"], 0, 3));
            trace.state(&under_way(0, &["a", "b", "c"], 0, 3));
            let early = json!({ "lastNodeId": "a", "lastNodeSequenceId": 0 });
            trace.state(&merged(under_way(0, &["b", "c"], 2, 2), &early));
            trace.state(&second);
        })
    };
    assert_eq!(told(under_way(0, &["b", "c"], 2, 2)), ["NODE-03 warning"]);
    let still = json!({ "lastNodeId": "a", "lastNodeSequenceId": 0 });
    let lost = told(merged(under_way(0, &["b", "c"], 2, 2), &still));
    assert_eq!(lost, ["STATE-12", "STATE-12"]);
}

#[test]
fn nothing_is_held_against_a_cancelled_or_a_refused_order() {
    let outcome = route_of(|trace| {
        trace.sent("order", &order(0, &["a", "b", "c"], 0, 3));
        trace.state(&under_way(0, &["a", "b", "c"], 0, 3));
        trace.instant("cancelOrder", "x", &json!([]));
        trace.state(&json!({ "orderId": "o", "lastNodeId": "a" }));
        trace.sent(
            "order",
            &json!({ "orderId": "p", "orderUpdateId": 0, "nodes": [], "edges": [] }),
        );
        trace.state(&json!({ "orderId": "p", "lastNodeId": "a" }));
    });
    assert_eq!(outcome, Vec::<String>::new());
}

#[test]
fn a_refused_update_leaves_no_trace_in_what_is_required() {
    let outcome = route_of(|trace| {
        trace.sent("order", &order(0, &["a", "b", "c"], 0, 2));
        trace.state(&under_way(0, &["a", "b", "c"], 0, 2));
        // Starts at the wrong node, is refused; the next one is right.
        trace.sent("order", &order(1, &["x", "y"], 0, 2));
        trace.sent("order", &order(2, &["b", "c"], 2, 2));
        trace.state(&under_way(2, &["a", "b", "c"], 0, 3));
    });
    assert_eq!(outcome, Vec::<String>::new());
}

fn last_nodes(base: usize, visits: &[(&str, u64)]) -> Vec<String> {
    let mut trace = Trace::subscriber();
    trace.state(&json!({ "lastNodeId": "a", "lastNodeSequenceId": 8 }));
    trace.sent("order", &order(0, &["a", "b", "c"], 0, base));
    for (node, sequence) in visits {
        trace.state(&json!({ "orderId": "o", "lastNodeId": node, "lastNodeSequenceId": sequence }));
    }
    trace.judge("state/last-node").summary()
}

#[test]
fn progress_in_sequence_is_right() {
    assert!(last_nodes(3, &[("a", 8), ("a", 0), ("b", 2), ("c", 4)]).is_empty());
    assert!(last_nodes(3, &[("a", 0), ("c", 4)]).is_empty());
}

#[test]
fn a_number_of_the_order_before_is_not_held_against_the_first_node_of_the_next() {
    let mut trace = Trace::subscriber();
    trace.sent("order", &order(0, &["a", "b", "c"], 0, 3));
    // Accepted, while the last node is still that of an older order, with a number that occurs in this one too.
    let nodes = |from: u64| json!([{ "nodeId": "c", "sequenceId": from, "released": true }]);
    trace.state(&json!({ "orderId": "o", "lastNodeId": "b", "lastNodeSequenceId": 2, "nodeStates": nodes(2) }));
    trace.state(&json!({ "orderId": "o", "lastNodeId": "a", "lastNodeSequenceId": 0, "nodeStates": nodes(4) }));
    assert!(trace.judge("state/last-node").summary().is_empty());
}

#[test]
fn going_back_entering_the_horizon_and_inventing_numbers_are_found() {
    assert_eq!(last_nodes(3, &[("a", 0), ("c", 4), ("b", 2)]), ["ORD-01"]);
    assert_eq!(last_nodes(2, &[("a", 0), ("b", 2), ("c", 4)]), ["ORD-07"]);
    assert_eq!(last_nodes(3, &[("a", 0), ("b", 3)]), ["STATE-MSG-04"]);
    assert_eq!(last_nodes(3, &[("a", 0), ("z", 2)]), ["STATE-MSG-04 warning"]);
    assert_eq!(last_nodes(3, &[("", 5)]), ["STATE-MSG-04"]);
}
