//! What the last messages say about the vehicle: enough to spare it a postamble it does not need.

use std::sync::Arc;

use tck_journal::Entry;
use tck_judge::{RunJudge, client_of, number_of};
use tck_view::Topic;
use tck_world::rest;

/// Whether the last state of the present connection shows no order and no motion. A device that never sent a state has
/// shown no order either.
#[must_use]
pub fn is_idle(judge: &RunJudge) -> bool {
    match judge.state() {
        Some(state) => rest::is_idle(&state),
        None => last_state(judge).is_none_or(|entry| entry.json().is_none()),
    }
}

/// Whether a state that came after this journal number shows no order, no motion, and no action under way.
#[must_use]
pub fn is_idle_since(judge: &RunJudge, seq: u64) -> bool {
    if last_state(judge).is_none_or(|entry| entry.seq() <= seq) {
        return false;
    }
    let Some(state) = judge.state() else { return false };
    let has_done_all = state.action_states.is_there() && rest::open_actions(&state).next().is_none();
    rest::is_idle(&state) && has_done_all
}

/// Whether a mock AGV has done everything it was sent: it is idle, no action is under way, and its last state is about
/// the last order.
#[must_use]
pub fn has_nothing_to_do(judge: &RunJudge) -> bool {
    let Some(order) = judge.timeline().of("order").last() else {
        return is_idle(judge);
    };
    let Some(state) = last_state(judge) else { return false };
    let timeline = judge.timeline();
    let sent = timeline.view(order, Topic::Order).and_then(|message| message.order());
    let shown = timeline.state(state);
    let same = sent.zip(shown).is_some_and(|(sent, shown)| {
        (&sent.order_id, &sent.order_update_id) == (&shown.order_id, &shown.order_update_id)
    });
    is_idle_since(judge, order.seq()) && same
}

/// Whether any connection of the device that the tap has seen is open. A master control may have one for each vehicle.
#[must_use]
pub fn has_any_open_connection(judge: &RunJudge) -> bool {
    let timeline = judge.timeline();
    let closed: std::collections::BTreeSet<u64> = timeline
        .of("mqtt/closed")
        .iter()
        .filter_map(|entry| number_of(entry))
        .collect();
    let mut opened = timeline.of("mqtt/connect").iter().filter_map(|entry| number_of(entry));
    opened.any(|connection| !closed.contains(&connection))
}

/// Whether the client that publishes the states is connected, as the tap has seen it. A second client of the device that
/// stays connected is not the device; one that connects after the first has gone may be it.
#[must_use]
pub fn has_open_connection(judge: &RunJudge) -> bool {
    let timeline = judge.timeline();
    let closed = |connection: u64| {
        let mut all = timeline.of("mqtt/closed").iter();
        all.find(|entry| number_of(entry) == Some(connection))
            .map(|entry| entry.seq())
    };
    let connects = timeline.of("mqtt/connect");
    let is_open = |entry: &&Arc<Entry>| number_of(entry).is_some_and(|connection| closed(connection).is_none());
    let Some(publishing) = timeline.publishing() else {
        return connects.iter().any(|entry| is_open(&entry));
    };
    let Some(gone) = closed(publishing) else { return true };
    let client = connects.iter().find(|entry| number_of(entry) == Some(publishing));
    let client = client.and_then(|entry| client_of(entry));
    let mut open = connects.iter().rev().filter(is_open);
    open.any(|entry| entry.seq() > gone || client.is_some_and(|client| client_of(entry) == Some(client)))
}

fn last_state(judge: &RunJudge) -> Option<&Arc<Entry>> {
    judge.timeline().of("state").last()
}
