//! Whether a vehicle that connects again may have forgotten everything, or was only cut off by the harness.

use tck_journal::event::{Event, LinkFault};

use crate::members::number;
use crate::observation::Observation;

/// Tells a possible restart from a link that the harness broke.
///
/// A vehicle that counts its headerId on over a cut of ours has not been started anew, and has no reason to forget
/// anything. Everything else may be a restart.
#[derive(Debug, Default)]
pub struct Restarts {
    /// The harness has disturbed the link since the last state.
    cut: bool,
    /// The vehicle connected again behind that; the next state tells what it is.
    pending: bool,
    header: Option<u64>,
    /// The record by which it may have been restarted last.
    at: Option<u64>,
}

impl Restarts {
    /// Whether the vehicle may have been restarted as of this record.
    #[must_use]
    pub fn now(&self, record: &Observation<'_>) -> bool {
        self.at == Some(record.seq())
    }
}

impl Restarts {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>) {
        if let Event::Fault { fault } = record.event() {
            self.cut |= *fault != LinkFault::Restore;
        }
        let restarted = if let Some(state) = record.state() {
            let header = number(state, "headerId");
            let goes_on = matches!((self.header, header), (Some(before), Some(now)) if now > before);
            let restarted = self.pending && !goes_on;
            self.header = header;
            self.pending = false;
            self.cut &= record.link.disturbed;
            restarted
        } else if record.may_be_a_restart() {
            self.pending |= self.cut;
            !self.cut
        } else {
            false
        };
        if restarted {
            self.at = Some(record.seq());
        }
    }
}
