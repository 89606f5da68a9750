//! The running order: its acceptance, the extension of its base, and its end.

use std::time::Duration;

use serde_json::{Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::order::Window;
use super::seen::State;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Presence, Running, Transport, Vehicle};

/// How often a faulty master control repeats a refused order.
const FLOOD: u32 = 20;

/// A transport is not begun more often than this.
const MAX_BEGUN: u32 = 3;

/// What has become of the running order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// It goes on.
    Runs,
    /// It is done, or given up.
    Over,
    /// The vehicle does not have it any more, or refused it for where it stands.
    Again,
    /// The rest has to be called off.
    CalledOff,
}

impl Site {
    /// Looks after the running order.
    pub(super) fn watch_order(&mut self, vehicle: &mut Vehicle) {
        if self.r1_resent_in_service(vehicle) {
            return;
        }
        if vehicle.cancel.is_some() && self.faults.has(F::UpdatedWhileCancelled) {
            self.extend_all_the_same(vehicle);
            return;
        }
        let manual = vehicle
            .state
            .as_ref()
            .is_some_and(|state| state.operating_mode == "MANUAL");
        let stubborn = self.faults.has(F::UpdatesInService) || (manual && self.faults.has(F::R1UpdatesInManual));
        let stubborn = stubborn && self.reachable(vehicle);
        let lost = vehicle.presence == Presence::Away && vehicle.state.as_ref().is_some_and(State::takes_orders);
        let stubborn = stubborn || (lost && self.faults.has(F::R4UpdatesToALostVehicle)) || self.held_update(vehicle);
        if vehicle.cancel.is_some() || !(self.commandable(vehicle) || stubborn) {
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
        let failed = has_failed(&running, &state);
        vehicle.state = Some(state);
        if failed && !running.r1_logged && self.takes(T::R1LogAskedAfterFailure) {
            running.r1_logged = true;
            let offers = vehicle.factsheet.as_ref().and_then(|sheet| sheet.actions.as_ref());
            if offers.is_some_and(|offers| offers.contains_key("logReport")) {
                self.instant(vehicle, "logReport", &json!({ "reason": "an action has failed" }));
            }
        }
        if failed && fate == Fate::CalledOff && self.faults.has(F::R1NextOrderAfterFailedAction) {
            vehicle.r1_hasty = true;
            fate = Fate::Over;
        }
        match fate {
            Fate::Runs => {
                let hurried = running.changed && self.faults.has(F::R4CountsUpdatesFromTheReportedState);
                if (running.confirmed || hurried) && !running.refused {
                    self.extend_base(vehicle, &mut running);
                }
                vehicle.running = Some(running);
            }
            Fate::Over => {
                vehicle.slips.triggered |= running.waits.is_some();
                vehicle.last_order = Some(running);
                if self.faults.has(F::R2EmptyMessageAfterOrder) {
                    self.r2_empty_order(vehicle);
                }
            }
            Fate::Again => {
                let transport = again(&running, vehicle.state.as_ref());
                if running.transport.begun < MAX_BEGUN {
                    vehicle.queue.push_front(transport);
                }
                vehicle.last_order = Some(running);
            }
            Fate::CalledOff => {
                vehicle.running = Some(running);
                self.cancel(vehicle, None);
            }
        }
    }

    /// What some master controls do of their own while an order is driven.
    pub(super) fn r3_watch(&mut self, vehicle: &mut Vehicle) {
        let Some(state) = &vehicle.state else { return };
        let (informs, paused) = (state.informs(), state.is_paused());
        let battery = &state.battery_state;
        let low = battery
            .battery_charge
            .is_some_and(|charge| charge < self.config.low_battery)
            && !battery.charging;
        if let Some(running) = &mut vehicle.running {
            running.r3_paused |= paused && running.accepted;
        }
        self.r6_cancel_on_fatal(vehicle);
        if informs
            && vehicle.running.is_some()
            && vehicle.cancel.is_none()
            && self.faults.has(F::R3InformationCancelsOrder)
        {
            self.cancel(vehicle, None);
        }
        let due = low && !vehicle.r3_charged && vehicle.running.is_some();
        if due && self.faults.has(F::R3ChargingOnLowBattery) {
            vehicle.r3_charged = true;
            if self.offers(vehicle.factsheet.as_ref(), "startCharging", "INSTANT") {
                let action = self.action(vehicle, "startCharging", &Value::Null);
                self.queue(vehicle, action);
            }
        }
        vehicle.r3_charged &= low;
    }

    /// `updated-while-cancelled`: as if nobody had called the order off.
    fn extend_all_the_same(&mut self, vehicle: &mut Vehicle) {
        if let Some(mut running) = vehicle.running.take() {
            if running.confirmed {
                self.extend_base(vehicle, &mut running);
            }
            vehicle.running = Some(running);
        }
    }

    fn fate(&mut self, vehicle: &mut Vehicle, running: &mut Running, state: &State) -> Fate {
        let shown = state.order_id == running.id;
        // The state from before the order names the order called off, under the same id.
        let older = !running.accepted && vehicle.state_at <= running.sent_at;
        let shown = shown && !(older && self.faults.has(F::R6OrderIdKeptAfterCancel));
        if shown {
            running.accepted = true;
            running.confirmed |= state.order_update_id >= running.update_id;
        }
        if !running.confirmed && !running.refused {
            if let Some(kind) = refusal(running, state) {
                if running.accepted {
                    running.refused = true;
                } else if self.faults.has(F::RefusedOrderRepeated) && running.resends < FLOOD {
                    self.repeat_refused(vehicle, running);
                } else if kind.to_ascii_lowercase().contains("noroute") && running.transport.begun < 2 {
                    return Fate::Again;
                } else {
                    return Fate::Over;
                }
            } else if !self.send_again(vehicle, running) {
                if !running.accepted {
                    return Fate::Over;
                }
                running.refused = true;
            }
        }
        if !running.accepted {
            return Fate::Runs;
        }
        if running.cleared && !self.faults.has(F::ClearedOrderUpdated) {
            return Fate::Again;
        }
        let alien = self.faults.has(F::OrderIdPerUpdate) || self.faults.has(F::OrderIdReused);
        if !shown && !alien {
            return Fate::Again;
        }
        let fate = progress(running, state);
        let driven = state.route_empty() && running.is_whole() && running.confirmed;
        match fate {
            Fate::Runs if driven && self.faults.has(F::ActionNotAwaited) => Fate::Over,
            Fate::CalledOff if running.refused && self.faults.has(F::RefusedUpdateExtended) => {
                (running.refused, running.confirmed) = (false, true);
                Fate::Runs
            }
            Fate::Again if running.confirmed && self.faults.has(F::ClearedOrderUpdated) => {
                running.changed = true;
                Fate::Runs
            }
            fate => fate,
        }
    }

    /// Sends the unchanged message again when it was not seen in time; false when that was done often enough.
    pub(super) fn send_again(&mut self, vehicle: &mut Vehicle, running: &mut Running) -> bool {
        let now = self.now.moment;
        let lost = self.lost_after(running.sent_at);
        if lost > now {
            vehicle.at(lost);
            return true;
        }
        if self.faults.has(F::LostOrderNotResent) || self.r5_left_paused(vehicle) || self.not_repeated(running) {
            return true;
        }
        if running.resends >= self.config.resend_limit {
            return false;
        }
        if let Some(due) = self
            .next_order_at(vehicle)
            .filter(|_| !self.faults.has(F::ResentTooSoon))
        {
            vehicle.at(due);
            return true;
        }
        running.resends += 1;
        running.sent_at = now;
        vehicle.last_order_at = Some(now);
        if self.faults.has(F::R3ResendWithoutHorizon) {
            for key in ["nodes", "edges"] {
                if let Some(list) = running.message[key].as_array_mut() {
                    list.retain(|element| element["released"] == json!(true));
                }
            }
        }
        vehicle.at(self.lost_after(now));
        if self.faults.has(F::ResentChanged) {
            slower(&mut running.message, running.resends);
        }
        if self.faults.has(F::R2ResendExtendsBase) && release_next(&mut running.message) {
            running.released += 1;
        }
        if self.faults.has(F::R2ResendWithoutActions) {
            without_actions(&mut running.message);
        }
        if self.faults.has(F::R1ResendAsUpdate) {
            running.update_id += 1;
            running.message["orderUpdateId"] = json!(running.update_id);
        }
        if self.faults.has(F::R1ResendWithNewActionIds) {
            self.rename_actions(vehicle, running);
        }
        if !self.faults.has(F::OrdersNotSent) {
            self.r1_resending = true;
            self.publish(vehicle, "order", &running.message);
            self.r1_resending = false;
        }
        true
    }

    /// `refused-order-repeated`: perhaps it likes it better this way.
    fn repeat_refused(&mut self, vehicle: &mut Vehicle, running: &mut Running) {
        running.resends += 1;
        slower(&mut running.message, running.resends);
        running.sent_at = self.now.moment;
        self.publish(vehicle, "order", &running.message);
    }

    /// Extends the base before the vehicle has to halt at its end (ORD-UPD-02).
    fn extend_base(&mut self, vehicle: &mut Vehicle, running: &mut Running) {
        let Some(state) = &vehicle.state else { return };
        let reached = running.reached(Some(state));
        let last_order = vehicle
            .last_order_at
            .filter(|_| self.faults.has(F::R3BasePlannedEveryHalfMinute));
        let due = last_order.map(|last| last + Duration::from_secs(30));
        if let Some(due) = due.filter(|due| *due > self.now.moment) {
            vehicle.at(due);
            return;
        }
        if running.r3_held || running.r6_skipped || self.r5_left_paused(vehicle) {
            return;
        }
        if state.is_paused() && self.takes(T::R6NoUpdateWhilePaused) {
            return;
        }
        let stopped = !matches!(state.safety_state.e_stop.as_str(), "NONE" | "");
        let withdraws = (stopped && self.faults.has(F::R2EStopWithdrawsBase))
            || (state.is_paused() && self.faults.has(F::R4TakesTheBaseBackInPause));
        if let Some(halt) = running.r4_halt {
            let ids = running.actions().filter_map(|action| action["actionId"].as_str());
            let pending = |id: &str| state.action(id).is_some_and(|action| !action.is_terminal());
            let done = !ids.into_iter().any(pending);
            let there = state.order_id == running.id && state.route_empty() && reached + 1 >= halt;
            if there && done {
                running.r4_halt = None;
            }
        }
        if withdraws && running.released > reached + 1 && !running.r2_withdrawn {
            running.r2_withdrawn = true;
            running.released = reached + 1;
            running.changed = true;
        }
        let ahead = running.released.saturating_sub(reached + 1);
        let asked = state.new_base_request == Some(true) && !self.faults.has(F::NewBaseRequestIgnored);
        let deaf = (vehicle.r1_answered && self.faults.has(F::R1NewBaseAnsweredOnce))
            || (state.driving && self.faults.has(F::R1NewBaseOnlyAtRest));
        let half = state.operating_mode == "SEMIAUTOMATIC" && self.faults.has(F::R2NewBaseIgnoredInSemiautomatic);
        let spent = running.r5_asked && self.faults.has(F::R5NewBaseRequestHeardOnce);
        let asked = asked && !deaf && !half && !spent;
        running.r3_asked = asked;
        let showing = asked && self.faults.has(F::R3NewBaseAnsweredByHorizon);
        if showing && !running.r3_answered && !running.is_whole() {
            running.r3_answered = true;
            running.changed = true;
        }
        let warned = state.errors.iter().any(|error| error.error_level == "WARNING");
        if warned && self.faults.has(F::R2WarningHoldsBase) {
            return;
        }
        let held = (vehicle.r1_stale && self.faults.has(F::R1VehicleReturnStopsUpdates))
            || (state.informs() && self.faults.has(F::R1InformationHoldsBase))
            || (state.paused.is_none() && self.faults.has(F::MissingPausedIsPaused))
            || (running.r3_paused && self.faults.has(F::R4NoBaseAfterPause));
        let first = self.config.vehicles.first() == Some(&vehicle.config);
        if held || (!first && self.faults.has(F::FirstVehicleExtended)) {
            return;
        }
        let halts = !state.driving && ahead == 0;
        let short = state.is_paused() && !running.is_whole() && self.takes(T::R5HorizonDeletedOnPause);
        running.changed |= short != running.r5_short;
        running.r5_short = short;
        if self.takes(T::R1HorizonSentAgain) && !running.r1_again && !running.is_whole() {
            running.r1_again = true;
            running.changed = true;
        }
        let eager = self.takes(T::R1BaseGrowsEagerly) && !running.is_whole();
        let enough = if self.takes(T::SmallSteps) {
            self.config.base_length - 1
        } else {
            1
        };
        let urgent = ahead <= enough || asked || eager;
        if self.takes(T::R6HorizonWithdrawnAndGivenAgain) && !urgent {
            super::sixth::withdraw_horizon(vehicle, running);
        }
        let wanted = if withdraws || showing || short || running.r4_drops_horizon {
            false
        } else if self.faults.has(F::BaseExtendedLate) || spent {
            ahead == 0 && !state.driving
        } else {
            urgent
        };
        if !(wanted || running.changed) || self.localization_shunned(vehicle) {
            return;
        }
        let free = self.free_until(vehicle, running, running.released);
        let least = running.released + usize::from((asked || eager) && wanted);
        let target = (reached + 1).saturating_add(self.config.base_length.max(1)).max(least);
        let target = if wanted { target.min(free) } else { running.released };
        let early = target == running.stops.len() && target > running.released && !halts && !asked;
        let target = if early && self.faults.has(F::R1GoalReleasedOnArrival) {
            target - 1
        } else {
            target
        };
        if target <= running.released && !running.changed {
            return;
        }
        let at_once = running.changed && self.faults.has(F::R2IntervalIgnoredOnReroute);
        let at_once = at_once || (asked && self.faults.has(F::R3IntervalNotWhenBaseAsked));
        if let Some(due) = self.next_order_at(vehicle).filter(|_| !at_once) {
            vehicle.slips.held = true;
            if self.faults.has(F::R6QueuedUpdateAfterCancel) {
                self.r6_queue(vehicle, running, (target, free));
            }
            vehicle.at(due);
            return;
        }
        vehicle.slips.held = false;
        let fresh = running.released.min(target)..target;
        let mut maps: Vec<String> = running.stops[fresh].iter().map(|stop| stop.map_id.clone()).collect();
        if self.faults.has(F::R4ChecksTheFirstMapOnly) {
            maps.retain(|map_id| Some(map_id) == running.stops.first().map(|first| &first.map_id));
        }
        let blindly = self.faults.has(F::R1MapNotCheckedInUpdates);
        if !blindly && !self.maps_ready(vehicle, maps.iter().map(String::as_str)) {
            return;
        }
        let window = Window {
            first: if self.faults.has(F::BaseSentAgain)
                || (running.r3_paused && self.faults.has(F::R3BaseSentAgainAfterPause))
                || (vehicle.r4_returned && self.faults.has(F::R4WholeOrderAfterReconnect))
                || vehicle.r5_whole
            {
                0
            } else if self.faults.has(F::R1UpdateFromVehicle) {
                reached.min(running.released.saturating_sub(1))
            } else if self.faults.has(F::R2UpdateBeginsOneNodeEarly) {
                running.released.saturating_sub(2)
            } else {
                running.released.saturating_sub(1)
            },
            released: target.max(running.released),
            end: free.min(target.max(running.released).saturating_add(self.horizon_length())),
        };
        let window = if self.takes(T::R2HorizonToTheGoal) {
            Window { end: free, ..window }
        } else {
            window
        };
        let window = if self.takes(T::R1UpdatesWithoutHorizon) && target > running.released {
            Window {
                end: window.released,
                ..window
            }
        } else {
            window
        };
        let window = if running.r4_drops_horizon || short {
            Window {
                end: window.released,
                ..window
            }
        } else {
            window
        };
        let window = self.stitched_at_first_pass(running, window);
        let stuck = (running.update_id > 0 && self.faults.has(F::SecondUpdateRepeats))
            || (running.changed && self.faults.has(F::R1UpdateIdKeptOnReroute));
        let stuck = stuck || (running.resends > 0 && self.faults.has(F::R3UpdateIdKeptAfterResend));
        let shown_only = running.changed && target <= running.released;
        let stuck = stuck || (shown_only && self.faults.has(F::R6UpdateIdRaisedOnlyWithBase));
        let before = running.update_id;
        running.update_id += u32::from(!(stuck || running.update_id == 10 && self.faults.has(F::UpdateIdStopsAtTen)));
        if self.faults.has(F::R4CountsUpdatesFromTheReportedState) {
            let state = vehicle.state.as_ref().filter(|state| state.order_id == running.id);
            running.update_id = state.map_or(0, |state| state.order_update_id).saturating_add(1);
        }
        if self.takes(T::R5HorizonActionsGetNewIds) {
            self.r5_rename_horizon(vehicle, running);
        }
        if self.faults.has(F::R5ActionIdsCountedPerMessage) {
            super::habits::number_actions(vehicle, running, running.released);
        }
        match self.order_message(vehicle, running, window) {
            Some((message, window)) if window.released > running.released || running.changed => {
                running.released = window.released;
                vehicle.r1_answered |= asked;
                running.r5_asked |= asked;
                self.send_order(vehicle, running, message);
                vehicle.r4_returned = false;
                vehicle.r5_whole = false;
                // The horizon is gone; the new one is still to be sent.
                running.changed = std::mem::take(&mut running.r4_drops_horizon);
            }
            _ => running.update_id = before,
        }
    }

    /// Calls the order off when a trigger does not come in time (ACT-39).
    fn supervise_trigger(&mut self, vehicle: &mut Vehicle, running: &mut Running, state: &State) -> Fate {
        if self.faults.has(F::TriggerUnsupervised)
            || running.r2_unsupervised
            || self.left_waiting(vehicle, running, state)
        {
            return Fate::Runs;
        }
        let first = running.message.pointer("/nodes/0/sequenceId").and_then(Value::as_u64);
        if first.is_some_and(|first| first > 0) && self.faults.has(F::R3TriggerUnsupervisedAfterUpdate) {
            return Fate::Runs;
        }
        let trigger = |action: &Value| {
            let id = action["actionId"]
                .as_str()
                .filter(|_| action["actionType"] == "waitForTrigger")?;
            let status = &state.action(id)?.action_status;
            (status == "RUNNING").then(|| id.to_owned())
        };
        let waiting: Option<String> = running.actions().find_map(trigger);
        let now = self.now.moment;
        let known = running.waits.take();
        running.waits = waiting.map(|id| match known {
            Some((known, _))
                if known == id && vehicle.state_at == now && self.faults.has(F::R1TriggerTimerRestarts) =>
            {
                (id, now)
            }
            Some((known, since)) if known == id => (id, since),
            _ => (id, now),
        });
        let Some((_, since)) = &running.waits else {
            return Fate::Runs;
        };
        let due = *since + self.config.trigger_timeout;
        if due <= now && self.faults.has(F::R1TriggerTimeoutPauses) {
            if let Some((_, since)) = &mut running.waits {
                *since = now;
            }
            vehicle.at(now + self.config.trigger_timeout);
            self.instant(vehicle, "startPause", &Value::Null);
            return Fate::Runs;
        }
        if due <= now && self.faults.has(F::R6TriggerTimeoutWithoutCancel) {
            vehicle.r1_hasty = true;
            return Fate::Over;
        }
        if due <= now && self.faults.has(F::R5TriggerTimeoutOnlyDropsTransport) {
            return Fate::Over;
        }
        if due <= now {
            return Fate::CalledOff;
        }
        vehicle.at(due);
        Fate::Runs
    }
}

/// The transport as it is still to be done.
pub(super) fn again(running: &Running, state: Option<&State>) -> Transport {
    let mut transport = running.transport.clone();
    let mut picks = running.actions().filter(|action| action["actionType"] == "pick");
    let picked = picks.any(|action| {
        let id = action["actionId"].as_str().unwrap_or_default();
        state
            .and_then(|state| state.action(id))
            .is_some_and(|action| action.action_status == "FINISHED")
    });
    transport.loaded |= picked;
    transport
}

/// Whether an action of the order has failed.
fn has_failed(running: &Running, state: &State) -> bool {
    let mut ids = running.actions().filter_map(|action| action["actionId"].as_str());
    ids.any(|id| state.action(id).is_some_and(|action| action.action_status == "FAILED"))
}

/// The errorType with which the vehicle refuses the message sent last.
fn refusal<'a>(running: &Running, state: &'a State) -> Option<&'a str> {
    let update = running.update_id.to_string();
    let found = state.errors.iter().find(|error| {
        let own = error.reference("orderId") == Some(running.id.as_str());
        own && error.reference("orderUpdateId").is_none_or(|named| named == update)
    });
    found.map(|error| error.error_type.as_str())
}

/// `r2-resend-extends-base`: releases the first node of the horizon of a message.
fn release_next(message: &mut Value) -> bool {
    let nodes = message["nodes"].as_array_mut().into_iter().flatten();
    let Some((index, node)) = nodes.enumerate().find(|(_, node)| node["released"] == json!(false)) else {
        return false;
    };
    node["released"] = json!(true);
    let edge = index.checked_sub(1).and_then(|before| message["edges"].get_mut(before));
    if let Some(edge) = edge {
        edge["released"] = json!(true);
    }
    true
}

/// `r2-resend-without-actions`: leaves the actions of a message out.
fn without_actions(message: &mut Value) {
    for key in ["nodes", "edges"] {
        for element in message[key].as_array_mut().into_iter().flatten() {
            element["actions"] = json!([]);
        }
    }
}

/// Changes a message that must not be changed.
fn slower(message: &mut Value, times: u32) {
    let edges = message.get_mut("edges").and_then(Value::as_array_mut);
    for edge in edges.into_iter().flatten() {
        edge["maxSpeed"] = json!(1.0 / f64::from(times + 1));
    }
}

/// How far an accepted order is.
fn progress(running: &Running, state: &State) -> Fate {
    let actions = || running.actions().filter_map(|action| action["actionId"].as_str());
    let failed = actions().any(|id| state.action(id).is_some_and(|action| action.action_status == "FAILED"));
    let reached = running.reached(Some(state)) + 1;
    let known = if running.confirmed { running.released } else { reached };
    if state.route_empty() && reached < known && !failed {
        return Fate::Again;
    }
    if state.route_empty() && (running.is_whole() || failed) && running.confirmed {
        // Nothing is left to be driven. Actions that are not listed any more have ended as well.
        let pending = actions().any(|id| state.action(id).is_some_and(|action| !action.is_terminal()));
        return if pending { Fate::Runs } else { Fate::Over };
    }
    let halted = !state.driving && !state.node_states.iter().any(|node| node.released);
    if failed || (running.refused && halted) {
        return Fate::CalledOff;
    }
    Fate::Runs
}
