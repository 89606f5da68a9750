//! What every check asks of an entry: whose message is it, and may it be judged at all?
//!
//! Which requirement is broken is left to the checks.

use std::time::Duration;

use serde_json::Value;

use tck_base::verdict::Verdict;
use tck_check::device_publish;
use tck_check::{CheckContext, CheckFinding};
use tck_journal::Entry;
use tck_journal::event::{Event, LinkFault, Packet};
use tck_pack::{RequirementId, Role};

/// The header fields of every message.
pub(super) const HEADER: [&str; 5] = ["headerId", "timestamp", "version", "manufacturer", "serialNumber"];

/// What a check has learned about the run from the entries so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Traffic {
    /// Whether packets are seen, so that what the device really published is known.
    pub tap: bool,
    /// Whether the harness disturbs the link right now.
    pub disturbed: bool,
}

impl Traffic {
    /// Learns from an entry. Call it first, for every entry.
    pub fn note(&mut self, entry: &Entry) {
        match entry.event() {
            Event::RunBegun { header } => {
                self.tap = header.vantage == "tap";
            }
            Event::Opened { .. } | Event::Packet { .. } => self.tap = true,
            Event::Fault { fault } => self.disturbed = *fault != LinkFault::Restore,
            _ => {}
        }
    }

    /// A message of the device under test that was delivered live. Retained deliveries are stale: nobody
    /// knows when, or by which firmware, they were sent.
    #[expect(clippy::unused_self, reason = "asked in one breath with `published`, which needs it")]
    pub fn delivered<'c>(self, entry: &Entry, context: &'c CheckContext<'_>) -> Option<Delivered<'c>> {
        let Event::Message {
            topic,
            qos,
            retain: false,
            dup,
            ..
        } = entry.event()
        else {
            return None;
        };
        let name = context.topic_name(topic)?;
        (publisher(name, context) == Some(context.role)).then_some(Delivered {
            name,
            qos: *qos,
            retain: None,
            dup: *dup,
        })
    }

    /// A message of the device under test as it was published: at the tap where there is one, otherwise as
    /// it was delivered.
    pub fn published<'c>(self, entry: &Entry, context: &'c CheckContext<'_>) -> Option<Delivered<'c>> {
        if !self.tap {
            return self.delivered(entry, context);
        }
        let (_, topic, qos, retain, dup, _) = device_publish(entry)?;
        let name = context.topic_name(topic)?;
        (publisher(name, context) == Some(context.role)).then_some(Delivered {
            name,
            qos,
            retain: Some(retain),
            dup,
        })
    }
}

/// A message of the device under test.
#[derive(Clone, Copy, Debug)]
pub(super) struct Delivered<'c> {
    /// Name of the topic.
    pub name: &'c str,
    /// QoS it was published with.
    pub qos: u8,
    /// RETAIN it was published with, where that was seen.
    pub retain: Option<bool>,
    /// DUP of the delivery.
    pub dup: bool,
}

/// A live state message: its value, and only if it is an object.
pub(super) fn state<'e>(traffic: Traffic, entry: &'e Entry, context: &CheckContext<'_>) -> Option<&'e Value> {
    let message = traffic.delivered(entry, context)?;
    (message.name == "state")
        .then(|| entry.json())
        .flatten()
        .filter(|value| value.is_object())
}

/// A message towards the vehicle on `name`, from the harness or from a master control that was recorded.
pub(super) fn to_vehicle<'e>(name: &str, entry: &'e Entry, context: &CheckContext<'_>) -> Option<&'e Value> {
    let (Event::Sent { topic, .. }
    | Event::Message {
        topic, retain: false, ..
    }) = entry.event()
    else {
        return None;
    };
    (context.topic_name(topic) == Some(name))
        .then(|| entry.json())
        .flatten()
}

/// Whether this is a message towards the vehicle on `name`, readable or not.
pub(super) fn is_to_vehicle(name: &str, entry: &Entry, context: &CheckContext<'_>) -> bool {
    match entry.event() {
        Event::Sent { topic, .. }
        | Event::Message {
            topic, retain: false, ..
        } => context.topic_name(topic) == Some(name),
        _ => false,
    }
}

/// Every action of an instantActions message, whatever else is wrong with it.
pub(super) fn actions(message: &Value) -> impl Iterator<Item = &Value> {
    // 1.1 and careless senders call the list `instantActions`.
    elements(message, "actions").chain(elements(message, "instantActions"))
}

/// The elements of an array member; none if it is missing or no array.
pub(super) fn elements<'v>(value: &'v Value, name: &str) -> impl Iterator<Item = &'v Value> {
    value.get(name).and_then(Value::as_array).into_iter().flatten()
}

/// A text member; empty when it is missing.
pub(super) fn text<'v>(value: &'v Value, name: &str) -> &'v str {
    value.get(name).and_then(Value::as_str).unwrap_or_default()
}

/// Whether something outside the protocol may have changed the vehicle: a hook was run or a person acted.
pub(super) fn outside_influence(entry: &Entry) -> bool {
    matches!(entry.event(), Event::Hook { .. } | Event::Answer { .. })
}

/// By how much the harness was late: what came meanwhile was read later than it was sent.
pub(super) fn lag(entry: &Entry) -> Option<Duration> {
    match entry.event() {
        Event::Lag { micros, .. } => Some(Duration::from_micros(*micros)),
        _ => None,
    }
}

/// Whether the device may have been restarted: it opens a connection, or says something about it.
pub(super) fn maybe_restarted(traffic: Traffic, entry: &Entry, context: &CheckContext<'_>) -> bool {
    let connects = matches!(
        entry.event(),
        Event::Packet {
            packet: Packet::Connect { .. },
            ..
        }
    );
    connects
        || traffic
            .delivered(entry, context)
            .is_some_and(|message| message.name == "connection")
}

/// Whether a connection message says that the connection is broken. Spelled with or without underscore
/// depending on the version.
pub(super) fn says_broken(message: &Value) -> bool {
    text(message, "connectionState")
        .bytes()
        .filter(|byte| *byte != b'_')
        .eq(b"CONNECTIONBROKEN".iter().copied())
}

fn publisher(name: &str, context: &CheckContext<'_>) -> Option<Role> {
    context.pack.topic(name).map(|topic| topic.publisher)
}

/// A finding on `requirement` that follows its mood.
pub(super) fn broken(requirement: &str, seq: u64, message: impl Into<String>) -> CheckFinding {
    CheckFinding {
        requirement: Some(RequirementId::from(requirement)),
        verdict: None,
        seq,
        message: message.into(),
    }
}

/// A finding that a ruling of the catalogue makes a warning.
pub(super) fn remark(requirement: &str, seq: u64, message: impl Into<String>) -> CheckFinding {
    CheckFinding {
        verdict: Some(Verdict::Warning),
        ..broken(requirement, seq, message)
    }
}

/// A fact that cannot be observed from here.
pub(super) fn unclear(requirement: &str, seq: u64, message: impl Into<String>) -> CheckFinding {
    CheckFinding {
        verdict: Some(Verdict::Inconclusive),
        ..broken(requirement, seq, message)
    }
}

/// A value of a device, escaped and cut to a readable length.
pub(super) fn show(value: &Value) -> String {
    shorten(&value.to_string())
}

/// A text of a device in quotes, escaped and cut to a readable length.
pub(super) fn quote(text: &str) -> String {
    shorten(&format!("{:?}", text.chars().take(100).collect::<String>()))
}

fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(80).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}
