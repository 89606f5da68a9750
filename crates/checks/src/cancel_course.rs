//! `cancel/course`: how far a vehicle goes after a cancelOrder, and what it says of it meanwhile.
//!
//! What the state with the end of a cancellation has to show is left to `action/linked-state`.

use std::collections::BTreeMap;

use crate::finding::{broken, quote};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Topic, nodes_left};

/// How many cancellations and actions are looked at.
const MANY: usize = 256;

/// How far a vehicle goes after a cancelOrder, and what it says of it meanwhile.
pub(super) const COURSE: Check = Check {
    name: "cancel/course",
    decides: &["ORD-CANCEL-02", "ORD-CANCEL-06"],
    doc: "From the first state that lists a cancelOrder on, the vehicle reaches one node more at the most, as long as no \
          other order is sent. A cancelOrder is not WAITING in two states more than time.notice apart while an action \
          of the order is under way, nor in one that shows a later instant action FINISHED. Not judged over a restart, nor after what a person or a hook did.",
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
    needs: &[StateView::action_states, StateView::last_node_sequence_id],
    start: |_| Box::new(Course::default()),
};

/// What the first state with a cancelOrder showed.
struct Begun {
    order: String,
    /// The farthest sequenceId it may still reach.
    farthest: u64,
    /// Since when it is WAITING beside an action that is under way.
    waits: Option<Moment>,
    told: bool,
}

#[derive(Default)]
struct Course {
    /// Instant actions that were sent, whether they are a cancelOrder, and with which entry.
    sent: BTreeMap<String, (bool, u64)>,
    begun: BTreeMap<String, Begun>,
}

impl Course {
    fn learn(&mut self, record: &Observation<'_>) {
        if record.is_to_vehicle(Topic::Order) {
            self.begun.clear();
            self.sent.retain(|_, (cancels, _)| !*cancels);
        }
        let Some(message) = record.instant_actions_to_vehicle() else {
            return;
        };
        for action in message.all_actions().take(MANY) {
            if self.sent.len() >= MANY {
                self.sent.pop_first();
            }
            let id = action.action_id.or_empty().to_owned();
            self.sent
                .insert(id, (action.action_type.is("cancelOrder"), record.seq()));
        }
    }

    /// Whether an action of the order is under way.
    fn works(&self, state: &StateView) -> bool {
        let mut all = state.all_action_states().take(MANY);
        all.any(|action| action.action_status.is("RUNNING") && !self.sent.contains_key(action.action_id.or_empty()))
    }
}

impl Running for Course {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        self.learn(record);
        if context.world.restarts().now(record) || record.outside_influence() {
            self.begun.clear();
            self.sent.clear();
        }
        if !self.sent.values().any(|(cancels, _)| *cancels) {
            return false;
        }
        let Some(state) = record.state() else {
            return false;
        };
        let Some(last) = state.last_node_sequence_id.whole() else {
            return false;
        };
        let order = state.order_id.or_empty();
        let works = self.works(state);
        let now = record.at().moment;
        let patience = context.time.notice;
        let mut judged = false;
        for action in state.all_action_states().take(MANY) {
            let id = action.action_id.or_empty();
            let status = action.action_status.or_empty();
            let Some((true, seq)) = self.sent.get(id).copied() else {
                continue;
            };
            if status == "FAILED" {
                self.begun.remove(id);
                self.sent.remove(id);
                continue;
            }
            judged = true;
            let begun = self.begun.entry(id.to_owned()).or_insert_with(|| Begun {
                order: order.to_owned(),
                farthest: next_node(state, last),
                waits: None,
                told: false,
            });
            if begun.told || begun.order != order {
                continue;
            }
            if last > begun.farthest {
                begun.told = true;
                let text = format!(
                    "the vehicle has come to sequenceId {last}, and {} was the next when cancelOrder {} was first listed",
                    begun.farthest,
                    quote(id)
                );
                findings.push(broken("ORD-CANCEL-02", record.seq(), text));
                continue;
            }
            if status != "WAITING" || !works {
                begun.waits = None;
                continue;
            }
            let since = *begun.waits.get_or_insert(now);
            // Who has done what was asked for later has read the cancellation long ago.
            let later = state.all_action_states().take(MANY).any(|other| {
                let asked = self.sent.get(other.action_id.or_empty());
                other.action_status.is("FINISHED") && asked.is_some_and(|(_, at)| *at > seq)
            });
            if later || now.since(since) > patience {
                begun.told = true;
                let text = format!(
                    "cancelOrder {} is WAITING, not RUNNING, while an action of the order runs",
                    quote(id)
                );
                findings.push(broken("ORD-CANCEL-06", record.seq(), text));
            }
        }
        judged
    }
}

/// The first node behind the last one; without a list of nodes, the next by number.
fn next_node(state: &StateView, last: u64) -> u64 {
    let nodes = nodes_left(state).unwrap_or_default();
    let ahead = nodes.iter().map(|node| node.sequence).filter(|number| *number > last);
    ahead.min().unwrap_or(last + 2).max(last + 2)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    fn shown(last: u64, cancel: &str, work: &str) -> Value {
        let node = |number: u64| json!({ "nodeId": format!("n{number}"), "sequenceId": number, "released": true });
        let nodes: Vec<Value> = [2, 4, 6]
            .into_iter()
            .filter(|number| *number > last)
            .map(node)
            .collect();
        json!({
            "orderId": "o", "lastNodeSequenceId": last, "nodeStates": nodes,
            "actionStates": [
                { "actionId": "w", "actionType": "beep", "actionStatus": work },
                { "actionId": "c", "actionType": "cancelOrder", "actionStatus": cancel },
            ],
        })
    }

    fn judge(states: &[(u64, &str, &str)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.instant("cancelOrder", "c", &json!([]));
        for (last, cancel, work) in states {
            trace.state(&shown(*last, cancel, work)).wait(0.8);
        }
        trace.judge("cancel/course").summary()
    }

    #[test]
    fn stopping_on_the_next_node_is_right() {
        assert!(judge(&[(0, "RUNNING", "FAILED"), (2, "FINISHED", "FAILED")]).is_empty());
        assert!(judge(&[(2, "WAITING", "FAILED"), (4, "FINISHED", "FAILED")]).is_empty());
    }

    #[test]
    fn driving_on_is_found_and_a_new_order_ends_the_matter() {
        let on = [
            (0, "RUNNING", "FAILED"),
            (2, "RUNNING", "FAILED"),
            (4, "RUNNING", "FAILED"),
        ];
        assert_eq!(judge(&on), ["ORD-CANCEL-02"]);
        let mut trace = Trace::subscriber();
        trace.instant("cancelOrder", "c", &json!([]));
        trace.state(&shown(0, "FINISHED", "FAILED"));
        trace.sent("order", &json!({ "orderId": "o" }));
        trace.state(&shown(4, "FINISHED", "FAILED"));
        assert!(trace.judge("cancel/course").findings.is_empty());
    }

    #[test]
    fn a_cancellation_that_has_not_begun_while_an_action_runs_is_found() {
        let late = [
            (0, "WAITING", "RUNNING"),
            (0, "RUNNING", "RUNNING"),
            (0, "FINISHED", "FAILED"),
        ];
        assert!(judge(&late).is_empty());
        let never = [
            (0, "WAITING", "RUNNING"),
            (0, "WAITING", "RUNNING"),
            (0, "WAITING", "RUNNING"),
        ];
        assert_eq!(judge(&never), ["ORD-CANCEL-06"]);
    }
}
