//! `errors/explained`: an action that runs and fails, though nobody has called it off, comes with an error.

use std::collections::BTreeMap;

use crate::finding::{quote, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::rest::is_stopped;
use tck_world::{Fact, Listen, Observation, Topic};

/// How many actions are looked at.
const MANY: usize = 256;

/// The predefined actions whose failure has to be accompanied by an error.
const EXPLAINED: [&str; 3] = ["pick", "drop", "startCharging"];

/// A failure that nobody brought about comes with an error.
pub(super) const EXPLAINS: Check = Check {
    name: "errors/explained",
    decides: &["ACT-30"],
    doc: "A pick, a drop or a startCharging that was RUNNING and is FAILED comes with an error: a remark when no state lists any \
          error from the failure on until time.slow later. Not judged where something may have ended it: an instant action or \
          another order that was sent since it began, a cancelOrder among the actions, another mode than AUTOMATIC, an emergency \
          stop, a hook, a restart, a disturbed link.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::errors, StateView::action_states],
    start: |_| Box::new(Explained::default()),
};

/// A failure without an error, so far.
struct Open {
    id: String,
    kind: String,
    seq: u64,
    at: Moment,
}

#[derive(Default)]
struct Explained {
    /// Whether messages to the vehicle are seen at all.
    commanded: bool,
    /// Actions that run and that nothing has disturbed since, with their types, by actionId.
    running: BTreeMap<String, String>,
    open: Vec<Open>,
}

impl Explained {
    /// Whatever ends now may have been ended by somebody.
    fn forget(&mut self) {
        self.running.clear();
        self.open.clear();
    }

    /// Whether the vehicle does by itself what it does.
    fn is_left_alone(state: &StateView, context: &CheckContext<'_>) -> bool {
        let automatic = context.pack.word("operatingMode.automatic");
        let called_off = state
            .action_states
            .iter()
            .take(MANY)
            .any(|action| action.action_type.is("cancelOrder") && !action.action_status.is("FAILED"));
        automatic.is_some() && state.operating_mode.text() == automatic && !is_stopped(state) && !called_off
    }
}

impl Running for Explained {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let restarted = context.world.restarts().now(record);
        let told = record.is_to_vehicle(Topic::InstantActions) || record.is_to_vehicle(Topic::Order);
        self.commanded |= told;
        if told || restarted || record.link.disturbed || record.outside_influence() {
            self.forget();
        }
        let Some(state) = record.state() else {
            return false;
        };
        if !self.commanded || !state.action_states.is_there() || !Self::is_left_alone(state, context) {
            self.forget();
            return false;
        }
        if !state.errors.is_there() || !state.errors.is_empty() {
            let judged = !self.open.is_empty();
            self.forget();
            return judged;
        }
        let now = record.at().moment;
        let mut running = BTreeMap::new();
        for action in state.action_states.iter().take(MANY) {
            let (id, status) = (action.action_id.or_empty(), action.action_status.or_empty());
            let known = self.running.get(id).cloned();
            if status == "FAILED"
                && let Some(kind) = known
            {
                self.open.push(Open {
                    id: id.to_owned(),
                    kind,
                    seq: record.seq(),
                    at: now,
                });
            } else if status == "RUNNING" && EXPLAINED.iter().any(|kind| action.action_type.is(kind)) {
                running.insert(id.to_owned(), action.action_type.or_empty().to_owned());
            }
        }
        self.running = running;
        let is_over = |open: &mut Open| now.since(open.at) > context.time.slow;
        let over: Vec<Open> = self.open.extract_if(.., is_over).collect();
        let judged = !over.is_empty();
        findings.extend(over.into_iter().map(|open| {
            let text = format!(
                "action {} ({}) was RUNNING and has FAILED, and no error says why",
                quote(&open.id),
                quote(&open.kind)
            );
            remark("ACT-30", open.seq, text)
        }));
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn state(status: &str, errors: &Value) -> Value {
        json!({
            "actionStates": [{ "actionId": "p", "actionType": "pick", "actionStatus": status }],
            "errors": errors,
        })
    }

    /// A pick that runs and fails, with what comes between and what is listed then and a second later.
    fn judge(between: impl Fn(&mut Trace), then: &Value, later: &Value) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.instant("stateRequest", "x", &json!([]));
        trace.state(&state("RUNNING", &json!([])));
        trace.wait(0.5);
        between(&mut trace);
        trace.wait(0.5).state(&state("FAILED", then));
        trace.wait(1.0).state(&state("FAILED", later));
        trace.wait(20.0).state(&state("FAILED", later));
        trace.judge("errors/explained").summary()
    }

    #[test]
    fn a_failure_without_a_word_is_remarked_on() {
        let none = json!([]);
        assert_eq!(judge(|_| {}, &none, &none), ["ACT-30 warning"]);
    }

    #[test]
    fn an_error_then_or_in_the_next_state_explains_it() {
        let (none, error) = (
            json!([]),
            json!([{ "errorType": "pickError", "errorLevel": "WARNING" }]),
        );
        assert!(judge(|_| {}, &error, &error).is_empty());
        // It is shown for one state only, or comes a moment later.
        assert!(judge(|_| {}, &error, &none).is_empty());
        assert!(judge(|_| {}, &none, &error).is_empty());
    }

    #[test]
    fn what_somebody_may_have_ended_needs_no_error() {
        let none = json!([]);
        let cancelled = |trace: &mut Trace| {
            trace.instant("cancelOrder", "c", &json!([]));
        };
        assert!(judge(cancelled, &none, &none).is_empty());
        let by_hand = |trace: &mut Trace| {
            let mut state = state("RUNNING", &json!([]));
            state["operatingMode"] = json!("MANUAL");
            trace.state(&state);
        };
        assert!(judge(by_hand, &none, &none).is_empty());
        let hooked = |trace: &mut Trace| {
            trace.hook();
        };
        assert!(judge(hooked, &none, &none).is_empty());
    }

    #[test]
    fn of_a_recording_without_commands_nothing_is_said() {
        let mut trace = Trace::subscriber();
        let none = json!([]);
        trace.state(&state("RUNNING", &none));
        trace.wait(0.5).state(&state("FAILED", &none));
        trace.wait(20.0).state(&state("FAILED", &none));
        assert!(trace.judge("errors/explained").summary().is_empty());
    }
}
