use serde_json::{Value, json};

use crate::trace::Trace;

/// A vehicle of 1.2 m by 0.8 m, and zones from 2 to 4 m along its way.
pub(super) fn vehicle(zones: &[(&str, &str)]) -> Trace {
    let mut trace = Trace::subscriber_of("3.0");
    let corner = |x: f64, y: f64| json!({ "x": x, "y": y });
    let outline = [
        corner(-0.6, -0.4),
        corner(0.6, -0.4),
        corner(0.6, 0.4),
        corner(-0.6, 0.4),
    ];
    trace.message(
        "factsheet",
        &json!({ "mobileRobotGeometry": { "envelopes2d": [{ "envelope2dId": "e", "vertices": outline }] } }),
    );
    let vertices = [corner(2.0, -2.0), corner(4.0, -2.0), corner(4.0, 2.0), corner(2.0, 2.0)];
    let zones: Vec<Value> = zones
        .iter()
        .map(
            |(id, kind)| json!({ "zoneId": id, "zoneType": kind, "releaseLossBehavior": "STOP", "vertices": vertices }),
        )
        .collect();
    trace.sent(
        "zoneSet",
        &json!({ "zoneSet": { "mapId": "hall", "zoneSetId": "z", "zones": zones } }),
    );
    trace
}

fn request(id: &str, zone: &str, status: &str) -> Value {
    json!({ "requestId": id, "requestType": "ACCESS", "zoneId": zone, "zoneSetId": "z", "requestStatus": status })
}

/// At x, with these requests.
fn at(trace: &mut Trace, x: f64, requests: &Value) {
    trace.wait(0.2).state(&json!({
        "operatingMode": "AUTOMATIC", "driving": true,
        "zoneSets": [{ "zoneSetId": "z", "mapId": "hall", "zoneSetStatus": "ENABLED" }],
        "mobileRobotPosition": { "x": x, "y": 0.0, "theta": 0.0, "mapId": "hall", "localized": true },
        "zoneRequests": requests,
    }));
}

/// At each of these places, with these requests.
fn drive(trace: &mut Trace, places: &[f64], requests: &Value) {
    for x in places {
        at(trace, *x, requests);
    }
}

pub(super) fn answer(trace: &mut Trace, id: &str, grant: &str) {
    trace.sent(
        "responses",
        &json!({ "responses": [{ "requestId": id, "grantType": grant }] }),
    );
}

const BEFORE: [f64; 3] = [0.0, 0.5, 1.0];
const INSIDE: [f64; 3] = [1.8, 2.5, 3.0];
const BEHIND: [f64; 5] = [4.8, 5.0, 5.5, 6.0, 6.5];

fn summaries(trace: &mut Trace) -> Vec<Vec<String>> {
    ["zones/release-asked", "zones/release-granted", "zones/release-kept"]
        .map(|check| trace.judge(check).summary())
        .to_vec()
}

/// Requirements are those of the clause or monitor that uses the check.
fn nothing() -> Vec<Vec<String>> {
    vec![Vec::new(); 3]
}

#[test]
fn a_vehicle_that_asks_waits_and_gives_back_is_not_accused() {
    let mut trace = vehicle(&[("r", "RELEASE")]);
    drive(&mut trace, &BEFORE, &json!([request("1", "r", "REQUESTED")]));
    at(&mut trace, 1.37, &json!([request("1", "r", "REQUESTED")]));
    answer(&mut trace, "1", "GRANTED");
    drive(&mut trace, &INSIDE, &json!([request("1", "r", "GRANTED")]));
    drive(&mut trace, &BEHIND, &json!([]));
    assert_eq!(summaries(&mut trace), nothing());
    for check in ["zones/release-asked", "zones/release-granted", "zones/release-kept"] {
        assert!(trace.judge(check).judged > 0, "{check}");
    }
}

#[test]
fn one_that_goes_in_without_asking_is_found_twice() {
    let mut trace = vehicle(&[("r", "RELEASE")]);
    drive(&mut trace, &BEFORE, &json!([]));
    drive(&mut trace, &INSIDE, &json!([]));
    let found = summaries(&mut trace);
    assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 0]);
}

#[test]
fn an_answer_that_grants_nothing_gives_no_access() {
    for grant in ["QUEUED", "REJECTED", "REVOKED"] {
        let mut trace = vehicle(&[("r", "RELEASE")]);
        drive(&mut trace, &BEFORE, &json!([request("1", "r", "REQUESTED")]));
        answer(&mut trace, "1", grant);
        drive(&mut trace, &INSIDE, &json!([request("1", "r", "REQUESTED")]));
        assert_eq!(trace.judge("zones/release-granted").findings.len(), 1, "{grant}");
    }
    let mut trace = vehicle(&[("r", "RELEASE"), ("s", "RELEASE")]);
    let both = json!([request("1", "r", "GRANTED"), request("2", "s", "REQUESTED")]);
    drive(&mut trace, &BEFORE, &both);
    answer(&mut trace, "1", "GRANTED");
    drive(&mut trace, &INSIDE, &both);
    assert_eq!(
        trace.judge("zones/release-granted").findings.len(),
        1,
        "the other one was not granted"
    );
}

#[test]
fn a_grant_that_was_taken_back_long_before_gives_no_access_and_one_just_before_does() {
    let judged = |places_since: usize| {
        let mut trace = vehicle(&[("r", "RELEASE")]);
        drive(&mut trace, &BEFORE, &json!([request("1", "r", "REQUESTED")]));
        answer(&mut trace, "1", "GRANTED");
        at(&mut trace, 1.0, &json!([request("1", "r", "GRANTED")]));
        answer(&mut trace, "1", "REVOKED");
        drive(&mut trace, &vec![1.0; places_since], &json!([]));
        drive(&mut trace, &INSIDE, &json!([]));
        trace.judge("zones/release-granted").findings.len()
    };
    assert_eq!((judged(2), judged(10)), (0, 1));
}

#[test]
fn a_request_is_kept_inside_and_not_behind() {
    let run = |inside: &Value, behind: &Value, lost: bool| {
        let mut trace = vehicle(&[("r", "RELEASE")]);
        drive(&mut trace, &BEFORE, &json!([request("1", "r", "REQUESTED")]));
        answer(&mut trace, "1", "GRANTED");
        at(&mut trace, 1.8, &json!([request("1", "r", "GRANTED")]));
        if lost {
            answer(&mut trace, "1", "REVOKED");
        }
        drive(&mut trace, &INSIDE, inside);
        drive(&mut trace, &BEHIND, behind);
        let judged = trace.judge("zones/release-kept");
        (
            judged.findings.len(),
            judged.findings.iter().any(|finding| finding.verdict.is_some()),
        )
    };
    let granted = json!([request("1", "r", "GRANTED")]);
    let none = json!([]);
    assert_eq!(run(&granted, &none, false), (0, false));
    assert_eq!(run(&none, &none, false), (1, false), "it is gone while inside");
    assert_eq!(run(&json!([request("1", "r", "REQUESTED")]), &none, false), (1, false));
    assert_eq!(run(&granted, &granted, false), (1, true), "left behind is a warning");
    assert_eq!(run(&none, &none, true), (0, false), "what follows a loss is not judged");
    let next = json!([request("2", "r", "REQUESTED")]);
    assert_eq!(run(&granted, &next, false), (0, false), "it asks for the next time");
}

#[test]
fn a_request_is_for_a_zone_of_a_set_that_is_enabled_and_of_the_type_of_the_zone() {
    let judged = |zone_type: &str, request: &Value| {
        let mut trace = vehicle(&[("r", zone_type)]);
        at(&mut trace, 0.0, &json!([request]));
        trace.judge("zones/requests").summary()
    };
    let right = request("1", "r", "REQUESTED");
    assert!(judged("RELEASE", &right).is_empty());
    assert_eq!(judged("COORDINATED_REPLANNING", &right), ["ZREQ-05"]);
    assert_eq!(judged("RELEASE", &request("1", "none", "REQUESTED")), ["ZREQ-06"]);
    let elsewhere = crate::trace::merged(right.clone(), &json!({ "zoneSetId": "y" }));
    assert_eq!(judged("RELEASE", &elsewhere), ["ZREQ-03"]);
    let unnamed = crate::trace::merged(right, &json!({ "requestType": "REPLANNING" }));
    assert_eq!(judged("RELEASE", &unnamed), ["ZREQ-05"]);
}
