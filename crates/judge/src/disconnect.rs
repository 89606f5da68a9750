//! Whether the device left during a test of its own accord, as it does when it crashes.

use super::gone::{Gone, Mark, Sign, ends};
use tck_journal::Entry;
use tck_journal::event::{Close, Event, LinkFault};
use tck_view::Names;

/// Watches the connection of the device through one test.
#[derive(Debug, Default)]
pub(super) struct Disconnect {
    /// The harness disturbed the link, or somebody did something to the device: a close proves nothing.
    disturbed: bool,
    /// The device said DISCONNECT.
    announced: bool,
    last_sent: Option<Mark>,
    left: Option<Gone>,
}

impl Disconnect {
    pub(super) fn observe(&mut self, entry: &Entry, subject: Option<&str>, names: &Names) {
        let mark = (entry.seq(), entry.at().moment);
        match entry.event() {
            Event::Fault { fault } if !matches!(fault, LinkFault::Restore) => self.disturbed = true,
            Event::Hook { .. } | Event::Vehicle { .. } | Event::Interrupted => self.disturbed = true,
            Event::Sent { .. } => self.last_sent = Some(mark),
            Event::Closed {
                how: Close::DeviceFin | Close::DeviceReset,
                ..
            } if !self.announced => self.leaves(Sign::Closed, mark),
            Event::Message { retain: false, .. } if subject == Some("connection") => {
                if let Some(state) = ends(entry, names) {
                    self.leaves(Sign::Said(state), mark);
                }
            }
            _ if subject == Some("mqtt/connect") => self.announced = false,
            _ if subject == Some("mqtt/disconnect") => self.announced = true,
            _ => {}
        }
    }

    fn leaves(&mut self, sign: Sign, since: Mark) {
        if !self.disturbed && self.left.is_none() {
            let sent = self.last_sent;
            self.left = Some(Gone { sign, since, sent });
        }
    }

    /// What happened, if the device left.
    pub(super) fn story(&self) -> Option<&Gone> {
        self.left.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::{Moment, Stamp};
    use tck_journal::Journal;
    use tck_journal::event::{Direction, Occurrence, Packet, Payload, Source};

    fn story(events: &[Event]) -> Option<String> {
        let mut journal = Journal::new();
        let mut departure = Disconnect::default();
        for event in events {
            let is_disconnect = matches!(event, Event::Packet { .. });
            let entry = journal.append(Occurrence {
                at: Stamp {
                    moment: Moment::START,
                    utc: jiff::Timestamp::UNIX_EPOCH,
                },
                source: Source::Tap,
                direction: is_disconnect.then_some(Direction::FromDevice),
                event: event.clone(),
            });
            departure.observe(&entry, is_disconnect.then_some("mqtt/disconnect"), &Names::default());
        }
        departure.story().map(Gone::to_string)
    }

    fn sent() -> Event {
        Event::Sent {
            topic: "order".to_owned(),
            qos: 0,
            retain: false,
            payload: Payload::keep(bytes::Bytes::from_static(b"{}")),
        }
    }

    const CLOSED: Event = Event::Closed {
        connection: 1,
        how: Close::DeviceFin,
    };

    #[test]
    fn a_device_that_leaves_without_a_word_is_named_with_what_it_was_sent() {
        let story = story(&[sent(), CLOSED]).unwrap();
        assert!(story.contains("after it was sent #"), "{story}");
    }

    #[test]
    fn a_device_that_says_goodbye_has_not_crashed() {
        let goodbye = Event::Packet {
            connection: 1,
            packet: Packet::Disconnect { code: 0 },
        };
        assert_eq!(story(&[sent(), goodbye, CLOSED]), None);
    }

    #[test]
    fn a_close_after_the_harness_disturbed_the_link_proves_nothing() {
        let fault = Event::Fault {
            fault: LinkFault::Cut { reset: false },
        };
        assert_eq!(story(&[sent(), fault, CLOSED]), None);
    }
}
