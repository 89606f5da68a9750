//! What later versions ask of a master control beside what all do: names, sleep, lists, retries.

use serde_json::json;
use tck_view::Names;

use super::*;

/// A master control and a vehicle without a device behind it, of a version with all that is switched on later.
fn bench() -> Bench {
    let mut config = config();
    for vehicle in &mut config.vehicles {
        let further = [
            "instantActionStates",
            "instantActionsNeverBlock",
            "cancelByOrderId",
            "hibernation",
            "retry",
            "strictUpdates",
            "triggers",
        ];
        vehicle.features.extend(further.map(str::to_owned));
        vehicle.timestamp_digits = 3;
        vehicle.names = serde_json::from_value::<Names>(json!({
            "state": { "agvPosition": "place", "instantActionStates": true },
            "edge": { "startNodeId": false, "endNodeId": false, "maxSpeed": "fastest" },
            "factsheet": { "vehicleConfig": "config" },
        }))
        .unwrap();
    }
    let mut bench = Bench::alone(MasterControl::new(config));
    bench.say("connection", &connection("ONLINE"));
    bench.say(
        "factsheet",
        &json!({
            "manufacturer": "Reference", "serialNumber": "agv-1",
            "protocolFeatures": { "optionalParameters": [{ "parameter": "order.edges.fastest", "support": "SUPPORTED" }] },
        }),
    );
    bench
}

/// A state whose place goes by the name of the version.
fn placed(changes: &Value) -> Value {
    let mut state = state(changes);
    let place = state.as_object_mut().unwrap().remove("agvPosition").unwrap();
    state["place"] = place;
    state
}

#[test]
fn members_go_by_the_names_of_the_version() {
    let mut bench = bench();
    bench.say("state", &placed(&json!({ "lastNodeId": "" })));
    bench.command("dispatch", json!({ "to": "n2" }));
    bench.wait(1.0);
    let order = bench.orders()[0];
    assert_eq!(order["nodes"][0]["nodeId"], "n1", "it stands where its place says");
    let edge = order["edges"][0].as_object().unwrap();
    assert!(edge.contains_key("fastest") && !edge.contains_key("maxSpeed") && !edge.contains_key("startNodeId"));
    let time = order["timestamp"].as_str().unwrap();
    assert_eq!(time.rsplit('.').next().unwrap().len(), 4, "{time}");
}

#[test]
fn optional_parameters_are_read_by_the_names_of_the_version() {
    let vehicle = bench().master.config().vehicles[0].clone();
    let usual = |own: &str| vehicle.usual_parameter(own);
    assert_eq!(usual("order.edges.fastest").as_deref(), Some("order.edges.maxSpeed"));
    assert_eq!(
        usual("order.nodes.nodePosition.theta").as_deref(),
        Some("order.nodes.nodePosition.theta")
    );
    assert_eq!(usual("order.edges.startNodeId"), None);
}

#[test]
fn a_sleeping_vehicle_is_woken_before_it_is_told_anything() {
    let mut bench = bench();
    bench.say("state", &placed(&json!({})));
    bench.say("connection", &connection("HIBERNATING"));
    bench.wait(30.0);
    assert!(bench.actions().is_empty() && bench.orders().is_empty());
    bench.command("dispatch", json!({ "to": "n2" }));
    bench.wait(1.0);
    assert_eq!(bench.actions(), ["stopHibernation"]);
    assert!(bench.orders().is_empty());
    bench.say("connection", &connection("ONLINE"));
    bench.say("state", &placed(&json!({})));
    bench.wait(1.0);
    assert_eq!(bench.orders().len(), 1);
}

#[test]
fn what_has_ended_in_a_list_of_instant_actions_is_cleared_once() {
    let mut bench = bench();
    let ended = |kind: &str| json!({ "actionId": kind, "actionType": kind, "actionStatus": "FINISHED" });
    bench.say(
        "state",
        &placed(&json!({ "instantActionStates": [ended("startPause")] })),
    );
    bench.wait(0.5);
    assert_eq!(bench.actions(), ["clearInstantActions"]);
    let cleared = bench.seen("instantActions")[0]["actions"][0].clone();
    assert_eq!(cleared["blockingType"], "NONE");
    let left = json!([{
        "actionId": cleared["actionId"], "actionType": "clearInstantActions", "actionStatus": "FINISHED",
    }]);
    bench.say("state", &placed(&json!({ "instantActionStates": left })));
    bench.wait(30.0);
    assert_eq!(bench.actions().len(), 1);
}

#[test]
fn a_retry_names_the_action_that_waits_for_it() {
    let mut bench = bench();
    let waits = json!([{ "actionId": "a1", "actionType": "pick", "actionStatus": "RETRIABLE" }]);
    bench.command("retry", json!({}));
    bench.say("state", &placed(&json!({ "actionStates": waits })));
    bench.wait(0.5);
    assert!(bench.actions().is_empty(), "nobody has asked for it since");
    bench.command("skip-retry", json!({}));
    bench.wait(0.5);
    let told = &bench.seen("instantActions")[0]["actions"][0];
    assert_eq!(told["actionType"], "skipRetry");
    assert_eq!(told["actionParameters"], json!([{ "key": "actionId", "value": "a1" }]));
}

#[test]
fn an_order_is_called_off_by_its_id_also_while_somebody_intervenes() {
    let mut bench = bench();
    bench.say("state", &placed(&json!({})));
    bench.command("dispatch", json!({ "to": "n3" }));
    bench.wait(0.5);
    let id = bench.orders()[0]["orderId"].clone();
    let left = json!([{ "nodeId": "n2", "sequenceId": 2, "released": true }]);
    let driven = json!({ "orderId": id, "nodeStates": left, "operatingMode": "INTERVENED" });
    bench.say("state", &placed(&driven));
    bench.command("pause", json!({}));
    bench.command("cancel", json!({}));
    bench.wait(1.0);
    assert_eq!(bench.actions(), ["cancelOrder"]);
    let told = &bench.seen("instantActions")[0]["actions"][0];
    assert_eq!(told["actionParameters"], json!([{ "key": "orderId", "value": id }]));
}
