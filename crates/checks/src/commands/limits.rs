//! The limits a vehicle states in its factsheet: how long, how many, how often.

use serde_json::Value;

use super::fields::ids;
use super::{Command, ELEMENTS, Found, parameter};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Event, LinkFault};
use tck_world::members::{elements, text};
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `commands/limits`.
pub(crate) const SIZES: Check = Check {
    name: "commands/limits",
    decides: &["FACT-12"],
    doc: "Orders and instant actions keep the lengths of arrays, ids, enumerations and whole messages that the factsheet \
          of the vehicle states, and its wish for ids of digits only. 0 and a missing limit are none.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Sizes),
};

/// `commands/order-interval`.
pub(crate) const ORDER_INTERVAL: Check = Check {
    name: "commands/order-interval",
    decides: &["FACT-13"],
    doc: "Between two order messages lies at least minOrderInterval of the factsheet, with a margin of a tenth and \
          50 ms. Judged only while the link is not disturbed; the first order behind a link that was cut counts from the \
          last one before.",
    arguments: &[],
    listens: &[Listen::Fault, Listen::Hook, Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Interval::default()),
};

struct Sizes;

impl Running for Sizes {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        let limited = |sheet: &Factsheet| !sheet.strings.is_empty() || !sheet.arrays.is_empty() || sheet.numerical;
        if sheets.is_empty() || !sheets.iter().all(|sheet| limited(sheet)) {
            return false;
        }
        let length = record.payload().map_or(0, tck_journal::Payload::len);
        let all: Vec<Vec<String>> = sheets.iter().map(|sheet| excesses(sheet, command, length)).collect();
        // Wrong is what no factsheet that counts allows.
        if all.iter().all(|excesses| !excesses.is_empty()) {
            let mut found = Found::new(record, findings);
            for text in all.into_iter().next().unwrap_or_default() {
                found.broken("FACT-12", text);
            }
        }
        true
    }
}

/// Arrays of a message with their names in a factsheet.
fn arrays(command: Command<'_>) -> Vec<(&'static str, usize)> {
    let count = |value: &Value, name: &str| elements(value, name).count();
    let mut all = Vec::new();
    match command {
        Command::Instant(message) => all.push(("instantActions", count(message, "actions"))),
        Command::Order(order) => {
            all.push(("order.nodes", count(order, "nodes")));
            all.push(("order.edges", count(order, "edges")));
            for node in elements(order, "nodes").take(ELEMENTS) {
                all.push(("node.actions", count(node, "actions")));
            }
            for edge in elements(order, "edges").take(ELEMENTS) {
                all.push(("edge.actions", count(edge, "actions")));
                if let Some(curve) = edge.get("trajectory") {
                    all.push(("trajectory.knotVector", count(curve, "knotVector")));
                    all.push(("trajectory.controlPoints", count(curve, "controlPoints")));
                }
            }
        }
    }
    let actions = command.actions().into_iter();
    all.extend(actions.map(|(_, action)| ("actions.actionsParameters", count(action, "actionParameters"))));
    all
}

fn excesses(sheet: &Factsheet, command: Command<'_>, length: u64) -> Vec<String> {
    let string = |name: &str| sheet.strings.get(name).copied().unwrap_or(u64::MAX);
    let chars = |text: &str| text.chars().count() as u64;
    let mut all = Vec::new();
    if length > string("msgLen") {
        all.push(format!(
            "the message has {length} bytes, msgLen is {}",
            string("msgLen")
        ));
    }
    for (name, count) in arrays(command) {
        if let Some(limit) = sheet.arrays.get(name).filter(|limit| count as u64 > **limit) {
            all.push(format!("{name} has {count} elements, the limit is {limit}"));
        }
    }
    for (name, id) in ids(command) {
        if chars(id) > string("idLen") {
            all.push(format!("{name} {} is longer than idLen {}", quote(id), string("idLen")));
        }
        if sheet.numerical && !id.bytes().all(|byte| byte.is_ascii_digit()) {
            all.push(format!("{name} {} is not made of digits only", quote(id)));
        }
    }
    for (_, action) in command.actions() {
        let blocking = text(action, "blockingType");
        if chars(blocking) > string("enumLen") {
            all.push(format!("blockingType {} is longer than enumLen", quote(blocking)));
        }
        let load = parameter(action, "loadId").and_then(Value::as_str).unwrap_or_default();
        if chars(load) > string("loadIdLen") {
            all.push(format!("loadId {} is longer than loadIdLen", quote(load)));
        }
    }
    all
}

#[derive(Default)]
struct Interval {
    last: Option<Moment>,
    /// The link was cut since the last order.
    cut: bool,
}

impl Running for Interval {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        match record.event() {
            Event::Fault {
                fault: LinkFault::Cut { .. },
            } => self.cut = true,
            Event::Fault {
                fault: LinkFault::Restore,
            } if self.cut => {}
            // What is held back or lost comes at other times than it was sent.
            Event::Fault { .. } => self.last = None,
            Event::Hook { hook, .. } if matches!(hook.as_str(), "start" | "shutdown") => self.last = None,
            _ => {}
        }
        let order = Command::read(record).and_then(Command::order);
        if order.is_none() || record.link.disturbed {
            return false;
        }
        let now = record.at().moment;
        let before = self.last.replace(now);
        if std::mem::take(&mut self.cut) {
            // What was sent while the link was down may come all at once. It is never earlier than it was sent.
            self.last = None;
        }
        let Some(before) = before else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        let Some(interval) = sheets.iter().map(|sheet| sheet.interval).reduce(f64::min) else {
            return false;
        };
        if interval <= 0.0 {
            return false;
        }
        let gap = now.since(before).as_secs_f64();
        if gap < interval * 0.9 - 0.05 {
            let text = format!("two orders come {gap:.2} s apart, minOrderInterval is {interval} s");
            Found::new(record, findings).broken("FACT-13", text);
        }
        true
    }
}
