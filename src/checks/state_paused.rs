//! `state/paused-actions`: an action is PAUSED only while something holds the vehicle.

use std::collections::BTreeSet;

use serde_json::Value;

use super::traffic::{Traffic, broken, elements, outside_influence, quote, state, text};
use super::{Check, CheckContext, CheckFinding, Running};
use crate::journal::Entry;

/// How many actions are looked at.
const ACTIONS: usize = 256;

/// See the module.
pub(super) const PAUSED: Check = Check {
    name: "state/paused-actions",
    decides: &["ASTATE-04"],
    doc: "An action is PAUSED only while the state says why: paused, a field violation, an emergency stop, a mode in \
          which master control is not in command, or a fatal error. Judged when two states in a row show it without \
          any of these, since a button and a flag may be read at slightly different times, and only on vehicles that \
          report `paused`.",
    arguments: &[],
    start: |_| Box::new(PausedActions::default()),
};

#[derive(Default)]
struct PausedActions {
    traffic: Traffic,
    /// Actions the last state showed PAUSED without a reason.
    before: BTreeSet<String>,
    accused: BTreeSet<String>,
}

/// Whether something in the state may hold actions.
fn is_held(state: &Value) -> bool {
    let safety = |name: &str| state.get("safetyState").and_then(|safety| safety.get(name));
    state.get("paused") != Some(&Value::Bool(false))
        || safety("fieldViolation") != Some(&Value::Bool(false))
        || safety("eStop").and_then(Value::as_str) != Some("NONE")
        || !matches!(text(state, "operatingMode"), "AUTOMATIC" | "SEMIAUTOMATIC")
        || elements(state, "errors").any(|error| text(error, "errorLevel") != "WARNING")
}

impl Running for PausedActions {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        if outside_influence(entry) {
            self.before.clear();
        }
        let Some(state) = state(self.traffic, entry, context) else {
            return false;
        };
        let before = std::mem::take(&mut self.before);
        let listed = elements(state, "actionStates").take(ACTIONS);
        let paused: Vec<&str> = listed
            .filter(|action| text(action, "actionStatus") == "PAUSED")
            .map(|action| text(action, "actionId"))
            .collect();
        if is_held(state) {
            return !paused.is_empty() && state.get("paused").is_some();
        }
        for id in paused {
            if before.contains(id) && self.accused.len() < ACTIONS && self.accused.insert(id.to_owned()) {
                let text = format!("action {} stays PAUSED, and nothing holds the vehicle", quote(id));
                findings.push(broken("ASTATE-04", entry.seq(), text));
            }
            self.before.insert(id.chars().take(512).collect());
        }
        !self.before.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::{Trace, merged};

    fn judge(states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for state in states {
            let with = json!({ "paused": false, "actionStates": [{ "actionId": "a", "actionStatus": "PAUSED" }] });
            trace.state(&merged(with, state));
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
    fn paused_without_a_reason_is_found_once() {
        assert_eq!(judge(&[json!({}), json!({}), json!({})]), ["ASTATE-04"]);
    }
}
