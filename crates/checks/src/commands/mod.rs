//! `commands/…`: what a master control sends, judged message by message and in the light of what its vehicles said.
//!
//! The vehicles are the harness's own. A message of the master control may have crossed a state on the way, so nobody
//! is held to what was said a moment ago; and what is known is forgotten whenever the harness plays with the link or
//! with its vehicle.

mod actions;
mod asked;
mod away;
mod axes;
mod cancelled;
mod capability;
mod contradicts;
mod corridors;
mod fields;
mod follow;
mod graph;
mod health;
mod identity;
mod informed;
mod limits;
mod link;
mod maps;
mod modes;
mod parameters;
mod place;
mod sheet;
#[cfg(test)]
mod tests;
mod trajectories;
mod vehicle;

pub(super) use actions::{IN_FACTSHEET, LOAD_DEVICE, SCOPES};
pub(super) use asked::NOT_ASKED;
pub(super) use away::AWAY;
pub(super) use axes::AXES;
pub(super) use cancelled::BASE_KEPT;
pub(super) use capability::{OPTIONAL, REQUIRED};
pub(super) use contradicts::CONTRADICTS;
pub(super) use corridors::CORRIDORS;
pub(super) use fields::{ARRAYS, IDENTIFIERS, POSITION, POSITION_RANGE, TOPICS, ZONE_SET};
pub(super) use follow::{ORDER_IDS, RESENT, UPDATES};
pub(super) use graph::{EDGE_ENDS, NODES_AND_EDGES, RELEASED, SEQUENCE};
pub(super) use health::HEALTH;
pub(super) use identity::{ACTION_IDS, NODE_IDS};
pub(super) use informed::ON_INFORMATION;
pub(super) use limits::{ORDER_INTERVAL, SIZES};
pub(super) use link::{ALIVE, LISTENS};
pub(super) use maps::{DOWNLOADS, DUPLICATES, ENABLED, ON_BOARD};
pub(super) use modes::MODES;
pub(super) use parameters::{KEYS, MANDATORY, VALUES};
pub(super) use place::{CANCELLED_BETWEEN, CANCELLED_ON_NODE, FIRST_PLACE, START};
pub(super) use trajectories::{ENDS, TRAJECTORY};

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use serde_json::Value;

use super::orders::number;
use super::traffic::{Traffic, broken, elements, remark, text};
use tck_check::{CheckContext, CheckFinding, Running};
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_pack::Role;

/// How many elements of a list are looked at.
const ELEMENTS: usize = 2048;
/// How many findings of one kind a message is worth.
const REPORTED: usize = 4;

/// A message of the master control to the vehicle.
#[derive(Clone, Copy, Debug)]
enum Command<'e> {
    Order(&'e Value),
    Instant(&'e Value),
}

impl<'e> Command<'e> {
    /// Reads an entry; only what is a JSON object.
    fn read(traffic: Traffic, entry: &'e Entry, context: &CheckContext<'_>) -> Option<Self> {
        let message = traffic.delivered(entry, context)?;
        if context.role != Role::MasterControl {
            return None;
        }
        let value = entry.json().filter(|value| value.is_object())?;
        match message.name {
            "order" => Some(Self::Order(value)),
            "instantActions" => Some(Self::Instant(value)),
            _ => None,
        }
    }

    fn order(self) -> Option<&'e Value> {
        match self {
            Self::Order(order) => Some(order),
            Self::Instant(_) => None,
        }
    }

    fn value(self) -> &'e Value {
        match self {
            Self::Order(value) | Self::Instant(value) => value,
        }
    }

    /// Every action in it, with its scope in the words of a factsheet.
    ///
    /// Where there is no array `actions`, the name that older versions gave it counts: what must not come does not
    /// become right by a wrong name.
    fn actions(self) -> Vec<(&'static str, &'e Value)> {
        match self {
            Self::Instant(message) => {
                let named = message.get("actions").is_some_and(Value::is_array);
                let list = if named { "actions" } else { "instantActions" };
                let all = elements(message, list).take(ELEMENTS);
                all.map(|action| ("INSTANT", action)).collect()
            }
            Self::Order(order) => {
                let of = |list, scope| {
                    elements(order, list)
                        .take(ELEMENTS)
                        .flat_map(|element| elements(element, "actions"))
                        .map(move |action| (scope, action))
                };
                of("nodes", "NODE").chain(of("edges", "EDGE")).take(ELEMENTS).collect()
            }
        }
    }
}

/// Takes down what is wrong with one message, not more than is readable.
struct Found<'f> {
    seq: u64,
    findings: &'f mut Vec<CheckFinding>,
    before: usize,
}

impl<'f> Found<'f> {
    fn new(entry: &Entry, findings: &'f mut Vec<CheckFinding>) -> Self {
        let before = findings.len();
        Self {
            seq: entry.seq(),
            findings,
            before,
        }
    }

    fn push(&mut self, finding: CheckFinding) {
        let alike =
            |known: &&CheckFinding| known.requirement == finding.requirement && known.verdict == finding.verdict;
        if self.findings[self.before..].iter().filter(alike).count() < REPORTED {
            self.findings.push(finding);
        }
    }

    fn broken(&mut self, requirement: &str, message: impl Into<String>) {
        self.push(broken(requirement, self.seq, message));
    }

    fn remark(&mut self, requirement: &str, message: impl Into<String>) {
        self.push(remark(requirement, self.seq, message));
    }
}

/// A rule on a single message: whether there was something to judge.
type Rule = fn(Command<'_>, &CheckContext<'_>, &mut Found<'_>) -> bool;

/// Judges every message by itself.
struct Each {
    traffic: Traffic,
    rule: Rule,
}

impl Each {
    fn start(rule: Rule) -> Box<dyn Running> {
        Box::new(Self {
            traffic: Traffic::default(),
            rule,
        })
    }
}

impl Running for Each {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        let Some(command) = Command::read(self.traffic, entry, context) else {
            return false;
        };
        (self.rule)(command, context, &mut Found::new(entry, findings))
    }
}

/// What a mock vehicle says on a topic.
fn said<'e>(name: &str, entry: &'e Entry, context: &CheckContext<'_>) -> Option<&'e Value> {
    let Event::Sent { topic, .. } = entry.event() else {
        return None;
    };
    (context.topic_name(topic) == Some(name))
        .then(|| entry.json())
        .flatten()
        .filter(|value| value.is_object())
}

/// The nodes of an order in the order of their sequenceIds, where all have one; as they stand otherwise.
fn in_sequence<'v>(order: &'v Value, list: &str) -> Vec<&'v Value> {
    let mut all: Vec<&Value> = elements(order, list).take(ELEMENTS).collect();
    if all.iter().all(|element| number(element, "sequenceId").is_some()) {
        all.sort_by_key(|element| number(element, "sequenceId"));
    }
    all
}

fn released(element: &Value) -> Option<bool> {
    element.get("released")?.as_bool()
}

/// A short copy of a text member; `None` when it is missing or no text.
fn short(value: &Value, name: &str) -> Option<String> {
    Some(value.get(name)?.as_str()?.chars().take(256).collect())
}

/// x, y and mapId of a node.
fn place_of(node: &Value) -> Option<(f64, f64, &str)> {
    let position = node.get("nodePosition")?;
    let member = |name: &str| {
        position
            .get(name)
            .and_then(Value::as_f64)
            .filter(|value| value.is_finite())
    };
    Some((member("x")?, member("y")?, text(position, "mapId")))
}

/// Of a parameter of an action.
fn parameter<'v>(action: &'v Value, key: &str) -> Option<&'v Value> {
    elements(action, "actionParameters")
        .take(ELEMENTS)
        .find(|parameter| text(parameter, "key") == key)?
        .get("value")
}

/// The same for the same JSON value, whatever the order of its members and however a number is written.
fn fingerprint(value: &Value) -> u64 {
    let mut hasher = DefaultHasher::new();
    match value {
        Value::Object(members) => {
            let of_member = |(name, value): (&String, &Value)| {
                let mut hasher = DefaultHasher::new();
                name.hash(&mut hasher);
                fingerprint(value).hash(&mut hasher);
                hasher.finish()
            };
            members
                .iter()
                .map(of_member)
                .fold(0_u64, u64::wrapping_add)
                .hash(&mut hasher);
        }
        Value::Array(list) => list.iter().for_each(|value| fingerprint(value).hash(&mut hasher)),
        Value::Number(number) => number.as_f64().map(f64::to_bits).hash(&mut hasher),
        other => other.to_string().hash(&mut hasher),
    }
    std::mem::discriminant(value).hash(&mut hasher);
    hasher.finish()
}

/// The same for a message that is sent again: headerId and timestamp are left out.
fn content(message: &Value) -> u64 {
    let members = message.as_object().into_iter().flatten();
    members
        .filter(|(name, _)| !matches!(name.as_str(), "headerId" | "timestamp"))
        .map(|(name, value)| {
            let mut hasher = DefaultHasher::new();
            name.hash(&mut hasher);
            fingerprint(value).hash(&mut hasher);
            hasher.finish()
        })
        .fold(0_u64, u64::wrapping_add)
}
