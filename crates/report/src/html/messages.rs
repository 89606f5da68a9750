//! The messages a page shows, each once, verbatim, and bounded.

use std::collections::BTreeSet;

use super::pretty::{self, Line};
use crate::clean::line;
use crate::headline::{headline, kind};
use tck_journal::{Direction, Entry, Event, Journal, Payload};
use tck_view::Names;

/// Most messages of one page.
const PAGE_LIMIT: usize = 600;
/// Most bytes that messages take up in one page, roughly.
const BYTES: usize = 2_000_000;
/// Roughly what a line takes up beside its text.
const OF_A_LINE: usize = 50;
/// Most bytes of a payload that are set on lines.
const PAYLOAD_LIMIT: usize = 64 * 1024;

/// One message as the page shows it.
pub struct MessageView {
    pub seq: u64,
    pub kind: String,
    pub headline: String,
    /// Why it is shown, such as `fail`, `nearest miss` or `stimulus`.
    pub role: String,
    /// Where it came from and went to.
    pub way: &'static str,
    pub topic: String,
    pub utc: String,
    /// Seconds since the run began.
    pub time: String,
    /// `QoS 1, RETAIN`; empty for what is not a message.
    pub delivery: String,
    pub bytes: u64,
    /// What is wrong with the payload as JSON.
    pub problems: Vec<String>,
    /// Said when not all of it is here.
    pub cut: Option<String>,
    pub lines: Vec<Line>,
    pub open: bool,
}

/// Collects messages, each once, for the part of the page that asks for it first.
pub struct Gallery<'a> {
    journal: Option<&'a Journal>,
    shown: BTreeSet<u64>,
    waiting: Vec<MessageView>,
    bytes: usize,
}

impl<'a> Gallery<'a> {
    pub fn new(journal: Option<&'a Journal>) -> Self {
        Self {
            journal,
            shown: BTreeSet::new(),
            waiting: Vec::new(),
            bytes: 0,
        }
    }

    pub fn journal(&self) -> Option<&'a Journal> {
        self.journal
    }

    /// Whether the page shows this record.
    pub fn shows(&self, seq: u64) -> bool {
        self.shown.contains(&seq)
    }

    /// All records shown so far.
    pub fn shown(&self) -> &BTreeSet<u64> {
        &self.shown
    }

    /// Asks for a record; `places` is what verdicts say about it. Gives back whether the page shows it.
    pub fn show(&mut self, seq: u64, role: &str, places: &[&str]) -> bool {
        if self.shown.contains(&seq) {
            return true;
        }
        let journal = self
            .journal
            .filter(|_| self.shown.len() < PAGE_LIMIT && self.bytes < BYTES);
        let Some((journal, entry)) = journal.and_then(|journal| Some((journal, journal.get(seq)?))) else {
            return false;
        };
        self.shown.insert(seq);
        let message = view(&entry, journal.names(), role, places);
        self.bytes += message
            .lines
            .iter()
            .map(|line| line.text.len() + OF_A_LINE)
            .sum::<usize>();
        self.waiting.push(message);
        true
    }

    /// The messages asked for since the last call, in the order they happened.
    pub fn take(&mut self) -> Vec<MessageView> {
        let mut messages = std::mem::take(&mut self.waiting);
        messages.sort_by_key(|message| message.seq);
        messages
    }
}

fn view(entry: &Entry, names: &Names, role: &str, places: &[&str]) -> MessageView {
    let mut cut = None;
    let lines = match entry.payload() {
        None => {
            let picture = entry.subject().map(|picture| picture.to_string()).unwrap_or_default();
            pretty::json(&picture, places)
        }
        Some(payload) => {
            let bytes = payload.bytes();
            if let Payload::Cut { sha256, length, prefix } = payload {
                cut = Some(format!(
                    "the first {} of {length} bytes; SHA-256 of all of them {sha256}",
                    prefix.len()
                ));
            } else if bytes.len() > PAYLOAD_LIMIT {
                cut = Some(format!(
                    "the beginning of {} bytes; the journal has all of them",
                    bytes.len()
                ));
            }
            match std::str::from_utf8(bytes) {
                Ok(text) if entry.json().is_some() && bytes.len() <= PAYLOAD_LIMIT => pretty::json(text, places),
                _ => pretty::other(&bytes[..bytes.len().min(PAYLOAD_LIMIT)]),
            }
        }
    };
    let (topic, delivery) = match entry.event() {
        Event::Message { topic, qos, retain, .. }
        | Event::Sent { topic, qos, retain, .. }
        | Event::Retained { topic, qos, retain, .. } => (
            topic.as_str(),
            format!("QoS {qos}{}", if *retain { ", RETAIN" } else { "" }),
        ),
        Event::Packet {
            packet:
                tck_journal::Packet::Publish {
                    topic,
                    qos,
                    retain,
                    dup,
                    ..
                },
            ..
        } => {
            let flags = [(*retain, ", RETAIN"), (*dup, ", DUP")];
            let flags: String = flags.iter().filter(|(set, _)| *set).map(|(_, word)| *word).collect();
            (topic.as_str(), format!("QoS {qos}{flags}"))
        }
        _ => ("", String::new()),
    };
    MessageView {
        seq: entry.seq(),
        kind: kind(entry),
        headline: headline(entry, None, names),
        role: role.to_owned(),
        way: way(entry),
        topic: line(topic).into_owned(),
        utc: entry.at().utc.strftime("%Y-%m-%d %H:%M:%S%.3f UTC").to_string(),
        time: format!("{:.3} s", entry.at().moment.seconds()),
        delivery,
        bytes: entry.payload().map_or(0, Payload::len),
        problems: entry
            .parsed()
            .map(|parsed| parsed.problems().iter().map(ToString::to_string).collect())
            .unwrap_or_default(),
        cut,
        lines,
        open: !places.is_empty(),
    }
}

fn way(entry: &Entry) -> &'static str {
    match (entry.event(), entry.record.direction) {
        (Event::Message { .. }, _) => "delivered to the harness",
        (Event::Sent { .. }, _) => "sent by the harness",
        (Event::Retained { .. }, _) => "delivered to a fresh subscriber",
        (Event::Packet { .. } | Event::Undecodable { .. }, Some(Direction::ToDevice)) => {
            "seen at the tap, to the device"
        }
        (Event::Packet { .. } | Event::Undecodable { .. }, _) => "seen at the tap, from the device",
        _ => "recorded by the harness",
    }
}
