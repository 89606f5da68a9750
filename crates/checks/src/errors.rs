//! `errors/persist-until-new-order`: the report of a rejected order stays until a new order is accepted.
//!
//! Whether an order had to be rejected, and with which words, is left to the tests.

use std::collections::BTreeMap;

use crate::finding::broken;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ErrorView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many actionIds of instant actions are kept in mind.
const ACTIONS: usize = 256;

/// The report of a rejected order stays until a new order is accepted.
pub(super) const PERSIST: Check = Check {
    name: "errors/persist-until-new-order",
    decides: &["ORD-REJ-03", "ORD-REJ-08", "ORD-REJ-19"],
    doc: "A validationError or orderError warning that answers an order, and an UNSUPPORTED_PARAMETER error, is listed in every state until the vehicle \
          shows another orderId or orderUpdateId. Errors that answer an instant action are not held to this, and a \
          restart or a change of operating mode ends the watch; a cut of the link by the harness does not, as long as the \
          vehicle counts its headerId on.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::ToVehicle(Topic::Responses),
        Listen::ToVehicle(Topic::ZoneSet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::errors, StateView::order_id, StateView::order_update_id],
    start: |_| Box::new(Persist::default()),
};

#[derive(Default)]
struct Persist {
    /// Whether the last thing sent to the vehicle was an order.
    after_order: bool,
    /// Whether no state has come since the last instant action.
    instant_pending: bool,
    instant: Vec<String>,
    /// What the last state showed: order, update, mode.
    shown: Option<(String, Option<u64>, String)>,
    /// Error types listed in the last state.
    listed: Vec<String>,
    /// Error types that have to stay, and the entry in which they appeared.
    watched: BTreeMap<&'static str, u64>,
}

/// The requirement that demands of an error type to stay.
pub(super) fn requirement(error_type: &str) -> Option<(&'static str, &'static str)> {
    // One check for all versions: later ones spell these in capitals.
    match error_type {
        "validationError" | "VALIDATION_FAILURE" => Some(("validation", "ORD-REJ-03")),
        "orderError" | "INVALID_ORDER_ACTION" => Some(("order", "ORD-REJ-08")),
        "UNSUPPORTED_PARAMETER" => Some(("parameter", "ORD-REJ-19")),
        _ => None,
    }
}

impl Running for Persist {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.sent(record);
        if context.world.restarts().now(record) || record.outside_influence() {
            self.watched.clear();
            self.shown = None;
        }
        let Some(state) = record.state() else {
            return false;
        };
        if !state.errors.is_there() {
            return false;
        }
        let shown = (
            state.order_id.or_empty().to_owned(),
            state.order_update_id.whole(),
            state.operating_mode.or_empty().chars().take(64).collect(),
        );
        self.instant_pending = false;
        let before = self.shown.replace(shown);
        if before.is_none() || before != self.shown {
            self.watched.clear();
        }
        let now: Vec<(String, bool)> = state
            .errors
            .iter()
            .take(ACTIONS)
            .filter(|error| requirement(error.error_type.or_empty()).is_some())
            .map(|error| (error.error_type.or_empty().to_owned(), self.is_of_instant_action(error)))
            .collect();
        let judged = !self.watched.is_empty();
        let gone: Vec<(&'static str, u64)> = self
            .watched
            .iter()
            .map(|(kind, since)| (*kind, *since))
            .filter(|(kind, _)| {
                !now.iter()
                    .any(|(listed, _)| requirement(listed).is_some_and(|found| found.0 == *kind))
            })
            .collect();
        for (kind, since) in gone {
            self.watched.remove(kind);
            let (name, id) = match kind {
                "order" => ("orderError", "ORD-REJ-08"),
                "parameter" => ("UNSUPPORTED_PARAMETER error", "ORD-REJ-19"),
                _ => ("validationError", "ORD-REJ-03"),
            };
            let text = format!("the {name} of message #{since} is gone, although no new order was accepted");
            findings.push(broken(id, record.seq(), text));
        }
        // The first state of a run tells nothing about what an error answers.
        if before.is_some() && self.after_order {
            for (listed, instant) in &now {
                let new = !self.listed.contains(listed);
                if let Some((kind, _)) = requirement(listed).filter(|_| new && !instant) {
                    self.watched.insert(kind, record.seq());
                }
            }
        }
        self.listed = now.into_iter().map(|(listed, _)| listed).collect();
        judged
    }
}

impl Persist {
    fn sent(&mut self, record: &Observation<'_>) {
        if record.is_to_vehicle(Topic::Order) {
            // Right after an instant action nobody knows which of the two an error answers.
            self.after_order = !self.instant_pending;
        } else if [Topic::InstantActions, Topic::Responses, Topic::ZoneSet]
            .iter()
            .any(|topic| record.is_to_vehicle(*topic))
        {
            self.after_order = false;
            self.instant_pending = true;
        }
        if let Some(message) = record.instant_actions_to_vehicle() {
            let ids = message
                .all_actions()
                .map(|action| action.action_id.or_empty().to_owned());
            self.instant.extend(ids);
            let excess = self.instant.len().saturating_sub(ACTIONS);
            self.instant.drain(..excess);
        }
    }

    fn is_of_instant_action(&self, error: &ErrorView) -> bool {
        error.error_references.iter().any(|reference| {
            let value = reference.value.or_empty();
            self.instant.iter().any(|id| id == value)
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;
    use tck_journal::Payload;
    use tck_journal::event::{Event, Source};

    const CHECK: &str = "errors/persist-until-new-order";

    fn with(errors: &[&str]) -> Value {
        let errors: Vec<Value> = errors
            .iter()
            .map(|error| json!({ "errorType": error, "errorLevel": "WARNING" }))
            .collect();
        json!({ "errors": errors })
    }

    fn rejected(error: &str) -> Trace {
        let mut trace = Trace::subscriber();
        trace
            .state(&json!({}))
            .sent("order", &json!({ "orderId": 7 }))
            .state(&with(&[error]));
        trace
    }

    #[test]
    fn a_report_that_stays_until_a_new_order_is_right() {
        let mut trace = rejected("validationError");
        trace
            .instant("stateRequest", "x", &json!([]))
            .state(&with(&["other", "validationError"]));
        trace
            .state(&json!({ "orderId": "o" }))
            .state(&json!({ "orderId": "o" }));
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert_eq!(outcome.judged, 1);
    }

    #[test]
    fn reports_that_vanish_are_found() {
        let mut trace = rejected("validationError");
        trace.state(&json!({})).state(&json!({}));
        assert_eq!(trace.judge(CHECK).summary(), ["ORD-REJ-03"]);
        let mut trace = rejected("orderError");
        trace.state(&with(&["orderError"])).state(&with(&["validationError"]));
        assert_eq!(trace.judge(CHECK).summary(), ["ORD-REJ-08"]);
    }

    #[test]
    fn other_errors_and_answers_to_instant_actions_may_go() {
        let mut trace = rejected("orderUpdateError");
        trace.state(&json!({}));
        let error = json!({ "errorType": "orderError", "errorLevel": "WARNING",
            "errorReferences": [{ "referenceKey": "actionId", "referenceValue": "x" }] });
        trace
            .instant("dance", "x", &json!([]))
            .state(&json!({ "errors": [error] }))
            .state(&json!({}));
        trace
            .instant("jump", "y", &json!([]))
            .state(&with(&["validationError"]))
            .state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn an_error_that_may_answer_either_of_two_messages_is_not_held_to_it() {
        let mut trace = Trace::subscriber();
        trace.state(&json!({})).instant("jump", "x", &json!([]));
        trace
            .sent("order", &json!({ "orderId": 7 }))
            .state(&with(&["validationError"]));
        trace.state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
    }

    #[test]
    fn an_unreadable_order_counts_as_an_order() {
        let mut trace = Trace::subscriber();
        trace.instant("jump", "x", &json!([])).state(&json!({}));
        let topic = trace.topic("order");
        let event = Event::Sent {
            topic,
            qos: 0,
            retain: false,
            payload: Payload::keep(bytes::Bytes::from_static(b"{")),
        };
        trace.add(Source::Harness, None, event);
        trace.state(&with(&["validationError"])).state(&json!({}));
        assert_eq!(trace.judge(CHECK).summary(), ["ORD-REJ-03"]);
    }

    #[test]
    fn a_restart_or_a_change_of_mode_ends_the_watch() {
        let mut trace = rejected("validationError");
        trace
            .connection("CONNECTIONBROKEN")
            .connection("ONLINE")
            .state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
        let mut trace = rejected("validationError");
        trace.hook().state(&json!({}));
        assert!(trace.judge(CHECK).findings.is_empty());
        let mut trace = rejected("validationError");
        trace.state(&json!({ "operatingMode": "MANUAL" }));
        assert!(trace.judge(CHECK).findings.is_empty());
    }
}
