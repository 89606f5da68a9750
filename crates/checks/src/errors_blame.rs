//! `errors/blame`: an error that comes with the failure of an action names that action, not another one.
//!
//! Whether there has to be an error is left to the tests.

use std::collections::{BTreeMap, BTreeSet};

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, ErrorView, Print, StateView};
use tck_world::{Listen, Observation, Topic};

/// How many actions, errors and references are looked at.
const MANY: usize = 256;

/// An error that comes with the failure of an action names that action, not another one.
pub(super) const BLAME: Check = Check {
    name: "errors/blame",
    decides: &["BP-03"],
    doc: "An error that is new in the state that first shows an action FAILED, and references a listed action, references \
          one that has FAILED, unless another new error names the failed one. Not judged when something was sent since the state before, which the error may answer.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[StateView::errors, StateView::action_states],
    start: |_| Box::new(Blame::default()),
};

#[derive(Default)]
struct Blame {
    /// Whether an order was sent since the last state.
    sent: bool,
    /// Errors of the last state.
    listed: BTreeSet<Key>,
    /// actionIds that had FAILED in the last state; `None` before the first.
    failed: Option<BTreeSet<String>>,
}

impl Running for Blame {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.sent |= record.is_to_vehicle(Topic::Order) || record.is_to_vehicle(Topic::InstantActions);
        let Some(state) = record.state() else {
            return false;
        };
        let statuses: BTreeMap<&str, &str> = state
            .all_action_states()
            .take(MANY)
            .map(|action| (action.action_id.or_empty(), action.action_status.or_empty()))
            .collect();
        let has_failed = |id: &str| statuses.get(id) == Some(&"FAILED");
        let failed: BTreeSet<String> = statuses
            .keys()
            .filter(|id| has_failed(id))
            .map(|id| id.chars().take(512).collect())
            .collect();
        let errors: Vec<&ErrorView> = state.errors.iter().take(MANY).collect();
        let before = std::mem::replace(&mut self.listed, errors.iter().map(|error| key(error)).collect());
        let known = self.failed.replace(failed);
        let sent = std::mem::take(&mut self.sent);
        let (Some(known), Some(failed)) = (known, &self.failed) else {
            return false;
        };
        let fresh: Vec<&String> = failed.iter().filter(|id| !known.contains(*id)).collect();
        let [one] = fresh[..] else {
            return false;
        };
        if sent {
            return false;
        }
        let named = |error: &ErrorView| -> Vec<String> {
            let references = error.error_references.iter().take(MANY);
            references
                .filter(|reference| reference.key.is(ActionState::action_id.usual_name()))
                .map(|reference| reference.value.or_empty().to_owned())
                .collect()
        };
        let fresh: Vec<Vec<String>> = errors
            .iter()
            .filter(|error| !before.contains(&key(error)))
            .map(|error| named(error))
            .collect();
        // Where the action has its error, another one may announce what has not FAILED yet.
        if fresh.iter().any(|named| named.contains(one)) {
            return true;
        }
        let mut judged = false;
        for named in &fresh {
            let others = named
                .iter()
                .all(|id| statuses.contains_key(id.as_str()) && !has_failed(id));
            if let Some(other) = named.first().filter(|_| others) {
                let text = format!(
                    "with the failure of action {} comes an error about action {}, which has not failed",
                    quote(one),
                    quote(other)
                );
                findings.push(broken("BP-03", record.seq(), text));
                judged = true;
            }
        }
        judged
    }
}

/// Type and references of an error: by these it is known again.
type Key = (String, Vec<Print>);

fn key(error: &ErrorView) -> Key {
    let references = error.error_references.iter().take(MANY);
    let references = references.map(|reference| reference.print).collect();
    (error.error_type.or_empty().to_owned(), references)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::Trace;

    fn judge(blamed: &[&str], sent: bool) -> Vec<String> {
        let mut trace = Trace::subscriber();
        let actions = |status: &str| {
            json!([
                { "actionId": "a", "actionType": "beep", "actionStatus": "FINISHED" },
                { "actionId": "b", "actionType": "pick", "actionStatus": status },
            ])
        };
        trace.state(&json!({ "actionStates": actions("RUNNING") }));
        if sent {
            trace.instant("stateRequest", "x", &json!([]));
        }
        let error = |blamed: &&str| {
            json!({ "errorType": "pickError", "errorLevel": "WARNING",
                "errorReferences": [{ "referenceKey": "actionId", "referenceValue": blamed }] })
        };
        let errors: Vec<_> = blamed.iter().map(error).collect();
        trace.state(&json!({ "actionStates": actions("FAILED"), "errors": errors }));
        trace.judge("errors/blame").summary()
    }

    #[test]
    fn the_error_names_the_action_that_failed() {
        assert!(judge(&["b"], false).is_empty());
        assert!(judge(&["z"], false).is_empty(), "something else has gone wrong");
        assert!(judge(&["a"], true).is_empty(), "it may answer what was sent");
        assert!(judge(&["a", "b"], false).is_empty(), "the other one may fail next");
        assert_eq!(judge(&["a"], false), ["BP-03"]);
    }
}
