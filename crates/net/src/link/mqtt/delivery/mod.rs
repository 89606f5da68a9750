//! Whether a broker of somebody else delivers, both ways. One with access rules drops what it does not allow without a word:
//! a device that gets no order must not be accused of not obeying it, and one whose states do not arrive not of sending none.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::link::filter::covers;
use tck_base::clock::Moment;
use tck_journal::event::{Close, Direction, Event, LinkFault, Occurrence, Packet, Source};

/// How long a broker may take to deliver a message to the device.
const TO_DEVICE: Duration = Duration::from_secs(5);
/// How long a broker may take to deliver a message to the harness: less than what is still allowed to a device that has to
/// publish something on an event.
const TO_HARNESS: Duration = Duration::from_secs(3);

/// A message that did not arrive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Undelivered {
    /// The harness has published on this topic, to which the device subscribes.
    ToDevice(String),
    /// The device has published something.
    ToHarness {
        /// Topic of the message.
        topic: String,
        /// Client id of the device.
        client: String,
        /// User name of the device.
        user: Option<String>,
        /// Whether something of it was delivered on this topic before.
        delivered_before: bool,
    },
}

/// What is known of it.
#[derive(Debug)]
pub(super) struct Delivery {
    to_device: ToDevice,
    to_harness: ToHarness,
    /// The harness plays with the link.
    disturbed: bool,
}

impl Delivery {
    /// Nothing is known yet. The harness subscribes to these filters.
    pub(super) fn new(filters: Vec<String>) -> Self {
        Self {
            to_device: ToDevice::default(),
            to_harness: ToHarness {
                filters,
                ..ToHarness::default()
            },
            disturbed: false,
        }
    }

    /// The harness has published something.
    pub(super) fn sent(&mut self, topic: &str, now: Moment) {
        if !self.disturbed {
            self.to_device.sent(topic, now);
        }
    }

    /// The harness has done this to the link.
    pub(super) fn fault(&mut self, fault: &LinkFault) {
        self.disturbed = *fault != LinkFault::Restore;
        self.to_device.awaited = None;
        self.to_harness.awaited.clear();
    }

    /// Something happened.
    pub(super) fn observe(&mut self, occurrence: &Occurrence) {
        let now = occurrence.at.moment;
        match &occurrence.event {
            Event::Packet { connection, packet } if occurrence.direction == Some(Direction::FromDevice) => match packet
            {
                Packet::Publish { topic, qos, .. } if !self.disturbed => {
                    self.to_harness.published(*connection, topic, *qos, now);
                }
                Packet::Connect {
                    client_id, username, ..
                } => {
                    let client = (client_id.clone(), username.clone());
                    self.to_harness.clients.insert(*connection, client);
                }
                Packet::Subscribe { filters, .. } => {
                    let filters = filters.iter().map(|filter| filter.filter.clone());
                    self.to_device.filters.entry(*connection).or_default().extend(filters);
                }
                Packet::Unsubscribe { filters, .. } => self.to_device.leaves(*connection, filters),
                _ => {}
            },
            Event::Packet { connection, packet } => match packet {
                Packet::Publish { topic, .. } => self.to_device.delivered(topic),
                Packet::Connack { code: 1.., .. } => self.to_harness.forget(*connection),
                _ => {}
            },
            // A mock vehicle of the harness.
            Event::Sent { topic, .. } => self.sent(topic, now),
            Event::Message {
                topic, retain: false, ..
            } if occurrence.source == Source::Link => {
                self.to_harness.delivered(topic);
            }
            Event::Closed { connection, how } => {
                self.to_device.gone(*connection);
                self.to_harness.gone(*connection, *how);
            }
            // What is late by itself is not held against the broker.
            Event::Lag { .. } => {
                self.to_device.wait_again(now);
                self.to_harness.wait_again(now);
            }
            _ => {}
        }
    }

    /// A message that should have been delivered by now.
    pub(super) fn overdue(&mut self, now: Moment) -> Option<Undelivered> {
        let to_device = self.to_device.awaited.take_if(|(_, until)| now > *until);
        let to_device = to_device.map(|(topic, _)| Undelivered::ToDevice(topic));
        to_device.or_else(|| self.to_harness.overdue(now))
    }
}

/// From the harness to the device. It is asked until one message of a topic was delivered.
#[derive(Debug, Default)]
struct ToDevice {
    /// The topics on which a message reached the device.
    proven: BTreeSet<String>,
    /// What open connections subscribe to.
    filters: BTreeMap<u64, Vec<String>>,
    /// A message that is on its way, and until when.
    awaited: Option<(String, Moment)>,
}

impl ToDevice {
    fn sent(&mut self, topic: &str, now: Moment) {
        let is_heard = self.filters.values().flatten().any(|filter| covers(filter, topic));
        if is_heard && self.awaited.is_none() && !self.proven.contains(topic) {
            self.awaited = Some((topic.to_owned(), now + TO_DEVICE));
        }
    }

    fn delivered(&mut self, topic: &str) {
        self.proven.insert(topic.to_owned());
        self.awaited.take_if(|(awaited, _)| awaited == topic);
    }

    fn leaves(&mut self, connection: u64, left: &[String]) {
        if let Some(filters) = self.filters.get_mut(&connection) {
            filters.retain(|filter| !left.contains(filter));
            self.awaited = None;
        }
    }

    /// Who is gone gets nothing.
    fn gone(&mut self, connection: u64) {
        if self.filters.remove(&connection).is_some() {
            self.awaited = None;
        }
    }

    fn wait_again(&mut self, now: Moment) {
        if let Some((_, until)) = &mut self.awaited {
            *until = (*until).max(now + TO_DEVICE);
        }
    }
}

/// From the device to the harness. Every message is asked for, since a broker may begin to drop at any time.
#[derive(Debug, Default)]
struct ToHarness {
    /// What the harness subscribes to.
    filters: Vec<String>,
    /// Client id and user name of each connection.
    clients: BTreeMap<u64, (String, Option<String>)>,
    /// By topic and connection: until when something has to come.
    awaited: BTreeMap<String, BTreeMap<u64, Moment>>,
    /// The clients whose messages on a topic were delivered.
    delivering: BTreeMap<String, BTreeSet<String>>,
}

impl ToHarness {
    fn published(&mut self, connection: u64, topic: &str, qos: u8, now: Moment) {
        // With QoS 2 the broker delivers when the client goes on with the handshake, which it may not do.
        let is_heard = qos < 2 && self.filters.iter().any(|filter| covers(filter, topic));
        // A stranger may have no right to publish where the device does.
        let is_stranger = |known: &BTreeSet<String>| !known.contains(self.client(connection));
        if is_heard && !self.delivering.get(topic).is_some_and(is_stranger) {
            let awaited = self.awaited.entry(topic.to_owned()).or_default();
            awaited.entry(connection).or_insert(now + TO_HARNESS);
        }
    }

    fn client(&self, connection: u64) -> &str {
        self.clients.get(&connection).map_or("", |(client, _)| client)
    }

    fn delivered(&mut self, topic: &str) {
        let Some(awaited) = self.awaited.remove(topic) else {
            return;
        };
        let clients: Vec<String> = awaited
            .keys()
            .map(|connection| self.client(*connection).to_owned())
            .collect();
        self.delivering.entry(topic.to_owned()).or_default().extend(clients);
    }

    /// What a device has sent is delivered though it goes. A broker that ends the connection may never have read it, or ends it
    /// because it does not allow it: the latter is what it is where nothing was ever delivered.
    fn gone(&mut self, connection: u64, how: Close) {
        match how {
            Close::DeviceFin | Close::DeviceReset => {}
            Close::Harness => self.forget(connection),
            Close::Broker => {
                let proven = &self.delivering;
                for (topic, awaited) in &mut self.awaited {
                    if proven.contains_key(topic) {
                        awaited.remove(&connection);
                    }
                }
            }
        }
    }

    /// Nothing is awaited from this connection.
    fn forget(&mut self, connection: u64) {
        for awaited in self.awaited.values_mut() {
            awaited.remove(&connection);
        }
    }

    fn wait_again(&mut self, now: Moment) {
        for until in self.awaited.values_mut().flat_map(BTreeMap::values_mut) {
            *until = (*until).max(now + TO_HARNESS);
        }
    }

    fn overdue(&mut self, now: Moment) -> Option<Undelivered> {
        let late = |awaited: &BTreeMap<u64, Moment>| {
            let mut late = awaited.iter().filter(|(_, until)| now > **until);
            late.next().map(|(connection, _)| *connection)
        };
        let mut all = self.awaited.iter();
        let (topic, connection) = all.find_map(|(topic, awaited)| Some((topic.clone(), late(awaited)?)))?;
        self.awaited.remove(&topic);
        let (client, user) = self.clients.get(&connection).cloned().unwrap_or_default();
        let delivered_before = self.delivering.contains_key(&topic);
        Some(Undelivered::ToHarness {
            topic,
            client,
            user,
            delivered_before,
        })
    }
}

#[cfg(test)]
mod tests;
