//! What is sent again although nobody needs it, or with other ids: faults only.
//!
//! The repetition of what was lost stands with the running order.

use std::time::Duration;

use serde_json::{Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::vehicle::{Running, Vehicle};

impl Site {
    /// `r1-resend-with-new-action-ids`: new ids for the actions of the message sent last.
    pub(super) fn rename_actions(&mut self, vehicle: &Vehicle, running: &mut Running) {
        let mut renamed = std::collections::BTreeMap::new();
        for key in ["nodes", "edges"] {
            let elements = running.message.get_mut(key).and_then(Value::as_array_mut);
            let actions = elements.into_iter().flatten();
            let actions = actions
                .filter_map(|element| element.get_mut("actions")?.as_array_mut())
                .flatten();
            for action in actions {
                let old = action["actionId"].as_str().unwrap_or_default().to_owned();
                let fresh = json!(self.next_id(vehicle, "action"));
                action["actionId"] = fresh.clone();
                renamed.insert(old, fresh);
            }
        }
        let on_nodes = running.stops.iter_mut().flat_map(|stop| &mut stop.actions);
        let on_edges = running.legs.iter_mut().flat_map(|leg| &mut leg.actions);
        for action in on_nodes.chain(on_edges) {
            let old = action["actionId"].as_str().unwrap_or_default();
            if let Some(fresh) = renamed.get(old).cloned() {
                action["actionId"] = fresh;
            }
        }
    }

    /// `r1-resend-in-service` and `r4-copies-in-manual`: repeats a lost order although the vehicle is in service, or
    /// driven by hand.
    pub(super) fn r1_resent_in_service(&mut self, vehicle: &mut Vehicle) -> bool {
        let deaf = vehicle.state.as_ref().is_some_and(|state| {
            let copied = match state.operating_mode.as_str() {
                "SERVICE" => F::R1ResendInService,
                "MANUAL" => F::R4CopiesInManual,
                _ => return false,
            };
            self.faults.has(copied)
        });
        let open = vehicle
            .running
            .as_ref()
            .is_some_and(|running| !running.confirmed && !running.refused);
        if !(deaf && open && self.reachable(vehicle)) {
            return false;
        }
        if let Some(mut running) = vehicle.running.take() {
            let shown = vehicle.state.as_ref().is_some_and(|state| state.order_id == running.id);
            let shown = shown
                && vehicle
                    .state
                    .as_ref()
                    .is_some_and(|state| state.order_update_id >= running.update_id);
            if !shown {
                self.send_again(vehicle, &mut running);
            }
            vehicle.running = Some(running);
        }
        true
    }

    /// `order-repeated-for-ever`: once more, and at once again, whatever has become of it.
    pub(super) fn repeat_for_ever(&mut self, vehicle: &mut Vehicle) {
        if !self.faults.has(F::OrderRepeatedForEver) {
            return;
        }
        let now = self.now.moment;
        let sheet = vehicle.factsheet.as_ref();
        let begins = vehicle.repeated.is_none() && sheet.is_some_and(|sheet| sheet.order_interval > 0.0);
        if let Some(running) = vehicle.running.as_ref().filter(|_| begins) {
            vehicle.repeated = Some((running.message.clone(), now));
        }
        let Some((message, due)) = vehicle.repeated.take() else {
            return;
        };
        let next = if due > now { due } else { now + Duration::from_millis(2) };
        vehicle.repeated = Some((message.clone(), next));
        vehicle.at(next);
        if due <= now {
            self.publish(vehicle, "order", &message);
        }
    }
}
