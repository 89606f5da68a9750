//! Calling orders off: cancelOrder, its end, and only then what comes next (section 6.6.3, ORD-CANCEL-01).
//!
//! Where the vehicle stands after that, and how the next order begins there, stands in `ways` (the ruling of
//! ORD-CANCEL-17).

use serde_json::{Value, json};

use super::Site;
use super::hooks::{Event, Permission};
use super::vehicle::{Cancel, Running, Transport, Vehicle};

impl Site {
    /// Calls the running order off once; `then` is what the vehicle is to do instead.
    pub(crate) fn cancel(&mut self, vehicle: &mut Vehicle, mut then: Option<Transport>) {
        if let Some(cancel) = &mut vehicle.cancel {
            cancel.then = then;
            return;
        }
        if vehicle.running.is_none() {
            return;
        }
        let mut sends = true;
        self.happens(vehicle, &mut Event::CallingOff(&mut then, &mut sends));
        if !sends {
            return;
        }
        let order_id = vehicle.running.as_ref().map(|running| running.id.clone());
        let named = if vehicle.config.has("cancelByOrderId") {
            json!({ "orderId": order_id })
        } else {
            Value::Null
        };
        if let Some(action_id) = self.instant(vehicle, "cancelOrder", &named) {
            vehicle.cancel = Some(Cancel { action_id, then });
            self.happens(vehicle, &mut Event::CalledOff);
        }
    }

    /// Forgets the running order, and does this next.
    pub(crate) fn drop_order(&mut self, vehicle: &mut Vehicle, then: Option<Transport>) {
        if let Some(running) = vehicle.running.take() {
            self.end(vehicle, &running, false);
        }
        if let Some(transport) = then {
            vehicle.queue.push_front(transport);
        }
    }

    /// Goes on when the cancellation has ended and the order is over (ORD-CANCEL-01).
    pub(super) fn watch_cancel(&mut self, vehicle: &mut Vehicle) {
        let Some(cancel) = vehicle.cancel.clone() else { return };
        let ended = vehicle.ended(&cancel.action_id);
        if !self.allows(vehicle, Permission::CancelEnded, ended.is_some()) {
            return;
        }
        let Some(state) = &vehicle.state else { return };
        let order_id = vehicle.running.as_ref().map(|running| running.id.as_str());
        let driven = order_id == Some(state.order_id.as_str()) && !state.route_empty();
        if driven && ended != Some(false) {
            return;
        }
        vehicle.cancel = None;
        if self.allows(vehicle, Permission::OrderGone, !driven) {
            if let Some(running) = vehicle.running.take() {
                self.end(vehicle, &running, true);
            }
            if let Some(transport) = cancel.then {
                vehicle.queue.push_front(transport);
            }
        } else {
            // It could not be called off, and is driven to its end.
            vehicle.queue.extend(cancel.then);
            if let Some(running) = &mut vehicle.running {
                // Nothing more is released of what was called off (ORD-CANCEL-22).
                running.refused |= vehicle.config.has("strictUpdates");
            }
        }
        self.happens(vehicle, &mut Event::CancelOver);
    }

    /// An order is over.
    pub(super) fn end(&mut self, vehicle: &mut Vehicle, running: &Running, called_off: bool) {
        self.happens(vehicle, &mut Event::Ended(running, called_off));
    }
}
