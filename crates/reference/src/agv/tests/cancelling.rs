use super::*;

fn vehicle(interruptible: bool, stops_between_nodes: bool) -> Bench {
    let mut bench = Bench::with(
        AgvConfig {
            interruptible,
            stops_between_nodes,
            ..config()
        },
        &[],
    );
    let long = action("beep", "run", "NONE", json!({ "duration": 3 }));
    let later = action("beep", "later", "NONE", json!({}));
    let order = with(order("o1", 0, 0, "n1 n2 n3 | n4"), "/nodes/0/actions/-", long);
    bench.order(with(order, "/nodes/1/actions/-", later));
    bench.wait(0.5);
    bench.instant("cancelOrder", "c", json!({}));
    bench
}

fn assert_over(bench: &Bench, last_node: &str) {
    let state = bench.state();
    assert_eq!((&state["nodeStates"], &state["edgeStates"]), (&json!([]), &json!([])));
    assert_eq!((&state["orderId"], &state["driving"]), (&json!("o1"), &json!(false)));
    assert_eq!(
        (bench.status("c"), bench.status("later")),
        ("FINISHED".into(), "FAILED".into())
    );
    assert_eq!(state["lastNodeId"], last_node);
}

#[test]
fn interruptible_and_stopping_anywhere_it_is_over_at_once() {
    let mut bench = vehicle(true, true);
    assert_over(&bench, "n1");
    assert_eq!(bench.status("run"), "FAILED");
    bench.wait(60.0);
    assert!((bench.state()["agvPosition"]["x"].as_f64().unwrap() - 1.0).abs() < 1e-6);
}

#[test]
fn uninterruptible_actions_run_to_their_end() {
    let mut bench = vehicle(false, true);
    assert_eq!(
        (bench.status("c"), bench.status("run"), bench.status("later")),
        ("RUNNING".into(), "RUNNING".into(), "FAILED".into())
    );
    assert_eq!(bench.state()["driving"], false);
    bench.wait(2.4);
    assert_eq!(bench.status("c"), "RUNNING");
    bench.wait(0.2);
    assert_over(&bench, "n1");
    assert_eq!(bench.status("run"), "FINISHED");
}

#[test]
fn a_vehicle_bound_to_nodes_drives_to_the_next_one() {
    let mut bench = vehicle(true, false);
    let state = bench.state();
    assert_eq!(
        (bench.status("c"), bench.status("run")),
        ("RUNNING".into(), "FAILED".into())
    );
    assert_eq!(ids(&state["nodeStates"], "nodeId"), ["n2"]);
    assert_eq!((&state["edgeStates"], &state["driving"]), (&json!([]), &json!(true)));
    bench.wait(1.0);
    assert_over(&bench, "n2");
    assert_eq!(bench.state()["lastNodeSequenceId"], 2);
}

#[test]
fn a_vehicle_bound_to_nodes_also_awaits_its_actions() {
    let mut bench = vehicle(false, false);
    bench.wait(1.0);
    let state = bench.state();
    assert_eq!((&state["lastNodeId"], &state["driving"]), (&json!("n2"), &json!(false)));
    assert_eq!(
        (bench.status("c"), bench.status("run")),
        ("RUNNING".into(), "RUNNING".into())
    );
    bench.wait(2.0);
    assert_over(&bench, "n2");
    assert_eq!(bench.status("run"), "FINISHED");
}

#[test]
fn a_new_order_is_accepted_after_every_kind_of_cancellation() {
    for (interruptible, stops) in [(true, true), (false, true), (true, false), (false, false)] {
        let mut bench = vehicle(interruptible, stops);
        bench.wait(10.0);
        let here = bench.state();
        let (node, x, y) = (
            &here["lastNodeId"],
            &here["agvPosition"]["x"],
            &here["agvPosition"]["y"],
        );
        let position = json!({ "x": x, "y": y, "mapId": "hall", "allowedDeviationXY": 5.0 });
        let route = format!("{} n3", node.as_str().unwrap());
        bench.order(with(order("o2", 0, 0, &route), "/nodes/0/nodePosition", position));
        assert_eq!(bench.state()["orderId"], "o2");
        assert_eq!(bench.state()["actionStates"], json!([]));
        bench.wait(10.0);
        assert_eq!(bench.state()["lastNodeId"], "n3");
    }
}

#[test]
fn the_last_node_with_an_enlarged_deviation_counts_as_traversed() {
    let mut bench = vehicle(true, true);
    let position = json!({ "x": 0.0, "y": 0.0, "mapId": "hall", "allowedDeviationXY": 2.0 });
    bench.order(with(order("o2", 0, 0, "n1 n2"), "/nodes/0/nodePosition", position));
    assert_eq!(bench.state()["orderId"], "o2");
    assert_eq!(ids(&bench.state()["nodeStates"], "nodeId"), ["n2"]);
    bench.wait(0.9);
    assert_eq!(bench.state()["lastNodeId"], "n1");
    bench.wait(0.2);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn without_an_order_there_is_nothing_to_cancel() {
    let mut never = Bench::new();
    let mut done = Bench::new();
    done.order(order("o1", 0, 0, "n1 n2"));
    done.wait(10.0);
    let mut cancelled = vehicle(true, true);
    for bench in [&mut never, &mut done, &mut cancelled] {
        bench.instant("cancelOrder", "x", json!({}));
        assert_eq!(bench.status("x"), "FAILED");
        assert_eq!(bench.error_types(), ["noOrderToCancel"]);
        assert_eq!(bench.state()["errors"][0]["errorLevel"], "WARNING");
        assert_eq!(bench.reference("actionId").as_deref(), Some("x"));
    }
}

#[test]
fn a_second_cancel_order_fails_while_the_first_one_runs_and_ends() {
    let mut bench = vehicle(false, false);
    bench.instant("cancelOrder", "x", json!({}));
    assert_eq!(
        (bench.status("c"), bench.status("x")),
        ("RUNNING".into(), "FAILED".into())
    );
    bench.wait(10.0);
    assert_eq!(bench.status("c"), "FINISHED");
}

#[test]
fn an_order_that_waits_at_its_decision_point_can_be_cancelled() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 | n3"));
    bench.wait(10.0);
    bench.instant("cancelOrder", "c", json!({}));
    assert_eq!(bench.status("c"), "FINISHED");
    assert_eq!(bench.state()["nodeStates"], json!([]));
}

#[test]
fn wait_for_trigger_and_paused_actions_fail_even_where_others_cannot_be_interrupted() {
    let mut bench = Bench::with(
        AgvConfig {
            interruptible: false,
            ..config()
        },
        &[],
    );
    let wait = action("waitForTrigger", "w", "HARD", json!({ "triggerType": "t" }));
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/0/actions/-", wait));
    bench.instant("cancelOrder", "c", json!({}));
    assert_eq!(
        (bench.status("w"), bench.status("c")),
        ("FAILED".into(), "FINISHED".into())
    );
}

#[test]
fn a_calibration_is_never_interrupted() {
    let mut bench = Bench::new();
    let calibrate = action("calibrate", "k", "HARD", json!({ "duration": 5 }));
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/0/actions/-", calibrate));
    bench.instant("cancelOrder", "c", json!({}));
    bench.wait(4.0);
    assert_eq!(
        (bench.status("k"), bench.status("c")),
        ("RUNNING".into(), "RUNNING".into())
    );
    bench.wait(2.0);
    assert_eq!(
        (bench.status("k"), bench.status("c")),
        ("FINISHED".into(), "FINISHED".into())
    );
}

#[test]
fn an_update_after_the_cancellation_is_refused() {
    let mut bench = vehicle(true, true);
    bench.order(order("o1", 1, 4, "n3 n4"));
    bench.order(order("o1", 2, 0, "n1 n2"));
    assert_eq!(bench.error_types(), ["orderUpdateError", "orderUpdateError"]);
    assert_eq!(bench.state()["orderUpdateId"], 0);
}
