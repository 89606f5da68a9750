//! Another destination for a transport under way, an edge that is closed, and the next transport.

use super::Site;
use super::dispatch::Way;
use super::driving::again;
use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;
use super::vehicle::{MAX_QUEUE, Running, Transport, Vehicle};

impl Site {
    /// Gives the running transport another destination: behind the base, or by calling it off.
    pub(super) fn reroute(&mut self, vehicle: &mut Vehicle, to: &str) {
        if self.config.node(to).is_none() {
            return;
        }
        let Some(mut running) = vehicle.running.take() else {
            match vehicle.queue.front_mut() {
                Some(next) => to.clone_into(&mut next.to),
                None => self.dispatch(
                    vehicle,
                    Transport {
                        to: to.to_owned(),
                        ..Transport::default()
                    },
                ),
            }
            return;
        };
        if self.takes(T::R3LongWaysInTwoOrders) && vehicle.queue.front().is_some_and(|next| next.r1_follows) {
            vehicle.queue.pop_front();
        }
        let mut transport = again(&running, vehicle.state.as_ref());
        to.clone_into(&mut transport.to);
        let paused = vehicle.state.as_ref().is_some_and(super::seen::State::is_paused);
        let midway = running.accepted && vehicle.cancel.is_none();
        if paused && midway && self.faults.has(F::R4NewOrderWithoutCancelInPause) {
            vehicle.last_order = Some(running);
            vehicle.r1_hasty = true;
            vehicle.queue.push_front(transport);
            vehicle.at(self.now.moment);
            return;
        }
        vehicle.r1_blind = self.faults.has(F::R1RerouteOverBlockedEdge);
        if !running.is_whole() && self.faults.has(F::R1RerouteCutsBase) {
            let next = running.reached(vehicle.state.as_ref()) + 2;
            running.released = running.released.min(next);
        }
        if running.is_whole() && self.faults.has(F::BaseReplaced) {
            running.released = running.reached(vehicle.state.as_ref()) + 1;
        }
        let led = vehicle.cancel.is_none() && !running.is_whole() && !running.refused;
        let led = led && !self.takes(T::R1ReroutesByCancel);
        let led = led && self.lead_on(vehicle, &mut running, transport.clone());
        vehicle.running = Some(running);
        if !led {
            self.cancel(vehicle, Some(transport));
        }
        vehicle.at(self.now.moment);
    }

    /// Replaces the way behind the base.
    pub(super) fn lead_on(&mut self, vehicle: &mut Vehicle, running: &mut Running, transport: Transport) -> bool {
        let base = running.released;
        let Some(end) = running.stops.get(base.saturating_sub(1)) else {
            return false;
        };
        let here = end.id.clone();
        let picks = running.stops.iter().take(base).any(|stop| {
            let mut kinds = stop.actions.iter().filter_map(|action| action["actionType"].as_str());
            kinds.any(|kind| kind == "pick")
        });
        let mut on_edges = running
            .legs
            .iter()
            .take(base.saturating_sub(1))
            .flat_map(|leg| &leg.actions);
        let picks = picks || (self.takes(T::R1ActionsOnEdges) && on_edges.any(|action| action["actionType"] == "pick"));
        let transport = Transport {
            loaded: transport.loaded || picks,
            ..transport
        };
        let mut way = Way {
            stops: vec![super::vehicle::Stop::default()],
            legs: Vec::new(),
        };
        let led = self.config.node(&here).is_some() && self.lead(vehicle, &mut way, &here, &transport).is_some();
        if led && way.stops.len() == 1 && self.faults.has(F::R4ActionAddedToTheStitchingNode) {
            let added = std::mem::take(&mut way.stops[0].actions);
            if added.is_empty() {
                return false;
            }
            running.stops.truncate(base);
            running.legs.truncate(base.saturating_sub(1));
            if let Some(end) = running.stops.last_mut() {
                end.actions.extend(added);
            }
            running.transport = Transport {
                begun: running.transport.begun,
                loaded: running.transport.loaded,
                ..transport
            };
            running.changed = true;
            return true;
        }
        // What is done at the end of the base is fixed; more cannot be done there.
        if !led || way.stops.len() < 2 || !way.stops[0].actions.is_empty() || !self.names_fit(vehicle, &way) {
            return false;
        }
        if self.faults.has(F::R1SequenceGapAfterReroute) && running.r1_gap.is_none() {
            running.r1_gap = Some((base, 2 * running.stops.len().saturating_sub(base)));
        }
        running.r1_rerouted = true;
        running.r4_drops_horizon = self.takes(T::R4HorizonDeletedFirst);
        running.r4_halt = None;
        running.stops.truncate(base);
        running.legs.truncate(base.saturating_sub(1));
        running.stops.extend(way.stops.into_iter().skip(1));
        running.legs.extend(way.legs);
        running.transport = Transport {
            begun: running.transport.begun,
            loaded: running.transport.loaded,
            ..transport
        };
        running.changed = true;
        true
    }

    /// Closes a way. A base that leads over it is called off, a horizon led round it.
    pub(super) fn block(&mut self, vehicle: &mut Vehicle, from: &str, to: &str) {
        if self.faults.has(F::R3OnlyLastBlockKept) {
            vehicle.blocked.clear();
        }
        vehicle.blocked.insert((from.to_owned(), to.to_owned()));
        let Some(running) = &vehicle.running else { return };
        let reached = running.reached(vehicle.state.as_ref());
        let mut ahead = running.legs.iter().enumerate().skip(reached);
        let Some((index, _)) = ahead.find(|(_, leg)| leg.from == from && leg.to == to) else {
            return;
        };
        if self.faults.has(F::BlockedEdgeUsed) || self.faults.has(F::R2BlockCheckedAtPlanningOnly) {
            return;
        }
        let transport = again(running, vehicle.state.as_ref());
        let shortens = self.faults.has(F::R1BaseShortenedOnBlock);
        if shortens && let Some(running) = &mut vehicle.running {
            running.released = running.released.min(index + 1);
        }
        let released = vehicle.running.as_ref().map_or(0, |running| running.released);
        if index + 1 < released || self.takes(T::R2BlocksByCancel) {
            self.cancel(vehicle, Some(transport));
        } else if let Some(mut running) = vehicle.running.take() {
            if !self.lead_on(vehicle, &mut running, transport) {
                running.changed = true;
            }
            vehicle.running = Some(running);
        }
        vehicle.at(self.now.moment);
    }

    /// Queues a transport.
    pub(super) fn dispatch(&mut self, vehicle: &mut Vehicle, transport: Transport) {
        let mut transport = transport;
        if self.faults.has(F::R2StartPlannedTooEarly) {
            let state = vehicle.state.as_ref();
            transport.r2_asked_at = state.map(|state| (state.last_node_id.clone(), state.agv_position.clone()));
        }
        let later = self.takes(T::R4DispatchesAfterTwoSeconds);
        transport.r4_due = later.then(|| self.now.moment + std::time::Duration::from_secs(2));
        if vehicle.queue.len() < MAX_QUEUE {
            vehicle.queue.push_back(transport);
            vehicle.at(self.now.moment);
        }
    }
}
