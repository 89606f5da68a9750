//! Nothing is sent to a vehicle that is known to be gone.

use super::{Command, Found};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::{Event, Packet};
use tck_pack::HookInfo;
use tck_view::ConnectionView;
use tck_world::{Listen, Observation, Topic};

/// `commands/while-away`.
pub(crate) const AWAY: Check = Check {
    name: "commands/while-away",
    decides: &["CONN-12", "HIB-13"],
    doc: "While the connection topic of a vehicle says CONNECTIONBROKEN or OFFLINE, no order and no instant action but a \
          request for a message is sent to it; while it says HIBERNATING, nothing but stopHibernation. What comes within \
          the time a message may take is not judged. A warning where it is gone: nothing forbids it.",
    arguments: &[],
    listens: &[
        Listen::Fault,
        Listen::Connect,
        Listen::Hook,
        Listen::Sent(Topic::Connection),
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[],
    needs: &[ConnectionView::connection_state],
    start: |_| Box::new(Away::default()),
};

#[derive(Default)]
struct Away {
    /// Since when the master control may know that the vehicle is gone, and the word.
    since: Option<(Moment, String)>,
    /// Whether it only sleeps.
    asleep: bool,
}

impl Running for Away {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let now = record.at().moment;
        match record.event() {
            // A master control that was away itself has to hear it first.
            Event::Fault { .. }
            | Event::Packet {
                packet: Packet::Connect { .. },
                ..
            } => self.delay(now),
            Event::Hook { hook, .. } if context.hook(hook).is_some_and(HookInfo::may_restart) => self.delay(now),
            _ => {}
        }
        if let Some(message) = record.said_connection() {
            let state = message.connection_state.or_empty();
            let gone = message.is_broken() || Some(state) == context.pack.word("connection.offline");
            self.asleep = Some(state) == context.pack.word("connection.hibernating");
            let silent = gone || self.asleep;
            self.since = silent.then(|| (now, state.chars().take(64).collect()));
            return silent;
        }
        let Some((since, word)) = &self.since else { return false };
        let Some(command) = Command::read(record) else {
            return false;
        };
        if record.link.disturbed || now.since(*since) < context.time.notice {
            return false;
        }
        let asks = |kind: &str| matches!(kind, "stateRequest" | "factsheetRequest");
        if self.asleep {
            return asleep(command, word, &mut Found::new(record, findings));
        }
        let mut kinds = command
            .actions()
            .into_iter()
            .map(|(_, action)| action.action_type.or_empty());
        let what = match command {
            Command::Order(_) => "an order",
            Command::Instant(_) if kinds.all(asks) => return true,
            Command::Instant(_) => "an instant action",
        };
        Found::new(record, findings).remark("CONN-12", format!("{what} is sent to a vehicle that is {word}"));
        true
    }
}

/// What is sent to a vehicle that sleeps.
fn asleep(command: Command<'_>, word: &str, found: &mut Found<'_>) -> bool {
    let actions = command.actions();
    let mut kinds = actions.iter().map(|(_, action)| action.action_type.or_empty());
    match command {
        Command::Order(_) => found.broken("HIB-13", format!("an order is sent to a vehicle that is {word}")),
        Command::Instant(_) => {
            if let Some(kind) = kinds
                .clone()
                .find(|kind| !matches!(*kind, "stopHibernation" | "stateRequest"))
            {
                found.broken("HIB-13", format!("{} is sent to a vehicle that is {word}", quote(kind)));
            } else if kinds.any(|kind| kind == "stateRequest") {
                found.remark("HIB-13", format!("a state is asked for of a vehicle that is {word}"));
            }
        }
    }
    true
}

impl Away {
    fn delay(&mut self, now: Moment) {
        if let Some((since, _)) = &mut self.since {
            *since = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    /// What a message finds so long after the vehicle was lost, or has come back.
    fn sent(after: f64, back: bool, kind: &str) -> Vec<String> {
        let mut trace = Trace::master_control();
        trace.sent("connection", &json!({ "connectionState": "CONNECTIONBROKEN" }));
        if back {
            trace
                .wait(5.0)
                .sent("connection", &json!({ "connectionState": "ONLINE" }));
        }
        let action = json!({ "actionId": "1", "actionType": kind });
        trace
            .wait(after)
            .commands("instantActions", &json!({ "actions": [action] }));
        trace.judge("commands/while-away").summary()
    }

    #[test]
    fn who_sleeps_is_only_woken() {
        let sent = |kind: &str| {
            let mut trace = Trace::master_control();
            trace.sent("connection", &json!({ "connectionState": "HIBERNATING" }));
            let action = json!({ "actionId": "1", "actionType": kind });
            trace
                .wait(5.0)
                .commands("instantActions", &json!({ "actions": [action] }));
            trace.judge("commands/while-away").summary()
        };
        // A version without that word has no vehicle that sleeps.
        assert!(sent("startPause").is_empty());
    }

    #[test]
    fn who_is_gone_is_left_alone() {
        assert_eq!(sent(5.0, false, "startPause"), ["CONN-12 warning"]);
        assert!(sent(0.2, false, "startPause").is_empty());
        assert!(sent(5.0, true, "startPause").is_empty());
        assert!(sent(5.0, false, "stateRequest").is_empty());
    }
}
