//! Kinds of instant actions that must not come, whatever the array they come in is called.

use serde_json::Value;

use super::{Command, Found};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::ActionView;
use tck_world::{Listen, Observation, Topic, sets_position};

/// Kinds of instant actions that must not come, whatever the array they come in is called.
pub(crate) const NOT_ASKED: Check = Check {
    name: "commands/not-asked",
    decides: &[
        "ACT-08", "CONN-12", "CONN-14", "FACT-15", "IACT-02", "INFO-02", "INFO-03", "MODE-04", "VIS-03",
    ],
    doc: "No instant action of the `types` is sent, or none but those of `except`. Without an \
          array `actions` they are looked for in `instantActions`, as older versions called it: there they are as wrong.",
    arguments: &["types", "except"],
    listens: &[Listen::Delivered(Topic::InstantActions)],
    reads: &[],
    needs: &[ActionView::action_type],
    start: |context| {
        let list = |name: &str| -> Option<Vec<String>> {
            let list = context.with.get(name)?.as_array()?;
            Some(list.iter().filter_map(Value::as_str).map(str::to_owned).collect())
        };
        Box::new(NotAsked {
            types: list("types"),
            except: list("except"),
        })
    },
};

struct NotAsked {
    /// What must not come; everything but the exceptions, if there are only those.
    types: Option<Vec<String>>,
    /// What may come all the same.
    except: Option<Vec<String>>,
}

impl NotAsked {
    fn forbids(&self, kind: &str) -> bool {
        let same = |one: &String| one == kind || (sets_position(one) && sets_position(kind));
        let named = |list: &Vec<String>| list.iter().any(same);
        match (&self.types, &self.except) {
            (Some(types), _) if !named(types) => false,
            (_, Some(except)) => !named(except),
            (types, None) => types.is_some(),
        }
    }
}

impl Running for NotAsked {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let command = Command::read(record);
        let Some(command) = command.filter(|command| command.order().is_none()) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        for (_, action) in command.actions() {
            let kind = action.action_type.or_empty();
            if self.forbids(kind) {
                found.push(CheckFinding {
                    requirement: None,
                    verdict: None,
                    seq: record.seq(),
                    message: format!("the instant action {} comes", quote(kind)),
                    element: None,
                });
            }
        }
        true
    }
}
