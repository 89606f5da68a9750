//! `state/action-ids`: the vehicle names its actions as they were sent.
//!
//! Which actions are listed is left to `state_actions` and to the tests.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, StateView, Text};
use tck_world::{Listen, Observation, Topic};

/// How many actionIds are kept in mind, and how many of one message are looked at.
const IDS: usize = 8192;
/// Longer ones are not judged.
const LONGEST: u64 = 1024;
/// A shorter beginning may be a name of its own.
const BEGINNING: usize = 8;

/// The vehicle names its actions as they were sent.
pub(crate) const ACTION_IDS: Check = Check {
    name: "state/action-ids",
    decides: &["STATE-MSG-14"],
    doc: "actionStates list no actionId that was never sent and is the beginning, of at least eight characters, of one that \
          was: it was cut off. Judged only as long as all actionIds of the run are kept in mind; what was listed before \
          anything was sent is of an earlier run.",
    arguments: &[],
    listens: &[
        Listen::ToVehicle(Topic::InstantActions),
        Listen::ToVehicle(Topic::Order),
        Listen::Delivered(Topic::State),
    ],
    reads: &[],
    needs: &[StateView::action_states],
    start: |_| Box::new(ActionIds::default()),
};

#[derive(Default)]
struct ActionIds {
    sent: BTreeSet<Text>,
    /// What a vehicle listed before any of this was sent may be of an earlier run.
    old: BTreeSet<Text>,
    unknown: bool,
    told: bool,
}

impl ActionIds {
    fn learn(&mut self, record: &Observation<'_>) {
        let read = |action: &ActionView| action.action_id.there().cloned().unwrap_or_default();
        if let Some(order) = record.order_to_vehicle() {
            self.sent
                .extend(order.actions().map(|(_, action)| read(action)).take(IDS));
        }
        if let Some(message) = record.instant_actions_to_vehicle() {
            self.sent.extend(message.all_actions().map(read).take(IDS));
        }
        self.unknown |= self.sent.len() > IDS;
    }

    /// The actionId that was sent and of which this one is only the beginning.
    fn whole(&self, id: &Text) -> Option<&Text> {
        // Of a text that is not kept as a whole, the length tells whether it is the beginning.
        let mut from = self.sent.range(id.clone()..);
        from.next().filter(|sent| sent.starts_with(id.as_str()) && *sent != id)
    }
}

impl Running for ActionIds {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.learn(record);
        let Some(state) = record.state() else {
            return false;
        };
        let listed = state.all_action_states().take(IDS);
        let ids = listed.filter_map(|action| action.action_id.there());
        if self.sent.is_empty() {
            self.old = ids.cloned().collect();
            return false;
        }
        let mut judged = false;
        for id in ids.filter(|id| id.len() >= BEGINNING && id.length() < LONGEST) {
            if self.unknown || self.old.contains(id) {
                continue;
            }
            judged = true;
            let Some(whole) = self
                .whole(id)
                .filter(|_| !self.sent.contains(id))
                .filter(|_| !self.told)
            else {
                continue;
            };
            let text = format!("actionStates lists {}, and {} was sent", quote(id), quote(whole));
            findings.push(broken("STATE-MSG-14", record.seq(), text));
            self.told = true;
        }
        judged
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    fn listed(id: &str) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({}));
        trace.instant("stateRequest", "12345678-abcdef", &json!([]));
        trace.state(&json!({ "actionStates": [{ "actionId": id, "actionStatus": "FINISHED" }] }));
        trace.state(&json!({ "actionStates": [{ "actionId": id, "actionStatus": "FINISHED" }] }));
        trace.judge("state/action-ids").summary()
    }

    #[test]
    fn ids_as_they_were_sent_and_ids_of_others_are_right() {
        assert!(listed("12345678-abcdef").is_empty());
        assert!(listed("12345679").is_empty());
        assert!(listed("123").is_empty());
    }

    #[test]
    fn an_id_that_is_cut_off_is_found_once() {
        assert_eq!(listed("12345678-abc"), ["STATE-MSG-14"]);
    }
}
