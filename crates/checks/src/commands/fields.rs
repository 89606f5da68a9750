//! Fields of orders that no schema can judge: arrays that are left out, positions, zones, identifiers, topics.

use std::f64::consts::PI;
use std::sync::LazyLock;

use regex::Regex;
use serde_json::Value;

use super::{Command, ELEMENTS, Each, Found, in_sequence};
use crate::finding::{quote, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::{elements, text};
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `commands/arrays`.
pub(crate) const ARRAYS: Check = Check {
    name: "commands/arrays",
    decides: &["ORD-MSG-06"],
    doc: "edges, and the actions of every node and edge, are sent as empty arrays where there are none.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    start: |_| Each::start(arrays),
};

/// `commands/position-range`.
pub(crate) const POSITION_RANGE: Check = Check {
    name: "commands/position-range",
    decides: &["ORD-MSG-09", "MAP-02"],
    doc: "theta of a node lies between minus pi and pi, allowedDeviationXY is not below 0, allowedDeviationTheta lies \
          between 0 and pi. Coordinates that are far too big for metres are a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    start: |_| Each::start(position_range),
};

/// `commands/zone-set`.
pub(crate) const ZONE_SET: Check = Check {
    name: "commands/zone-set",
    decides: &["ORD-MSG-03"],
    doc: "zoneSetId is left out or names a zone set; it is neither null nor empty. A word for nothing, such as none, is \
          a warning, and fails where the factsheet of the vehicle does not support the field.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(ZoneSet),
};

/// `commands/identifiers`.
pub(crate) const IDENTIFIERS: Check = Check {
    name: "commands/identifiers",
    decides: &["JSON-04"],
    doc: "The identifiers in orders and instant actions keep to the recommended characters.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[],
    start: |_| Each::start(identifiers),
};

/// `commands/topics`.
pub(crate) const TOPICS: Check = Check {
    name: "commands/topics",
    decides: &["TOPIC-13"],
    doc: "What comes on the order topic is an order, what comes on the instantActions topic is a list of actions, and \
          not the other way round.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[],
    start: |_| Each::start(topics),
};

/// `commands/node-position`.
pub(crate) const POSITION: Check = Check {
    name: "commands/node-position",
    decides: &["ORD-MSG-08"],
    doc: "Every node has a nodePosition, unless the vehicle is bound to lines. A missing one is a warning where the \
          factsheet does not require it; a factsheet that lists optional parameters, and not this one, has no use for it.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Position),
};

/// What rounding may add to pi.
const ROUNDING: f64 = 1.0e-9;
/// Beyond this many metres a coordinate is taken for another unit.
const FAR: f64 = 1.0e6;

static IDENTIFIER: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"^[A-Za-z0-9_.:-]*$").ok());

fn arrays(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    if order.get("nodes").is_none() {
        return false;
    }
    if order.get("edges").is_none() {
        found.broken("ORD-MSG-06", "edges is left out");
    }
    for (list, id) in [("nodes", "nodeId"), ("edges", "edgeId")] {
        for element in elements(order, list)
            .take(ELEMENTS)
            .filter(|element| element.is_object())
        {
            if element.get("actions").is_none() {
                let id = quote(text(element, id));
                found.broken("ORD-MSG-06", format!("actions of {id} is left out"));
            }
        }
    }
    true
}

fn position_range(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    let mut judged = false;
    for node in in_sequence(order, "nodes") {
        let Some(position) = node.get("nodePosition").filter(|position| position.is_object()) else {
            continue;
        };
        judged = true;
        let id = quote(text(node, "nodeId"));
        let number = |name: &str| position.get(name).and_then(Value::as_f64);
        if let Some(theta) = number("theta").filter(|theta| theta.abs() > PI + ROUNDING) {
            let text = format!("theta {theta} of node {id} is not between minus pi and pi");
            found.broken("ORD-MSG-09", text.clone());
            found.broken("MAP-02", text);
        }
        if let Some(allowed) = number("allowedDeviationXY").filter(|allowed| *allowed < 0.0) {
            found.broken(
                "ORD-MSG-09",
                format!("allowedDeviationXY {allowed} of node {id} is below 0"),
            );
        }
        let turned = number("allowedDeviationTheta").filter(|allowed| !(0.0..=PI + ROUNDING).contains(allowed));
        if let Some(allowed) = turned {
            let text = format!("allowedDeviationTheta {allowed} of node {id} is not between 0 and pi");
            found.broken("ORD-MSG-09", text);
        }
        for name in ["x", "y"] {
            if let Some(value) = number(name).filter(|value| value.abs() > FAR) {
                found.remark(
                    "MAP-02",
                    format!("{name} {value} of node {id} is not likely to be in metres"),
                );
            }
        }
    }
    judged
}

/// Words that say that there is nothing, where nothing should be said.
const NOTHING: [&str; 7] = ["none", "null", "nil", "undefined", "n/a", "na", "-"];

struct ZoneSet;

impl Running for ZoneSet {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let mut found = Found::new(record, findings);
        match order.get("zoneSetId") {
            Some(Value::Null) => found.broken("ORD-MSG-03", "zoneSetId is null"),
            Some(Value::String(text)) if text.is_empty() => found.broken("ORD-MSG-03", "zoneSetId is empty"),
            Some(Value::String(text)) if NOTHING.contains(&text.to_ascii_lowercase().trim()) => {
                let sheets = context.world.factsheets().valid(record, context);
                let unlisted = |sheet: &Factsheet| {
                    let listed = sheet.supported.as_ref();
                    listed.is_some_and(|listed| !listed.iter().any(|one| one.ends_with("zoneSetId")))
                };
                let message = format!("zoneSetId is {}, a word for no zone set", quote(text));
                if !sheets.is_empty() && sheets.iter().all(|sheet| unlisted(sheet)) {
                    found.broken("ORD-MSG-03", message);
                } else {
                    found.remark("ORD-MSG-03", message);
                }
            }
            _ => {}
        }
        true
    }
}

/// Every identifier in a message: what it is, and the text.
pub(super) fn ids<'v>(command: Command<'v>) -> Vec<(&'static str, &'v str)> {
    let mut all = Vec::new();
    let mut add = |value: &'v Value, name: &'static str| {
        all.extend(value.get(name).and_then(Value::as_str).map(|text| (name, text)));
    };
    if let Command::Order(order) = command {
        add(order, "orderId");
        add(order, "zoneSetId");
        for node in elements(order, "nodes").take(ELEMENTS) {
            add(node, "nodeId");
            if let Some(position) = node.get("nodePosition") {
                add(position, "mapId");
            }
        }
        for edge in elements(order, "edges").take(ELEMENTS) {
            for name in ["edgeId", "startNodeId", "endNodeId"] {
                add(edge, name);
            }
        }
    }
    for (_, action) in command.actions() {
        add(action, "actionId");
    }
    all
}

fn identifiers(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(form) = IDENTIFIER.as_ref() else { return false };
    let ids = ids(command);
    for (name, id) in &ids {
        if !form.is_match(id) {
            let text = format!("{name} {} holds other characters than recommended", quote(id));
            found.broken("JSON-04", text);
        }
    }
    !ids.is_empty()
}

fn topics(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let value = command.value();
    let has = |name: &str| value.get(name).is_some();
    let is_order = has("nodes") || has("orderId");
    let is_instant = ["actions", "instantActions"]
        .iter()
        .any(|name| value.get(*name).is_some_and(Value::is_array));
    match command {
        Command::Order(_) if is_instant && !is_order => {
            found.broken("TOPIC-13", "instant actions come on the order topic");
        }
        Command::Instant(_) if is_order && !is_instant => {
            found.broken("TOPIC-13", "an order comes on the instantActions topic");
        }
        _ => {}
    }
    is_order || is_instant
}

/// Whether an optional parameter of a factsheet is the position of a node, or something in it.
fn names_position(parameter: &str) -> bool {
    parameter.split('.').any(|level| level == "nodePosition")
}

struct Position;

impl Running for Position {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let sheets = context.world.factsheets().valid(record, context);
        // A vehicle nobody has described may be of any kind.
        let unlisted = |sheet: &Factsheet| {
            sheet
                .supported
                .as_ref()
                .is_some_and(|listed| !listed.iter().any(|one| names_position(one)))
        };
        if sheets.is_empty() || sheets.iter().any(|sheet| sheet.line_guided || unlisted(sheet)) {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for node in in_sequence(order, "nodes") {
            judged = true;
            if node.get("nodePosition").is_some_and(Value::is_object) {
                continue;
            }
            let id = quote(text(node, "nodeId"));
            let shown = node.get("nodePosition").map_or_else(|| "missing".to_owned(), show);
            let message = format!("nodePosition of node {id} is {shown}");
            let required = |name: &str| name.rsplit('.').next() == Some("nodePosition");
            if sheets
                .iter()
                .all(|sheet| sheet.required.iter().any(|name| required(name)))
            {
                found.broken("ORD-MSG-08", message);
            } else {
                found.remark("ORD-MSG-08", message);
            }
        }
        judged
    }
}
