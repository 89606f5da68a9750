//! Where a new order begins, seen from where the vehicle stands.

use serde_json::Value;

use super::{Command, Found, allowed, nodes_in_sequence, place_of};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Deviation, Member, Node, OrderView, StateView};
use tck_world::{Fact, Factsheet, Listen, Observation, ShownState, Topic};

/// `commands/start`.
pub(crate) const START: Check = Check {
    name: "commands/start",
    decides: &["ORD-03"],
    doc: "A new order for an idle vehicle begins at its lastNodeId, or at a place whose allowedDeviationXY covers the \
          reported position. Any state that may still have been under way will do. With `settled`, a vehicle that was \
          set up a moment ago is judged as well: the test has waited until its states show where it stands.",
    arguments: &["settled"],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Starts, Fact::Mock],
    needs: &[OrderView::order_id, Node::node_id, StateView::last_node_id],
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
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Starts, Fact::Mock, Fact::Factsheets],
    needs: &[OrderView::order_id, Node::node_id, StateView::last_node_id],
    start: |_| Box::new(Start::new(Rule::OnNode)),
};

/// `commands/start-between-nodes`.
pub(crate) const CANCELLED_BETWEEN: Check = Check {
    name: "commands/start-between-nodes",
    decides: &["ORD-CANCEL-17"],
    doc: "After cancelOrder stopped a vehicle between nodes, the next order begins at a node where the vehicle stands, or \
          at its lastNodeId with a deviation that reaches the vehicle; a lastNodeId without any deviation is a warning.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Starts, Fact::Mock, Fact::Factsheets],
    needs: &[OrderView::order_id, Node::node_id, StateView::last_node_id],
    start: |_| Box::new(Start::new(Rule::Between)),
};

/// `commands/first-place`.
pub(crate) const FIRST_PLACE: Check = Check {
    name: "commands/first-place",
    decides: &["MAP-02"],
    doc: "A new order that begins at the node on which the vehicle was put says that this node is where the vehicle says \
          it is. One that is far off is in another unit. Only for a test that knows the vehicle to stand on its node, and not at the origin.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::Order)],
    reads: &[Fact::Starts, Fact::Mock],
    needs: &[OrderView::order_id, Node::node_id, StateView::last_node_id],
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
}

/// The distance of the vehicle from the place of its last node, by the orders before.
fn off(seen: &ShownState, context: &CheckContext<'_>) -> Option<f64> {
    let (x, y, _) = seen.pose.as_ref()?;
    let place = context.world.starts().place(&seen.last_node)?;
    Some((x - place.0).hypot(y - place.1))
}

impl Start {
    fn new(rule: Rule) -> Self {
        Self { rule, settled: false }
    }

    fn judge(
        &self,
        node: &Node,
        recent: &[&ShownState],
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        found: &mut Found<'_>,
    ) -> bool {
        let cancelled = context.world.starts().is_behind_cancellation(record);
        let id = node.node_id.or_empty();
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
                let sheets = context.world.factsheets().valid(record, context);
                let bound = !sheets.is_empty() && sheets.iter().all(|sheet| sheet.on_nodes_only);
                let no_pose = recent.iter().all(|seen| seen.pose.is_none());
                if !cancelled || !(bound || no_pose) || newest.is_empty() {
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
                    .any(|seen| off(seen, context).is_some_and(|off| off > BETWEEN));
                if !cancelled || !between || covered == Reach::Unknown {
                    return false;
                }
                let position = node.node_position.there();
                let allowed = position.map_or(&Member::Absent, |position| &position.allowed_deviation_xy);
                if covered == Reach::Yes {
                    return true;
                }
                let unlisted = |sheet: &Factsheet| {
                    let listed = sheet.supported.as_ref();
                    listed.is_some_and(|listed| !listed.iter().any(|one| one.ends_with("allowedDeviationXY")))
                };
                // What the vehicle does not support need not be sent to it.
                let sheets = context.world.factsheets().valid(record, context);
                let unsupported = sheets.iter().any(|sheet| unlisted(sheet));
                if is_last && allowed.is_absent() && unsupported {
                    return false;
                }
                if is_last && allowed.is_absent() {
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
fn other_map<'a>(node: &'a Node, recent: &[&'a ShownState]) -> Option<(&'a str, &'a str)> {
    let map = place_of(node)?.2;
    let (_, _, first) = recent.first()?.pose.as_ref()?;
    let elsewhere = recent
        .iter()
        .all(|seen| matches!(&seen.pose, Some((_, _, on)) if !on.is_empty() && on != map));
    (!map.is_empty() && elsewhere).then_some((map, first.as_str()))
}

/// Whether the place of a node covers where the vehicle says it is; a deviation that is named has to reach it where
/// that is known exactly.
fn covers(node: &Node, seen: &ShownState, exact: bool) -> Reach {
    let (Some((x, y, map)), Some((at_x, at_y, on))) = (place_of(node), seen.pose.as_ref()) else {
        return Reach::Unknown;
    };
    let allowed = allowed(node);
    let named = allowed
        .and_then(Deviation::farthest)
        .is_some_and(|allowed| allowed > 0.0);
    let margin = if exact && named { ROUNDED } else { MEASURED };
    let (dx, dy) = (at_x - x, at_y - y);
    let near = allowed.map_or(dx.hypot(dy) <= margin, |allowed| allowed.allows((dx, dy), margin));
    if near && (map == on || on.is_empty()) {
        Reach::Yes
    } else {
        Reach::No
    }
}

impl Running for Start {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(order) = Command::read(record).and_then(Command::order) else {
            return false;
        };
        // Who knows that the vehicle has nothing to do also knows that an order of another name is a new one.
        let begins = self.settled || order.order_update_id.whole().is_none_or(|update| update == 0);
        let node = nodes_in_sequence(order).into_iter().next();
        let Some(node) = node.filter(|_| begins && context.world.starts().is_new(record)) else {
            return false;
        };
        let vehicle = context.world.mock();
        // A state may overtake the order it answers.
        let own = order.order_id.or_empty();
        let recent = vehicle.recent(record, context);
        let mut recent: Vec<&ShownState> = recent.filter(|seen| seen.order != own).collect();
        if self.settled {
            // The newest may have crossed the order on its way.
            recent.truncate(2);
        }
        let settled = self.settled || (!vehicle.unsettled(record, context) && !record.link.disturbed);
        let idle = recent.first().is_some_and(|seen| seen.is_idle());
        if !settled || !idle || !node.node_id.is_there() {
            return false;
        }
        self.judge(node, &recent, record, context, &mut Found::new(record, findings))
    }
}
