//! Triggers: what ends a waitForTrigger, by hand or by an instant action (sections 6.8.1 and 6.2.3.1).
//!
//! A trigger of the fleet control names no action and so serves all that wait for it (the ruling of TRIG-01).

use serde_json::Value;

use super::Agv;
use super::action_effect::{Outcome, Problem};
use super::action_kinds::Effect;
use super::actions::{Action, Status};
use super::hook_points::Permission;

/// The trigger that a fleet control gives.
const BY_FLEET: &str = "FLEET_CONTROL";
/// The trigger that somebody gives at the vehicle.
const BY_HAND: &str = "LOCAL";

impl Agv {
    /// The button that waitForTrigger waits for; it serves all of them unless one is named.
    pub(crate) fn trigger(&mut self, wanted: &str) {
        for id in self.waiting_for(BY_HAND, wanted) {
            self.complete(&id);
        }
    }

    /// The instant action trigger: what waits for the fleet control goes on (TRIG-01), or it fails (TRIG-02).
    pub(crate) fn trigger_by_fleet(&mut self, action: &Action) -> Outcome {
        let ids = self.waiting_for(BY_FLEET, "");
        if ids.is_empty() {
            return Outcome::Failed(Problem::unable(action, "no action waits for a trigger"));
        }
        for id in &ids {
            self.complete(id);
        }
        Outcome::Done(None)
    }

    /// Ids of the actions that wait for such a trigger.
    fn waiting_for(&self, trigger: &str, wanted: &str) -> Vec<String> {
        let waits = |action: &&Action| {
            (wanted.is_empty() || action.request.id == wanted)
                && action.status == Status::Running
                && action.kind.is_some_and(|kind| kind.effect == Effect::WaitForTrigger)
                && self.allows(Permission::HeedTrigger(action), self.awaits(action, trigger))
        };
        self.actions.iter().filter(waits).map(Action::id).collect()
    }

    /// Whether an action waits for such a trigger; where the version does not tell them apart, for any.
    fn awaits(&self, action: &Action, trigger: &str) -> bool {
        let named = action.request.parameter("triggerType").and_then(Value::as_array);
        !self.config.has("triggers") || named.is_some_and(|named| named.iter().any(|name| name == trigger))
    }
}
