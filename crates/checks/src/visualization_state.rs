//! `visualization/names-its-state`: a visualization names the state that it belongs to.

use std::collections::VecDeque;

use crate::finding::{broken, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{MessageView, VisualizationView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many visualizations wait for their states, and how many states are remembered.
const WAITING: usize = 256;

/// `visualization/names-its-state`.
pub(super) const NAMES_ITS_STATE: Check = Check {
    name: "visualization/names-its-state",
    decides: &["VIS-04"],
    doc: "referenceStateHeaderId is the headerId of a state that the vehicle has sent: one that is higher than those of all states that \
          came until time.react later was never sent. One of a state that came longer ago than time.statePeriod before the last one \
          is a warning. Not judged over a restart of the vehicle, nor while the harness disturbs the link.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::Delivered(Topic::State),
        Listen::Delivered(Topic::Visualization),
    ],
    reads: &[Fact::Restarts],
    needs: &[VisualizationView::reference_state_header_id],
    start: |_| Box::new(Names::default()),
};

#[derive(Default)]
struct Names {
    /// headerIds of the states that came, and when.
    states: VecDeque<(u64, Moment)>,
    /// Visualizations of a state that did not come yet: its headerId, when they came, and their entry.
    early: VecDeque<(u64, Moment, u64)>,
    never: bool,
    old: bool,
}

impl Names {
    fn forget(&mut self) {
        self.states.clear();
        self.early.clear();
    }

    /// The visualizations whose states should have come by now.
    fn overdue(&mut self, now: Moment, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let Some((last, _)) = self.states.back().copied() else {
            return;
        };
        self.early.retain(|(id, ..)| *id > last);
        while let Some((id, at, seq)) = self.early.front().copied() {
            if now.since(at) <= context.time.react {
                return;
            }
            self.early.pop_front();
            if !self.never {
                self.never = true;
                let text = format!("referenceStateHeaderId is {id}, and the last state has the headerId {last}");
                findings.push(broken("VIS-04", seq, text));
            }
        }
    }
}

impl Running for Names {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.restarts().now(record) || record.link.disturbed || record.outside_influence() {
            self.forget();
        }
        let now = record.at().moment;
        if record.is_delivered(Topic::State) {
            let id = record
                .message()
                .and_then(MessageView::state)
                .and_then(|state| state.header.header_id.whole());
            let Some(id) = id else { return false };
            if self.states.back().is_some_and(|(last, _)| *last > id) {
                self.forget();
            }
            if self.states.len() == WAITING {
                self.states.pop_front();
            }
            self.states.push_back((id, now));
            self.overdue(now, context, findings);
            return false;
        }
        let Some(id) = record
            .visualization()
            .and_then(|shown| shown.reference_state_header_id.whole())
        else {
            return false;
        };
        let Some((last, at)) = self.states.back().copied() else {
            return false;
        };
        self.overdue(now, context, findings);
        if id > last {
            if self.early.len() < WAITING {
                self.early.push_back((id, now, record.seq()));
            }
            return true;
        }
        let named = self
            .states
            .iter()
            .find(|(state, _)| *state >= id)
            .map(|(_, came)| *came);
        let is_old = named.is_some_and(|came| at.since(came) > context.time.state_period);
        if is_old && !self.old {
            self.old = true;
            let text = format!("referenceStateHeaderId is {id}, and the last state has the headerId {last}");
            findings.push(remark("VIS-04", record.seq(), text));
        }
        true
    }
}
