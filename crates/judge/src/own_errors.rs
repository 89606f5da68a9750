//! What the vehicle itself says is wrong: the errors of its states.

use serde_json::Value;

use super::timeline::Timeline;
use tck_journal::OwnError;

/// How many states are looked through for a new error.
const STATES: usize = 200;

/// The errors a vehicle reports since a message was sent to it, those it did not report before if there are any.
pub(super) fn reported(timeline: &Timeline, since: u64) -> Vec<OwnError> {
    let new = added(timeline, since);
    if !new.is_empty() {
        return named(&new);
    }
    let states = timeline.of("state");
    let state = states.last().and_then(|entry| entry.json());
    state.map_or_else(Vec::new, |state| named(errors(state)))
}

/// Whether the vehicle says by a new error that it did not take what was sent to it. Errors about anything else do not
/// say so.
pub(super) fn is_refused(timeline: &Timeline, since: u64) -> bool {
    added(timeline, since).iter().any(|error| {
        let kind = error.get("errorType").and_then(Value::as_str).unwrap_or_default();
        let kind = kind.to_ascii_lowercase();
        kind.contains("order") || kind.contains("validation")
    })
}

/// The errors of the first state with more of them than there were before.
fn added(timeline: &Timeline, since: u64) -> Vec<Value> {
    let before = timeline.baseline("state", since);
    let before = before.as_ref().map_or(&[][..], errors);
    let states = timeline.since("state", since).iter().take(STATES);
    let new = states.filter_map(|entry| {
        let mut known = before.to_vec();
        let mut new = Vec::new();
        for error in errors(entry.json()?) {
            match known.iter().position(|one| one == error) {
                Some(at) => drop(known.swap_remove(at)),
                None => new.push(error.clone()),
            }
        }
        (!new.is_empty()).then_some(new)
    });
    new.into_iter().next().unwrap_or_default()
}

fn errors(state: &Value) -> &[Value] {
    state
        .get("errors")
        .and_then(Value::as_array)
        .map_or(&[][..], Vec::as_slice)
}

/// The first errors by level and type, with what they refer to.
fn named(errors: &[Value]) -> Vec<OwnError> {
    let text = |value: &Value, name: &str| -> String {
        let found = value.get(name).and_then(Value::as_str).unwrap_or_default();
        found.chars().take(60).collect()
    };
    let one = |error: &Value| {
        let references = error.get("errorReferences").and_then(Value::as_array);
        let references = references.into_iter().flatten().take(3).map(|reference| {
            let (key, value) = (text(reference, "referenceKey"), text(reference, "referenceValue"));
            format!("{key} {value}")
        });
        OwnError {
            error: format!("{} {}", text(error, "errorLevel"), text(error, "errorType")),
            references: references.collect(),
        }
    };
    errors.iter().take(2).map(one).collect()
}
