use super::*;

fn text(value: &Value, key: &str) -> String {
    value[key].as_str().unwrap().to_owned()
}

#[test]
fn the_vehicle_connects_with_a_will_and_says_online() {
    let mut bench = Bench::off(config(), &[]);
    assert_eq!(bench.agv.wake_up(), Some(Moment::START));
    bench.give(Input::Time);
    assert_eq!(bench.outputs, [(Moment::START, Output::Connect)]);
    let options = bench.options();
    let will = options.will.unwrap();
    assert_eq!((will.qos, will.retain, options.keep_alive.as_secs()), (1, true, 15));
    let message: Value = serde_json::from_slice(&will.payload).unwrap();
    assert_eq!(message["connectionState"], "CONNECTIONBROKEN");
    assert_eq!(message["version"], VERSION);
    assert_eq!(options.subscriptions.len(), 2);
    bench.give(Input::Connected);
    let connection = bench.publications("/connection");
    assert_eq!((connection[0].qos, connection[0].retain), (1, true));
    assert_eq!(bench.messages("/connection")[0]["connectionState"], "ONLINE");
    let factsheet = bench.publications("/factsheet");
    assert_eq!((factsheet[0].qos, factsheet[0].retain), (0, true));
    let state = bench.publications("/state");
    assert_eq!((state.len(), state[0].qos, state[0].retain), (1, 0, false));
    assert!(bench.messages("/visualization").is_empty());
}

#[test]
fn error_names_come_from_the_vocabulary_where_it_has_them() {
    let names = ErrorNames::from_vocabulary(|path| (path == "error.startTooFar").then_some("TOO_FAR"));
    assert_eq!(
        (names.start_out_of_range.as_str(), names.order.as_str()),
        ("TOO_FAR", "orderError")
    );
    let mut bench = Bench::with(
        AgvConfig {
            errors: names,
            ..config()
        },
        &[],
    );
    bench.order(order("o1", 0, 0, "n3 n4"));
    assert_eq!(bench.error_types(), ["TOO_FAR"]);
}

#[test]
fn headers_count_per_topic_over_reconnections() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(5.0);
    bench.give(Input::ConnectionLost);
    bench.wait(3.0);
    let _ = bench.options();
    bench.give(Input::Connected);
    bench.wait(60.0);
    for topic in ["/state", "/connection", "/factsheet"] {
        let messages = bench.messages(topic);
        let ids: Vec<u64> = messages
            .iter()
            .map(|message| message["headerId"].as_u64().unwrap())
            .collect();
        assert_eq!(ids, (0..ids.len() as u64).collect::<Vec<_>>(), "{topic}");
        assert!(ids.len() > 1);
    }
}

#[test]
fn timestamps_have_two_digits_and_rise() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(30.0);
    let stamps: Vec<String> = bench.states().iter().map(|state| text(state, "timestamp")).collect();
    assert_eq!(stamps[0], "2026-03-04T05:06:07.89Z");
    assert!(stamps.iter().all(|stamp| stamp.len() == 23 && stamp.ends_with('Z')));
    assert!(stamps.is_sorted());
}

#[test]
fn a_lost_connection_is_restored_and_online_is_said_again() {
    let mut bench = Bench::new();
    bench.give(Input::ConnectionLost);
    bench.forget();
    bench.wait(0.9);
    assert!(!bench.outputs.iter().any(|(_, output)| *output == Output::Connect));
    bench.wait(0.2);
    assert_eq!(
        bench
            .outputs
            .iter()
            .filter(|(_, output)| *output == Output::Connect)
            .count(),
        1
    );
    bench.give(Input::ConnectionLost);
    bench.wait(1.1);
    assert_eq!(
        bench
            .outputs
            .iter()
            .filter(|(_, output)| *output == Output::Connect)
            .count(),
        2
    );
    bench.give(Input::Connected);
    assert_eq!(
        bench.messages("/connection").pop().unwrap()["connectionState"],
        "ONLINE"
    );
}

#[test]
fn the_order_goes_on_to_the_end_of_its_base_without_a_link() {
    let mut bench = Bench::new();
    let beep = action("beep", "a", "HARD", json!({}));
    bench.order(with(order("o1", 0, 0, "n1 n2 n3 | n4"), "/nodes/1/actions/-", beep));
    bench.wait(0.5);
    bench.give(Input::ConnectionLost);
    bench.forget();
    bench.wait(60.0);
    assert_eq!(bench.states().len(), 1);
    bench.give(Input::Connected);
    let state = bench.state();
    assert_eq!(
        (&state["orderId"], &state["lastNodeId"], &state["driving"]),
        (&json!("o1"), &json!("n3"), &json!(false))
    );
    assert_eq!(ids(&state["nodeStates"], "nodeId"), ["n4"]);
    assert_eq!(bench.status("a"), "FINISHED");
}

#[test]
fn a_state_comes_at_least_at_its_interval_and_no_sooner_without_reason() {
    let mut bench = Bench::new();
    bench.wait(100.5);
    assert_eq!(bench.states().len(), 11);
}

#[test]
fn the_minimum_interval_collects_events() {
    let min = Duration::from_millis(500);
    let mut bench = Bench::with(
        AgvConfig {
            min_state_interval: min,
            ..config()
        },
        &[],
    );
    let beep = action("beep", "a", "HARD", json!({ "duration": 0.2 }));
    bench.order(with(order("o1", 0, 0, "n1 n2 n3"), "/nodes/0/actions/-", beep));
    bench.instant("stateRequest", "s", json!({}));
    bench.wait(30.0);
    let times: Vec<Moment> = bench
        .outputs
        .iter()
        .filter(|(_, output)| matches!(output, Output::Publish(p) if p.topic.ends_with("/state")))
        .map(|(at, _)| *at)
        .collect();
    assert!(times.len() > 4);
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= min));
    assert_eq!(bench.status("a"), "FINISHED");
}

#[test]
fn the_visualization_comes_at_its_interval() {
    let interval = Some(Duration::from_millis(500));
    let mut bench = Bench::with(
        AgvConfig {
            visualization_interval: interval,
            ..config()
        },
        &[],
    );
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(1.1);
    let messages = bench.messages("/visualization");
    assert_eq!(messages.len(), 3);
    assert!((messages[1]["agvPosition"]["x"].as_f64().unwrap() - 1.0).abs() < 1e-6);
    assert_eq!(messages[2]["headerId"], 2);
}

#[test]
fn a_shutdown_says_offline_and_disconnects_for_good() {
    let mut bench = Bench::new();
    bench.forget();
    bench.command("shutdown", json!({}));
    bench.give(Input::ConnectionLost);
    bench.wait(100.0);
    let said: Vec<Value> = bench.messages("/connection");
    assert_eq!(said[said.len() - 1]["connectionState"], "OFFLINE");
    assert_eq!(bench.outputs.last().unwrap().1, Output::Disconnect);
    bench.command("start", json!({}));
    assert_eq!(bench.outputs.last().unwrap().1, Output::Connect);
}

#[test]
fn a_power_cycle_forgets_the_order_and_keeps_the_place() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(10.0);
    bench.forget();
    bench.command("power-cycle", json!({}));
    assert_eq!(bench.outputs.last().unwrap().1, Output::Drop);
    bench.give(Input::ConnectionLost);
    bench.wait(2.0);
    assert_eq!(bench.outputs.last().unwrap().1, Output::Connect);
    bench.give(Input::Connected);
    let state = bench.state();
    assert_eq!(
        (&state["orderId"], &state["lastNodeId"], &state["actionStates"]),
        (&json!(""), &json!("n2"), &json!([]))
    );
    assert!((state["agvPosition"]["x"].as_f64().unwrap() - 3.0).abs() < 1e-9);
}

#[test]
fn the_factsheet_lists_what_the_vehicle_does() {
    let bench = Bench::new();
    let factsheet = &bench.messages("/factsheet")[0];
    for part in [
        "typeSpecification",
        "physicalParameters",
        "protocolLimits",
        "protocolFeatures",
        "agvGeometry",
        "loadSpecification",
    ] {
        assert!(factsheet[part].is_object(), "{part}");
    }
    let actions = factsheet["protocolFeatures"]["agvActions"].as_array().unwrap();
    assert_eq!(actions.len(), 20);
    let pick = actions.iter().find(|action| action["actionType"] == "pick").unwrap();
    assert_eq!(pick["actionScopes"], json!(["NODE", "EDGE"]));
    assert_eq!(
        pick["actionParameters"][0],
        json!({ "key": "stationType", "valueDataType": "STRING", "isOptional": false })
    );
}

#[test]
fn events_of_one_instant_share_one_state() {
    let mut bench = Bench::new();
    let beep = action("beep", "a", "SOFT", json!({}));
    bench.order(with(order("o1", 0, 0, "n1 n2 n3"), "/nodes/1/actions/-", beep));
    bench.wait(1.4);
    let before = bench.states().len();
    bench.wait(0.15);
    assert_eq!(bench.states().len(), before + 1);
    let state = bench.state();
    assert_eq!(
        (&state["lastNodeId"], &state["driving"], bench.status("a")),
        (&json!("n2"), &json!(false), "RUNNING".into())
    );
}
