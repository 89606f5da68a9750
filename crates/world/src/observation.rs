//! A record as it concerns one vehicle: whose message it is, on which topic, how it was seen, and what the link was like.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::Value;
use tck_base::clock::{Moment, Stamp};
use tck_journal::event::{Direction, Event, LinkFault, Packet};
use tck_journal::{Entry, Parsed, Payload};
use tck_pack::{Pack, Role};

use crate::listen::{Kind, Seen};
use crate::print;
use crate::topic::Topic;
use crate::topics::{Named, Topics};

/// What is known of the link to the device under test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Link {
    /// Packets are seen, so that what the device really published is known.
    pub tap: bool,
    /// The harness disturbs the link right now.
    pub disturbed: bool,
}

/// A point in time up to which a check was shown everything: that of a record, or the end.
#[derive(Clone, Copy, Debug)]
pub struct End {
    /// When.
    pub moment: Moment,
    /// What the link was like then.
    pub link: Link,
}

/// Makes observations of the records of one vehicle, in their order.
#[derive(Clone, Debug)]
pub struct Observer {
    topics: Topics,
    role: Role,
    link: Link,
}

impl Observer {
    /// For a vehicle with these full topics by topic name; `role` is the side under test.
    #[must_use]
    pub fn new(topics: &BTreeMap<String, String>, pack: &Pack, role: Role) -> Self {
        Self {
            topics: Topics::new(topics, pack),
            role,
            link: Link::default(),
        }
    }

    /// Observes the next record.
    pub fn see<'a>(&'a mut self, entry: &'a Entry) -> Observation<'a> {
        match entry.event() {
            Event::RunBegun { header } => self.link.tap = header.vantage == "tap",
            Event::Opened { .. } | Event::Packet { .. } => self.link.tap = true,
            Event::Fault { fault } => self.link.disturbed = *fault != LinkFault::Restore,
            _ => {}
        }
        let (way, named, kind) = self.place(entry);
        Observation {
            entry,
            seen: way,
            named,
            link: self.link,
            role: self.role,
            kind,
            content: OnceCell::new(),
        }
    }

    /// What a check is told when the records end at a moment.
    #[must_use]
    pub fn end(&self, moment: Moment) -> End {
        End {
            moment,
            link: self.link,
        }
    }

    fn place(&self, entry: &Entry) -> (Option<Seen>, Option<&Named>, Kind) {
        let on = |way: Seen, full: &str, otherwise: Kind| {
            let named = self.topics.of(full);
            let kind = named.map_or(otherwise, |named| Kind::message(way, named.topic));
            (Some(way), named, kind)
        };
        let kind = match entry.event() {
            Event::Message { topic, retain, .. } => {
                let way = if *retain { Seen::Stored } else { Seen::Delivered };
                return on(way, topic, Kind::REST);
            }
            Event::Sent { topic, .. } => return on(Seen::Sent, topic, Kind::REST),
            Event::Retained { topic, .. } => return on(Seen::Fetched, topic, Kind::REST),
            Event::Packet {
                packet: Packet::Publish { topic, .. },
                ..
            } => {
                return match entry.record.direction {
                    Some(Direction::ToDevice) => on(Seen::Received, topic, Kind::REST),
                    _ => on(Seen::Published, topic, Kind::ELSEWHERE),
                };
            }
            Event::Packet { packet, .. } => match packet {
                Packet::Connect { .. } => Kind::CONNECT,
                Packet::Connack { .. } => Kind::CONNACK,
                Packet::Subscribe { .. } => Kind::SUBSCRIBE,
                Packet::Disconnect { .. } => Kind::DISCONNECT,
                _ => Kind::REST,
            },
            Event::Opened { .. } => Kind::OPENED,
            Event::Closed { .. } => Kind::CLOSED,
            Event::Undecodable { .. } => Kind::UNDECODABLE,
            Event::Fault { .. } => Kind::FAULT,
            Event::Hook { .. } => Kind::HOOK,
            Event::Answer { .. } => Kind::ANSWER,
            Event::Lag { .. } => Kind::LAG,
            Event::Vehicle { .. } => Kind::VEHICLE,
            Event::Mark { .. } | Event::Bound { .. } => Kind::STEP,
            Event::RunBegun { .. } => Kind::BEGIN,
            _ => Kind::REST,
        };
        (None, None, kind)
    }
}

/// A record as it concerns one vehicle.
#[derive(Debug)]
pub struct Observation<'a> {
    /// The record.
    pub entry: &'a Entry,
    /// How a message was seen, if this is about one.
    pub seen: Option<Seen>,
    named: Option<&'a Named>,
    /// What the link is like, this record included.
    pub link: Link,
    role: Role,
    kind: Kind,
    content: OnceCell<Option<u64>>,
}

/// A message of the device under test.
#[derive(Clone, Copy, Debug)]
pub struct Delivered<'a> {
    /// Its topic.
    pub topic: Topic,
    /// Name of the topic.
    pub name: &'a str,
    /// QoS it was published with.
    pub qos: u8,
    /// RETAIN it was published with, where that was seen.
    pub retain: Option<bool>,
    /// DUP of the delivery.
    pub dup: bool,
}

impl<'a> Observation<'a> {
    /// The number of the record.
    #[must_use]
    pub fn seq(&self) -> u64 {
        self.entry.seq()
    }

    /// When it happened.
    #[must_use]
    pub fn at(&self) -> Stamp {
        self.entry.at()
    }

    /// When it happened, and what the link was like then.
    #[must_use]
    pub fn now(&self) -> End {
        End {
            moment: self.at().moment,
            link: self.link,
        }
    }

    /// What happened.
    #[must_use]
    pub fn event(&self) -> &'a Event {
        self.entry.event()
    }

    /// The message as a JSON value, if it is one.
    #[must_use]
    pub fn json(&self) -> Option<&'a Value> {
        self.entry.json()
    }

    /// The parse of the payload, with its problems.
    #[must_use]
    pub fn parsed(&self) -> Option<&'a Parsed> {
        self.entry.parsed()
    }

    /// The payload of the message.
    #[must_use]
    pub fn payload(&self) -> Option<&'a Payload> {
        self.entry.payload()
    }

    /// What checks listen to.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The topic of the vehicle that the record is about.
    #[must_use]
    pub fn topic(&self) -> Option<Topic> {
        self.named.map(|named| named.topic)
    }

    /// The name of that topic.
    #[must_use]
    pub fn topic_name(&self) -> Option<&'a str> {
        self.named.map(|named| named.name.as_str())
    }

    /// Whether it is a message on this topic that was seen in this way.
    #[must_use]
    pub fn is(&self, way: Seen, topic: Topic) -> bool {
        self.seen == Some(way) && self.topic() == Some(topic)
    }

    /// Whether the topic is one on which the side under test publishes.
    fn is_of_device(&self) -> bool {
        self.named.is_some_and(|named| named.publisher == Some(self.role))
    }

    /// A message of the device under test that was delivered live. What the broker had stored is stale: nobody knows when, or
    /// by which firmware, it was sent.
    #[must_use]
    pub fn delivered(&self) -> Option<Delivered<'a>> {
        let Event::Message { qos, dup, .. } = self.event() else {
            return None;
        };
        let named = self
            .named
            .filter(|_| self.seen == Some(Seen::Delivered) && self.is_of_device())?;
        Some(Delivered {
            topic: named.topic,
            name: &named.name,
            qos: *qos,
            retain: None,
            dup: *dup,
        })
    }

    /// A message of the device under test as it was published: at the tap where there is one, otherwise as it was delivered.
    #[must_use]
    pub fn published(&self) -> Option<Delivered<'a>> {
        if !self.link.tap {
            return self.delivered();
        }
        let publish = self.device_publish()?;
        let named = self.named.filter(|_| self.is_of_device())?;
        Some(Delivered {
            topic: named.topic,
            name: &named.name,
            qos: publish.qos,
            retain: Some(publish.retain),
            dup: publish.dup,
        })
    }

    /// Whether the device under test said this live on that topic.
    #[must_use]
    pub fn is_delivered(&self, topic: Topic) -> bool {
        self.is(Seen::Delivered, topic) && self.is_of_device()
    }

    /// A live message of the device under test on that topic, if it is an object.
    #[must_use]
    pub fn delivered_on(&self, topic: Topic) -> Option<&'a Value> {
        let value = self.is_delivered(topic).then(|| self.json()).flatten();
        value.filter(|value| value.is_object())
    }

    /// A live state of the device under test, if it is an object.
    #[must_use]
    pub fn state(&self) -> Option<&'a Value> {
        self.delivered_on(Topic::State)
    }

    /// Whether this is a message towards the vehicle on that topic, from the harness or from a master control, readable or not.
    #[must_use]
    pub fn is_to_vehicle(&self, topic: Topic) -> bool {
        matches!(self.seen, Some(Seen::Sent | Seen::Delivered)) && self.topic() == Some(topic)
    }

    /// A message towards the vehicle on that topic, from the harness or from a master control that was recorded.
    #[must_use]
    pub fn to_vehicle(&self, topic: Topic) -> Option<&'a Value> {
        self.is_to_vehicle(topic).then(|| self.json()).flatten()
    }

    /// What a mock vehicle of the harness says on that topic, if it is an object.
    #[must_use]
    pub fn said(&self, topic: Topic) -> Option<&'a Value> {
        let value = self.is(Seen::Sent, topic).then(|| self.json()).flatten();
        value.filter(|value| value.is_object())
    }

    /// A PUBLISH packet of the device.
    #[must_use]
    pub fn device_publish(&self) -> Option<DevicePublish<'a>> {
        let Event::Packet {
            connection,
            packet:
                Packet::Publish {
                    topic,
                    qos,
                    retain,
                    dup,
                    ..
                },
        } = self.event()
        else {
            return None;
        };
        (self.seen == Some(Seen::Published)).then_some(DevicePublish {
            connection: *connection,
            topic,
            qos: *qos,
            retain: *retain,
            dup: *dup,
        })
    }

    /// Whether something outside the protocol may have changed the vehicle: a hook was run or a person acted.
    #[must_use]
    pub fn outside_influence(&self) -> bool {
        matches!(self.event(), Event::Hook { .. } | Event::Answer { .. })
    }

    /// By how much the harness was late: what came meanwhile was read later than it was sent.
    #[must_use]
    pub fn lag(&self) -> Option<Duration> {
        match self.event() {
            Event::Lag { micros, .. } => Some(Duration::from_micros(*micros)),
            _ => None,
        }
    }

    /// Whether a connection is opened.
    #[must_use]
    pub fn connects(&self) -> bool {
        self.kind == Kind::CONNECT
    }

    /// Whether the device may have been restarted: it opens a connection, or says something about it.
    #[must_use]
    pub fn may_be_a_restart(&self) -> bool {
        self.connects() || self.is_delivered(Topic::Connection)
    }

    /// A print of the message without what changes when it is sent again; worked out once.
    #[must_use]
    pub fn content(&self) -> Option<u64> {
        *self.content.get_or_init(|| self.json().map(print::of_content))
    }
}

/// A PUBLISH packet of the device.
#[derive(Clone, Copy, Debug)]
pub struct DevicePublish<'a> {
    /// Number of the connection.
    pub connection: u64,
    /// Full topic.
    pub topic: &'a str,
    /// QoS.
    pub qos: u8,
    /// RETAIN.
    pub retain: bool,
    /// DUP.
    pub dup: bool,
}

#[cfg(test)]
mod tests {
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
        assert!(seen.delivered().is_none() && seen.to_vehicle(Topic::Order).is_some());
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
}
