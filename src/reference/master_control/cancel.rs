//! Calling orders off: cancelOrder, its end, and only then what comes next.

use serde_json::{Value, json};

use super::Site;
use super::faults::{FaultName as F, Faults};
use super::instant::ended;
use super::seen::State;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Cancel, Presence, Transport, Vehicle};

impl Site {
    /// Calls the running order off once; `then` is what the vehicle is to do instead.
    pub(super) fn cancel(&mut self, vehicle: &mut Vehicle, then: Option<Transport>) {
        if let Some(cancel) = &mut vehicle.cancel {
            cancel.then = then;
            return;
        }
        let Some(running) = &vehicle.running else { return };
        if running.message.is_null() {
            // Nobody has heard of it yet.
            vehicle.running = None;
            vehicle.queue.extend(then);
            return;
        }
        if !running.accepted && self.faults.has(F::R2CancelForgottenBeforeAcceptance) {
            vehicle.last_order = vehicle.running.take();
            vehicle.queue.extend(then);
            return;
        }
        if vehicle.presence == Presence::Away && self.faults.has(F::R1CancelLostWhileAway) {
            return;
        }
        if vehicle.presence == Presence::Away && self.faults.has(F::R5CancelLostWhileDisconnected) {
            vehicle.last_order = vehicle.running.take();
            vehicle.r1_hasty = true;
            vehicle.queue.extend(then);
            return;
        }
        if vehicle.r3_cancels > 0 && self.faults.has(F::R3CancelsOnlyOnce) {
            return;
        }
        vehicle.r3_cancels += 1;
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.clone());
        vehicle.r3_cancelled_at = position;
        let paused = vehicle.state.as_ref().is_some_and(super::seen::State::is_paused);
        if paused && self.faults.has(F::R5CancelOfPausedVehicleOnlyInternal) {
            vehicle.last_order = vehicle.running.take();
            vehicle.r5_dropped = true;
            vehicle.queue.extend(then);
            return;
        }
        if self.faults.has(F::R1PauseInsteadOfCancel) {
            let pausing = vehicle.instants.iter().any(|instant| instant.kind() == "startPause");
            if !paused && !pausing {
                self.instant(vehicle, "startPause", &Value::Null);
            }
            return;
        }
        let works = vehicle.state.as_ref().is_some_and(|state| {
            let mut ids = running.actions().filter_map(|action| action["actionId"].as_str());
            !state.driving && ids.any(|id| state.action(id).is_some_and(|action| !action.is_terminal()))
        });
        let replaced = (paused && self.faults.has(F::R1PausedOrderReplaced))
            || (works && then.is_some() && self.faults.has(F::ReplacedAtWork));
        if replaced {
            vehicle.last_order = vehicle.running.take();
            vehicle.r1_hasty = true;
            if let Some(transport) = then {
                vehicle.queue.push_front(transport);
            }
            return;
        }
        if self.faults.has(F::OrderInsteadOfCancel) {
            vehicle.last_order = vehicle.running.take();
            match then {
                Some(transport) => vehicle.queue.push_front(transport),
                None => stop_by_order(vehicle),
            }
            return;
        }
        if self.faults.has(F::NoNodes) {
            let body =
                json!({ "orderId": running.id, "orderUpdateId": running.update_id + 1, "nodes": [], "edges": [] });
            self.publish(vehicle, "order", &body);
        }
        if paused && self.takes(T::R3ResumesBeforeCancel) {
            self.instant(vehicle, "stopPause", &Value::Null);
        }
        if !paused && self.takes(T::R2PausesBeforeCancel) {
            vehicle.r2_resume = self.instant(vehicle, "startPause", &Value::Null).is_some();
        }
        let Some(action_id) = self.instant(vehicle, "cancelOrder", &Value::Null) else {
            return;
        };
        if self.faults.has(F::CancelNotAwaited) {
            self.send_instants(vehicle);
            vehicle.last_order = vehicle.running.take();
            if let Some(transport) = then {
                vehicle.queue.push_front(transport);
            }
            return;
        }
        if let Some(running) = &mut vehicle.running {
            // Only a faulty master control has made one.
            vehicle.r6_late = running.r6_waiting.take();
        }
        vehicle.cancel = Some(Cancel { action_id, then });
    }
}

/// `order-instead-of-cancel`: an order that ends where the vehicle is.
fn stop_by_order(vehicle: &mut Vehicle) {
    let last = vehicle.state.as_ref().map(|state| state.last_node_id.clone());
    if let Some(to) = last.filter(|node| !node.is_empty()) {
        vehicle.queue.push_front(Transport {
            to,
            ..Transport::default()
        });
    }
}

/// Goes on when the cancellation has ended and the order is over (ORD-CANCEL-01).
pub(super) fn watch_cancel(vehicle: &mut Vehicle, faults: Faults) {
    let Some(cancel) = vehicle.cancel.clone() else { return };
    let cleared = vehicle.state.as_ref().is_some_and(State::route_empty);
    let finished = match ended(vehicle, &cancel.action_id) {
        Some(finished) => finished,
        None if cleared && faults.has(F::CancelEndsWithRoute) => true,
        None => return,
    };
    let Some(state) = &vehicle.state else { return };
    let order_id = vehicle.running.as_ref().map(|running| running.id.as_str());
    let other = order_id != Some(state.order_id.as_str());
    let busy = !other && !state.route_empty();
    if finished && busy {
        return;
    }
    vehicle.cancel = None;
    let over = busy && faults.has(F::R2FailedCancelTakenForDone);
    vehicle.r1_hasty |= over;
    if busy && !over {
        // It could not be called off, and is driven to its end.
        vehicle.queue.extend(cancel.then);
        return;
    }
    vehicle.last_order = vehicle.running.take();
    vehicle.r1_cancelled = true;
    vehicle.r1_kept = vehicle
        .last_order
        .as_ref()
        .map(|order| (order.id.clone(), order.update_id));
    if let Some(transport) = cancel.then {
        vehicle.queue.push_front(transport);
    }
}
