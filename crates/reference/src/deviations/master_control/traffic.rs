//! Deviations of how vehicles are kept apart: what an order or an update says while another vehicle is on the way (section 6.6).

use super::prelude::*;

records! {
    fault "first-node-unreleased-before-an-occupied-way" ["ORD-14"]
        "While another vehicle is on the way ahead it sends a new order without any released node, the first one included."
        => fleet::<Traffic>().happens(|traffic, _, vehicle, event| traffic.watch(vehicle, event))
            .shows(|traffic, _, vehicle, running, window, _| {
                if running.released == 0 && running.stops.iter().take(window.released).skip(1).any(|stop| traffic.occupies(vehicle, stop)) { window.released = 1; }
            })
            .words(|_, _, _, worded, m| if !worded.is_update() && worded.window.released == 1 && worded.running.stops.len() > 1 {
                each_element(m, |element| element.set("released", false));
            })
            .allows(|traffic, _, vehicle, what, usual| match what {
                Permission::Extend(running) if running.released == 1 => usual && !running.stops.get(1).is_some_and(|stop| traffic.occupies(vehicle, stop)),
                _ => usual,
            });
    fault "free-elements-released-behind-occupied-ones" ["ORD-09"]
        "It releases each node and edge of a message that no other vehicle is on, also behind one that another vehicle is on."
        => fleet::<Traffic>().happens(|traffic, _, vehicle, event| traffic.watch(vehicle, event))
            .shows(|traffic, _, vehicle, running, window, _| {
                let known = running.released.max(1);
                let ahead = running.stops.iter().enumerate().take(window.end).skip(known);
                let occupied = ahead.into_iter().find(|(_, stop)| traffic.occupies(vehicle, stop));
                window.released = occupied.map_or(window.end, |(index, _)| index);
            })
            .words(|traffic, _, vehicle, worded, m| {
                let stops = &worded.running.stops;
                let free = |index: usize| index < worded.window.released || stops.get(index).is_some_and(|stop| !traffic.occupies(vehicle, stop));
                worded.nodes(m, |index, _, node| node.set("released", free(index)));
                worded.edges(m, |index, _, edge| edge.set("released", free(index + 1)));
            });
    fault "base-taken-back-for-a-vehicle-of-higher-rank" ["ORD-UPD-03"]
        "When a vehicle that stands later in its fleet gets a base over a node ahead, an update repeats the base of the earlier one from there on as not released."
        => fleet::<Traffic>().happens(|traffic, site, vehicle, event| {
            traffic.watch(vehicle, event);
            if let Event::Extending(running) = event && traffic.gives_way(site, vehicle, running) {
                let reached = running.reached(vehicle.state.as_ref());
                if running.released > reached + 1 && traffic.withdrawn.insert(running.id.clone()) {
                    running.released = reached + 1;
                    running.changed = true;
                }
            }
        }).allows(|traffic, site, vehicle, what, usual| match what {
            Permission::Grow(running, ..) => usual && !traffic.gives_way(site, vehicle, running),
            _ => usual,
        });
}

/// Where a vehicle is, and what it has been given.
#[derive(Clone, Default)]
struct Place {
    /// Node it was on last.
    here: String,
    /// Nodes of its base that it has not reached.
    ahead: BTreeSet<String>,
}

/// Places of the vehicles by serial number, and the orders whose base was taken back.
#[derive(Clone, Default)]
struct Traffic {
    places: BTreeMap<String, Place>,
    withdrawn: BTreeSet<String>,
}

impl Traffic {
    /// Notes where a vehicle is.
    fn watch(&mut self, vehicle: &Vehicle, event: &Event<'_>) {
        let running = match event {
            Event::State(_) | Event::Begun => vehicle.running.as_ref(),
            Event::Updated(running, _) => Some(&**running),
            _ => return,
        };
        let state = vehicle.state.as_ref();
        let ahead = running.into_iter().flat_map(|running| {
            let base = running.stops.iter().take(running.released);
            base.skip(running.reached(state) + 1).map(|stop| stop.id.clone())
        });
        let place = Place {
            here: state.map(|state| state.last_node_id.clone()).unwrap_or_default(),
            ahead: ahead.collect(),
        };
        self.places.insert(vehicle.config.serial_number.clone(), place);
    }

    /// Whether another vehicle is on a node, or has it in its base.
    fn occupies(&self, vehicle: &Vehicle, stop: &Stop) -> bool {
        let mut others = self
            .places
            .iter()
            .filter(|(serial, _)| **serial != vehicle.config.serial_number);
        others.any(|(_, place)| place.here == stop.id || place.ahead.contains(&stop.id))
    }

    /// Whether a vehicle later in the fleet has a node of the way ahead in its base.
    fn gives_way(&self, site: &Site, vehicle: &Vehicle, running: &Running) -> bool {
        let ahead = || running.stops.iter().skip(running.reached(vehicle.state.as_ref()) + 1);
        let later = site
            .config
            .vehicles
            .iter()
            .skip_while(|known| **known != vehicle.config)
            .skip(1);
        let mut places = later.filter_map(|known| self.places.get(&known.serial_number));
        places.any(|place| ahead().any(|stop| place.ahead.contains(&stop.id)))
    }
}
