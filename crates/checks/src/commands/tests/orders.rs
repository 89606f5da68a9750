//! Mistakes in one order.

use serde_json::{Value, json};

use super::{action, all, begun, merged, order, pick};
use crate::trace::Trace;

/// One order, changed.
fn with(change: impl FnOnce(&mut Value)) -> Vec<String> {
    let mut trace = begun();
    let mut first = order("o1", 0, 0, 2, 4);
    change(&mut first);
    trace.commands("order", &first);
    all(&trace)
}

#[test]
fn mistakes_in_one_order_are_found() {
    assert_eq!(with(|_| {}), Vec::<String>::new());
    assert_eq!(
        with(|order| drop(order["edges"].as_array_mut().unwrap().pop())),
        ["ORD-02", "ORD-UPD-11"]
    );
    assert_eq!(with(|order| order["edges"][2]["released"] = json!(true)), ["ORD-08"]);
    assert_eq!(with(|order| order["nodes"][4]["released"] = json!(true)), ["ORD-09"]);
    assert_eq!(
        with(|order| order["edges"][0]["startNodeId"] = json!("n9")),
        ["ORD-MSG-19"]
    );
    assert_eq!(with(|order| order["edges"][0]["sequenceId"] = json!(0)), ["ORD-UPD-11"]);
    assert_eq!(
        with(|order| drop(order["nodes"][0].as_object_mut().unwrap().remove("actions"))),
        ["ORD-MSG-06"]
    );
    assert_eq!(with(|order| order["zoneSetId"] = json!("")), ["OPT-03", "ORD-MSG-03"]);
    assert_eq!(with(|order| order["orderId"] = json!("o 1")), ["JSON-04"]);
    assert_eq!(
        with(|order| order["nodes"][1]["nodePosition"]["allowedDeviationXY"] = json!(-1.0)),
        ["ORD-MSG-09"]
    );
    assert_eq!(
        with(|order| drop(order["nodes"][1].as_object_mut().unwrap().remove("nodePosition"))),
        ["ORD-MSG-08 warning"]
    );
    assert_eq!(
        with(|order| drop(
            order["nodes"][1]["nodePosition"]
                .as_object_mut()
                .unwrap()
                .remove("allowedDeviationXY")
        )),
        ["OPT-05"]
    );
    assert_eq!(with(|order| order["edges"][0]["maxSpeed"] = json!(1.0)), ["OPT-03"]);
    assert_eq!(with(|order| order["orderId"] = json!("o".repeat(41))), ["FACT-12"]);
    assert_eq!(
        with(|order| order["nodes"][3]["nodePosition"]["mapId"] = json!("cellar")),
        ["MAP-09"]
    );
    assert_eq!(
        with(|order| {
            for node in order["nodes"].as_array_mut().unwrap() {
                let y = node["nodePosition"]["y"].as_f64().unwrap();
                node["nodePosition"]["y"] = json!(-y);
            }
        }),
        ["MAP-01"]
    );
    assert_eq!(
        with(|order| *order = merged(
            json!({ "actions": [action("cancelOrder", "a", &json!([]))] }),
            &json!({})
        )),
        ["TOPIC-13"]
    );
}

#[test]
fn mistakes_in_actions_are_found() {
    let on_node = |action: Value| with(move |order| order["nodes"][1]["actions"] = json!([action]));
    assert_eq!(on_node(action("pick", "a", &pick())), Vec::<String>::new());
    assert_eq!(on_node(action("startPause", "a", &json!([]))), ["ACT-08", "FACT-15"]);
    assert_eq!(on_node(action("dance", "a", &json!([]))), ["FACT-15"]);
    let renamed = json!([
        { "key": "station_type", "value": "floor" },
        { "key": "loadType", "value": "EPAL" },
        { "key": "lhd", "value": "left" },
    ]);
    assert_eq!(on_node(action("pick", "a", &renamed)), ["ACT-06", "ACT-31", "FACT-15"]);
    let number = merged(action("pick", "a", &pick()), &json!({}));
    let mut wrong = number;
    wrong["actionParameters"][0]["value"] = json!(3);
    assert_eq!(on_node(wrong), ["ACT-31", "BP-05"]);
    let mut unknown = action("pick", "a", &pick());
    unknown["actionParameters"][2]["value"] = json!("middle");
    assert_eq!(on_node(unknown), ["ACT-32"]);
    assert_eq!(
        on_node(action("pick", "a", &json!({ "loadType": "EPAL" }))),
        ["ACT-31", "ACT-32", "BP-04", "FACT-15"]
    );
    let mut null = action("pick", "a", &pick());
    null["actionParameters"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "key": "loadId", "value": null }));
    assert_eq!(on_node(null), ["BP-05", "FACT-15 warning"]);
}

#[test]
fn a_corridor_without_sense_is_found() {
    let corridor = |corridor: Value| {
        with(move |order| {
            order["edges"][0]["corridor"] = corridor;
            order["edges"][0]["trajectory"] = json!({
                "degree": 1, "knotVector": [0, 0, 1, 1],
                "controlPoints": [{ "x": 1.0, "y": 2.0 }, { "x": 4.0, "y": 2.0 }],
            });
        })
    };
    let optional = "OPT-03";
    assert_eq!(corridor(json!({ "leftWidth": 1.0, "rightWidth": 1.0 })), [optional]);
    assert_eq!(
        corridor(json!({ "leftWidth": 0.0, "rightWidth": 0.0 })),
        ["CORR-05", optional]
    );
    assert_eq!(
        corridor(json!({ "leftWidth": -1.0, "rightWidth": 1.0 })),
        ["CORR-09", optional]
    );
    assert_eq!(
        with(|order| order["edges"][0]["corridor"] = json!({ "leftWidth": 1.0, "rightWidth": 1.0 })),
        ["CORR-02", optional]
    );
}

#[test]
fn curves_that_lead_elsewhere_are_found() {
    let curve = |knots: Value, y: f64| {
        with(move |order| {
            order["edges"][0]["trajectory"] = json!({
                "degree": 1, "knotVector": knots, "controlPoints": [{ "x": 1.0, "y": y }, { "x": 4.0, "y": y }],
            });
        })
    };
    assert_eq!(curve(json!([0, 0, 1, 1]), 2.0), ["OPT-03"]);
    assert_eq!(curve(json!([0, 0, 1]), 2.0), ["OPT-03", "ORD-MSG-29"]);
    assert_eq!(curve(json!("x"), 2.0), ["OPT-03", "ORD-MSG-28"]);
    assert_eq!(curve(json!([0, 0, 1, 1]), 5.0), ["OPT-03", "ORD-MSG-30"]);
}

#[test]
fn the_reference_point_of_a_corridor_has_the_name_of_its_version() {
    let corridor = |members: &Value| {
        let mut trace = Trace::master_control_of("3.0");
        let place = |x: f64| json!({ "x": x, "y": 2.0, "mapId": "hall" });
        let corridor = merged(json!({ "leftWidth": 1.0, "rightWidth": 1.0 }), members);
        let order = json!({
            "orderId": "o1", "orderUpdateId": 0,
            "nodes": [
                { "nodeId": "a", "sequenceId": 0, "released": true, "nodePosition": place(1.0), "actions": [] },
                { "nodeId": "b", "sequenceId": 2, "released": true, "nodePosition": place(4.0), "actions": [] },
            ],
            "edges": [{ "edgeId": "ab", "sequenceId": 1, "released": true, "corridor": corridor, "actions": [] }],
        });
        trace.commands("order", &order);
        trace.judge("commands/corridors").summary()
    };
    let point = |name: &str, word: &str| corridor(&json!({ name: word }));
    assert_eq!(corridor(&json!({})), Vec::<String>::new());
    assert_eq!(
        point("corridorReferencePoint", "KINEMATIC_CENTER"),
        Vec::<String>::new()
    );
    assert_eq!(point("corridorRefPoint", "KINEMATICCENTER"), ["CORR-09"]);
    // Who speaks to both versions may say both.
    let both = json!({ "corridorRefPoint": "KINEMATICCENTER", "corridorReferencePoint": "KINEMATIC_CENTER" });
    assert_eq!(corridor(&both), Vec::<String>::new());
}

#[test]
fn corridors_that_have_only_the_line_in_common_are_remarked() {
    let corridors = |widths: [(f64, f64); 2], allowed: f64| {
        let mut order = order("o1", 0, 0, 2, 2);
        for (at, (left, right)) in widths.into_iter().enumerate() {
            order["edges"][at]["corridor"] = json!({ "leftWidth": left, "rightWidth": right });
        }
        order["nodes"][0]["nodePosition"]["allowedDeviationXY"] = json!(allowed);
        let mut trace = Trace::master_control();
        trace.commands("order", &order);
        trace.judge("commands/corridors").summary()
    };
    assert_eq!(corridors([(1.0, 1.0), (1.0, 1.0)], 0.2), Vec::<String>::new());
    assert_eq!(corridors([(2.0, 0.0), (2.0, 0.5)], 0.2), Vec::<String>::new());
    assert_eq!(corridors([(2.0, 0.0), (0.0, 2.0)], 0.2), ["CORR-04 warning"]);
    assert_eq!(corridors([(0.0, 2.0), (2.0, 0.0)], 0.2), ["CORR-04 warning"]);
    assert_eq!(corridors([(0.5, 0.5), (1.0, 1.0)], 0.8), ["CORR-04 warning"]);
}
