//! A message on its way through, and what it says of itself.

use std::sync::Arc;

use tck_base::clock::Stamp;
use tck_journal::Entry;
use tck_journal::event::{Direction, Event, Record, Source};
use tck_view::{MessageView, Names, StateView, Topic};
use tck_world::rest::{has_order, open_actions};

/// A message on its way through.
pub(super) struct Arrived {
    pub number: u64,
    pub name: String,
    pub at: Stamp,
    pub stale: bool,
    pub entry: Arc<Entry>,
}

impl Arrived {
    /// The message, if it is JSON.
    pub fn message(&self, names: &Names) -> Option<&MessageView> {
        self.entry.view(Topic::of_name(&self.name), names)
    }
}

/// The record as the side that is judged is shown it: its own messages came, those of the other side were sent.
pub(super) fn as_shown(arrived: &Arrived, own: bool, apart: i64, retain: bool) -> Arc<Entry> {
    let Event::Message {
        topic,
        qos,
        dup,
        payload,
        ..
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
pub(super) fn timestamp(message: &MessageView) -> Option<jiff::Timestamp> {
    message.header().timestamp.text()?.parse().ok()
}

/// What a message says of its version.
pub(super) fn version(message: &MessageView) -> Option<String> {
    let said = message.header().version.text()?;
    Some(said.chars().take(32).collect())
}

/// Whether a state shows no order and no action that is still under way.
pub(super) fn is_at_rest(state: &StateView) -> bool {
    !has_order(state) && open_actions(state).next().is_none()
}
