//! A faultless master control passes every check; each mistake is found, and by the check that is about it.

mod anything;
mod orders;
mod surroundings;
mod updates;

use serde_json::{Value, json};

use crate::REGISTRY;
use crate::trace::{Trace, merged};

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
    REGISTRY
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
