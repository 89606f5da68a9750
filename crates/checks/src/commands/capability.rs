//! Optional fields: only those the factsheet of the vehicle lists, and all of those it requires.

use serde_json::Value;

use super::{Command, ELEMENTS, Found};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::elements;
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `commands/optional-fields`.
pub(crate) const OPTIONAL: Check = Check {
    name: "commands/optional-fields",
    decides: &["OPT-03"],
    doc: "Orders hold only optional fields that optionalParameters of the factsheet lists; a field inside of a listed one \
          counts as listed. nodePosition and actionParameters are left to other requirements. Descriptions that are not \
          listed are a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Optional),
};

/// `commands/required-fields`.
pub(crate) const REQUIRED: Check = Check {
    name: "commands/required-fields",
    decides: &["OPT-05"],
    doc: "Orders hold every optional field that the factsheet marks as REQUIRED, wherever there is something it could be \
          a field of.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Required),
};

/// Optional fields by the list they belong to.
const OF_NODE: [&str; 1] = ["nodeDescription"];
const OF_POSITION: [&str; 4] = ["theta", "allowedDeviationXY", "allowedDeviationTheta", "mapDescription"];
const OF_EDGE: [&str; 12] = [
    "edgeDescription",
    "maxSpeed",
    "maxHeight",
    "minHeight",
    "orientation",
    "orientationType",
    "direction",
    "rotationAllowed",
    "maxRotationSpeed",
    "trajectory",
    "length",
    "corridor",
];

/// The optional fields of an order that are there, by their full names.
fn present(order: &Value) -> Vec<String> {
    let mut all = Vec::new();
    let mut add = |value: &Value, prefix: &str, names: &[&str]| {
        for name in names {
            if value.get(*name).is_some_and(|field| !field.is_null()) {
                let full = format!("{prefix}.{name}");
                if !all.contains(&full) {
                    all.push(full);
                }
            }
        }
    };
    add(order, "order", &["zoneSetId"]);
    for node in elements(order, "nodes").take(ELEMENTS) {
        add(node, "order.nodes", &OF_NODE);
        if let Some(position) = node.get("nodePosition") {
            add(position, "order.nodes.nodePosition", &OF_POSITION);
        }
        for action in elements(node, "actions").take(ELEMENTS) {
            add(action, "order.nodes.actions", &["actionDescription"]);
        }
    }
    for edge in elements(order, "edges").take(ELEMENTS) {
        add(edge, "order.edges", &OF_EDGE);
        for action in elements(edge, "actions").take(ELEMENTS) {
            add(action, "order.edges.actions", &["actionDescription"]);
        }
    }
    all
}

/// Whether a factsheet lists a field: under its full name, under the end of it, or with what it belongs to.
fn lists(sheet: &Factsheet, field: &str) -> bool {
    let last = field.rsplit('.').next().unwrap_or_default();
    let position = field.contains(".nodePosition.");
    sheet.supported.iter().flatten().any(|listed| {
        let end = listed.rsplit('.').next().unwrap_or_default();
        end == last || (position && end == "nodePosition") || listed == "order"
    })
}

struct Optional;

impl Running for Optional {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() || sheets.iter().any(|sheet| sheet.supported.is_none()) {
            return false;
        }
        let mut found = Found::new(record, findings);
        for field in present(order) {
            if sheets.iter().any(|sheet| lists(sheet, &field)) {
                continue;
            }
            let text = format!("{field} is sent, which the factsheet does not list");
            if field.ends_with("Description") {
                found.remark("OPT-03", text);
            } else {
                found.broken("OPT-03", text);
            }
        }
        true
    }
}

struct Required;

impl Running for Required {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let sheets = context.world.factsheets().valid(record, context);
        let Some((first, others)) = sheets.split_first() else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for name in first.required.iter().take(ELEMENTS) {
            if !others.iter().all(|sheet| sheet.required.contains(name)) {
                continue;
            }
            let mut steps = name.split('.');
            if steps.next() != Some("order") {
                continue;
            }
            let steps: Vec<&str> = steps.take(8).collect();
            let mut missing = 0_usize;
            judged |= look_for(order, &steps, &mut missing);
            if missing > 0 {
                found.broken(
                    "OPT-05",
                    format!("{} is missing, which the factsheet requires", quote(name)),
                );
            }
        }
        judged
    }
}

/// Counts where a field is missing; returns whether there was a place for it at all.
fn look_for(value: &Value, steps: &[&str], missing: &mut usize) -> bool {
    let Some((step, rest)) = steps.split_first() else {
        return false;
    };
    if rest.is_empty() {
        *missing += usize::from(value.get(*step).is_none_or(Value::is_null));
        return true;
    }
    match value.get(*step) {
        Some(Value::Array(list)) => {
            let all = list.iter().take(ELEMENTS).filter(|element| element.is_object());
            // Every element is looked at, not only those up to the first place.
            all.fold(false, |any, element| look_for(element, rest, missing) | any)
        }
        Some(inner @ Value::Object(_)) => look_for(inner, rest, missing),
        _ => false,
    }
}
