//! Whether a broker of somebody else delivers to the device what the harness publishes. A broker with access rules drops what
//! it does not allow without a word, and a device that gets no order must not be accused of not obeying it.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::clock::Moment;
use crate::journal::event::{Direction, Event, LinkFault, Occurrence, Packet};

/// How long a broker may take to deliver a message.
const LIMIT: Duration = Duration::from_secs(5);

/// What is known of it. It is asked until one message of a topic was delivered.
#[derive(Debug, Default)]
pub(super) struct Delivery {
    /// The topics on which a message reached the device.
    proven: BTreeSet<String>,
    /// What open connections subscribe to.
    subscribed: BTreeMap<u64, Vec<String>>,
    /// A message that is on its way, and until when.
    awaited: Option<(String, Moment)>,
    /// The harness plays with the link.
    disturbed: bool,
}

impl Delivery {
    /// The harness has published something.
    pub(super) fn sent(&mut self, topic: &str, now: Moment) {
        let is_heard = self.subscribed.values().flatten().any(|filter| filter == topic);
        if is_heard && !self.disturbed && self.awaited.is_none() && !self.proven.contains(topic) {
            self.awaited = Some((topic.to_owned(), now + LIMIT));
        }
    }

    /// The harness has done this to the link.
    pub(super) fn fault(&mut self, fault: &LinkFault) {
        self.disturbed = *fault != LinkFault::Restore;
        self.awaited = None;
    }

    /// Something happened.
    pub(super) fn observe(&mut self, occurrence: &Occurrence) {
        match &occurrence.event {
            Event::Packet {
                connection,
                packet: Packet::Subscribe { filters, .. },
            } => {
                let filters = filters.iter().map(|filter| filter.filter.clone());
                self.subscribed.entry(*connection).or_default().extend(filters);
            }
            Event::Packet {
                packet: Packet::Publish { topic, .. },
                ..
            } if occurrence.direction == Some(Direction::ToDevice) => {
                self.proven.insert(topic.clone());
                self.awaited.take_if(|(awaited, _)| awaited == topic);
            }
            // Who is gone gets nothing.
            Event::Closed { connection, .. } if self.subscribed.remove(connection).is_some() => self.awaited = None,
            _ => {}
        }
    }

    /// The topic of a message that should have been delivered by now.
    pub(super) fn overdue(&mut self, now: Moment) -> Option<String> {
        let overdue = self.awaited.take_if(|(_, until)| now > *until);
        overdue.map(|(topic, _)| topic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::Stamp;
    use crate::journal::event::{Close, Filter, Payload, Source};

    fn at(direction: Direction, event: Event) -> Occurrence {
        Occurrence {
            at: Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            source: Source::Tap,
            direction: Some(direction),
            event,
        }
    }

    fn subscribed() -> Delivery {
        let mut delivery = Delivery::default();
        let filters = vec![Filter {
            filter: "a/order".to_owned(),
            qos: 0,
        }];
        let packet = Packet::Subscribe { packet_id: 1, filters };
        delivery.observe(&at(Direction::FromDevice, Event::Packet { connection: 1, packet }));
        delivery
    }

    fn delivered() -> Occurrence {
        let packet = Packet::Publish {
            topic: "a/order".to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload: Payload::keep(bytes::Bytes::new()),
        };
        at(Direction::ToDevice, Event::Packet { connection: 1, packet })
    }

    const LATER: Moment = Moment::from_micros(6_000_000);

    #[test]
    fn what_never_reaches_a_device_that_waits_for_it_is_named_once() {
        let mut delivery = subscribed();
        delivery.sent("a/order", Moment::START);
        assert_eq!(delivery.overdue(Moment::START), None);
        assert_eq!(delivery.overdue(LATER).as_deref(), Some("a/order"));
        assert_eq!(delivery.overdue(LATER), None);
    }

    #[test]
    fn what_was_delivered_once_is_not_asked_for_again() {
        let mut delivery = subscribed();
        delivery.sent("a/order", Moment::START);
        delivery.observe(&delivered());
        delivery.sent("a/order", Moment::START);
        assert_eq!(delivery.overdue(LATER), None);
    }

    #[test]
    fn a_device_that_is_gone_or_does_not_listen_and_a_link_that_is_played_with_excuse_the_broker() {
        let mut gone = subscribed();
        gone.sent("a/order", Moment::START);
        let closed = Event::Closed {
            connection: 1,
            how: Close::DeviceFin,
        };
        gone.observe(&at(Direction::FromDevice, closed));
        assert_eq!(gone.overdue(LATER), None);
        let mut disturbed = subscribed();
        disturbed.sent("a/order", Moment::START);
        disturbed.fault(&LinkFault::Cut { reset: false });
        disturbed.sent("a/order", Moment::START);
        assert_eq!(disturbed.overdue(LATER), None);
        let mut deaf = Delivery::default();
        deaf.sent("a/order", Moment::START);
        assert_eq!(deaf.overdue(LATER), None);
    }
}
