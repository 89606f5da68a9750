//! A message on its way through, and what it says of itself.

use std::sync::Arc;

use serde_json::Value;

use tck_base::clock::Stamp;
use tck_journal::Entry;
use tck_journal::event::{Direction, Event, Record, Source};

/// A message on its way through.
pub(super) struct Arrived {
    pub number: u64,
    pub name: String,
    pub at: Stamp,
    pub stale: bool,
    pub entry: Arc<Entry>,
}

/// The record as the side that is judged is shown it: its own messages came, those of the other side were sent.
pub(super) fn of_side(arrived: &Arrived, own: bool, apart: i64) -> Arc<Entry> {
    let Event::Message {
        topic,
        qos,
        retain,
        dup,
        payload,
    } = arrived.entry.event().clone()
    else {
        return Arc::clone(&arrived.entry);
    };
    let event = if own {
        Event::Message {
            topic,
            qos,
            retain,
            dup,
            payload,
        }
    } else {
        Event::Sent {
            topic,
            qos,
            retain,
            payload,
        }
    };
    let utc = arrived.at.utc.as_microsecond().saturating_add(apart);
    let record = Record {
        seq: arrived.number,
        at: Stamp {
            moment: arrived.at.moment,
            utc: jiff::Timestamp::from_microsecond(utc).unwrap_or(arrived.at.utc),
        },
        source: Source::Link,
        direction: Some(if own {
            Direction::FromDevice
        } else {
            Direction::ToDevice
        }),
        event,
    };
    Entry::beside(&arrived.entry, record)
}

/// What a message says of its time.
pub(super) fn timestamp(message: &Value) -> Option<jiff::Timestamp> {
    message.get("timestamp")?.as_str()?.parse().ok()
}

/// What a message says of its version.
pub(super) fn version(message: &Value) -> Option<String> {
    let said = message.get("version")?.as_str()?;
    Some(said.chars().take(32).collect())
}

/// Whether a state shows no order and no action that is still under way.
pub(super) fn is_at_rest(state: &Value) -> bool {
    let list = |member: &str| {
        state
            .get(member)
            .and_then(Value::as_array)
            .map_or(&[][..], Vec::as_slice)
    };
    let is_over = |action: &Value| {
        let status = action.get("actionStatus").and_then(Value::as_str);
        matches!(status, Some("FINISHED" | "FAILED"))
    };
    list("nodeStates").is_empty() && list("edgeStates").is_empty() && list("actionStates").iter().all(is_over)
}
