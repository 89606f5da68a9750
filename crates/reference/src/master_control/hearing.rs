//! What the vehicles say: connection (section 6.14), state (6.10), factsheet (6.15).
//!
//! A message that does not parse, or that names another vehicle, is ignored as a whole. The visualization is for display,
//! and there is none (VIS-03).

use std::time::Duration;

use serde_json::Value;

use super::hooks::{Event, Heard, Permission};
use super::seen::{Factsheet, Header, MAX_MESSAGE, State};
use super::vehicle::{Presence, Vehicle};
use super::{MasterControl, Site};

impl MasterControl {
    /// Takes a message.
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
        let mut heard = Heard {
            name,
            topic,
            payload,
            message: serde_json::from_slice(payload).unwrap_or_default(),
        };
        vehicle.config.understand(name, &mut heard.message);
        if !self.site.hears(vehicle, &mut heard) {
            return;
        }
        let message = heard.message;
        let header = Header::deserialized(&message).filter(|header| header.is_from(vehicle));
        if header.is_none() {
            return;
        }
        match name {
            "connection" => self.site.connection_heard(vehicle, &message),
            "state" => {
                if let Ok(state) = serde_json::from_value::<State>(message) {
                    self.site.state_heard(vehicle, state);
                }
            }
            "factsheet" => {
                vehicle.factsheet = Some(Factsheet::read(&message, |own| vehicle.config.usual_parameter(own)));
                vehicle.missed = None;
                self.site.happens(vehicle, &mut Event::Factsheet);
            }
            _ => return,
        }
        vehicle.at(self.site.now.moment);
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
    fn connection_heard(&mut self, vehicle: &mut Vehicle, message: &Value) {
        let told = message.get("connectionState").and_then(Value::as_str);
        let presence = match told {
            Some("ONLINE") => Presence::Online,
            Some("OFFLINE" | "CONNECTIONBROKEN") => Presence::Away,
            Some("HIBERNATING") => Presence::Asleep,
            _ => return,
        };
        let before = std::mem::replace(&mut vehicle.presence, presence);
        if presence == Presence::Asleep {
            // It has given its order up before (HIB-04).
            if let Some(running) = vehicle.running.as_mut().filter(|running| running.accepted) {
                running.cleared = true;
            }
        } else if presence == Presence::Away {
            self.happens(vehicle, &mut Event::Away(told == Some("CONNECTIONBROKEN"), before));
        } else {
            if before != Presence::Online {
                vehicle.give_time(self.now.moment);
            }
            self.happens(vehicle, &mut Event::Online(before));
        }
    }

    fn state_heard(&mut self, vehicle: &mut Vehicle, state: State) {
        let back = vehicle.state.as_ref().is_some_and(|before| !before.takes_orders()) && state.takes_orders();
        // A vehicle in MANUAL gives up the order it has (MODE-02), and in later versions in other modes, too.
        let all = vehicle.config.has("modesClear");
        if let Some(running) = vehicle.running.as_mut().filter(|running| running.accepted) {
            running.cleared |= match state.operating_mode.as_str() {
                "MANUAL" => true,
                "STARTUP" | "SERVICE" | "TEACHIN" => all,
                _ => false,
            };
        }
        let before = vehicle.state.replace(state);
        vehicle.state_at = self.now.moment;
        if back {
            vehicle.give_time(self.now.moment);
        }
        self.happens(vehicle, &mut Event::State(before.as_ref()));
    }

    /// Asks for the factsheet once when none is there a while after the vehicle is.
    pub(super) fn miss_factsheet(&mut self, vehicle: &mut Vehicle) {
        let here = vehicle.presence == Presence::Online && vehicle.state.is_some();
        if vehicle.factsheet.is_some() || !here || !vehicle.config.has("factsheetRequest") {
            return;
        }
        let now = self.now.moment;
        let (since, asked) = *vehicle.missed.get_or_insert((now, false));
        let due = since + Duration::from_secs(2);
        if due > now && !asked {
            vehicle.at(due);
        } else if !asked {
            vehicle.missed = Some((since, true));
            self.instant(vehicle, "factsheetRequest", &Value::Null);
        }
    }

    /// Whether anything may be sent to the vehicle (CONN-12).
    pub(crate) fn reachable(&self, vehicle: &Vehicle) -> bool {
        self.allows(vehicle, Permission::Reach, vehicle.presence == Presence::Online)
    }

    /// Whether the vehicle may be commanded (MODE-04). Without a state nothing is known.
    pub(crate) fn commandable(&self, vehicle: &Vehicle) -> bool {
        let Some(state) = &vehicle.state else { return false };
        self.reachable(vehicle) && self.allows(vehicle, Permission::Command, state.takes_orders())
    }
}
