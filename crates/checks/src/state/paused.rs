//! `state/paused-actions`: an action is PAUSED only while something holds the vehicle.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use crate::finding::{broken, quote};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{SafetyState, StateView};
use tck_world::{Listen, Observation, Topic};

/// How many actions are looked at.
const ACTIONS: usize = 256;
/// How long what was held may take to go on.
const GOING_ON: Duration = Duration::from_secs(2);

/// An action is PAUSED only while something holds the vehicle.
pub(crate) const PAUSED: Check = Check {
    name: "state/paused-actions",
    decides: &["ASTATE-04"],
    doc: "An action is PAUSED only while the state says why: paused, a field violation, an emergency stop, a mode in \
          which master control is not in command, or a fatal error. Judged when states show it without any of these for \
          longer than two seconds: what was held goes on in its own time. Only on vehicles that report `paused`.",
    arguments: &[],
    listens: &[Listen::Hook, Listen::Answer, Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[
        StateView::paused,
        StateView::action_states,
        StateView::safety_state,
        SafetyState::emergency_stop,
        SafetyState::field_violation,
    ],
    start: |_| Box::new(PausedActions::default()),
};

#[derive(Default)]
struct PausedActions {
    /// Actions the last state showed PAUSED without a reason, and since when.
    before: BTreeMap<String, Moment>,
    accused: BTreeSet<String>,
}

/// Whether something in the state may hold actions.
fn is_held(state: &StateView) -> bool {
    !state.paused.is(false)
        || state.field_violation() != Some(false)
        || state.emergency_stop() != Some("NONE")
        || !matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC")
        || state.errors.iter().any(|error| !error.error_level.is("WARNING"))
}

impl Running for PausedActions {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if record.outside_influence() {
            self.before.clear();
        }
        let Some(state) = record.state() else {
            return false;
        };
        let before = std::mem::take(&mut self.before);
        let listed = state.all_action_states().take(ACTIONS);
        let paused: Vec<&str> = listed
            .filter(|action| action.action_status.is("PAUSED"))
            .map(|action| action.action_id.or_empty())
            .collect();
        if is_held(state) {
            return !paused.is_empty() && !state.paused.is_absent();
        }
        let now = record.at().moment;
        for id in paused {
            let since = before.get(id).copied().unwrap_or(now);
            if now.since(since) > GOING_ON && self.accused.len() < ACTIONS && self.accused.insert(id.to_owned()) {
                let text = format!("action {} stays PAUSED, and nothing holds the vehicle", quote(id));
                findings.push(broken("ASTATE-04", record.seq(), text));
            }
            self.before.insert(id.chars().take(512).collect(), since);
        }
        !self.before.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::{Trace, merged};

    fn judge(states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for state in states {
            let with = json!({ "paused": false, "actionStates": [{ "actionId": "a", "actionStatus": "PAUSED" }] });
            trace.state(&merged(with, state)).wait(3.0);
        }
        trace.judge("state/paused-actions").summary()
    }

    #[test]
    fn a_reason_in_the_state_is_enough() {
        for reason in [
            json!({ "paused": true }),
            json!({ "paused": null }),
            json!({ "safetyState": { "fieldViolation": true } }),
            json!({ "safetyState": { "eStop": "MANUAL" } }),
            json!({ "operatingMode": "MANUAL" }),
            json!({ "errors": [{ "errorType": "x", "errorLevel": "FATAL" }] }),
        ] {
            assert!(judge(&[reason.clone(), reason.clone()]).is_empty(), "{reason}");
        }
    }

    #[test]
    fn a_flag_may_come_one_state_late() {
        assert!(judge(&[json!({}), json!({ "paused": true })]).is_empty());
        assert!(judge(&[json!({ "paused": true }), json!({}), json!({ "actionStates": [] })]).is_empty());
    }

    #[test]
    fn what_was_held_may_take_a_moment_to_go_on() {
        let mut trace = Trace::subscriber();
        let held = json!({ "paused": false, "actionStates": [{ "actionId": "a", "actionStatus": "PAUSED" }] });
        for _ in 0..3 {
            trace.state(&held).wait(0.2);
        }
        trace.state(&json!({ "paused": false, "actionStates": [{ "actionId": "a", "actionStatus": "RUNNING" }] }));
        assert!(trace.judge("state/paused-actions").findings.is_empty());
    }

    #[test]
    fn paused_without_a_reason_is_found_once() {
        assert_eq!(judge(&[json!({}), json!({}), json!({})]), ["ASTATE-04"]);
    }
}
