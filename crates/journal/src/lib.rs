//! The append-only record of everything that happened in a run; the only input of the judge.
//!
//! [`event`] says what can be recorded, [`Journal`] keeps the records in order in memory, [`file`] writes
//! them through as JSON Lines and reads them back. What the records *mean* is left to the judge.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod event;
mod fault;
pub mod file;
pub mod json;
mod latency;
mod packet;
mod payload;
pub mod place;
mod plan;
mod program;
mod read;
mod reason;
mod serving;
mod vantage;
mod waiver;

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use serde_json::Value;
use tck_view::{MessageView, Names, Topic};

pub use event::{Direction, Event, Packet, Payload, Record, Source, Will};
pub use json::Parsed;
pub use latency::{Histogram, OwnLatency, Spread};
pub use plan::tool;
use read::Read;
pub use reason::{OwnError, Reason};
pub use serving::ServeBehaviour;
pub use vantage::Vantage;

use tck_base::clock::Stamp;

/// One record together with the one parse and the one reading of its payload.
#[derive(Debug)]
pub struct Entry {
    /// The record as it stands in the journal.
    pub record: Record,
    read: OnceLock<Arc<Read>>,
    picture: OnceLock<Value>,
}

impl Entry {
    /// Wraps a record; the payload is parsed when it is first asked for.
    #[must_use]
    pub fn new(record: Record) -> Arc<Self> {
        Arc::new(Self {
            record,
            read: OnceLock::new(),
            picture: OnceLock::new(),
        })
    }

    /// Wraps another record of the same payload, which is not parsed or read again.
    #[must_use]
    pub fn beside(other: &Self, record: Record) -> Arc<Self> {
        let entry = Self::new(record);
        if let Some(read) = other.shared() {
            // It is empty: nobody else has seen it yet.
            let _ = entry.read.set(Arc::clone(read));
        }
        entry
    }

    /// The number of the record.
    #[must_use]
    pub fn seq(&self) -> u64 {
        self.record.seq
    }

    /// When it happened.
    #[must_use]
    pub fn at(&self) -> Stamp {
        self.record.at
    }

    /// What happened.
    #[must_use]
    pub fn event(&self) -> &Event {
        &self.record.event
    }

    /// The MQTT application message this record carries, if it carries one: delivered to the harness,
    /// sent by the harness, delivered to a fresh subscriber, or seen as PUBLISH at the tap.
    #[must_use]
    pub fn payload(&self) -> Option<&Payload> {
        match &self.record.event {
            Event::Message { payload, .. }
            | Event::Sent { payload, .. }
            | Event::Retained { payload, .. }
            | Event::Packet {
                packet: Packet::Publish { payload, .. },
                ..
            } => Some(payload),
            _ => None,
        }
    }

    /// The payload parsed as JSON, once.
    #[must_use]
    pub fn parsed(&self) -> Option<&Parsed> {
        self.shared().map(|read| &read.parsed)
    }

    /// About how many bytes of memory its payload takes: its bytes, and the value they are parsed to, unless another record
    /// has that already.
    #[must_use]
    pub fn held(&self) -> u64 {
        let bytes = self.payload().map_or(0, |payload| payload.bytes().len() as u64);
        let own = self.shared().filter(|read| Arc::strong_count(read) == 1);
        bytes + own.map_or(0, |read| read.parsed.weight())
    }

    /// Forgets how it was read, which is done again when somebody asks. Gives about how many bytes of memory that frees.
    fn forget(&mut self) -> u64 {
        self.picture = OnceLock::new();
        let read = self.read.take().filter(|read| Arc::strong_count(read) == 1);
        read.map_or(0, |read| read.parsed.weight())
    }

    fn shared(&self) -> Option<&Arc<Read>> {
        let payload = self.payload()?;
        Some(self.read.get_or_init(|| Arc::new(Read::of(payload))))
    }

    /// The payload as a message of a topic, read once for a version's names of members; `None` when there is none or it is
    /// not JSON.
    #[must_use]
    pub fn view(&self, topic: Topic, names: &Names) -> Option<&MessageView> {
        self.shared()?.view(topic, names)
    }

    /// The payload as a JSON value; `None` when there is none or it is not JSON.
    #[must_use]
    pub fn json(&self) -> Option<&Value> {
        self.parsed()?.value()
    }

    /// What patterns match against: the JSON payload of a message, or the JSON picture of a packet,
    /// a map download or any other event.
    #[must_use]
    pub fn subject(&self) -> Option<Cow<'_, Value>> {
        match &self.record.event {
            Event::Message { .. } | Event::Sent { .. } | Event::Retained { .. } => self.json().map(Cow::Borrowed),
            event => Some(Cow::Borrowed(self.picture.get_or_init(|| event.picture()))),
        }
    }
}

/// The records of a run, in order.
#[derive(Clone, Debug, Default)]
pub struct Journal {
    entries: Vec<Arc<Entry>>,
    names: Arc<Names>,
}

impl Journal {
    /// An empty journal.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends what happened, giving it the next number (counted from 1).
    pub fn append(&mut self, occurrence: event::Occurrence) -> Arc<Entry> {
        let seq = self.entries.len() as u64 + 1;
        let entry = Entry::new(occurrence.numbered(seq));
        self.entries.push(Arc::clone(&entry));
        entry
    }

    /// Takes over a record that already has its number, when reading a journal back.
    pub fn restore(&mut self, record: Record) {
        self.entries.push(Entry::new(record));
    }

    /// What the version of the run calls the members of messages; what 2.x calls them where nobody has said it.
    #[must_use]
    pub fn names(&self) -> &Names {
        &self.names
    }

    /// Says what the version of the run calls the members of messages.
    pub fn set_names(&mut self, names: &Arc<Names>) {
        self.names = Arc::clone(names);
    }

    /// Forgets how the record was read that stands so many places before the last one, if nobody else holds it: what it says is
    /// read again when somebody asks. Gives about how many bytes of memory that frees.
    pub fn forget_reading(&mut self, places: usize) -> u64 {
        let at = self.entries.len().checked_sub(places + 1);
        let entry = at.and_then(|at| self.entries.get_mut(at)).and_then(Arc::get_mut);
        entry.map_or(0, Entry::forget)
    }

    /// All records so far.
    #[must_use]
    pub fn entries(&self) -> &[Arc<Entry>] {
        &self.entries
    }

    /// The record with a number.
    #[must_use]
    pub fn get(&self, seq: u64) -> Option<&Arc<Entry>> {
        let at = self.entries.binary_search_by_key(&seq, |entry| entry.seq()).ok()?;
        self.entries.get(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use event::Occurrence;
    use tck_base::clock::Moment;

    fn sent() -> Occurrence {
        let at = Stamp {
            moment: Moment::START,
            utc: jiff::Timestamp::UNIX_EPOCH,
        };
        let event = Event::Sent {
            topic: "state".to_owned(),
            qos: 0,
            retain: false,
            payload: Payload::keep(br#"{ "nodeStates": [1, 2, 3] }"#.to_vec().into()),
        };
        Occurrence::harness(at, event)
    }

    #[test]
    fn how_a_record_was_read_is_forgotten_where_nobody_holds_it_and_read_again_when_it_is_asked_for() {
        let mut journal = Journal::new();
        let held = journal.append(sent());
        drop(journal.append(sent()));
        drop(journal.append(sent()));
        assert!(journal.entries().iter().all(|entry| entry.json().is_some()));
        assert_eq!(journal.forget_reading(2), 0, "somebody holds it");
        let freed = journal.forget_reading(1);
        assert!(freed > 0);
        assert_eq!(journal.forget_reading(1), 0, "there is nothing left to forget");
        assert_eq!(journal.forget_reading(3), 0, "there is none so far back");
        let again = journal.get(2).and_then(|entry| entry.json());
        assert!(again.is_some() && again == held.json());
        assert_eq!(journal.forget_reading(1), freed);
    }
}
