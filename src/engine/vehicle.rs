//! What the last messages say about the vehicle: enough to spare it a postamble it does not need.

use std::sync::Arc;

use serde_json::Value;

use crate::journal::Entry;
use crate::journal::event::Event;
use crate::judge::RunJudge;

/// Whether the last state shows no order and no motion.
#[must_use]
pub fn is_idle(judge: &RunJudge) -> bool {
    last_state(judge)
        .and_then(|entry| entry.json())
        .is_none_or(is_without_order)
}

/// Whether a state that came after this journal number shows no order, no motion, and no action under way.
#[must_use]
pub fn is_idle_since(judge: &RunJudge, seq: u64) -> bool {
    let Some(entry) = last_state(judge).filter(|entry| entry.seq() > seq) else {
        return false;
    };
    let Some(state) = entry.json() else { return false };
    let actions = state.get("actionStates").and_then(Value::as_array);
    let is_over = |action: &Value| {
        let status = action.get("actionStatus").and_then(Value::as_str);
        matches!(status, Some("FINISHED" | "FAILED"))
    };
    is_without_order(state) && actions.is_some_and(|actions| actions.iter().all(is_over))
}

/// Whether a mock AGV has done everything it was sent: it is idle, no action is under way, and its last state is about
/// the last order.
#[must_use]
pub fn has_nothing_to_do(judge: &RunJudge) -> bool {
    let Some(order) = judge.timeline().of("order").last() else {
        return is_idle(judge);
    };
    let Some(state) = last_state(judge) else { return false };
    let same =
        |name: &str| order.json().and_then(|order| order.get(name)) == state.json().and_then(|state| state.get(name));
    is_idle_since(judge, order.seq()) && same("orderId") && same("orderUpdateId")
}

/// Whether any connection of the device that the tap has seen is open. A master control may have one for each vehicle.
#[must_use]
pub fn has_any_open_connection(judge: &RunJudge) -> bool {
    let timeline = judge.timeline();
    let closed: std::collections::BTreeSet<u64> = timeline.of("mqtt/closed").iter().filter_map(number).collect();
    let mut opened = timeline.of("mqtt/connect").iter().filter_map(number);
    opened.any(|connection| !closed.contains(&connection))
}

/// Whether the newest connection of the device that the tap has seen is open.
#[must_use]
pub fn has_open_connection(judge: &RunJudge) -> bool {
    let timeline = judge.timeline();
    let last = timeline.of("mqtt/connect").last().and_then(number);
    let is_closed = |connection| {
        timeline
            .of("mqtt/closed")
            .iter()
            .any(|entry| number(entry) == Some(connection))
    };
    last.is_some_and(|connection| !is_closed(connection))
}

/// The number of the connection an entry is about.
fn number(entry: &Arc<Entry>) -> Option<u64> {
    match entry.event() {
        Event::Packet { connection, .. } | Event::Closed { connection, .. } => Some(*connection),
        _ => None,
    }
}

fn last_state(judge: &RunJudge) -> Option<&Arc<Entry>> {
    judge.timeline().of("state").last()
}

fn is_without_order(state: &Value) -> bool {
    let is_empty = |name: &str| state.get(name).and_then(Value::as_array).is_none_or(Vec::is_empty);
    let is_driving = state.get("driving").and_then(Value::as_bool).unwrap_or(false);
    is_empty("nodeStates") && is_empty("edgeStates") && !is_driving
}
