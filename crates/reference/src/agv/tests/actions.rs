use super::*;

fn at_node(route: &str, index: usize, actions: Vec<Value>) -> Value {
    with(
        order("o1", 0, 0, route),
        &format!("/nodes/{index}/actions"),
        Value::Array(actions),
    )
}

fn beep(id: &str, blocking: &str) -> Value {
    action("beep", id, blocking, json!({}))
}

/// Whether two actions were ever active in the same state.
fn overlapped(bench: &Bench, one: &str, other: &str) -> bool {
    let active =
        |state: &Value, id| status_in(state, id).is_some_and(|status| status == "RUNNING" || status == "INITIALIZING");
    bench
        .states()
        .iter()
        .any(|state| active(state, one) && active(state, other))
}

fn driven_while(bench: &Bench, id: &str) -> bool {
    let active =
        |state: &Value| status_in(state, id).is_some_and(|status| status == "RUNNING" || status == "INITIALIZING");
    bench
        .states()
        .iter()
        .any(|state| active(state) && state["driving"] == true)
}

#[test]
fn a_node_action_waits_for_its_node_and_runs_to_its_end() {
    let mut bench = Bench::new();
    bench.order(at_node("n1 n2 n3", 1, vec![beep("a", "HARD")]));
    bench.wait(1.4);
    assert_eq!(bench.status("a"), "WAITING");
    bench.wait(0.2);
    assert_eq!(
        (bench.status("a"), bench.state()["lastNodeId"].clone()),
        ("RUNNING".into(), json!("n2"))
    );
    bench.wait(10.0);
    assert_eq!(bench.statuses("a"), ["WAITING", "RUNNING", "FINISHED"]);
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn blocking_types_decide_about_driving() {
    for (blocking, drives) in [("NONE", true), ("SOFT", false), ("HARD", false)] {
        let mut bench = Bench::new();
        bench.order(at_node("n1 n2 n3", 1, vec![beep("a", blocking)]));
        bench.wait(10.0);
        assert_eq!(driven_while(&bench, "a"), drives, "{blocking}");
        assert_eq!(bench.state()["lastNodeId"], "n3");
    }
}

#[test]
fn parallel_actions_run_together_and_hard_ones_alone_in_list_order() {
    let mut bench = Bench::new();
    let actions = vec![
        beep("a", "NONE"),
        beep("b", "SOFT"),
        beep("c", "HARD"),
        beep("d", "HARD"),
        beep("e", "NONE"),
    ];
    bench.order(at_node("n1 n2", 0, actions));
    bench.wait(10.0);
    assert!(overlapped(&bench, "a", "b"));
    for (one, other) in [("a", "c"), ("b", "c"), ("c", "d"), ("d", "e")] {
        assert!(!overlapped(&bench, one, other), "{one} {other}");
    }
    let begun = |id: &str| {
        bench
            .states()
            .iter()
            .position(|state| status_in(state, id).is_some_and(|status| status != "WAITING"))
            .unwrap()
    };
    assert!(begun("a") == begun("b") && begun("b") < begun("c") && begun("c") < begun("d") && begun("d") < begun("e"));
    for id in ["a", "b", "c", "d"] {
        assert!(!driven_while(&bench, id), "{id}");
    }
    assert!(driven_while(&bench, "e"));
}

#[test]
fn a_hard_action_waits_for_a_none_action_of_the_node_before() {
    let mut bench = Bench::new();
    let long = action("beep", "long", "NONE", json!({ "duration": 4 }));
    let order = with(
        at_node("n1 n2", 0, vec![long]),
        "/nodes/1/actions/-",
        beep("hard", "HARD"),
    );
    bench.order(order);
    bench.wait(10.0);
    assert!(!overlapped(&bench, "long", "hard"));
    assert_eq!(bench.status("hard"), "FINISHED");
}

#[test]
fn an_edge_action_runs_while_the_vehicle_is_on_its_edge() {
    let mut bench = Bench::new();
    let long = action("beep", "e", "NONE", json!({ "duration": 60 }));
    bench.order(with(order("o1", 0, 0, "n1 n2 n3"), "/edges/1/actions/-", long));
    bench.wait(1.4);
    assert_eq!(bench.status("e"), "WAITING");
    bench.wait(0.2);
    assert_eq!(bench.status("e"), "RUNNING");
    bench.wait(1.5);
    assert_eq!(
        (bench.status("e"), bench.state()["lastNodeId"].clone()),
        ("FINISHED".into(), json!("n3"))
    );
}

#[test]
fn a_blocking_edge_action_stops_the_vehicle_on_the_edge() {
    let mut bench = Bench::new();
    bench.order(with(
        order("o1", 0, 0, "n1 n2"),
        "/edges/0/actions/-",
        beep("e", "HARD"),
    ));
    assert_eq!(
        (bench.status("e"), bench.state()["driving"].clone()),
        ("WAITING".into(), json!(true))
    );
    bench.wait(0.2);
    assert_eq!(
        (bench.status("e"), bench.state()["driving"].clone()),
        ("RUNNING".into(), json!(false))
    );
    assert!(bench.state()["agvPosition"]["x"].as_f64().unwrap() > 0.1);
    bench.wait(5.0);
    assert_eq!(
        (bench.status("e"), bench.state()["lastNodeId"].clone()),
        ("FINISHED".into(), json!("n2"))
    );
    assert!(!driven_while(&bench, "e"));
}

#[test]
fn an_edge_action_waits_while_the_vehicle_is_held_on_the_node() {
    let mut bench = Bench::new();
    let order = at_node("n1 n2", 0, vec![beep("n", "HARD")]);
    bench.order(with(order, "/edges/0/actions/-", beep("e", "NONE")));
    assert_eq!(bench.status("e"), "WAITING");
    bench.wait(0.35);
    assert_eq!(
        (bench.status("e"), bench.state()["driving"].clone()),
        ("RUNNING".into(), json!(true))
    );
    assert!(!overlapped(&bench, "n", "e"));
}

#[test]
fn pick_and_drop_change_the_load_and_fail_without_one() {
    let mut bench = Bench::new();
    let pick = |id| {
        action(
            "pick",
            id,
            "HARD",
            json!({ "stationType": "floor", "loadType": "EPAL", "loadId": "L7" }),
        )
    };
    let drop = |id| action("drop", id, "HARD", json!({}));
    bench.order(at_node("n1", 0, vec![drop("d0"), pick("p1"), pick("p2"), drop("d1")]));
    bench.wait(0.5);
    assert_eq!(bench.status("d0"), "FAILED");
    assert_eq!(bench.error_types(), ["loadError"]);
    assert_eq!(bench.reference("actionId").as_deref(), Some("d0"));
    bench.wait(0.4);
    assert_eq!(bench.statuses("p1"), ["WAITING", "INITIALIZING", "RUNNING", "FINISHED"]);
    assert_eq!(bench.state()["loads"][0]["loadId"], "L7");
    bench.wait(5.0);
    assert_eq!(
        (bench.status("p2"), bench.status("d1")),
        ("FAILED".into(), "FINISHED".into())
    );
    assert_eq!(bench.state()["loads"], json!([]));
}

#[test]
fn wait_for_trigger_waits_for_the_trigger() {
    let mut bench = Bench::new();
    let wait = action("waitForTrigger", "w", "SOFT", json!({ "triggerType": "button" }));
    bench.order(at_node("n1 n2", 0, vec![wait]));
    bench.wait(100.0);
    assert_eq!(bench.status("w"), "RUNNING");
    bench.command("trigger", json!({}));
    assert_eq!(
        (bench.status("w"), bench.state()["driving"].clone()),
        ("FINISHED".into(), json!(true))
    );
}

#[test]
fn instant_actions_are_performed_at_once_and_all_of_them() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    let actions = vec![
        beep("i1", "HARD"),
        action("logReport", "i2", "NONE", json!({ "reason": "test" })),
        beep("i3", "NONE"),
    ];
    bench.send("instantActions", json!({ "actions": actions }));
    assert!(["i1", "i2", "i3"].iter().all(|id| bench.status(id) == "RUNNING"));
    assert_eq!(bench.state()["driving"], true);
    bench.wait(1.0);
    assert!(["i1", "i2", "i3"].iter().all(|id| bench.status(id) == "FINISHED"));
    let state = bench.state();
    let log = state["actionStates"]
        .as_array()
        .unwrap()
        .iter()
        .find(|action| action["actionId"] == "i2")
        .unwrap();
    assert_eq!(log["resultDescription"], "log-1.txt");
}

#[test]
fn an_instant_action_the_vehicle_cannot_perform_fails_with_an_error() {
    let cases = [
        ("fly", json!({})),
        ("pick", json!({ "stationType": "floor", "loadType": "EPAL" })),
        ("enableMap", json!({})),
        ("beep", json!({ "duration": -1 })),
    ];
    for (action_type, parameters) in cases {
        let mut bench = Bench::new();
        bench.instant(action_type, "x", parameters);
        assert_eq!(bench.status("x"), "FAILED", "{action_type}");
        assert_eq!(bench.error_types(), ["instantActionError"]);
        assert_eq!(bench.reference("actionId").as_deref(), Some("x"));
    }
}

#[test]
fn an_instant_action_delivered_twice_is_done_once() {
    let mut bench = Bench::new();
    bench.instant("logReport", "l", json!({ "reason": "r" }));
    bench.instant("logReport", "l", json!({ "reason": "r" }));
    bench.wait(1.0);
    bench.instant("logReport", "l", json!({ "reason": "r" }));
    bench.wait(1.0);
    assert_eq!(bench.state()["actionStates"].as_array().unwrap().len(), 1);
    assert_eq!(bench.state()["actionStates"][0]["resultDescription"], "log-1.txt");
}

#[test]
fn a_pause_stops_everything_and_a_stop_pause_goes_on() {
    let mut bench = Bench::new();
    let long = action("beep", "a", "NONE", json!({ "duration": 2 }));
    bench.order(at_node("n1 n2", 0, vec![long]));
    bench.wait(0.5);
    bench.instant("startPause", "p", json!({}));
    let state = bench.state();
    assert_eq!((&state["paused"], &state["driving"]), (&json!(true), &json!(false)));
    assert_eq!(
        (bench.status("p"), bench.status("a")),
        ("FINISHED".into(), "PAUSED".into())
    );
    bench.wait(50.0);
    assert_eq!(bench.state()["lastNodeId"], "n1");
    bench.instant("startPause", "p2", json!({}));
    assert_eq!(bench.status("p2"), "FINISHED");
    bench.instant("stopPause", "s", json!({}));
    let state = bench.state();
    assert_eq!((&state["paused"], &state["driving"]), (&json!(false), &json!(true)));
    bench.wait(1.1);
    assert_eq!(
        (bench.status("a"), bench.state()["lastNodeId"].clone()),
        ("RUNNING".into(), json!("n2"))
    );
    bench.wait(0.5);
    assert_eq!(bench.statuses("a"), ["RUNNING", "PAUSED", "RUNNING", "FINISHED"]);
}

#[test]
fn charging_is_reported_and_ends_before_driving() {
    let mut bench = Bench::new();
    bench.instant("startCharging", "c", json!({}));
    bench.wait(1.0);
    assert_eq!(
        (bench.status("c"), bench.state()["batteryState"]["charging"].clone()),
        ("FINISHED".into(), json!(true))
    );
    bench.instant("stopCharging", "d", json!({}));
    bench.wait(1.0);
    assert_eq!(
        (bench.status("d"), bench.state()["batteryState"]["charging"].clone()),
        ("FINISHED".into(), json!(false))
    );
    bench.instant("startCharging", "e", json!({}));
    bench.wait(1.0);
    bench.order(order("o1", 0, 0, "n1 n2"));
    assert_eq!(bench.state()["batteryState"]["charging"], false);
    bench.instant("startCharging", "f", json!({}));
    bench.wait(0.5);
    assert_eq!(bench.status("f"), "FAILED");
    assert_eq!(bench.error_types(), ["chargingError"]);
}

#[test]
fn init_position_takes_over_a_valid_pose_only() {
    let pose = json!({ "x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "hall", "lastNodeId": "here" });
    let mut bench = Bench::new();
    bench.instant("initPosition", "i", pose.clone());
    let state = bench.state();
    assert_eq!(
        (bench.status("i"), &state["lastNodeId"]),
        ("FINISHED".into(), &json!("here"))
    );
    let position = &state["agvPosition"];
    assert_eq!(
        (&position["x"], &position["y"], &position["theta"]),
        (&json!(1.0), &json!(2.0), &json!(0.5))
    );
    for (key, value) in [("mapId", json!("moon")), ("x", json!(1e9)), ("theta", json!(9.0))] {
        bench.instant("initPosition", key, with(pose.clone(), &format!("/{key}"), value));
        assert_eq!(bench.status(key), "FAILED", "{key}");
        assert_eq!(bench.state()["agvPosition"]["x"], 1.0);
        assert!(!bench.error_types().is_empty());
    }
}

#[test]
fn requests_are_answered() {
    let mut bench = Bench::new();
    bench.wait(3.0);
    let (states, factsheets) = (bench.states().len(), bench.messages("/factsheet").len());
    bench.instant("stateRequest", "s", json!({}));
    assert_eq!(
        (bench.states().len(), bench.status("s")),
        (states + 1, "FINISHED".into())
    );
    bench.instant("factsheetRequest", "f", json!({}));
    assert_eq!(
        (bench.messages("/factsheet").len(), bench.status("f")),
        (factsheets + 1, "FINISHED".into())
    );
}

#[test]
fn action_states_are_kept_until_a_new_order() {
    let mut bench = Bench::new();
    bench.order(at_node("n1 n2", 0, vec![beep("a", "NONE")]));
    bench.wait(60.0);
    bench.order(order("o1", 1, 2, "n2 n3"));
    bench.wait(60.0);
    assert_eq!(bench.status("a"), "FINISHED");
}
