//! Instant actions that contradict the order the vehicle is driving.

use super::{Command, Found};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Scope, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/contradicts`.
pub(crate) const CONTRADICTS: Check = Check {
    name: "commands/contradicts",
    decides: &["IACT-02"],
    doc: "While the states of a vehicle show released parts of an order that was not called off, no initPosition comes \
          as an instant action to a vehicle that knows where it is; otherwise it is a warning. What comes within the time a \
          message may take is not judged.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Mock],
    needs: &[ActionView::action_type, StateView::node_states],
    start: |_| Box::new(Contradicts::default()),
};

#[derive(Default)]
struct Contradicts {
    /// Since when the vehicle shows an order to be driven.
    since: Option<Moment>,
}

impl Running for Contradicts {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) {
            self.since = None;
        }
        if record.said_state().is_some() {
            let busy = context.world.mock().last().filter(|seen| seen.base > 0);
            self.since = busy.map(|seen| self.since.unwrap_or(seen.at));
        }
        let Some(command) = Command::read(record) else {
            return false;
        };
        let actions = command
            .actions()
            .into_iter()
            .filter(|(scope, _)| *scope == Scope::Instant);
        let kinds: Vec<&str> = actions.map(|(_, action)| action.action_type.or_empty()).collect();
        if kinds.contains(&"cancelOrder") {
            self.since = None;
        }
        let Some(since) = self.since.filter(|_| !record.link.disturbed) else {
            return false;
        };
        if kinds.is_empty() || record.at().moment.since(since) < context.time.notice {
            return false;
        }
        let placed = context.world.mock().last().is_some_and(|seen| seen.pose.is_some());
        let mut found = Found::new(record, findings);
        for kind in kinds {
            if matches!(kind, "initPosition" | "initializePosition") && placed {
                let text = format!(
                    "the instant action {} comes to a vehicle that has an order to drive",
                    quote(kind)
                );
                found.remark("IACT-02", text);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    fn sent(first: &[&str], kind: &str) -> Vec<String> {
        let mut trace = Trace::master_control();
        let left = json!([{ "nodeId": "n2", "sequenceId": 2, "released": true }]);
        trace
            .shows(&json!({ "orderId": "o1", "nodeStates": left, "driving": true }))
            .wait(5.0);
        for kind in first.iter().chain(&[kind]) {
            let action = json!({ "actionId": kind, "actionType": kind });
            trace.commands("instantActions", &json!({ "actions": [action] }));
        }
        trace.judge("commands/contradicts").summary()
    }

    #[test]
    fn who_drives_is_not_placed_elsewhere() {
        assert_eq!(sent(&[], "initPosition"), ["IACT-02 warning"]);
        assert!(sent(&["cancelOrder"], "initPosition").is_empty());
        // There are charging lanes, on which a vehicle charges while it drives.
        assert!(sent(&[], "startCharging").is_empty());
        assert!(sent(&[], "startPause").is_empty());
    }
}
