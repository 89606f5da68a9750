//! Nothing is sent to a vehicle that people have taken over.

use super::{Command, Found};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::text;
use tck_world::{Fact, Listen, Observation, Outside, Topic};

/// `commands/modes`.
pub(crate) const MODES: Check = Check {
    name: "commands/modes",
    decides: &["MODE-04"],
    doc: "While the states of the vehicle show MANUAL, SERVICE or TEACHIN, no order and no instant action is sent to it. \
          What comes within the time a message may take is not judged; stateRequest and factsheetRequest alone are a \
          warning.",
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
    start: |_| Box::new(Modes::default()),
};

#[derive(Default)]
struct Modes {
    /// Since when people are in charge.
    since: Option<Moment>,
}

impl Running for Modes {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if context.world.mock().now(record) != Outside::No {
            // The next state says what holds from now on.
            self.since = None;
        }
        let Some(seen) = context.world.mock().last() else {
            return false;
        };
        let word = |name: &str| context.pack.word(name).unwrap_or_default().to_owned();
        let theirs = ["operatingMode.manual", "operatingMode.service", "operatingMode.teachIn"];
        if !theirs.iter().any(|name| word(name) == seen.mode) {
            self.since = None;
            return false;
        }
        let since = *self.since.get_or_insert(seen.at);
        let now = record.at().moment;
        if record.link.disturbed || now.since(since) < context.time.notice {
            return false;
        }
        // That nothing comes is seen with every state.
        let Some(command) = Command::read(record) else {
            return record.said(Topic::State).is_some();
        };
        let mut found = Found::new(record, findings);
        let asks = |kind: &str| matches!(kind, "stateRequest" | "factsheetRequest");
        let actions = command.actions();
        let only_asks = command.order().is_none()
            && !actions.is_empty()
            && actions.iter().all(|(_, action)| asks(text(action, "actionType")));
        if only_asks {
            found.remark("MODE-04", format!("a request is sent to a vehicle in {}", seen.mode));
        } else {
            let what = if command.order().is_some() {
                "an order"
            } else {
                "an instant action"
            };
            found.broken("MODE-04", format!("{what} is sent to a vehicle in {}", seen.mode));
        }
        true
    }
}
