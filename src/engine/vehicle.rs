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

/// Whether the newest connection of the device that the tap has seen is open.
#[must_use]
pub fn has_open_connection(judge: &RunJudge) -> bool {
    let number = |entry: &Arc<Entry>| match entry.event() {
        Event::Packet { connection, .. } | Event::Closed { connection, .. } => Some(*connection),
        _ => None,
    };
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

fn last_state(judge: &RunJudge) -> Option<&Arc<Entry>> {
    judge.timeline().of("state").last()
}

fn is_without_order(state: &Value) -> bool {
    let is_empty = |name: &str| state.get(name).and_then(Value::as_array).is_none_or(Vec::is_empty);
    let is_driving = state.get("driving").and_then(Value::as_bool).unwrap_or(false);
    is_empty("nodeStates") && is_empty("edgeStates") && !is_driving
}
