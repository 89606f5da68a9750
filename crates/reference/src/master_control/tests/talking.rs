//! Loss, refusal, absence, modes, maps.

use serde_json::json;

use super::*;

#[test]
fn an_unseen_order_is_sent_again_unchanged_three_times_at_most() {
    let mut bench = Bench::new();
    bench.deaf = true;
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(60.0);
    let orders = bench.orders();
    assert_eq!(orders.len(), 4);
    let plain = |order: &Value| {
        let mut order = order.clone();
        order["headerId"] = Value::Null;
        order["timestamp"] = Value::Null;
        order
    };
    assert!(orders.iter().all(|order| plain(order) == plain(orders[0])));
    assert_ne!(orders[0]["headerId"], orders[1]["headerId"]);
}

#[test]
fn a_refused_order_is_not_repeated() {
    let mut bench = Bench::alone(MasterControl::new(config()));
    bench.say("connection", &connection("ONLINE"));
    bench.say("state", &state(&json!({})));
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(5.0);
    let order = bench.orders()[0].clone();
    let error = json!({
        "errorType": "orderError", "errorLevel": "WARNING",
        "errorReferences": [{ "referenceKey": "orderId", "referenceValue": order["orderId"] }],
    });
    for _ in 0..20 {
        bench.say("state", &state(&json!({ "errors": [error] })));
        bench.wait(3.0);
    }
    assert_eq!(bench.orders().len(), 1);
}

#[test]
fn nothing_is_sent_to_a_vehicle_that_is_away() {
    for literal in ["CONNECTIONBROKEN", "OFFLINE"] {
        let mut bench = Bench::alone(MasterControl::new(config()));
        bench.say("state", &state(&json!({})));
        bench.say("connection", &connection("ONLINE"));
        bench.say("connection", &connection(literal));
        bench.command("dispatch", json!({ "to": "n2" }));
        bench.wait(10.0);
        assert!(bench.orders().is_empty());
        assert!(bench.actions().is_empty());
        bench.say("connection", &connection("ONLINE"));
        bench.wait(10.0);
        assert!(!bench.orders().is_empty());
    }
}

#[test]
fn an_order_is_kept_while_the_vehicle_is_away() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(0.5);
    bench.say("connection", &connection("CONNECTIONBROKEN"));
    bench.wait(10.0);
    assert_eq!(bench.orders().len(), 1);
    bench.say("connection", &connection("ONLINE"));
    bench.wait(20.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
    let orders = bench.orders();
    assert!(orders.iter().all(|order| order["orderId"] == orders[0]["orderId"]));
}

#[test]
fn a_lost_connection_is_restored_and_the_order_goes_on() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(0.5);
    bench.master_gets(Input::ConnectionLost);
    bench.wait(5.0);
    assert!(bench.outputs.contains(&Output::Connect));
    bench.master_gets(Input::Connected);
    bench.wait(30.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
}

#[test]
fn a_vehicle_in_other_modes_is_left_alone() {
    for mode in ["MANUAL", "SERVICE", "TEACHIN"] {
        let mut bench = Bench::alone(MasterControl::new(config()));
        bench.say("connection", &connection("ONLINE"));
        bench.say("state", &state(&json!({ "operatingMode": mode })));
        bench.command("dispatch", json!({ "to": "n4" }));
        bench.command("pause", json!({}));
        bench.command("request-state", json!({}));
        bench.wait(20.0);
        assert!(bench.orders().is_empty() && bench.actions().is_empty(), "{mode}");
    }
}

#[test]
fn nothing_is_begun_with_an_unfit_vehicle() {
    let unfit = [
        json!({ "errors": [{ "errorType": "x", "errorLevel": "FATAL" }] }),
        json!({ "safetyState": { "eStop": "MANUAL", "fieldViolation": false } }),
        json!({ "agvPosition": { "x": 0.0, "y": 0.0, "theta": 0.0, "mapId": "hall", "positionInitialized": false } }),
        json!({ "batteryState": { "batteryCharge": 3.0, "charging": false } }),
    ];
    for changes in unfit {
        let mut bench = Bench::alone(MasterControl::new(config()));
        bench.say("connection", &connection("ONLINE"));
        bench.say("state", &state(&changes));
        bench.command("dispatch", json!({ "to": "n4" }));
        bench.wait(20.0);
        assert!(bench.orders().is_empty(), "{changes}");
        bench.say("state", &state(&json!({})));
        bench.wait(1.0);
        assert_eq!(bench.orders().len(), 1);
    }
}

#[test]
fn a_map_is_enabled_before_it_is_used() {
    let mut bench = Bench::alone(MasterControl::new(config()));
    bench.say("connection", &connection("ONLINE"));
    let map = |status: &str| json!([{ "mapId": "hall", "mapVersion": "1", "mapStatus": status }]);
    bench.say("state", &state(&json!({ "maps": map("DISABLED") })));
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(4.5);
    assert!(bench.orders().is_empty());
    assert!(bench.actions().contains(&"enableMap"), "{:?}", bench.actions());
    bench.say("state", &state(&json!({ "maps": map("ENABLED") })));
    bench.wait(1.0);
    assert_eq!(bench.orders().len(), 1);
}

#[test]
fn a_duplicate_is_deleted_before_the_download_is_repeated() {
    let mut bench = Bench::alone(MasterControl::new(config()));
    bench.say("connection", &connection("ONLINE"));
    bench.say("state", &state(&json!({})));
    bench.command(
        "download-map",
        json!({ "mapId": "yard", "mapVersion": "1", "mapDownloadLink": "http://maps/yard" }),
    );
    let failed = |bench: &Bench, kind: &str, status: &str| {
        let messages = bench.seen("instantActions");
        let mut actions = messages
            .iter()
            .rev()
            .flat_map(|message| message["actions"].as_array().unwrap());
        let action = actions.find(|action| action["actionType"] == kind).unwrap();
        state(&json!({
            "maps": [{ "mapId": "yard", "mapVersion": "1", "mapStatus": "DISABLED" }],
            "actionStates": [{ "actionId": action["actionId"], "actionStatus": status }],
        }))
    };
    let refusal = failed(&bench, "downloadMap", "FAILED");
    bench.say("state", &refusal);
    bench.wait(0.1);
    assert_eq!(bench.actions(), ["downloadMap", "deleteMap"]);
    let deleted = failed(&bench, "deleteMap", "FINISHED");
    bench.say("state", &deleted);
    bench.wait(0.1);
    assert_eq!(bench.actions(), ["downloadMap", "deleteMap", "downloadMap"]);
}

#[test]
fn positions_are_set_only_without_an_order() {
    let mut bench = Bench::new();
    bench.command("init-position", json!({ "nodeId": "n3" }));
    bench.wait(1.0);
    assert_eq!(bench.actions(), ["initPosition"]);
    assert_eq!(bench.state()["lastNodeId"], "n3");
    bench.command("dispatch", json!({ "to": "n5" }));
    bench.wait(0.5);
    bench.command("init-position", json!({ "nodeId": "n1" }));
    bench.wait(20.0);
    assert_eq!(bench.actions(), ["initPosition"]);
    assert_eq!(bench.state()["lastNodeId"], "n5");
}

#[test]
fn pauses_and_goes_on() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(0.5);
    bench.command("pause", json!({}));
    bench.wait(10.0);
    assert_eq!(bench.state()["paused"], true);
    assert_eq!(bench.state()["driving"], false);
    bench.command("resume", json!({}));
    bench.wait(20.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
}

#[test]
fn a_vehicle_switched_to_manual_goes_on_afterwards() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(1.0);
    bench.at_agv("set-mode", json!({ "mode": "MANUAL" }));
    bench.wait(10.0);
    bench.at_agv("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.wait(40.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
}
