//! `state/pause-allowed`: a pause holds the actions that can be held, and no others.

use std::collections::{BTreeMap, BTreeSet};

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, OfferedAction, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many actions are looked at.
const ACTIONS: usize = 256;

/// A pause holds the actions that can be held, and no others.
pub(crate) const PAUSE_ALLOWED: Check = Check {
    name: "state/pause-allowed",
    decides: &["ACT-15", "ACT-43"],
    doc: "In the state that reports a startPause FINISHED for the first time, as long as no stopPause was sent behind it, no action of \
          an order or a zone is RUNNING whose pauseAllowed is true in the factsheet. One whose pauseAllowed is false and that \
          is PAUSED is a warning. Nothing is judged before there is a factsheet, and not where a person or a hook has a hand in it.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::Factsheet),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[
        StateView::action_states,
        StateView::instant_action_states,
        OfferedAction::pause_allowed,
    ],
    start: |_| Box::new(PauseAllowed::default()),
};

#[derive(Default)]
struct PauseAllowed {
    /// pauseAllowed by actionType.
    pausable: BTreeMap<String, bool>,
    /// actionIds of startPause that were sent, and of which no state has shown the end.
    asked: BTreeSet<String>,
    said: BTreeSet<String>,
}

impl PauseAllowed {
    fn learn(&mut self, record: &Observation<'_>, context: &CheckContext<'_>) {
        if let Some(sheet) = record.factsheet() {
            let actions = sheet.offered_actions().take(ACTIONS);
            let said = actions
                .filter_map(|action| Some((action.action_type.text()?.to_owned(), action.pause_allowed.flag()?)));
            self.pausable = said.collect();
        }
        // Whoever lets it go on, or pauses it by hand, leaves open what the actions do.
        if record.outside_influence() || context.world.restarts().now(record) {
            self.asked.clear();
        }
        let instant = record.instant_actions_to_vehicle();
        for action in instant.into_iter().flat_map(|message| message.all_actions()) {
            match action.action_type.or_empty() {
                "startPause" if self.asked.len() < ACTIONS => {
                    self.asked.insert(action.action_id.or_empty().to_owned());
                }
                "stopPause" => self.asked.clear(),
                _ => {}
            }
        }
    }

    /// What is wrong with an action while the vehicle is paused.
    fn held_against(&self, action: &ActionState, seq: u64) -> Vec<CheckFinding> {
        let id = action.action_id.or_empty();
        let status = action.action_status.or_empty();
        let kind = action.action_type.or_empty();
        let what = format!(
            "startPause is FINISHED, and action {} of type {} is {status}",
            quote(id),
            quote(kind)
        );
        match (self.pausable.get(kind), status) {
            (Some(true), "RUNNING") => {
                let text = format!("{what}, although the factsheet says that it can be paused");
                vec![broken("ACT-15", seq, text.clone()), broken("ACT-43", seq, text)]
            }
            (Some(false), "PAUSED") => {
                let text = format!("{what}, although the factsheet says that it cannot be paused");
                vec![remark("ACT-43", seq, text)]
            }
            _ => Vec::new(),
        }
    }
}

impl Running for PauseAllowed {
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
        let ended = state.instant_action_states.iter().filter(|action| action.is_over());
        let ended: Vec<&ActionState> = ended
            .filter(|action| self.asked.contains(action.action_id.or_empty()))
            .collect();
        for action in &ended {
            self.asked.remove(action.action_id.or_empty());
        }
        let begins = ended.iter().any(|action| action.action_status.is("FINISHED"));
        if !begins || !state.paused.is(true) || !self.asked.is_empty() || self.pausable.is_empty() {
            return false;
        }
        let order = state.action_states.iter().take(ACTIONS);
        let actions = order.chain(state.zone_action_states.iter().take(ACTIONS));
        let mut judged = false;
        for action in actions.filter(|action| !action.is_over() && !action.action_status.is("WAITING")) {
            judged |= self.pausable.contains_key(action.action_type.or_empty());
            let found = self.held_against(action, record.seq());
            let id = action.action_id.or_empty().to_owned();
            if !found.is_empty() && self.said.len() < ACTIONS && self.said.insert(id) {
                findings.extend(found);
            }
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::{Trace, merged};

    fn vehicle() -> Trace {
        let mut trace = Trace::subscriber_of("3.0");
        let actions = json!([
            { "actionType": "lift", "actionScopes": ["NODE"], "pauseAllowed": true, "cancelAllowed": true },
            { "actionType": "weigh", "actionScopes": ["NODE"], "pauseAllowed": false, "cancelAllowed": true },
        ]);
        trace.message(
            "factsheet",
            &json!({ "protocolFeatures": { "mobileRobotActions": actions } }),
        );
        trace.state(&json!({ "paused": false, "instantActionStates": [] }));
        trace
    }

    fn paused(kind: &str, status: &str) -> Value {
        json!({
            "paused": true,
            "instantActionStates": [{ "actionId": "p", "actionType": "startPause", "actionStatus": "FINISHED" }],
            "actionStates": [{ "actionId": "w", "actionType": kind, "actionStatus": status }],
        })
    }

    fn judge(kind: &str, status: &str) -> Vec<String> {
        let mut trace = vehicle();
        trace.instant("startPause", "p", &json!([]));
        trace.state(&paused(kind, status)).state(&paused(kind, status));
        trace.judge("state/pause-allowed").summary()
    }

    #[test]
    fn what_can_be_paused_is_paused() {
        for status in ["PAUSED", "WAITING", "INITIALIZING", "FINISHED", "FAILED", "RETRIABLE"] {
            assert!(judge("lift", status).is_empty(), "{status}");
        }
        assert_eq!(judge("lift", "RUNNING"), ["ACT-15", "ACT-43"]);
    }

    #[test]
    fn what_cannot_be_paused_goes_on() {
        assert!(judge("weigh", "RUNNING").is_empty());
        assert_eq!(judge("weigh", "PAUSED"), ["ACT-43 warning"]);
        // Of what the factsheet does not list nothing is known.
        assert!(judge("sing", "RUNNING").is_empty());
    }

    #[test]
    fn a_pause_that_is_over_or_still_to_come_leaves_it_open() {
        let mut trace = vehicle();
        trace
            .instant("startPause", "p", &json!([]))
            .instant("stopPause", "q", &json!([]));
        trace.state(&paused("lift", "RUNNING"));
        assert!(trace.judge("state/pause-allowed").findings.is_empty());
        let mut trace = vehicle();
        trace.instant("startPause", "p", &json!([]));
        trace.state(&merged(
            paused("lift", "RUNNING"),
            &json!({ "instantActionStates": [] }),
        ));
        trace.state(&paused("lift", "PAUSED"));
        assert!(trace.judge("state/pause-allowed").findings.is_empty());
    }
}
