//! Transports driven to their end.

use serde_json::json;

use super::*;

#[test]
fn a_transport_is_driven_to_its_end_without_a_halt_at_a_decision_point() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(20.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
    assert_eq!(bench.state()["nodeStates"], json!([]));
    let orders = bench.orders();
    assert_eq!(ids(orders[0])[0], "n1");
    assert_eq!(orders[0]["nodes"][0]["sequenceId"], 0);
    assert!(orders.len() > 1, "the base was extended");
    let mut released = 0;
    for order in orders.iter().skip(1) {
        assert_eq!(order["orderId"], orders[0]["orderId"]);
        assert_eq!(order["nodes"][0]["released"], true);
        assert!(order["nodes"][0]["sequenceId"].as_u64().unwrap() > released);
        released = order["nodes"][0]["sequenceId"].as_u64().unwrap();
    }
    let halted = bench.seen("state").into_iter().any(|state| {
        let waits = state["nodeStates"].as_array().unwrap();
        let waits = !waits.is_empty() && waits.iter().all(|node| node["released"] == false);
        waits && state["driving"] == false
    });
    assert!(!halted, "the vehicle had to halt");
    assert!(bench.seen("state").iter().all(|state| state["errors"] == json!([])));
}

#[test]
fn a_load_is_picked_and_dropped() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "from": "n3", "to": "n5", "loadType": "EPAL" }));
    bench.wait(9.0);
    let carried = bench.seen("state").into_iter().any(|state| state["loads"] != json!([]));
    assert!(carried);
    bench.wait(20.0);
    assert_eq!(bench.state()["lastNodeId"], "n5");
    let kinds: Vec<_> = bench.state()["actionStates"].as_array().unwrap().iter().collect();
    assert!(
        kinds.iter().all(|action| action["actionStatus"] == "FINISHED"),
        "{kinds:?}"
    );
}

#[test]
fn transports_follow_one_another() {
    let mut bench = Bench::new();
    for to in ["n2", "n3", "n2"] {
        bench.command("dispatch", json!({ "to": to }));
    }
    bench.wait(30.0);
    let mut order_ids: Vec<_> = bench.orders().iter().map(|order| order["orderId"].clone()).collect();
    order_ids.dedup();
    assert_eq!(order_ids.len(), 3);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn a_cancelled_order_is_followed_by_one_from_where_the_vehicle_stands() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(1.2);
    bench.command("cancel", json!({}));
    bench.command("dispatch", json!({ "to": "n1" }));
    bench.wait(20.0);
    assert_eq!(bench.actions(), ["cancelOrder"]);
    assert_eq!(bench.state()["lastNodeId"], "n1");
    let orders = bench.orders();
    let last = orders
        .iter()
        .find(|order| order["orderId"] != orders[0]["orderId"])
        .unwrap();
    assert!(!ids(last)[0].starts_with('n'), "a temporary node: {last}");
    let cancelled = bench
        .passed
        .iter()
        .find(|passed| passed.topic.ends_with("instantActions"))
        .unwrap();
    let next = bench.passed.iter().filter(|passed| passed.topic.ends_with("/order"));
    assert!(
        next.clone()
            .any(|passed| passed.at >= cancelled.at && passed.body["orderId"] == last["orderId"])
    );
}

#[test]
fn another_destination_replaces_the_horizon() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(0.5);
    bench.command("reroute", json!({ "to": "n5" }));
    bench.wait(30.0);
    assert_eq!(bench.state()["lastNodeId"], "n5");
    let orders = bench.orders();
    assert!(
        orders.iter().all(|order| order["orderId"] == orders[0]["orderId"]),
        "{orders:?}"
    );
    assert!(bench.actions().is_empty());
}

#[test]
fn a_base_that_has_to_change_is_called_off() {
    let mut bench = Bench::new();
    bench.command("dispatch", json!({ "to": "n2" }));
    bench.wait(0.5);
    bench.command("reroute", json!({ "to": "n6" }));
    bench.wait(30.0);
    assert_eq!(bench.actions(), ["cancelOrder"]);
    assert_eq!(bench.state()["lastNodeId"], "n6");
}

#[test]
fn a_closed_way_is_not_used() {
    let mut bench = Bench::new();
    bench.command("block-edge", json!({ "from": "n2", "to": "n3" }));
    bench.command("block-edge", json!({ "from": "n5", "to": "n4" }));
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(20.0);
    assert_ne!(bench.state()["lastNodeId"], "n4");
    for order in bench.orders() {
        for edge in order["edges"].as_array().unwrap() {
            assert!(edge["edgeId"] != "n2-n3" && edge["edgeId"] != "n5-n4", "{order}");
        }
    }
    bench.command("unblock-edge", json!({ "from": "n2", "to": "n3" }));
    bench.command("unblock-edge", json!({ "from": "n5", "to": "n4" }));
    bench.wait(20.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
}

#[test]
fn a_trigger_that_does_not_come_ends_the_order() {
    let mut config = config();
    config.trigger_timeout = Duration::from_secs(5);
    let mut bench = Bench::with(MasterControl::new(config), agv_config("agv-1"));
    bench.command("dispatch", json!({ "to": "n2", "action": "waitForTrigger" }));
    bench.wait(4.0);
    assert!(bench.actions().is_empty());
    bench.wait(8.0);
    assert_eq!(bench.actions(), ["cancelOrder"]);
}
