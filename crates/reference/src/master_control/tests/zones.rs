//! Zones that are given to vehicles, and what is said to their requests.

use serde_json::{Value, json};

use super::{Bench, connection, state, topics};
use crate::master_control::{MasterControl, MasterControlConfig, VehicleConfig};

/// A master control of two vehicles whose version has zones; nobody but the test speaks for them.
fn bench() -> Bench {
    let vehicle = |serial: &str| {
        let mut topics = topics(serial);
        for name in ["zoneSet", "responses"] {
            topics.insert(name.to_owned(), format!("uagv/v7/Reference/{serial}/{name}"));
        }
        VehicleConfig {
            manufacturer: "Reference".into(),
            serial_number: serial.into(),
            version: super::VERSION.into(),
            features: ["zones", "requests"].map(String::from).into(),
            timestamp_digits: 3,
            topics,
            ..VehicleConfig::default()
        }
    };
    let config = MasterControlConfig {
        vehicles: vec![vehicle("agv-1"), vehicle("agv-2")],
        ..MasterControlConfig::default()
    };
    let mut bench = Bench::alone(MasterControl::new(config));
    for serial in ["agv-1", "agv-2"] {
        says(&mut bench, serial, "connection", connection("ONLINE"));
        let sheet = json!({
            "typeSpecification": { "supportedZones": ["RELEASE", "SPEED_LIMIT"] },
            "protocolLimits": { "maxArrayLens": { "zoneSet.zones": 3 } },
            "protocolFeatures": { "agvActions": [
                { "actionType": "enableZoneSet", "actionScopes": ["INSTANT"] },
                { "actionType": "deleteZoneSet", "actionScopes": ["INSTANT"] },
            ] },
        });
        says(&mut bench, serial, "factsheet", sheet);
        says(&mut bench, serial, "state", state(&json!({})));
    }
    bench
}

/// Something is said for one of the vehicles.
fn says(bench: &mut Bench, serial: &str, topic: &str, mut body: Value) {
    body["manufacturer"] = json!("Reference");
    body["serialNumber"] = json!(serial);
    bench.master_gets(crate::Input::Message {
        topic: format!("uagv/v7/Reference/{serial}/{topic}"),
        payload: body.to_string().into(),
    });
}

/// A vehicle shows these sets and this request.
fn shows(bench: &mut Bench, serial: &str, sets: &Value, request: Option<(&str, &str)>) {
    let set = sets[0]["zoneSetId"].clone();
    let request = request.map(|(id, status)| {
        json!({ "requestId": id, "requestType": "ACCESS", "zoneId": "release-1", "zoneSetId": set, "requestStatus": status })
    });
    let asked: Vec<Value> = request.into_iter().collect();
    says(
        bench,
        serial,
        "state",
        state(&json!({ "zoneSets": sets, "zoneRequests": asked })),
    );
}

/// What was said to a vehicle: requestId and grantType.
fn answers(bench: &Bench, serial: &str) -> Vec<(String, String)> {
    let suffix = format!("/{serial}/responses");
    let passed = bench.passed.iter().filter(|passed| passed.topic.ends_with(&suffix));
    let all = passed.flat_map(|passed| passed.body["responses"].as_array().unwrap());
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    all.map(|answer| (text(&answer["requestId"]), text(&answer["grantType"])))
        .collect()
}

/// The id of a set that a vehicle was given, and shows as enabled from then on.
fn given(bench: &mut Bench, serial: &str) -> Value {
    bench.command(
        "distribute-zones",
        json!({ "vehicle": serial, "nodeId": "n2", "what": "release" }),
    );
    let id = bench.seen("zoneSet").last().unwrap()["zoneSet"]["zoneSetId"].clone();
    let sets = json!([{ "zoneSetId": id, "mapId": "hall", "zoneSetStatus": "ENABLED" }]);
    shows(bench, serial, &sets, None);
    sets
}

#[test]
fn a_set_is_sent_enabled_and_replaced_by_an_empty_one() {
    let mut bench = bench();
    bench.command("distribute-zones", json!({ "nodeId": "n2", "what": "many" }));
    let set = bench.seen("zoneSet")[0]["zoneSet"].clone();
    assert_eq!(set["zones"].as_array().unwrap().len(), 3, "{set}");
    let listed = json!([{ "zoneSetId": set["zoneSetId"], "mapId": "hall", "zoneSetStatus": "DISABLED" }]);
    assert!(bench.actions().is_empty());
    shows(&mut bench, "agv-1", &listed, None);
    assert_eq!(bench.actions(), ["enableZoneSet"]);
    bench.command("withdraw-zones", json!({}));
    let empty = bench.seen("zoneSet").last().unwrap()["zoneSet"].clone();
    assert_eq!(empty["zones"], json!([]));
    let both = json!([
        { "zoneSetId": empty["zoneSetId"], "mapId": "hall", "zoneSetStatus": "ENABLED" },
        { "zoneSetId": set["zoneSetId"], "mapId": "hall", "zoneSetStatus": "DISABLED" },
    ]);
    shows(&mut bench, "agv-1", &both, None);
    assert_eq!(bench.actions().last(), Some(&"deleteZoneSet"));
}

#[test]
fn a_set_that_is_not_listed_is_sent_again_and_then_given_up() {
    let mut bench = bench();
    bench.command("distribute-zones", json!({ "nodeId": "n2", "what": "release" }));
    bench.wait(100.0);
    let sent = bench.seen("zoneSet").len();
    assert!((2..6).contains(&sent), "{sent}");
    bench.command("dispatch", json!({ "to": "n3" }));
    assert_eq!(bench.orders().len(), 1, "orders do not wait for ever");
}

#[test]
fn a_zone_is_given_to_one_vehicle_at_a_time_until_it_is_seen_to_be_free() {
    let mut bench = bench();
    let first = given(&mut bench, "agv-1");
    let second = given(&mut bench, "agv-2");
    shows(&mut bench, "agv-1", &first, Some(("a", "REQUESTED")));
    shows(&mut bench, "agv-1", &first, Some(("a", "GRANTED")));
    shows(&mut bench, "agv-2", &second, Some(("b", "REQUESTED")));
    assert_eq!(answers(&bench, "agv-1"), [("a".into(), "GRANTED".into())]);
    assert_eq!(answers(&bench, "agv-2"), [("b".into(), "QUEUED".into())]);
    bench.command("revoke-grant", json!({ "vehicle": "agv-1" }));
    assert_eq!(answers(&bench, "agv-1").last().unwrap().1, "REVOKED");
    shows(&mut bench, "agv-1", &first, Some(("a", "GRANTED")));
    assert_eq!(answers(&bench, "agv-2").len(), 1, "it may still be inside");
    shows(&mut bench, "agv-1", &first, Some(("a", "REVOKED")));
    assert_eq!(answers(&bench, "agv-2").last().unwrap().1, "GRANTED");
}

#[test]
fn a_lease_is_prolonged_while_the_vehicle_shows_it_and_not_beyond() {
    let mut bench = bench();
    let sets = given(&mut bench, "agv-1");
    shows(&mut bench, "agv-1", &sets, Some(("a", "REQUESTED")));
    shows(&mut bench, "agv-1", &sets, Some(("a", "GRANTED")));
    bench.wait(12.0);
    assert_eq!(answers(&bench, "agv-1").len(), 2);
    let lease = |index: usize| {
        bench.seen("responses")[index]["responses"][0]["leaseExpiry"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    assert!(lease(1) > lease(0), "{} {}", lease(0), lease(1));
    shows(&mut bench, "agv-1", &sets, None);
    bench.wait(60.0);
    assert_eq!(answers(&bench, "agv-1").len(), 2);
}

#[test]
fn what_it_does_not_know_is_rejected() {
    let mut bench = bench();
    let sets = json!([{ "zoneSetId": "other", "mapId": "hall", "zoneSetStatus": "ENABLED" }]);
    shows(&mut bench, "agv-1", &sets, Some(("a", "REQUESTED")));
    assert_eq!(answers(&bench, "agv-1"), [("a".into(), "REJECTED".into())]);
    let corridor = json!([{ "requestId": "c", "requestType": "CORRIDOR", "edgeId": "e", "sequenceId": 1, "requestStatus": "REQUESTED" }]);
    says(
        &mut bench,
        "agv-1",
        "state",
        state(&json!({ "edgeRequests": corridor })),
    );
    assert_eq!(
        answers(&bench, "agv-1").last().unwrap(),
        &("c".to_owned(), "REJECTED".to_owned())
    );
}
