//! Nothing is sent to a vehicle that people have taken over.

use super::{Command, Found};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::StateView;
use tck_world::{Fact, Listen, Observation, Outside, Topic};

/// `commands/modes`.
pub(crate) const MODES: Check = Check {
    name: "commands/modes",
    decides: &["MODE-04", "MODE-11"],
    doc: "While the states of the vehicle show MANUAL, SERVICE, TEACHIN or STARTUP, no order and no instant action is sent to \
          it, and in INTERVENED no instant action but cancelOrder. What comes within the time a message may take is not \
          judged; stateRequest and factsheetRequest alone are a warning.",
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
    needs: &[StateView::operating_mode],
    start: |_| Box::new(Modes::default()),
};

/// What may be sent in a mode that is not for the master control alone.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lets {
    /// Nothing at all.
    Nothing,
    /// Orders, and of all actions cancelOrder.
    OrdersOnly,
}

impl Lets {
    fn of(mode: &str, context: &CheckContext<'_>) -> Option<Self> {
        let is = |name: &&str| context.pack.word(&format!("operatingMode.{name}")) == Some(mode);
        if ["manual", "service", "teachIn", "startup"].iter().any(is) {
            return Some(Self::Nothing);
        }
        is(&"intervened").then_some(Self::OrdersOnly)
    }
}

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
        let Some(lets) = Lets::of(&seen.mode, context) else {
            self.since = None;
            return false;
        };
        let since = *self.since.get_or_insert(seen.at);
        let now = record.at().moment;
        if record.link.disturbed || now.since(since) < context.time.notice {
            return false;
        }
        // That nothing comes is seen with every state.
        let Some(command) = Command::read(record) else {
            return record.said_state().is_some();
        };
        if lets == Lets::OrdersOnly && command.order().is_some() {
            return false;
        }
        let id = if lets == Lets::Nothing { "MODE-04" } else { "MODE-11" };
        let mut found = Found::new(record, findings);
        let asks = |kind: &str| matches!(kind, "stateRequest" | "factsheetRequest");
        let actions = command.actions();
        let mut kinds = actions.iter().map(|(_, action)| action.action_type.or_empty());
        if lets == Lets::OrdersOnly && kinds.all(|kind| kind == "cancelOrder") {
            return true;
        }
        let only_asks = command.order().is_none()
            && !actions.is_empty()
            && actions.iter().all(|(_, action)| asks(action.action_type.or_empty()));
        if only_asks {
            found.remark(id, format!("a request is sent to a vehicle in {}", seen.mode));
        } else {
            let what = if command.order().is_some() {
                "an order"
            } else {
                "an instant action"
            };
            found.broken(id, format!("{what} is sent to a vehicle in {}", seen.mode));
        }
        true
    }
}
