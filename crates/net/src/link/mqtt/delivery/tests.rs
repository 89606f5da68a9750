//! What is held against a broker, and what is not.

use bytes::Bytes;

use super::*;
use tck_base::clock::Stamp;
use tck_journal::event::{Filter, Payload};

const LATER: Moment = Moment::from_micros(6_000_000);

fn at(moment: Moment, source: Source, direction: Direction, event: Event) -> Occurrence {
    Occurrence {
        at: Stamp {
            moment,
            utc: jiff::Timestamp::UNIX_EPOCH,
        },
        source,
        direction: Some(direction),
        event,
    }
}

/// A packet of the first connection.
fn packet(direction: Direction, packet: Packet) -> Occurrence {
    let event = Event::Packet { connection: 1, packet };
    at(Moment::START, Source::Tap, direction, event)
}

fn publish(topic: &str, qos: u8) -> Packet {
    Packet::Publish {
        topic: topic.to_owned(),
        qos,
        retain: false,
        dup: false,
        packet_id: None,
        payload: Payload::keep(Bytes::new()),
    }
}

fn closed(how: Close) -> Occurrence {
    let event = Event::Closed { connection: 1, how };
    at(Moment::START, Source::Tap, Direction::FromDevice, event)
}

fn subscribed(filter: &str) -> Delivery {
    let mut delivery = Delivery::new(Vec::new());
    let filters = vec![Filter {
        filter: filter.to_owned(),
        qos: 0,
    }];
    let subscribe = Packet::Subscribe { packet_id: 1, filters };
    delivery.observe(&packet(Direction::FromDevice, subscribe));
    delivery
}

#[test]
fn what_never_reaches_a_device_that_waits_for_it_is_named_once() {
    for filter in ["a/order", "+/order", "#"] {
        let mut delivery = subscribed(filter);
        delivery.sent("a/order", Moment::START);
        assert_eq!(delivery.overdue(Moment::START), None);
        let named = Undelivered::ToDevice("a/order".to_owned());
        assert_eq!(delivery.overdue(LATER), Some(named), "{filter}");
        assert_eq!(delivery.overdue(LATER), None);
    }
}

#[test]
fn what_was_delivered_once_is_not_asked_for_again() {
    let mut delivery = subscribed("a/order");
    delivery.sent("a/order", Moment::START);
    delivery.observe(&packet(Direction::ToDevice, publish("a/order", 0)));
    delivery.sent("a/order", Moment::START);
    assert_eq!(delivery.overdue(LATER), None);
}

#[test]
fn a_device_that_is_gone_or_does_not_listen_and_a_link_that_is_played_with_excuse_the_broker() {
    let mut gone = subscribed("a/order");
    gone.sent("a/order", Moment::START);
    gone.observe(&closed(Close::DeviceFin));
    assert_eq!(gone.overdue(LATER), None);
    let mut disturbed = subscribed("a/order");
    disturbed.sent("a/order", Moment::START);
    disturbed.fault(&LinkFault::Cut { reset: false });
    disturbed.sent("a/order", Moment::START);
    assert_eq!(disturbed.overdue(LATER), None);
    let mut deaf = Delivery::new(Vec::new());
    deaf.sent("a/order", Moment::START);
    assert_eq!(deaf.overdue(LATER), None);
    let mut leaving = subscribed("a/order");
    let filters = vec!["a/order".to_owned()];
    let unsubscribe = Packet::Unsubscribe { packet_id: 2, filters };
    leaving.observe(&packet(Direction::FromDevice, unsubscribe));
    leaving.sent("a/order", Moment::START);
    assert_eq!(leaving.overdue(LATER), None);
}

/// A device that has connected and published a state.
fn spoken(qos: u8) -> Delivery {
    let mut delivery = Delivery::new(vec!["a/state".to_owned()]);
    delivery.observe(&connect("agv"));
    delivery.observe(&packet(Direction::FromDevice, publish("a/state", qos)));
    delivery
}

fn connect(client: &str) -> Occurrence {
    let connect = Packet::Connect {
        level: 4,
        client_id: client.to_owned(),
        keep_alive: 10,
        clean_session: true,
        username: Some("fleet".to_owned()),
        has_password: false,
        will: None,
    };
    packet(Direction::FromDevice, connect)
}

fn delivered() -> Occurrence {
    let event = Event::Message {
        topic: "a/state".to_owned(),
        qos: 0,
        retain: false,
        dup: false,
        payload: Payload::keep(Bytes::new()),
    };
    at(Moment::START, Source::Link, Direction::FromDevice, event)
}

fn lost(delivered_before: bool) -> Undelivered {
    Undelivered::ToHarness {
        topic: "a/state".to_owned(),
        client: "agv".to_owned(),
        user: Some("fleet".to_owned()),
        delivered_before,
    }
}

#[test]
fn what_the_device_publishes_and_the_broker_drops_is_named_at_any_time() {
    let mut delivery = spoken(1);
    assert_eq!(delivery.overdue(Moment::START), None);
    assert_eq!(delivery.overdue(LATER), Some(lost(false)));
    let mut later = spoken(0);
    later.observe(&delivered());
    assert_eq!(later.overdue(LATER), None);
    later.observe(&packet(Direction::FromDevice, publish("a/state", 0)));
    assert_eq!(later.overdue(LATER), Some(lost(true)));
}

#[test]
fn a_broker_that_ends_the_connection_over_a_message_does_not_allow_it() {
    let mut refused = spoken(0);
    refused.observe(&closed(Close::Broker));
    assert_eq!(refused.overdue(LATER), Some(lost(false)));
    let mut ended = spoken(0);
    ended.observe(&delivered());
    ended.observe(&packet(Direction::FromDevice, publish("a/state", 0)));
    ended.observe(&closed(Close::Broker));
    assert_eq!(ended.overdue(LATER), None);
}

#[test]
fn what_no_broker_delivers_is_not_held_against_it() {
    // A handshake that the device may not go on with.
    assert_eq!(spoken(2).overdue(LATER), None);
    let mut elsewhere = Delivery::new(vec!["a/state".to_owned()]);
    elsewhere.observe(&packet(Direction::FromDevice, publish("a/b", 0)));
    assert_eq!(elsewhere.overdue(LATER), None);
    let mut refused = spoken(0);
    let code = 5;
    let connack = Packet::Connack {
        code,
        session_present: false,
    };
    refused.observe(&packet(Direction::ToDevice, connack));
    assert_eq!(refused.overdue(LATER), None);
    let mut cut = spoken(0);
    cut.observe(&closed(Close::Harness));
    assert_eq!(cut.overdue(LATER), None);
    let mut disturbed = spoken(0);
    disturbed.fault(&LinkFault::Refuse);
    disturbed.observe(&packet(Direction::FromDevice, publish("a/state", 0)));
    assert_eq!(disturbed.overdue(LATER), None);
}

#[test]
fn a_stranger_without_rights_ends_no_run() {
    let mut delivery = spoken(0);
    delivery.observe(&delivered());
    delivery.observe(&connect("stranger"));
    delivery.observe(&packet(Direction::FromDevice, publish("a/state", 0)));
    assert_eq!(delivery.overdue(LATER), None);
}

#[test]
fn a_machine_that_stood_still_gives_the_broker_its_time_again() {
    let mut delivery = spoken(0);
    let lag = Event::Lag {
        micros: 6_000_000,
        of: "timer".to_owned(),
    };
    delivery.observe(&at(LATER, Source::Harness, Direction::FromDevice, lag));
    assert_eq!(delivery.overdue(LATER), None);
    assert_eq!(delivery.overdue(LATER + TO_DEVICE), Some(lost(false)));
}
