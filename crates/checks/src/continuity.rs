//! Whether a vehicle that connects again may have forgotten everything, or was only cut off by the harness.

use super::orders::number;
use super::traffic::{Traffic, maybe_restarted, state};
use tck_check::CheckContext;
use tck_journal::Entry;
use tck_journal::event::{Event, LinkFault};

/// Tells a possible restart from a link that the harness broke.
///
/// A vehicle that counts its headerId on over a cut of ours has not been started anew, and has no reason to forget
/// anything. Everything else may be a restart.
#[derive(Debug, Default)]
pub(super) struct Continuity {
    /// The harness has disturbed the link since the last state.
    cut: bool,
    /// The vehicle connected again behind that; the next state tells what it is.
    pending: bool,
    header: Option<u64>,
}

impl Continuity {
    /// Learns from an entry; returns whether the vehicle may have been restarted, as of now. Call it for every entry,
    /// once, and before a state is judged.
    pub fn restarted(&mut self, traffic: Traffic, entry: &Entry, context: &CheckContext<'_>) -> bool {
        if let Event::Fault { fault } = entry.event() {
            self.cut |= *fault != LinkFault::Restore;
        }
        if let Some(state) = state(traffic, entry, context) {
            let header = number(state, "headerId");
            let goes_on = matches!((self.header, header), (Some(before), Some(now)) if now > before);
            let restarted = self.pending && !goes_on;
            self.header = header;
            self.pending = false;
            self.cut &= traffic.disturbed;
            return restarted;
        }
        if !maybe_restarted(traffic, entry, context) {
            return false;
        }
        self.pending |= self.cut;
        !self.cut
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;
    use tck_journal::event::LinkFault;

    fn over_a_cut(anew: bool) -> Vec<String> {
        let mut trace = Trace::tap();
        let listed = json!({ "orderId": "o", "actionStates": [{ "actionId": "a", "actionStatus": "FINISHED" }] });
        trace
            .connected(1)
            .state(&listed)
            .fault(LinkFault::Cut { reset: false })
            .closed(1);
        trace.fault(LinkFault::Restore);
        if anew {
            trace.connected(2);
        } else {
            trace.connect(2, None, 15, 4);
        }
        trace
            .state(&json!({ "orderId": "o" }))
            .state(&json!({ "orderId": "o" }));
        trace.judge("state/action-states-kept").summary()
    }

    #[test]
    fn a_vehicle_that_counts_on_over_a_cut_of_ours_has_no_reason_to_forget() {
        assert_eq!(over_a_cut(false), ["STATE-MSG-10"]);
    }

    #[test]
    fn a_vehicle_that_counts_anew_may_have_been_restarted() {
        assert!(over_a_cut(true).is_empty());
    }
}
