//! cancelOrder, for all four capabilities of figure 9, and giving an order up altogether.

use std::time::Duration;

use super::Agv;
use super::action_kinds::Deed;
use super::actions::{Action, Origin, Status};
use super::book::Cancel;
use super::errors::{ActiveError, Life};
use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;

/// How long a faulty vehicle waits before it does what it should not.
pub(crate) const MOMENT: Duration = Duration::from_millis(50);

/// How long a cancellation takes at least for a vehicle that may take its time.
const CANCELLING: Duration = Duration::from_millis(400);

impl Agv {
    /// A cancelOrder action begins.
    pub(crate) fn cancel_order(&mut self, action_id: &str) {
        if let Some(cancel) = self
            .book
            .cancel
            .as_mut()
            .filter(|_| self.faults.has(F::SecondCancelTakesOver))
        {
            action_id.clone_into(&mut cancel.action_id);
            if let Some(action) = self.actions.get_mut(action_id) {
                action.status = Status::Running;
            }
            return;
        }
        if self.book.cancel.is_some() && self.takes(T::R4SecondCancelEndsWithTheFirst) {
            self.cancels_together(action_id);
            return;
        }
        let active = !self.book.nodes.is_empty() || self.actions.order_unfinished();
        let acts = self
            .actions
            .iter()
            .any(|action| action.of_order() && action.status.is_active());
        let waits = self.waits_at_decision_point() && !self.motion.is_moving() && !acts;
        let active = active
            && !(waits && self.faults.has(F::R2CancelAtDecisionPointRefused))
            && !(self.book.nodes.is_empty() && self.faults.has(F::R2CancelOfActingOrderRefused));
        if !active || self.book.cancel.is_some() || self.book.cancelled {
            self.nothing_to_cancel(action_id);
            return;
        }
        let to_node = !self.config.stops_between_nodes && (self.book.entered || self.motion.reached);
        let next = self.book.nodes.front().is_some_and(|stop| stop.node.released);
        let leaves = acts && next && !self.book.entered && !self.motion.is_moving();
        let to_node = to_node || leaves && self.faults.has(F::R4CancelInNodeActionDrivesToNextNode);
        if self.holds.pause && self.faults.has(F::PausedOrderSurvivesCancel) {
            self.remembered = Some(self.book.clone());
        }
        self.stop_actions();
        if to_node && !self.faults.has(F::CancelKeepsNodes) {
            self.book.nodes.truncate(1);
            self.book.edges.clear();
        }
        let moment = self.moment();
        if to_node && self.takes(T::R6LibEarlyTraversal) {
            // It ends on the node now and not before it: the rest of the way is planned anew.
            self.motion.halt(moment);
        }
        self.persona.cancel_begins(moment);
        if self.takes(T::R1CancelTakesTime) && self.persona.cancel_held_until.is_none() {
            self.persona.cancel_held_until = Some(moment + CANCELLING);
        }
        self.book.cancel = Some(Cancel {
            action_id: action_id.to_owned(),
            to_node,
        });
        let unbegun = self.faults.has(F::R3CancelNotRunning);
        if let Some(action) = self.actions.get_mut(action_id).filter(|_| !unbegun) {
            action.status = Status::Running;
        }
        if self.takes(T::R3CancelInSteps)
            || self.config.has("cancelRunsFromReceipt")
            || self.faults.has(F::CancelFinishedEarly)
        {
            self.flush();
        }
    }

    /// No order, or one that was cancelled before (ORD-CANCEL-18 to ORD-CANCEL-20).
    fn nothing_to_cancel(&mut self, action_id: &str) {
        let complete = self.book.has_order() && self.book.nodes.is_empty() && !self.book.cancelled;
        if complete && self.faults.has(F::R2CompletedOrderCancelFinished) {
            if let Some(action) = self.actions.get_mut(action_id) {
                action.end(Status::Finished);
            }
            return;
        }
        let again = self.book.cancelled && self.faults.has(F::R1SecondCancelFinished);
        let status = if again || self.faults.has(F::IdleCancelFinished) {
            Status::Finished
        } else {
            Status::Failed
        };
        if let Some(action) = self.actions.get_mut(action_id) {
            action.end(status);
        }
        if self.faults.has(F::CancelLeavesNodes) {
            self.book.drop_route();
        }
        let error = ActiveError {
            error_type: self.config.errors.no_order_to_cancel.clone(),
            fatal: false,
            references: vec![("actionId".to_owned(), action_id.to_owned())],
            description: "there is no order to cancel".into(),
            life: match () {
                () if self.takes(T::R1IdleCancelErrorBrief) => Life::Until(self.moment() + self.brief()),
                () if self.takes(T::R4NoOrderWarningUntilNextOrder) => Life::UntilNewOrder,
                () => Life::Until(self.moment() + self.config.error_duration),
            },
        };
        self.raise_nothing_to_cancel(error);
    }

    /// Ends the actions of the order, as far as they can be interrupted (ORD-CANCEL-03 to ORD-CANCEL-05).
    fn stop_actions(&mut self) {
        let (faults, interruptible) = (self.faults, self.config.interruptible);
        let base_end = self.book.base_end.1;
        let here = Origin::Node(self.book.last_sequence);
        let waiting = |action: &&Action| action.of_order() && action.status == Status::Waiting;
        let unbegun = self
            .actions
            .iter()
            .filter(waiting)
            .map(|action| action.request.id.clone())
            .collect();
        let queue_survives = faults.has(F::R2QueuedActionsSurviveCancel);
        for action in self.actions.iter_mut().filter(|action| action.of_order()) {
            let deed = action.kind.map(|kind| kind.deed);
            let ends = match deed {
                Some(Deed::WaitForTrigger) => !faults.has(F::R1TriggerHoldsCancel),
                Some(Deed::Calibrate) => false,
                _ => interruptible && !faults.has(F::CancelLetsRun),
            };
            let planned = match action.origin {
                super::actions::Origin::Node(id) | super::actions::Origin::Edge(id) => id > base_end,
                super::actions::Origin::Instant => false,
            };
            match action.status {
                Status::Waiting if planned && faults.has(F::R1CancelFinishesHorizonActions) => {
                    action.end(Status::Finished);
                }
                Status::Waiting if planned && faults.has(F::R3CancelLeavesHorizonWaiting) => {}
                _ if survives(action, faults) => {}
                Status::Waiting if queue_survives && action.origin == here => {}
                Status::Waiting if !faults.has(F::CancelLeavesWaiting) => action.end(Status::Failed),
                status if status.is_active() && ends => action.end(interrupted(action, faults)),
                status if status.is_active() && faults.has(F::CancelFailsEarly) => action.masked = Some(Status::Failed),
                Status::Finished if faults.has(F::FailsAfterFinished) => action.status = Status::Failed,
                _ => {}
            }
        }
        if !queue_survives {
            self.actions.drop_lists();
        }
        if faults.has(F::R2CancelDropsWaiting) {
            let unbegun: Vec<String> = unbegun;
            self.actions.retain(|action| !unbegun.contains(&action.request.id));
        }
    }

    /// Ends the cancellation once nothing moves or runs any more (ORD-CANCEL-07, ORD-CANCEL-11).
    pub(crate) fn settle_cancel(&mut self) -> bool {
        let Some(cancel) = self.book.cancel.clone() else {
            return false;
        };
        if self.holds.pause && self.faults.has(F::R1CancelWaitsForPause) {
            return false;
        }
        let drives_on = self.book.updated && !self.holds.any() && self.faults.has(F::R3CancelAfterUpdateDrivesOn);
        let keeps_nodes = self.faults.has(F::CancelKeepsNodes);
        let under_way = cancel.to_node && self.book.entered && !self.book.nodes.is_empty()
            || cancel.to_node && !keeps_nodes && !self.book.nodes.is_empty()
            || self.motion.is_moving() && !self.faults.has(F::CancelFinishedMoving)
            || ((drives_on || self.faults.has(F::CancelDrivesOn))
                && self.book.nodes.iter().any(|stop| stop.node.released));
        let left =
            |action: &Action| action.status == Status::Waiting && self.faults.has(F::R3CancelLeavesHorizonWaiting);
        let open = |action: &Action| {
            action.of_order() && !action.status.is_terminal() && !survives(action, self.faults) && !left(action)
        };
        let unfinished = self.actions.iter().any(open)
            && !self.faults.has(F::CancelFinishedEarly)
            && !self.faults.has(F::CancelLeavesWaiting);
        let waits = self.holds.pause && self.faults.has(F::CancelWaitsForPause);
        if under_way || unfinished || waits || self.persona.holds_cancel() {
            return false;
        }
        if self.faults.has(F::R3RouteDroppedAfterCancelFinished) {
            if let Some(action) = self.actions.get_mut(&cancel.action_id) {
                action.end(Status::Finished);
            }
            self.flush();
        }
        self.book.cancel = None;
        self.book.cancelled = true;
        self.end_further_cancels();
        if self.faults.has(F::LastNodeAheadWhenCancelled)
            && let Some(ahead) = self.book.nodes.front().filter(|_| self.book.entered)
        {
            (self.book.last_node, self.book.last_sequence) = (ahead.node.id.clone(), ahead.node.sequence_id);
        }
        if self.faults.has(F::R1CancelKeepsCurrentEdge) && self.book.entered {
            let current = self.book.edges.front().cloned();
            self.book.drop_route();
            self.book.edges.extend(current);
        } else if !self.faults.has(F::CancelLeavesNodes) {
            self.book.drop_route();
        } else if cancel.to_node {
            // All that was left was this node.
            self.book.nodes.extend(self.book.left.0.clone());
        }
        if self.faults.has(F::R1CancelResetsUpdateId) {
            self.book.update_id = 0;
        }
        if self.faults.has(F::CancelClearsOrderId) {
            self.book.order_id.clear();
        }
        if self.faults.has(F::CancelResetsUpdateId) {
            self.book.update_id = 0;
        }
        if self.faults.has(F::CancelClearsLastNode) {
            self.book.last_node.clear();
        }
        if self.faults.has(F::R6CancelClearsOrderWarnings) {
            self.errors.new_order();
        }
        if self.faults.has(F::CancelForgetsLoad) {
            self.loads.clear();
        }
        if self.faults.has(F::CancelDropsActions) {
            self.actions.retain(|action| !action.of_order());
        }
        if self.faults.has(F::CancelForgetsActions) {
            self.book.soon = Some(self.moment() + MOMENT);
        }
        if !self.faults.has(F::CancelNeverFinished)
            && let Some(action) = self.actions.get_mut(&cancel.action_id)
        {
            action.end(Status::Finished);
        }
        true
    }

    /// What a faulty vehicle does a moment after it stopped or was cancelled.
    pub(crate) fn a_moment_later(&mut self) {
        if self.book.soon.is_none_or(|soon| soon > self.moment()) {
            return;
        }
        self.book.soon = None;
        self.book.slipped = self.faults.has(F::HorizonSlippedInto) || self.faults.has(F::HorizonCreptInto);
        if self.faults.has(F::CancelForgetsActions) {
            self.actions.retain(|action| !action.of_order());
        }
    }

    /// Drops the order at once, with everything that belongs to it.
    pub(crate) fn give_up_order(&mut self) {
        let moment = self.moment();
        self.motion.halt(moment);
        self.motion.reached = false;
        for action in self
            .actions
            .iter_mut()
            .filter(|action| action.of_order() && !action.status.is_terminal())
        {
            action.end(Status::Failed);
        }
        self.actions.drop_lists();
        self.book.drop_route();
        if let Some(cancel) = self.book.cancel.take()
            && let Some(action) = self.actions.get_mut(&cancel.action_id)
        {
            action.end(Status::Finished);
        }
        self.end_further_cancels();
        self.book.cancelled = self.book.has_order();
    }
}

/// Whether a faulty vehicle misses this action when its order is cancelled.
fn survives(action: &Action, faults: super::Faults) -> bool {
    match action.status {
        Status::Waiting => matches!(action.origin, Origin::Edge(_)) && faults.has(F::CancelMissesEdgeActions),
        Status::Initializing if faults.has(F::PreparedActionsSurviveCancel) => true,
        Status::Paused if faults.has(F::PausedActionsSurviveCancel) => true,
        status => {
            let of_edge = matches!(action.origin, Origin::Edge(_));
            status.is_active() && of_edge && faults.has(F::R4CancelLeavesEdgeActionRunning)
        }
    }
}

fn interrupted(action: &Action, faults: super::Faults) -> Status {
    let trigger = action.kind.is_some_and(|kind| kind.deed == Deed::WaitForTrigger);
    if !trigger && faults.has(F::R1CancelledActionFinished) || trigger && faults.has(F::TriggerSurvivesCancel) {
        Status::Finished
    } else {
        Status::Failed
    }
}
