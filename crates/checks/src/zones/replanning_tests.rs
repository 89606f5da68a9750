use serde_json::{Value, json};

use super::release_tests::{answer, vehicle};
use crate::trace::{Trace, merged};

const ZONE: &str = "COORDINATED_REPLANNING";
const BEFORE: [f64; 2] = [0.0, 0.5];
const INSIDE: [f64; 3] = [2.3, 3.0, 3.5];

/// At x on its order, with these requests.
fn at(trace: &mut Trace, x: f64, requests: &Value) {
    trace.wait(0.2).state(&json!({
        "operatingMode": "AUTOMATIC", "driving": true, "orderId": "o", "lastNodeId": "a", "lastNodeSequenceId": 0,
        "zoneSets": [{ "zoneSetId": "z", "mapId": "hall", "zoneSetStatus": "ENABLED" }],
        "mobileRobotPosition": { "x": x, "y": 0.0, "theta": 0.0, "mapId": "hall", "localized": true },
        "zoneRequests": requests,
    }));
}

fn drive(trace: &mut Trace, places: &[f64], requests: &Value) {
    for x in places {
        at(trace, *x, requests);
    }
}

fn way(points: &[(f64, f64)]) -> Value {
    let last = u32::try_from(points.len() - 1).unwrap();
    let knots = [0].into_iter().chain(0..=last).chain([last]);
    let knots: Vec<f64> = knots.map(|knot| f64::from(knot) / f64::from(last)).collect();
    let points: Vec<Value> = points.iter().map(|(x, y)| json!({ "x": x, "y": y })).collect();
    json!({ "degree": 1, "knotVector": knots, "controlPoints": points })
}

fn straight() -> Value {
    way(&[(0.0, 0.0), (6.0, 0.0)])
}

/// A way that leaves the straight line by as much as this in the zone.
fn aside(off: f64) -> Value {
    way(&[(0.0, 0.0), (1.5, off), (4.5, off), (6.0, 0.0)])
}

fn request(id: &str, zone: &str, status: &str, way: &Value) -> Value {
    json!({
        "requestId": id, "requestType": "REPLANNING", "zoneId": zone, "zoneSetId": "z", "requestStatus": status,
        "trajectory": way,
    })
}

/// Drives straight through a zone, having asked for this way, and been granted it.
fn granted(way: &Value) -> Trace {
    let mut trace = vehicle(&[("r", ZONE)]);
    order(&mut trace, None);
    through(&mut trace, way);
    trace
}

fn order(trace: &mut Trace, trajectory: Option<&Value>) {
    trace.sent("order", &ordered(trajectory));
}

fn ordered(trajectory: Option<&Value>) -> Value {
    let mut edge = json!({ "edgeId": "e", "sequenceId": 1, "released": true, "startNodeId": "a", "endNodeId": "b", "actions": [] });
    if let Some(trajectory) = trajectory {
        edge["trajectory"] = trajectory.clone();
    }
    let node =
        |id: &str, sequence: u32| json!({ "nodeId": id, "sequenceId": sequence, "released": true, "actions": [] });
    json!({ "orderId": "o", "orderUpdateId": 0, "nodes": [node("a", 0), node("b", 2)], "edges": [edge] })
}

fn through(trace: &mut Trace, way: &Value) {
    drive(trace, &BEFORE, &json!([request("1", "r", "REQUESTED", way)]));
    answer(trace, "1", "GRANTED");
    drive(trace, &INSIDE, &json!([request("1", "r", "GRANTED", way)]));
}

#[test]
fn who_asks_waits_and_keeps_to_the_way_is_not_accused() {
    let trace = granted(&straight());
    for check in [
        "zones/replanning-asked",
        "zones/replanning-granted",
        "zones/replanning-path",
    ] {
        let judged = trace.judge(check);
        assert!(judged.findings.is_empty() && judged.judged > 0, "{check}");
    }
    assert_eq!(trace.judge("zones/release-asked").judged, 0, "it is no RELEASE zone");
}

#[test]
fn who_leaves_the_granted_way_is_found() {
    let found = |off: f64| granted(&aside(off)).judge("zones/replanning-path").summary();
    assert!(found(0.35).is_empty(), "as near as can be asked");
    assert_eq!(found(0.5), ["ZONE-16 warning"]);
    assert_eq!(found(0.8), ["ZONE-16"]);
    let mut trace = vehicle(&[("r", ZONE), ("l", "LINE_GUIDED")]);
    order(&mut trace, None);
    through(&mut trace, &aside(1.2));
    assert_eq!(trace.judge("zones/replanning-path").judged, 0, "the line decides");
}

#[test]
fn who_drives_another_way_than_the_granted_one_is_found() {
    let found = |other: &Value| {
        let mut trace = vehicle(&[("r", ZONE)]);
        order(&mut trace, None);
        let asked = |status: &str| request("1", "r", status, &aside(0.5));
        let other = request("2", "r", "REQUESTED", other);
        drive(&mut trace, &BEFORE, &json!([asked("REQUESTED"), other]));
        answer(&mut trace, "1", "GRANTED");
        drive(&mut trace, &INSIDE, &json!([asked("GRANTED")]));
        trace.judge("zones/replanning-path").summary()
    };
    assert_eq!(found(&straight()), ["ZONE-16 warning", "ZONE-16"]);
    assert_eq!(found(&aside(0.3)), ["ZONE-16 warning"], "it is on neither");
    let mut trace = vehicle(&[("r", ZONE)]);
    order(&mut trace, None);
    let both = |status: &str| {
        json!([
            request("1", "r", status, &aside(0.5)),
            request("1", "r", status, &straight())
        ])
    };
    drive(&mut trace, &BEFORE, &both("REQUESTED"));
    answer(&mut trace, "1", "GRANTED");
    drive(&mut trace, &INSIDE, &both("GRANTED"));
    assert!(
        trace.judge("zones/replanning-path").findings.is_empty(),
        "it was granted both"
    );
}

#[test]
fn what_an_order_lets_leave_its_trajectory_is_not_asked_for() {
    let mut trace = vehicle(&[("r", ZONE)]);
    let mut ordered = ordered(Some(&straight()));
    ordered["nodes"][1]["nodePosition"] =
        json!({ "x": 6.0, "y": 0.0, "mapId": "hall", "allowedDeviationXY": { "a": 1.0, "b": 1.0, "theta": 0.0 } });
    trace.sent("order", &ordered);
    through(&mut trace, &aside(0.8));
    assert_eq!(trace.judge("zones/replanning-sent").judged, 0);
}

#[test]
fn who_goes_in_with_nothing_granted_is_found_in_each_zone() {
    let mut trace = vehicle(&[("r", ZONE), ("s", ZONE)]);
    let both = json!([
        request("1", "r", "GRANTED", &straight()),
        request("2", "s", "REQUESTED", &straight())
    ]);
    drive(&mut trace, &BEFORE, &both);
    answer(&mut trace, "1", "GRANTED");
    drive(&mut trace, &INSIDE, &both);
    assert_eq!(trace.judge("zones/replanning-granted").findings.len(), 1);
    let mut trace = vehicle(&[("r", ZONE)]);
    drive(&mut trace, &BEFORE, &json!([]));
    drive(&mut trace, &INSIDE, &json!([]));
    assert_eq!(trace.judge("zones/replanning-asked").findings.len(), 1);
}

#[test]
fn what_an_edge_prescribes_is_asked_for() {
    let found = |asked: &Value| {
        let mut trace = vehicle(&[("r", ZONE)]);
        order(&mut trace, Some(&straight()));
        through(&mut trace, asked);
        trace.judge("zones/replanning-sent").summary()
    };
    assert!(found(&straight()).is_empty());
    assert!(
        found(&way(&[(2.0, 0.0), (4.0, 0.0)])).is_empty(),
        "the part inside is enough"
    );
    assert_eq!(found(&aside(0.8)), ["ZREQ-16"]);
    assert_eq!(found(&way(&[(0.0, 0.0), (3.0, 0.0)])), ["ZREQ-16"], "it ends inside");
}

#[test]
fn each_request_has_a_way_of_its_own() {
    let judged = |requests: &Value| {
        let mut trace = vehicle(&[("r", ZONE), ("s", ZONE)]);
        at(&mut trace, 0.0, requests);
        trace.judge("zones/requests").summary()
    };
    let first = request("1", "r", "REQUESTED", &straight());
    let again = |zone: &str, status: &str| json!([request("0", zone, status, &straight()), first]);
    assert!(judged(&json!([first, request("2", "r", "REQUESTED", &aside(0.5))])).is_empty());
    assert!(judged(&again("s", "REQUESTED")).is_empty(), "it is another zone");
    assert!(judged(&again("r", "REVOKED")).is_empty(), "it asks anew");
    assert_eq!(judged(&again("r", "QUEUED")), ["ZREQ-07 warning"], "it may ask again");
    assert_eq!(
        judged(&json!([merged(first.clone(), &json!({ "trajectory": null }))])),
        ["ZREQ-07"]
    );
}
