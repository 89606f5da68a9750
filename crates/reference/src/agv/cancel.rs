//! cancelOrder, for all four capabilities of figure 9, and giving an order up altogether (section 6.6.3).
//!
//! A completed order is none, and its cancelOrder is FAILED although a table of section 6.8 knows no failure of it (the
//! ruling of ORD-CANCEL-18); the error stays for a while, as nothing says how long (that of ORD-CANCEL-19). A vehicle
//! that cannot stop between nodes keeps the next node, and no edge (that of ORD-CANCEL-09).

use super::Agv;
use super::action_kinds::Effect;
use super::actions::{Action, Status};
use super::errors::{ActiveError, Life};
use super::hook_points::{Event, Permission};
use super::order_state::Cancel;

impl Agv {
    /// A cancelOrder action begins.
    pub(crate) fn cancel_order(&mut self, action_id: &str) {
        let active = !self.order.nodes.is_empty() || self.actions.order_unfinished();
        if self.means_another_order(action_id) || !active || self.order.cancel.is_some() || self.order.cancelled {
            self.nothing_to_cancel(action_id);
            return;
        }
        let to_node = !self.config.stops_between_nodes && (self.order.entered || self.motion.reached);
        let to_node = self.allows(Permission::CancelAtNode, to_node);
        self.stop_actions();
        if to_node {
            self.order.nodes.truncate(1);
            self.order.edges.clear();
        }
        self.order.cancel = Some(Cancel {
            action_id: action_id.to_owned(),
            to_node,
        });
        if let Some(action) = self.actions.get_mut(action_id) {
            action.status = Status::Running;
        }
        self.happens(Event::CancelBegun);
        if self.config.has("cancelRunsFromReceipt") {
            self.flush();
        }
    }

    /// Whether a cancelOrder names an order that is not the one there is, where the version lets it name one.
    fn means_another_order(&self, action_id: &str) -> bool {
        let named = self.actions.get(action_id).map_or("", |action| action.text("orderId"));
        let says_which = self.config.has("cancelByOrderId") && !named.is_empty();
        says_which && self.allows(Permission::LeaveOrder, named != self.order.order_id)
    }

    /// No order, or one that was cancelled before (ORD-CANCEL-18 to ORD-CANCEL-20).
    pub(crate) fn nothing_to_cancel(&mut self, action_id: &str) {
        if let Some(action) = self.actions.get_mut(action_id) {
            action.end(Status::Failed);
        }
        self.raise_nothing_to_cancel(ActiveError {
            error_type: self.config.errors.no_order_to_cancel.clone(),
            fatal: false,
            references: vec![("actionId".to_owned(), action_id.to_owned())],
            description: "there is no order to cancel".into(),
            life: Life::Until(self.moment() + self.config.error_duration),
        });
    }

    /// Ends the actions of the order, as far as they can be interrupted (ORD-CANCEL-03 to ORD-CANCEL-05).
    pub(crate) fn stop_actions(&mut self) {
        let interruptible = |action: &Action| match action.kind.map(|kind| kind.effect) {
            Some(Effect::WaitForTrigger) => true,
            Some(Effect::Calibrate) => false,
            _ => self.config.interruptible,
        };
        let end = |action: &Action| {
            let ends = match action.status {
                Status::Waiting => true,
                status => status.is_active() && interruptible(action),
            };
            let status = self.breaks(action, ends.then_some(Status::Failed))?;
            Some((action.request.id.clone(), status))
        };
        let of_order = self.actions.iter().filter(|action| action.of_order());
        let ends: Vec<(String, Status)> = of_order.filter_map(end).collect();
        for (id, status) in ends {
            if let Some(action) = self.actions.get_mut(&id) {
                action.end(status);
            }
        }
        if self.allows(Permission::ForgetQueue, true) {
            self.actions.drop_lists();
        }
    }

    /// Ends the cancellation once nothing moves or runs any more (ORD-CANCEL-07, ORD-CANCEL-11).
    pub(crate) fn settle_cancel(&mut self) -> bool {
        let Some(cancel) = self.order.cancel.clone() else {
            return false;
        };
        let under_way = cancel.to_node && !self.order.nodes.is_empty() || self.motion.is_moving();
        let under_way = self.allows(Permission::CancelAwaitsWay, under_way);
        let open = |action: &Action| action.of_order() && !action.status.is_terminal();
        let awaited = |action: &Action| open(action) && self.allows(Permission::CancelAwaits(action), true);
        let ends = !under_way && !self.actions.iter().any(awaited);
        if !self.allows(Permission::EndCancel, ends) {
            return false;
        }
        self.happens(Event::CancelEnding);
        self.order.cancel = None;
        self.order.cancelled = true;
        self.order.drop_route();
        if let Some(action) = self.actions.get_mut(&cancel.action_id) {
            action.end(Status::Finished);
        }
        self.happens(Event::Cancelled);
        true
    }

    /// Drops the order at once, with everything that belongs to it (MODE-05).
    pub(crate) fn give_up_order(&mut self) {
        let moment = self.moment();
        self.motion.halt(moment);
        self.motion.reached = false;
        let open = |action: &&mut Action| action.of_order() && !action.status.is_terminal();
        for action in self.actions.iter_mut().filter(open) {
            action.end(Status::Failed);
        }
        self.actions.drop_lists();
        self.order.drop_route();
        if let Some(cancel) = self.order.cancel.take()
            && let Some(action) = self.actions.get_mut(&cancel.action_id)
        {
            action.end(Status::Finished);
        }
        self.order.cancelled = self.order.has_order();
        self.happens(Event::GivenUp);
    }
}
