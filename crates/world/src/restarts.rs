//! Whether a vehicle that connects again may have forgotten everything, or was only cut off by the harness.

use tck_journal::event::{Event, LinkFault};
use tck_view::Topic;

use crate::listen::Seen;
use crate::observation::Observation;

/// Tells a new connection from one that goes on, and a possible restart from a link that the harness broke.
///
/// At the tap a connection is new when the vehicle opens it. Without a tap it is new when the vehicle speaks again after OFFLINE,
/// CONNECTIONBROKEN or a connection message that cannot be read, which may have said either: an ONLINE that is said once more is
/// no sign of anything.
///
/// A vehicle that counts its headerId on over a cut of ours has not been started anew, and has no reason to forget
/// anything. Every other new connection may be a restart.
#[derive(Debug, Default)]
pub struct Restarts {
    /// The harness has disturbed the link since the last state.
    cut: bool,
    /// The last connection message does not say that the vehicle is there.
    gone: bool,
    /// The vehicle connected again behind a cut; the next state tells what it is.
    pending: bool,
    header: Option<u64>,
    /// The record by which it may have been restarted last.
    at: Option<u64>,
    /// The record by which it is known to have a new connection.
    connected: Option<u64>,
}

impl Restarts {
    /// Whether the vehicle may have been restarted as of this record.
    #[must_use]
    pub fn now(&self, record: &Observation<'_>) -> bool {
        self.at == Some(record.seq())
    }

    /// Whether the vehicle has a new connection as of this record.
    #[must_use]
    pub fn connects(&self, record: &Observation<'_>) -> bool {
        self.connected == Some(record.seq())
    }
}

impl Restarts {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>) {
        if let Event::Fault { fault } = record.event() {
            self.cut |= *fault != LinkFault::Restore;
        }
        let connects = self.is_back(record);
        if connects {
            self.connected = Some(record.seq());
            self.pending |= self.cut;
        }
        let mut restarted = connects && !self.cut;
        if let Some(state) = record.state() {
            let header = state.header.header_id.whole();
            let goes_on = matches!((self.header, header), (Some(before), Some(now)) if now > before);
            restarted |= self.pending && !goes_on;
            self.header = header;
            self.pending = false;
            self.cut &= record.link.disturbed;
        }
        if restarted {
            self.at = Some(record.seq());
        }
    }

    /// Whether this is the first sign of a new connection.
    fn is_back(&mut self, record: &Observation<'_>) -> bool {
        if record.link.tap {
            return record.connects();
        }
        // What the broker kept from before tells whether the vehicle was gone, but not that it is back.
        let stored = record.is(Seen::Stored, Topic::Connection);
        let heard = record.is_delivered(Topic::Connection);
        if (stored || heard) && !record.connection_message().is_some_and(|message| message.is_online()) {
            self.gone = true;
            return false;
        }
        (heard || record.state().is_some()) && std::mem::take(&mut self.gone)
    }
}
