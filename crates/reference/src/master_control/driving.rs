//! The running order: its acceptance, the extension of its base, and its end (sections 6.6.2 and 6.10).
//!
//! An order that was not seen in a state is sent again, unchanged (the ruling of ORD-REJ-18); a waitForTrigger that
//! takes too long is called off (ACT-39).

use super::Site;
use super::hooks::{Event, Fate, Measure, Occasion, Permission};
use super::order::Window;
use super::seen::{ErrorSeen, State};
use super::vehicle::{Running, Transport, Vehicle};

/// A transport is not begun more often than this.
const MAX_BEGUN: u32 = 3;

impl Site {
    /// Looks after the running order.
    pub(super) fn watch_order(&mut self, vehicle: &mut Vehicle) {
        let usual = vehicle.cancel.is_none() && self.commandable(vehicle);
        if !self.allows(vehicle, Permission::Follow, usual) {
            return;
        }
        let Some(mut running) = vehicle.running.take() else {
            return;
        };
        let Some(state) = vehicle.state.take() else {
            vehicle.running = Some(running);
            return;
        };
        let mut fate = self.fate(vehicle, &mut running, &state);
        if fate == Fate::Runs && running.confirmed && !running.refused {
            fate = self.supervise_trigger(vehicle, &mut running, &state);
        }
        if fate == Fate::Runs && self.is_stuck(vehicle, &running, &state) {
            fate = Fate::CalledOff;
        }
        let fate = self.judges(vehicle, &mut running, &state, fate);
        vehicle.state = Some(state);
        match fate {
            Fate::Runs => {
                if running.confirmed && !running.refused {
                    self.extend_base(vehicle, &mut running);
                }
                vehicle.running = Some(running);
            }
            Fate::Over => self.end(vehicle, &running, false),
            Fate::Again => {
                let transport = again(&running, vehicle.state.as_ref());
                if running.transport.begun < MAX_BEGUN {
                    vehicle.queue.push_front(transport);
                }
                self.end(vehicle, &running, false);
            }
            Fate::CalledOff | Fate::TooLate => {
                vehicle.running = Some(running);
                self.cancel(vehicle, None);
            }
        }
    }

    fn fate(&mut self, vehicle: &mut Vehicle, running: &mut Running, state: &State) -> Fate {
        let shown = state.order_id == running.id;
        if shown {
            running.accepted = true;
            running.confirmed |= state.order_update_id >= running.update_id;
        }
        if !running.confirmed && !running.refused {
            let refusal = refusal(running, state).map(|kind| kind.replace('_', "").to_ascii_lowercase());
            match refusal {
                Some(_) if running.accepted => running.refused = true,
                Some(kind) if misplaced(&kind) && running.transport.begun < 2 => return Fate::Again,
                None if self.send_again(vehicle, running) => {}
                None if running.accepted => running.refused = true,
                Some(_) | None => return Fate::Over,
            }
        }
        if !running.accepted {
            return Fate::Runs;
        }
        if running.cleared || self.allows(vehicle, Permission::Gone, !shown) {
            return Fate::Again;
        }
        progress(running, state)
    }

    /// Sends the unchanged message again when it was not seen in time; false when that was done often enough.
    pub(crate) fn send_again(&mut self, vehicle: &mut Vehicle, running: &mut Running) -> bool {
        let now = self.now.moment;
        let lost = self.lost_after(vehicle, running.sent_at);
        if lost > now {
            vehicle.at(lost);
            return true;
        }
        if !self.allows(vehicle, Permission::Resend(running), true) {
            return true;
        }
        if running.resends >= self.config.resend_limit {
            return false;
        }
        if let Some(due) = self.next_order_at(vehicle, Occasion::Again) {
            vehicle.at(due);
            return true;
        }
        running.resends += 1;
        running.sent_at = now;
        vehicle.last_order_at = Some(now);
        vehicle.at(self.lost_after(vehicle, now));
        self.happens(vehicle, &mut Event::Resending(running));
        self.send(vehicle, "order", &running.message, true);
        true
    }

    /// Extends the base before the vehicle has to halt at its end (ORD-UPD-02).
    pub(crate) fn extend_base(&mut self, vehicle: &mut Vehicle, running: &mut Running) {
        let Some(state) = &vehicle.state else { return };
        // Somebody has to bring it back into its corridor first (CORR-23).
        let outside = vehicle.config.has("requests") && state.has_error("OUTSIDE_OF_CORRIDOR");
        if !self.allows(vehicle, Permission::Extend(running), !outside) {
            return;
        }
        self.happens(vehicle, &mut Event::Extending(running));
        let Some(state) = &vehicle.state else { return };
        let reached = running.reached(Some(state));
        let ahead = running.released.saturating_sub(reached + 1);
        let asked = state.new_base_request == Some(true);
        let asked = self.allows(vehicle, Permission::Heed, asked);
        let grows = self.allows(vehicle, Permission::Grow(running, ahead, asked), ahead <= 1 || asked);
        if !(grows || running.changed) {
            return;
        }
        let free = self.free_until(vehicle, running, running.released);
        let target = (reached + 1).saturating_add(self.config.base_length.max(1));
        let target = target.max(running.released + usize::from(asked)).min(free);
        let target = if grows { target } else { running.released };
        let target = self.measures(vehicle, Measure::Base(running, free, asked), target);
        if target <= running.released && !running.changed {
            return;
        }
        let changed = running.changed;
        if let Some(due) = self.next_order_at(vehicle, Occasion::Update { changed, asked }) {
            self.happens(vehicle, &mut Event::Waits(running, target, free));
            vehicle.at(due);
            return;
        }
        if !self.maps_ready(vehicle, running, running.released.min(target)..target) {
            return;
        }
        let released = target.max(running.released);
        let mut window = Window {
            first: running.released.saturating_sub(1),
            released,
            end: free.min(released.saturating_add(self.config.horizon_length)),
        };
        self.shows(vehicle, running, &mut window, free);
        let before = running.update_id;
        running.update_id += 1;
        self.happens(vehicle, &mut Event::Updating(running));
        match self.order_message(vehicle, running, window) {
            Some((message, window)) if window.released > running.released || running.changed => {
                running.released = window.released;
                self.send_order(vehicle, running, message);
                self.happens(vehicle, &mut Event::Updated(running, asked));
            }
            _ => running.update_id = before,
        }
    }

    /// Whether the vehicle says that it cannot come to a node that is left (ZERR-03).
    fn is_stuck(&self, vehicle: &Vehicle, running: &Running, state: &State) -> bool {
        let told = |error: &ErrorSeen| {
            let ahead = running.stops.iter().skip(running.reached(Some(state)) + 1);
            let named = error.reference("nodeId");
            error.is("NODE_UNREACHABLE") && named.is_none_or(|id| ahead.map(|stop| &stop.id).any(|stop| stop == id))
        };
        let usual = vehicle.config.has("zones") && running.accepted && state.errors.iter().any(told);
        usual && self.allows(vehicle, Permission::GiveUp, usual)
    }

    /// Calls the order off when a trigger does not come in time (ACT-39).
    fn supervise_trigger(&mut self, vehicle: &mut Vehicle, running: &mut Running, state: &State) -> Fate {
        if !self.allows(vehicle, Permission::Supervise(running), true) {
            return Fate::Runs;
        }
        let now = self.now.moment;
        let waiting = running.actions().find_map(|action| {
            let id = action["actionId"].as_str()?;
            let runs = state.action(id).is_some_and(|seen| seen.action_status == "RUNNING");
            (runs && action["actionType"] == "waitForTrigger").then(|| id.to_owned())
        });
        let known = running.waits.take();
        running.waits = waiting.map(|id| match known {
            Some((known, since)) if known == id => (id, since),
            _ => (id, now),
        });
        let Some((_, since)) = &running.waits else {
            return Fate::Runs;
        };
        let due = *since + self.config.trigger_timeout;
        if due <= now {
            return Fate::TooLate;
        }
        vehicle.at(due);
        Fate::Runs
    }
}

/// Whether an error says that an order does not begin where the vehicle stands.
fn misplaced(kind: &str) -> bool {
    kind.contains("noroute") || kind.contains("startnodeoutofrange")
}

/// The transport as it is still to be done.
pub(crate) fn again(running: &Running, state: Option<&State>) -> Transport {
    let mut transport = running.transport.clone();
    let mut picks = running.actions().filter(|action| action["actionType"] == "pick");
    let picked = picks.any(|action| {
        let id = action["actionId"].as_str().unwrap_or_default();
        let seen = state.and_then(|state| state.action(id));
        seen.is_some_and(|action| action.action_status == "FINISHED")
    });
    transport.loaded |= picked;
    transport
}

/// Whether an action of the order has failed.
pub(crate) fn has_failed(running: &Running, state: &State) -> bool {
    let mut ids = running.action_ids();
    ids.any(|id| state.action(id).is_some_and(|action| action.action_status == "FAILED"))
}

/// The errorType with which the vehicle refuses the message sent last.
pub(crate) fn refusal<'a>(running: &Running, state: &'a State) -> Option<&'a str> {
    let update = running.update_id.to_string();
    let found = state.errors.iter().find(|error| {
        let own = error.reference("orderId") == Some(running.id.as_str());
        own && error.reference("orderUpdateId").is_none_or(|named| named == update)
    });
    found.map(|error| error.error_type.as_str())
}

/// Progress of an accepted order.
pub(crate) fn progress(running: &Running, state: &State) -> Fate {
    let failed = has_failed(running, state);
    let reached = running.reached(Some(state)) + 1;
    let known = if running.confirmed { running.released } else { reached };
    if state.route_empty() && reached < known && !failed {
        return Fate::Again;
    }
    if state.route_empty() && (running.is_whole() || failed) && running.confirmed {
        // Nothing is left to be driven. Actions that are not listed any more have ended as well.
        let pending = |id: &str| state.action(id).is_some_and(|action| !action.is_terminal());
        let pending = running.action_ids().any(pending);
        return if pending { Fate::Runs } else { Fate::Over };
    }
    let halted = !state.driving && !state.node_states.iter().any(|node| node.released);
    if failed || (running.refused && halted) {
        return Fate::CalledOff;
    }
    Fate::Runs
}
