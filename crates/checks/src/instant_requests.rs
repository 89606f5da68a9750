//! `instant/requests`: who is asked for a state or a factsheet publishes it, whatever else it does.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::finding::{broken, quote, remark};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Seen, Topic};

/// How many requests are kept in mind.
const REQUESTS: usize = 64;

/// Who is asked for a state or a factsheet publishes it, whatever else it does.
pub(super) const REQUESTS_MET: Check = Check {
    name: "instant/requests",
    decides: &["ACT-26", "ACT-40"],
    doc: "The next state comes within time.event of a stateRequest, up to time.eventWarning with a warning, if a state says \
          that the request was met. A factsheetRequest that is FINISHED is followed, or was preceded since it was sent, by \
          a factsheet within time.react; from time.slow on it is a warning. Not judged while the harness disturbs the \
          link, nor over a restart.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::Fault,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::Factsheet),
        Listen::Stored(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts, Fact::Instant],
    needs: &[StateView::action_states],
    start: |_| Box::new(Requests::default()),
};

#[derive(Default)]
struct Requests {
    /// When the next state came for each stateRequest, as soon as it did: time it took, and entry.
    states: BTreeMap<String, (Moment, Option<(Duration, u64)>)>,
    /// When each factsheetRequest was seen FINISHED, and whether that was remarked on.
    sheets: BTreeMap<String, Option<(Moment, u64, bool)>>,
}

impl Requests {
    fn learn(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        let message = context.world.instant().well_formed(record);
        let Some(message) = message.filter(|_| !record.link.disturbed) else {
            return;
        };
        for action in message.all_actions().take(REQUESTS) {
            let id = action.action_id.or_empty().to_owned();
            match action.action_type.or_empty() {
                "stateRequest" if self.states.len() < REQUESTS => {
                    self.states.entry(id).or_insert((record.at().moment, None));
                }
                "factsheetRequest" if self.sheets.len() < REQUESTS => {
                    self.sheets.entry(id).or_insert(None);
                }
                _ => {}
            }
        }
    }

    fn state_came(
        &mut self,
        state: &StateView,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) {
        let now = record.at().moment;
        let soft = context.time.event;
        let hard = context.time.event_warning.max(soft);
        for (since, came) in self.states.values_mut() {
            came.get_or_insert((now.since(*since), record.seq()));
        }
        for action in state.all_action_states().take(REQUESTS * 4) {
            let (id, status) = (action.action_id.or_empty(), action.action_status.or_empty());
            if !matches!(status, "FINISHED" | "FAILED") {
                continue;
            }
            if let Some((_, Some((took, seq)))) = self.states.remove(id)
                && status == "FINISHED"
            {
                let text = format!(
                    "no state came for {:.1} s after stateRequest {}, which is reported FINISHED",
                    took.as_secs_f64(),
                    quote(id)
                );
                if took > hard {
                    findings.push(broken("ACT-26", seq, text));
                } else if took > soft {
                    findings.push(remark("ACT-26", seq, text));
                }
            }
            if status == "FAILED" {
                self.sheets.remove(id);
            } else if let Some(seen) = self.sheets.get_mut(id) {
                seen.get_or_insert((now, record.seq(), false));
            }
        }
    }

    fn overdue(&mut self, now: Moment, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let slow = context.time.slow;
        let react = context.time.react;
        let mut given_up = Vec::new();
        for (id, seen) in &mut self.sheets {
            let Some((since, seq, remarked)) = seen else { continue };
            let text = format!(
                "factsheetRequest {} is FINISHED, and no factsheet has come since it was sent",
                quote(id)
            );
            if now.since(*since) > react {
                findings.push(broken("ACT-40", *seq, text));
                given_up.push(id.clone());
            } else if now.since(*since) > slow && !*remarked {
                *remarked = true;
                findings.push(remark("ACT-40", *seq, text));
            }
        }
        for id in given_up {
            self.sheets.remove(&id);
        }
    }
}

impl Running for Requests {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let restarted = context.world.restarts().now(record);
        if restarted || record.link.disturbed || record.outside_influence() {
            self.states.clear();
            self.sheets.clear();
        }
        self.learn(record, context);
        if record.is(Seen::Delivered, Topic::Factsheet) || record.is(Seen::Stored, Topic::Factsheet) {
            self.sheets.clear();
        }
        let Some(state) = record.state() else {
            return false;
        };
        let judged = !self.states.is_empty() || !self.sheets.is_empty();
        self.overdue(record.at().moment, context, findings);
        self.state_came(state, record, context, findings);
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::{Trace, merged};

    fn asks(kind: &str) -> Trace {
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        let action = json!({ "actionId": "x", "actionType": kind, "blockingType": "NONE" });
        let message = merged(trace.header(), &json!({ "actions": [action] }));
        trace.sent("instantActions", &message);
        trace
    }

    fn ended(status: &str) -> Value {
        json!({ "actionStates": [{ "actionId": "x", "actionStatus": status }] })
    }

    #[test]
    fn a_state_that_was_asked_for_comes_at_once() {
        let after = |seconds: f64, status: &str| {
            let mut trace = asks("stateRequest");
            trace.wait(seconds).state(&ended(status));
            trace.judge("instant/requests").summary()
        };
        assert!(after(0.3, "FINISHED").is_empty());
        assert_eq!(after(3.0, "FINISHED"), ["ACT-26 warning"]);
        assert_eq!(after(20.0, "FINISHED"), ["ACT-26"]);
        assert!(after(20.0, "FAILED").is_empty());
    }

    #[test]
    fn a_factsheet_that_is_said_to_be_published_comes() {
        let after = |seconds: f64, comes: bool| {
            let mut trace = asks("factsheetRequest");
            trace.state(&ended("FINISHED"));
            if comes {
                trace.message("factsheet", &json!({}));
            }
            trace.wait(seconds).state(&ended("FINISHED"));
            trace.judge("instant/requests").summary()
        };
        assert!(after(60.0, true).is_empty());
        assert!(after(2.0, false).is_empty());
        assert_eq!(after(10.0, false), ["ACT-40 warning"]);
        assert_eq!(after(60.0, false), ["ACT-40"]);
    }

    #[test]
    fn a_request_that_a_restart_swallowed_is_forgiven() {
        let mut trace = asks("factsheetRequest");
        trace
            .state(&ended("FINISHED"))
            .connection("CONNECTIONBROKEN")
            .connection("ONLINE")
            .wait(60.0)
            .state(&json!({}));
        assert!(trace.judge("instant/requests").findings.is_empty());
    }
}
