//! When an order is begun: the vehicle is free, fit and known, and its way is planned (sections 6.6.1 and 6.11).

use std::time::Duration;

use serde_json::Value;

use super::Site;
use super::hooks::{Event, Measure, Occasion, Permission, Span};
use super::order::Window;
use super::vehicle::{Leg, Running, Stop, Transport, Vehicle};
use tck_base::clock::Moment;

/// A way as far as it is planned.
#[derive(Clone, Debug, Default)]
pub(crate) struct Way {
    pub(crate) stops: Vec<Stop>,
    pub(crate) legs: Vec<Leg>,
}

impl Site {
    /// Begins the next transport of a vehicle.
    pub(super) fn begin_next(&mut self, vehicle: &mut Vehicle) {
        let idle = vehicle.running.is_none() && vehicle.cancel.is_none() && self.commandable(vehicle);
        let Some(transport) = vehicle.queue.front().cloned().filter(|_| idle) else {
            return;
        };
        if !self.may_begin(vehicle) {
            return;
        }
        if let Some(due) = self.next_order_at(vehicle, Occasion::New) {
            vehicle.at(due);
            return;
        }
        let Some(way) = self.planned(vehicle, &transport) else {
            // There is no way, or the vehicle cannot be told it.
            vehicle.queue.pop_front();
            vehicle.at(self.now.moment);
            return;
        };
        let mut running = Running {
            id: self.next_id(vehicle, "order"),
            stops: way.stops,
            legs: way.legs,
            transport,
            ..Running::default()
        };
        self.happens(vehicle, &mut Event::Planned(&mut running));
        let end = self.free_until(vehicle, &running, 0);
        let released = end.min(self.config.base_length.max(1).saturating_add(1));
        if released < 2 && running.stops.len() > 1 {
            return;
        }
        let mut window = Window {
            first: 0,
            released,
            end: end.min(released.saturating_add(self.config.horizon_length)),
        };
        self.shows(vehicle, &running, &mut window, end);
        if !self.maps_ready(vehicle, &running, 0..released.max(window.released)) {
            return;
        }
        self.happens(vehicle, &mut Event::Begins(&mut running));
        vehicle.queue.pop_front();
        let Some((message, window)) = self.order_message(vehicle, &running, window) else {
            return;
        };
        running.transport.begun += 1;
        running.released = window.released;
        self.send_order(vehicle, &mut running, message);
        vehicle.running = Some(running);
        self.happens(vehicle, &mut Event::Begun);
    }

    /// Publishes an order message and watches for it.
    pub(super) fn send_order(&mut self, vehicle: &mut Vehicle, running: &mut Running, message: Value) {
        let now = self.now.moment;
        running.message = message;
        running.sent_at = now;
        running.resends = 0;
        running.confirmed = false;
        running.changed = false;
        vehicle.last_order_at = Some(now);
        vehicle.at(self.lost_after(vehicle, now));
        self.publish(vehicle, "order", &running.message);
    }

    /// When the next order message may be sent; `None` if now (FACT-13).
    pub(crate) fn next_order_at(&self, vehicle: &Vehicle, occasion: Occasion) -> Option<Moment> {
        let interval = vehicle.factsheet.as_ref().map_or(0.0, |sheet| sheet.order_interval);
        // A little more, since both sides measure.
        let interval = Duration::from_secs_f64(interval * 1.02);
        let due = vehicle.last_order_at? + self.lasts(vehicle, Span::Interval(occasion), interval);
        (due > self.now.moment).then_some(due)
    }

    /// Whether a new order may be begun: nothing is wrong with the vehicle, and nothing is under way.
    fn may_begin(&mut self, vehicle: &mut Vehicle) -> bool {
        let Some(state) = &vehicle.state else { return false };
        let free = state.route_empty() || self.allows(vehicle, Permission::Interrupt, false);
        let fit = self.allows(vehicle, Permission::Fit, state.is_fit(self.config.low_battery));
        let level = vehicle.factsheet.as_ref().and_then(|sheet| sheet.critical_charge);
        let charges = |transport: &Transport| transport.action.as_deref() == Some("startCharging");
        let empty = state.is_critical(level) && !vehicle.queue.front().is_some_and(charges);
        let fit = fit && !self.allows(vehicle, Permission::Starve, empty);
        if !free || !fit || !self.zones_ready(vehicle) || !self.allows(vehicle, Permission::Begin, true) {
            return false;
        }
        let waits = |kind: &str| matches!(kind, "initPosition" | "stopCharging");
        if vehicle.instants.iter().any(|instant| waits(instant.kind())) {
            return false;
        }
        if let Some((since, _)) = vehicle.missed
            && vehicle.factsheet.is_none()
        {
            let due = since + Duration::from_secs(4);
            if due > self.now.moment {
                vehicle.at(due);
                return false;
            }
        }
        true
    }

    /// Index behind the last node that can be reached without a blocked edge, from `base` nodes on (ORD-12).
    pub(super) fn free_until(&self, vehicle: &Vehicle, running: &Running, base: usize) -> usize {
        let mut legs = running.legs.iter().enumerate().skip(base.saturating_sub(1));
        let blocked = legs.find(|(_, leg)| {
            let open = !vehicle.blocked.contains(&(leg.from.clone(), leg.to.clone()));
            !self.allows(vehicle, Permission::Drive(base), open)
        });
        let free = blocked.map_or(running.stops.len(), |(index, _)| index + 1);
        self.measures(vehicle, Measure::Free, free)
    }

    /// The whole way of a transport; `None` if there is none the vehicle can be told.
    fn planned(&mut self, vehicle: &mut Vehicle, transport: &Transport) -> Option<Way> {
        let from = transport.from.as_ref().filter(|_| !transport.loaded);
        let (mut way, here) = self.begin_at(vehicle, from.unwrap_or(&transport.to), transport)?;
        self.lead(vehicle, &mut way, &here, transport)?;
        self.plans(vehicle, &mut way, transport, true);
        (self.names_fit(vehicle, &way) && self.actions_fit(vehicle, &way)).then_some(way)
    }
}
