//! `errors/ready-under-warning`: a vehicle that only warns is ready to start.

use serde_json::Value;

use crate::finding::remark;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{SafetyState, StateView};
use tck_world::{End, Listen, Observation, Topic};

/// A vehicle that only warns is ready to start.
pub(super) const READY: Check = Check {
    name: "errors/ready-under-warning",
    decides: &["ERR-03"],
    doc: "A vehicle that reports warnings and no worse error, and that nothing else holds, sets out when it is given \
          an order. One that stands until the end of the window is remarked on, by the ruling of the catalogue: if it \
          has taken the order over, and the order named `order` also if it has not.",
    arguments: &["order"],
    listens: &[Listen::ToVehicle(Topic::Order), Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[
        StateView::errors,
        StateView::last_node_id,
        StateView::safety_state,
        SafetyState::emergency_stop,
        SafetyState::field_violation,
    ],
    start: |_| Box::new(Ready::default()),
};

#[derive(Default)]
struct Ready {
    /// orderId of the last order sent.
    order: Option<String>,
    /// The last state, if the vehicle could have set out and had not.
    waits: Option<u64>,
    started_at: Option<(String, u64)>,
    set_out: bool,
}

/// Whether the vehicle reports warnings, nothing worse, and nothing else that holds it.
fn only_warns(state: &StateView) -> bool {
    !state.errors.is_empty()
        && state.errors.iter().all(|error| error.error_level.is("WARNING"))
        && !state.paused.is(true)
        && state.emergency_stop() == Some("NONE")
        && state.field_violation() == Some(false)
        && matches!(state.operating_mode.or_empty(), "AUTOMATIC" | "SEMIAUTOMATIC")
}

impl Running for Ready {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        _findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Some(order) = record.order_to_vehicle() {
            self.order = Some(order.order_id.or_empty().to_owned());
            self.waits = None;
            self.started_at = None;
            self.set_out = false;
        }
        let Some(state) = record.state().filter(|_| self.order.is_some()) else {
            return false;
        };
        let here = state.last_node().map(|(node, sequence)| (node.to_string(), sequence));
        let moved = self.started_at.is_some() && here != self.started_at;
        if self.started_at.is_none() {
            self.started_at = here;
        }
        self.set_out |= moved || state.driving.is(true);
        let warns = only_warns(state);
        let order = self.order.as_deref();
        let ahead = state.node_states.iter().any(|node| node.released.is(true));
        let asked = context.with.get("order").and_then(Value::as_str) == order;
        let taken = Some(state.order_id.or_empty()) == order && ahead;
        self.waits = (warns && !self.set_out && (asked || taken)).then_some(record.seq());
        warns && self.set_out
    }

    fn finish(&mut self, _: &End, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        if let Some(seq) = self.waits.filter(|_| !self.set_out) {
            let text = "the vehicle reports warnings only, and does not set out";
            findings.push(remark("ERR-03", seq, text));
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::{Trace, merged};

    fn judge(level: &str, last: &Value) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.with.insert("order".into(), json!("o"));
        let errors = json!({ "errors": [{ "errorType": "x", "errorLevel": level }] });
        trace.state(&errors).sent("order", &json!({ "orderId": "o" }));
        trace.state(&errors).state(&merged(errors.clone(), last));
        trace.judge("errors/ready-under-warning").summary()
    }

    #[test]
    fn a_vehicle_that_sets_out_under_a_warning_is_right() {
        assert!(judge("WARNING", &json!({ "driving": true })).is_empty());
        assert!(judge("WARNING", &json!({ "lastNodeId": "n2", "lastNodeSequenceId": 2 })).is_empty());
    }

    #[test]
    fn a_vehicle_that_stands_under_a_warning_is_remarked_on() {
        assert_eq!(judge("WARNING", &json!({})), ["ERR-03 warning"]);
    }

    #[test]
    fn an_order_it_refused_is_not_waited_for_unless_asked_to() {
        let mut trace = Trace::subscriber();
        let warning = json!({ "errors": [{ "errorType": "x", "errorLevel": "WARNING" }] });
        trace.sent("order", &json!({ "orderId": "o" })).state(&warning);
        assert!(trace.judge("errors/ready-under-warning").findings.is_empty());
        let node = json!({ "nodeId": "n2", "sequenceId": 2, "released": true });
        trace.state(&merged(warning, &json!({ "orderId": "o", "nodeStates": [node] })));
        assert_eq!(trace.judge("errors/ready-under-warning").summary(), ["ERR-03 warning"]);
    }

    #[test]
    fn another_reason_to_stand_is_none_of_its_business() {
        assert!(judge("FATAL", &json!({})).is_empty());
    }
}
