//! Messages of the versions whose published text and schemas contradict each other, and what depends on other members.

use serde_json::{Value, json};

use super::super::FindingKind::{self, Enumeration, Missing, Other, Range, Type};
use super::super::Pack;
use super::{findings, good, packs, spoil};

/// The version with zones.
fn with_zones() -> std::sync::Arc<Pack> {
    let packs = packs();
    let found = packs.all().iter().find(|pack| pack.topic("zoneSet").is_some());
    found.expect("a version with zones").clone()
}

fn spoilt(pack: &Pack, name: &str, changes: &[(&str, Option<Value>)]) -> (String, Value) {
    let mut message = good(pack, name);
    for (place, value) in changes {
        if message.pointer(place).is_none() {
            let (holder, member) = place.rsplit_once('/').expect("pointer");
            let holder = message
                .pointer_mut(holder)
                .and_then(Value::as_object_mut)
                .expect("an object");
            holder.insert(member.to_owned(), value.clone().expect("a value"));
        } else {
            assert!(spoil(&mut message, place, value.clone()), "{place}");
        }
    }
    (name.split('-').next().expect("topic").to_owned(), message)
}

/// A contradiction, a good message, and what is changed in it: pointer and value.
type Case<'a> = (&'a str, &'a str, Vec<(String, Option<Value>)>);

#[test]
fn either_reading_is_right_and_the_unusual_one_is_named() {
    let pack = with_zones();
    let flag = "/protocolFeatures/mobileRobotActions/0/pauseAllowed";
    let zone = |at: usize, member: &str| format!("/zoneSet/zones/{at}/{member}");
    let cases: Vec<Case<'_>> = vec![
        (
            "name-of-the-kinematics",
            "factsheet-full",
            vec![
                ("/typeSpecification/mobileRobotKinematics".into(), None),
                (
                    "/typeSpecification/mobileRobotKinematic".into(),
                    Some(json!("DIFFERENTIAL")),
                ),
            ],
        ),
        (
            "type-of-action-flags",
            "factsheet-full",
            vec![(flag.into(), Some(json!("true")))],
        ),
        (
            "minimum-charging-time",
            "factsheet-full",
            vec![(
                "/mobileRobotConfiguration/batteryCharging/minimumChargingTime".into(),
                Some(json!(0.5)),
            )],
        ),
        (
            "whole-battery-health",
            "state-driving",
            vec![("/powerSupply/batteryHealth".into(), Some(json!(98.5)))],
        ),
        (
            "queued-requests",
            "state-driving",
            vec![("/zoneRequests/1/requestStatus".into(), Some(json!("REJECTED")))],
        ),
        (
            "words-of-the-orientation-type",
            "order-full",
            vec![("/edges/0/orientationType".into(), Some(json!("LOCAL")))],
        ),
        (
            "name-of-the-rotation-speed",
            "order-full",
            vec![
                ("/edges/0/maximumRotationSpeed".into(), None),
                ("/edges/0/maxRotationSpeed".into(), Some(json!(0.5))),
            ],
        ),
        (
            "weight-of-a-control-point",
            "order-full",
            vec![("/edges/0/trajectory/controlPoints/0/weight".into(), Some(json!(0)))],
        ),
        (
            "limitation-of-a-directed-zone",
            "zoneSet-full",
            vec![
                (zone(8, "directedLimitation"), None),
                (zone(8, "limitation"), Some(json!("STRICT"))),
            ],
        ),
        (
            "limitation-of-a-bidirected-zone",
            "zoneSet-full",
            vec![
                (zone(9, "bidirectedLimitation"), None),
                (zone(9, "limitation"), Some(json!("SOFT"))),
            ],
        ),
        (
            "name-of-the-priority",
            "zoneSet-full",
            vec![
                (zone(6, "priorityFactor"), None),
                (zone(6, "priorityFactor "), Some(json!(0.5))),
            ],
        ),
        (
            "name-of-the-penalty",
            "zoneSet-full",
            vec![
                (zone(7, "penaltyFactor"), None),
                (zone(7, "penaltyFactor "), Some(json!(0.5))),
            ],
        ),
        (
            "factors-of-zones",
            "zoneSet-full",
            vec![(zone(6, "priorityFactor"), Some(json!(7)))],
        ),
        (
            "loss-of-a-release",
            "zoneSet-full",
            vec![(zone(3, "releaseLossBehavior"), None)],
        ),
        (
            "name-of-battery-charging",
            "factsheet-full",
            vec![
                ("/mobileRobotConfiguration/batteryCharging".into(), None),
                ("/mobileRobotConfiguration/batteryCharging ".into(), Some(json!({}))),
            ],
        ),
        (
            "name-of-the-load-handling-device",
            "order-full",
            vec![(
                "/nodes/1/actions/0/actionParameters/0/key".into(),
                Some(json!("loadHandlingDevice")),
            )],
        ),
        ("turn-of-the-ellipse", "order-full", vec![]),
        ("orientation-of-an-edge", "order-full", vec![]),
        ("digits-of-pi", "visualization-full", vec![]),
    ];
    for (erratum, name, changes) in cases {
        let changes: Vec<(&str, Option<Value>)> =
            changes.iter().map(|(at, value)| (at.as_str(), value.clone())).collect();
        let (topic, message) = spoilt(&pack, name, &changes);
        assert_eq!(findings(&pack, &topic, &message), [], "{erratum}");
        let kept = pack.schema(&topic).expect("schema").readings(&message);
        assert!(kept.iter().any(|kept| kept.erratum == erratum), "{erratum}: {kept:?}");
    }
}

#[test]
fn the_usual_reading_goes_without_a_word() {
    let pack = with_zones();
    for name in [
        "factsheet-full",
        "factsheet-small",
        "state-driving",
        "zoneSet-full",
        "state-idle",
        "connection-will",
    ] {
        let topic = name.split('-').next().expect("topic");
        let kept = pack.schema(topic).expect("schema").readings(&good(&pack, name));
        assert_eq!(kept, [], "{name}");
    }
}

#[test]
fn what_no_reading_allows_is_found() {
    let pack = with_zones();
    let gone: Option<Value> = None;
    let cases: [(&str, &str, Option<Value>, FindingKind); 22] = [
        (
            "factsheet-full",
            "/typeSpecification/mobileRobotKinematics",
            gone.clone(),
            Missing,
        ),
        (
            "factsheet-full",
            "/typeSpecification/mobileRobotKinematics",
            Some(json!(7)),
            Type,
        ),
        (
            "factsheet-full",
            "/protocolFeatures/mobileRobotActions/0/pauseAllowed",
            Some(json!("yes")),
            Type,
        ),
        (
            "factsheet-full",
            "/protocolFeatures/mobileRobotActions/0/cancelAllowed",
            gone.clone(),
            Missing,
        ),
        (
            "factsheet-full",
            "/typeSpecification/supportedZones/0",
            Some(json!("FORBIDDEN")),
            Enumeration,
        ),
        (
            "state-driving",
            "/zoneRequests/1/requestStatus",
            Some(json!("ASKED")),
            Enumeration,
        ),
        ("state-driving", "/zoneRequests/0/trajectory", gone.clone(), Missing),
        ("state-driving", "/instantActionStates", gone.clone(), Missing),
        (
            "state-driving",
            "/errors/0/errorLevel",
            Some(json!("ERROR")),
            Enumeration,
        ),
        (
            "state-driving",
            "/intermediatePath/polyline/0/eta",
            Some(json!(7)),
            Type,
        ),
        ("visualization-full", "/referenceStateHeaderId", gone.clone(), Missing),
        ("order-full", "/nodes", Some(json!([])), Range),
        (
            "order-full",
            "/nodes/0/nodePosition/allowedDeviationXY",
            Some(json!(0.5)),
            Type,
        ),
        (
            "order-full",
            "/edges/0/trajectory/controlPoints/0/weight",
            Some(json!(-1)),
            Range,
        ),
        (
            "instantActions-several",
            "/actions/0/blockingType",
            Some(json!("HARD")),
            Enumeration,
        ),
        (
            "responses-several",
            "/responses/0/leaseExpiry",
            Some(json!("2026-03-02T08:16:30.000Z")),
            Other,
        ),
        (
            "zoneSet-full",
            "/zoneSet/zones/1/vertices",
            Some(json!([{ "x": 0, "y": 0 }])),
            Range,
        ),
        ("zoneSet-full", "/zoneSet/zones/0/exitActions", gone.clone(), Missing),
        ("zoneSet-full", "/zoneSet/zones/5/maximumSpeed", gone.clone(), Missing),
        (
            "zoneSet-full",
            "/zoneSet/zones/8/directedLimitation",
            gone.clone(),
            Missing,
        ),
        ("zoneSet-full", "/zoneSet/zones/8/direction", gone.clone(), Missing),
        (
            "zoneSet-full",
            "/zoneSet/zones/9/bidirectedLimitation",
            Some(json!("STRICT")),
            Enumeration,
        ),
    ];
    for (name, place, value, kind) in cases {
        let (topic, message) = spoilt(&pack, name, &[(place, value.clone())]);
        assert_eq!(
            findings(&pack, &topic, &message),
            [(place.to_owned(), kind)],
            "{name} {place} {value:?}"
        );
    }
}
