//! Deviations of how it answers what people ask of it: what it does not send now it declines, and keeps nothing in mind.

use crate::master_control::commands::{text, transport};

use super::prelude::*;

records! {
    tolerance "declines-what-it-may-not-send" ["CONN-12", "MODE-04", "ORD-12", "FACT-15"]
        "It says no at once to whoever asks for something that it may not send now, and does not come back to it."
        => plain().declines(|(), site, vehicle, command, arguments| declined(site, vehicle, command, arguments).map(str::to_owned));
}

/// Commands that come to nothing on the wire.
const WITHOUT_MESSAGE: [&str; 6] = [
    "start",
    "shutdown",
    "confirm",
    "configure",
    "block-edge",
    "unblock-edge",
];

/// Why a command is declined.
fn declined(site: &Site, vehicle: &Vehicle, command: &str, arguments: &Value) -> Option<&'static str> {
    if WITHOUT_MESSAGE.contains(&command) {
        return None;
    }
    if !site.reachable(vehicle) {
        return Some("the vehicle is not connected");
    }
    if matches!(command, "request-state" | "request-factsheet") {
        return None;
    }
    if !site.commandable(vehicle) {
        return Some("the vehicle is not in automatic operation");
    }
    match command {
        "dispatch" => {
            let state = vehicle.state.as_ref()?;
            let transport = transport(vehicle, arguments)?;
            if !state.is_fit(site.config.low_battery) {
                return Some("the vehicle is not fit for a transport");
            }
            if is_closed(site, vehicle, &state.last_node_id, &transport) {
                return Some("every way there is closed for the vehicle");
            }
            let kinds = transport.from.iter().flat_map(|_| ["pick", "drop"]);
            let mut kinds = kinds.chain(transport.action.as_deref());
            let lacks = |kind: &str| !["NODE", "EDGE"].iter().any(|scope| site.offers(vehicle, kind, scope));
            kinds.any(lacks).then_some("the vehicle does not do such an action")
        }
        "reroute" => {
            let to = text(arguments, "to")?;
            let running = vehicle.running.as_ref()?;
            let end = running.stops.get(running.released.saturating_sub(1))?;
            let transport = Transport {
                to,
                ..Transport::default()
            };
            is_closed(site, vehicle, &end.id, &transport).then_some("every way there is closed for the vehicle")
        }
        "init-position" => vehicle.running.is_some().then_some("the vehicle has an order"),
        _ => None,
    }
}

/// Whether no way that is open leads from a node to where a transport ends.
fn is_closed(site: &Site, vehicle: &Vehicle, last: &str, transport: &Transport) -> bool {
    let known = |from: &str, to: &str| site.config.way(from, to, &BTreeSet::new()).is_some();
    let open = |from: &str, to: &str| !known(from, to) || site.config.way(from, to, &vehicle.blocked).is_some();
    let places = transport.from.iter().chain([&transport.to]);
    let mut here = last;
    places.into_iter().any(|place| {
        let closed = !open(here, place);
        here = place;
        closed
    })
}
