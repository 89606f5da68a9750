//! The order a vehicle shows in its states, and whether it can still be held against it.

use std::sync::Arc;

use crate::observation::Observation;
use crate::orders::sets_position;
use tck_view::{ActionState, ErrorView, Print, StateView};

/// How many FATAL errors are kept in mind.
const ERRORS: usize = 16;
/// How many actions of a state are looked at.
const ACTIONS: usize = 256;

/// The order whose ids the states show. Which order had to be accepted is left to the tests.
#[derive(Debug, Default)]
pub struct ShownOrder {
    /// orderId of the last state.
    order: Option<String>,
    /// How often that has become another one.
    turn: u64,
    /// orderId of an order that was cancelled or may have been abandoned.
    abandoned: Option<String>,
    carried: Option<(String, u64)>,
    last: Option<(String, u64)>,
    /// FATAL errors of the last state.
    fatal: Vec<Print>,
    /// Those among them with which the vehicle has taken the present order over all the same: they do not hold it.
    borne: Vec<Print>,
    /// Ids of actions in the last state for which a vehicle gives its order up; `None` before the first state.
    clearing: Option<Vec<String>>,
    /// The last record that can be held against its order.
    held: Option<u64>,
}

impl ShownOrder {
    /// The state that this record is, if it can be held against its order.
    #[must_use]
    pub fn state<'e>(&self, record: &Observation<'e>) -> Option<&'e Arc<StateView>> {
        record.state().filter(|_| self.held == Some(record.seq()))
    }

    /// orderId of the last state.
    #[must_use]
    pub fn order(&self) -> Option<&str> {
        self.order.as_deref()
    }

    /// A number that is another one whenever another order is shown.
    #[must_use]
    pub fn turn(&self) -> u64 {
        self.turn
    }

    /// Last node of the state before the order changed: not yet progress in the new one.
    #[must_use]
    pub fn carried(&self) -> Option<&(String, u64)> {
        self.carried.as_ref()
    }

    /// The last node, and its sequenceId.
    #[must_use]
    pub fn last(&self) -> Option<&(String, u64)> {
        self.last.as_ref()
    }
}

impl ShownOrder {
    /// Whether the state tells of an action that clears the order and was in no state before: a recording may hold it before the
    /// order, or not at all. What is over where another order is shown, with nodes left, was for the one before; so it is in the
    /// first state of all.
    fn clears(&mut self, state: &StateView, is_next: bool) -> bool {
        let listed = state.all_action_states().take(ACTIONS);
        let listed = listed.filter(|action| action.clears_order() && !action.is_failed());
        let before = self.clearing.take();
        let has_nodes = state.node_states.iter().next().is_some();
        let mut now = Vec::new();
        let mut clears = false;
        for action in listed {
            let id = action.action_id.or_empty();
            let known = before
                .as_ref()
                .is_some_and(|known| known.iter().any(|known| known == id));
            let of_another = is_next && has_nodes && action.is_over();
            clears |= !known && !of_another;
            now.push(id.to_owned());
        }
        self.clearing = Some(now);
        clears
    }

    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>) {
        let moved = record.instant_actions_to_vehicle().is_some_and(|message| {
            let mut all = message.all_actions();
            all.any(|action| action.clears_order() || sets_position(action.action_type.or_empty()))
        });
        if moved || record.outside_influence() {
            self.abandoned.clone_from(&self.order);
        }
        let Some(state) = record.state() else { return };
        let (Some(order), Some(last)) = (state.order_id.text(), last_node(state)) else {
            return;
        };
        let is_next = self.order.as_deref() != Some(order);
        let clears = self.clears(state, is_next);
        if is_next {
            self.carried = self.last.take();
            self.order = Some(order.to_owned());
            self.turn += 1;
            self.abandoned = None;
            let fatal = fatal_errors(state).map(|error| error.print);
            self.borne = fatal.filter(|error| self.fatal.contains(error)).collect();
        }
        self.fatal = fatal_errors(state).map(|error| error.print).take(ERRORS).collect();
        if self.carried.as_ref().is_some_and(|carried| *carried != last) {
            self.carried = None;
        }
        self.last = Some(last);
        if clears || may_abandon_beside(state, &self.borne) {
            self.abandoned.clone_from(&self.order);
        }
        if self.abandoned.is_none() {
            self.held = Some(record.seq());
        }
    }
}

/// Where a state says the vehicle was last: node and sequenceId.
#[must_use]
pub fn last_node(state: &StateView) -> Option<(String, u64)> {
    let (node, sequence) = state.last_node()?;
    Some((node.as_str().to_owned(), sequence))
}

/// Whether a state reports something that may end an order without a word: another operating mode than the
/// automatic ones, an emergency stop (a word that is none of the standard is neither, and a finding of its own), a fatal error, or a failed action.
#[must_use]
pub fn may_abandon(state: &StateView) -> bool {
    may_abandon_beside(state, &[])
}

/// Whether it does so beside errors that are known not to hold the vehicle.
fn may_abandon_beside(state: &StateView, borne: &[Print]) -> bool {
    let failed = state.action_states.iter().any(ActionState::is_failed);
    failed || is_taken_out_beside(state, borne)
}

/// The errors of a state that ask for a person.
pub fn fatal_errors(state: &StateView) -> impl Iterator<Item = &ErrorView> {
    let is_fatal = |error: &&ErrorView| !matches!(error.error_level.or_empty(), "WARNING" | "URGENT");
    state.errors.iter().filter(is_fatal)
}

/// Whether a state reports what [`may_abandon`] asks for but a failed action: whatever is left of the order is still to be
/// seen then.
pub(crate) fn is_taken_out(state: &StateView) -> bool {
    is_taken_out_beside(state, &[])
}

fn is_taken_out_beside(state: &StateView, borne: &[Print]) -> bool {
    let manual = matches!(
        state.operating_mode.or_empty(),
        "MANUAL" | "SERVICE" | "TEACHIN" | "TEACH_IN" | "STARTUP" | "INTERVENED"
    );
    let stopped = matches!(state.emergency_stop(), Some("AUTOACK" | "MANUAL" | "REMOTE"));
    let fatal = fatal_errors(state).any(|error| !borne.contains(&error.print));
    manual || stopped || fatal
}
