//! Hibernation and shutdown: instant actions after which the vehicle says nothing for a while, or goes altogether.
//!
//! An order is cleared before the vehicle goes to sleep, as by a mode that takes none, and the state that says FINISHED
//! comes before HIBERNATING (the ruling of HIB-01). Asleep it listens for stopHibernation only. What breaks its link wakes it.

use serde_json::Value;

use tck_base::clock::Moment;

use super::Agv;
use super::action_effect::{Outcome, Problem};
use super::actions::{Action, Status};
use super::hook_points::{Event, Permission};

/// How far the vehicle is on its way to sleep, or out of the conversation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hibernation {
    /// actionId of a startHibernation that waits until nothing of the order is left.
    pub(crate) awaited: Option<String>,
    /// It falls asleep as soon as it has said so in a state.
    pub(crate) tired: bool,
    /// It sleeps.
    pub(crate) asleep: bool,
    /// When it wakes by itself.
    pub(crate) wakes_at: Option<Moment>,
    /// It has something to say although it sleeps.
    pub(crate) speaks: bool,
    /// It shuts down as soon as it has said so in a state.
    pub(crate) leaves: bool,
    /// A switch keeps it from falling asleep, and from waking.
    pub(crate) blocked: bool,
}

impl Hibernation {
    /// Awake, whatever was planned; the switch is where it was.
    pub(crate) fn ended(&self) -> Self {
        Self {
            blocked: self.blocked,
            ..Self::default()
        }
    }
}

impl Agv {
    /// Whether messages other than stopHibernation go past it (HIB-06).
    pub(crate) fn overhears(&self) -> bool {
        self.sleep.asleep || self.sleep.tired
    }

    /// Whether no state goes out (HIB-07).
    pub(crate) fn is_mute(&self) -> bool {
        self.sleep.asleep && !self.sleep.speaks && !self.allows(Permission::SpeakAsleep, false)
    }

    /// What a sleeping vehicle takes of a message: the actions that wake it.
    pub(crate) fn heard_asleep(&self, name: &str, payload: &[u8]) -> Option<Vec<u8>> {
        if !self.overhears() || self.allows(Permission::HeedAsleep, false) {
            return Some(payload.to_vec());
        }
        let mut message = serde_json::from_slice::<Value>(payload)
            .ok()
            .filter(|_| name == "instantActions")?;
        let actions = message.get_mut("actions")?.as_array_mut()?;
        actions.retain(|action| action.get("actionType").and_then(Value::as_str) == Some("stopHibernation"));
        (!actions.is_empty()).then(|| message.to_string().into_bytes())
    }

    /// startHibernation: the order is cleared first, and what cannot be broken off ends (HIB-04).
    pub(crate) fn start_hibernation(&mut self, action: &Action) -> Outcome {
        if self.allows(Permission::HeedSwitch, self.sleep.blocked) {
            return Outcome::Failed(Problem::unable(action, "a switch keeps the vehicle awake"));
        }
        let time = action.text("wakeUpTime");
        let wakes_at = match time.parse::<jiff::Timestamp>() {
            Ok(time) if time > self.now.utc => {
                let ahead = time.duration_since(self.now.utc).unsigned_abs();
                Some(self.moment() + ahead)
            }
            Ok(_) => return Outcome::Failed(Problem::unable(action, "wakeUpTime is over")),
            Err(_) if !time.is_empty() => return Outcome::Failed(Problem::unable(action, "wakeUpTime is no time")),
            Err(_) => None,
        };
        if self.allows(Permission::ClearForSleep, true) {
            self.stop_actions();
        }
        self.sleep.wakes_at = wakes_at;
        self.sleep.awaited = Some(action.id());
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.status = Status::Running;
        }
        Outcome::Open
    }

    /// Gives the order up that a startHibernation waits for, once nothing of it moves or runs.
    pub(crate) fn settle_sleep(&mut self) -> bool {
        let clears = self.allows(Permission::ClearForSleep, true);
        if clears && (self.motion.is_moving() || self.actions.order_unfinished()) {
            return false;
        }
        let Some(id) = self.sleep.awaited.take() else {
            return false;
        };
        if clears && self.is_occupied() {
            self.give_up_order();
        }
        self.finish(&id, None);
        self.sleep.tired = true;
        true
    }

    /// Falls asleep, or shuts down, once the states have said so (HIB-01, HIB-02, SHUT-02).
    pub(crate) fn settle_farewell(&mut self) {
        if self.report.delayed || !self.connection.online {
            return;
        }
        if std::mem::take(&mut self.sleep.leaves) {
            self.shut_down();
        }
        if std::mem::take(&mut self.sleep.tired) {
            self.publish_connection("HIBERNATING");
            self.sleep.asleep = true;
            self.happens(Event::FallenAsleep);
        }
        self.sleep.speaks = false;
    }

    /// Somebody at the vehicle sends it to sleep.
    pub(crate) fn falls_asleep(&mut self) {
        if self.is_occupied() {
            self.stop_actions();
            self.give_up_order();
        }
        self.sleep.tired = true;
    }

    /// stopHibernation: ONLINE, and then states (HIB-10).
    pub(crate) fn stop_hibernation(&mut self, action: &Action) -> Outcome {
        if self.allows(Permission::HeedSwitch, self.sleep.blocked) {
            self.sleep.speaks = true;
            return Outcome::Failed(Problem::unable(action, "a switch keeps the vehicle as it is"));
        }
        if let Some(id) = self.sleep.awaited.take() {
            self.end_failed(&id);
        }
        if self.sleep.asleep {
            self.wakes_up();
        } else {
            self.sleep = self.sleep.ended();
        }
        Outcome::Done(None)
    }

    /// Wakes when it was told to (HIB-09).
    pub(crate) fn wakes_in_time(&mut self) {
        if self.sleep.asleep && self.sleep.wakes_at.is_some_and(|at| at <= self.moment()) {
            self.wakes_up();
        }
    }

    /// Says that it is there again, and what there is to say.
    pub(crate) fn wakes_up(&mut self) {
        self.sleep = self.sleep.ended();
        self.publish_connection("ONLINE");
        self.start_reporting();
        self.happens(Event::Awoken);
    }

    /// shutdown: only without an order (SHUT-01).
    pub(crate) fn shutdown_asked(&mut self, action: &Action) -> Outcome {
        if self.allows(Permission::RefuseShutdown, self.is_occupied()) {
            return Outcome::Failed(Problem::unable(action, "the vehicle has an order"));
        }
        self.sleep.leaves = true;
        Outcome::Done(None)
    }
}
