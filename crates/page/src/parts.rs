//! The parts that a page is made of, as browsers are told of them.

use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;
use serde::Serialize;
use serde_json::{Value, json};

use super::floor::FleetVehicle;
use super::shown::{EXCERPT, shown};
use super::told::{Facts, Outcome, Way};
use tck_journal::Entry;
use tck_journal::event::Event;

/// The vehicles of a watch.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(crate) struct Fleet {
    /// How many were heard.
    pub heard: usize,
    /// Those that are shown.
    pub vehicles: Vec<FleetVehicle>,
}

#[derive(Debug, Default, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Head {
    pub facts: Facts,
    pub phase: Phase,
    /// When the run began, in milliseconds since 1970, as all times here.
    pub began: i64,
    /// When it is expected to end.
    pub ends: Option<i64>,
    /// Where the device is to connect.
    pub address: Option<String>,
    /// How many connections are open at the tap; `None` where there is no tap.
    pub connections: Option<u64>,
    /// What the device says of its connection.
    pub connection: Option<String>,
    pub outcome: Option<Outcome>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Phase {
    #[default]
    Begins,
    ExpectsDevice,
    Runs,
    Stops,
    Ended,
}

#[derive(Debug, Serialize)]
pub(crate) struct Running {
    pub test: String,
    pub title: String,
    pub why: String,
    pub number: usize,
    pub of: usize,
    pub since: i64,
    pub step: Option<Step>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Step {
    pub path: String,
    pub title: Option<String>,
    pub does: String,
    pub since: i64,
    /// Until when is waited for something.
    pub until: Option<i64>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Asked {
    pub number: u64,
    /// How many questions the plan has, where it knows them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<u64>,
    pub test: Option<String>,
    pub title: Option<String>,
    pub why: Option<String>,
    pub step: Option<String>,
    pub text: String,
    pub until: i64,
}

/// A test of the plan.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Row {
    pub test: String,
    /// `left`, `runs`, `left-out` or a verdict.
    pub state: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

#[derive(Debug)]
pub(crate) struct Message {
    pub change: u64,
    pub way: Way,
    pub topic: String,
    pub entry: Arc<Entry>,
}

#[derive(Debug)]
pub(crate) struct Line {
    pub change: u64,
    pub at: i64,
    pub kind: &'static str,
    pub text: String,
    pub record: Option<u64>,
}

impl Message {
    /// As it is told.
    pub fn shown(&self) -> Value {
        let bytes = payload(self.entry.event()).unwrap_or_default();
        // What is not text may be anything.
        let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * EXCERPT)]);
        let excerpt: String = text.chars().take(EXCERPT).collect();
        let more = if excerpt.len() < bytes.len() { " …" } else { "" };
        json!({ "record": self.entry.seq(), "at": self.entry.at().utc.as_millisecond(), "way": self.way,
            "topic": self.topic, "text": format!("{}{more}", shown(&excerpt, EXCERPT)) })
    }
}

fn payload(event: &Event) -> Option<&[u8]> {
    match event {
        Event::Sent { payload, .. } | Event::Message { payload, .. } | Event::Retained { payload, .. } => {
            Some(payload.bytes())
        }
        _ => None,
    }
}

impl Line {
    /// As it is told.
    pub fn shown(&self) -> Value {
        json!({ "at": self.at, "kind": self.kind, "text": self.text, "record": self.record })
    }
}

/// This moment, in milliseconds since 1970.
pub(crate) fn now() -> i64 {
    Timestamp::now().as_millisecond()
}

/// A moment that comes so much later.
pub(crate) fn from_now(left: Duration) -> i64 {
    now().saturating_add(i64::try_from(left.as_millis()).unwrap_or(i64::MAX))
}
