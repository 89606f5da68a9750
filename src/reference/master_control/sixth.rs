//! Faults and liberties of the sixth blind round that need more than a word where they are decided.

use serde_json::{Value, json};

use super::Site;
use super::config::SiteMap;
use super::faults::FaultName as F;
use super::maps::enabled_version;
use super::order::Window;
use super::seen::{Factsheet, State};
use super::tolerances::ToleranceName as T;
use super::vehicle::{Running, Vehicle};
use crate::reference::{Output, Publication};

/// With more seconds between two orders than this a horizon that was withdrawn would come back too late.
const QUICK: f64 = 1.0;

/// Every optional parameter that an order may have a value for.
const OPTIONAL: [&str; 16] = [
    "order.nodes.nodeDescription",
    "order.nodes.nodePosition.theta",
    "order.nodes.nodePosition.allowedDeviationXY",
    "order.nodes.nodePosition.allowedDeviationTheta",
    "order.edges.edgeDescription",
    "order.edges.maxSpeed",
    "order.edges.maxHeight",
    "order.edges.minHeight",
    "order.edges.orientation",
    "order.edges.orientationType",
    "order.edges.direction",
    "order.edges.rotationAllowed",
    "order.edges.maxRotationSpeed",
    "order.edges.length",
    "order.edges.trajectory",
    "order.edges.corridor",
];

impl Site {
    /// What a new state leads to, while the one before is still known.
    pub(super) fn r6_state(&self, vehicle: &mut Vehicle, state: &State) {
        let paused = vehicle.state.as_ref().is_some_and(State::is_paused);
        let Some(running) = &mut vehicle.running else { return };
        if state.order_id == running.id && self.faults.has(F::R6LostStateStopsProgress) {
            let reached = running.reached(Some(state));
            running.r6_skipped |= reached > running.r6_reached + 1;
            running.r6_reached = running.r6_reached.max(reached);
        }
        let resumed = paused && !state.is_paused() && running.accepted;
        if resumed && self.faults.has(F::R6ResumeRepeatsBase) {
            running.changed = true;
            vehicle.r5_whole = true;
        }
    }

    /// `r6-map-remembered-over-reconnect`: what was enabled before stays so for it.
    pub(super) fn r6_returned(&self, vehicle: &mut Vehicle) {
        if !self.faults.has(F::R6MapRememberedOverReconnect) {
            return;
        }
        let maps = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
        let enabled = maps.into_iter().flatten().filter(|map| map.map_status == "ENABLED");
        vehicle.r6_enabled.extend(enabled.map(|map| map.map_id.clone()));
    }

    /// `r6-queued-update-after-cancel`: makes the update that is sent as soon as minOrderInterval has passed.
    pub(super) fn r6_queue(&self, vehicle: &Vehicle, running: &mut Running, (target, free): (usize, usize)) {
        let released = target.max(running.released);
        let window = Window {
            first: running.released.saturating_sub(1),
            released,
            end: free.min(released.saturating_add(self.horizon_length())),
        };
        let mut next = running.clone();
        next.update_id += 1;
        running.r6_waiting = self.order_message(vehicle, &next, window).map(|(message, _)| message);
    }

    /// `r6-queued-update-after-cancel`: sends the update of an order that was called off while the update waited.
    pub(super) fn r6_send_late(&mut self, vehicle: &mut Vehicle) {
        if vehicle.r6_late.is_none() || !self.commandable(vehicle) {
            return;
        }
        // What was called off is sent before what had to wait.
        let waits = vehicle.instants.iter().any(|instant| instant.sent_at.is_none());
        if waits {
            vehicle.at(self.now.moment);
            return;
        }
        if let Some(due) = self.next_order_at(vehicle) {
            vehicle.at(due);
            return;
        }
        if let Some(message) = vehicle.r6_late.take() {
            vehicle.last_order_at = Some(self.now.moment);
            self.publish(vehicle, "order", &message);
        }
    }

    /// `r6-delete-map-under-running-order`: makes room for a new version, although the old one is driven on.
    pub(super) fn r6_tidy_up(&mut self, vehicle: &mut Vehicle, map: &SiteMap) {
        let version = enabled_version(vehicle, map);
        let running = vehicle.running.as_ref();
        let driven = running.is_some_and(|running| running.stops.iter().any(|stop| stop.map_id == map.map_id));
        if driven && version != map.map_version {
            self.map_action(vehicle, "deleteMap", &map.map_id, &version);
        }
    }

    /// `r6-cancels-on-fatal`: calls an order off, once, when the vehicle cannot go on with it.
    pub(super) fn r6_cancel_on_fatal(&mut self, vehicle: &mut Vehicle) {
        let state = vehicle.state.as_ref();
        let fatal = state.is_some_and(|state| state.errors.iter().any(|error| error.error_level == "FATAL"));
        if !fatal || vehicle.cancel.is_some() || !self.takes(T::R6CancelsOnFatal) || !self.commandable(vehicle) {
            return;
        }
        let Some(running) = &mut vehicle.running else { return };
        if running.accepted && !std::mem::replace(&mut running.r6_fatal, true) {
            self.cancel(vehicle, None);
        }
    }

    /// `r6-clears-retained-order-topics`: takes away what may have been left on the topics of a vehicle.
    pub(super) fn r6_clear(&mut self, vehicle: &Vehicle) {
        for name in ["order", "instantActions"] {
            if let Some(topic) = vehicle.topic(name).map(str::to_owned) {
                self.pending.push(Output::Publish(Publication {
                    topic,
                    payload: Vec::new(),
                    qos: 0,
                    retain: true,
                }));
            }
        }
    }

    /// `r6-several-instant-actions-in-one-message`: a stateRequest, if the vehicle takes one. Nobody awaits its end.
    pub(super) fn r6_question(&mut self, vehicle: &Vehicle) -> Option<Value> {
        let offered = self.offers(vehicle.factsheet.as_ref(), "stateRequest", "INSTANT");
        offered.then(|| self.action(vehicle, "stateRequest", &Value::Null))
    }

    /// Defects of nodes that depend on where in the order they are.
    pub(super) fn r6_nodes(&self, running: &Running, window: Window, nodes: &mut [Value]) {
        for (place, node) in nodes.iter_mut().enumerate() {
            let index = window.first + place;
            let Some(stop) = running.stops.get(index) else { continue };
            let first = running.stops.iter().position(|known| known.id == stop.id);
            if let Some(first) = first.filter(|_| self.faults.has(F::R6LoopNodeKeepsFirstSequenceId)) {
                node["sequenceId"] = json!(running.r1_number(2 * first));
            }
            // The layout is drawn from the lesser id to the greater.
            let before = index.checked_sub(1).and_then(|before| running.stops.get(before));
            let back = before.is_some_and(|before| before.id > stop.id);
            if back
                && self.faults.has(F::R6ThetaNotNormalisedOnReverse)
                && let Some(theta) = node.pointer_mut("/nodePosition/theta")
            {
                *theta = json!(theta.as_f64().unwrap_or_default() + std::f64::consts::PI);
            }
        }
    }

    /// Defects and liberties of an edge that depend on where in the order it is.
    pub(super) fn r6_edge(&self, vehicle: &Vehicle, running: &Running, window: Window, index: usize, edge: &mut Value) {
        let last = window.first > 0 && index + 2 == window.released;
        if last && self.faults.has(F::R6EdgeIntoLastBaseNodeUnreleased) {
            edge["released"] = json!(false);
        }
        if self.takes(T::R6CorridorWithOneSideZero)
            && narrow(vehicle, running)
            && let Some(corridor) = edge.get_mut("corridor")
            && let (Some(left), Some(right)) = (corridor["leftWidth"].as_f64(), corridor["rightWidth"].as_f64())
        {
            corridor["leftWidth"] = json!(left + right);
            corridor["rightWidth"] = json!(0.0);
        }
    }
}

/// Whether no node of the way allows a deviation, which might lie to the right of the next corridor (CORR-04).
fn narrow(vehicle: &Vehicle, running: &Running) -> bool {
    let sheet = vehicle.factsheet.as_ref();
    let demanded = sheet.and_then(|sheet| sheet.support("order.nodes.nodePosition.allowedDeviationXY"));
    let wide = |metres: f64| metres > 0.0;
    demanded != Some("REQUIRED") && !running.stops.iter().any(|stop| stop.deviation_xy.is_some_and(wide))
}

/// `r6-order-id-from-route`: the id of an order by where it begins and where it ends.
pub(super) fn route_id(running: &Running) -> String {
    let transport = &running.transport;
    let start = running.stops.first().map(|stop| stop.id.as_str());
    let from = transport.from.as_deref().or(start).unwrap_or_default();
    match transport.begun {
        0 => format!("{from}-to-{}", transport.to),
        times => format!("{from}-to-{}-{times}", transport.to),
    }
}

/// `r6-horizon-withdrawn-and-given-again`: deletes the horizon once, while the base is long enough.
pub(super) fn withdraw_horizon(vehicle: &Vehicle, running: &mut Running) {
    let sheet = vehicle.factsheet.as_ref();
    let quick = sheet.is_none_or(|sheet| sheet.order_interval <= QUICK);
    let mut nodes = running.message["nodes"].as_array().into_iter().flatten();
    let shown = nodes.any(|node| node["released"] == json!(false));
    if quick && shown && !running.r6_withdrawn && !running.changed {
        running.r6_withdrawn = true;
        running.r4_drops_horizon = true;
        running.changed = true;
    }
}

/// `r6-options-checked-on-first-order-only`: the factsheet of a vehicle that supports everything.
pub(super) fn open(sheet: &Factsheet) -> Factsheet {
    let mut sheet = sheet.clone();
    for name in OPTIONAL {
        sheet
            .optional
            .entry(name.to_owned())
            .or_insert_with(|| "SUPPORTED".to_owned());
    }
    sheet
}
