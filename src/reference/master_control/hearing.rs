//! What the vehicles say: connection, state, factsheet.

use serde_json::Value;

use super::faults::FaultName as F;
use super::seen::{Factsheet, Header, MAX_MESSAGE, Position, State};
use super::vehicle::{Presence, Vehicle};
use super::{MasterControl, Site};

impl MasterControl {
    /// Takes a message. What does not parse or is from another vehicle is ignored.
    pub(super) fn message(&mut self, topic: &str, payload: &[u8]) {
        let Some((index, name)) = self.by_topic.get(topic).copied() else {
            return;
        };
        let Some(vehicle) = self.fleet.get_mut(index) else {
            return;
        };
        if payload.len() > MAX_MESSAGE {
            return;
        }
        self.site.take_odd(vehicle, name, payload);
        if self.site.dead {
            self.shut_down();
            return;
        }
        let Ok(message) = serde_json::from_slice::<Value>(payload) else {
            return;
        };
        let Some(header) = Header::deserialized(&message) else {
            return;
        };
        if !header.is_from(vehicle) {
            return;
        }
        let now = self.site.now.moment;
        match name {
            "connection" => self.site.connection_heard(vehicle, &header, &message),
            "state" => {
                if let Ok(state) = serde_json::from_value::<State>(message) {
                    self.site.state_heard(vehicle, state);
                }
            }
            "factsheet" => {
                vehicle.factsheet = Some(Factsheet::read(&message));
                vehicle.missed = None;
            }
            _ if self.site.faults.has(F::VisualizationObeyed) => self.site.visualization_obeyed(vehicle, &message),
            // Visualization is for display, and there is none (VIS-03).
            _ => return,
        }
        vehicle.at(now);
    }
}

/// `visualization-obeyed`: the vehicle is where the visualization shows it, whatever its state says.
fn believe(shown_at: Option<&(String, Position)>, state: &mut State) {
    if let Some((node, position)) = shown_at {
        state.last_node_id.clone_from(node);
        state.agv_position = Some(position.clone());
    }
}

impl Header {
    fn deserialized(message: &Value) -> Option<Self> {
        serde::Deserialize::deserialize(message).ok()
    }

    /// Whether the header names this vehicle, or nobody.
    fn is_from(&self, vehicle: &Vehicle) -> bool {
        let same = |named: &Option<String>, known: &str| named.as_deref().is_none_or(|named| named == known);
        same(&self.serial_number, &vehicle.config.serial_number)
            && same(&self.manufacturer, &vehicle.config.manufacturer)
    }
}

impl Site {
    /// The headerId and timestamp of a last will are old, and say nothing (CONN-13).
    fn connection_heard(&mut self, vehicle: &mut Vehicle, header: &Header, message: &Value) {
        if self.faults.has(F::OldWillIgnored) && header.timestamp < vehicle.heard {
            return;
        }
        vehicle.heard.clone_from(&header.timestamp);
        let presence = match message.get("connectionState").and_then(Value::as_str) {
            Some("ONLINE") => Presence::Online,
            Some("OFFLINE" | "CONNECTIONBROKEN") => Presence::Away,
            _ => return,
        };
        let broken = message["connectionState"] == "CONNECTIONBROKEN";
        if broken && self.faults.has(F::BrokenIsDead) {
            vehicle.running = None;
            vehicle.cancel = None;
        }
        if broken && self.faults.has(F::PublishesConnection) {
            self.declare_offline(vehicle);
        }
        if presence == Presence::Online && vehicle.presence != Presence::Online {
            vehicle.give_time(self.now.moment);
            vehicle.absolved = self.faults.has(F::OnlineIsHealthy);
        }
        vehicle.presence = presence;
    }

    /// `visualization-obeyed`: believes the visualization as if it were the state.
    fn visualization_obeyed(&self, vehicle: &mut Vehicle, message: &Value) {
        let position = message.get("agvPosition").cloned();
        let Some(position) = position.and_then(|position| serde_json::from_value::<Position>(position).ok()) else {
            return;
        };
        let Some(state) = &mut vehicle.state else {
            return;
        };
        let Some(running) = &vehicle.running else {
            if let Some((node, _)) = self.config.nearest(position.x, position.y, &position.map_id) {
                vehicle.shown_at = Some((node.id.clone(), position));
                believe(vehicle.shown_at.as_ref(), state);
            }
            return;
        };
        let released = &running.stops[..running.released.min(running.stops.len())];
        let stops = released.iter().enumerate();
        let mut near =
            stops.filter(|(_, stop)| super::layout::distance((stop.x, stop.y), (position.x, position.y)) < 0.5);
        if let Some((index, _)) = near.next_back() {
            let sequence = u32::try_from(2 * index).unwrap_or(u32::MAX);
            state.last_node_sequence_id = state.last_node_sequence_id.max(sequence);
            state
                .node_states
                .retain(|node| node.sequence_id.is_some_and(|id| id > sequence));
        }
    }

    fn state_heard(&mut self, vehicle: &mut Vehicle, mut state: State) {
        let back = vehicle.state.as_ref().is_some_and(|before| !before.takes_orders()) && state.takes_orders();
        if vehicle.running.is_none() {
            believe(vehicle.shown_at.as_ref(), &mut state);
        }
        if let Some(running) = vehicle.running.as_mut().filter(|running| running.accepted)
            && state.operating_mode == "MANUAL"
        {
            running.cleared = true;
        }
        vehicle.absolved &= !state.is_fit(self.config.low_battery);
        vehicle.state = Some(state);
        vehicle.state_at = self.now.moment;
        if back {
            vehicle.give_time(self.now.moment);
        }
        if self.faults.has(F::InformationObeyed) {
            self.obey_information(vehicle);
        }
    }

    /// `information-obeyed`: takes an information for a reason to pause.
    fn obey_information(&mut self, vehicle: &mut Vehicle) {
        let informed = vehicle.state.as_ref().and_then(|state| state.information.as_ref());
        let paused = vehicle.instants.iter().any(|instant| instant.kind() == "startPause");
        if informed.is_some_and(|list| !list.is_empty()) && !paused {
            self.instant(vehicle, "startPause", &Value::Null);
        }
    }

    /// Asks for the factsheet once when none is there a while after the vehicle is.
    pub(super) fn miss_factsheet(&mut self, vehicle: &mut Vehicle) {
        let here = vehicle.presence == Presence::Online && vehicle.state.is_some();
        if vehicle.factsheet.is_some() || !here || !self.config.has("factsheetRequest") {
            return;
        }
        let now = self.now.moment;
        let (since, asked) = *vehicle.missed.get_or_insert((now, false));
        let due = since + std::time::Duration::from_secs(2);
        if due > now && !asked {
            vehicle.at(due);
        } else if !asked {
            vehicle.missed = Some((since, true));
            self.instant(vehicle, "factsheetRequest", &Value::Null);
        }
    }

    /// Whether anything may be sent to the vehicle (CONN-12).
    pub(super) fn reachable(&self, vehicle: &Vehicle) -> bool {
        vehicle.presence == Presence::Online || (self.faults.has(F::OrdersToOffline) && vehicle.state.is_some())
    }

    /// Whether the vehicle may be commanded (MODE-04). Without a state nothing is known.
    pub(super) fn commandable(&self, vehicle: &Vehicle) -> bool {
        let Some(state) = &vehicle.state else { return false };
        let manual = !state.takes_orders() && self.faults.has(F::OrdersInManual);
        self.reachable(vehicle) && (state.takes_orders() || manual)
    }
}
