use proptest::prelude::*;

use super::*;

/// What holds in every state, whatever was received.
fn assert_sound(state: &Value) {
    let last = state["lastNodeSequenceId"].as_u64().unwrap();
    assert!(u32::try_from(last).is_ok());
    for list in ["nodeStates", "edgeStates"] {
        let elements = state[list].as_array().unwrap();
        let ids: Vec<u64> = elements
            .iter()
            .map(|element| element["sequenceId"].as_u64().unwrap())
            .collect();
        assert!(ids.windows(2).all(|pair| pair[0] < pair[1]), "{list}: {ids:?}");
        let released: Vec<bool> = elements
            .iter()
            .map(|element| element["released"].as_bool().unwrap())
            .collect();
        assert!(
            released.windows(2).all(|pair| pair[0] || !pair[1]),
            "{list}: {released:?}"
        );
    }
    let known = ["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "FINISHED", "FAILED"];
    let actions = state["actionStates"].as_array().unwrap();
    assert!(
        actions
            .iter()
            .all(|action| known.contains(&action["actionStatus"].as_str().unwrap()))
    );
    let mut ids: Vec<&str> = actions
        .iter()
        .map(|action| action["actionId"].as_str().unwrap())
        .collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), actions.len());
    assert!(state["errors"].as_array().unwrap().len() <= 20);
    let theta = state["agvPosition"]["theta"].as_f64().unwrap();
    assert!(theta.abs() <= std::f64::consts::PI + 1e-9);
}

fn leaf() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        (0_u32..12).prop_map(Value::from),
        prop_oneof![
            Just("n1"),
            Just("n2"),
            Just("o1"),
            Just("beep"),
            Just("HARD"),
            Just("cancelOrder"),
            Just("")
        ]
        .prop_map(Value::from),
        ".{0,8}".prop_map(Value::from),
        Just(json!([])),
        Just(json!({})),
    ]
}

/// All places of a JSON value, as pointers.
fn places(value: &Value, at: String, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) => fields
            .iter()
            .for_each(|(key, value)| places(value, format!("{at}/{key}"), found)),
        Value::Array(elements) => {
            elements
                .iter()
                .enumerate()
                .for_each(|(index, value)| places(value, format!("{at}/{index}"), found));
        }
        _ => {}
    }
    found.push(at);
}

fn message() -> impl Strategy<Value = (&'static str, Value)> {
    let beep = action("beep", "a", "SOFT", json!({ "duration": 1 }));
    let position = json!({ "x": 3.0, "y": 0.0, "theta": 0.0, "allowedDeviationXY": 1.0, "mapId": "hall" });
    let full = with(order("o1", 0, 0, "n1 n2 | n3"), "/nodes/1/actions/-", beep.clone());
    let full = with(
        with(full, "/nodes/1/nodePosition", position),
        "/edges/0/maxSpeed",
        json!(1.0),
    );
    let instant = |name, parameters| json!({ "actions": [action(name, name, "NONE", parameters)] });
    let pose = json!({ "x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "hall", "lastNodeId": "here" });
    prop_oneof![
        Just(("order", full)),
        Just(("order", order("o1", 1, 2, "n2 n3 | n4"))),
        Just(("order", order("o2", 0, 0, "n2 n3 n4"))),
        Just(("instantActions", instant("cancelOrder", json!({})))),
        Just(("instantActions", instant("startPause", json!({})))),
        Just(("instantActions", instant("stopPause", json!({})))),
        Just(("instantActions", instant("initPosition", pose))),
        Just((
            "instantActions",
            instant(
                "downloadMap",
                json!({ "mapId": "a", "mapVersion": "b", "mapDownloadLink": "http://c" })
            )
        )),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_messages_never_break_the_vehicle(
        script in prop::collection::vec(
            (message(), any::<prop::sample::Index>(), prop::option::of(leaf()), 0.0..3.0_f64),
            1..12,
        ),
        fault in prop::option::of(any::<prop::sample::Index>()),
        interval in 0_u64..600,
    ) {
        let faults: Vec<&str> = fault.iter().map(|index| index.get(&deviations::FAULTS).name).collect();
        let min_state_interval = Duration::from_millis(interval.saturating_sub(300));
        let mut bench = Bench::with(AgvConfig { min_state_interval, ..config() }, &faults);
        for ((topic, mut body), place, value, pause) in script {
            if let Some(value) = value {
                let mut found = Vec::new();
                places(&body, String::new(), &mut found);
                if let Some(target) = body.pointer_mut(&found[place.index(found.len())]) {
                    *target = value;
                }
            }
            if body.is_object() { bench.send(topic, body) } else { bench.send_raw(topic, body.to_string()) }
            bench.wait(pause);
        }
        bench.wait(20.0);
        if faults.is_empty() {
            bench.states().iter().for_each(assert_sound);
        }
    }

    #[test]
    fn arbitrary_bytes_never_break_the_vehicle(
        payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..200), 1..8),
    ) {
        let mut bench = Bench::new();
        for payload in payloads {
            bench.send_raw("order", payload.clone());
            bench.send_raw("instantActions", payload.clone());
            bench.send_raw("elsewhere", payload);
        }
        bench.wait(1.0);
        bench.states().iter().for_each(assert_sound);
        prop_assert_eq!(&bench.state()["orderId"], "");
    }
}

#[test]
fn deep_and_long_messages_are_refused() {
    let mut bench = Bench::new();
    bench.send_raw("order", "[".repeat(500_000));
    bench.send_raw("order", vec![b' '; 2_000_000]);
    bench.send_raw("instantActions", "{\"actions\":".repeat(100_000));
    assert!(bench.error_types().iter().all(|name| name == "validationError"));
    assert_eq!(bench.state()["orderId"], "");
}

#[test]
fn instant_actions_without_an_end_are_bounded() {
    let mut bench = Bench::new();
    for round in 0..20 {
        let actions: Vec<Value> = (0..50)
            .map(|index| action("stateRequest", &format!("{round}-{index}"), "NONE", json!({})))
            .collect();
        bench.send("instantActions", json!({ "actions": actions }));
    }
    assert!(bench.state()["actionStates"].as_array().unwrap().len() <= 500);
    assert_eq!(bench.status("19-49"), "FINISHED");
}
