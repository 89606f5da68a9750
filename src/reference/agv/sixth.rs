//! What only vehicles with faults or liberties of the sixth blind round remember and do.

use std::collections::BTreeSet;
use std::time::Duration;

use super::Agv;
use super::actions::{Action, Origin, Status};
use super::book::Stop;
use super::connection::Connection;
use super::faults::FaultName as F;
use super::order_message::Blocking;
use super::tolerances::ToleranceName as T;
use crate::clock::Moment;
use crate::reference::Output;

/// How long a vehicle plans that plans before it drives.
pub(crate) const PLANNING: Duration = Duration::from_millis(2_500);

/// How long a download waits for its turn.
pub(crate) const QUEUING: Duration = Duration::from_secs(3);

/// How long what was paused is WAITING before it begins anew.
const ANEW: Duration = Duration::from_millis(300);

/// The share of a deviation range that is left when a node is entered early.
const EARLY: f64 = 0.9;

/// What is remembered.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sixth {
    /// sequenceIds of later visits that were taken for the first one.
    hidden: BTreeSet<u32>,
    /// Where actions were paused that begin anew, and when they do.
    again: Vec<Origin>,
    again_at: Option<Moment>,
    /// Downloads that wait for their turn.
    fetches: Vec<(Moment, u64, String)>,
}

impl Sixth {
    /// A new order was taken over.
    pub(crate) fn new_order(&mut self) {
        self.hidden.clear();
        self.again.clear();
        self.again_at = None;
    }

    /// Whether a node still to be traversed is not listed any more.
    pub(crate) fn is_hidden(&self, sequence_id: u32) -> bool {
        self.hidden.contains(&sequence_id)
    }

    /// Whether actions are to begin anew.
    pub(crate) fn waits_again(&self) -> bool {
        !self.again.is_empty()
    }

    /// When something of this is due.
    pub(crate) fn next_event(&self) -> Option<Moment> {
        let fetches = self.fetches.iter().map(|(due, ..)| *due);
        fetches.chain(self.again_at).min()
    }
}

impl Connection {
    /// `r4-header-id-restarts-with-order`: counts its states from 0 again.
    pub(crate) fn restart_header_id(&mut self) {
        self.header_ids.insert("state", 0);
    }
}

impl Agv {
    /// `r6-failed-action-blocks-next-order`: whether an action of the completed order has failed.
    pub(crate) fn order_has_failed_action(&self) -> bool {
        let failed = |action: &Action| action.of_order() && action.status == Status::Failed;
        !self.book.cancelled && self.actions.iter().any(failed)
    }

    /// `r6-loop-clears-both-visits`: a node was reached, and with it all that have its nodeId.
    pub(crate) fn hide_later_visits(&mut self, reached: &Stop) {
        if self.faults.has(F::R6LoopClearsBothVisits) {
            let again = self.book.nodes.iter().filter(|ahead| ahead.node.id == reached.node.id);
            self.sixth.hidden.extend(again.map(|ahead| ahead.node.sequence_id));
        }
    }

    /// `r6-resumed-action-waits-again`: remembers where actions are paused that go on now.
    pub(crate) fn note_what_waits_again(&mut self) {
        if !self.faults.has(F::R6ResumedActionWaitsAgain) {
            return;
        }
        let paused = |action: &&Action| action.of_order() && action.status == Status::Paused;
        let origins = self.actions.iter().filter(paused).map(|action| action.origin);
        self.sixth.again.extend(origins);
        if self.sixth.waits_again() {
            self.sixth.again_at = Some(self.moment() + ANEW);
        }
    }

    /// Begins anew what was paused, unless it is paused once more.
    pub(crate) fn begin_what_waits_again(&mut self) {
        let moment = self.moment();
        if self.sixth.again_at.take_if(|at| *at <= moment).is_none() || self.holds.any() {
            return;
        }
        for origin in std::mem::take(&mut self.sixth.again) {
            self.actions.trigger_again(origin, self.faults);
        }
    }

    /// `r6-edge-action-starts-before-leaving`: whether the actions of the next edge do not wait for a HARD action here.
    pub(crate) fn begins_edge_actions_on_node(&self) -> bool {
        let here = Origin::Node(self.book.last_sequence);
        let hard = |action: &Action| {
            let waits = action.origin == here && action.status == Status::Waiting;
            waits && action.request.blocking == Blocking::Hard
        };
        let released = self.book.edge_ahead().is_some_and(|edge| edge.released);
        released && self.faults.has(F::R6EdgeActionStartsBeforeLeaving) && self.actions.iter().any(hard)
    }

    /// Actions of the order that have not begun.
    pub(crate) fn waiting_order_actions(&self) -> Vec<String> {
        let waiting = |action: &&Action| action.of_order() && action.status == Status::Waiting;
        let waiting = self.actions.iter().filter(waiting);
        waiting.map(|action| action.request.id.clone()).collect()
    }

    /// `r6-manual-leaves-actions-waiting`: they wait although their order is gone.
    pub(crate) fn leave_waiting(&mut self, ids: &[String]) {
        for action in self
            .actions
            .iter_mut()
            .filter(|action| ids.contains(&action.request.id))
        {
            action.status = Status::Waiting;
        }
    }

    /// How far before a node on its way it may report it, and does so.
    ///
    /// Not where it has something to do or to look somewhere, nor where a corridor begins (NODE-02): then it has to be
    /// on the node itself.
    pub(crate) fn early_by(&self, stop: &Stop) -> Option<f64> {
        let sequence_id = stop.node.sequence_id;
        let passes = sequence_id < self.book.base_end.1 && self.book.cancel.is_none();
        let mut ahead = self.book.edges.iter().filter(|edge| edge.sequence_id > sequence_id);
        let free = stop.node.actions.is_empty() && ahead.next().is_none_or(|edge| edge.corridor.is_none());
        let position = stop.node.position.as_ref().filter(|_| passes && free);
        let position = position.filter(|position| position.theta.is_none() && self.takes(T::R6LibEarlyTraversal))?;
        let allowed = position.allowed_deviation?;
        (allowed > self.config.tolerance).then_some(allowed * EARLY)
    }

    /// Asks for a file, now or when it is its turn.
    pub(crate) fn fetch(&mut self, token: u64, url: String, queued: bool) {
        if queued {
            let due = self.moment() + QUEUING;
            self.sixth.fetches.push((due, token, url));
        } else {
            self.pending.push(Output::Fetch { token, url });
        }
    }

    /// Asks for the files whose turn has come.
    pub(crate) fn fetch_what_waited(&mut self) {
        let moment = self.moment();
        let (due, later) = std::mem::take(&mut self.sixth.fetches)
            .into_iter()
            .partition(|(due, ..)| *due <= moment);
        self.sixth.fetches = later;
        let due: Vec<(Moment, u64, String)> = due;
        for (_, token, url) in due {
            self.pending.push(Output::Fetch { token, url });
        }
    }
}
