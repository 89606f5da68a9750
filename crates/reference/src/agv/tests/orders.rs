use super::*;

#[test]
fn a_new_order_is_taken_over_and_driven_to_the_end_of_its_base() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3 | n4"));
    let state = bench.state();
    assert_eq!((&state["orderId"], &state["orderUpdateId"]), (&json!("o1"), &json!(0)));
    assert_eq!(ids(&state["nodeStates"], "nodeId"), ["n2", "n3", "n4"]);
    assert_eq!(ids(&state["edgeStates"], "edgeId"), ["n1-n2", "n2-n3", "n3-n4"]);
    assert_eq!(state["driving"], true);
    bench.wait(60.0);
    let state = bench.state();
    assert_eq!(bench.trail(), ["n1/0", "n2/2", "n3/4"]);
    assert_eq!(ids(&state["nodeStates"], "nodeId"), ["n4"]);
    assert_eq!(state["nodeStates"][0]["released"], false);
    assert_eq!(
        (&state["driving"], &state["newBaseRequest"]),
        (&json!(false), &json!(true))
    );
}

#[test]
fn a_completed_order_leaves_empty_states_and_keeps_its_ids() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(10.0);
    let state = bench.state();
    assert_eq!((&state["nodeStates"], &state["edgeStates"]), (&json!([]), &json!([])));
    assert_eq!((&state["orderId"], &state["lastNodeId"]), (&json!("o1"), &json!("n2")));
    assert_eq!(state["newBaseRequest"], false);
}

#[test]
fn one_node_is_enough_for_an_order() {
    let mut bench = Bench::new();
    let beep = action("beep", "a1", "NONE", json!({}));
    bench.order(with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", beep));
    assert_eq!(bench.status("a1"), "RUNNING");
    bench.wait(1.0);
    assert_eq!(bench.status("a1"), "FINISHED");
    assert_eq!(bench.state()["nodeStates"], json!([]));
}

#[test]
fn row_2_a_new_order_while_driving_is_refused_and_the_old_one_goes_on() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(0.5);
    bench.order(order("o2", 0, 0, "n1 n2"));
    assert_eq!(bench.state()["orderId"], "o1");
    assert_eq!(bench.error_types(), ["orderError"]);
    assert_eq!(bench.reference("orderId").as_deref(), Some("o2"));
    bench.wait(10.0);
    assert_eq!(bench.trail(), ["n1/0", "n2/2", "n3/4"]);
}

#[test]
fn row_2_an_action_or_a_horizon_keeps_the_vehicle_busy() {
    let mut bench = Bench::new();
    let wait = action("waitForTrigger", "w", "HARD", json!({ "triggerType": "button" }));
    bench.order(with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", wait));
    bench.order(order("o2", 0, 0, "n1 n2"));
    assert_eq!(bench.state()["orderId"], "o1");

    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 | n3"));
    bench.wait(20.0);
    bench.order(order("o2", 0, 0, "n2 n1"));
    assert_eq!(bench.state()["orderId"], "o1");
    assert_eq!(bench.error_types().len(), 1);
}

#[test]
fn row_3_a_first_node_out_of_reach_is_refused_without_motion() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n3 n4"));
    bench.wait(5.0);
    let state = bench.state();
    assert_eq!((&state["orderId"], &state["lastNodeId"]), (&json!(""), &json!("n1")));
    assert_eq!(bench.error_types(), ["noRouteError"]);
    assert!(bench.states().iter().all(|state| state["driving"] == false));
}

#[test]
fn row_4_a_first_node_counts_as_reached_inside_its_deviation() {
    for (deviation, accepted) in [(json!(3.5), true), (json!(2.0), false), (json!(0.0), false)] {
        let mut bench = Bench::new();
        let position = json!({ "x": 3.0, "y": 0.0, "mapId": "hall", "allowedDeviationXY": deviation });
        bench.order(with(order("o1", 0, 0, "n2 n3"), "/nodes/0/nodePosition", position));
        assert_eq!(bench.state()["orderId"] == "o1", accepted, "{deviation}");
    }
}

#[test]
fn row_4_the_states_of_the_old_order_go_and_running_instant_actions_stay() {
    let mut bench = Bench::new();
    let beep = action("beep", "a1", "NONE", json!({}));
    bench.order(with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", beep));
    bench.instant("stateRequest", "i1", json!({}));
    bench.instant("beep", "i2", json!({ "duration": 60 }));
    bench.wait(1.0);
    assert_eq!(ids(&bench.state()["actionStates"], "actionId"), ["a1", "i1", "i2"]);
    bench.order(order("o2", 0, 0, "n1 n2"));
    assert_eq!(bench.state()["orderId"], "o2");
    assert_eq!(ids(&bench.state()["actionStates"], "actionId"), ["i2"]);
}

#[test]
fn row_5_an_outdated_update_is_refused_and_named() {
    let mut bench = Bench::new();
    bench.order(order("o1", 3, 0, "n1 n2 | n3"));
    bench.order(order("o1", 2, 0, "n1 n2 | n3"));
    assert_eq!(bench.error_types(), ["orderUpdateError"]);
    assert_eq!(bench.reference("orderUpdateId").as_deref(), Some("2"));
    assert_eq!(bench.state()["errors"][0]["errorLevel"], "WARNING");
    assert_eq!(bench.state()["orderUpdateId"], 3);
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
    assert!(bench.error_types().is_empty());
}

#[test]
fn row_6_an_order_that_comes_twice_is_ignored_but_answered_with_a_state() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.2);
    let before = bench.states().len();
    bench.order(order("o1", 0, 0, "n1 n2"));
    assert_eq!(bench.states().len(), before + 1);
    assert!(bench.error_types().is_empty());
    bench.wait(5.0);
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(5.0);
    assert_eq!(bench.trail(), ["n1/0", "n2/2"]);
    assert!(bench.error_types().is_empty());
}

#[test]
fn row_7_an_update_of_a_running_order_begins_at_the_decision_point() {
    for (from, route) in [(4, "n3 n4"), (0, "n1 n2 n3"), (4, "n2 n3")] {
        let mut bench = Bench::new();
        bench.order(order("o1", 0, 0, "n1 n2 | n3"));
        bench.order(order("o1", 1, from, route));
        assert_eq!(bench.state()["orderUpdateId"], 0, "{route}");
        assert_eq!(bench.error_types(), ["orderUpdateError"], "{route}");
        assert_eq!(bench.reference("orderUpdateId").as_deref(), Some("1"));
        assert_eq!(ids(&bench.state()["nodeStates"], "nodeId"), ["n2", "n3"]);
    }
}

#[test]
fn row_8_an_update_extends_the_base_and_replaces_the_horizon() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 | n3 n4"));
    bench.order(order("o1", 1, 2, "n2 n5 | n6"));
    let state = bench.state();
    assert_eq!(state["orderUpdateId"], 1);
    assert_eq!(ids(&state["nodeStates"], "nodeId"), ["n2", "n5", "n6"]);
    assert_eq!(ids(&state["edgeStates"], "edgeId"), ["n1-n2", "n2-n5", "n5-n6"]);
    bench.wait(20.0);
    assert_eq!(bench.trail(), ["n1/0", "n2/2", "n5/4"]);
    bench.order(order("o1", 2, 4, "n5"));
    assert_eq!(bench.state()["nodeStates"], json!([]));
    assert_eq!(bench.state()["orderUpdateId"], 2);
}

#[test]
fn row_8_actions_of_a_removed_horizon_go_with_it() {
    let mut bench = Bench::new();
    let beep = action("beep", "h1", "NONE", json!({}));
    bench.order(with(
        order("o1", 0, 0, "n1 n2 | n3"),
        "/nodes/2/actions/-",
        beep.clone(),
    ));
    assert_eq!(bench.status("h1"), "WAITING");
    bench.order(order("o1", 1, 2, "n2"));
    assert_eq!(bench.status("h1"), "absent");
    bench.order(with(order("o1", 2, 2, "n2 n3"), "/nodes/1/actions/-", beep));
    assert_eq!(bench.status("h1"), "WAITING");
}

#[test]
fn row_9_and_10_a_completed_order_continues_where_it_ended() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(10.0);
    bench.order(order("o1", 1, 0, "n2 n3"));
    assert_eq!(bench.state()["orderUpdateId"], 0);
    assert_eq!(bench.error_types(), ["orderUpdateError"]);
    bench.order(order("o1", 1, 2, "n2 n3"));
    assert_eq!(bench.state()["orderUpdateId"], 1);
    bench.wait(10.0);
    assert_eq!(bench.trail(), ["n1/0", "n2/2", "n3/4"]);
}

#[test]
fn what_an_update_says_about_the_stitching_node_is_ignored() {
    let mut bench = Bench::new();
    let first = action("beep", "s1", "NONE", json!({}));
    bench.order(with(order("o1", 0, 0, "n1 n2 | n3"), "/nodes/1/actions/-", first));
    let other = action("beep", "s2", "NONE", json!({}));
    bench.order(with(order("o1", 1, 2, "n2 n3"), "/nodes/0/actions/-", other));
    bench.wait(20.0);
    assert_eq!(
        (bench.status("s1"), bench.status("s2")),
        ("FINISHED".into(), "absent".into())
    );
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn a_loop_is_reported_visit_by_visit() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n5 n6 n1 n2"));
    bench.wait(60.0);
    assert_eq!(bench.trail(), ["n1/0", "n2/2", "n5/4", "n6/6", "n1/8", "n2/10"]);
}

#[test]
fn orders_are_taken_in_automatic_modes_only() {
    for (mode, accepted) in [
        ("AUTOMATIC", true),
        ("SEMIAUTOMATIC", true),
        ("MANUAL", false),
        ("SERVICE", false),
        ("TEACHIN", false),
    ] {
        let mut bench = Bench::new();
        bench.command("set-mode", json!({ "mode": mode }));
        assert_eq!(bench.state()["operatingMode"], mode);
        bench.order(order("o1", 0, 0, "n1 n2"));
        assert_eq!(bench.state()["orderId"] == "o1", accepted, "{mode}");
    }
}

#[test]
fn an_order_from_a_temporary_node_between_nodes_is_accepted() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.7);
    bench.instant("cancelOrder", "c", json!({}));
    let position = bench.state()["agvPosition"].clone();
    let here = json!({ "x": position["x"], "y": position["y"], "mapId": "hall" });
    bench.order(with(order("o2", 0, 0, "somewhere n3"), "/nodes/0/nodePosition", here));
    assert_eq!(bench.state()["orderId"], "o2");
    assert_eq!(bench.state()["lastNodeId"], "somewhere");
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n3");
}
