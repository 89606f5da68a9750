//! The intervals between messages of one kind, as far as they are the device's own.

use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::event::{Event, Packet};
use tck_world::Observation;

/// Measures from message to message. What a link fault held back comes all at once when it ends, so that no interval counts
/// until one is as long as the device's own.
#[derive(Default)]
pub(super) struct Rhythm {
    last: Option<Moment>,
    held_back: bool,
}

impl Rhythm {
    /// Learns from an entry; whether it breaks the rhythm off.
    pub fn note(&mut self, record: &Observation<'_>) -> bool {
        let faulty = matches!(record.event(), Event::Fault { .. });
        let packet = |packet: &Packet| matches!(packet, Packet::Disconnect { .. } | Packet::Connect { .. });
        let ends = faulty
            || match record.event() {
                Event::Closed { .. } => true,
                Event::Packet { packet: seen, .. } => packet(seen),
                _ => false,
            };
        self.held_back |= faulty;
        if ends {
            self.last = None;
        }
        ends
    }

    /// The next interval starts anew.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// A message came. The interval since the one before, where it is the device's own; `usual` is what the device says it is.
    pub fn beat(&mut self, now: Moment, usual: Option<Duration>) -> Option<Duration> {
        let gap = now.since(self.last.replace(now)?);
        self.held_back &= usual.is_none_or(|usual| gap < usual / 2);
        (!self.held_back).then_some(gap)
    }
}
