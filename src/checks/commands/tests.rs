//! A faultless master control passes every check; each mistake is found, and by the check that is about it.

use proptest::prelude::*;
use serde_json::{Value, json};

use crate::checks::registry;
use crate::checks::trace::{Trace, merged};
use crate::journal::event::{Direction, LinkFault, Packet};

const NODES: [(&str, f64, f64); 6] = [
    ("n1", 1.0, 2.0),
    ("n2", 4.0, 2.0),
    ("n3", 7.0, 2.0),
    ("n4", 10.0, 2.0),
    ("n5", 13.0, 2.0),
    ("n6", 16.0, 2.0),
];

fn action(kind: &str, id: &str, parameters: &Value) -> Value {
    json!({ "actionType": kind, "actionId": id, "blockingType": "HARD", "actionParameters": parameters })
}

/// An order over nodes `from` to `to`, released up to `base`; sequenceIds belong to the place in `NODES`.
fn order(id: &str, update: u64, from: usize, base: usize, to: usize) -> Value {
    let node = |at: usize| {
        let (name, x, y) = NODES[at];
        json!({
            "nodeId": name, "sequenceId": 2 * at, "released": at <= base, "actions": [],
            "nodePosition": { "x": x, "y": y, "mapId": "hall", "allowedDeviationXY": 0.2 },
        })
    };
    let edge = |at: usize| {
        let (start, end) = (NODES[at].0, NODES[at + 1].0);
        json!({
            "edgeId": format!("{start}-{end}"), "sequenceId": 2 * at + 1, "released": at < base,
            "startNodeId": start, "endNodeId": end, "actions": [],
        })
    };
    json!({
        "orderId": id, "orderUpdateId": update,
        "nodes": (from..=to).map(node).collect::<Vec<_>>(),
        "edges": (from..to).map(edge).collect::<Vec<_>>(),
    })
}

fn sheet() -> Value {
    json!({
        "typeSpecification": { "localizationTypes": ["NATURAL"], "navigationTypes": ["AUTONOMOUS"] },
        "protocolLimits": {
            "maxStringLens": { "msgLen": 0, "idLen": 40 }, "maxArrayLens": { "order.nodes": 8 },
            "timing": { "minOrderInterval": 1.0, "minStateInterval": 0.1 },
        },
        "protocolFeatures": {
            "optionalParameters": [
                { "parameter": "order.nodes.nodePosition.allowedDeviationXY", "support": "REQUIRED" },
            ],
            "agvActions": [
                { "actionType": "pick", "actionScopes": ["NODE"], "blockingTypes": ["HARD"], "actionParameters": [
                    { "key": "stationType", "valueDataType": "STRING" },
                    { "key": "loadType", "valueDataType": "STRING" },
                    { "key": "lhd", "valueDataType": "STRING", "isOptional": true },
                ] },
            ],
        },
        "loadSpecification": { "loadPositions": ["left", "right"] },
    })
}

/// A vehicle that is known and idle on n1.
fn begun() -> Trace {
    let mut trace = Trace::master_control();
    trace.sent("factsheet", &sheet()).wait(20.0);
    trace.shows(&json!({ "maps": [{ "mapId": "hall", "mapVersion": "1", "mapStatus": "ENABLED" }] }));
    trace.wait(10.0);
    trace
}

/// What a vehicle under way shows.
fn under_way(order: &str, update: u64, released: usize) -> Value {
    let left: Vec<Value> = (0..released)
        .map(|at| json!({ "nodeId": NODES[at + 1].0, "sequenceId": 2 * at + 2, "released": true }))
        .collect();
    json!({ "orderId": order, "orderUpdateId": update, "driving": true, "nodeStates": left })
}

fn pick() -> Value {
    json!([
        { "key": "stationType", "value": "floor" },
        { "key": "loadType", "value": "EPAL" },
        { "key": "lhd", "value": "left" },
    ])
}

/// A whole transport with updates, a re-send, a cancellation and what comes behind it.
fn transport() -> Trace {
    let mut trace = begun();
    let mut first = order("o1", 0, 0, 2, 4);
    first["nodes"][2]["actions"] = json!([action("pick", "a1", &pick())]);
    trace.commands("order", &first).wait(2.0);
    // The state has not been seen in time.
    trace.commands("order", &first).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    let mut second = order("o1", 1, 2, 4, 5);
    second["nodes"][0]["actions"] = json!([action("pick", "a1", &pick())]);
    trace.commands("order", &second).wait(2.0);
    trace.shows(&under_way("o1", 1, 4)).wait(8.0);
    trace.commands(
        "instantActions",
        &json!({ "actions": [action("cancelOrder", "c1", &json!([]))] }),
    );
    trace.wait(1.0);
    trace.shows(&json!({
        "orderId": "o1", "orderUpdateId": 1, "lastNodeId": "n2", "lastNodeSequenceId": 2,
        "agvPosition": { "x": 4.1 },
        "actionStates": [{ "actionId": "c1", "actionType": "cancelOrder", "actionStatus": "FINISHED" }],
    }));
    trace.wait(8.0);
    let mut next = order("o2", 0, 1, 2, 3);
    for (list, shift) in [("nodes", 2), ("edges", 2)] {
        for element in next[list].as_array_mut().unwrap() {
            let sequence = element["sequenceId"].as_u64().unwrap();
            element["sequenceId"] = json!(sequence - shift);
        }
    }
    trace.commands("order", &next).wait(2.0);
    trace
}

fn commands() -> impl Iterator<Item = &'static str> {
    registry()
        .iter()
        .map(|check| check.name)
        .filter(|name| name.starts_with("commands/"))
}

/// Everything all checks of commands find.
fn all(trace: &Trace) -> Vec<String> {
    let mut all: Vec<String> = commands().flat_map(|name| trace.judge(name).summary()).collect();
    all.sort();
    all.dedup();
    all
}

#[test]
fn a_faultless_transport_passes_every_check() {
    let trace = transport();
    for name in commands() {
        let outcome = trace.judge(name);
        assert!(outcome.findings.is_empty(), "{name}: {:?}", outcome.findings);
    }
    for name in [
        "updates",
        "resent",
        "order-ids",
        "base-kept",
        "start",
        "actions-of-factsheet",
        "required-fields",
        "map-enabled",
    ] {
        assert!(
            trace.judge(&format!("commands/{name}")).judged > 0,
            "{name} judged nothing"
        );
    }
    for name in [
        "message/schema",
        "message/encoding",
        "header/identity",
        "header/version",
        "header/timestamp",
        "mqtt/quality",
        "topic/structure",
    ] {
        let outcome = trace.judge(name);
        assert!(outcome.findings.is_empty(), "{name}: {:?}", outcome.findings);
        assert!(outcome.judged > 0, "{name} judged nothing");
    }
}

#[test]
fn nothing_of_this_concerns_a_vehicle_under_test() {
    let mut trace = Trace::subscriber();
    trace
        .sent("factsheet", &sheet())
        .sent("order", &json!({ "orderId": "", "nodes": [] }));
    trace.state(&json!({}));
    for name in commands() {
        assert_eq!(trace.judge(name).judged, 0, "{name}");
    }
}

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
    assert_eq!(on_node(wrong), ["ACT-31"]);
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

/// An order that is driven, and then an update, changed.
fn updated(change: impl FnOnce(&mut Value)) -> Vec<String> {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    let mut second = order("o1", 1, 2, 4, 5);
    change(&mut second);
    trace.commands("order", &second);
    all(&trace)
}

#[test]
fn mistakes_in_updates_are_found() {
    assert_eq!(updated(|_| {}), Vec::<String>::new());
    assert_eq!(
        updated(|order| order["orderUpdateId"] = json!(0)),
        ["ORD-REJ-18 warning", "ORD-UPD-04"]
    );
    assert_eq!(
        updated(|order| order["orderUpdateId"] = json!(4)),
        ["ORD-UPD-04 warning"]
    );
    assert_eq!(
        updated(|order| order["orderId"] = json!("o2")),
        ["ORD-CANCEL-01", "ORD-UPD-04"]
    );
    assert_eq!(
        updated(|second| *second = order("o1", 1, 0, 4, 5)),
        ["ORD-UPD-03", "ORD-UPD-05"]
    );
    assert_eq!(updated(|second| *second = order("o1", 1, 3, 4, 5)), ["ORD-UPD-05"]);
    assert_eq!(
        updated(|order| order["nodes"][0]["nodePosition"]["x"] = json!(7.1)),
        ["ORD-MSG-07 inconclusive", "ORD-UPD-06"]
    );
    let restarted = |order: &mut Value| {
        for list in ["nodes", "edges"] {
            for element in order[list].as_array_mut().unwrap() {
                let sequence = element["sequenceId"].as_u64().unwrap();
                element["sequenceId"] = json!(sequence - 4);
            }
        }
    };
    assert_eq!(updated(restarted), ["ORD-UPD-05", "ORD-UPD-12"]);
    let replaced = |order: &mut Value| order["nodes"][0]["nodeId"] = json!("n9");
    assert!(updated(replaced).contains(&"ORD-CANCEL-01".to_owned()));
    let added = |order: &mut Value| order["nodes"][0]["actions"] = json!([action("pick", "late", &pick())]);
    assert_eq!(updated(added), ["ORD-UPD-06"]);
}

#[test]
fn an_update_the_vehicle_did_not_take_may_be_replaced() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace.commands("order", &order("o1", 1, 2, 4, 5)).wait(6.0);
    trace.shows(&under_way("o1", 0, 1)).wait(2.0);
    trace.commands("order", &order("o1", 2, 2, 3, 5));
    assert_eq!(all(&trace), Vec::<String>::new());
}

#[test]
fn an_order_that_replaces_another_one_waits_for_the_cancellation() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace.commands(
        "instantActions",
        &json!({ "actions": [action("cancelOrder", "c1", &json!([]))] }),
    );
    trace.wait(2.0).commands("order", &order("o2", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/base-kept").summary(), ["ORD-CANCEL-01"]);
    // Unless the vehicle has given up by itself.
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace
        .shows(&merged(under_way("o1", 0, 2), &json!({ "operatingMode": "MANUAL" })))
        .wait(2.0);
    trace.commands("order", &order("o2", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/base-kept").summary(), Vec::<String>::new());
}

#[test]
fn an_order_from_another_place_is_found_and_a_moved_vehicle_is_given_time() {
    let elsewhere = |moved: bool| {
        let mut trace = begun();
        trace.wait(10.0);
        if moved {
            trace.vehicle("place-on");
            trace.shows(&json!({ "lastNodeId": "n5", "agvPosition": { "x": 13.0 } }));
        }
        let mut order = order("o1", 0, 1, 2, 3);
        order["orderUpdateId"] = json!(0);
        trace.commands("order", &order);
        trace.judge("commands/start").summary()
    };
    assert_eq!(elsewhere(false), ["ORD-03"]);
    assert_eq!(elsewhere(true), Vec::<String>::new());
}

#[test]
fn a_first_order_of_a_high_update_is_judged_where_nothing_was_under_way() {
    let elsewhere = |settled: bool| {
        let mut trace = begun();
        trace.with.insert("settled".to_owned(), json!(settled));
        trace.wait(10.0);
        let mut order = order("o1", 0, 1, 2, 3);
        order["orderUpdateId"] = json!(7);
        trace.commands("order", &order);
        trace.judge("commands/start").summary()
    };
    assert_eq!(elsewhere(true), ["ORD-03"]);
    assert_eq!(elsewhere(false), Vec::<String>::new());
}

#[test]
fn a_vehicle_between_nodes_goes_on_from_there() {
    let begins = |deviation: Option<f64>, from: usize| {
        let mut trace = begun();
        trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("cancelOrder", "c1", &json!([]))] }),
        );
        let stopped = json!({ "orderId": "o1", "lastNodeId": "n1", "agvPosition": { "x": 2.6 } });
        trace.wait(1.0).shows(&stopped).wait(10.0);
        let mut next = order("o2", 0, from, from + 1, from + 2);
        let position = next["nodes"][0]["nodePosition"].as_object_mut().unwrap();
        position.remove("allowedDeviationXY");
        position.extend(deviation.map(|deviation| ("allowedDeviationXY".to_owned(), json!(deviation))));
        trace.commands("order", &next);
        trace.judge("commands/start-between-nodes").summary()
    };
    assert_eq!(begins(Some(2.0), 0), Vec::<String>::new());
    assert_eq!(begins(None, 0), ["ORD-CANCEL-17 warning"]);
    assert_eq!(begins(Some(0.1), 0), ["ORD-CANCEL-17"]);
    assert_eq!(begins(Some(0.2), 1), ["ORD-CANCEL-17"]);
}

#[test]
fn nothing_is_sent_to_people() {
    let in_manual = |wait: f64, kind: &str| {
        let mut trace = begun();
        trace.shows(&json!({ "operatingMode": "MANUAL" })).wait(wait);
        trace.commands(
            "instantActions",
            &json!({ "actions": [action(kind, "i1", &json!([]))] }),
        );
        trace.judge("commands/modes").summary()
    };
    assert_eq!(in_manual(1.0, "startPause"), Vec::<String>::new());
    assert_eq!(in_manual(10.0, "startPause"), ["MODE-04"]);
    assert_eq!(in_manual(10.0, "stateRequest"), ["MODE-04 warning"]);
}

#[test]
fn orders_that_come_too_fast_are_found() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(0.95);
    trace.commands("order", &order("o1", 1, 2, 3, 4)).wait(0.5);
    trace.commands("order", &order("o1", 2, 3, 4, 5));
    assert_eq!(trace.judge("commands/order-interval").summary(), ["FACT-13"]);
}

#[test]
fn a_map_that_was_refused_is_deleted_first() {
    let map = json!([
        { "key": "mapId", "value": "hall" }, { "key": "mapVersion", "value": "1" },
        { "key": "mapDownloadLink", "value": "http://maps/hall" },
    ]);
    let again = |delete: bool| {
        let mut trace = begun();
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("downloadMap", "d1", &map)] }),
        );
        trace.wait(1.0).shows(&json!({
            "maps": [{ "mapId": "hall", "mapVersion": "1", "mapStatus": "ENABLED" }],
            "actionStates": [{ "actionId": "d1", "actionStatus": "FAILED" }],
        }));
        trace.wait(10.0);
        if delete {
            trace.commands(
                "instantActions",
                &json!({ "actions": [action("deleteMap", "d2", &map)] }),
            );
        }
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("downloadMap", "d3", &map)] }),
        );
        trace.judge("commands/map-duplicate").summary()
    };
    assert_eq!(again(false), ["MAP-28"]);
    assert_eq!(again(true), Vec::<String>::new());
    let mut trace = begun();
    trace.commands(
        "instantActions",
        &json!({ "actions": [action("downloadMap", "d1", &json!([]))] }),
    );
    assert_eq!(
        trace.judge("commands/map-download").summary(),
        ["MAP-16", "MAP-16", "MAP-16 warning"]
    );
}

#[test]
fn ids_that_are_used_twice_are_found() {
    let mut trace = begun();
    for order_id in ["o1", "o2"] {
        let mut order = order(order_id, 0, 0, 2, 4);
        order["nodes"][1]["actions"] = json!([action("pick", "a1", &pick())]);
        trace.commands("order", &order);
    }
    assert_eq!(trace.judge("commands/action-ids").summary(), ["ORD-MSG-17"]);
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 2)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(10.0);
    trace.shows(&json!({ "orderId": "o1", "lastNodeId": "n3" })).wait(10.0);
    trace.commands("order", &order("o1", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/order-ids").summary(), ["ORD-MSG-02"]);
    assert_eq!(trace.judge("commands/updates").summary(), Vec::<String>::new());
}

#[test]
fn what_was_sent_on_a_broken_link_is_forgotten() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace
        .fault(LinkFault::Cut { reset: false })
        .fault(LinkFault::Restore)
        .wait(2.0);
    trace.commands("order", &order("o1", 5, 3, 4, 5));
    assert_eq!(all(&trace), Vec::<String>::new());
}

#[test]
fn a_factsheet_that_has_just_changed_is_not_held_against_anybody() {
    let changed = |wait: f64| {
        let mut trace = begun();
        let mut strict = sheet();
        strict["protocolLimits"]["maxArrayLens"]["order.nodes"] = json!(2);
        trace.sent("factsheet", &strict).wait(wait);
        trace.commands("order", &order("o1", 0, 0, 2, 4));
        trace.judge("commands/limits").summary()
    };
    assert_eq!(changed(1.0), Vec::<String>::new());
    assert_eq!(changed(10.0), ["FACT-12"]);
}

#[test]
fn headers_topics_and_quality_of_a_master_control_are_judged() {
    let mut trace = begun();
    trace.commands(
        "order",
        &merged(order("o1", 0, 0, 2, 4), &json!({ "serialNumber": "me" })),
    );
    assert_eq!(trace.judge("header/identity").summary(), ["TOPIC-04 warning", "HDR-05"]);
    let mut trace = Trace::master_control_at_tap();
    trace.connect(1, None, 60, 3);
    trace.publish(1, "order", 1, false, &json!({}));
    trace.publish(1, "connection", 1, true, &json!({}));
    assert_eq!(trace.judge("mqtt/connect").summary(), ["MQTT-01"]);
    assert_eq!(trace.judge("mqtt/quality").summary(), ["MQTT-06 warning"]);
    assert_eq!(trace.judge("topic/own-side").summary(), ["TOPIC-15"]);
    let elsewhere = |topic: &str, check: &str| {
        let mut trace = Trace::master_control_at_tap();
        let packet = Packet::Publish {
            topic: topic.to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload: crate::journal::Payload::keep(bytes::Bytes::from_static(b"{}")),
        };
        trace.packet(1, Direction::FromDevice, packet);
        trace.judge(check).summary()
    };
    assert_eq!(elsewhere("uagv/v2/acme/7/instant_actions", "topic/names"), ["TOPIC-01"]);
    assert_eq!(elsewhere("erp/Order", "topic/names"), Vec::<String>::new());
    assert_eq!(elsewhere("uagv/acme/7/order", "topic/structure"), ["TOPIC-02 warning"]);
    assert_eq!(
        elsewhere("uagv/v9/acme/7/order", "topic/structure"),
        ["TOPIC-03 warning"]
    );
    assert_eq!(
        elsewhere("uagv/v2/acme/$7/order", "topic/structure"),
        ["TOPIC-07 warning"]
    );
}

#[test]
fn the_schema_names_the_requirements_of_commands() {
    let schema = |change: fn(&mut Value)| {
        let mut trace = begun();
        let mut order = order("o1", 0, 0, 2, 4);
        change(&mut order);
        trace.commands("order", &order);
        trace.judge("message/schema").summary()
    };
    assert_eq!(
        schema(|order| order["orderUpdateId"] = json!("0")),
        ["JSON-10", "JSON-06", "ORD-MSG-01"]
    );
    assert_eq!(
        schema(|order| order["nodes"][0]["released"] = json!("true")),
        ["JSON-10", "JSON-07", "ORD-MSG-05"]
    );
    assert_eq!(
        schema(|order| order["edges"][0]["edgeId"] = json!(7)),
        ["JSON-10", "JSON-06", "ORD-MSG-18"]
    );
    let blocking = |order: &mut Value| {
        order["nodes"][0]["actions"] = json!([{ "actionType": "x", "actionId": "a", "blockingType": "hard" }]);
    };
    assert_eq!(schema(blocking), ["JSON-10", "JSON-02", "ORD-MSG-16"]);
    let snake = |order: &mut Value| order["nodes"][0]["sequence_id"] = json!(0);
    assert_eq!(schema(snake), ["JSON-01"]);
}

#[test]
fn an_instant_action_that_must_not_come_is_found_under_the_older_name_of_the_array_too() {
    for list in ["actions", "instantActions"] {
        let mut trace = begun();
        trace.with.insert("types".into(), json!(["pick"]));
        let pause = json!({ list: [action("startPause", "a1", &json!([]))] });
        trace.commands("instantActions", &pause).wait(1.0);
        assert_eq!(trace.judge("commands/not-asked").summary(), [""; 0]);
        trace.commands("instantActions", &json!({ list: [action("pick", "a2", &pick())] }));
        assert_eq!(trace.judge("commands/not-asked").findings.len(), 1);
        trace.with = serde_json::Map::new();
        trace.with.insert("except".into(), json!(["pick"]));
        let found = trace.judge("commands/not-asked").findings;
        assert!(found.len() == 1 && found[0].message.contains("startPause"));
    }
}

/// Values as they may come: names the checks look for, with anything in them.
fn anything() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop::sample::select(vec![
            "",
            "pick",
            "downloadMap",
            "cancelOrder",
            "n1",
            "hall",
            "HARD",
            "ü"
        ])
        .prop_map(Value::from),
    ];
    let names = vec![
        "orderId",
        "orderUpdateId",
        "nodes",
        "edges",
        "nodeId",
        "edgeId",
        "sequenceId",
        "released",
        "actions",
        "nodePosition",
        "x",
        "y",
        "mapId",
        "actionId",
        "actionType",
        "blockingType",
        "actionParameters",
        "key",
        "value",
        "corridor",
        "leftWidth",
        "rightWidth",
        "trajectory",
        "knotVector",
        "controlPoints",
        "degree",
        "zoneSetId",
        "maps",
        "actionStates",
        "protocolFeatures",
        "agvActions",
        "optionalParameters",
        "protocolLimits",
        "maxArrayLens",
        "typeSpecification",
    ];
    leaf.prop_recursive(6, 96, 6, move |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::btree_map(prop::sample::select(names.clone()), inner, 0..8).prop_map(|members| {
                Value::Object(
                    members
                        .into_iter()
                        .map(|(name, value)| (name.to_owned(), value))
                        .collect(),
                )
            }),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_message_makes_a_check_panic(messages in prop::collection::vec((0_usize..4, anything()), 1..8)) {
        let mut trace = begun();
        for (kind, message) in &messages {
            match kind {
                0 => trace.message("order", message),
                1 => trace.message("instantActions", message),
                2 => trace.sent("state", message),
                _ => trace.sent("factsheet", message),
            };
            trace.wait(6.0);
        }
        for name in commands() {
            let _ = trace.judge(name);
        }
    }
}
