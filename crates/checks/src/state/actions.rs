//! `state/action-transitions`, `state/action-states-kept`: the life of every action in `actionStates`.
//!
//! When an action has to start or end is left to the tests.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use serde_json::Value;

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_pack::Pack;
use tck_view::{ActionState, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// How many actions are kept in mind; a state that lists more is judged on the first ones.
const ACTIONS: usize = 4096;

/// `state/action-transitions`.
pub(crate) const TRANSITIONS: Check = Check {
    name: "state/action-transitions",
    decides: &["ASTATE-05", "ASTATE-06", "STATE-MSG-09"],
    doc: "actionStatus moves only along the legal graph, where statuses may be skipped because states coalesce; \
          FINISHED and FAILED are never left; no actionId is listed twice.",
    arguments: &[],
    listens: &[Listen::Hook, Listen::Answer, Listen::Delivered(Topic::State)],
    reads: &[],
    needs: &[StateView::action_states],
    start: |context| {
        Box::new(Transitions {
            graph: Graph::of(context.pack),
            ..Transitions::default()
        })
    },
};

/// `state/action-states-kept`.
pub(crate) const KEPT: Check = Check {
    name: "state/action-states-kept",
    decides: &["STATE-MSG-10", "ORD-CANCEL-12", "STATE-MSG-09"],
    doc: "Action states stay listed until a new order is accepted, also after a cancellation. Where the factsheet \
          limits the array and it was full, leaving out finished ones is a warning.",
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
    needs: &[StateView::action_states],
    start: |context| {
        Box::new(Kept {
            graph: Graph::of(context.pack),
            ..Kept::default()
        })
    },
};

/// The statuses of the protocol version, and which may be seen after which.
#[derive(Default)]
struct Graph(BTreeMap<String, BTreeSet<String>>);

impl Graph {
    /// Every status that some path of transitions leads to: those in between may have been missed.
    ///
    /// The transitions that only other clauses imply count as well. On states that coalesce they cannot be
    /// told from legal ones anyway.
    fn of(pack: &Pack) -> Self {
        let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for kind in ["legal", "implied"] {
            let edges = pack.vocabulary().pointer(&format!("/transition/{kind}"));
            for (from, to) in edges.and_then(Value::as_object).into_iter().flatten() {
                let to = to.as_array().into_iter().flatten().filter_map(Value::as_str);
                graph.entry(from.clone()).or_default().extend(to.map(str::to_owned));
            }
        }
        for _ in 0..graph.len() {
            let known = graph.clone();
            for reached in graph.values_mut() {
                let further = reached.iter().filter_map(|status| known.get(status)).flatten();
                let further: Vec<String> = further.cloned().collect();
                reached.extend(further);
            }
        }
        Self(graph)
    }

    fn reachable(&self, from: &str, to: &str) -> bool {
        from == to || self.0.get(from).is_none_or(|reached| reached.contains(to))
    }

    /// Whether nothing leads out of this status.
    fn terminal(&self, status: &str) -> bool {
        self.0.get(status).is_some_and(BTreeSet::is_empty)
    }

    /// Id and status of action states; statuses that do not exist are another check's business.
    fn statuses<'v>(&self, all: impl Iterator<Item = &'v ActionState>) -> impl Iterator<Item = (&'v str, &'v str)> {
        let named = all.take(ACTIONS).filter_map(|action| {
            let id = action.action_id.there().filter(|id| !id.is_cut() && id.len() <= 512)?;
            Some((id.as_str(), action.action_status.or_empty()))
        });
        named.filter(|(id, status)| !id.is_empty() && self.0.contains_key(*status))
    }
}

#[derive(Default)]
struct Transitions {
    graph: Graph,
    last: HashMap<String, String>,
}

impl Running for Transitions {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        if record.outside_influence() {
            self.last.clear();
        }
        let Some(state) = record.state() else {
            return false;
        };
        let seq = record.seq();
        let mut now = HashMap::new();
        for (id, status) in self.graph.statuses(state.all_action_states()) {
            if now.insert(id.to_owned(), status.to_owned()).is_some() {
                let text = format!("actionStates lists {} more than once", quote(id));
                findings.push(broken("STATE-MSG-09", seq, text));
                continue;
            }
            let Some(before) = self.last.get(id) else { continue };
            if !self.graph.reachable(before, status) {
                let requirement = if self.graph.terminal(before) {
                    "ASTATE-06"
                } else {
                    "ASTATE-05"
                };
                let text = format!("action {} goes from {before} to {status}", quote(id));
                findings.push(broken(requirement, seq, text));
            }
        }
        // What is not listed any more is forgotten, which also bounds what is remembered.
        let judged = !now.is_empty();
        self.last = now;
        judged
    }
}

#[derive(Default)]
struct Kept {
    graph: Graph,
    order: Option<(String, u64)>,
    listed: HashMap<String, String>,
    /// actionIds of cancelOrder actions seen on their way to the vehicle.
    cancels: Vec<String>,
    /// actionIds of all instant actions: they are none of a cancelled order's.
    instant: VecDeque<String>,
    /// The limit of the factsheet; zero is none.
    limit: usize,
}

impl Running for Kept {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        // A restarted vehicle may have forgotten everything; what it keeps over a restart is not ruled.
        if context.world.restarts().now(record) || record.outside_influence() {
            self.listed.clear();
        }
        if let Some(message) = record.instant_actions_to_vehicle() {
            let all = message
                .all_actions()
                .map(|action| action.action_id.or_empty().to_owned());
            self.instant.extend(all.take(ACTIONS));
            let excess = self.instant.len().saturating_sub(ACTIONS);
            self.instant.drain(..excess);
            let cancels = message
                .all_actions()
                .filter(|action| action.action_type.is("cancelOrder"));
            self.cancels
                .extend(cancels.map(|action| action.action_id.or_empty().to_owned()));
            let excess = self.cancels.len().saturating_sub(64);
            self.cancels.drain(..excess);
        }
        if let Some(limit) = Self::factsheet_limit(record) {
            self.limit = limit;
        }
        let Some(state) = record.state() else {
            return false;
        };
        // While a vehicle starts, nothing that it says need be right.
        if state.operating_mode.is("STARTUP") {
            self.listed.clear();
            self.order = None;
            return false;
        }
        if !state.action_states.is_there() {
            return false;
        }
        let order = (
            state.order_id.or_empty().to_owned(),
            state.order_update_id.whole().unwrap_or_default(),
        );
        let now: HashMap<String, String> = self
            .graph
            .statuses(state.action_states.iter())
            .map(|(id, status)| (id.to_owned(), status.to_owned()))
            .collect();
        let complete = state.action_states.total() == now.len();
        let before = self.order.replace(order.clone());
        let listed = std::mem::take(&mut self.listed);
        let same_order = before
            .as_ref()
            .is_some_and(|before| before.0 == order.0 && before.1 <= order.1);
        let updated = before.as_ref().is_some_and(|before| before.1 != order.1);
        if same_order && complete {
            let cancelled = listed.keys().chain(now.keys()).any(|id| self.cancels.contains(id));
            for (id, status) in listed.iter().filter(|(id, _)| !now.contains_key(*id)) {
                self.judge(id, status, (cancelled, updated, listed.len()), record, findings);
            }
        }
        self.listed = now;
        same_order
    }
}

impl Kept {
    fn judge(
        &self,
        id: &str,
        status: &str,
        (cancelled, updated, count): (bool, bool, usize),
        record: &Observation<'_>,
        findings: &mut Vec<CheckFinding>,
    ) {
        let seq = record.seq();
        let gone = |requirement: &str, text: String| CheckFinding {
            element: Some(id.to_owned()),
            ..broken(requirement, seq, text)
        };
        let text = format!(
            "action {} was {status} and is gone, although no new order was accepted",
            quote(id)
        );
        if !self.graph.terminal(status) && updated {
            // An update may delete a horizon and its actions with it.
            return;
        }
        if self.limit > 0 && count >= self.limit {
            let text = format!("{text}; the factsheet allows {} of them", self.limit);
            findings.push(remark("STATE-MSG-10", seq, text));
            return;
        }
        if cancelled && !self.instant.iter().any(|instant| instant == id) {
            findings.push(gone("ORD-CANCEL-12", text.clone()));
        }
        if !self.graph.terminal(status) {
            findings.push(gone("STATE-MSG-09", text.clone()));
        }
        findings.push(gone("STATE-MSG-10", text));
    }

    fn factsheet_limit(record: &Observation<'_>) -> Option<usize> {
        let limits = record.factsheet()?.array_limits()?;
        usize::try_from(limits.action_states.whole().unwrap_or_default()).ok()
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};
    use tck_journal::event::LinkFault;

    use crate::trace::Trace;

    fn actions(all: &[(&str, &str)]) -> Value {
        let states: Vec<Value> = all
            .iter()
            .map(|(id, status)| json!({ "actionId": id, "actionStatus": status }))
            .collect();
        json!({ "orderId": "o", "actionStates": states })
    }

    fn walk(statuses: &[&str]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for status in statuses {
            trace.state(&actions(&[("a", status)]));
        }
        trace.judge("state/action-transitions").summary()
    }

    #[test]
    fn legal_walks_with_and_without_missed_statuses_are_right() {
        assert!(
            walk(&[
                "WAITING",
                "INITIALIZING",
                "RUNNING",
                "PAUSED",
                "RUNNING",
                "FINISHED",
                "FINISHED"
            ])
            .is_empty()
        );
        assert!(walk(&["WAITING", "FINISHED"]).is_empty());
        assert!(walk(&["PAUSED", "FAILED"]).is_empty());
        assert!(walk(&["FAILED"]).is_empty());
    }

    #[test]
    fn going_back_and_leaving_the_end_are_found() {
        assert_eq!(walk(&["RUNNING", "WAITING"]), ["ASTATE-05"]);
        assert_eq!(walk(&["FINISHED", "FAILED"]), ["ASTATE-06"]);
        assert_eq!(walk(&["FAILED", "RUNNING", "FINISHED"]), ["ASTATE-06"]);
    }

    #[test]
    fn an_action_listed_twice_is_found() {
        let mut trace = Trace::subscriber();
        trace.state(&actions(&[("a", "RUNNING"), ("a", "RUNNING")]));
        assert_eq!(trace.judge("state/action-transitions").summary(), ["STATE-MSG-09"]);
    }

    #[test]
    fn an_id_that_returns_after_a_new_order_is_a_new_action() {
        let mut trace = Trace::subscriber();
        trace
            .state(&actions(&[("a", "FINISHED")]))
            .state(&actions(&[]))
            .state(&actions(&[("a", "WAITING")]));
        assert!(trace.judge("state/action-transitions").findings.is_empty());
    }

    #[test]
    fn action_states_may_go_with_a_new_order_a_restart_or_a_shorter_horizon() {
        let mut trace = Trace::tap();
        trace.state(&actions(&[("a", "FINISHED")]));
        trace.state(&json!({ "orderId": "p" }));
        trace
            .state(&actions(&[("b", "FINISHED")]))
            .connected(2)
            .state(&actions(&[]));
        trace.state(&actions(&[("c", "WAITING")]));
        trace.state(&json!({ "orderId": "o", "orderUpdateId": 1 }));
        assert!(trace.judge("state/action-states-kept").findings.is_empty());
    }

    #[test]
    fn without_the_tap_a_vehicle_that_was_gone_may_have_been_restarted() {
        for gone in ["OFFLINE", "CONNECTIONBROKEN"] {
            let mut trace = Trace::subscriber();
            trace.connection("ONLINE").state(&actions(&[("a", "FINISHED")]));
            trace.connection(gone).connection("ONLINE").state(&actions(&[]));
            assert!(trace.judge("state/action-states-kept").findings.is_empty(), "{gone}");
        }
    }

    #[test]
    fn an_online_that_is_said_again_is_no_restart() {
        for mut trace in [Trace::subscriber(), Trace::tap()] {
            trace.state(&actions(&[("a", "FINISHED")]));
            trace.connection("ONLINE").state(&actions(&[]));
            assert!(!trace.judge("state/action-states-kept").findings.is_empty());
        }
    }

    #[test]
    fn action_states_that_vanish_are_found() {
        let mut trace = Trace::subscriber();
        trace
            .state(&actions(&[("a", "FINISHED"), ("b", "RUNNING")]))
            .state(&actions(&[("b", "RUNNING")]))
            .state(&actions(&[]));
        assert_eq!(
            trace.judge("state/action-states-kept").summary(),
            ["STATE-MSG-10", "STATE-MSG-09", "STATE-MSG-10"]
        );
    }

    #[test]
    fn action_states_that_vanish_with_a_cancellation_are_found() {
        let mut trace = Trace::subscriber();
        trace
            .state(&actions(&[("a", "RUNNING")]))
            .instant("cancelOrder", "x", &json!([]))
            .state(&actions(&[("a", "FAILED"), ("x", "FINISHED")]))
            .state(&actions(&[("x", "FINISHED")]));
        assert_eq!(
            trace.judge("state/action-states-kept").summary(),
            ["ORD-CANCEL-12", "STATE-MSG-10"]
        );
    }

    #[test]
    fn an_instant_action_that_vanishes_is_none_of_the_cancelled_order() {
        let mut trace = Trace::subscriber();
        trace
            .state(&actions(&[("a", "RUNNING")]))
            .instant("stopPause", "p", &json!([]))
            .instant("cancelOrder", "x", &json!([]))
            .state(&actions(&[("a", "FAILED"), ("p", "FINISHED"), ("x", "FINISHED")]))
            .state(&actions(&[("a", "FAILED"), ("x", "FINISHED")]));
        let judged = trace.judge("state/action-states-kept");
        assert_eq!(judged.summary(), ["STATE-MSG-10"]);
        assert_eq!(judged.findings[0].element.as_deref(), Some("p"));
    }

    #[test]
    fn a_full_array_makes_it_a_remark() {
        let mut trace = Trace::subscriber();
        trace.message(
            "factsheet",
            &json!({ "protocolLimits": { "maxArrayLens": { "state.actionStates": 1 } } }),
        );
        trace
            .state(&actions(&[("a", "FINISHED")]))
            .state(&actions(&[("b", "RUNNING")]));
        assert_eq!(
            trace.judge("state/action-states-kept").summary(),
            ["STATE-MSG-10 warning"]
        );
    }

    fn over_a_cut(anew: bool) -> Vec<String> {
        let mut trace = Trace::tap();
        let listed = json!({ "orderId": "o", "actionStates": [{ "actionId": "a", "actionStatus": "FINISHED" }] });
        trace
            .connected(1)
            .state(&listed)
            .fault(LinkFault::Cut { reset: false })
            .closed(1);
        trace.fault(LinkFault::Restore);
        if anew {
            trace.connected(2);
        } else {
            trace.connect(2, None, 15, 4);
        }
        trace
            .state(&json!({ "orderId": "o" }))
            .state(&json!({ "orderId": "o" }));
        trace.judge("state/action-states-kept").summary()
    }

    #[test]
    fn a_vehicle_that_counts_on_over_a_cut_of_ours_has_no_reason_to_forget() {
        assert_eq!(over_a_cut(false), ["STATE-MSG-10"]);
    }

    #[test]
    fn a_vehicle_that_counts_anew_may_have_been_restarted() {
        assert!(over_a_cut(true).is_empty());
    }
}
