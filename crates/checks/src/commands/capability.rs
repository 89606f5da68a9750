//! Optional fields: only those the factsheet of the vehicle lists, and all of those it requires.

use serde_json::Value;

use super::{Command, ELEMENTS, Found};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Edge, Field, Names, Node, NodePosition, OrderView, Presence, ProtocolFeatures};
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
    needs: &[ProtocolFeatures::optional_parameters],
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
    needs: &[ProtocolFeatures::optional_parameters],
    start: |_| Box::new(Required),
};

/// `commands/omni-only`.
pub(crate) const OMNI_ONLY: Check = Check {
    name: "commands/omni-only",
    decides: &["ORD-MSG-34"],
    doc: "orientationType GLOBAL and reachOrientationBeforeEntering come only to vehicles that drive in all directions, by \
          mobileRobotKinematics of the factsheet. A warning where the factsheet lists the field.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Factsheets],
    needs: &[Edge::orientation_type],
    start: |_| Box::new(OmniOnly),
};

struct OmniOnly;

impl Running for OmniOnly {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let order = Command::read(record).and_then(Command::order);
        let Some(order) = order else { return false };
        let sheets = context.world.factsheets().valid(record, context);
        let is_omni = |sheet: &Factsheet| {
            let kind = sheet.view.type_specification.there();
            kind.is_none_or(|kind| !kind.kinematic.is_there() || kind.kinematic.or_empty().starts_with("OMNI"))
        };
        if sheets.is_empty() || sheets.iter().any(|sheet| is_omni(sheet)) {
            return false;
        }
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for edge in order.edges.iter().take(ELEMENTS) {
            judged = true;
            let global = context.pack.word("orientationType.global").unwrap_or("GLOBAL");
            let fields = [
                (Edge::orientation_type, edge.orientation_type.is(global)),
                (
                    Edge::reach_orientation_before_entering,
                    edge.presence(Edge::reach_orientation_before_entering).is_something(),
                ),
            ];
            for (field, _) in fields.into_iter().filter(|(_, sent)| *sent) {
                let name = field.usual_name();
                let text = format!(
                    "{name} of edge {} is for vehicles that drive in all directions",
                    quote(edge.edge_id.or_empty())
                );
                let field = format!("order.edges.{name}");
                if sheets.iter().any(|sheet| lists(sheet, &field)) {
                    found.remark("ORD-MSG-34", text);
                } else {
                    found.broken("ORD-MSG-34", text);
                }
            }
        }
        judged
    }
}

/// Optional fields by what they belong to.
const OF_POSITION: [Field; 4] = [
    NodePosition::theta,
    NodePosition::allowed_deviation_xy,
    NodePosition::allowed_deviation_theta,
    NodePosition::map_description,
];
const OF_EDGE: [Field; 13] = [
    Edge::edge_description,
    Edge::max_speed,
    Edge::max_height,
    Edge::min_height,
    Edge::orientation,
    Edge::orientation_type,
    Edge::direction,
    Edge::reach_orientation_before_entering,
    Edge::rotation_allowed,
    Edge::max_rotation_speed,
    Edge::trajectory,
    Edge::length,
    Edge::corridor,
];

/// The optional fields of an order that are there, by their full names.
fn present(order: &OrderView, names: &Names) -> Vec<String> {
    let mut found: Vec<(&str, Field)> = Vec::new();
    let mut add = |prefix: &'static str, field: Field, presence: Presence| {
        if presence.is_something() && !found.contains(&(prefix, field)) {
            found.push((prefix, field));
        }
    };
    let described = ActionView::action_description;
    add("order", OrderView::zone_set_id, order.zone_set_id.presence());
    for node in order.nodes.iter().take(ELEMENTS) {
        add("order.nodes", Node::node_description, node.node_description.presence());
        if let Some(position) = node.node_position.there() {
            for field in OF_POSITION {
                add("order.nodes.nodePosition", field, position.presence(field));
            }
        }
        for action in node.actions.iter().take(ELEMENTS) {
            add("order.nodes.actions", described, action.action_description.presence());
        }
    }
    for edge in order.edges.iter().take(ELEMENTS) {
        for field in OF_EDGE {
            add("order.edges", field, edge.presence(field));
        }
        for action in edge.actions.iter().take(ELEMENTS) {
            add("order.edges.actions", described, action.action_description.presence());
        }
    }
    let full = |(prefix, field): (&str, Field)| Some(format!("{prefix}.{}", names.name(field)?));
    found.into_iter().filter_map(full).collect()
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
        for field in present(order, record.names()) {
            if sheets.iter().any(|sheet| lists(sheet, &field)) {
                continue;
            }
            let text = format!("{field} is sent, which the factsheet does not list");
            if field.ends_with("Description") || field.ends_with("Descriptor") {
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
        // The factsheet gives the names of what is looked for.
        let Some(order) = record.delivered_json(Topic::Order) else {
            return false;
        };
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
