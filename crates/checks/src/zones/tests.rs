use serde_json::{Value, json};

use crate::trace::Trace;

const SPEC: &str = "3.0";

/// A vehicle of 1.2 m by 0.8 m, and a set of zones that is sent to it.
fn vehicle(zones: &Value) -> Trace {
    let mut trace = Trace::subscriber_of(SPEC);
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
    trace.sent(
        "zoneSet",
        &json!({ "zoneSet": { "mapId": "hall", "zoneSetId": "z", "zones": zones } }),
    );
    trace
}

/// A zone from 2 to 4 m along the way, and wide.
fn zone(kind: &str, over: &Value) -> Value {
    let corner = |x: f64, y: f64| json!({ "x": x, "y": y });
    let zone = json!({
        "zoneId": format!("z-{kind}"), "zoneType": kind,
        "vertices": [corner(2.0, -2.0), corner(4.0, -2.0), corner(4.0, 2.0), corner(2.0, 2.0)],
    });
    crate::trace::merged(zone, over)
}

/// At x, with this speed, and its zone set in this status.
fn at(trace: &mut Trace, x: f64, speed: f64, status: &str) {
    let sets = match status {
        "" => json!([]),
        status => json!([{ "zoneSetId": "z", "mapId": "hall", "zoneSetStatus": status }]),
    };
    trace.wait(0.2).state(&json!({
        "operatingMode": "AUTOMATIC", "driving": speed > 0.0, "zoneSets": sets,
        "mobileRobotPosition": { "x": x, "y": 0.0, "theta": 0.0, "mapId": "hall", "localized": true },
        "velocity": { "vx": speed, "vy": 0.0, "omega": 0.0 },
    }));
}

/// What a check finds when the vehicle is seen at these places, with its zone set enabled.
fn driven(check: &str, zones: &Value, places: &[(f64, f64)]) -> Vec<String> {
    let mut trace = vehicle(zones);
    for (x, speed) in places {
        at(&mut trace, *x, *speed, "ENABLED");
    }
    trace.judge(check).summary()
}

#[test]
fn a_vehicle_that_goes_into_a_blocked_zone_is_found_and_one_that_is_found_in_it_is_not() {
    let blocked = json!([zone("BLOCKED", &json!({}))]);
    let driven = |places: &[(f64, f64)]| driven("zones/blocked", &blocked, places);
    assert_eq!(
        driven(&[(0.0, 1.0), (0.5, 1.0), (1.0, 1.0), (1.6, 1.0), (3.0, 1.0)]),
        ["ZONE-05"]
    );
    assert!(
        driven(&[(0.0, 1.0), (0.5, 1.0), (1.3, 1.0), (1.38, 0.0)]).is_empty(),
        "it stops before it"
    );
    assert!(
        driven(&[(0.0, 1.0), (0.5, 1.0), (1.3, 1.0), (1.45, 0.0)]).is_empty(),
        "nearer than it is exact"
    );
    assert!(
        driven(&[(3.0, 0.0), (3.0, 0.0), (3.5, 1.0)]).is_empty(),
        "it was inside"
    );
}

#[test]
fn a_zone_counts_only_while_its_set_is_enabled_and_known() {
    let mut trace = vehicle(&json!([zone("BLOCKED", &json!({}))]));
    for status in ["DISABLED", "", "DISABLED"] {
        at(&mut trace, 0.0, 1.0, status);
        at(&mut trace, 3.0, 1.0, status);
    }
    assert_eq!(trace.judge("zones/blocked").judged, 0);
    let mut trace = vehicle(&json!([zone("BLOCKED", &json!({}))]));
    trace.sent(
        "zoneSet",
        &json!({ "zoneSet": { "mapId": "hall", "zoneSetId": "z", "zones": [] } }),
    );
    for x in [0.0, 0.5, 3.0] {
        at(&mut trace, x, 1.0, "ENABLED");
    }
    assert!(
        trace.judge("zones/blocked").findings.is_empty(),
        "which of the two it has is not known"
    );
}

#[test]
fn the_lowest_speed_counts_from_the_first_corner_inside() {
    let slow = zone("SPEED_LIMIT", &json!({ "maximumSpeed": 0.5 }));
    let fast = zone("SPEED_LIMIT", &json!({ "zoneId": "f", "maximumSpeed": 2.0 }));
    let one = json!([slow]);
    let two = json!([slow, fast]);
    assert!(driven("zones/speed", &one, &[(0.0, 2.0), (0.5, 2.0), (1.2, 2.0), (3.0, 0.5)]).is_empty());
    assert_eq!(
        driven("zones/speed", &one, &[(0.0, 2.0), (1.0, 2.0), (1.7, 2.0)]),
        ["ZONE-17", "ZINT-08"]
    );
    assert_eq!(
        driven("zones/speed", &two, &[(0.0, 2.0), (3.0, 1.5)]),
        ["ZONE-17", "ZINT-04"]
    );
}

#[test]
fn travel_against_a_direction_is_found_and_travel_along_it_is_not() {
    let directed = |direction: f64, limitation: &str| {
        json!([zone(
            "DIRECTED",
            &json!({ "direction": direction, "directedLimitation": limitation })
        )])
    };
    let places = [(2.3, 1.0), (2.5, 1.0), (2.8, 1.0), (3.2, 1.0), (3.6, 1.0)];
    let driven = |zones: &Value| driven("zones/directed", zones, &places);
    assert!(driven(&directed(0.0, "STRICT")).is_empty());
    assert_eq!(driven(&directed(3.1, "RESTRICTED")), ["ZONE-21"]);
    assert_eq!(driven(&directed(2.2, "RESTRICTED")), ["ZONE-21 warning"]);
    assert_eq!(driven(&directed(1.0, "STRICT")), ["ZONE-21"]);
    assert!(
        driven(&directed(3.1, "SOFT")).is_empty(),
        "nobody knows whether there was another way"
    );
    let both = zone(
        "BIDIRECTED",
        &json!({ "direction": 3.1, "bidirectedLimitation": "RESTRICTED" }),
    );
    assert!(driven(&json!([both])).is_empty());
    let across = zone(
        "BIDIRECTED",
        &json!({ "direction": 1.57, "bidirectedLimitation": "RESTRICTED" }),
    );
    assert_eq!(driven(&json!([across])), ["ZONE-23"]);
}

#[test]
fn the_outline_counts_at_the_border_of_a_zone() {
    let blocked = json!([zone("BLOCKED", &json!({}))]);
    let seen = |places: &[(f64, f64)]| driven("zones/contour", &blocked, places);
    assert!(seen(&[(0.0, 1.0), (0.5, 1.0), (1.3, 1.0), (1.38, 0.0)]).is_empty());
    assert_eq!(
        seen(&[(0.0, 1.0), (0.5, 1.0), (1.0, 1.0), (1.7, 1.0)]),
        ["ZONE-03 warning"]
    );
    assert_eq!(seen(&[(0.0, 1.0), (0.5, 1.0), (1.0, 1.0), (3.0, 1.0)]), ["ZONE-03"]);
    let slow = json!([zone("SPEED_LIMIT", &json!({ "maximumSpeed": 0.5 }))]);
    let seen = |places: &[(f64, f64)]| driven("zones/contour", &slow, places);
    assert!(seen(&[(0.0, 2.0), (0.5, 2.0), (1.7, 0.5), (4.3, 0.5), (5.0, 2.0)]).is_empty());
    assert_eq!(seen(&[(0.0, 2.0), (1.0, 2.0), (1.7, 2.0)]), ["ZONE-03 warning"]);
    assert_eq!(seen(&[(0.0, 2.0), (1.0, 2.0), (3.0, 2.0)]), ["ZONE-03"]);
}

fn sets(states: &[Value], before: impl Fn(&mut Trace, usize)) -> Vec<String> {
    let mut trace = Trace::subscriber_of(SPEC);
    for (index, sets) in states.iter().enumerate() {
        before(&mut trace, index);
        trace.wait(1.0).state(&json!({ "zoneSets": sets }));
    }
    trace.judge("zones/sets").summary()
}

fn entry(id: &str, status: &str) -> Value {
    json!({ "zoneSetId": id, "mapId": "hall", "zoneSetStatus": status })
}

#[test]
fn zone_sets_that_change_by_themselves_are_found() {
    let nothing = |_: &mut Trace, _: usize| {};
    let a = |status: &str| json!([entry("a", status)]);
    assert!(sets(&[a("DISABLED"), a("DISABLED")], nothing).is_empty());
    assert_eq!(sets(&[json!([]), a("DISABLED")], nothing), ["ZSET-03"]);
    assert_eq!(sets(&[a("DISABLED"), json!([])], nothing), ["ZSET-03"]);
    assert_eq!(sets(&[a("DISABLED"), a("ENABLED")], nothing), ["ZSET-03"]);
    let two = json!([entry("a", "ENABLED"), entry("b", "ENABLED")]);
    assert_eq!(sets(&[two], nothing), ["ZSET-09"]);
}

#[test]
fn zone_sets_that_change_as_they_are_told_are_not() {
    let a = |status: &str| json!([entry("a", status)]);
    let sends = |trace: &mut Trace, index: usize| {
        let set = json!({ "zoneSet": { "mapId": "hall", "zoneSetId": "a", "zones": [] } });
        match index {
            1 => trace.sent("zoneSet", &set),
            2 => trace.instant("enableZoneSet", "e", &json!([{ "key": "zoneSetId", "value": "a" }])),
            3 => trace.instant("deleteZoneSet", "d", &json!([{ "key": "zoneSetId", "value": "a" }])),
            _ => trace,
        };
    };
    assert_eq!(
        sets(&[json!([]), a("DISABLED"), a("ENABLED"), json!([])], sends),
        Vec::<String>::new()
    );
    assert_eq!(sets(&[json!([]), a("ENABLED")], sends), ["ZSET-07"]);
}

#[test]
fn actions_of_zones_have_ids_and_a_list_of_their_own() {
    let action = |id: &str, status: &str| json!({ "actionId": id, "actionType": "beep", "actionStatus": status });
    let judged = |states: &[Value], clears: bool| {
        let mut trace = Trace::subscriber_of(SPEC);
        for state in states {
            trace.wait(1.0).state(state);
            if clears {
                trace.instant("clearZoneActions", "c", &json!({}));
            }
        }
        trace.judge("zones/actions").summary()
    };
    let list = |actions: Value| json!({ "zoneActionStates": actions });
    let done = list(json!([action("z1", "FINISHED")]));
    assert!(judged(&[list(json!([action("z1", "RUNNING")])), done.clone()], false).is_empty());
    assert_eq!(judged(&[done.clone(), list(json!([]))], false), ["ZACT-STATE-04"]);
    assert!(judged(&[done.clone(), list(json!([]))], true).is_empty());
    let mixed = json!({ "zoneActionStates": [action("z1", "RUNNING")], "actionStates": [action("z1", "RUNNING")] });
    assert_eq!(judged(&[mixed], false), ["IACT-STATE-03"]);
    assert_eq!(
        judged(&[done, list(json!([action("z1", "RUNNING")]))], false),
        ["ZACT-STATE-03"]
    );
}

/// A vehicle that shows this action of a zone, and then this, beside the actions of its order.
fn acted(first: (&str, &str), then: Option<(&str, &str)>, of_order: &Value) -> Vec<String> {
    let asked = json!({ "entryActions": [{ "actionType": "beep", "blockingType": "NONE" }], "duringActions": [], "exitActions": [] });
    let mut trace = vehicle(&json!([zone("ACTION", &asked)]));
    let listed = |(id, status): (&str, &str)| json!([{ "actionId": id, "actionType": "beep", "actionStatus": status }]);
    trace.state(&json!({ "zoneActionStates": [], "actionStates": [] }));
    trace.state(&json!({ "zoneActionStates": listed(first), "actionStates": of_order }));
    let then = then.map_or(json!([]), listed);
    trace.state(&json!({ "zoneActionStates": then, "actionStates": of_order }));
    trace.judge("zones/actions").summary()
}

#[test]
fn what_was_only_planned_may_go() {
    assert!(acted(("1", "WAITING"), None, &json!([])).is_empty());
    assert!(acted(("1", "WAITING"), Some(("1", "FINISHED")), &json!([])).is_empty());
    assert_eq!(acted(("1", "FINISHED"), None, &json!([])), ["ZACT-STATE-04"]);
    assert_eq!(acted(("1", "RUNNING"), None, &json!([])), ["ZACT-STATE-04"]);
}

#[test]
fn an_action_of_a_zone_does_not_stand_among_those_of_an_order() {
    let shown = |kind: &str| json!([{ "actionId": "9", "actionType": kind, "actionStatus": "RUNNING" }]);
    let waits = ("1", "WAITING");
    assert_eq!(acted(waits, Some(waits), &shown("beep")), ["IACT-STATE-03"]);
    // Nobody asked for that in a zone.
    assert!(acted(waits, Some(waits), &shown("weigh")).is_empty());
}
