use serde_json::json;

use super::super::trace::Trace;
use tck_journal::event::{Direction, Event, Packet, Source};

fn at_tap(topic: &str) -> Trace {
    said_at_tap(topic, "{}")
}

fn said_at_tap(topic: &str, text: &str) -> Trace {
    let mut trace = Trace::tap();
    let packet = Packet::Publish {
        topic: topic.to_owned(),
        qos: 0,
        retain: false,
        dup: false,
        packet_id: None,
        payload: tck_journal::Payload::keep(bytes::Bytes::from(text.to_owned())),
    };
    trace.packet(1, Direction::FromDevice, packet);
    trace
}

#[test]
fn defined_names_and_the_vendors_own_topics_are_right() {
    let mut trace = Trace::tap();
    trace.publish(1, "state", 0, false, &json!({}));
    assert!(trace.judge("topic/names").findings.is_empty());
    let own = at_tap("acme/diagnostics").judge("topic/names");
    assert!(own.findings.is_empty() && own.judged == 0);
}

#[test]
fn messages_on_another_topic_are_found_when_they_never_come_on_their_own() {
    let state = json!({ "actionStates": [], "operatingMode": "AUTOMATIC" });
    let mut trace = Trace::tap();
    trace
        .publish(1, "states", 0, false, &state)
        .wait(40.0)
        .publish(1, "states", 0, false, &state);
    assert_eq!(trace.judge("topic/names").summary(), ["TOPIC-01"]);
    assert!(trace.judge("state/period").findings.is_empty(), "states do come");
    trace.publish(1, "state", 0, false, &state);
    let mut copied = Trace::tap();
    copied
        .publish(1, "state", 0, false, &state)
        .publish(1, "states", 0, false, &state)
        .wait(40.0);
    assert!(copied.judge("topic/names").findings.is_empty(), "a copy for others");
    let mut other = Trace::tap();
    let (own, minor) = (other.prefix.clone(), other.prefix.replacen("/v", "/v1.", 1));
    other.prefix = minor;
    let topic = other.topic("state");
    other.prefix = own;
    let payload = tck_journal::Payload::keep(bytes::Bytes::from(state.to_string().into_bytes()));
    let packet = Packet::Publish {
        topic,
        qos: 0,
        retain: false,
        dup: false,
        packet_id: None,
        payload,
    };
    other
        .add(
            Source::Tap,
            Some(Direction::FromDevice),
            Event::Packet { connection: 1, packet },
        )
        .wait(40.0);
    assert_eq!(other.judge("topic/names").summary(), ["TOPIC-03 warning"]);
}

#[test]
fn variants_of_a_name_are_found_once() {
    for name in ["State", "instant_actions", "FactSheet"] {
        assert_eq!(
            at_tap(&format!("x/{name}")).judge("topic/names").summary(),
            ["TOPIC-01"],
            "{name}"
        );
    }
    let mut trace = Trace::subscriber();
    trace
        .message("Connection", &json!({}))
        .message("Connection", &json!({}));
    assert_eq!(trace.judge("topic/names").summary(), ["TOPIC-01"]);
}

fn structure(prefix: &str) -> Vec<String> {
    let mut trace = Trace::subscriber();
    prefix.clone_into(&mut trace.prefix);
    trace.state(&json!({})).state(&json!({}));
    trace.judge("topic/structure").summary()
}

#[test]
fn five_levels_with_the_major_version_are_right() {
    let trace = Trace::subscriber();
    assert!(structure(&trace.prefix).is_empty());
}

#[test]
fn other_structures_are_remarked_on_once_per_topic() {
    assert_eq!(structure("site/hall/agv7"), ["TOPIC-02 warning"]);
    assert_eq!(structure("uagv/2/acme/7"), ["TOPIC-03 warning"]);
    assert_eq!(structure("uagv/v2/ac$me/7"), ["TOPIC-07 warning"]);
}

#[test]
fn a_serial_number_of_other_characters_is_found() {
    let mut trace = Trace::subscriber();
    trace.prefix.push_str(" b");
    trace.serial.push_str(" b");
    trace.state(&json!({}));
    assert_eq!(trace.judge("topic/structure").summary(), ["TOPIC-05"]);
}

#[test]
fn a_level_that_contradicts_the_version_of_its_message_is_remarked_on() {
    let said = |topic: &str, version: &str| {
        let text = json!({ "version": version }).to_string();
        said_at_tap(topic, &text).judge("topic/structure").summary()
    };
    assert_eq!(said("uagv/v7/acme/7/visualization", "8.1.0"), ["TOPIC-03 warning"]);
    assert!(
        said("uagv/v7/acme/7/visualization", "7.1.0").is_empty(),
        "two versions side by side"
    );
    assert!(
        said("uagv/v7/acme/7/diagnostics", "8.1.0").is_empty(),
        "a topic of its own"
    );
    assert!(
        said("uagv/v7/acme/9/visualization", "8.1.0").is_empty(),
        "another vehicle"
    );
}

#[test]
fn publishing_on_the_other_sides_topics_is_found() {
    let mut trace = Trace::tap();
    trace
        .publish(1, "state", 0, false, &json!({}))
        .sent("order", &json!({}));
    assert!(trace.judge("topic/own-side").findings.is_empty());
    trace.publish(1, "order", 0, false, &json!({}));
    assert_eq!(trace.judge("topic/own-side").summary(), ["TOPIC-15"]);
}

#[test]
fn what_the_broker_delivers_to_the_device_is_not_published_by_it() {
    let mut trace = Trace::tap();
    let topic = trace.topic("order");
    let packet = Packet::Publish {
        topic,
        qos: 0,
        retain: false,
        dup: false,
        packet_id: None,
        payload: tck_journal::Payload::keep(bytes::Bytes::from_static(b"{}")),
    };
    trace.add(
        Source::Tap,
        Some(Direction::ToDevice),
        Event::Packet { connection: 1, packet },
    );
    let outcome = trace.judge("topic/own-side");
    assert!(outcome.findings.is_empty() && outcome.judged == 0);
}

#[test]
fn a_last_will_on_a_topic_of_the_vehicle_is_foreign() {
    let mut trace = Trace::master_control_at_tap();
    let will = trace.will();
    trace.connect(1, Some(will), 15, 4);
    assert_eq!(trace.judge("topic/own-side").summary(), ["TOPIC-15"]);
    let mut vehicle = Trace::tap();
    vehicle.connected(1);
    assert!(vehicle.judge("topic/own-side").findings.is_empty());
}

#[test]
fn instant_actions_belong_on_their_topic() {
    let actions = json!({ "headerId": 1, "actions": [{ "actionId": "a", "actionType": "enableMap" }] });
    let judged = |names: &[&str]| {
        let mut trace = Trace::master_control_at_tap();
        trace.connect(1, None, 15, 4);
        for name in names {
            let topic = trace.topic("instantActions").replace("instantActions", name);
            let packet = Packet::Publish {
                topic,
                qos: 0,
                retain: false,
                dup: false,
                packet_id: None,
                payload: tck_journal::Payload::keep(bytes::Bytes::from(actions.to_string())),
            };
            trace.packet(1, Direction::FromDevice, packet);
        }
        trace.wait(60.0).shows(&json!({}));
        trace.judge("topic/names").summary()
    };
    assert_eq!(judged(&["mapActions"]), ["TOPIC-01"]);
    assert!(judged(&["instantActions", "copy"]).is_empty());
    assert!(judged(&["copy", "instantActions"]).is_empty());
}
