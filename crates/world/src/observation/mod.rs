//! A record as it concerns one vehicle: whose message it is, on which topic, how it was seen, and what the link was like.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value;
use tck_base::clock::{Moment, Stamp};
use tck_journal::event::{Direction, Event, LinkFault, Packet};
use tck_journal::{Entry, Parsed, Payload};
use tck_pack::{Pack, Role};
use tck_view::{
    ConnectionView, FactsheetView, Header, InstantActionsView, MessageView, Names, OrderView, Print, StateView, Topic,
    VisualizationView,
};

use crate::listen::{Kind, Seen};
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
    names: Arc<Names>,
    role: Role,
    link: Link,
}

impl Observer {
    /// For a vehicle with these full topics by topic name; `role` is the side under test.
    #[must_use]
    pub fn new(topics: &BTreeMap<String, String>, pack: &Pack, role: Role) -> Self {
        Self {
            topics: Topics::new(topics, pack),
            names: Arc::clone(pack.names()),
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
            topics: &self.topics,
            names: &self.names,
            link: self.link,
            role: self.role,
            kind,
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
            Event::Program { .. } => Kind::PROGRAM,
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
    topics: &'a Topics,
    names: &'a Names,
    /// What the link is like, this record included.
    pub link: Link,
    role: Role,
    kind: Kind,
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

    /// The message as it is read by the names of its version; `None` when it is no JSON, or on no topic of the vehicle.
    #[must_use]
    pub fn message(&self) -> Option<&'a MessageView> {
        self.entry.view(self.topic()?, self.names)
    }

    /// The message as one of another topic, on which it may have been meant; `None` when it is no JSON.
    #[must_use]
    pub fn message_as(&self, topic: Topic) -> Option<&'a MessageView> {
        self.entry.view(topic, self.names)
    }

    /// The header of the message, whatever its topic; `None` when it is no JSON.
    #[must_use]
    pub fn header(&self) -> Option<&'a Header> {
        let message = self.message_as(self.topic().unwrap_or(Topic::Other));
        message.map(MessageView::header)
    }

    /// A connection message, whoever sent it and however it was seen. It may be no object.
    #[must_use]
    pub fn connection_message(&self) -> Option<&'a Arc<ConnectionView>> {
        self.message()?.connection()
    }

    /// What the version calls the members of messages: to show one as evidence.
    #[must_use]
    pub fn names(&self) -> &'a Names {
        self.names
    }

    /// The message as a JSON value, if it is one: for what judges the document itself. What calculates with a message reads its
    /// view.
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

    /// The name of the topic of the vehicle on which a connection that is opened has its last will.
    #[must_use]
    pub fn will_topic_name(&self) -> Option<&'a str> {
        let Event::Packet {
            packet: Packet::Connect { will: Some(will), .. },
            ..
        } = self.event()
        else {
            return None;
        };
        self.topics.of(&will.topic).map(|named| named.name.as_str())
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
    pub fn delivered_on(&self, topic: Topic) -> Option<&'a MessageView> {
        let message = self.is_delivered(topic).then(|| self.message()).flatten();
        message.filter(|message| message.is_object())
    }

    /// A live state of the device under test, if it is an object.
    #[must_use]
    pub fn state(&self) -> Option<&'a Arc<StateView>> {
        self.delivered_on(Topic::State)?.state()
    }

    /// A live visualization message of the device under test, if it is an object.
    #[must_use]
    pub fn visualization(&self) -> Option<&'a Arc<VisualizationView>> {
        self.delivered_on(Topic::Visualization)?.visualization()
    }

    /// A live connection message of the device under test, if it is an object.
    #[must_use]
    pub fn connection(&self) -> Option<&'a Arc<ConnectionView>> {
        self.delivered_on(Topic::Connection)?.connection()
    }

    /// A live factsheet of the device under test, if it is an object.
    #[must_use]
    pub fn factsheet(&self) -> Option<&'a Arc<FactsheetView>> {
        self.delivered_on(Topic::Factsheet)?.factsheet()
    }

    /// A live order of a master control under test, if it is an object.
    #[must_use]
    pub fn order(&self) -> Option<&'a Arc<OrderView>> {
        self.delivered_on(Topic::Order)?.order()
    }

    /// Live instant actions of a master control under test, if it is an object.
    #[must_use]
    pub fn instant_actions(&self) -> Option<&'a Arc<InstantActionsView>> {
        self.delivered_on(Topic::InstantActions)?.instant_actions()
    }

    /// The JSON of a live message of the device under test on that topic, if it is an object.
    #[must_use]
    pub fn delivered_json(&self, topic: Topic) -> Option<&'a Value> {
        let value = self.is_delivered(topic).then(|| self.json()).flatten();
        value.filter(|value| value.is_object())
    }

    /// Whether this is a message towards the vehicle on that topic, from the harness or from a master control, readable or not.
    #[must_use]
    pub fn is_to_vehicle(&self, topic: Topic) -> bool {
        matches!(self.seen, Some(Seen::Sent | Seen::Delivered)) && self.topic() == Some(topic)
    }

    /// A message towards the vehicle on that topic, from the harness or from a master control that was recorded. It may be no
    /// object.
    #[must_use]
    pub fn to_vehicle(&self, topic: Topic) -> Option<&'a MessageView> {
        self.is_to_vehicle(topic).then(|| self.message()).flatten()
    }

    /// An order towards the vehicle, see [`Observation::to_vehicle`].
    #[must_use]
    pub fn order_to_vehicle(&self) -> Option<&'a Arc<OrderView>> {
        self.to_vehicle(Topic::Order)?.order()
    }

    /// Instant actions towards the vehicle, see [`Observation::to_vehicle`].
    #[must_use]
    pub fn instant_actions_to_vehicle(&self) -> Option<&'a Arc<InstantActionsView>> {
        self.to_vehicle(Topic::InstantActions)?.instant_actions()
    }

    /// What a mock vehicle of the harness says on that topic, if it is an object.
    #[must_use]
    pub fn said(&self, topic: Topic) -> Option<&'a MessageView> {
        let message = self.is(Seen::Sent, topic).then(|| self.message()).flatten();
        message.filter(|message| message.is_object())
    }

    /// A state of a mock vehicle of the harness, if it is an object.
    #[must_use]
    pub fn said_state(&self) -> Option<&'a Arc<StateView>> {
        self.said(Topic::State)?.state()
    }

    /// A connection message of a mock vehicle of the harness, if it is an object.
    #[must_use]
    pub fn said_connection(&self) -> Option<&'a Arc<ConnectionView>> {
        self.said(Topic::Connection)?.connection()
    }

    /// A factsheet of a mock vehicle of the harness, if it is an object.
    #[must_use]
    pub fn said_factsheet(&self) -> Option<&'a Arc<FactsheetView>> {
        self.said(Topic::Factsheet)?.factsheet()
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

    /// The fingerprint of the message without what changes when it is sent again.
    #[must_use]
    pub fn content(&self) -> Option<Print> {
        self.message().map(MessageView::content)
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
mod tests;
