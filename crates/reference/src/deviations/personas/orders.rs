//! Orders a vehicle ignores or rejects because it was told to.

use serde_json::Value;

use super::Persona;
use super::told::Told;
use crate::agv::Agv;
use crate::agv::errors::{ActiveError, Life};
use crate::agv::order_message::Order;
use crate::agv::rejection::message_references;

/// How orders are rejected, and how many still are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Rejection {
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

impl Persona {
    /// Whether an order is not even looked at.
    pub(super) fn ignores_order(&mut self) -> bool {
        let ignores = self.ignored_orders > 0;
        self.ignored_orders = self.ignored_orders.saturating_sub(1);
        ignores
    }

    /// Rejects an order it was told to reject, if the order can be read; whether it was one.
    pub(super) fn rejects(&mut self, agv: &mut Agv, payload: &[u8]) -> bool {
        if self.new_orders.is_none() && self.updates.is_none() || payload.len() > agv.config.max_message {
            return false;
        }
        let Ok(message) = serde_json::from_slice::<Value>(payload) else {
            return false;
        };
        let message = agv.understood("order", message);
        let Ok(order) = Order::read(&message) else { return false };
        if order.graph_defect().is_some() || agv.check_ids(&order).is_err() {
            return false;
        }
        let new = order.id != agv.order.order_id;
        if !new && order.update_id <= agv.order.update_id {
            return false;
        }
        let slot = if new { &mut self.new_orders } else { &mut self.updates };
        let Some(rejection) = slot.as_mut().filter(|rejection| rejection.left > 0) else {
            return false;
        };
        rejection.left -= 1;
        let life = match new {
            true => Life::UntilNewOrder,
            false => Life::Until(agv.moment() + agv.config.error_duration),
        };
        agv.report.order_received = true;
        agv.errors.raise(ActiveError {
            error_type: rejection.error_type.clone(),
            // A refusal is a WARNING, whatever its type.
            fatal: false,
            references: match rejection.references {
                true => message_references(&message),
                false => Vec::new(),
            },
            description: "the vehicle does not take this order".into(),
            life,
        });
        true
    }
}
