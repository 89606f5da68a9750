//! `state/node-positions`, `state/joint-position`: where a state says that the nodes ahead are, against the orders.

use std::collections::{BTreeSet, VecDeque};

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Member, Node, NodePosition, NodeState, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many order messages, and nodes of one, are kept in mind.
const MESSAGES: usize = 64;
const NODES: usize = 1024;
/// A node may be known so much better than its order says, in metres.
const BESIDE: f64 = 0.1;

/// `state/node-positions`.
pub(crate) const NODE_POSITIONS: Check = Check {
    name: "state/node-positions",
    decides: &["ORD-FLOW-06"],
    doc: "Where nodeStates give a nodePosition, x, y and mapId are those of the order, but for ten centimetres. A vehicle that \
          reports places of its own throughout is not judged, nor a node that was sent twice.",
    arguments: &[],
    listens: &[Listen::ToVehicle(Topic::Order), Listen::Delivered(Topic::State)],
    reads: &[Fact::Shown, Fact::Orders],
    needs: &[StateView::node_states, NodeState::node_position],
    start: |_| Box::new(NodePositions::default()),
};

/// `state/joint-position`.
pub(crate) const JOINT_POSITION: Check = Check {
    name: "state/joint-position",
    decides: &["ORD-UPD-07"],
    doc: "A node that was sent twice, at different places, keeps the place of its first transmission where nodeStates give a \
          nodePosition: a warning, as to list a place is not to use it. Judged when states have shown the order the first \
          one came with.",
    arguments: &[],
    listens: &[Listen::ToVehicle(Topic::Order), Listen::Delivered(Topic::State)],
    reads: &[Fact::Shown, Fact::Orders],
    needs: &[StateView::node_states, NodeState::node_position],
    start: |_| {
        Box::new(NodePositions {
            joint: true,
            ..NodePositions::default()
        })
    },
};

/// nodePosition: mapId, x and y.
type Place = (String, f64, f64);

struct Plan {
    order: String,
    update: u64,
    /// nodeId, sequenceId and place.
    nodes: Vec<(String, u64, Place)>,
}

#[derive(Default)]
struct NodePositions {
    /// Whether nodes are judged that were sent twice, or the others.
    joint: bool,
    plans: VecDeque<Plan>,
    /// orderUpdateIds of the present order that states have shown.
    adopted: BTreeSet<u64>,
    of: String,
    /// Whether a place was ever the one in the order, so that it is where the vehicle takes it from.
    follows: bool,
    /// Visits that were told of.
    told: BTreeSet<(String, u64)>,
}

fn place(position: &Member<Box<NodePosition>>) -> Option<Place> {
    let position = position.there()?;
    let map = position.map_id.or_empty().to_owned();
    Some((map, position.x.float()?, position.y.float()?))
}

fn same(one: &Place, other: &Place) -> bool {
    one.0 == other.0 && (one.1 - other.1).hypot(one.2 - other.2) <= BESIDE
}

impl NodePositions {
    fn learn(&mut self, record: &Observation<'_>) {
        let Some(order) = record.order_to_vehicle() else {
            return;
        };
        let Some(update) = order.order_update_id.whole() else {
            return;
        };
        let node = |node: &Node| {
            let id = node.node_id.or_empty().to_owned();
            Some((id, node.sequence_id.whole()?, place(&node.node_position)?))
        };
        if self.plans.len() == MESSAGES {
            self.plans.pop_front();
        }
        self.plans.push_back(Plan {
            order: order.order_id.or_empty().to_owned(),
            update,
            nodes: order.nodes.iter().take(NODES).filter_map(node).collect(),
        });
    }

    /// The places that messages of the present order give a visit, and whether each was taken over.
    fn sent(&self, id: &str, sequence: u64, update: u64) -> Vec<(&Place, bool)> {
        let plans = self
            .plans
            .iter()
            .filter(|plan| plan.order == self.of && plan.update <= update);
        let all = plans.flat_map(|plan| {
            let visit = plan.nodes.iter().filter(|node| node.0 == id && node.1 == sequence);
            visit.map(|node| (&node.2, self.adopted.contains(&plan.update)))
        });
        all.collect()
    }
}

impl Running for NodePositions {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record);
        let Some(state) = context.world.shown().state(record) else {
            return false;
        };
        let Some(update) = state.order_update_id.whole() else {
            return false;
        };
        let order = state.order_id.or_empty();
        if self.of != order {
            order.clone_into(&mut self.of);
            self.adopted.clear();
            self.told.clear();
        }
        if self.adopted.len() < NODES {
            self.adopted.insert(update);
        }
        let sound = context.world.orders().of(order).all(|sent| sent.sound);
        let mut judged = false;
        for node in state.node_states.iter().take(NODES).filter(|_| sound) {
            let (Some(shown), Some(sequence)) = (place(&node.node_position), node.sequence_id.whole()) else {
                continue;
            };
            let id = node.node_id.or_empty();
            let sent = self.sent(id, sequence, update);
            let Some((first, known)) = sent.first().copied() else {
                continue;
            };
            let follows = same(first, &shown);
            let trusted = self.follows || follows;
            let requirement = if self.joint {
                // One that was refused may have come first.
                let twice = sent.iter().skip(1).find(|(place, _)| !same(place, first));
                let Some((later, _)) = twice.filter(|_| known) else {
                    continue;
                };
                judged = true;
                same(later, &shown).then_some("ORD-UPD-07")
            } else {
                judged |= sent.len() == 1;
                (sent.len() == 1 && !follows && trusted).then_some("ORD-FLOW-06")
            };
            let text = format!(
                "node {} with sequenceId {sequence} is at ({}, {}) in the state and was sent at ({}, {})",
                quote(id),
                shown.1,
                shown.2,
                first.1,
                first.2
            );
            self.follows = trusted;
            let Some(requirement) = requirement else { continue };
            if self.told.len() < NODES && self.told.insert((id.to_owned(), sequence)) {
                let found = if self.joint { remark } else { broken };
                findings.push(found(requirement, record.seq(), text));
            }
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn node(id: &str, sequence: u64, x: f64) -> Value {
        json!({ "nodeId": id, "sequenceId": sequence, "released": true, "actions": [],
            "nodePosition": { "x": x, "y": 0.0, "mapId": "hall" } })
    }

    fn edge(sequence: u64) -> Value {
        json!({ "edgeId": format!("e{sequence}"), "sequenceId": sequence, "released": true, "actions": [] })
    }

    /// What is found when b stands at 5 m in an order, at `second` in its update, and is shown at these places.
    fn shown(second: f64, before: f64, after: f64) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        let order = |update: u64, nodes: &Value, edges: &Value| json!({ "orderId": "o", "orderUpdateId": update, "nodes": nodes, "edges": edges });
        let state = |update: u64, nodes: Value| json!({ "orderId": "o", "orderUpdateId": update, "nodeStates": nodes });
        trace.sent(
            "order",
            &order(0, &json!([node("n1", 0, 0.0), node("b", 2, 5.0)]), &json!([edge(1)])),
        );
        trace.state(&state(0, json!([node("b", 2, before)])));
        trace.sent(
            "order",
            &order(1, &json!([node("b", 2, second), node("c", 4, 9.0)]), &json!([edge(3)])),
        );
        trace.state(&state(1, json!([node("b", 2, after), node("c", 4, 9.0)])));
        trace.judge("state/joint-position").summary()
    }

    #[test]
    fn the_place_that_was_sent_first_is_right() {
        assert!(shown(5.0, 5.0, 5.0).is_empty());
        assert!(shown(6.0, 5.0, 5.02).is_empty());
    }

    #[test]
    fn the_place_of_the_update_is_found() {
        assert_eq!(shown(6.0, 5.0, 6.0), ["ORD-UPD-07 warning"]);
    }

    #[test]
    fn another_place_is_found_in_a_vehicle_that_goes_by_orders_otherwise() {
        let mut trace = Trace::subscriber();
        let nodes = json!([node("n1", 0, 0.0), node("b", 2, 5.0), node("c", 4, 9.0)]);
        trace.state(&json!({}));
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": [edge(1), edge(3)] }),
        );
        let ahead = json!([node("b", 2, 5.0), node("c", 4, 10.0)]);
        trace.state(&json!({ "orderId": "o", "nodeStates": ahead }));
        assert_eq!(trace.judge("state/node-positions").summary(), ["ORD-FLOW-06"]);
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": [edge(1), edge(3)] }),
        );
        trace.state(&json!({ "orderId": "o", "nodeStates": [node("b", 2, 5.5), node("c", 4, 9.5)] }));
        assert!(trace.judge("state/node-positions").findings.is_empty());
    }
}
