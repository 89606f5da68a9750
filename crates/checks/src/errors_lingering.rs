//! `errors/go-with-new-orders`: the report of a rejected order does not outlive the orders that come after it.
//!
//! That it stays until then is left to `errors/persist-until-new-order`.

use crate::errors::requirement;
use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ErrorView, OrderView, Print, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// The report of a rejected order does not outlive the orders that come after it.
pub(super) const GONE: Check = Check {
    name: "errors/go-with-new-orders",
    decides: &["ORD-REJ-03", "ORD-REJ-08"],
    doc: "A validationError or orderError warning that names a refused order by its orderId is not listed any more when \
          the vehicle has taken over two new orders since. One that names an order that was sent once more is told anew. A \
          restart, and what a person or a hook did, end the watch.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::errors, StateView::order_id],
    start: |_| Box::new(Gone::default()),
};

/// How many errors are kept in mind, and references of each.
const ERRORS: usize = 64;
/// After so many orders the report is of no use to anybody.
const TAKEN: u32 = 2;

/// An error that is listed.
struct Listed {
    print: Print,
    /// The orderId it names.
    order: String,
    requirement: &'static str,
    /// The state that showed it first.
    seq: u64,
    /// How many new orders were taken over since.
    taken: u32,
}

#[derive(Default)]
struct Gone {
    /// orderId of the last state.
    order: Option<String>,
    listed: Vec<Listed>,
}

/// The orderId that an error names.
fn refused(error: &ErrorView) -> Option<&str> {
    let mut references = error.error_references.iter().take(ERRORS);
    let named = references.find(|reference| reference.key.is(OrderView::order_id.usual_name()))?;
    named.value.text().filter(|order| !order.is_empty())
}

impl Running for Gone {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.restarts().now(record) || record.outside_influence() {
            self.listed.clear();
            self.order = None;
        }
        if let Some(order) = record.order_to_vehicle() {
            let again = order.order_id.or_empty();
            self.listed.retain(|listed| listed.order != again);
        }
        let Some(state) = record.state() else {
            return false;
        };
        let order = state.order_id.or_empty();
        let before = self.order.replace(order.to_owned());
        let is_new = before.is_some_and(|before| before != order) && !order.is_empty();
        let now = state.errors.iter().take(ERRORS);
        let now: Vec<(&ErrorView, &str, &'static str)> = now
            .filter(|error| error.error_level.is("WARNING"))
            .filter_map(|error| {
                let (_, requirement) = requirement(error.error_type.or_empty())?;
                Some((error, refused(error)?, requirement))
            })
            .collect();
        self.listed
            .retain(|listed| now.iter().any(|(error, ..)| error.print == listed.print));
        for listed in self.listed.iter_mut().filter(|listed| is_new && listed.order != order) {
            listed.taken += 1;
            if listed.taken == TAKEN {
                let text = format!(
                    "the report of the refused order {}, first listed in #{}, is still there after {TAKEN} new orders",
                    quote(&listed.order),
                    listed.seq
                );
                findings.push(broken(listed.requirement, record.seq(), text));
            }
        }
        for (error, order, requirement) in now {
            if !self.listed.iter().any(|listed| listed.print == error.print) {
                self.listed.push(Listed {
                    print: error.print,
                    order: order.to_owned(),
                    requirement,
                    seq: record.seq(),
                    taken: 0,
                });
            }
        }
        !self.listed.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    const CHECK: &str = "errors/go-with-new-orders";

    fn shows(order: &str, refused: Option<&str>) -> Value {
        let errors: Vec<Value> = refused
            .iter()
            .map(|order| {
                json!({ "errorType": "orderError", "errorLevel": "WARNING",
                    "errorReferences": [{ "referenceKey": "orderId", "referenceValue": order }] })
            })
            .collect();
        json!({ "orderId": order, "errors": errors })
    }

    #[test]
    fn a_report_that_goes_with_the_next_order_or_the_one_behind_it_is_right() {
        let mut trace = Trace::subscriber();
        for (order, refused) in [
            ("a", None),
            ("a", Some("x")),
            ("b", Some("x")),
            ("b", None),
            ("c", None),
        ] {
            trace.state(&shows(order, refused));
        }
        let outcome = trace.judge(CHECK);
        assert!(outcome.findings.is_empty());
        assert!(outcome.judged > 0);
    }

    #[test]
    fn a_report_that_outlives_two_orders_is_found_once() {
        let mut trace = Trace::subscriber();
        for order in ["a", "b", "c", "d"] {
            trace.state(&shows(order, Some("x")));
        }
        assert_eq!(trace.judge(CHECK).summary(), ["ORD-REJ-08"]);
    }

    #[test]
    fn an_order_that_is_refused_once_more_is_reported_once_more() {
        let mut trace = Trace::subscriber();
        for order in ["a", "b", "c", "d"] {
            trace.state(&shows(order, Some("x")));
            trace.sent("order", &json!({ "orderId": "x" }));
        }
        assert!(trace.judge(CHECK).findings.is_empty());
    }
}
