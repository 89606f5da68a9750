//! `errors/on-event`: an error is published when it occurs, not when the clock says so.
//!
//! Whether something had to be an error is left to the tests: a vehicle that takes over what it should refuse has none.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::finding::{broken, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ErrorView, Print, StateView};
use tck_world::{Listen, Observation, Seen, Topic};

/// How many errors of a state, and texts of what was sent, are looked at.
const MANY: usize = 256;

/// An error is published when it occurs, not when the clock says so.
pub(super) const ON_EVENT: Check = Check {
    name: "errors/on-event",
    decides: &["STATE-05"],
    doc: "The first new error that answers what was sent, by its type or by naming it, is in a state within time.event; \
          up to time.eventWarning is a warning. Without such an error nothing is judged.",
    arguments: &[],
    listens: &[Listen::AnySent, Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::errors],
    start: |_| Box::new(OnEvent::default()),
};

#[derive(Default)]
struct OnEvent {
    /// When the last message was sent, and the texts in it.
    stimulus: Option<(Moment, BTreeSet<String>)>,
    /// Errors of the last state before it, and of the last state: type, level, references.
    before: Vec<Key>,
    latest: Vec<Key>,
    judged: bool,
}

/// Type, level and references of an error: by these it is known again.
type Key = (String, String, Vec<Print>);

fn key(error: &ErrorView) -> Key {
    (
        error.error_type.or_empty().to_owned(),
        error.error_level.or_empty().to_owned(),
        error.error_references.iter().map(|reference| reference.print).collect(),
    )
}

fn texts(value: &Value, told: &mut BTreeSet<String>) {
    match value {
        Value::String(text) if told.len() < MANY && text.len() <= 512 => {
            told.insert(text.clone());
        }
        Value::Array(items) => items.iter().for_each(|item| texts(item, told)),
        Value::Object(members) => members.values().for_each(|member| texts(member, told)),
        _ => {}
    }
}

/// Whether the protocol has this error for what a message may be refused for.
fn is_refusal(kind: &str, context: &CheckContext<'_>) -> bool {
    let errors = context.pack.vocabulary().get("error").and_then(Value::as_object);
    errors
        .into_iter()
        .flatten()
        .any(|(_, name)| name.as_str() == Some(kind))
}

impl Running for OnEvent {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if record.seen == Some(Seen::Sent) && record.topic().is_some() {
            let mut sent = BTreeSet::new();
            if let Some(message) = record.json() {
                texts(message, &mut sent);
            }
            self.stimulus = Some((record.at().moment, sent));
            self.before.clone_from(&self.latest);
            self.judged = false;
        }
        let Some(state) = record.state() else {
            return false;
        };
        let errors: Vec<&ErrorView> = state.errors.iter().take(MANY).collect();
        self.latest = errors.iter().copied().map(key).collect();
        let Some((since, sent)) = self.stimulus.as_ref().filter(|_| !self.judged) else {
            return false;
        };
        let answers = |error: &&&ErrorView| {
            let mut named = error
                .error_references
                .iter()
                .map(|reference| reference.value.or_empty());
            is_refusal(error.error_type.or_empty(), context) || named.any(|named| sent.contains(named))
        };
        let mut new = errors.iter().filter(|error| !self.before.contains(&key(error)));
        if !new.any(|error| answers(&error)) {
            return false;
        }
        self.judged = true;
        let took = record.at().moment.since(*since);
        let soft = context.time.event;
        let hard = context.time.event_warning.max(soft);
        let text = format!(
            "the error is published {:.1} s after what caused it",
            took.as_secs_f64()
        );
        if took > hard {
            findings.push(broken("STATE-05", record.seq(), text));
        } else if took > soft {
            findings.push(remark("STATE-05", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::{Outcome, Trace};

    fn judge(seconds: f64, errors: &Value) -> Outcome {
        let mut trace = Trace::subscriber();
        trace.state(&json!({})).sent("order", &json!({ "orderId": "o" }));
        trace
            .wait(seconds)
            .state(&json!({ "errors": errors }))
            .wait(30.0)
            .state(&json!({ "errors": errors }));
        trace.judge("errors/on-event")
    }

    fn error(kind: &str, named: &str) -> Value {
        json!([{ "errorType": kind, "errorLevel": "WARNING",
            "errorReferences": [{ "referenceKey": "orderId", "referenceValue": named }] }])
    }

    #[test]
    fn an_error_that_comes_at_once_is_right_and_one_that_waits_for_the_clock_is_found() {
        let answer = error("vendorOrderRefused", "o");
        assert!(judge(0.2, &answer).findings.is_empty());
        assert_eq!(judge(0.2, &answer).judged, 1);
        assert_eq!(judge(20.0, &answer).summary(), ["STATE-05"]);
    }

    #[test]
    fn a_vehicle_without_an_error_or_with_one_of_its_own_owes_nothing() {
        for errors in [json!([]), error("maintenanceDue", "brush")] {
            let outcome = judge(20.0, &errors);
            assert!(outcome.findings.is_empty() && outcome.judged == 0);
        }
    }
}
