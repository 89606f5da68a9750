//! Instant actions: sent once the vehicle can be commanded, watched until they end.

use serde_json::{Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::seen::ActionState;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Instant, MAX_INSTANT, Vehicle};

/// Instant actions that do not go together with an order that is driven (IACT-02).
const AGAINST_ORDER: [&str; 4] = ["initPosition", "startCharging", "stopCharging", "finePositioning"];

impl Site {
    /// Queues an instant action; its actionId, or nothing if the vehicle does not take it.
    pub(super) fn instant(&mut self, vehicle: &mut Vehicle, kind: &str, given: &Value) -> Option<String> {
        let contradicts = vehicle.running.is_some() && AGAINST_ORDER.contains(&kind);
        let paused = vehicle.state.as_ref().is_some_and(super::seen::State::is_paused);
        let despite = (paused && kind == "initPosition" && self.faults.has(F::R1PositionWhilePaused))
            || (kind.ends_with("Charging") && self.faults.has(F::R1ChargingDuringOrder));
        let position = vehicle.state.as_ref().and_then(|state| state.agv_position.as_ref());
        let lost = position.is_some_and(|position| !position.position_initialized);
        let despite = despite || (lost && kind == "initPosition" && self.faults.has(F::R2PositionSetWhenLost));
        if contradicts && !despite && !self.faults.has(F::PositionDuringOrder) {
            return None;
        }
        if !self.offers(vehicle.factsheet.as_ref(), kind, "INSTANT") {
            return None;
        }
        self.slips.instant = true;
        let mut action = self.action(vehicle, kind, given);
        self.slips.instant = false;
        let offers = vehicle.factsheet.as_ref().and_then(|sheet| sheet.actions.as_ref());
        let listed = offers.and_then(|offers| offers.get(kind)?.blocking_types.as_ref());
        let nothing = listed.is_none_or(|listed| listed.iter().any(|blocking| blocking == "NONE"));
        if nothing && self.takes(T::R1InstantsBlockNothing) {
            action["blockingType"] = json!("NONE");
        }
        if kind == "stopPause"
            && let Some(id) = vehicle.r5_pause_id.take()
            && self.faults.has(F::R5StopPauseWithIdOfStartPause)
        {
            action["actionId"] = json!(id);
        }
        if kind == "startPause" {
            vehicle.r5_pause_id = action["actionId"].as_str().map(str::to_owned);
        }
        self.queue(vehicle, action)
    }

    /// Queues an action that is made already.
    pub(super) fn queue(&mut self, vehicle: &mut Vehicle, action: Value) -> Option<String> {
        if vehicle.instants.len() >= MAX_INSTANT {
            let ended = vehicle.instants.iter().position(|instant| instant.sent_at.is_some())?;
            vehicle.instants.remove(ended);
        }
        let id = action["actionId"].as_str()?.to_owned();
        vehicle.instants.push_back(Instant {
            action,
            sent_at: None,
            resends: 0,
        });
        vehicle.at(self.now.moment);
        Some(id)
    }

    /// Sends what waits.
    pub(super) fn send_instants(&mut self, vehicle: &mut Vehicle) {
        let service = vehicle
            .state
            .as_ref()
            .is_some_and(|state| matches!(state.operating_mode.as_str(), "SERVICE" | "TEACHIN"));
        let cancels = |instant: &Instant| instant.sent_at.is_none() && instant.kind() == "cancelOrder";
        let manual = vehicle.state.as_ref().is_some_and(|state| !state.takes_orders());
        let stops = manual && vehicle.instants.iter().any(cancels) && self.faults.has(F::R1CancelInManual);
        let pause =
            |instant: &Instant| instant.sent_at.is_none() && matches!(instant.kind(), "startPause" | "stopPause");
        let pauses = manual && vehicle.instants.iter().any(pause) && self.faults.has(F::R2PausesInEveryMode);
        let map = |instant: &Instant| instant.sent_at.is_none() && instant.kind().ends_with("Map");
        let maps = manual && vehicle.instants.iter().any(map) && self.faults.has(F::R3MapActionsInEveryMode);
        let only_maps = maps && !self.commandable(vehicle);
        let despite = service && self.faults.has(F::ActionsInService) || stops || pauses || maps;
        let despite = despite && self.reachable(vehicle);
        // A paused or stopped vehicle takes actions; before the first state only questions are asked.
        if !self.commandable(vehicle) && !despite {
            return;
        }
        let now = self.now.moment;
        let limit = vehicle
            .factsheet
            .as_ref()
            .filter(|_| !self.faults.has(F::InstantActionsIgnored));
        let limit = limit.map_or(usize::MAX, |sheet| {
            sheet.limit(&["instantActions", "instantActions.actions", "actions"])
        });
        let limit = match () {
            () if self.faults.has(F::R1InstantLimitIgnored) => usize::MAX,
            () if self.takes(T::R1InstantActionsOneByOne) => 1,
            () => limit,
        };
        let paused = vehicle.state.as_ref().is_some_and(super::seen::State::is_paused);
        let held = paused && self.faults.has(F::R2CancelHeldWhilePaused);
        let drives = vehicle.state.as_ref().is_some_and(|state| state.driving);
        let drives = drives && self.faults.has(F::R3PauseWaitsForStandstill);
        loop {
            let mut actions = Vec::new();
            for instant in vehicle.instants.iter_mut().filter(|instant| instant.sent_at.is_none()) {
                if held && instant.kind() == "cancelOrder" {
                    continue;
                }
                let later = drives && instant.kind() == "startPause";
                if later || (only_maps && !instant.kind().ends_with("Map")) {
                    continue;
                }
                if actions.len() < limit.clamp(1, 10) {
                    instant.sent_at = Some(now);
                    actions.push(instant.action.clone());
                }
            }
            if actions.is_empty() {
                break;
            }
            let asks = self.takes(T::R6SeveralInstantActionsInOneMessage) && actions.len() < limit.min(10);
            if asks && !actions.iter().any(|action| action["actionType"] == "stateRequest") {
                actions.extend(self.r6_question(vehicle));
            }
            self.publish(vehicle, "instantActions", &json!({ "actions": actions }));
            vehicle.at(self.lost_after(now));
        }
    }

    /// Forgets what has ended, and sends again what was lost.
    pub(super) fn watch_instants(&mut self, vehicle: &mut Vehicle) {
        let now = self.now.moment;
        let awaited = vehicle.awaited();
        let is_awaited = |instant: &Instant| awaited.iter().any(|id| id == instant.id());
        let Vehicle { instants, state, .. } = vehicle;
        let seen = |id: &str| state.as_ref().and_then(|state| state.action(id));
        let is_over =
            |instant: &Instant| instant.sent_at.is_some() && seen(instant.id()).is_some_and(ActionState::is_terminal);
        instants.retain(|instant| !is_over(instant) || is_awaited(instant));
        let mut wake = None;
        for instant in instants.iter_mut() {
            let Some(sent_at) = instant.sent_at else { continue };
            if seen(instant.id()).is_some() {
                continue;
            }
            let lost = self.lost_after(sent_at);
            // A request is answered by what was asked for, and need not be listed.
            let answered = matches!(instant.kind(), "stateRequest" | "factsheetRequest") && vehicle.state_at > sent_at;
            if answered || instant.resends >= self.config.resend_limit {
                instant.resends = u32::MAX;
            } else if lost > now {
                wake = Some(wake.map_or(lost, |wake: crate::clock::Moment| wake.min(lost)));
            } else if self.faults.has(F::R1LostInstantNotResent) {
                instant.resends = u32::MAX;
            } else {
                instant.resends += 1;
                instant.sent_at = None;
            }
        }
        instants.retain(|instant| instant.resends < u32::MAX || is_awaited(instant));
        if let Some(wake) = wake {
            vehicle.at(wake);
        }
        if self.takes(T::R5CancelRepeatedWithNewId) {
            self.r5_rename_cancel(vehicle);
        }
    }
}

impl Vehicle {
    /// actionIds somebody waits for the end of, and takes out.
    fn awaited(&self) -> Vec<String> {
        let cancel = self.cancel.iter().map(|cancel| &cancel.action_id);
        let jobs = self.jobs.iter().map(|job| &job.action_id);
        cancel.chain(jobs).chain(self.enabling.values()).cloned().collect()
    }
}

/// How an instant action ended: `Some(true)` FINISHED, `Some(false)` FAILED or lost for good.
pub(super) fn ended(vehicle: &mut Vehicle, id: &str) -> Option<bool> {
    let mut waiting = vehicle.instants.iter().filter(|instant| instant.sent_at.is_none());
    if waiting.any(|instant| instant.id() == id) {
        return None;
    }
    let seen = vehicle.state.as_ref().and_then(|state| state.action(id));
    let end = match seen {
        Some(action) if action.is_terminal() => Some(action.action_status == "FINISHED"),
        Some(_) => None,
        None => {
            let watched = vehicle.instants.iter().find(|instant| instant.id() == id);
            watched
                .is_none_or(|instant| instant.resends == u32::MAX)
                .then_some(false)
        }
    };
    if end.is_some() {
        vehicle.instants.retain(|instant| instant.id() != id);
    }
    end
}
