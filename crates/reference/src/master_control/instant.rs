//! Instant actions: sent once the vehicle can be commanded, watched until they end (section 6.9).
//!
//! What goes together with an order that is driven follows the ruling of IACT-02.

use serde_json::{Value, json};

use super::Site;
use super::hooks::{Event, Measure, Permission};
use super::seen::{ActionState, State};
use super::vehicle::{Instant, MAX_INSTANT, Presence, Vehicle};
use super::zones::WantedSet;

/// Instant actions that do not go together with an order that is driven (IACT-02).
const AGAINST_ORDER: [&str; 4] = ["initPosition", "startCharging", "stopCharging", "finePositioning"];

impl Site {
    /// Queues an instant action; its actionId, or nothing if the vehicle does not take it.
    pub(crate) fn instant(&mut self, vehicle: &mut Vehicle, kind: &str, given: &Value) -> Option<String> {
        let contradicts = vehicle.running.is_some() && AGAINST_ORDER.contains(&kind);
        if !self.allows(vehicle, Permission::Beside(kind), !contradicts) {
            return None;
        }
        self.instant_all_the_same(vehicle, kind, given)
    }

    /// Queues an instant action without regard to the order that is driven.
    pub(crate) fn instant_all_the_same(&mut self, vehicle: &mut Vehicle, kind: &str, given: &Value) -> Option<String> {
        if !self.offers(vehicle, kind, "INSTANT") {
            return None;
        }
        let action = self.made_action(vehicle, kind, given, true);
        self.queue(vehicle, action)
    }

    /// Queues an action that is made already.
    pub(crate) fn queue(&mut self, vehicle: &mut Vehicle, action: Value) -> Option<String> {
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

    /// Sends what waits. A paused or stopped vehicle takes actions, too.
    pub(crate) fn send_instants(&mut self, vehicle: &mut Vehicle) {
        let now = self.now.moment;
        let commandable = self.commandable(vehicle);
        let limit = vehicle.factsheet.as_ref().map_or(usize::MAX, |sheet| {
            sheet.limit(&["instantActions", "instantActions.actions", "actions"])
        });
        let limit = self.measures(vehicle, Measure::Instants, limit).clamp(1, 10);
        let waits = |instant: &Instant| instant.sent_at.is_none();
        let told = |instant: &Instant| {
            let usual = commandable || self.takes(vehicle, instant.kind());
            self.allows(vehicle, Permission::Tell(instant.kind()), usual)
        };
        let ready: Vec<bool> = vehicle.instants.iter().map(|one| waits(one) && told(one)).collect();
        let mut actions = Vec::new();
        for (instant, _) in vehicle.instants.iter_mut().zip(ready).filter(|(_, ready)| *ready) {
            instant.sent_at = Some(now);
            actions.push(instant.action.clone());
        }
        for actions in actions.chunks(limit) {
            self.publish(vehicle, "instantActions", &json!({ "actions": actions }));
            vehicle.at(self.lost_after(vehicle, now));
        }
    }

    /// Whether a vehicle that cannot be commanded takes this all the same: asleep it can be woken (HIB-06), and an order can be
    /// called off while somebody works on the vehicle (MODE-11).
    fn takes(&self, vehicle: &Vehicle, kind: &str) -> bool {
        let intervened = vehicle
            .state
            .as_ref()
            .is_some_and(|state| state.operating_mode == "INTERVENED");
        match kind {
            "stopHibernation" => vehicle.presence == Presence::Asleep,
            "cancelOrder" => intervened && self.reachable(vehicle),
            _ => false,
        }
    }

    /// Wakes a sleeping vehicle for what waits to be done (HIB-13, SHUT-03).
    pub(super) fn watch_sleep(&mut self, vehicle: &mut Vehicle) {
        let woken = vehicle
            .instants
            .iter()
            .any(|instant| instant.kind() == "stopHibernation");
        let waits = vehicle.instants.iter().any(|instant| instant.sent_at.is_none());
        let needed = vehicle.presence == Presence::Asleep && !woken && (waits || !vehicle.queue.is_empty());
        if self.allows(vehicle, Permission::Wake, needed) {
            self.instant(vehicle, "stopHibernation", &Value::Null);
        }
    }

    /// Has the lists of instant actions and of actions in zones emptied once all in them has ended (IACT-STATE-07, ZACT-STATE-08).
    pub(super) fn watch_lists(&mut self, vehicle: &mut Vehicle) {
        let Some(state) = &vehicle.state else { return };
        if !vehicle.config.has("instantActionStates") || !vehicle.instants.is_empty() || !vehicle.awaited().is_empty() {
            return;
        }
        let lists = [
            ("clearInstantActions", &state.instant_action_states),
            ("clearZoneActions", &state.zone_action_states),
        ];
        let full = lists.into_iter().filter(|(kind, list)| {
            // What clears the list may stand in it itself.
            let others = list.iter().any(|action| action.action_type != *kind);
            others && list.iter().all(ActionState::is_terminal)
        });
        let full: Vec<&str> = full.map(|(kind, _)| kind).collect();
        for kind in full {
            if self.commandable(vehicle) && self.allows(vehicle, Permission::Clear(kind), true) {
                self.instant(vehicle, kind, &Value::Null);
            }
        }
    }

    /// Says what becomes of an action that has failed and may be tried again (RETRY-08).
    pub(crate) fn decide_retriable(&mut self, vehicle: &mut Vehicle, kind: &str) {
        let state = vehicle.state.as_ref();
        let id = state.and_then(State::retriable).map(|action| action.action_id.clone());
        if let Some(id) = id {
            self.instant(vehicle, kind, &json!({ "actionId": id }));
        }
    }

    /// Forgets what has ended, and sends again what was lost.
    pub(super) fn watch_instants(&mut self, vehicle: &mut Vehicle) {
        let now = self.now.moment;
        let awaited = vehicle.awaited();
        let is_awaited = |instant: &Instant| awaited.iter().any(|id| id == instant.id());
        let mut instants = std::mem::take(&mut vehicle.instants);
        let state = vehicle.state.as_ref();
        let seen = |id: &str| state.and_then(|state| state.action(id));
        let is_over =
            |instant: &Instant| instant.sent_at.is_some() && seen(instant.id()).is_some_and(ActionState::is_terminal);
        instants.retain(|instant| !is_over(instant) || is_awaited(instant));
        let mut wakes = Vec::new();
        let mut lost = Vec::new();
        for instant in &mut instants {
            let Some(sent_at) = instant.sent_at.filter(|_| seen(instant.id()).is_none()) else {
                continue;
            };
            let due = self.lost_after(vehicle, sent_at);
            // A request is answered by what was asked for, and need not be listed.
            let answered = matches!(instant.kind(), "stateRequest" | "factsheetRequest") && vehicle.state_at > sent_at;
            if answered || instant.resends >= self.config.resend_limit {
                instant.resends = u32::MAX;
            } else if due > now {
                wakes.push(due);
            } else if self.allows(vehicle, Permission::TellAgain, true) {
                instant.resends += 1;
                instant.sent_at = None;
                lost.push(instant.id().to_owned());
            } else {
                instant.resends = u32::MAX;
            }
        }
        instants.retain(|instant| instant.resends < u32::MAX || is_awaited(instant));
        vehicle.instants = instants;
        for due in wakes {
            vehicle.at(due);
        }
        for id in lost {
            self.happens(vehicle, &mut Event::InstantLost(&id));
        }
    }
}

impl Vehicle {
    /// actionIds somebody waits for the end of, and takes out.
    fn awaited(&self) -> Vec<String> {
        let cancel = self.cancel.iter().map(|cancel| &cancel.action_id);
        let jobs = self.jobs.iter().map(|job| &job.action_id);
        let sets = self.zone_sets.iter().flat_map(WantedSet::awaited);
        cancel
            .chain(jobs)
            .chain(self.enabling.values())
            .chain(sets)
            .cloned()
            .collect()
    }

    /// How an instant action ended: `Some(true)` FINISHED, `Some(false)` FAILED or lost for good.
    pub(super) fn ended(&mut self, id: &str) -> Option<bool> {
        let watched = self.instants.iter().find(|instant| instant.id() == id);
        if watched.is_some_and(|instant| instant.sent_at.is_none()) {
            return None;
        }
        let end = match self.state.as_ref().and_then(|state| state.action(id)) {
            Some(action) if action.is_terminal() => Some(action.action_status == "FINISHED"),
            Some(_) => None,
            None => watched
                .is_none_or(|instant| instant.resends == u32::MAX)
                .then_some(false),
        };
        if end.is_some() {
            self.instants.retain(|instant| instant.id() != id);
        }
        end
    }
}
