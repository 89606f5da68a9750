//! `state/order-cleared`: no order goes by itself, whatever goes wrong.
//!
//! What an order looks like that was called off is left to the tests of that.

use std::collections::VecDeque;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_pack::{HookChange, HookEffect};
use tck_view::{ActionView, StateView};
use tck_world::{Element, Fact, Listen, Observation, Topic, edges_left, nodes_left, sets_position};

/// How many orders on their way are kept in mind.
const ORDERS: usize = 64;

/// No order goes by itself.
pub(crate) const ORDER_CLEARED: Check = Check {
    name: "state/order-cleared",
    decides: &["ORD-CLEAR-11"],
    doc: "nodeStates and edgeStates are not emptied before the last released node of them was reached, and not before the last \
          one of the horizon where no update was sent, unless something was sent or done since the order that ends it: \
          cancelOrder, startHibernation, shutdown, a pose, another mode, a hook that may change the order, a person, a restart. \
          Orders that nobody was seen to send are not judged.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[
        StateView::order_id,
        StateView::node_states,
        StateView::edge_states,
        StateView::operating_mode,
    ],
    start: |_| Box::new(OrderCleared::default()),
};

#[derive(Default)]
struct OrderCleared {
    /// orderId, record of the first message, and number of messages.
    sent: VecDeque<(String, u64, usize)>,
    /// The last record that may end an order.
    ended: u64,
    /// orderId and nodes of the last state.
    before: Option<(String, Vec<Element>)>,
}

/// Whether an instant action ends the order that is under way, or puts the vehicle elsewhere.
fn ends_orders(action: &ActionView) -> bool {
    action.clears_order() || action.action_type.is("shutdown") || sets_position(action.action_type.or_empty())
}

/// Whether a person or a hook may have ended the order.
fn is_interfered(record: &Observation<'_>, context: &CheckContext<'_>) -> bool {
    match record.event() {
        Event::Answer { .. } => true,
        Event::Hook { hook, .. } => context.hook(hook).is_none_or(|hook| {
            hook.changes().contains(&HookChange::Order) || hook.has(HookEffect::SetsMode) || hook.may_restart()
        }),
        _ => false,
    }
}

impl OrderCleared {
    fn learn(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        let instant = record.instant_actions_to_vehicle();
        let mut instant = instant.into_iter().flat_map(|message| message.all_actions());
        let ends = instant.any(ends_orders);
        if ends || is_interfered(record, context) || context.world.restarts().now(record) {
            self.ended = record.seq();
        }
        let Some(order) = record.order_to_vehicle() else {
            return;
        };
        let id = order.order_id.or_empty();
        match self.sent.iter_mut().find(|sent| sent.0 == id) {
            Some(sent) => sent.2 += 1,
            None => self.sent.push_back((id.to_owned(), record.seq(), 1)),
        }
        if self.sent.len() > ORDERS {
            self.sent.pop_front();
        }
    }

    /// The node that had to be reached before the order could be over.
    fn goal<'n>(&self, order: &str, nodes: &'n [Element]) -> Option<&'n Element> {
        let (_, since, messages) = self.sent.iter().find(|sent| sent.0 == order)?;
        if self.ended > *since {
            return None;
        }
        // An update may have taken the horizon away.
        let mut wanted = nodes.iter().rev().filter(|node| node.released || *messages == 1);
        wanted.next()
    }
}

impl Running for OrderCleared {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record, context);
        let Some(state) = record.state() else {
            return false;
        };
        let in_command = matches!(
            state.operating_mode.or_empty(),
            "AUTOMATIC" | "SEMIAUTOMATIC" | "INTERVENED"
        );
        if !in_command {
            self.ended = record.seq();
        }
        let (Some(nodes), Some(edges)) = (nodes_left(state), edges_left(state)) else {
            self.before = None;
            return false;
        };
        let order = state.order_id.or_empty().to_owned();
        let is_over = nodes.is_empty() && edges.is_empty();
        let before = self.before.replace((order.clone(), nodes));
        let Some((_, nodes)) = before.filter(|before| before.0 == order) else {
            return false;
        };
        let Some(goal) = self.goal(&order, &nodes) else {
            return false;
        };
        let there = state
            .last_node_sequence_id
            .whole()
            .is_some_and(|last| last >= goal.sequence);
        if is_over && !there && !state.last_node_id.is(&goal.id) {
            let text = format!(
                "order {} is gone before node {} with sequenceId {} was reached, and nobody has called it off",
                quote(&order),
                quote(&goal.id),
                goal.sequence
            );
            findings.push(broken("ORD-CLEAR-11", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::{Trace, merged};

    fn route(released: usize) -> (Value, Value) {
        let nodes =
            (0..3).map(|at| json!({ "nodeId": format!("n{at}"), "sequenceId": 2 * at, "released": at < released }));
        let edges =
            (1..3).map(|at| json!({ "edgeId": format!("e{at}"), "sequenceId": 2 * at - 1, "released": at < released }));
        (nodes.collect(), edges.collect())
    }

    /// A vehicle that has taken over an order with so many released nodes of three.
    fn begun(released: usize) -> Trace {
        let mut trace = Trace::subscriber_of("3.0");
        let (nodes, edges) = route(released);
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": edges }),
        );
        let left: Vec<Value> = nodes.as_array().unwrap()[1..].to_vec();
        trace.state(&json!({ "orderId": "o", "lastNodeId": "n0", "nodeStates": left, "edgeStates": edges }));
        trace
    }

    fn gone(trace: &mut Trace, over: &Value) -> Vec<String> {
        let state = json!({ "orderId": "o", "lastNodeId": "n0", "lastNodeSequenceId": 0 });
        trace.state(&merged(state, over));
        trace.judge("state/order-cleared").summary()
    }

    #[test]
    fn an_order_that_was_driven_is_over() {
        assert!(gone(&mut begun(3), &json!({ "lastNodeId": "n2", "lastNodeSequenceId": 4 })).is_empty());
        // Whichever of the two is right.
        assert!(gone(&mut begun(3), &json!({ "lastNodeId": "n2" })).is_empty());
        assert!(gone(&mut begun(3), &json!({ "orderId": "p" })).is_empty());
    }

    #[test]
    fn an_order_that_goes_by_itself_is_found() {
        assert_eq!(gone(&mut begun(3), &json!({})), ["ORD-CLEAR-11"]);
        assert_eq!(
            gone(&mut begun(2), &json!({ "lastNodeId": "n1", "lastNodeSequenceId": 2 })),
            ["ORD-CLEAR-11"]
        );
        let error = json!({ "errors": [{ "errorType": "x", "errorLevel": "FATAL" }] });
        assert_eq!(gone(&mut begun(3), &error), ["ORD-CLEAR-11"]);
    }

    #[test]
    fn what_ends_an_order_may_end_it() {
        for action in ["cancelOrder", "startHibernation", "shutdown", "initPosition"] {
            let mut trace = begun(3);
            trace.instant(action, "x", &json!([]));
            assert!(gone(&mut trace, &json!({})).is_empty(), "{action}");
        }
        assert!(gone(&mut begun(3), &json!({ "operatingMode": "MANUAL" })).is_empty());
        let mut trace = begun(3);
        trace.hook();
        assert!(gone(&mut trace, &json!({})).is_empty());
    }

    #[test]
    fn an_update_may_take_the_horizon_away() {
        let mut trace = begun(2);
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 1, "nodes": [], "edges": [] }),
        );
        assert!(gone(&mut trace, &json!({ "lastNodeId": "n1", "lastNodeSequenceId": 2 })).is_empty());
        assert_eq!(gone(&mut begun(2), &json!({})), ["ORD-CLEAR-11"]);
    }

    #[test]
    fn an_order_after_a_cancellation_is_judged_again() {
        let mut trace = Trace::subscriber_of("3.0");
        trace.instant("cancelOrder", "x", &json!([]));
        let (nodes, edges) = route(3);
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": edges }),
        );
        let left: Vec<Value> = nodes.as_array().unwrap()[1..].to_vec();
        trace.state(&json!({ "orderId": "o", "lastNodeId": "n0", "nodeStates": left, "edgeStates": edges }));
        assert_eq!(gone(&mut trace, &json!({})), ["ORD-CLEAR-11"]);
    }
}
