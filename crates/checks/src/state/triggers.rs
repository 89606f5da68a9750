//! `state/action-triggers`: actions of an order begin where they belong, and edge actions end there.
//!
//! Which statuses may follow each other is left to `state_actions`.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Placed, Topic};

/// How many actions are kept in mind from one state to the next.
const ACTIONS: usize = 1024;

/// Actions of an order begin where they belong, and edge actions end there.
pub(crate) const TRIGGERS: Check = Check {
    name: "state/action-triggers",
    decides: &["ASTATE-02", "ASTATE-03", "ACT-02", "NODE-05"],
    doc: "An action of a node does not begin before the node is the last node, one of an edge not before the node in \
          front of it is. Behind its edge an action is over; one state of overlap is tolerated. Not judged after a \
          cancelOrder, a change of mode, a fatal error or a failed action.",
    arguments: &[],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Shown, Fact::Orders],
    needs: &[StateView::action_states, StateView::order_id],
    start: |_| Box::new(Triggers::default()),
};

#[derive(Default)]
struct Triggers {
    /// Actions reported already, and edge actions that were open behind their edge in the last state.
    early: BTreeSet<String>,
    open: BTreeSet<String>,
}

impl Running for Triggers {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = context.world.shown().state(record) else {
            return false;
        };
        let Some((node, sequence)) = context
            .world
            .shown()
            .last()
            .filter(|_| context.world.shown().carried().is_none())
        else {
            return false;
        };
        let sent: Vec<_> = context.world.orders().of(state.order_id.or_empty()).collect();
        let here = sent
            .iter()
            .flat_map(|sent| &sent.nodes)
            .any(|element| element.id == *node && element.sequence == *sequence);
        if !here || sent.iter().any(|sent| !sent.sound) {
            return false;
        }
        let progress = *sequence;
        let mut open = BTreeSet::new();
        for action in state.all_action_states().take(ACTIONS) {
            let (id, status) = (action.action_id.or_empty(), action.action_status.or_empty());
            let places: Vec<&Placed> = sent
                .iter()
                .flat_map(|sent| &sent.actions)
                .filter(|placed| placed.action == id)
                .collect();
            // An id that is used in two places says nothing.
            let Some(place) = places
                .first()
                .filter(|first| places.iter().all(|place| place.sequence == first.sequence))
            else {
                continue;
            };
            let begun = matches!(status, "INITIALIZING" | "RUNNING" | "PAUSED" | "FINISHED");
            let ahead = place.sequence > progress + u64::from(place.on_edge);
            if begun && ahead && self.early.len() < ACTIONS && self.early.insert(id.to_owned()) {
                let what = if place.on_edge { "edge" } else { "node" };
                let message = format!(
                    "action {} of the {what} with sequenceId {} is {status} at sequenceId {progress}",
                    quote(id),
                    place.sequence
                );
                if place.on_edge {
                    findings.push(broken("ACT-02", record.seq(), message.clone()));
                }
                if status == "INITIALIZING" {
                    findings.push(broken("ASTATE-03", record.seq(), message.clone()));
                }
                findings.push(broken("ASTATE-02", record.seq(), message));
            }
            let unfinished = matches!(status, "WAITING" | "INITIALIZING" | "RUNNING" | "PAUSED");
            if place.on_edge && unfinished && progress > place.sequence {
                open.insert(id.to_owned());
                if self.open.contains(id) && self.early.len() < ACTIONS && self.early.insert(id.to_owned()) {
                    let message = format!(
                        "action {} of the edge with sequenceId {} is still {status} at sequenceId {progress}",
                        quote(id),
                        place.sequence
                    );
                    findings.push(broken("NODE-05", record.seq(), message.clone()));
                    findings.push(broken("ACT-02", record.seq(), message));
                }
            }
        }
        self.open = open;
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    /// What is found when a vehicle drives from a to b to c and shows these statuses of an action on edge b-c
    /// and one on node b, at a, at b, and twice at c.
    fn drive(edge: [&str; 4], node: [&str; 4]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({ "lastNodeId": "a", "lastNodeSequenceId": 8 }));
        let visit =
            |id: &str, sequence: u64| json!({ "nodeId": id, "sequenceId": sequence, "released": true, "actions": [] });
        let mut nodes = vec![visit("a", 0), visit("b", 2), visit("c", 4)];
        nodes[1]["actions"] = json!([{ "actionId": "node" }]);
        let edges = json!([
            { "edgeId": "a-b", "sequenceId": 1, "released": true, "actions": [] },
            { "edgeId": "b-c", "sequenceId": 3, "released": true, "actions": [{ "actionId": "edge" }] },
        ]);
        trace.sent(
            "order",
            &json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": edges }),
        );
        for (at, (last, sequence)) in [("a", 0), ("b", 2), ("c", 4), ("c", 4)].into_iter().enumerate() {
            trace.state(&json!({
                "orderId": "o", "lastNodeId": last, "lastNodeSequenceId": sequence,
                "actionStates": [
                    { "actionId": "edge", "actionStatus": edge[at] },
                    { "actionId": "node", "actionStatus": node[at] },
                ],
            }));
        }
        let outcome = trace.judge("state/action-triggers");
        assert_eq!(outcome.judged, 4);
        outcome.summary()
    }

    const NODE: [&str; 4] = ["WAITING", "RUNNING", "FINISHED", "FINISHED"];
    const EDGE: [&str; 4] = ["WAITING", "RUNNING", "RUNNING", "FINISHED"];

    #[test]
    fn actions_in_their_places_are_right() {
        assert!(drive(EDGE, NODE).is_empty());
        assert!(
            drive(
                ["WAITING", "WAITING", "FINISHED", "FINISHED"],
                ["WAITING", "WAITING", "RUNNING", "FINISHED"]
            )
            .is_empty()
        );
    }

    #[test]
    fn actions_that_begin_early_are_found_once() {
        assert_eq!(
            drive(EDGE, ["RUNNING", "RUNNING", "FINISHED", "FINISHED"]),
            ["ASTATE-02"]
        );
        assert_eq!(
            drive(["RUNNING", "RUNNING", "FINISHED", "FINISHED"], NODE),
            ["ACT-02", "ASTATE-02"]
        );
    }

    #[test]
    fn preparation_before_the_trigger_is_found() {
        assert_eq!(
            drive(EDGE, ["INITIALIZING", "RUNNING", "FINISHED", "FINISHED"]),
            ["ASTATE-03", "ASTATE-02"]
        );
    }

    #[test]
    fn an_edge_action_that_outlives_its_edge_is_found() {
        assert_eq!(
            drive(["WAITING", "RUNNING", "RUNNING", "RUNNING"], NODE),
            ["NODE-05", "ACT-02"]
        );
    }
}
