//! Fields of orders that no schema can judge: arrays that are left out, positions, zones, identifiers, topics.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::{Command, Each, Found, elements, nodes_in_sequence};
use crate::finding::{number, quote, show};
use regex::Regex;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{
    ActionView, Deviation, Edge, Element, Field, InstantActionsView, Member, MessageView, Node, NodePosition,
    OrderView, Text,
};
use tck_world::ordered::ELEMENTS;
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `commands/arrays`.
pub(crate) const ARRAYS: Check = Check {
    name: "commands/arrays",
    decides: &["ORD-MSG-06"],
    doc: "edges, and the actions of every node and edge, are sent as empty arrays where there are none.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[OrderView::edges, Node::actions, Edge::actions],
    start: |_| Each::start(arrays),
};

/// `commands/position-range`.
pub(crate) const POSITION_RANGE: Check = Check {
    name: "commands/position-range",
    decides: &["ORD-MSG-09", "MAP-02"],
    doc: "theta of a node lies between minus pi and pi, allowedDeviationXY is not below 0, allowedDeviationTheta lies \
          between 0 and pi. An ellipse whose a is less than its b, or whose theta is more than a half turn, is a warning. Coordinates \
          that are far too big for metres are a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[Node::node_position],
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
    needs: &[OrderView::zone_set_id],
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
    needs: &[OrderView::order_id, ActionView::action_id],
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
    needs: &[OrderView::nodes, InstantActionsView::actions],
    start: |_| Box::new(Topics),
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
    needs: &[Node::node_position],
    start: |_| Box::new(Position),
};

/// What rounding may add to pi.
const ROUNDING: f64 = 1.0e-9;
/// Beyond this many metres a coordinate is taken for another unit.
const FAR: f64 = 1.0e6;

static IDENTIFIER: LazyLock<Option<Regex>> = LazyLock::new(|| Regex::new(r"^[A-Za-z0-9_.:-]*$").ok());

fn arrays(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    if order.nodes.is_absent() {
        return false;
    }
    if order.edges.is_absent() {
        found.broken("ORD-MSG-06", "order/edges: `edges` is missing");
    }
    let nodes = order.nodes.iter().map(Element::Node).enumerate().take(ELEMENTS);
    let edges = order.edges.iter().map(Element::Edge).enumerate().take(ELEMENTS);
    for (at, element) in nodes.chain(edges).filter(|(_, element)| element.is_object()) {
        if element.actions().is_absent() {
            let list = if element.is_edge() { "edges" } else { "nodes" };
            found.broken("ORD-MSG-06", format!("order/{list}/{at}/actions: `actions` is missing"));
        }
    }
    true
}

fn position_range(command: Command<'_>, _: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
    let Some(order) = command.order() else { return false };
    let mut judged = false;
    for node in nodes_in_sequence(order) {
        let Some(position) = node.node_position.there() else {
            continue;
        };
        judged = true;
        let id = quote(node.node_id.or_empty());
        if let Some(theta) = position.theta.float().filter(|theta| theta.abs() > PI + ROUNDING) {
            let text = format!("theta {} of node {id} is not between minus pi and pi", number(theta));
            found.broken("ORD-MSG-09", text.clone());
            found.broken("MAP-02", text);
        }
        if let Some(allowed) = position
            .allowed_deviation_xy
            .there()
            .and_then(Deviation::nearest)
            .filter(|allowed| *allowed < 0.0)
        {
            found.broken(
                "ORD-MSG-09",
                format!("allowedDeviationXY {} of node {id} is below 0", number(allowed)),
            );
        }
        if let Some(Deviation::Ellipse(ellipse)) = position.allowed_deviation_xy.there()
            && let (Some(a), Some(b)) = (ellipse.a.float(), ellipse.b.float())
            && a < b
        {
            let text = format!(
                "a {} of allowedDeviationXY of node {id} is less than b {}",
                number(a),
                number(b)
            );
            found.remark("ORD-MSG-09", text);
        }
        if let Some(Deviation::Ellipse(ellipse)) = position.allowed_deviation_xy.there()
            && let Some(theta) = ellipse.theta.float().filter(|theta| theta.abs() > PI + ROUNDING)
        {
            let text = format!(
                "theta {} of allowedDeviationXY of node {id} is more than a half turn",
                number(theta)
            );
            found.remark("ORD-MSG-09", text);
        }
        let turned = position.allowed_deviation_theta.float();
        let turned = turned.filter(|allowed| !(0.0..=PI + ROUNDING).contains(allowed));
        if let Some(allowed) = turned {
            let text = format!(
                "allowedDeviationTheta {} of node {id} is not between 0 and pi",
                number(allowed)
            );
            found.broken("ORD-MSG-09", text);
        }
        for (name, coordinate) in [("x", &position.x), ("y", &position.y)] {
            if let Some(value) = coordinate.float().filter(|value| value.abs() > FAR) {
                found.remark(
                    "MAP-02",
                    format!("{name} {} of node {id} is not likely to be in metres", number(value)),
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
        match &order.zone_set_id {
            Member::Null => found.broken("ORD-MSG-03", "zoneSetId is null"),
            Member::There(text) if text.is_empty() => found.broken("ORD-MSG-03", "zoneSetId is empty"),
            Member::There(text) if NOTHING.contains(&text.to_ascii_lowercase().trim()) => {
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
pub(super) fn ids(command: Command<'_>) -> Vec<(&'static str, &Text)> {
    let mut all = Vec::new();
    if let Command::Order(order) = command {
        let mut add = |field: Field, member| all.extend(named(field, member));
        add(OrderView::order_id, &order.order_id);
        add(OrderView::zone_set_id, &order.zone_set_id);
        for element in elements(order) {
            match element {
                Element::Node(node) => {
                    add(Node::node_id, &node.node_id);
                    if let Some(position) = node.node_position.there() {
                        add(NodePosition::map_id, &position.map_id);
                    }
                }
                Element::Edge(edge) => {
                    add(Edge::edge_id, &edge.edge_id);
                    add(Edge::start_node_id, &edge.start_node_id);
                    add(Edge::end_node_id, &edge.end_node_id);
                }
            }
        }
    }
    let actions = command.actions().into_iter();
    all.extend(actions.filter_map(|(_, action)| named(ActionView::action_id, &action.action_id)));
    all
}

fn named(field: Field, member: &Member<Text>) -> Option<(&'static str, &Text)> {
    Some((field.usual_name(), member.there()?))
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

struct Topics;

fn is_order(order: &OrderView) -> bool {
    !order.nodes.is_absent() || !order.order_id.is_absent()
}

fn is_instant(message: &InstantActionsView) -> bool {
    message.actions.is_there() || message.misnamed_actions.is_there()
}

impl Running for Topics {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let own = match command {
            Command::Order(order) => is_order(order),
            Command::Instant(message) => is_instant(message),
        };
        if own {
            return true;
        }
        // What is none of its topic is read as what it may have been meant for.
        let read = |topic| record.entry.view(topic, record.names());
        let wrong = match command {
            Command::Order(_) => {
                let meant = read(Topic::InstantActions).and_then(MessageView::instant_actions);
                meant
                    .is_some_and(|message| is_instant(message))
                    .then_some("instant actions come on the order topic")
            }
            Command::Instant(_) => {
                let meant = read(Topic::Order).and_then(MessageView::order);
                meant
                    .is_some_and(|order| is_order(order))
                    .then_some("an order comes on the instantActions topic")
            }
        };
        if let Some(wrong) = wrong {
            Found::new(record, findings).broken("TOPIC-13", wrong);
        }
        wrong.is_some()
    }
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
        for node in nodes_in_sequence(order) {
            judged = true;
            let shown = match &node.node_position {
                Member::There(_) => continue,
                Member::Absent => "missing".to_owned(),
                Member::Null => "null".to_owned(),
                Member::Other(other) => show(other),
            };
            let id = quote(node.node_id.or_empty());
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
