//! What the vehicle itself says is wrong: the errors of its states.

use std::sync::Arc;

use super::timeline::Timeline;
use tck_journal::OwnError;
use tck_view::{ErrorView, Member, Print, StateView, Text};

/// How many states are looked through for a new error.
const STATES: usize = 200;

/// The errors a vehicle reports since a message was sent to it, those it did not report before if there are any.
pub(super) fn reported(timeline: &Timeline, since: u64) -> Vec<OwnError> {
    let new = added(timeline, since);
    if !new.is_empty() {
        return named(new);
    }
    let state = timeline.of("state").last().and_then(|entry| timeline.state(entry));
    named(errors(state))
}

/// Whether the vehicle says by a new error that it did not take what was sent to it. Errors about anything else do not
/// say so.
pub(super) fn is_refused(timeline: &Timeline, since: u64) -> bool {
    added(timeline, since).iter().any(|error| {
        let kind = error.error_type.or_empty().to_ascii_lowercase();
        kind.contains("order") || kind.contains("validation")
    })
}

/// The errors of the first state with more of them than there were before.
fn added(timeline: &Timeline, since: u64) -> Vec<&ErrorView> {
    let before = timeline.before("state", since).and_then(|entry| timeline.state(entry));
    let before: Vec<Print> = errors(before).map(|error| error.print).collect();
    let states = timeline.since("state", since).iter().take(STATES);
    let new = states.filter_map(|entry| {
        let mut known = before.clone();
        let mut new = Vec::new();
        for error in errors(timeline.state(entry)) {
            match known.iter().position(|one| *one == error.print) {
                Some(at) => drop(known.swap_remove(at)),
                None => new.push(error),
            }
        }
        (!new.is_empty()).then_some(new)
    });
    new.into_iter().next().unwrap_or_default()
}

fn errors(state: Option<&Arc<StateView>>) -> impl Iterator<Item = &ErrorView> {
    state.into_iter().flat_map(|state| &state.errors)
}

/// The first errors by level and type, with what they refer to.
fn named<'e>(errors: impl IntoIterator<Item = &'e ErrorView>) -> Vec<OwnError> {
    let text = |member: &Member<Text>| -> String { member.or_empty().chars().take(60).collect() };
    let one = |error: &ErrorView| {
        let references = error.error_references.iter().take(3);
        let references = references.map(|reference| format!("{} {}", text(&reference.key), text(&reference.value)));
        OwnError {
            error: format!("{} {}", text(&error.error_level), text(&error.error_type)),
            references: references.collect(),
        }
    };
    errors.into_iter().take(2).map(one).collect()
}
