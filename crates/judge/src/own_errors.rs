//! What the vehicle itself says is wrong: the errors of its states.

use serde_json::Value;

use super::timeline::Timeline;

/// How many states are looked through for a new error.
const STATES: usize = 200;

/// The errors a vehicle reports since a message was sent to it, first those it did not report before; `None` if there are
/// no errors at all.
pub(super) fn reported(timeline: &Timeline, since: u64) -> Option<String> {
    let new = added(timeline, since);
    if !new.is_empty() {
        return Some(in_words(&new));
    }
    let state = timeline.of("state").last()?.json()?;
    let all: Vec<Value> = errors(state).to_vec();
    (!all.is_empty()).then(|| in_words(&all))
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

fn in_words(errors: &[Value]) -> String {
    let text = |value: &Value, name: &str| -> String {
        let found = value.get(name).and_then(Value::as_str).unwrap_or_default();
        found.chars().take(60).collect()
    };
    let one = |error: &Value| {
        let references = error.get("errorReferences").and_then(Value::as_array);
        let named: Vec<String> = references
            .into_iter()
            .flatten()
            .take(3)
            .map(|reference| {
                format!(
                    "{} {}",
                    text(reference, "referenceKey"),
                    text(reference, "referenceValue")
                )
            })
            .collect();
        let named = if named.is_empty() {
            String::new()
        } else {
            format!(" ({})", named.join(", "))
        };
        format!("{} {}{named}", text(error, "errorLevel"), text(error, "errorType"))
    };
    let all: Vec<String> = errors.iter().take(2).map(one).collect();
    format!("the vehicle itself reports {}", all.join(" and "))
}
