//! Transports: where a vehicle stands, the way it takes, what it does there, and when an order is begun.

use std::time::Duration;

use serde_json::Value;

use super::Site;
use super::config::{SiteEdge, SiteNode};
use super::faults::FaultName as F;
use super::order::Window;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Leg, Running, Stop, Transport, Vehicle};

impl From<&SiteNode> for Stop {
    fn from(node: &SiteNode) -> Self {
        Self {
            id: node.id.clone(),
            x: node.x,
            y: node.y,
            theta: node.theta,
            map_id: node.map_id.clone(),
            deviation_xy: node.deviation_xy,
            deviation_theta: node.deviation_theta,
            actions: Vec::new(),
        }
    }
}

impl From<&SiteEdge> for Leg {
    fn from(edge: &SiteEdge) -> Self {
        Self {
            id: edge.id.clone(),
            from: edge.from.clone(),
            to: edge.to.clone(),
            max_speed: edge.max_speed,
            max_height: edge.max_height,
            min_height: edge.min_height,
            direction: edge.direction.clone(),
            corridor: edge.corridor,
            actions: Vec::new(),
        }
    }
}

/// A way as far as it is planned.
#[derive(Clone, Debug, Default)]
pub(super) struct Way {
    pub(super) stops: Vec<Stop>,
    pub(super) legs: Vec<Leg>,
}

impl Site {
    /// Begins the next transport of a vehicle that is free, fit and known.
    pub(super) fn begin_next(&mut self, vehicle: &mut Vehicle) {
        let idle = vehicle.running.is_none() && vehicle.cancel.is_none();
        if idle && vehicle.r1_cancelled && self.takes(T::R5PauseAfterCancelBeforeNextOrder) {
            let now = self.now.moment;
            let due = *vehicle.r5_rest.get_or_insert(now + Duration::from_secs(3));
            if due > now {
                vehicle.at(due);
                return;
            }
        }
        if !idle || vehicle.queue.is_empty() || !self.commandable(vehicle) || !self.may_begin(vehicle) {
            return;
        }
        let due = self.next_order_at(vehicle);
        if let Some(due) = due.filter(|_| !self.faults.has(F::IntervalWithinOrderOnly)) {
            vehicle.at(due);
            return;
        }
        let Some(transport) = vehicle.queue.front().cloned() else {
            return;
        };
        if let Some(due) = transport.r4_due.filter(|due| *due > self.now.moment) {
            vehicle.at(due);
            return;
        }
        if self.faults.has(F::R6RedirectTakesBarredEdge) {
            vehicle.r1_blind = vehicle.r1_cancelled;
        }
        let Some(way) = self.planned(vehicle, &transport) else {
            // There is no way, or the vehicle cannot be told it.
            vehicle.queue.pop_front();
            vehicle.at(self.now.moment);
            return;
        };
        let mut running = Running {
            id: self.next_id(vehicle, "order"),
            update_id: if self.takes(T::UpdateIdFromSeven) { 7 } else { 0 },
            stops: way.stops,
            legs: way.legs,
            transport,
            ..Running::default()
        };
        if self.faults.has(F::R1SequenceContinuesOverOrders) {
            running.r1_offset = vehicle.r1_sequence;
        }
        let ended = vehicle.last_order.as_ref().filter(|_| vehicle.r1_cancelled);
        if let Some(ended) = ended.filter(|_| self.faults.has(F::R2SequenceContinuesAfterCancel)) {
            running.r1_offset = ended.r1_offset + 2 * ended.stops.len();
        }
        if self.faults.has(F::R2OrderIdFromGoal) {
            running.id = format!("to-{}", running.transport.to);
            if running.transport.begun > 0 {
                running.id = format!("{}-{}", running.id, running.transport.begun);
            }
        }
        if self.faults.has(F::R6OrderIdFromRoute) {
            running.id = super::sixth::route_id(&running);
        }
        if self.faults.has(F::R6OrderIdKeptAfterCancel)
            && let Some((id, _)) = &vehicle.r1_kept
        {
            running.id.clone_from(id);
        }
        if self.faults.has(F::R1OrderIdKeptAfterCancel)
            && let Some((id, update)) = &vehicle.r1_kept
        {
            running.id.clone_from(id);
            running.update_id = update + 1;
        }
        if let Some(old) = vehicle.last_order.as_ref().filter(|_| vehicle.r1_cancelled)
            && self.faults.has(F::R3ActionIdsKeptAfterCancel)
        {
            keep_ids(old, &mut running);
        }
        let paused = vehicle.state.as_ref().is_some_and(super::seen::State::is_paused);
        if paused && self.faults.has(F::R3ResumeOnFirstNode) {
            let action = self.action(vehicle, "stopPause", &Value::Null);
            if let Some(first) = running.stops.first_mut() {
                first.actions.push(action);
            }
        }
        if self.takes(T::R4SecondLegAsUpdateOfTheCompletedOrder) {
            running.r4_halt = first_leg(&running);
        }
        let end = self.free_until(vehicle, &running, 0);
        let released = if self.takes(T::R2WholeWayReleased) || running.r4_halt.is_some() {
            end
        } else {
            end.min(self.config.base_length.max(1).saturating_add(1))
        };
        if released < 2 && running.stops.len() > 1 {
            return;
        }
        let maps: Vec<String> = running.stops[..released]
            .iter()
            .map(|stop| stop.map_id.clone())
            .collect();
        let first = maps
            .first()
            .filter(|_| self.faults.has(F::R4ChecksTheFirstMapOnly))
            .cloned();
        let checked = maps
            .iter()
            .filter(|map_id| first.as_ref().is_none_or(|first| first == *map_id));
        if !self.maps_ready(vehicle, checked.map(String::as_str)) {
            return;
        }
        let window = Window {
            first: 0,
            released,
            end: if self.takes(T::R2HorizonToTheGoal) {
                end
            } else if self.takes(T::R2FirstOrderWithoutHorizon) {
                released
            } else {
                end.min(released.saturating_add(self.horizon_length()))
            },
        };
        let window = if self.takes(T::R6OneNodeFirst) {
            Window {
                first: 0,
                released: 1,
                end: 1,
            }
        } else {
            window
        };
        if let Some(map_id) = maps.first().filter(|_| self.takes(T::R3EnablesMapBeforeEachOrder)) {
            let seen = vehicle.state.as_ref().and_then(|state| state.maps.as_ref());
            let mut seen = seen.into_iter().flatten();
            let enabled = seen.find(|seen| seen.map_id == *map_id && seen.map_status == "ENABLED");
            if let Some(version) = enabled.map(|seen| seen.map_version.clone()) {
                self.map_action(vehicle, "enableMap", map_id, &version);
                self.send_instants(vehicle);
            }
        }
        vehicle.queue.pop_front();
        if self.faults.has(F::R5ActionIdsCountedPerMessage) {
            super::habits::number_actions(vehicle, &mut running, 0);
        }
        let Some((message, window)) = self.order_message(vehicle, &running, window) else {
            return;
        };
        running.transport.begun += 1;
        running.released = window.released;
        vehicle.r1_sequence += 2 * running.stops.len();
        vehicle.r1_stale = false;
        vehicle.r4_returned = false;
        vehicle.r5_whole = false;
        vehicle.r5_dropped = false;
        vehicle.r5_rest = None;
        vehicle.r1_hasty = false;
        vehicle.r1_cancelled = false;
        vehicle.r1_kept = None;
        vehicle.r1_before_manual = None;
        vehicle.r3_before_init = None;
        self.send_order(vehicle, &mut running, message);
        vehicle.running = Some(running);
        if self.takes(T::AsksForStates) {
            self.instant(vehicle, "stateRequest", &Value::Null);
        }
        if self.takes(T::AsksForFactsheet) {
            self.instant(vehicle, "factsheetRequest", &Value::Null);
        }
    }

    /// Number of nodes shown behind the base.
    pub(super) fn horizon_length(&self) -> usize {
        let most = if self.takes(T::R3HorizonOfOneNode) {
            1
        } else {
            usize::MAX
        };
        self.config.horizon_length.min(most)
    }

    /// Publishes an order message and watches for it.
    pub(super) fn send_order(&mut self, vehicle: &mut Vehicle, running: &mut Running, message: Value) {
        let now = self.now.moment;
        running.message = message;
        running.sent_at = now;
        running.resends = 0;
        running.confirmed = false;
        running.changed = false;
        running.r6_waiting = None;
        vehicle.last_order_at = Some(now);
        vehicle.at(self.lost_after(now));
        if !self.faults.has(F::OrdersNotSent) {
            self.publish(vehicle, "order", &running.message);
        }
    }

    /// When the next order message may be sent; `None` if now (FACT-13).
    pub(super) fn next_order_at(&self, vehicle: &Vehicle) -> Option<crate::clock::Moment> {
        let interval = vehicle.factsheet.as_ref().map_or(0.0, |sheet| sheet.order_interval);
        let interval = if self.faults.has(F::R1IntervalInMilliseconds) {
            interval / 1000.0
        } else {
            interval
        };
        if vehicle.r1_cancelled && self.faults.has(F::R1IntervalNotAfterCancel) {
            return None;
        }
        // A little more, since both sides measure.
        let interval = Duration::from_secs_f64(interval * 1.02);
        let due = vehicle.last_order_at? + interval;
        (due > self.now.moment && !self.faults.has(F::OrderIntervalIgnored)).then_some(due)
    }

    /// Whether a new order may be begun: nothing is wrong with the vehicle, and nothing is under way.
    fn may_begin(&mut self, vehicle: &mut Vehicle) -> bool {
        let Some(state) = &vehicle.state else { return false };
        let hasty = [F::OrderInsteadOfCancel, F::CancelNotAwaited, F::BrokenIsDead];
        let hasty = hasty.iter().any(|fault| self.faults.has(*fault));
        let busy = !state.route_empty() && !hasty && !vehicle.r1_hasty && !vehicle.r5_dropped;
        let dropped = vehicle.r5_dropped && state.is_paused();
        if vehicle.shunned || dropped || self.r5_left_paused(vehicle) {
            return false;
        }
        let waits = (vehicle.factsheet.is_none() && self.takes(T::R2FactsheetAwaited))
            || (vehicle.r2_stale && self.takes(T::R2FreshStateAwaited))
            || (state.is_paused() && self.takes(T::R2NoNewOrderWhilePaused));
        if waits {
            return false;
        }
        if state.operating_mode == "SEMIAUTOMATIC" && self.takes(T::R3NoNewOrdersInSemiautomatic) {
            return false;
        }
        let position = state.agv_position.as_ref();
        let unsure = position
            .and_then(|position| position.localization_score)
            .is_some_and(|score| score < 0.5);
        if unsure && self.faults.has(F::R4LowScoreBlocksDispatch) {
            return false;
        }
        let mut told = state.information.iter().flatten();
        if told.any(|entry| entry["infoLevel"] == "INFO") && self.faults.has(F::R4InformationBlocksDispatch) {
            return false;
        }
        if vehicle.r1_moving || (state.informs() && self.faults.has(F::R1InformationHoldsDispatch)) {
            return false;
        }
        let fit = state.is_fit(self.config.low_battery) || vehicle.absolved || self.takes(T::OrdersToFaulted);
        let manual = !state.takes_orders();
        let fit = fit || (manual && self.faults.has(F::OrdersInManual));
        if !fit || busy || self.localization_shunned(vehicle) {
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

    /// `localization-obeyed`: whether the vehicle is thought to be badly localized.
    pub(super) fn localization_shunned(&self, vehicle: &Vehicle) -> bool {
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        let score = position.and_then(|position| position.localization_score);
        let range = position.and_then(|position| position.deviation_range);
        let low = score.is_some_and(|score| score < 0.5) || range.is_some_and(|range| range > 1.0);
        low && self.faults.has(F::LocalizationObeyed)
    }

    /// Index behind the last node that can be reached without a blocked edge, from `base` nodes on (ORD-12).
    pub(super) fn free_until(&self, vehicle: &Vehicle, running: &Running, base: usize) -> usize {
        let first = base.saturating_sub(1);
        let blocked = running.legs.iter().enumerate().skip(first).find(|(_, leg)| {
            let used = self.faults.has(F::BlockedEdgeUsed) || vehicle.r1_blind;
            let used = used || (base > 0 && self.faults.has(F::R2BlockCheckedAtPlanningOnly));
            vehicle.blocked.contains(&(leg.from.clone(), leg.to.clone())) && !used
        });
        let free = blocked.map_or(running.stops.len(), |(index, _)| index + 1);
        free.min(running.r4_halt.unwrap_or(usize::MAX))
    }

    /// The whole way of a transport; `None` if there is none the vehicle can be told.
    fn planned(&mut self, vehicle: &mut Vehicle, transport: &Transport) -> Option<Way> {
        let goal = transport
            .from
            .as_ref()
            .filter(|_| !transport.loaded)
            .unwrap_or(&transport.to);
        let (mut way, here) = self.start(vehicle, goal, transport.r2_asked_at.as_ref())?;
        self.lead(vehicle, &mut way, &here, transport)?;
        if self.takes(T::R1GenerousDeviations) {
            for stop in way.stops.iter_mut().filter(|stop| stop.actions.is_empty()) {
                stop.deviation_xy.get_or_insert(0.8);
            }
        }
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        if let Some(range) = position.and_then(|position| position.deviation_range)
            && self.faults.has(F::R1DeviationRangeAtStart)
            && let Some(first) = way.stops.first_mut()
        {
            first.deviation_xy = Some(first.deviation_xy.unwrap_or(0.0) + range.abs());
        }
        if self.faults.has(F::StartsElsewhere) && way.legs.len() > 1 {
            way.stops.remove(0);
            way.legs.remove(0);
        }
        (self.names_fit(vehicle, &way) && self.actions_fit(vehicle, &way)).then_some(way)
    }
}

/// `r4-second-leg-as-update-of-the-completed-order`: number of nodes up to the pick, where the way goes on behind it.
fn first_leg(running: &Running) -> Option<usize> {
    let picks = |stop: &Stop| stop.actions.iter().any(|action| action["actionType"] == "pick");
    let nodes = running.stops.iter().position(picks)? + 1;
    (running.transport.from.is_some() && nodes > 1 && nodes < running.stops.len()).then_some(nodes)
}

/// `r3-action-ids-kept-after-cancel`: gives actions the ids of those of the same type in the order called off.
fn keep_ids(old: &Running, running: &mut Running) {
    let known: Vec<&Value> = old.stops.iter().flat_map(|stop| &stop.actions).collect();
    for action in running.stops.iter_mut().flat_map(|stop| &mut stop.actions) {
        let same = known.iter().find(|known| known["actionType"] == action["actionType"]);
        if let Some(same) = same {
            action["actionId"] = same["actionId"].clone();
        }
    }
}
