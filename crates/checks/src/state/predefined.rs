//! `state/described-statuses`, `state/described-results`: predefined actions and described results in `actionStates`.
//!
//! Which status may follow which is left to `state_actions`; what an action has to achieve is left to the tests.

use std::collections::BTreeSet;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, MessageView, StateView};
use tck_world::{Listen, Observation, Seen, Topic};

/// How many actions of a message are looked at.
const ACTIONS: usize = 4096;
/// How many types of actions are kept in mind.
const TYPES: usize = 512;

/// `state/described-statuses`.
pub(crate) const STATUSES: Check = Check {
    name: "state/described-statuses",
    decides: &["ACT-41"],
    doc: "A predefined action shows only the statuses that the text describes for it. WAITING and FAILED are always \
          fine, and PAUSED is while something holds the vehicle.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::action_states, ActionState::action_type],
    start: |_| Box::new(Statuses::default()),
};

/// `state/described-results`.
pub(crate) const RESULTS: Check = Check {
    name: "state/described-results",
    decides: &["STATE-MSG-12"],
    doc: "An action whose result the factsheet describes is reported FINISHED with a resultDescription; a missing one \
          is a warning.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[StateView::action_states, ActionState::result_description],
    start: |_| Box::new(Results::default()),
};

#[derive(Default)]
struct Statuses {
    /// Type and status of what was found.
    reported: BTreeSet<(String, String)>,
}

impl Running for Statuses {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = record.state() else {
            return false;
        };
        let held = is_held(state);
        let predefined = context.pack.vocabulary().get("action");
        let mut judged = false;
        for action in state.all_action_states().take(ACTIONS) {
            let (kind, status) = (action.action_type.or_empty(), action.action_status.or_empty());
            let described = predefined.and_then(|all| all.get(kind)?.get("statuses")?.as_array());
            let Some(described) = described else { continue };
            judged = true;
            let exempt = matches!(status, "WAITING" | "FAILED") || (status == "PAUSED" && held);
            // A status that does not exist is another check's business.
            let exists = matches!(status, "INITIALIZING" | "RUNNING" | "PAUSED" | "FINISHED");
            if exempt || !exists || described.iter().any(|known| known == status) {
                continue;
            }
            if self.reported.insert((kind.to_owned(), status.to_owned())) {
                let text = format!("{kind} is {status}, which the text does not describe for it");
                findings.push(broken("ACT-41", record.seq(), text));
            }
        }
        judged
    }
}

/// Whether a pause, the protective field or the emergency stop holds the vehicle.
fn is_held(state: &StateView) -> bool {
    let stop = state.emergency_stop().unwrap_or_default();
    state.paused.is(true) || state.field_violation() == Some(true) || !matches!(stop, "" | "NONE")
}

#[derive(Default)]
struct Results {
    /// Types whose result the factsheet describes.
    described: BTreeSet<String>,
    reported: BTreeSet<String>,
}

impl Results {
    /// Takes over what a factsheet describes, however old it is.
    fn learn(&mut self, record: &Observation<'_>) {
        let is_factsheet = |seen| record.is(seen, Topic::Factsheet);
        if !is_factsheet(Seen::Delivered) && !is_factsheet(Seen::Stored) {
            return;
        }
        let sheet = record.message().and_then(MessageView::factsheet);
        let actions = sheet.into_iter().flat_map(|sheet| sheet.offered_actions());
        let described = actions.filter(|action| !action.result_description.or_empty().trim().is_empty());
        self.described = described
            .take(TYPES)
            .map(|action| action.action_type.or_empty().to_owned())
            .collect();
    }
}

impl Running for Results {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.learn(record);
        let Some(state) = record.state() else {
            return false;
        };
        let mut judged = false;
        for action in state.all_action_states().take(ACTIONS) {
            let kind = action.action_type.or_empty();
            if !action.action_status.is("FINISHED") || !self.described.contains(kind) {
                continue;
            }
            judged = true;
            if action.result_description.or_empty().is_empty() && self.reported.insert(kind.to_owned()) {
                let text = format!("{} is FINISHED without the result its factsheet describes", quote(kind));
                findings.push(remark("STATE-MSG-12", record.seq(), text));
            }
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn action(kind: &str, status: &str) -> Value {
        json!({ "actionId": "x", "actionType": kind, "actionStatus": status })
    }

    fn judged(states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for state in states {
            trace.state(state);
        }
        trace.judge("state/described-statuses").summary()
    }

    #[test]
    fn described_statuses_and_those_of_other_actions_are_right() {
        let pick = ["WAITING", "INITIALIZING", "RUNNING", "PAUSED", "FINISHED", "FAILED"].map(|s| action("pick", s));
        assert!(judged(&pick.map(|action| json!({ "actionStates": [action] }))).is_empty());
        for (kind, status) in [
            ("cancelOrder", "FAILED"),
            ("stateRequest", "WAITING"),
            ("polish", "INITIALIZING"),
            ("startPause", "RUNNING"),
            ("startPause", "DONE"),
        ] {
            assert!(
                judged(&[json!({ "actionStates": [action(kind, status)] })]).is_empty(),
                "{kind}"
            );
        }
    }

    #[test]
    fn an_undescribed_status_is_found_once() {
        let odd = json!({ "actionStates": [action("startPause", "INITIALIZING")] });
        assert_eq!(judged(&[odd.clone(), odd]), ["ACT-41"]);
    }

    #[test]
    fn a_held_vehicle_may_pause_whatever_it_does() {
        let paused = |over: Value| {
            let mut state = json!({ "actionStates": [action("detectObject", "PAUSED")] });
            json_patch::merge(&mut state, &over);
            judged(&[state])
        };
        assert_eq!(paused(json!({})), ["ACT-41"]);
        assert!(paused(json!({ "paused": true })).is_empty());
        assert!(paused(json!({ "safetyState": { "fieldViolation": true } })).is_empty());
        assert!(paused(json!({ "safetyState": { "eStop": "MANUAL" } })).is_empty());
    }

    #[test]
    fn a_described_result_has_to_come_with_finished() {
        let factsheet = json!({ "protocolFeatures": { "agvActions": [
            { "actionType": "logReport", "resultDescription": "Name of the log" }, { "actionType": "pick" },
        ] } });
        let result = |kind: &str, status: &str, result: Option<&str>| {
            let mut action = action(kind, status);
            if let Some(result) = result {
                action["resultDescription"] = result.into();
            }
            let mut trace = Trace::subscriber();
            trace.message("factsheet", &factsheet);
            trace.state(&json!({ "actionStates": [action] }));
            trace.judge("state/described-results").summary()
        };
        assert!(result("logReport", "FINISHED", Some("log-1")).is_empty());
        assert!(result("logReport", "RUNNING", None).is_empty());
        assert!(result("logReport", "FAILED", None).is_empty());
        assert!(result("pick", "FINISHED", None).is_empty());
        assert_eq!(result("logReport", "FINISHED", None), ["STATE-MSG-12 warning"]);
        assert_eq!(result("logReport", "FINISHED", Some("")), ["STATE-MSG-12 warning"]);
    }
}
