//! A node that a vehicle cannot come to: it tries no more, and waits for a decision.

use super::{Command, ELEMENTS, Found};
use crate::finding::remark;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ErrorView, StateView};
use tck_world::{End, Fact, Listen, Observation, Topic};

/// `commands/unreachable-node`.
pub(crate) const UNREACHABLE: Check = Check {
    name: "commands/unreachable-node",
    decides: &["ZERR-03"],
    doc: "When a vehicle reports that it cannot come to a node of its order, an order message or cancelOrder follows within the time \
          in which something must have happened. Nothing is a warning, since an alarm for people is not seen.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Mock],
    needs: &[StateView::errors, ErrorView::error_type],
    start: |_| Box::new(Unreachable::default()),
};

#[derive(Default)]
struct Unreachable {
    /// Since when a state says so, and nothing was decided.
    since: Option<Moment>,
    /// The number of the record that said so last.
    seq: u64,
    /// What was reported was dealt with, or found already.
    done: bool,
}

impl Unreachable {
    fn is_late(&self, now: Moment, context: &CheckContext<'_>) -> bool {
        self.since.is_some_and(|since| now.since(since) > context.time.react)
    }
}

const SILENCE: &str = "the vehicle cannot come to a node of its order, and nothing is sent";

impl Running for Unreachable {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().is_lost(record) {
            (self.since, self.done) = (None, false);
        }
        let now = record.at().moment;
        if let Some(state) = record.said_state() {
            let word = context.pack.word("error.nodeUnreachable");
            let mut errors = state.errors.iter().take(ELEMENTS);
            let says = word.is_some_and(|word| errors.any(|error| error.error_type.is(word)));
            if !says || state.node_states.is_empty() {
                (self.since, self.done) = (None, false);
            } else if !self.done {
                self.since.get_or_insert(now);
                self.seq = record.seq();
            }
        }
        if self.is_late(now, context) {
            Found::new(record, findings).remark("ZERR-03", SILENCE);
            (self.since, self.done) = (None, true);
            return true;
        }
        let decides = |command: Command<'_>| match command {
            Command::Order(_) => true,
            Command::Instant(_) => command
                .actions()
                .iter()
                .any(|(_, action)| action.action_type.is("cancelOrder")),
        };
        let decided = self.since.is_some() && Command::read(record).is_some_and(decides);
        if decided {
            (self.since, self.done) = (None, true);
        }
        decided
    }

    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        if self.is_late(end.moment, context) {
            findings.push(remark("ZERR-03", self.seq, SILENCE));
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use crate::trace::Trace;

    fn stuck() -> Value {
        json!({ "orderId": "o1", "nodeStates": [{ "nodeId": "n2", "sequenceId": 2, "released": true }],
            "errors": [{ "errorType": "NODE_UNREACHABLE", "errorLevel": "CRITICAL" }] })
    }

    #[test]
    fn a_decision_follows_when_a_node_cannot_be_reached() {
        let cancel = json!({ "actions": [{ "actionType": "cancelOrder", "actionId": "c1", "blockingType": "NONE" }] });
        let mut trace = Trace::master_control_of("3.0");
        trace.shows(&stuck()).wait(20.0);
        trace.commands("instantActions", &cancel).wait(30.0);
        trace.shows(&stuck()).wait(30.0);
        let outcome = trace.judge("commands/unreachable-node");
        assert!(outcome.summary().is_empty() && outcome.judged > 0);
        let mut silent = Trace::master_control_of("3.0");
        for _ in 0..5 {
            silent.shows(&stuck()).wait(10.0);
        }
        assert_eq!(silent.judge("commands/unreachable-node").summary(), ["ZERR-03 warning"]);
    }
}
