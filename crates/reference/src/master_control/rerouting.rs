//! Another destination for a transport under way, an edge that is closed, and the next transport (section 6.6.2).
//!
//! Behind the base the way is changed by an update; where the base itself would have to change, the order is called off
//! first (ORD-CANCEL-01).

use super::Site;
use super::dispatch::Way;
use super::driving::again;
use super::hooks::Event;
use super::vehicle::{MAX_QUEUE, Running, Stop, Transport, Vehicle};

/// Means by which a transport gets another destination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reroute {
    /// By another way behind the base.
    ByUpdate,
    /// By calling the order off.
    ByCancel,
    /// By forgetting the order.
    Dropped,
}

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
        if vehicle.queue.front().is_some_and(|next| next.follows) {
            vehicle.queue.pop_front();
        }
        let mut transport = again(&running, vehicle.state.as_ref());
        to.clone_into(&mut transport.to);
        let mut how = match vehicle.cancel {
            None if !running.refused => Reroute::ByUpdate,
            _ => Reroute::ByCancel,
        };
        self.happens(vehicle, &mut Event::Rerouting(&mut running, &mut how));
        let led =
            how == Reroute::ByUpdate && !running.is_whole() && self.lead_on(vehicle, &mut running, transport.clone());
        vehicle.running = Some(running);
        match how {
            Reroute::Dropped => self.drop_order(vehicle, Some(transport)),
            _ if led => {}
            _ => self.cancel(vehicle, Some(transport)),
        }
        vehicle.at(self.now.moment);
    }

    /// Replaces the way behind the base.
    fn lead_on(&mut self, vehicle: &mut Vehicle, running: &mut Running, transport: Transport) -> bool {
        let base = running.released;
        let Some(end) = running.stops.get(base.saturating_sub(1)) else {
            return false;
        };
        let here = end.id.clone();
        let picks = running.actions().any(|action| action["actionType"] == "pick");
        let transport = Transport {
            loaded: transport.loaded || picks,
            begun: running.transport.begun,
            ..transport
        };
        let mut way = Way {
            stops: vec![Stop::default()],
            legs: Vec::new(),
        };
        let led = self.config.node(&here).is_some() && self.lead(vehicle, &mut way, &here, &transport).is_some();
        if led {
            self.plans(vehicle, &mut way, &transport, false);
        }
        // What is done at the end of the base is fixed; more cannot be done there.
        if !led || way.stops.len() < 2 || !way.stops[0].actions.is_empty() || !self.names_fit(vehicle, &way) {
            let mut done = false;
            if led {
                self.happens(vehicle, &mut Event::NotLed(running, &mut way, &transport, &mut done));
            }
            return done;
        }
        running.stops.truncate(base);
        running.legs.truncate(base.saturating_sub(1));
        running.stops.extend(way.stops.into_iter().skip(1));
        running.legs.extend(way.legs);
        running.transport = Transport {
            loaded: running.transport.loaded,
            ..transport
        };
        running.changed = true;
        self.happens(vehicle, &mut Event::Led(running));
        true
    }

    /// Closes a way. A base that leads over it is called off, a horizon led round it (ORD-12).
    pub(super) fn block(&mut self, vehicle: &mut Vehicle, from: &str, to: &str) {
        vehicle.blocked.insert((from.to_owned(), to.to_owned()));
        let Some(running) = &vehicle.running else { return };
        let reached = running.reached(vehicle.state.as_ref());
        let mut ahead = running.legs.iter().enumerate().skip(reached);
        let Some((index, _)) = ahead.find(|(_, leg)| leg.from == from && leg.to == to) else {
            return;
        };
        let transport = again(running, vehicle.state.as_ref());
        let mut heeded = true;
        self.happens(vehicle, &mut Event::Closed(index, &mut heeded));
        if !heeded {
            return;
        }
        let released = vehicle.running.as_ref().map_or(0, |running| running.released);
        if index + 1 < released {
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
    pub(crate) fn dispatch(&mut self, vehicle: &mut Vehicle, transport: Transport) {
        if vehicle.queue.len() < MAX_QUEUE {
            vehicle.queue.push_back(transport);
            vehicle.at(self.now.moment);
        }
    }
}
