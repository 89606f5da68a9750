//! Order updates: whether one continues the order, and taking it over (rows 8 and 10 of figure 8).

use super::Agv;
use super::actions::{Action, Origin, Status};
use super::faults::FaultName as F;
use super::order_message::{Node, Order};
use super::rejection::{Refusal, Rule};
use super::tolerances::ToleranceName as T;

impl Agv {
    /// Rows 8 and 10: whether the update continues the order.
    pub(crate) fn check_update(&self, order: &mut Order) -> Result<(), Refusal> {
        let busy = self.is_busy();
        let cancelled = self.book.cancel.is_some() || self.book.cancelled;
        let ended = self.book.cancel.is_some() && self.faults.has(F::CancelEndedByUpdate);
        if cancelled && !ended && !self.faults.has(F::CancelledOrderRevived) {
            return Err(Refusal::new(Rule::BrokenUpdate, "the order was cancelled"));
        }
        if self.refuses_updates_now() {
            return Err(Refusal::new(Rule::BrokenUpdate, "no update is taken now"));
        }
        if order.nodes.len() == 1 && self.faults.has(F::R2StitchOnlyUpdateRefused) {
            return Err(Refusal::new(Rule::BrokenUpdate, "the update brings nothing new"));
        }
        let plans_only = order.nodes.len() > 1 && order.nodes.iter().skip(1).all(|node| !node.released);
        if plans_only && self.faults.has(F::R6UpdateOfHorizonOnlyRefused) {
            return Err(Refusal::new(Rule::BrokenUpdate, "the update releases nothing"));
        }
        if self.faults.has(F::CompletedNotContinued) && !busy {
            return Err(Refusal::new(Rule::BrokenUpdate, "the order is complete"));
        }
        if self.faults.has(F::R4SecondExtensionRefused) && self.waits_for_first_base() {
            return Err(Refusal::new(
                Rule::BrokenUpdate,
                "the update does not continue the order",
            ));
        }
        let failed = |action: &Action| action.of_order() && action.status == Status::Failed;
        if !busy && self.actions.iter().any(failed) && self.faults.has(F::R3FailedOrderNotContinued) {
            return Err(Refusal::new(Rule::BrokenUpdate, "an action of the order has failed"));
        }
        let first = &order.nodes[0];
        let joins = if busy || cancelled {
            (&first.id, first.sequence_id) == (&self.book.base_end.0, self.book.base_end.1)
                || self.faults.has(F::RunningUpdateGapAccepted)
                || (self.faults.has(F::UpdateJoinedByNumber) && first.sequence_id == self.book.base_end.1)
                || (first.id == self.book.base_end.0 && self.faults.has(F::R1JointSequenceUnchecked))
                || self.faults.has(F::OutdatedUpdateTakenOver)
        } else {
            (&first.id, first.sequence_id) == (&self.book.last_node, self.book.last_sequence)
                || self.faults.has(F::CompletedUpdateGapAccepted)
                || (first.sequence_id == self.book.last_sequence && self.faults.has(F::R1JointNodeUnchecked))
        };
        if !joins {
            let refusal = Refusal::new(Rule::BrokenUpdate, "the update does not continue the order");
            return Err(refusal.naming("nodeId", &first.id));
        }
        let altered = first
            .actions
            .iter()
            .find(|action| self.actions.get(&action.id).is_none());
        if let Some(altered) = altered.filter(|_| self.takes(T::R1AlteredJointRejected)) {
            let reason = "the stitching node has another action than before";
            let refusal = Refusal::at_field(Rule::Unable, reason, &altered.path);
            return Err(refusal.naming("actionId", &altered.id));
        }
        self.check_ability(order, 1)
    }

    /// Whether a faulty vehicle does not take an update that continues its order.
    fn refuses_updates_now(&self) -> bool {
        let acting = || {
            self.actions
                .iter()
                .any(|action| action.of_order() && action.status.is_active())
        };
        (self.faults.has(F::OnlyFirstUpdate) && self.book.updated)
            || (self.faults.has(F::UpdateRefusedWhileActing) && acting())
            || (self.faults.has(F::UpdateRefusedWhilePaused) && self.holds.pause)
            || (self.faults.has(F::UpdateRefusedAfterCut) && self.book.cut)
    }

    /// Rows 8 and 10: takes over an update.
    pub(crate) fn continue_with(&mut self, mut order: Order) {
        if !self.is_busy() && self.faults.has(F::R6ContinuationClearsActionStates) {
            self.actions.retain(|action| !action.status.is_terminal());
        }
        self.book.continued |= !self.is_busy();
        self.book.cancelled = false;
        if let Some(cancel) = self.book.cancel.take()
            && let Some(action) = self.actions.get_mut(&cancel.action_id)
        {
            action.end(Status::Finished);
        }
        self.book.updated = true;
        self.report.update_received = true;
        self.note_joint();
        if self.faults.has(F::R4FirstStateAfterUpdateHasOldLists) {
            let update_id = std::mem::replace(&mut self.book.update_id, order.update_id);
            self.flush();
            self.book.update_id = update_id;
        }
        let shortens = order.nodes.len() == 1 && self.faults.has(F::R4HorizonDeletionShortensBase);
        if shortens && self.book.nodes.iter().any(|stop| !stop.node.released) {
            self.shorten_base();
        }
        let plans_only = order.nodes.len() > 1 && order.nodes.iter().skip(1).all(|node| !node.released);
        if plans_only && self.faults.has(F::R2HorizonChangeIgnored) {
            self.book.update_id = order.update_id;
            return;
        }
        let keep = if order.nodes.iter().any(|node| !node.released) {
            self.faults.has(F::HorizonAppended)
        } else {
            self.faults.has(F::HorizonKept)
        };
        self.take_update_wrongly(&order);
        if self.motion.is_moving() && self.faults.has(F::R3NewHorizonLostWhileDriving) {
            order.nodes.retain(|node| node.released);
            order.edges.retain(|edge| edge.released);
        }
        let kept = order.nodes.len() == 1 && self.faults.has(F::R3StitchOnlyUpdateIdKept);
        if !keep {
            self.drop_horizon();
        }
        if self.faults.has(F::UpdateReplacesBase) {
            while self.book.nodes.len() > 1 {
                self.book.nodes.pop_front();
                self.book.edges.pop_front();
            }
        }
        if !kept && !self.faults.has(F::UpdateIdKept) {
            self.book.update_id = order.update_id;
        }
        self.continue_actions_wrongly(&mut order);
        let mut nodes = order.nodes.into_iter();
        let joint = nodes.next();
        if let Some(joint) = &joint {
            self.join_badly(joint);
        }
        if let Some(joint) = joint.filter(|_| self.faults.has(F::StitchingNodeOverwritten)) {
            self.overwrite_joint(joint);
        }
        self.append(nodes.collect(), order.edges);
        self.book.dropped.clear();
        if self.faults.has(F::R3UpdateServesAsTrigger) {
            self.trigger("");
        }
        if self.takes(T::R2AdoptsBeforeDriving) {
            self.flush();
        }
    }

    /// The horizon goes, and the actions that wait there.
    fn drop_horizon(&mut self) {
        let edges = self.book.edges.clone();
        let gone = self.book.drop_horizon();
        if self.faults.has(F::R1HorizonEdgesStay) {
            self.book.edges.extend(edges.into_iter().filter(|edge| !edge.released));
        }
        let of_horizon = |action: &Action| match action.origin {
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => gone.contains(&sequence_id),
            Origin::Instant => false,
        };
        let waiting = self.actions.iter().filter(|action| of_horizon(action));
        self.book.dropped = waiting.map(|action| action.request.id.clone()).collect();
        if self.takes(T::R1HorizonActionsFail) {
            let given_up = self.actions.iter_mut().filter(|action| of_horizon(action));
            given_up
                .filter(|action| !action.status.is_terminal())
                .for_each(|action| action.end(Status::Failed));
        } else if self.faults.has(F::HorizonActionsStay) {
            // Nothing ever triggers them.
            let stranded = self.actions.iter_mut().filter(|action| of_horizon(action));
            stranded.for_each(|action| action.origin = Origin::Node(u32::MAX));
        } else if self.faults.has(F::R6OldHorizonEdgeActionsLinger) {
            let of_edge = |action: &Action| matches!(action.origin, Origin::Edge(_));
            self.actions.retain(|action| !of_horizon(action) || of_edge(action));
            // Nothing ever triggers them.
            let stranded = self.actions.iter_mut().filter(|action| of_horizon(action));
            stranded.for_each(|action| action.origin = Origin::Edge(u32::MAX));
        } else if !self.faults.has(F::HorizonActionsInherited) && !self.faults.has(F::ReleasedActionsDoubled) {
            self.actions.retain(|action| !of_horizon(action));
        }
    }

    /// What a faulty vehicle does to its actions, or to those of an update, when it takes the update over.
    fn continue_actions_wrongly(&mut self, order: &mut Order) {
        if self.faults.has(F::R2MaxSpeedOfUpdateIgnored) {
            order.edges.iter_mut().for_each(|edge| edge.max_speed = None);
        }
        if self.faults.has(F::R6TrajectoryOfUpdateIgnored) {
            order.edges.iter_mut().for_each(|edge| edge.trajectory = None);
        }
        if self.faults.has(F::UpdateEdgeActionsLost) {
            order.edges.iter_mut().for_each(|edge| edge.actions.clear());
        }
        if self.faults.has(F::UpdateActionsLost) {
            order.nodes.iter_mut().skip(1).for_each(|node| node.actions.clear());
            order.edges.iter_mut().for_each(|edge| edge.actions.clear());
        }
        if self.faults.has(F::UpdateClearsActionStates) {
            self.actions
                .retain(|action| !action.of_order() || !action.status.is_terminal());
        }
        let here = Origin::Node(self.book.last_sequence);
        for action in self.actions.iter_mut().filter(|action| action.of_order()) {
            if self.faults.has(F::UpdateEndsActions) && action.status.is_active() {
                action.end(Status::Failed);
            }
            if self.faults.has(F::UpdateRepeatsActions) && action.origin == here && action.status.is_terminal() {
                action.end(Status::Waiting);
            }
        }
        if self.faults.has(F::UpdateRepeatsActions) {
            self.actions.trigger(here, self.faults);
        }
        if self.faults.has(F::UpdateEndsPause) {
            self.set_holds(|holds| holds.pause = false);
        }
    }

    /// What a faulty vehicle does when it takes an update over, before it looks at the horizon.
    fn take_update_wrongly(&mut self, order: &Order) {
        if self.is_busy() && self.motion.is_moving() && self.faults.has(F::R1StopsAtStitch) {
            self.book.stuck_at = Some(self.book.base_end.1);
        }
        if self.faults.has(F::R3UpdateInPauseNotDriven) {
            self.book.stuck_at = self.holds.pause.then_some(self.book.base_end.1);
        }
        let stands = self.waits_at_decision_point() && !self.motion.is_moving();
        self.book.stunned |= stands && self.faults.has(F::R4UpdateAtDecisionPointNotDriven);
        self.book.heedless |= self.holds.pause && self.faults.has(F::R1UpdateDrivesInPause);
        let plans_only = order.nodes.len() > 1 && order.nodes.iter().skip(1).all(|node| !node.released);
        self.book.unbound |= plans_only && self.faults.has(F::R1HorizonUpdateDriven);
        let faults = self.faults;
        self.actions.retain(|action| {
            let forgotten = action.status.is_terminal()
                && if action.of_order() {
                    faults.has(F::R1UpdateForgetsEndedActions)
                } else {
                    faults.has(F::R1UpdateForgetsInstantActions)
                };
            !forgotten
        });
    }

    /// What a faulty vehicle does with the stitching node of an update.
    fn join_badly(&mut self, joint: &Node) {
        let open = self
            .book
            .nodes
            .iter()
            .any(|stop| stop.node.sequence_id == joint.sequence_id);
        if !open && self.faults.has(F::R1JointActionsRepeated) && !joint.actions.is_empty() {
            self.repeat_actions(joint.sequence_id);
        }
        if self.faults.has(F::R1JointPositionReplaced) {
            let place = self.place(joint);
            for stop in &mut self.book.nodes {
                if stop.node.sequence_id == joint.sequence_id {
                    stop.node.position.clone_from(&joint.position);
                    stop.node.sent_position.clone_from(&joint.sent_position);
                    if let Some(place) = &place {
                        stop.place.clone_from(place);
                    }
                }
            }
        }
        if self.faults.has(F::R1JointListedTwice) {
            let again = self
                .book
                .nodes
                .iter()
                .find(|stop| stop.node.sequence_id == joint.sequence_id)
                .cloned();
            self.book.nodes.extend(again);
        }
    }

    /// `stitching-node-overwritten`: what the first transmission said is forgotten.
    fn overwrite_joint(&mut self, joint: Node) {
        let origin = Origin::Node(joint.sequence_id);
        let open = self
            .book
            .nodes
            .iter()
            .any(|stop| stop.node.sequence_id == joint.sequence_id);
        self.actions
            .retain(|action| action.origin != origin || action.status.is_terminal());
        self.push_actions(joint.actions, origin);
        if !open {
            self.actions.trigger(origin, self.faults);
        }
    }
}
