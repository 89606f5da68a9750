//! How records are seen.

use std::sync::{Arc, LazyLock};

use tck_journal::Journal;
use tck_journal::event::{Occurrence, Source};
use tck_pack::{Assets, Packs};

use super::*;

static PACKS: LazyLock<Packs> = LazyLock::new(|| Packs::load(&Assets::of_source_tree().unwrap()).unwrap());

fn observer(role: Role) -> Observer {
    let topics = [
        ("order", "v/order"),
        ("state", "v/state"),
        ("connection", "v/connection"),
    ];
    let topics = topics.map(|(name, full)| (name.to_owned(), full.to_owned()));
    Observer::new(&topics.into_iter().collect(), PACKS.latest(), role)
}

fn entry(direction: Option<Direction>, event: Event) -> Arc<Entry> {
    let at = Stamp {
        moment: Moment::START,
        utc: jiff::Timestamp::UNIX_EPOCH,
    };
    Journal::new().append(Occurrence {
        at,
        source: Source::Link,
        direction,
        event,
    })
}

fn payload() -> Payload {
    Payload::keep(bytes::Bytes::from_static(b"{}"))
}

fn message(topic: &str, retain: bool) -> Arc<Entry> {
    let event = Event::Message {
        topic: topic.to_owned(),
        qos: 0,
        retain,
        dup: false,
        payload: payload(),
    };
    entry(Some(Direction::FromDevice), event)
}

fn published(topic: &str, direction: Direction) -> Arc<Entry> {
    let packet = Packet::Publish {
        topic: topic.to_owned(),
        qos: 0,
        retain: false,
        dup: false,
        packet_id: None,
        payload: payload(),
    };
    entry(Some(direction), Event::Packet { connection: 1, packet })
}

#[test]
fn a_live_message_is_of_the_side_that_publishes_its_topic() {
    let state = message("v/state", false);
    assert!(observer(Role::Agv).see(&state).state().is_some());
    assert!(observer(Role::MasterControl).see(&state).state().is_none());
    let order = message("v/order", false);
    let mut vehicle = observer(Role::Agv);
    let seen = vehicle.see(&order);
    assert!(seen.delivered().is_none() && seen.order_to_vehicle().is_some());
    assert!(observer(Role::MasterControl).see(&order).delivered().is_some());
}

#[test]
fn what_the_broker_had_stored_and_what_is_of_another_vehicle_is_no_live_message() {
    let mut observer = observer(Role::Agv);
    assert!(observer.see(&message("v/state", true)).delivered().is_none());
    let other = message("w/state", false);
    let seen = observer.see(&other);
    assert!(seen.delivered().is_none() && seen.topic().is_none());
}

#[test]
fn where_packets_are_seen_they_tell_what_was_published() {
    let mut observer = observer(Role::Agv);
    let delivered = message("v/state", false);
    assert!(observer.see(&delivered).published().is_some());
    assert!(
        observer
            .see(&published("v/state", Direction::FromDevice))
            .published()
            .is_some()
    );
    assert!(observer.see(&delivered).published().is_none());
    assert!(
        observer
            .see(&published("v/state", Direction::ToDevice))
            .published()
            .is_none()
    );
    assert!(observer.end(Moment::START).link.tap);
}

#[test]
fn the_link_is_disturbed_until_the_harness_restores_it() {
    let mut observer = observer(Role::Agv);
    let fault = |fault| entry(None, Event::Fault { fault });
    assert!(observer.see(&fault(LinkFault::Cut { reset: false })).link.disturbed);
    assert!(observer.see(&message("v/state", false)).link.disturbed);
    assert!(!observer.see(&fault(LinkFault::Restore)).link.disturbed);
}
