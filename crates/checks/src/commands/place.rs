//! Where a new order begins, seen from where the vehicle stands.

use std::collections::BTreeSet;

use serde_json::Value;

use super::sheet::{Sheet, Sheets};
use super::vehicle::{Outside, Seen, Vehicle};
use super::{Command, Found, in_sequence, place_of, short};
use crate::orders::number;
use crate::traffic::{Traffic, quote, text};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::Entry;

/// `commands/start`.
pub(crate) const START: Check = Check {
    name: "commands/start",
    decides: &["ORD-03"],
    doc: "A new order for an idle vehicle begins at its lastNodeId, or at a place whose allowedDeviationXY covers the \
          reported position. Any state that may still have been under way will do. With `settled`, a vehicle that was \
          set up a moment ago is judged as well: the test has waited until its states show where it stands.",
    arguments: &["settled"],
    start: |context| {
        let settled = context.with.get("settled") == Some(&Value::Bool(true));
        Box::new(Start {
            settled,
            ..Start::new(Rule::Start)
        })
    },
};

/// `commands/start-on-node`.
pub(crate) const CANCELLED_ON_NODE: Check = Check {
    name: "commands/start-on-node",
    decides: &["ORD-CANCEL-14"],
    doc: "After cancelOrder, the next order of a vehicle that localizes on nodes by tags, or reports no position, begins \
          at its lastNodeId.",
    arguments: &[],
    start: |_| Box::new(Start::new(Rule::OnNode)),
};

/// `commands/start-between-nodes`.
pub(crate) const CANCELLED_BETWEEN: Check = Check {
    name: "commands/start-between-nodes",
    decides: &["ORD-CANCEL-17"],
    doc: "After cancelOrder stopped a vehicle between nodes, the next order begins at a node where the vehicle stands, or \
          at its lastNodeId with a deviation that reaches the vehicle; a lastNodeId without any deviation is a warning.",
    arguments: &[],
    start: |_| Box::new(Start::new(Rule::Between)),
};

/// `commands/first-place`.
pub(crate) const FIRST_PLACE: Check = Check {
    name: "commands/first-place",
    decides: &["MAP-02"],
    doc: "A new order that begins at the node on which the vehicle was put says that this node is where the vehicle says \
          it is. One that is far off is in another unit. Only for a test that knows the vehicle to stand on its node, and not at the origin.",
    arguments: &[],
    start: |_| {
        Box::new(Start {
            settled: true,
            ..Start::new(Rule::Place)
        })
    },
};

/// How far a position may be off by measuring and rounding, in metres.
const MEASURED: f64 = 0.3;
/// How far a position may be off by rounding alone, in metres.
const ROUNDED: f64 = 0.06;
/// Farther off than this is another unit, and not another direction, in metres.
const FAR_OFF: f64 = 50.0;
/// A vehicle this far from the place of its last node stands between nodes, in metres.
const BETWEEN: f64 = 0.6;
/// How many ids are remembered.
const IDS: usize = 1024;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Rule {
    Start,
    OnNode,
    Between,
    Place,
}

struct Start {
    rule: Rule,
    /// The one who asks knows that the vehicle stands where it says.
    settled: bool,
    traffic: Traffic,
    sheets: Sheets,
    vehicle: Vehicle,
    orders: BTreeSet<String>,
    /// Places of nodes, from the orders.
    places: std::collections::BTreeMap<String, (f64, f64)>,
    /// Whether the order before was called off.
    cancelled: bool,
}

impl Start {
    fn new(rule: Rule) -> Self {
        Self {
            rule,
            settled: false,
            traffic: Traffic::default(),
            sheets: Sheets::default(),
            vehicle: Vehicle::default(),
            orders: BTreeSet::new(),
            places: std::collections::BTreeMap::new(),
            cancelled: false,
        }
    }

    /// The distance of the vehicle from the place of its last node.
    fn off(&self, seen: &Seen) -> Option<f64> {
        let (x, y, _) = seen.pose.as_ref()?;
        let place = self.places.get(&seen.last_node)?;
        Some((x - place.0).hypot(y - place.1))
    }

    fn judge(
        &self,
        node: &Value,
        recent: &[&Seen],
        sheets: &Sheets,
        entry: &Entry,
        context: &CheckContext<'_>,
        found: &mut Found<'_>,
    ) -> bool {
        let id = text(node, "nodeId");
        let is_last = recent.iter().any(|seen| seen.last_node == id);
        // What was set up by the harness stands exactly there.
        let exact = self.settled && self.rule == Rule::Start;
        let covered = recent
            .iter()
            .map(|seen| covers(node, seen, exact))
            .max()
            .unwrap_or(Reach::Unknown);
        let newest = recent.first().map(|seen| seen.last_node.as_str()).unwrap_or_default();
        let shown = quote(id);
        match self.rule {
            Rule::Start => {
                if let Some((map, on)) = other_map(node, recent).filter(|_| exact) {
                    let text = format!(
                        "the order begins at node {shown} on map {}, the vehicle is on {}",
                        quote(map),
                        quote(on)
                    );
                    found.broken("ORD-03", text);
                    return true;
                }
                if is_last || covered == Reach::Yes {
                    return true;
                }
                // A vehicle that never was on a node and does not know its position could be anywhere.
                if covered == Reach::Unknown && recent.iter().any(|seen| seen.last_node.is_empty()) {
                    return false;
                }
                let text = format!(
                    "the order begins at node {shown}, the vehicle was last on {}",
                    quote(newest)
                );
                found.broken("ORD-03", text);
                true
            }
            Rule::Place => {
                let Some(seen) = recent.first().filter(|seen| seen.last_node == id) else {
                    return false;
                };
                let (Some((x, y, _)), Some((at_x, at_y, _))) = (place_of(node), seen.pose.as_ref()) else {
                    return false;
                };
                let off = (x - at_x).hypot(y - at_y);
                if off > FAR_OFF {
                    let text = format!("node {shown} is said to be {off:.1} m from where the vehicle stands on it");
                    found.broken("MAP-02", text);
                }
                true
            }
            Rule::OnNode => {
                let sheets = sheets.valid(entry, context);
                let bound = !sheets.is_empty() && sheets.iter().all(|sheet| sheet.on_nodes_only);
                let no_pose = recent.iter().all(|seen| seen.pose.is_none());
                if !self.cancelled || !(bound || no_pose) || newest.is_empty() {
                    return false;
                }
                if !is_last {
                    let text = format!(
                        "the order begins at node {shown}, the vehicle stands on {}",
                        quote(newest)
                    );
                    found.broken("ORD-CANCEL-14", text);
                }
                true
            }
            Rule::Between => {
                let between = recent
                    .iter()
                    .take(1)
                    .any(|seen| self.off(seen).is_some_and(|off| off > BETWEEN));
                if !self.cancelled || !between || covered == Reach::Unknown {
                    return false;
                }
                let allowed = node.pointer("/nodePosition/allowedDeviationXY");
                if covered == Reach::Yes {
                    return true;
                }
                let unlisted = |sheet: &Sheet| {
                    let listed = sheet.supported.as_ref();
                    listed.is_some_and(|listed| !listed.iter().any(|one| one.ends_with("allowedDeviationXY")))
                };
                // What the vehicle does not support need not be sent to it.
                let unsupported = sheets.valid(entry, context).iter().any(|sheet| unlisted(sheet));
                if is_last && allowed.is_none() && unsupported {
                    return false;
                }
                if is_last && allowed.is_none() {
                    let text = format!("the order begins at node {shown} without a deviation that reaches the vehicle");
                    found.remark("ORD-CANCEL-17", text);
                } else {
                    let text = format!("the order begins at node {shown}, which the vehicle cannot reach trivially");
                    found.broken("ORD-CANCEL-17", text);
                }
                true
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Reach {
    Unknown,
    No,
    Yes,
}

/// The map of a node and that of the vehicle, where it was on another one in every state that counts.
fn other_map<'a>(node: &'a Value, recent: &[&'a Seen]) -> Option<(&'a str, &'a str)> {
    let map = place_of(node)?.2;
    let (_, _, first) = recent.first()?.pose.as_ref()?;
    let elsewhere = recent
        .iter()
        .all(|seen| matches!(&seen.pose, Some((_, _, on)) if !on.is_empty() && on != map));
    (!map.is_empty() && elsewhere).then_some((map, first.as_str()))
}

/// Whether the place of a node covers where the vehicle says it is; a deviation that is named has to reach it where
/// that is known exactly.
fn covers(node: &Value, seen: &Seen, exact: bool) -> Reach {
    let (Some((x, y, map)), Some((at_x, at_y, on))) = (place_of(node), seen.pose.as_ref()) else {
        return Reach::Unknown;
    };
    let allowed = node.pointer("/nodePosition/allowedDeviationXY").and_then(Value::as_f64);
    let named = allowed.is_some_and(|allowed| allowed > 0.0);
    let margin = if exact && named { ROUNDED } else { MEASURED };
    let near = (x - at_x).hypot(y - at_y) <= allowed.unwrap_or_default().max(0.0) + margin;
    if near && (map == on || on.is_empty()) {
        Reach::Yes
    } else {
        Reach::No
    }
}

impl Running for Start {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        self.sheets.note(entry, context);
        if matches!(self.vehicle.note(entry, context), Outside::Moved | Outside::Lost) {
            self.cancelled = false;
        }
        let Some(command) = Command::read(self.traffic, entry, context) else {
            return false;
        };
        let Command::Order(order) = command else {
            let mut actions = command.actions().into_iter();
            self.cancelled |= actions.any(|(_, action)| text(action, "actionType") == "cancelOrder");
            return false;
        };
        let Some(id) = short(order, "orderId") else {
            return false;
        };
        if self.orders.len() == IDS {
            self.orders.pop_first();
        }
        let is_new = self.orders.insert(id);
        let nodes = in_sequence(order, "nodes");
        let mut judged = false;
        // Who knows that the vehicle has nothing to do also knows that an order of another name is a new one.
        let begins = self.settled || number(order, "orderUpdateId").is_none_or(|update| update == 0);
        if let Some(node) = nodes.first().filter(|_| is_new && begins) {
            // A state may overtake the order it answers.
            let own = text(order, "orderId");
            let recent = self.vehicle.recent(entry, context);
            let mut recent: Vec<&Seen> = recent.filter(|seen| seen.order != own).collect();
            if self.settled {
                // The newest may have crossed the order on its way.
                recent.truncate(2);
            }
            let settled = self.settled || (!self.vehicle.unsettled(entry, context) && !self.traffic.disturbed);
            let idle = recent.first().is_some_and(|seen| seen.is_idle());
            if settled && idle && node.get("nodeId").is_some_and(Value::is_string) {
                let mut found = Found::new(entry, findings);
                judged = self.judge(node, &recent, &self.sheets, entry, context, &mut found);
            }
            self.cancelled = false;
        }
        for node in nodes {
            if let (Some(id), Some((x, y, _))) = (short(node, "nodeId"), place_of(node))
                && (self.places.len() < IDS || self.places.contains_key(&id))
            {
                self.places.insert(id, (x, y));
            }
        }
        judged
    }
}
