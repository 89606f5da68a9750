//! `state/order-kept`: orderId and orderUpdateId stay until a new order is accepted.
//!
//! Which order has to be accepted is left to the tests.

use std::collections::VecDeque;

use serde_json::Value;

use super::orders::number;
use super::traffic::{Traffic, broken, maybe_restarted, outside_influence, quote, state, text, to_vehicle};
use super::{Check, CheckContext, CheckFinding, Running};
use crate::journal::Entry;

/// How many orders on their way are kept in mind.
const ORDERS: usize = 64;

/// See the module.
pub(super) const ORDER_KEPT: Check = Check {
    name: "state/order-kept",
    decides: &["STATE-MSG-02"],
    doc: "orderId is not emptied, and orderUpdateId does not go back, as long as no new order was sent. Judged in \
          modes in which master control is in command; a restart and what a person or a hook did in between are \
          forgiven.",
    arguments: &[],
    start: |_| Box::new(OrderKept::default()),
};

#[derive(Default)]
struct OrderKept {
    traffic: Traffic,
    shown: Option<(String, u64)>,
    /// orderId and orderUpdateId of the latest orders seen on their way to the vehicle.
    sent: VecDeque<(String, u64)>,
}

impl Running for OrderKept {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        // What is kept over a restart is not ruled, nor what a person does to the order.
        if outside_influence(entry) || maybe_restarted(self.traffic, entry, context) {
            self.shown = None;
        }
        if let Some(order) = to_vehicle("order", entry, context) {
            self.sent.push_back(named(order));
            if self.sent.len() > ORDERS {
                self.sent.pop_front();
            }
        }
        let Some(state) = state(self.traffic, entry, context) else {
            return false;
        };
        let in_command = matches!(text(state, "operatingMode"), "AUTOMATIC" | "SEMIAUTOMATIC");
        if !in_command || !state.get("orderId").is_some_and(Value::is_string) {
            self.shown = None;
            return false;
        }
        let now = named(state);
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
            findings.push(broken("STATE-MSG-02", entry.seq(), text));
        } else if now.0 == before.0 && now.1 < before.1 && !self.sent.contains(&now) {
            let text = format!(
                "orderUpdateId of order {} was {} and is {}, although no such order came",
                quote(&now.0),
                before.1,
                now.1
            );
            findings.push(broken("STATE-MSG-02", entry.seq(), text));
        }
        true
    }
}

fn named(message: &Value) -> (String, u64) {
    let id: String = text(message, "orderId").chars().take(512).collect();
    (id, number(message, "orderUpdateId").unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

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
    fn a_restart_forgives_an_empty_order() {
        let mut trace = Trace::subscriber();
        trace.state(&shows("a", 0, "AUTOMATIC"));
        trace.message("connection", &json!({ "connectionState": "ONLINE" }));
        trace.state(&shows("", 0, "AUTOMATIC"));
        assert!(trace.judge("state/order-kept").findings.is_empty());
    }
}
