//! What the vehicles say: connection, state, factsheet.

use serde_json::Value;

use super::faults::FaultName as F;
use super::seen::{Factsheet, Header, MAX_MESSAGE, Position, State};
use super::tolerances::ToleranceName as T;
use super::vehicle::{Presence, Vehicle};
use super::{MasterControl, Output, Site};
use crate::reference::Publication;

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
                let number = message.get("headerId").and_then(Value::as_u64);
                let low = number
                    .zip(vehicle.r4_state_header)
                    .is_some_and(|(new, last)| new <= last);
                if low && self.site.faults.has(F::R4DropsStatesWithLowHeaderId) {
                    return;
                }
                vehicle.r4_state_header = number.or(vehicle.r4_state_header);
                vehicle.r2_state_time.clone_from(&header.timestamp);
                let version = message.get("version").and_then(Value::as_str);
                vehicle.slips.version = version.map(str::to_owned);
                if let Ok(state) = serde_json::from_value::<State>(message) {
                    self.site.state_heard(vehicle, state);
                }
            }
            "factsheet" if vehicle.factsheet.is_some() && self.site.faults.has(F::R1FirstFactsheetForever) => return,
            "factsheet" => {
                if self.site.faults.has(F::R1FactsheetPublishedAgain) && !vehicle.r1_shown {
                    vehicle.r1_shown = true;
                    self.site.pending.push(Output::Publish(Publication {
                        topic: topic.to_owned(),
                        payload: payload.to_vec(),
                        qos: 0,
                        retain: true,
                    }));
                }
                let sheet = self.site.r4_judged_by(index, Factsheet::read(&message));
                vehicle.factsheet = Some(sheet);
                vehicle.missed = None;
            }
            _ if self.site.faults.has(F::R2TemporaryStartFromVisualization) => {
                let position = message.get("agvPosition").cloned();
                vehicle.r2_seen_at = position.and_then(|position| serde_json::from_value(position).ok());
                return;
            }
            _ if self.site.faults.has(F::R4StartFromVisualization) => {
                let position = message.get("agvPosition").cloned();
                let position = position.and_then(|position| serde_json::from_value(position).ok());
                vehicle.r4_shown_at = position.or(vehicle.r4_shown_at.take());
                return;
            }
            _ if self.site.faults.has(F::R3VisualizationAsideMeansPause) => self.site.r3_aside(vehicle, &message),
            _ if self.site.faults.has(F::R1VisualizationHoldsDispatch) => {
                let speed = |key: &str| message.pointer(key).and_then(Value::as_f64).unwrap_or(0.0).abs();
                vehicle.r1_moving = speed("/velocity/vx") + speed("/velocity/vy") + speed("/velocity/omega") > 0.0;
            }
            _ if self.site.faults.has(F::VisualizationObeyed) => self.site.visualization_obeyed(vehicle, &message),
            // Visualization is for display, and there is none (VIS-03).
            _ => return,
        }
        vehicle.at(now);
        if name == "factsheet" && self.site.faults.has(F::R2FactsheetSharedByFleet) {
            let sheet = vehicle.factsheet.clone();
            for other in &mut self.fleet {
                other.factsheet.clone_from(&sheet);
            }
        }
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
        let count = message.get("headerId").and_then(Value::as_u64);
        let low = count
            .zip(vehicle.r4_connection_header)
            .is_some_and(|(new, last)| new < last);
        if low && self.faults.has(F::R4OldWillIgnored) {
            return;
        }
        vehicle.r4_connection_header = count.or(vehicle.r4_connection_header);
        let dying = message["connectionState"] == "CONNECTIONBROKEN";
        let older = !vehicle.r2_state_time.is_empty() && header.timestamp < vehicle.r2_state_time;
        if dying && older && self.faults.has(F::R2WillOlderThanStateIgnored) {
            return;
        }
        let number = message.get("headerId").and_then(Value::as_u64).unwrap_or(u64::MAX);
        if dying && number <= vehicle.r1_header && self.faults.has(F::R1WillWithLowHeaderIdIgnored) {
            return;
        }
        vehicle.r1_header = if number == u64::MAX { vehicle.r1_header } else { number };
        if dying && vehicle.running.is_some() && self.faults.has(F::R3BrokenHeededOnlyAtRest) {
            return;
        }
        let told = header.timestamp.parse::<jiff::Timestamp>();
        let age = told.map_or(0, |told| self.now.utc.as_second() - told.as_second());
        if dying && age > 60 && self.faults.has(F::R3WillOlderThanMinuteIgnored) {
            return;
        }
        if dying && self.faults.has(F::R1BrokenNotHeeded) {
            return;
        }
        let presence = match message.get("connectionState").and_then(Value::as_str) {
            Some("OFFLINE") if self.faults.has(F::R5OfflineVehicleGetsOrders) => return,
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
        if broken && self.faults.has(F::R4ClearsTheWill) {
            self.r2_clear_connection(vehicle);
        }
        if broken {
            vehicle.r2_broken += 1;
            vehicle.shunned |= vehicle.r2_broken > 1 && self.faults.has(F::R2TwiceBrokenIsDefective);
        }
        if presence == Presence::Away
            && vehicle.presence == Presence::Online
            && self.faults.has(F::R2ConnectionTopicCleared)
        {
            self.r2_clear_connection(vehicle);
        }
        if presence == Presence::Online && vehicle.presence == Presence::Away {
            vehicle.r2_stale = true;
            vehicle.r4_returned = vehicle.running.is_some();
            self.r5_returned(vehicle);
            self.r6_returned(vehicle);
            if let Some(running) = &mut vehicle.running
                && self.faults.has(F::R2UpdateIdsRestartWithVehicle)
            {
                running.update_id = 0;
            }
            if self.takes(T::R2FactsheetAskedOnReturn) && self.config.has("factsheetRequest") {
                self.instant(vehicle, "factsheetRequest", &Value::Null);
            }
        }
        if presence == Presence::Online && vehicle.presence != Presence::Online {
            vehicle.give_time(self.now.moment);
            vehicle.absolved = self.faults.has(F::OnlineIsHealthy);
            self.forget_on_return(vehicle);
            if self.takes(T::R6FactsheetRequestAtEachOnline) && self.config.has("factsheetRequest") {
                self.instant(vehicle, "factsheetRequest", &Value::Null);
            }
            if self.takes(T::R5StateRequestAfterOnline) {
                self.instant(vehicle, "stateRequest", &Value::Null);
            }
            if self.takes(T::R4RequestsStateAndFactsheetWhenOnline) {
                self.instant(vehicle, "stateRequest", &Value::Null);
                if self.config.has("factsheetRequest") {
                    self.instant(vehicle, "factsheetRequest", &Value::Null);
                }
            }
        }
        vehicle.presence = presence;
        if presence == Presence::Away {
            vehicle.r1_stale |= vehicle.running.is_some();
            vehicle.r1_cancel_due |= broken && vehicle.running.is_some();
            return;
        }
        if std::mem::take(&mut vehicle.r1_cancel_due) && self.faults.has(F::R1BrokenMeansCancel) {
            self.cancel(vehicle, None);
        }
        if let Some(state) = vehicle
            .state
            .as_mut()
            .filter(|_| self.faults.has(F::R1OnlineClearsErrors))
        {
            state.errors.clear();
        }
    }

    /// The factsheet a vehicle is judged by: its own, or that of the vehicle that came first
    /// (`r4-optional-fields-by-the-first-factsheet`).
    fn r4_judged_by(&mut self, index: usize, sheet: Factsheet) -> Factsheet {
        if !self.faults.has(F::R4OptionalFieldsByTheFirstFactsheet) {
            return sheet;
        }
        match &self.r4_first_sheet {
            Some((first, known)) if *first != index => known.clone(),
            _ => {
                self.r4_first_sheet = Some((index, sheet.clone()));
                sheet
            }
        }
    }

    /// What a faulty master control does not know any more when a vehicle is back.
    fn forget_on_return(&self, vehicle: &mut Vehicle) {
        if self.faults.has(F::BlockForgottenOnReturn) {
            vehicle.blocked.clear();
        }
        if self.faults.has(F::CancelForgottenOnReturn) {
            vehicle.cancel = None;
        }
        if let Some(running) = vehicle.running.as_mut()
            && self.faults.has(F::UpdateIdsRestartOnReturn)
        {
            running.update_id = 0;
        }
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

    /// `r3-visualization-aside-means-pause`: pauses a vehicle that the visualization shows elsewhere than its state.
    fn r3_aside(&mut self, vehicle: &mut Vehicle, message: &Value) {
        let shown = message.get("agvPosition").cloned();
        let shown = shown.and_then(|shown| serde_json::from_value::<Position>(shown).ok());
        let told = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        let (Some(shown), Some(told)) = (shown, told) else {
            return;
        };
        let aside = super::layout::distance((shown.x, shown.y), (told.x, told.y)) > 1.0;
        if aside && !vehicle.r3_aside {
            self.instant(vehicle, "startPause", &Value::Null);
        }
        vehicle.r3_aside = aside;
    }

    fn state_heard(&mut self, vehicle: &mut Vehicle, mut state: State) {
        let back = vehicle.state.as_ref().is_some_and(|before| !before.takes_orders()) && state.takes_orders();
        if vehicle.running.is_none() {
            believe(vehicle.shown_at.as_ref(), &mut state);
        }
        if let Some(before) = vehicle.state.as_ref().filter(|before| before.takes_orders())
            && !state.takes_orders()
            && self.faults.has(F::R1StartBeforeManual)
        {
            vehicle.r1_before_manual = Some((before.last_node_id.clone(), before.agv_position.clone()));
        }
        if let Some(running) = vehicle.running.as_mut().filter(|running| running.accepted)
            && state.operating_mode == "MANUAL"
            && !self.faults.has(F::R1UpdatesInManual)
        {
            running.cleared = true;
        }
        let seized = vehicle.state.as_ref().is_some_and(State::takes_orders) && state.operating_mode == "MANUAL";
        vehicle.r2_stale = false;
        vehicle.r5_declared = false;
        vehicle.r5_back &= state.is_paused();
        if vehicle.presence == Presence::Away && self.faults.has(F::R2StateMeansOnline) {
            vehicle.presence = Presence::Online;
        }
        if self.faults.has(F::R2MapEnabledForEver) {
            let enabled = state.maps.iter().flatten().filter(|map| map.map_status == "ENABLED");
            vehicle.r1_enabled.extend(enabled.map(|map| map.map_id.clone()));
        }
        vehicle.absolved &= !state.is_fit(self.config.low_battery);
        let enabled = state.maps.iter().flatten().filter(|map| map.map_status == "ENABLED");
        let serial = &vehicle.config.serial_number;
        self.slips
            .enabled
            .extend(enabled.map(|map| (map.map_id.clone(), serial.clone())));
        self.r6_state(vehicle, &state);
        vehicle.state = Some(state);
        vehicle.state_at = self.now.moment;
        self.charge_anyway(vehicle);
        if self.faults.has(F::R1LowScoreRelocated) {
            self.relocate(vehicle);
        }
        if back {
            vehicle.give_time(self.now.moment);
        }
        if seized {
            self.r5_cancel_in_manual(vehicle);
        }
        self.r2_answer(vehicle);
        if self.faults.has(F::InformationObeyed) {
            self.obey_information(vehicle);
        }
    }

    /// `r2-information-asks-for-state` and `r2-position-set-when-lost`.
    fn r2_answer(&mut self, vehicle: &mut Vehicle) {
        let informs = vehicle.state.as_ref().is_some_and(State::informs);
        if informs && !vehicle.r2_informed && self.faults.has(F::R2InformationAsksForState) {
            self.instant(vehicle, "stateRequest", &Value::Null);
        }
        vehicle.r2_informed = informs;
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        let lost = position.is_some_and(|position| !position.position_initialized);
        let driven = vehicle.running.is_some();
        if lost && driven && !vehicle.r2_lost && self.faults.has(F::R2PositionSetWhenLost) {
            self.init_position(vehicle, &Value::Null);
        }
        vehicle.r2_lost = lost;
    }

    /// `r1-low-score-relocated`: tells a vehicle that is unsure where it is where it says to be.
    fn relocate(&mut self, vehicle: &mut Vehicle) {
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        let low = position
            .and_then(|position| position.localization_score)
            .is_some_and(|score| score < 0.5);
        if low && !vehicle.r1_relocated && vehicle.running.is_none() {
            self.init_position(vehicle, &Value::Null);
        }
        vehicle.r1_relocated = low;
    }

    /// `r1-state-asked-when-quiet`: asks for a state when none has come for a while.
    pub(super) fn ask_when_quiet(&mut self, vehicle: &mut Vehicle) {
        if !self.takes(T::R1StateAskedWhenQuiet) || vehicle.state.is_none() || !self.commandable(vehicle) {
            return;
        }
        let due = vehicle.state_at + std::time::Duration::from_secs(6);
        if due > self.now.moment {
            vehicle.at(due);
        } else if vehicle.r1_asked != Some(vehicle.state_at) {
            vehicle.r1_asked = Some(vehicle.state_at);
            self.instant(vehicle, "stateRequest", &Value::Null);
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
        let taught = state.operating_mode == "TEACHIN" && self.faults.has(F::R1TeachinIsAutomatic);
        self.reachable(vehicle) && (state.takes_orders() || manual || taught)
    }
}
