//! `state/order-kept`: orderId and orderUpdateId stay until a new order is accepted.
//!
//! Which order has to be accepted is left to the tests.

use std::collections::VecDeque;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Member, Number, StateView, Text};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many orders on their way are kept in mind.
const ORDERS: usize = 64;

/// `orderId` and `orderUpdateId` stay until a new order is accepted.
pub(crate) const ORDER_KEPT: Check = Check {
    name: "state/order-kept",
    decides: &["STATE-MSG-02", "ORD-CANCEL-08"],
    doc: "orderId is not emptied, and orderUpdateId does not go back, as long as no new order was sent, neither after a \
          cancellation. Judged in modes in which master control is in command; a restart and what a person or a hook did \
          in between are forgiven; a cut of the link by the harness is no restart, as long as the vehicle counts its \
          headerId on.",
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
        StateView::order_update_id,
        StateView::operating_mode,
    ],
    start: |_| Box::new(OrderKept::default()),
};

#[derive(Default)]
struct OrderKept {
    shown: Option<(String, u64)>,
    /// orderId that a cancelOrder was sent for.
    cancelled: Option<String>,
    /// orderId and orderUpdateId of the latest orders seen on their way to the vehicle.
    sent: VecDeque<(String, u64)>,
}

impl Running for OrderKept {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        // What is kept over a restart is not ruled, nor what a person does to the order.
        if context.world.restarts().now(record) || record.outside_influence() {
            self.shown = None;
        }
        let cancels = record
            .instant_actions_to_vehicle()
            .is_some_and(|message| message.all_actions().any(|action| action.action_type.is("cancelOrder")));
        if cancels {
            self.cancelled = self.shown.as_ref().map(|shown| shown.0.clone());
        }
        if let Some(order) = record.order_to_vehicle() {
            self.sent.push_back(named(&order.order_id, &order.order_update_id));
            if self.sent.len() > ORDERS {
                self.sent.pop_front();
            }
        }
        let Some(state) = record.state() else {
            return false;
        };
        let in_command = matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC");
        if !in_command || !state.order_id.is_there() {
            self.shown = None;
            return false;
        }
        let now = named(&state.order_id, &state.order_update_id);
        let Some(before) = self.shown.replace(now.clone()) else {
            return false;
        };
        if before.0.is_empty() {
            return false;
        }
        // An order that names itself so is a mistake, and taking it over is another one.
        let named_so = self.sent.back().is_some_and(|last| last.0.is_empty());
        if now.0.is_empty() && !named_so {
            let text = format!(
                "orderId was {} and is empty, although no new order came",
                quote(&before.0)
            );
            let cancelled = self.cancelled.as_ref() == Some(&before.0);
            let requirement = if cancelled { "ORD-CANCEL-08" } else { "STATE-MSG-02" };
            findings.push(broken(requirement, record.seq(), text));
        } else if now.0 == before.0 && now.1 < before.1 && !self.sent.contains(&now) {
            let text = format!(
                "orderUpdateId of order {} was {} and is {}, although no such order came",
                quote(&now.0),
                before.1,
                now.1
            );
            findings.push(broken("STATE-MSG-02", record.seq(), text));
        }
        true
    }
}

fn named(order: &Member<Text>, update: &Member<Number>) -> (String, u64) {
    (order.or_empty().to_owned(), update.whole().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;
    use tck_journal::event::LinkFault;

    fn shows(id: &str, update: u64, mode: &str) -> Value {
        json!({ "orderId": id, "orderUpdateId": update, "operatingMode": mode })
    }

    fn judge(states: &[(&str, u64, &str)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for (id, update, mode) in states {
            trace.state(&shows(id, *update, mode));
        }
        trace.judge("state/order-kept").summary()
    }

    #[test]
    fn an_order_that_is_kept_or_replaced_is_right() {
        assert!(
            judge(&[
                ("", 0, "AUTOMATIC"),
                ("a", 0, "AUTOMATIC"),
                ("a", 2, "AUTOMATIC"),
                ("b", 0, "AUTOMATIC")
            ])
            .is_empty()
        );
    }

    #[test]
    fn an_emptied_order_is_found_once() {
        assert_eq!(
            judge(&[("a", 1, "AUTOMATIC"), ("", 0, "AUTOMATIC"), ("", 0, "AUTOMATIC")]),
            ["STATE-MSG-02"]
        );
        assert_eq!(judge(&[("a", 1, "AUTOMATIC"), ("a", 0, "AUTOMATIC")]), ["STATE-MSG-02"]);
    }

    #[test]
    fn an_order_without_a_name_that_was_taken_over_is_another_matter() {
        let mut trace = Trace::subscriber();
        trace.state(&shows("a", 0, "AUTOMATIC"));
        trace.sent("order", &json!({ "orderUpdateId": 0 }));
        trace.state(&shows("", 0, "AUTOMATIC"));
        assert!(trace.judge("state/order-kept").findings.is_empty());
    }

    #[test]
    fn what_a_person_does_with_it_is_not_judged() {
        assert!(judge(&[("a", 1, "AUTOMATIC"), ("", 0, "MANUAL"), ("", 0, "AUTOMATIC")]).is_empty());
        assert!(judge(&[("a", 1, "AUTOMATIC"), ("a", 1, "MANUAL"), ("", 0, "AUTOMATIC")]).is_empty());
    }

    #[test]
    fn an_order_that_is_forgotten_over_a_cut_of_ours_is_found() {
        let over_a_cut = |cancelled: bool| {
            let mut trace = Trace::tap();
            trace.connected(1).state(&shows("a", 1, "AUTOMATIC"));
            if cancelled {
                trace.instant("cancelOrder", "x", &json!([]));
            }
            trace
                .state(&shows("a", 1, "AUTOMATIC"))
                .fault(LinkFault::Cut { reset: false })
                .closed(1);
            trace.fault(LinkFault::Restore);
            trace.connect(2, None, 15, 4);
            trace.state(&shows("", 0, "AUTOMATIC"));
            trace.judge("state/order-kept").summary()
        };
        assert_eq!(over_a_cut(false), ["STATE-MSG-02"]);
        assert_eq!(over_a_cut(true), ["ORD-CANCEL-08"]);
    }

    #[test]
    fn a_restart_forgives_an_empty_order() {
        let mut trace = Trace::subscriber();
        trace.state(&shows("a", 0, "AUTOMATIC"));
        trace.connection("OFFLINE").connection("ONLINE");
        trace.state(&shows("", 0, "AUTOMATIC"));
        assert!(trace.judge("state/order-kept").findings.is_empty());
    }
}
