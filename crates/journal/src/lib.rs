//! The append-only record of everything that happened in a run; the only input of the judge.
//!
//! [`event`] says what can be recorded, [`Journal`] has the records in order, [`file`] writes them through as JSON Lines and
//! reads them back. What the records *mean* is left to the judge.
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
mod records;
mod serving;
mod shelf;
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
pub use records::{Entries, Journal};
pub use serving::ServeBehaviour;
pub use shelf::{LostRecord, Shelf};
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
