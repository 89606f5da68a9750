//! `state/order-known`, `state/update-id-rises`, `state/order-not-replaced`: the order a vehicle shows is one it was sent,
//! under the numbers it was sent with, and at a time when it may be taken over.
//!
//! Whether it had to take the order over is left to the tests, but for what the states alone show.

use std::collections::{BTreeSet, VecDeque};
use std::time::Duration;

use crate::finding::{broken, quote};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Member, Number, OrderView, StateView, Text};
use tck_world::{Element, Fact, Listen, Observation, Topic, last_node, may_abandon, nodes_left};

/// How many orders on their way are kept in mind.
const ORDERS: usize = 1024;
/// How many refusals are kept in mind.
const REFUSALS: usize = 64;
/// What is begun so soon after an error that names it may have crossed with it.
const CROSSING: Duration = Duration::from_secs(2);

/// `state/order-known`.
pub(crate) const ORDER_KNOWN: Check = Check {
    name: "state/order-known",
    decides: &["STATE-MSG-02", "ORD-FLOW-06", "ORD-FLOW-09"],
    doc: "A vehicle that shows another orderId or orderUpdateId than before shows a pair that was sent to it. Judged in modes \
          in which master control is in command; a restart, what a person or a hook did, and malformed orders of the \
          harness are left out.",
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
    reads: &[Fact::Restarts, Fact::Malformed],
    needs: &[StateView::order_id, StateView::order_update_id],
    start: |_| Box::new(OrderKnown::looking_for(Part::Known)),
};

/// `state/update-id-rises`.
pub(crate) const UPDATE_ID_RISES: Check = Check {
    name: "state/update-id-rises",
    decides: &["ORD-REJ-10"],
    doc: "The orderUpdateId of an order that was not cancelled does not fall when an update with a lower one is sent. \
          Otherwise as state/order-known.",
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
    reads: &[Fact::Restarts, Fact::Malformed],
    needs: &[StateView::order_id, StateView::order_update_id],
    start: |_| Box::new(OrderKnown::looking_for(Part::Rises)),
};

/// `state/order-not-replaced`.
pub(crate) const NOT_REPLACED: Check = Check {
    name: "state/order-not-replaced",
    decides: &["ORD-FLOW-01", "ORD-FLOW-03"],
    doc: "An order that comes while the vehicle lists a horizon, or base that it has not come to since, is not shown, unless \
          the one before was cancelled, extended, or may have been given up; and one that was refused then, with an error \
          that names it, is not shown later either, unless it was sent again. Otherwise as state/order-known.",
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
    reads: &[Fact::Restarts, Fact::Malformed],
    needs: &[StateView::order_id, StateView::order_update_id],
    start: |_| Box::new(OrderKnown::looking_for(Part::Replaced)),
};

/// Which of the three looks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Part {
    #[default]
    Known,
    Rises,
    Replaced,
}

type Pair = (String, u64);

/// What the last state showed.
struct Before {
    pair: Pair,
    last: Option<(String, u64)>,
    /// What nodeStates list, if something of it is still ahead of the vehicle.
    ahead: Option<Vec<Element>>,
    may_be_over: bool,
}

#[derive(Default)]
struct OrderKnown {
    part: Part,
    sent: VecDeque<Pair>,
    /// More was sent than is kept in mind.
    unknown: bool,
    /// orderId that a cancelOrder was sent for.
    cancelled: Option<String>,
    /// What was sent since the last state.
    since: Vec<Pair>,
    before: Option<Before>,
    refused: VecDeque<Refused>,
    /// orderIds that errors of the last state named.
    blamed: BTreeSet<String>,
}

/// An order that an error named while the vehicle was on its way with another one.
struct Refused {
    order: String,
    at: Moment,
    seq: u64,
}

impl OrderKnown {
    fn looking_for(part: Part) -> Self {
        Self {
            part,
            ..Self::default()
        }
    }

    fn learn(&mut self, record: &Observation<'_>) {
        // One without a name or number is malformed, and looked after there.
        if let Some(pair) = record
            .order_to_vehicle()
            .and_then(|order| named(&order.order_id, &order.order_update_id))
        {
            self.since.push(pair.clone());
            self.sent.push_back(pair);
            self.unknown |= self.sent.len() > ORDERS;
            let excess = self.sent.len().saturating_sub(ORDERS);
            self.sent.drain(..excess);
        }
        let cancels = record
            .instant_actions_to_vehicle()
            .is_some_and(|message| message.all_actions().any(tck_view::ActionView::clears_order));
        if cancels {
            self.cancelled = self.before.as_ref().map(|before| before.pair.0.clone());
        }
    }

    /// What is wrong with a pair that was not shown before.
    fn unsent(&self, before: &Before, now: &Pair) -> Option<(&'static str, String)> {
        // A recording may lack the commands.
        let same = before.pair == *now;
        if same || self.unknown || self.sent.is_empty() || now.0.is_empty() || self.sent.contains(now) {
            return None;
        }
        let shown = format!("order {} with orderUpdateId {}", quote(&now.0), now.1);
        let said = |what: &str| format!("the state shows {shown}, {what}");
        Some(if !self.sent.iter().any(|sent| sent.0 == now.0) {
            ("STATE-MSG-02", said("which was never sent"))
        } else if before.pair.0 == now.0 {
            ("ORD-FLOW-09", said("an update that was never sent"))
        } else {
            ("ORD-FLOW-06", said("but it was sent under another orderUpdateId"))
        })
    }

    /// What is wrong with a lower number of the same order.
    fn fallen(&self, before: &Before, now: &Pair) -> Option<(&'static str, String)> {
        let falls = before.pair.0 == now.0 && now.1 < before.pair.1;
        let one_order = self.sent.contains(now) && self.cancelled.as_ref() != Some(&now.0);
        (falls && one_order).then(|| {
            let text = format!(
                "orderUpdateId of order {} falls from {} to {}",
                quote(&now.0),
                before.pair.1,
                now.1
            );
            ("ORD-REJ-10", text)
        })
    }

    /// Learns which orders a vehicle refuses that has still another one to drive.
    fn refusals(&mut self, record: &Observation<'_>, state: &StateView, busy: bool) {
        let named: BTreeSet<String> = state
            .errors
            .iter()
            .take(REFUSALS)
            .flat_map(|error| error.error_references.iter().take(REFUSALS))
            .filter(|reference| reference.key.is(OrderView::order_id.usual_name()))
            .map(|reference| reference.value.or_empty().to_owned())
            .collect();
        for order in named.iter().filter(|order| busy && !self.blamed.contains(*order)) {
            let shown =
                state.order_id.or_empty() == order || self.before.as_ref().is_some_and(|it| it.pair.0 == **order);
            if shown || self.refused.iter().any(|refused| refused.order == *order) {
                continue;
            }
            if self.refused.len() == REFUSALS {
                self.refused.pop_front();
            }
            self.refused.push_back(Refused {
                order: order.clone(),
                at: record.at().moment,
                seq: record.seq(),
            });
        }
        self.blamed = named;
    }

    /// What is wrong with an order that is shown after it was refused, and was sent only once.
    fn queued(&self, before: &Before, now: &Pair, at: Moment) -> Option<(&'static str, String)> {
        let refused = self.refused.iter().find(|refused| refused.order == now.0)?;
        let once = self.sent.iter().filter(|sent| sent.0 == now.0).count() == 1;
        let begun = before.pair.0 != now.0 && once && !self.unknown && at.since(refused.at) > CROSSING;
        begun.then(|| {
            let text = format!(
                "the vehicle shows order {}, which error #{} had refused, and which was not sent again",
                quote(&now.0),
                refused.seq
            );
            ("ORD-FLOW-01", text)
        })
    }

    /// What is wrong with a new order that replaces another one.
    fn too_early(&self, before: &Before, now: &Before) -> Option<(&'static str, String)> {
        let over = before.may_be_over
            || before.pair.0.is_empty()
            || before.pair.0 == now.pair.0
            || self.cancelled.as_ref() == Some(&before.pair.0)
            || self.since.iter().any(|sent| sent.0 == before.pair.0);
        let listed = before.ahead.as_ref().filter(|_| !over)?;
        // One that only shows the other name is wrong about the name.
        if now.ahead.as_ref() == Some(listed) {
            return None;
        }
        let base = listed.iter().rfind(|node| node.released);
        let stayed = before.last == now.last;
        let behind = base.filter(|base| stayed && now.last.as_ref().is_some_and(|(node, _)| *node != base.id));
        let what = format!(
            "the vehicle shows the new order {}, though order {}",
            quote(&now.pair.0),
            quote(&before.pair.0)
        );
        if let Some(base) = behind {
            return Some(("ORD-FLOW-01", format!("{what} still led to node {}", quote(&base.id))));
        }
        let horizon = listed.iter().any(|node| !node.released);
        horizon.then(|| {
            (
                "ORD-FLOW-03",
                format!("{what} had a horizon, and was neither cancelled nor extended"),
            )
        })
    }
}

fn named(order: &Member<Text>, update: &Member<Number>) -> Option<Pair> {
    Some((order.text()?.to_owned(), update.whole()?))
}

/// What nodeStates list, if it leads away from the last node: what is listed first may be the node the vehicle is on.
fn ahead(state: &StateView, last: Option<&(String, u64)>) -> Option<Vec<Element>> {
    let nodes = nodes_left(state)?;
    let end = nodes.last()?;
    let leads = nodes.len() > 1 || last.is_some_and(|(node, _)| *node != end.id);
    leads.then_some(nodes)
}

impl Running for OrderKnown {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record);
        if context.world.restarts().now(record) || record.outside_influence() {
            self.before = None;
            self.refused.clear();
        }
        let Some(state) = record.state() else {
            return false;
        };
        let in_command = matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC");
        let pair = named(&state.order_id, &state.order_update_id)
            .filter(|_| in_command && !context.world.malformed().is_shown_in_command(record));
        let Some(pair) = pair else {
            self.before = None;
            self.blamed.clear();
            self.refused.clear();
            return false;
        };
        let last = last_node(state);
        let now = Before {
            pair: pair.clone(),
            ahead: ahead(state, last.as_ref()),
            last,
            may_be_over: may_abandon(state),
        };
        let busy = self.part == Part::Replaced && now.ahead.is_some();
        self.refusals(record, state, busy);
        let Some(before) = self.before.take() else {
            self.before = Some(now);
            self.since.clear();
            return false;
        };
        let (judged, found) = match self.part {
            Part::Known => (before.pair != pair, self.unsent(&before, &pair)),
            Part::Rises => {
                let lower = |sent: &Pair| sent.0 == before.pair.0 && sent.1 < before.pair.1;
                (self.since.iter().any(lower), self.fallen(&before, &pair))
            }
            Part::Replaced => {
                let other = |sent: &Pair| sent.0 != before.pair.0;
                let queued = self.queued(&before, &pair, record.at().moment);
                let early = queued.or_else(|| self.too_early(&before, &now));
                (
                    early.is_some() || before.ahead.is_some() && self.since.iter().any(other),
                    early,
                )
            }
        };
        if let Some((requirement, text)) = found {
            findings.push(broken(requirement, record.seq(), text));
        }
        if before.pair.0 != pair.0 {
            self.cancelled = None;
        }
        self.before = Some(now);
        self.since.clear();
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::{Trace, merged};

    fn order(id: &str, update: u64, nodes: &[(&str, bool)]) -> Value {
        let nodes = nodes.iter().enumerate().map(|(at, (node, released))| {
            json!({ "nodeId": node, "sequenceId": at * 2, "released": released, "actions": [] })
        });
        let nodes: Vec<Value> = nodes.collect();
        let edges: Vec<Value> = (1..nodes.len())
            .map(|at| {
                json!({ "edgeId": format!("e{at}"), "sequenceId": at * 2 - 1, "released": nodes[at]["released"],
                    "startNodeId": nodes[at - 1]["nodeId"], "endNodeId": nodes[at]["nodeId"], "actions": [] })
            })
            .collect();
        let mut header = Trace::subscriber().header();
        header["version"] = json!("2.1.0");
        merged(
            header,
            &json!({ "orderId": id, "orderUpdateId": update, "nodes": nodes, "edges": edges }),
        )
    }

    fn shows(id: &str, update: u64, last: (&str, u64), ahead: &[(&str, u64, bool)]) -> Value {
        let ahead: Vec<Value> = ahead
            .iter()
            .map(|(node, sequence, released)| json!({ "nodeId": node, "sequenceId": sequence, "released": released }))
            .collect();
        json!({ "orderId": id, "orderUpdateId": update, "lastNodeId": last.0, "lastNodeSequenceId": last.1,
            "nodeStates": ahead })
    }

    const CHECK: &str = "state/order-known";

    #[test]
    fn orders_under_the_numbers_they_were_sent_with_are_right() {
        let mut trace = Trace::subscriber();
        trace
            .state(&json!({}))
            .sent("order", &order("o", 3, &[("n1", true), ("n2", true)]));
        trace.state(&shows("o", 3, ("n1", 0), &[("n2", 2, true)]));
        trace.state(&shows("o", 3, ("n2", 2), &[]));
        trace.sent("order", &order("p", 0, &[("n2", true), ("n3", true)]));
        trace.state(&shows("p", 0, ("n2", 0), &[("n3", 2, true)]));
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 2);
    }

    #[test]
    fn pairs_that_were_never_sent_are_found() {
        let shown = |id: &str, update: u64| {
            let mut trace = Trace::subscriber();
            trace
                .state(&json!({}))
                .sent("order", &order("o", 3, &[("n1", true), ("n2", true)]));
            trace.state(&shows(id, update, ("n1", 0), &[("n2", 2, true)]));
            trace.judge(CHECK).summary()
        };
        assert_eq!(shown("o", 0), ["ORD-FLOW-06"]);
        assert_eq!(shown("q", 0), ["STATE-MSG-02"]);
    }

    #[test]
    fn what_a_vehicle_makes_of_a_number_beyond_32_bits_is_not_judged() {
        let mut trace = Trace::subscriber();
        trace
            .state(&json!({}))
            .sent("order", &order("o", 1 << 32, &[("n1", true), ("n2", true)]));
        trace.state(&shows("o", 0, ("n1", 0), &[("n2", 2, true)]));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn an_update_id_that_falls_is_found() {
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        for update in [0, 2, 1] {
            trace.sent("order", &order("o", update, &[("n1", true)]));
            trace.state(&shows("o", update, ("n1", 0), &[]));
        }
        assert_eq!(trace.judge("state/update-id-rises").summary(), ["ORD-REJ-10"]);
    }

    #[test]
    fn an_order_that_was_refused_and_is_begun_later_is_found() {
        let begun = |again: bool| {
            let mut trace = Trace::subscriber();
            trace
                .state(&json!({}))
                .sent("order", &order("o", 0, &[("n1", true), ("n2", true)]));
            trace.state(&shows("o", 0, ("n1", 0), &[("n2", 2, true)]));
            trace.sent("order", &order("p", 0, &[("n2", true), ("n3", true)]));
            let mut refuses = shows("o", 0, ("n1", 0), &[("n2", 2, true)]);
            refuses["errors"] = json!([{ "errorType": "orderUpdateError", "errorLevel": "WARNING",
                "errorReferences": [{ "referenceKey": "orderId", "referenceValue": "p" }] }]);
            trace.state(&refuses).wait(10.0).state(&shows("o", 0, ("n2", 2), &[]));
            if again {
                trace.sent("order", &order("p", 0, &[("n2", true), ("n3", true)]));
            }
            trace.state(&shows("p", 0, ("n2", 0), &[("n3", 2, true)]));
            trace.judge("state/order-not-replaced").summary()
        };
        assert_eq!(begun(false), ["ORD-FLOW-01"]);
        assert!(begun(true).is_empty());
    }

    #[test]
    fn a_new_order_in_the_midst_of_another_one_is_found() {
        let replaced = |end: (&str, u64, bool), last: (&str, u64), cancelled: bool| {
            let mut trace = Trace::subscriber();
            trace
                .state(&json!({}))
                .sent("order", &order("o", 0, &[("n1", true), ("n2", end.2)]));
            trace.state(&shows("o", 0, ("n1", 0), &[end]));
            if cancelled {
                trace.instant("cancelOrder", "x", &json!([]));
            }
            trace.sent("order", &order("p", 0, &[("n1", true), ("n3", true)]));
            trace.state(&shows("p", 0, last, &[("n3", 2, true)]));
            trace.judge("state/order-not-replaced").summary()
        };
        assert_eq!(replaced(("n2", 2, true), ("n1", 0), false), ["ORD-FLOW-01"]);
        assert_eq!(replaced(("n2", 2, false), ("n1", 0), false), ["ORD-FLOW-03"]);
        // It may have come to its end between two states, or was told to give up.
        assert!(replaced(("n2", 2, true), ("n2", 2), false).is_empty());
        assert!(replaced(("n2", 2, true), ("n1", 0), true).is_empty());
    }
}
