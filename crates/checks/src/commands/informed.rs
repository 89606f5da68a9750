//! `commands/on-information`: instant actions that a vehicle provokes by its information entries.
//!
//! One that comes when an information has begun may have come anyway. One that comes each time, and at no other time,
//! was sent because of it.

use std::collections::BTreeMap;
use std::time::Duration;

use super::{Command, ELEMENTS, Found};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, StateView};
use tck_world::{Listen, Observation, Topic};

/// Instant actions that a vehicle provokes by its information entries.
pub(crate) const ON_INFORMATION: Check = Check {
    name: "commands/on-information",
    decides: &["INFO-02"],
    doc: "No instant action of one type comes within a second each time the vehicle begins to give information entries, \
          three times at least, and never otherwise.",
    arguments: &[],
    listens: &[Listen::Sent(Topic::State), Listen::Delivered(Topic::InstantActions)],
    reads: &[],
    needs: &[StateView::information, ActionView::action_type],
    start: |_| Box::new(OnInformation::default()),
};

/// So soon comes what an information has brought about.
const AT_ONCE: Duration = Duration::from_secs(1);
/// How often it has to come before it is no chance.
const TIMES: u32 = 3;
/// How many types are remembered.
const KINDS: usize = 64;

#[derive(Default)]
struct OnInformation {
    informs: bool,
    /// When it began last to give information, and how often it has.
    since: Option<Moment>,
    begun: u32,
    /// By actionType: after how many beginnings it came, the last of them, and how often at another time.
    came: BTreeMap<String, (u32, u32, u32)>,
}

impl Running for OnInformation {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let now = record.at().moment;
        if let Some(state) = record.said_state() {
            let informs = !state.information.is_empty();
            if informs && !self.informs {
                self.since = Some(now);
                self.begun += 1;
            }
            self.informs = informs;
        }
        let command = Command::read(record);
        let Some(command) = command.filter(|command| command.order().is_none()) else {
            return false;
        };
        let at_once = self.since.is_some_and(|since| now.since(since) <= AT_ONCE);
        let mut found = Found::new(record, findings);
        for (_, action) in command.actions().into_iter().take(ELEMENTS) {
            let kind: String = action.action_type.or_empty().chars().take(256).collect();
            if self.came.len() == KINDS && !self.came.contains_key(&kind) {
                continue;
            }
            let (times, last, otherwise) = self.came.entry(kind.clone()).or_default();
            if at_once && *last < self.begun {
                *times += 1;
                *last = self.begun;
            } else if !at_once {
                *otherwise += 1;
            }
            if *times == self.begun && *times >= TIMES && *otherwise == 0 && at_once {
                let text = format!(
                    "the instant action {} comes each time the vehicle begins to give information",
                    quote(&kind)
                );
                found.broken("INFO-02", text);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use crate::trace::Trace;

    /// States with information, each answered after so many seconds or not at all.
    fn answered(after: &[Option<f64>]) -> Vec<String> {
        let mut trace = Trace::master_control();
        for after in after {
            trace
                .wait(10.0)
                .shows(&json!({ "information": [{ "infoType": "any" }] }));
            if let Some(after) = after {
                let action = json!({ "actionId": "1", "actionType": "stateRequest" });
                trace
                    .wait(*after)
                    .commands("instantActions", &json!({ "actions": [action] }));
            }
            trace.wait(10.0).shows(&json!({ "information": [] }));
        }
        trace.judge("commands/on-information").summary()
    }

    #[test]
    fn what_comes_each_time_comes_for_it() {
        assert_eq!(answered(&[Some(0.2), Some(0.4), Some(0.1)]), ["INFO-02"]);
    }

    #[test]
    fn what_comes_now_and_then_comes_anyway() {
        assert!(answered(&[Some(0.2), None, Some(0.1)]).is_empty());
        assert!(answered(&[Some(0.2), Some(3.0), Some(0.1)]).is_empty());
        assert!(answered(&[Some(0.2), Some(0.1)]).is_empty());
    }
}
