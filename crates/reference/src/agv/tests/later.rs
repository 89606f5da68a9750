//! What later versions ask of a vehicle beside what all do: names, lists, retries, orders told apart.

use tck_view::Names;

use super::*;

/// A vehicle with all that is switched on later, and with another name for what it is told and tells.
fn robot(faults: &[&str]) -> Bench {
    let mut config = config();
    let further = [
        "instantActionStates",
        "retry",
        "singleBlocking",
        "strictUpdates",
        "cancelByOrderId",
    ];
    config.features.extend(further.map(str::to_owned));
    config.names = serde_json::from_value::<Names>(json!({
        "state": { "agvPosition": "place", "instantActionStates": true },
        "position": { "positionInitialized": "sure" },
        "action": { "retriable": true },
        "edge": { "startNodeId": false, "endNodeId": false, "maxSpeed": "fastest" },
    }))
    .unwrap();
    config.errors.same_update = "same".into();
    config.errors.after_cancel = "late".into();
    Bench::with(config, faults)
}

fn listed(bench: &Bench, list: &str) -> Vec<String> {
    ids(&bench.state()[list], "actionId")
}

/// An order without the ends of its edges.
fn plain_order(update: u32, from: u32, route: &str) -> Value {
    let mut order = order("o1", update, from, route);
    for edge in order["edges"].as_array_mut().unwrap() {
        edge.as_object_mut().unwrap().remove("startNodeId");
        edge.as_object_mut().unwrap().remove("endNodeId");
    }
    order
}

#[test]
fn members_go_by_the_names_of_the_version() {
    let mut bench = robot(&[]);
    let state = bench.state();
    assert!(state.get("agvPosition").is_none());
    assert_eq!(state["place"]["sure"], json!(true));
    bench.order(plain_order(0, 0, "n1 n2"));
    bench.wait(60.0);
    assert_eq!(bench.state()["lastNodeId"], "n2", "an edge lies between its neighbours");
    bench.order(with(plain_order(1, 2, "n2 n3"), "/edges/0/fastest", json!(-1)));
    assert_eq!(bench.error_types(), ["validationError"]);
    assert_eq!(bench.reference("field").as_deref(), Some("edges[0].fastest"));
}

#[test]
fn instant_actions_have_a_list_of_their_own_that_only_clearing_empties() {
    let mut bench = robot(&[]);
    bench.instant("stateRequest", "asked", json!({}));
    bench.instant("nonsense", "unknown", json!({}));
    bench.order(with(
        plain_order(0, 0, "n1"),
        "/nodes/0/actions/-",
        action("beep", "work", "NONE", json!({})),
    ));
    assert_eq!(listed(&bench, "actionStates"), ["work"]);
    assert_eq!(listed(&bench, "instantActionStates"), ["asked", "unknown"]);
    bench.instant("clearInstantActions", "clear", json!({}));
    assert_eq!(listed(&bench, "instantActionStates"), ["clear"]);
}

#[test]
fn an_action_that_may_be_tried_again_waits_for_that() {
    let mut bench = robot(&[]);
    let mut look = action(
        "pick",
        "take",
        "HARD",
        json!({ "stationType": "floor", "loadType": "EPAL", "loadId": "none such" }),
    );
    look["retriable"] = json!(true);
    bench.command("place-load", json!({ "loadId": "l", "loadType": "EPAL" }));
    bench.order(with(plain_order(0, 0, "n1"), "/nodes/0/actions/-", look));
    bench.wait(5.0);
    assert_eq!(bench.status("take"), "RETRIABLE");
    bench.instant("retry", "again", json!({ "actionId": "take" }));
    assert_eq!(bench.status("take"), "RUNNING");
    bench.wait(5.0);
    assert_eq!(bench.status("take"), "RETRIABLE");
    bench.instant("skipRetry", "skip", json!({ "actionId": "take" }));
    assert_eq!(bench.status("take"), "FAILED");
    bench.instant("retry", "late", json!({ "actionId": "take" }));
    let late = bench.state()["instantActionStates"]
        .as_array()
        .unwrap()
        .last()
        .unwrap()
        .clone();
    assert_eq!(late["actionStatus"], "FAILED");
}

#[test]
fn a_cancellation_is_for_the_order_that_it_names() {
    let mut bench = robot(&[]);
    bench.order(plain_order(0, 0, "n1 | n2"));
    bench.instant("cancelOrder", "other", json!({ "orderId": "o2" }));
    assert_eq!(bench.error_types(), ["noOrderToCancel"]);
    assert_ne!(bench.state()["nodeStates"], json!([]));
    bench.instant("cancelOrder", "own", json!({ "orderId": "o1" }));
    assert_eq!(bench.state()["nodeStates"], json!([]));
    bench.order(plain_order(1, 0, "n1 n2"));
    assert!(bench.error_types().contains(&"late".to_owned()));
}

#[test]
fn known_ids_with_another_content_and_a_new_order_that_is_none_are_refused() {
    let mut bench = robot(&[]);
    bench.order(plain_order(1, 0, "n1"));
    assert_eq!(bench.error_types(), ["validationError"]);
    bench.order(plain_order(0, 0, "n1 | n2"));
    bench.order(plain_order(0, 0, "n1 | n2"));
    assert!(bench.error_types().is_empty(), "the same once more is no mistake");
    bench.order(plain_order(0, 0, "n1 n2"));
    assert_eq!(bench.error_types(), ["same"]);
}

#[test]
fn a_single_action_is_alone_and_lets_the_vehicle_drive() {
    let mut bench = robot(&[]);
    let beep = |id: &str, blocking: &str| action("beep", id, blocking, json!({ "duration": 1 }));
    let order = with(plain_order(0, 0, "n1 n2"), "/nodes/0/actions/-", beep("first", "NONE"));
    bench.order(with(order, "/nodes/0/actions/-", beep("alone", "SINGLE")));
    assert_eq!(
        (bench.status("first"), bench.status("alone")),
        ("RUNNING".into(), "WAITING".into())
    );
    assert_eq!(bench.state()["driving"], json!(true));
    bench.wait(1.1);
    assert_eq!(
        (bench.status("first"), bench.status("alone")),
        ("FINISHED".into(), "RUNNING".into())
    );
    let mut elder = Bench::new();
    elder.order(with(order_of_one(), "/nodes/0/actions/-", beep("alone", "SINGLE")));
    assert_eq!(elder.error_types(), ["validationError"], "no word of earlier versions");
}

fn order_of_one() -> Value {
    order("o1", 0, 0, "n1")
}

#[test]
fn a_mode_that_takes_no_orders_is_told_when_the_actions_of_the_order_have_ended() {
    let mut config = config();
    config.features.insert("modesClear".to_owned());
    let mut bench = Bench::with(config, &[]);
    let long = action("calibrate", "long", "HARD", json!({ "duration": 3 }));
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/0/actions/-", long));
    bench.command("set-mode", json!({ "mode": "SERVICE" }));
    let state = bench.state();
    assert_eq!(
        (&state["operatingMode"], bench.status("long")),
        (&json!("AUTOMATIC"), "RUNNING".into())
    );
    assert_ne!(state["nodeStates"], json!([]));
    bench.wait(4.0);
    let state = bench.state();
    assert_eq!(
        (&state["operatingMode"], bench.status("long")),
        (&json!("SERVICE"), "FINISHED".into())
    );
    assert_eq!((&state["nodeStates"], &state["lastNodeId"]), (&json!([]), &json!("")));
    bench.command("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.wait(60.0);
    assert_eq!(
        bench.state()["driving"],
        json!(false),
        "what was cleared is not taken up again"
    );
}

#[test]
fn an_order_waits_while_somebody_steps_in() {
    let mut bench = robot(&[]);
    bench.command("set-mode", json!({ "mode": "INTERVENED" }));
    bench.order(plain_order(0, 0, "n1 n2"));
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n1");
    assert_ne!(bench.state()["nodeStates"], json!([]));
    bench.command("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.wait(60.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}
