use super::*;

/// A good order with an action on its second node, to be broken.
fn good() -> Value {
    let beep = action("beep", "b", "NONE", json!({ "duration": 1 }));
    let position = json!({ "x": 3.0, "y": 0.0, "theta": 0.0, "mapId": "hall" });
    let order = with(order("o1", 0, 0, "n1 n2 n3 | n4"), "/nodes/1/actions/-", beep);
    with(order, "/nodes/1/nodePosition", position)
}

#[test]
fn the_order_that_is_broken_below_is_good() {
    let mut bench = Bench::new();
    bench.order(good());
    assert_eq!(bench.state()["orderId"], "o1");
}

#[test]
fn every_malformed_field_is_a_validation_error() {
    let strings = [
        "/orderId",
        "/nodes/1/nodeId",
        "/edges/0/edgeId",
        "/edges/0/startNodeId",
        "/edges/0/endNodeId",
    ];
    let action = ["actionType", "actionId", "blockingType"].map(|key| format!("/nodes/1/actions/0/{key}"));
    let numbers = ["/orderUpdateId", "/nodes/1/sequenceId", "/edges/1/sequenceId"];
    let mut broken: Vec<(String, Value)> = Vec::new();
    for path in strings.map(String::from).iter().chain(&action) {
        broken.extend(
            [Value::Null, json!(7), json!(""), json!(["x"]), json!("x".repeat(300))].map(|value| (path.clone(), value)),
        );
    }
    for path in numbers {
        let values = [
            Value::Null,
            json!("1"),
            json!(-2),
            json!(1.5),
            json!(4_294_967_296_u64),
            json!(true),
        ];
        broken.extend(values.map(|value| (path.to_owned(), value)));
    }
    for path in ["/nodes/1/released", "/edges/0/released"] {
        broken.extend([Value::Null, json!("true"), json!(1)].map(|value| (path.to_owned(), value)));
    }
    for path in ["/nodes", "/edges", "/nodes/1/actions", "/edges/0/actions"] {
        broken.extend([Value::Null, json!({}), json!("x"), json!([7])].map(|value| (path.to_owned(), value)));
    }
    for key in ["x", "y"] {
        let path = format!("/nodes/1/nodePosition/{key}");
        broken.extend([Value::Null, json!("three"), json!(false)].map(|value| (path.clone(), value)));
    }
    for key in ["headerId", "timestamp", "version", "manufacturer", "serialNumber"] {
        broken.push((format!("/{key}"), json!([])));
    }
    broken.extend([
        ("/nodes/1/nodePosition/mapId".to_owned(), json!(1)),
        ("/nodes/1/nodePosition/theta".to_owned(), json!(4.0)),
        ("/nodes/1/nodePosition/allowedDeviationXY".to_owned(), json!(-1)),
        ("/nodes/1/nodePosition/allowedDeviationTheta".to_owned(), json!(-0.1)),
        ("/nodes/1/nodePosition".to_owned(), json!("here")),
        ("/nodes/1/actions/0/blockingType".to_owned(), json!("Hard")),
        (
            "/nodes/1/actions/0/actionParameters".to_owned(),
            json!({ "duration": 1 }),
        ),
        ("/nodes/1/actions/0/actionParameters/0/key".to_owned(), json!(1)),
        ("/edges/0/maxSpeed".to_owned(), json!("fast")),
        ("/edges/0/orientationType".to_owned(), json!("LOCAL")),
        ("/edges/0/rotationAllowed".to_owned(), json!("no")),
    ]);
    assert!(broken.len() > 80);
    for (path, value) in broken {
        let mut bench = Bench::new();
        bench.order(with(good(), &path, value.clone()));
        assert_eq!(bench.state()["orderId"], "", "{path} = {value}");
        assert_eq!(bench.error_types(), ["validationError"], "{path} = {value}");
        assert_eq!(bench.state()["errors"][0]["errorLevel"], "WARNING");
    }
}

#[test]
fn the_rules_of_the_graph_are_checked() {
    let cases = [
        ("/nodes/0/released", json!(false)),
        ("/nodes/1/released", json!(false)),
        ("/edges/0/released", json!(false)),
        ("/edges/2/released", json!(true)),
        ("/nodes/3/released", json!(true)),
        ("/edges/0/startNodeId", json!("n3")),
        ("/edges/0/endNodeId", json!("n3")),
        ("/edges/1/sequenceId", json!(5)),
        ("/nodes/2/sequenceId", json!(6)),
        ("/edges", json!([])),
    ];
    for (path, value) in cases {
        let mut bench = Bench::new();
        bench.order(with(good(), path, value));
        assert_eq!(bench.state()["orderId"], "", "{path}");
        assert_eq!(bench.error_types(), ["validationError"], "{path}");
    }
    let mut bench = Bench::new();
    bench.order(json!({ "orderId": "o", "orderUpdateId": 0, "nodes": [], "edges": [] }));
    bench.order(order("p", 0, 2, "n1 n2"));
    assert_eq!(bench.error_types(), ["validationError", "validationError"]);
}

#[test]
fn the_validation_error_stays_until_a_new_order_is_accepted() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.send_raw("order", &b"{\"orderId\": "[..]);
    assert_eq!(bench.error_types(), ["validationError"]);
    bench.wait(120.0);
    bench.order(order("o1", 1, 2, "n2 n3"));
    assert_eq!(bench.error_types(), ["validationError"]);
    bench.wait(20.0);
    assert_eq!(bench.state()["lastNodeId"], "n3");
    bench.order(order("o2", 0, 0, "n3 n4"));
    assert!(bench.error_types().is_empty());
}

#[test]
fn what_the_vehicle_cannot_do_is_an_order_error_that_names_the_culprit() {
    let cases: Vec<(&str, Value, &str, &str)> = vec![
        (
            "/nodes/2/actions/-",
            action("fly", "x", "NONE", json!({})),
            "actionId",
            "x",
        ),
        (
            "/nodes/2/actions/-",
            action("startPause", "x", "NONE", json!({})),
            "actionId",
            "x",
        ),
        (
            "/edges/0/actions/-",
            action("waitForTrigger", "x", "NONE", json!({ "triggerType": "t" })),
            "actionId",
            "x",
        ),
        (
            "/nodes/2/actions/-",
            action("waitForTrigger", "x", "NONE", json!({})),
            "actionParameter",
            "triggerType",
        ),
        (
            "/nodes/2/actions/-",
            action("beep", "x", "NONE", json!({ "volume": 3 })),
            "actionParameter",
            "volume",
        ),
        (
            "/nodes/2/actions/-",
            action("beep", "x", "NONE", json!({ "duration": "long" })),
            "actionParameter",
            "duration",
        ),
        (
            "/nodes/2/actions/-",
            action("beep", "b", "NONE", json!({})),
            "actionId",
            "b",
        ),
        (
            "/nodes/2/actions/-",
            action("drop", "x", "HARD", json!({ "height": 9.0 })),
            "actionParameter",
            "height",
        ),
        (
            "/nodes/2/actions/-",
            action("drop", "x", "HARD", json!({ "lhd": "left" })),
            "actionParameter",
            "lhd",
        ),
        ("/edges/0/trajectory", json!({}), "field", "edges[0].trajectory"),
        ("/edges/1/corridor", json!({}), "field", "edges[1].corridor"),
        ("/zoneSetId", json!("z"), "field", "zoneSetId"),
        ("/edges/0/maxHeight", json!(0.5), "edgeId", "n1-n2"),
        ("/edges/0/maxSpeed", json!(0.0), "edgeId", "n1-n2"),
        ("/edges/0/orientation", json!(1.57), "edgeId", "n1-n2"),
        ("/nodes/1/nodePosition/mapId", json!("moon"), "mapId", "moon"),
    ];
    for (path, value, key, named) in cases {
        let mut bench = Bench::new();
        bench.order(with(good(), path, value.clone()));
        assert_eq!(bench.state()["orderId"], "", "{value}");
        assert_eq!(bench.error_types(), ["orderError"], "{value}");
        assert_eq!(bench.reference(key).as_deref(), Some(named), "{value}");
        assert_eq!(bench.state()["actionStates"], json!([]));
        bench.wait(100.0);
        assert_eq!(bench.error_types(), ["orderError"]);
    }
}

#[test]
fn an_order_without_positions_needs_nodes_the_vehicle_knows() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 nowhere"));
    assert_eq!(bench.error_types(), ["orderError"]);
    assert_eq!(bench.reference("nodeId").as_deref(), Some("nowhere"));
}

#[test]
fn an_order_beyond_the_memory_is_refused_and_the_limit_itself_is_not() {
    for (nodes, accepted) in [(4, true), (5, false)] {
        let mut bench = Bench::with(
            AgvConfig {
                max_nodes: 4,
                ..config()
            },
            &[],
        );
        let route = "n1 n2 ".repeat(3);
        let route: Vec<&str> = route.split_whitespace().take(nodes).collect();
        bench.order(order("o1", 0, 0, &route.join(" ")));
        assert_eq!(bench.state()["orderId"] == "o1", accepted);
    }
}

#[test]
fn header_names_of_another_vehicle_are_tolerated() {
    let mut bench = Bench::new();
    bench.order(with(good(), "/manufacturer", json!("Fleet")));
    assert_eq!(bench.state()["orderId"], "o1");
}

#[test]
fn a_rejection_disturbs_nothing() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(1.0);
    let before = bench.state();
    bench.send_raw("order", &b"\xff\xfe"[..]);
    bench.order(order("o2", 0, 0, "n1 n2"));
    bench.order(order("o1", 9, 0, "n1 n2"));
    for key in [
        "orderId",
        "orderUpdateId",
        "nodeStates",
        "edgeStates",
        "driving",
        "lastNodeId",
    ] {
        assert_eq!(bench.state()[key], before[key], "{key}");
    }
    bench.wait(2.0);
    assert_eq!(bench.state()["lastNodeId"], "n3");
}
