//! `state/joint-loads`: a pick of a stitching node that is done is not done again when an update repeats it.
//!
//! An action that shows another status than FINISHED again is left to `state/action-transitions`: this is about one that is over
//! before the next state.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionState, OrderView, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// A pick of a stitching node that is done is not done again when an update repeats it.
pub(crate) const JOINT_LOADS: Check = Check {
    name: "state/joint-loads",
    decides: &["ORD-UPD-07"],
    doc: "Behind an update whose first node repeats a pick that is FINISHED, loads does not list more than before as long \
          as no other action is under way or has ended. A restart, and what a person or a hook did, end the watch.",
    arguments: &[],
    listens: &[
        Listen::Connect,
        Listen::Delivered(Topic::Connection),
        Listen::Hook,
        Listen::Answer,
        Listen::ToVehicle(Topic::Order),
        Listen::ToVehicle(Topic::InstantActions),
        Listen::Delivered(Topic::State),
    ],
    reads: &[Fact::Restarts],
    needs: &[StateView::loads, StateView::action_states],
    start: |_| Box::new(JointLoads::default()),
};

/// How many actions are looked at.
const ACTIONS: usize = 1024;

/// What the last state showed.
struct Shown {
    order: String,
    loads: usize,
    finished: BTreeSet<String>,
    /// Whether an action is under way.
    acts: bool,
}

impl Shown {
    fn read(state: &StateView) -> Option<Self> {
        let all = || state.all_action_states().take(ACTIONS);
        let finished = all().filter(|action| action.action_status.is("FINISHED"));
        let acts = |action: &ActionState| !action.is_over() && !action.action_status.is("WAITING");
        Some(Self {
            order: state.order_id.or_empty().to_owned(),
            loads: state.loads.there()?.total(),
            finished: finished.map(|action| action.action_id.or_empty().to_owned()).collect(),
            acts: all().any(acts),
        })
    }
}

#[derive(Default)]
struct JointLoads {
    shown: Option<Shown>,
    /// The pick that an update repeats.
    repeated: Option<String>,
}

impl JointLoads {
    /// The pick on the first node of an update that the vehicle has shown FINISHED.
    fn repeated(&self, order: &OrderView) -> Option<String> {
        let shown = self.shown.as_ref()?;
        if !order.order_id.is(&shown.order) || shown.acts {
            return None;
        }
        let first = order.nodes.iter().next()?;
        let mut picks = first.actions.iter().filter(|action| action.action_type.is("pick"));
        let done = picks.find(|action| shown.finished.contains(action.action_id.or_empty()))?;
        Some(done.action_id.or_empty().to_owned())
    }
}

impl Running for JointLoads {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.restarts().now(record) || record.outside_influence() {
            self.shown = None;
            self.repeated = None;
        }
        if record.is_to_vehicle(Topic::InstantActions) {
            self.repeated = None;
        }
        if let Some(order) = record.order_to_vehicle() {
            self.repeated = self.repeated(order);
        }
        let Some(state) = record.state() else {
            return false;
        };
        let now = Shown::read(state);
        let before = std::mem::replace(&mut self.shown, now);
        let (Some(before), Some(now)) = (before, self.shown.as_ref()) else {
            return false;
        };
        // From here on another action may be the reason.
        if now.acts || !now.finished.is_subset(&before.finished) {
            self.repeated = None;
        }
        let Some(pick) = &self.repeated else { return false };
        if now.loads > before.loads {
            let text = format!(
                "loads lists {} and listed {}, behind an update that repeats the finished pick {}",
                now.loads,
                before.loads,
                quote(pick)
            );
            findings.push(broken("ORD-UPD-07", record.seq(), text));
            self.repeated = None;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn carries(loads: usize, status: &[(&str, &str)]) -> Value {
        let actions: Vec<Value> = status
            .iter()
            .map(|(id, status)| json!({ "actionId": id, "actionStatus": status }))
            .collect();
        let loads: Vec<Value> = (0..loads).map(|load| json!({ "loadId": load.to_string() })).collect();
        json!({ "orderId": "o", "loads": loads, "actionStates": actions })
    }

    fn behind_update(states: &[Value]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        let pick = json!({ "actionId": "p", "actionType": "pick" });
        let joint = json!({ "nodeId": "b", "sequenceId": 2, "released": true, "actions": [pick] });
        trace.state(&carries(1, &[("p", "FINISHED")]));
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 1, "nodes": [joint], "edges": [] }),
        );
        for state in states {
            trace.state(state);
        }
        trace.judge("state/joint-loads").summary()
    }

    #[test]
    fn a_load_that_stays_alone_is_right() {
        assert!(behind_update(&[carries(1, &[("p", "FINISHED")]), carries(0, &[("p", "FINISHED")])]).is_empty());
    }

    #[test]
    fn a_second_load_is_found() {
        assert_eq!(behind_update(&[carries(2, &[("p", "FINISHED")])]), ["ORD-UPD-07"]);
    }

    #[test]
    fn a_load_that_another_action_explains_is_right() {
        let other = carries(1, &[("p", "FINISHED"), ("q", "RUNNING")]);
        let both = carries(2, &[("p", "FINISHED"), ("q", "FINISHED")]);
        assert!(behind_update(&[other, both.clone()]).is_empty());
        assert!(behind_update(&[both]).is_empty());
    }
}
