//! `action/blocking`: the actions of a node or an edge, held against their blocking types and the sequence of their list.
//!
//! That actions run at all, and where, is left to the tests and to `state_triggers`.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Blocking, Fact, Listen, Observation, OrdersSent, Placed, SentOrder, Topic};

/// How many actions of one state are looked at, and how many findings are remembered.
const ACTIONS: usize = 256;
const KNOWN: usize = 1024;

/// The actions of a node or an edge, held against their blocking types and the sequence of their list.
pub(super) const BLOCKING: Check = Check {
    name: "action/blocking",
    decides: &["BLOCK-01", "BLOCK-03", "BLOCK-04", "BLOCK-05", "BLOCK-06"],
    doc: "Of the actions of one node, a HARD one runs beside no other, no action runs before one that stands in front \
          of it with a HARD one between or among them, and what may run in parallel is over before the next HARD one \
          begins. While a SOFT or HARD action of a node or an edge runs, driving is false. Running one after the other what may run in \
          parallel is a liberty. The sequence of the actions of edges, instant actions, and pick, drop and finePositioning, which move the \
          vehicle themselves, are not held to this; another action than the one named `still` may move it, too, which \
          makes it a warning. Not judged after a cancelOrder, a change of mode, a fatal error or a failed action.",
    arguments: &["still"],
    listens: &[Listen::Delivered(Topic::State)],
    reads: &[Fact::Shown, Fact::Orders],
    needs: &[StateView::action_states, StateView::order_id],
    start: |_| Box::new(BlockingTypes::default()),
};

#[derive(Default)]
struct BlockingTypes {
    /// What was found already: requirement and actionIds.
    known: BTreeSet<(&'static str, String, String)>,
}

/// An action of a node that a state lists.
struct Listed<'s> {
    id: &'s str,
    status: &'s str,
    /// actionType, as it was ordered.
    kind: String,
    blocking: Blocking,
    sequence: u64,
    /// Its place in the list of its node.
    rank: usize,
    /// How many HARD actions stand in front of it there.
    hard_before: usize,
    /// Whether it belongs to an edge.
    on_edge: bool,
}

impl Listed<'_> {
    fn runs(&self) -> bool {
        matches!(self.status, "RUNNING" | "PAUSED")
    }

    fn is_hard(&self) -> bool {
        self.blocking == Blocking::Hard
    }

    /// Whether it may run beside an action of the same list that stands further behind.
    fn may_join(&self, later: &Self) -> bool {
        !self.is_hard() && !later.is_hard() && self.hard_before == later.hard_before
    }
}

impl Running for BlockingTypes {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(state) = context.world.shown().state(record) else {
            return false;
        };
        let listed = Self::listed(state, context.world.orders());
        if listed.is_empty() {
            return false;
        }
        let seq = record.seq();
        let mut found = Vec::new();
        let of_nodes: Vec<&Listed<'_>> = listed.iter().filter(|action| !action.on_edge).collect();
        for (at, one) in of_nodes.iter().enumerate() {
            for other in &of_nodes[at + 1..] {
                let (first, second) = if (one.sequence, one.rank) <= (other.sequence, other.rank) {
                    (one, other)
                } else {
                    (other, one)
                };
                self.pair(first, second, seq, &mut found);
            }
        }
        if state.driving.is(true) {
            let still = context.with.get("still").and_then(Value::as_str);
            for action in listed.iter().filter(|action| action.runs()) {
                self.moving(action, still, seq, &mut found);
            }
        }
        findings.append(&mut found);
        true
    }
}

impl BlockingTypes {
    /// The actions of nodes whose list is known.
    fn listed<'s>(state: &'s StateView, orders: &OrdersSent) -> Vec<Listed<'s>> {
        let order = state.order_id.or_empty();
        if orders.of(order).any(|sent| !sent.sound) {
            return Vec::new();
        }
        let all = state.action_states.iter().take(ACTIONS);
        all.filter_map(|action| {
            let id = action.action_id.or_empty();
            let mut places = orders.of(order).filter_map(|sent| {
                let here = sent.actions.iter().find(|placed| placed.action == id);
                here.map(|placed| (placed, sent))
            });
            let (placed, sent) = places.next()?;
            // An update that says something else about the node leaves open what the vehicle goes by.
            let list = |sent: &SentOrder| -> Vec<Placed> {
                let of_node = |other: &&Placed| other.sequence == placed.sequence;
                sent.actions.iter().filter(of_node).cloned().collect()
            };
            let own = list(sent);
            let clear = orders
                .of(order)
                .filter(|other| {
                    let mut all = other.nodes.iter().chain(&other.edges);
                    all.any(|element| element.sequence == placed.sequence)
                })
                .all(|other| list(other) == own);
            let blocking = placed.blocking.filter(|_| clear)?;
            let rank = own.iter().position(|other| other.action == id)?;
            let hard_before = own[..rank]
                .iter()
                .filter(|other| other.blocking == Some(Blocking::Hard));
            Some(Listed {
                id,
                status: action.action_status.or_empty(),
                kind: placed.kind.clone(),
                blocking,
                sequence: placed.sequence,
                rank,
                hard_before: hard_before.count(),
                on_edge: placed.on_edge,
            })
        })
        .collect()
    }

    /// Two actions, `first` in front of `second`.
    fn pair(&mut self, first: &Listed<'_>, second: &Listed<'_>, seq: u64, found: &mut Vec<CheckFinding>) {
        let names = format!("{} and {}", quote(first.id), quote(second.id));
        if first.runs() && second.status == "RUNNING" && (first.is_hard() || second.is_hard()) {
            let text = format!("actions {names} run together, and one of them is HARD");
            if first.sequence != second.sequence {
                // The list of a node says nothing about what still runs from a node before.
                self.keep("BLOCK-05", first, second, || remark("BLOCK-05", seq, text), found);
                return;
            }
            self.keep("BLOCK-05", first, second, || broken("BLOCK-05", seq, text), found);
        }
        if first.sequence != second.sequence || first.status != "WAITING" {
            return;
        }
        let overtakes = if first.may_join(second) {
            second.status == "FINISHED"
        } else {
            matches!(second.status, "RUNNING" | "FINISHED")
        };
        if overtakes {
            let text = format!(
                "action {} is {} while {} in front of it is still WAITING",
                quote(second.id),
                second.status,
                quote(first.id)
            );
            let sequence = || broken("BLOCK-01", seq, text.clone());
            self.keep("BLOCK-01", first, second, sequence, found);
            if first.is_hard() != second.is_hard() {
                self.keep(
                    "BLOCK-06",
                    first,
                    second,
                    || broken("BLOCK-06", seq, text.clone()),
                    found,
                );
            }
        }
    }

    fn moving(&mut self, action: &Listed<'_>, still: Option<&str>, seq: u64, found: &mut Vec<CheckFinding>) {
        let requirement = match action.blocking {
            Blocking::None => return,
            Blocking::Soft => "BLOCK-03",
            Blocking::Hard => "BLOCK-04",
        };
        if matches!(action.kind.as_str(), "pick" | "drop" | "finePositioning") {
            return;
        }
        let text = format!("driving is true while action {} is {}", quote(action.id), action.status);
        let finding = || {
            if still == Some(action.kind.as_str()) {
                broken(requirement, seq, text)
            } else {
                remark(requirement, seq, text)
            }
        };
        self.keep(requirement, action, action, finding, found);
    }

    /// Says it once.
    fn keep(
        &mut self,
        requirement: &'static str,
        first: &Listed<'_>,
        second: &Listed<'_>,
        finding: impl FnOnce() -> CheckFinding,
        found: &mut Vec<CheckFinding>,
    ) {
        let key = (requirement, first.id.to_owned(), second.id.to_owned());
        if self.known.len() < KNOWN && self.known.insert(key) {
            found.push(finding());
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::trace::Trace;

    /// What is found when node b has actions of these types, and states show these statuses, one letter each:
    /// Waiting, Running, Paused, Finished, failed (X); a `+` in front says that the vehicle drives.
    fn judge(types: &str, states: &[&str], still: bool) -> Vec<String> {
        let mut trace = Trace::subscriber();
        if still {
            trace.with.insert("still".into(), json!("wait"));
        }
        trace.state(&json!({ "lastNodeId": "z", "lastNodeSequenceId": 8 }));
        let action = |(at, kind): (usize, char)| {
            let blocking = match kind {
                'N' => "NONE",
                'S' => "SOFT",
                _ => "HARD",
            };
            json!({ "actionId": format!("{at}"), "actionType": "wait", "blockingType": blocking })
        };
        let list: Vec<Value> = types.chars().enumerate().map(action).collect();
        trace.sent(
            "order",
            &json!({
                "orderId": "o", "orderUpdateId": 0, "edges": [],
                "nodes": [{ "nodeId": "b", "sequenceId": 0, "released": true, "actions": list }],
            }),
        );
        for state in states {
            let (driving, letters) = state.strip_prefix('+').map_or((false, *state), |rest| (true, rest));
            let status = |(at, letter): (usize, char)| {
                let status = match letter {
                    'W' => "WAITING",
                    'R' => "RUNNING",
                    'P' => "PAUSED",
                    'X' => "FAILED",
                    _ => "FINISHED",
                };
                json!({ "actionId": format!("{at}"), "actionType": "wait", "actionStatus": status })
            };
            let actions: Vec<Value> = letters.chars().enumerate().map(status).collect();
            trace.state(&json!({
                "orderId": "o", "lastNodeId": "b", "lastNodeSequenceId": 0, "driving": driving, "actionStates": actions,
            }));
        }
        trace.judge("action/blocking").summary()
    }

    #[test]
    fn every_liberty_of_the_table_is_right() {
        assert!(judge("NSN", &["WWW", "RRR", "FFR", "FFF"], true).is_empty());
        assert!(judge("NSN", &["RWW", "FRW", "FFR", "FFF"], true).is_empty());
        assert!(judge("NSH", &["RRW", "FRW", "FFR", "+FFF"], true).is_empty());
        assert!(judge("HNS", &["RWW", "FRR", "FRF", "+FRF"], true).is_empty());
        assert!(judge("N", &["+R", "+R", "+F"], true).is_empty());
        assert!(judge("SS", &["WR", "RR", "FF"], true).is_empty());
    }

    #[test]
    fn what_runs_beside_a_hard_action_is_found_once() {
        assert_eq!(judge("HN", &["RR", "RR", "FF"], true), ["BLOCK-05"]);
        assert_eq!(judge("SH", &["PR"], true), ["BLOCK-05"]);
    }

    #[test]
    fn overtaking_is_found() {
        assert_eq!(judge("HH", &["WR"], true), ["BLOCK-01"]);
        assert_eq!(judge("NH", &["WF"], true), ["BLOCK-01", "BLOCK-06"]);
        assert_eq!(judge("NHN", &["FWR"], true), ["BLOCK-01", "BLOCK-06"]);
        assert_eq!(judge("NN", &["WF"], true), ["BLOCK-01"]);
    }

    #[test]
    fn driving_beside_an_action_that_forbids_it_is_found() {
        assert_eq!(judge("S", &["+R"], true), ["BLOCK-03"]);
        assert_eq!(judge("H", &["+P"], true), ["BLOCK-04"]);
        assert_eq!(judge("H", &["+R"], false), ["BLOCK-04 warning"]);
    }

    #[test]
    fn after_a_failed_action_nothing_is_held_against_the_rest() {
        assert!(judge("HN", &["XW", "RR"], true).is_empty());
    }
}
