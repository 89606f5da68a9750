//! Everything that can be waited for, in the order of the journal, by subject.
//!
//! A subject is a topic name of the pack (`state`), a packet of the device (`mqtt/connect`), a map
//! download (`http/fetch`) or a delivery to a fresh subscriber. The judge looks only into this index.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use crate::clock::Stamp;
use crate::journal::Entry;
use crate::journal::event::{Direction, Event, Packet};

/// The index.
#[derive(Debug, Default)]
pub struct Timeline {
    topics: BTreeMap<String, String>,
    subjects: BTreeMap<String, Vec<Arc<Entry>>>,
    last: Option<Stamp>,
}

impl Timeline {
    /// An empty index for these full topics by topic name.
    #[must_use]
    pub fn new(topics: &BTreeMap<String, String>) -> Self {
        Self {
            topics: topics.iter().map(|(name, full)| (full.clone(), name.clone())).collect(),
            ..Self::default()
        }
    }

    /// Takes in one entry and returns its subject, if it has one.
    pub fn add(&mut self, entry: &Arc<Entry>) -> Option<String> {
        self.last = Some(entry.at());
        let subject = self.subject_of(entry)?;
        self.subjects
            .entry(subject.clone())
            .or_default()
            .push(Arc::clone(entry));
        Some(subject)
    }

    /// The subject of an entry.
    #[must_use]
    pub fn subject_of(&self, entry: &Entry) -> Option<String> {
        match entry.event() {
            Event::Message { topic, .. } => self.topics.get(topic).cloned(),
            Event::Packet { packet, .. } if entry.record.direction == Some(Direction::FromDevice) => {
                let name = match packet {
                    Packet::Connect { .. } => "connect",
                    Packet::Publish { .. } => "publish",
                    Packet::Subscribe { .. } => "subscribe",
                    Packet::Unsubscribe { .. } => "unsubscribe",
                    Packet::Disconnect { .. } => "disconnect",
                    Packet::Pingreq => "pingreq",
                    _ => return None,
                };
                Some(format!("mqtt/{name}"))
            }
            Event::Closed { .. } => Some("mqtt/closed".to_owned()),
            Event::Undecodable { .. } => Some("mqtt/undecodable".to_owned()),
            Event::Fetched { .. } => Some("http/fetch".to_owned()),
            _ => None,
        }
    }

    /// The topic name of a full topic.
    #[must_use]
    pub fn topic_name(&self, full: &str) -> Option<&str> {
        self.topics.get(full).map(String::as_str)
    }

    /// All entries of a subject.
    #[must_use]
    pub fn of(&self, subject: &str) -> &[Arc<Entry>] {
        self.subjects.get(subject).map_or(&[], Vec::as_slice)
    }

    /// The entries of a subject from a journal number on.
    #[must_use]
    pub fn since(&self, subject: &str, seq: u64) -> &[Arc<Entry>] {
        let all = self.of(subject);
        &all[all.partition_point(|entry| entry.seq() < seq)..]
    }

    /// The last entry of a subject before a journal number.
    #[must_use]
    pub fn before(&self, subject: &str, seq: u64) -> Option<&Arc<Entry>> {
        let all = self.of(subject);
        all[..all.partition_point(|entry| entry.seq() < seq)].last()
    }

    /// What the last message of a subject before a journal number said.
    #[must_use]
    pub fn baseline(&self, subject: &str, seq: u64) -> Option<Value> {
        self.before(subject, seq)?.json().cloned()
    }

    /// When the last entry happened.
    #[must_use]
    pub fn last(&self) -> Option<Stamp> {
        self.last
    }
}
