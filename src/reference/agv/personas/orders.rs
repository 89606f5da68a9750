//! Orders a vehicle ignores or rejects because it was told to.

use serde_json::Value;

use super::Told;
use crate::reference::agv::Agv;
use crate::reference::agv::errors::{ActiveError, Life};
use crate::reference::agv::order_message::Order;
use crate::reference::agv::rejection::message_references;

/// How orders are rejected, and how many still are.
#[derive(Clone, Debug)]
pub(in crate::reference::agv) struct Rejection {
    error_type: String,
    references: bool,
    left: u64,
}

impl Rejection {
    pub(super) fn told(told: &Told<'_>) -> Option<Self> {
        Some(Self {
            error_type: told.text("errorType")?,
            references: told.flag("references").unwrap_or(true),
            left: told.count(u64::MAX),
        })
    }
}

impl Agv {
    /// Whether an order is not even looked at.
    pub(in crate::reference::agv) fn ignores_order(&mut self) -> bool {
        let ignores = self.persona.ignored_orders > 0;
        self.persona.ignored_orders = self.persona.ignored_orders.saturating_sub(1);
        ignores
    }

    /// Rejects an order it was told to reject; whether it was one.
    pub(in crate::reference::agv) fn rejects_as_told(&mut self, order: &Order, message: &Value) -> bool {
        let new = order.id != self.book.order_id;
        if !new && order.update_id <= self.book.update_id {
            return false;
        }
        let slot = if new {
            &mut self.persona.new_orders
        } else {
            &mut self.persona.updates
        };
        let Some(rejection) = slot.as_mut().filter(|rejection| rejection.left > 0) else {
            return false;
        };
        rejection.left -= 1;
        let rejection = rejection.clone();
        let life = if new {
            Life::UntilNewOrder
        } else {
            Life::Until(self.moment() + self.config.error_duration)
        };
        self.errors.raise(ActiveError {
            error_type: rejection.error_type,
            // A refusal is a WARNING, whatever its type.
            fatal: false,
            references: if rejection.references {
                message_references(message)
            } else {
                Vec::new()
            },
            description: "the vehicle does not take this order".into(),
            life,
        });
        true
    }
}
