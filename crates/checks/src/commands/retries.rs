//! What becomes of actions that can be tried again.

use super::{Command, Found};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Scope, StateView};
use tck_world::{Fact, Listen, Observation, Topic};

/// `commands/retries`.
pub(crate) const RETRIES: Check = Check {
    name: "commands/retries",
    decides: &["RETRY-08"],
    doc: "retry and skipRetry are instant actions and name by actionId an action that the vehicle has shown as RETRIABLE of \
          late. While the link is disturbed nothing is judged.",
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
    needs: &[
        ActionView::action_type,
        ActionView::action_parameters,
        StateView::action_states,
    ],
    start: |_| Box::new(Retries),
};

struct Retries;

impl Running for Retries {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record).filter(|_| !record.link.disturbed) else {
            return false;
        };
        let Some(retriable) = context.pack.word("actionStatus.retriable") else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (scope, action) in command.actions() {
            let kind = action.action_type.or_empty();
            if !matches!(kind, "retry" | "skipRetry") {
                continue;
            }
            judged = true;
            if scope != Scope::Instant {
                found.broken("RETRY-08", format!("{kind} is an action of an order"));
                continue;
            }
            let Some(id) = action.argument("actionId").there().and_then(tck_view::Json::text) else {
                found.broken("RETRY-08", format!("{kind} names no action"));
                continue;
            };
            let shows = |status: &(String, String)| status.0 == id && status.1 == retriable;
            let mut states = context.world.mock().states();
            if !states.any(|state| state.actions.iter().any(shows)) {
                found.broken(
                    "RETRY-08",
                    format!("{kind} names {}, which is not {retriable}", quote(id)),
                );
            }
        }
        judged
    }
}
