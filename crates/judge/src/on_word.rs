//! What rests on a person's word: prompts that somebody answered, and capabilities that only the profile claims.

use tck_journal::Entry;
use tck_journal::event::{Capability, Event};
use tck_result::{OnWord, WordKind};
use tck_suite::model::{Need, Test};

/// Who says a capability that no factsheet lists.
const PROFILE: &str = "profile";
/// What is said of a capability that is there.
const YES: &str = "yes";

/// What people have answered.
#[derive(Clone, Debug, Default)]
pub(super) struct Answers {
    /// The hook that a person is asked for, and what he is to do.
    asked: Option<(String, String)>,
    said: Vec<OnWord>,
}

impl Answers {
    /// Shows the next record of a test.
    pub fn observe(&mut self, entry: &Entry, test: &str) {
        match entry.event() {
            Event::Question { hook, text, .. } => self.asked = Some((hook.clone(), text.clone())),
            Event::Hook { hook, ok, .. } => {
                let asked = self.asked.take().filter(|(asked, _)| asked == hook && *ok);
                self.said.extend(asked.map(|(_, text)| answer(test, text)));
            }
            Event::Answer { prompt, ok: true, .. } => self.said.push(answer(test, prompt.clone())),
            _ => {}
        }
    }

    /// What was answered so far.
    pub fn said(&self) -> &[OnWord] {
        &self.said
    }
}

fn answer(test: &str, what: String) -> OnWord {
    OnWord {
        test: test.to_owned(),
        kind: WordKind::Answer,
        what,
    }
}

/// What a test needs and only the profile claims.
pub(super) fn claimed(test: &Test, capabilities: &[Capability]) -> Vec<OnWord> {
    let claims = |name: &str| {
        let is_of = |known: &Capability| {
            let rest = known.name.strip_prefix(name);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(' '))
        };
        let mut own = capabilities.iter().filter(|known| is_of(known));
        let is_listed = own.clone().any(|known| known.source != PROFILE);
        !is_listed && own.any(|known| known.name == name && known.value == YES)
    };
    let needed = test.needs.iter().filter_map(|need| match need {
        Need::Action { name, scope } => {
            let of_scope = scope.as_ref().map(|scope| format!("action {name} {scope}"));
            Some(of_scope.filter(|name| claims(name)).unwrap_or(format!("action {name}")))
        }
        Need::Optional(path) => Some(format!("optional {path}")),
        Need::Limit(name) => Some(format!("limit {name}")),
        _ => None,
    });
    let claimed = needed.filter(|name| claims(name)).map(|what| OnWord {
        test: test.id.clone(),
        kind: WordKind::Claim,
        what,
    });
    claimed.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_base::clock::{Moment, Stamp};
    use tck_journal::event::{Record, Source};

    fn observed(events: Vec<Event>) -> Vec<OnWord> {
        let mut answers = Answers::default();
        for (seq, event) in (1..).zip(events) {
            let at = Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            };
            let record = Record {
                seq,
                at,
                source: Source::Operator,
                direction: None,
                event,
            };
            answers.observe(&Entry::new(record), "mode/manual");
        }
        answers.said().to_vec()
    }

    fn question(hook: &str) -> Event {
        Event::Question {
            hook: hook.to_owned(),
            text: format!("please {hook}"),
            seconds: 60,
        }
    }

    fn hook(hook: &str, ok: bool) -> Event {
        Event::Hook {
            hook: hook.to_owned(),
            ok,
            detail: String::new(),
            vehicle: None,
        }
    }

    #[test]
    fn what_a_person_has_done_is_a_word_and_what_a_machine_has_done_is_none() {
        assert!(observed(vec![hook("press", true)]).is_empty());
        assert!(observed(vec![question("press"), hook("press", false)]).is_empty());
        let said = observed(vec![question("press"), hook("press", true), hook("press", true)]);
        assert_eq!(said, [answer("mode/manual", "please press".to_owned())]);
    }

    #[test]
    fn a_claim_counts_where_no_factsheet_lists_it() {
        let library = tck_testing::library();
        let tests = &library.rules.suites.tests;
        let (test, name) = tests
            .iter()
            .find_map(|test| {
                let name = test.needs.iter().find_map(|need| match need {
                    Need::Optional(path) => Some(format!("optional {path}")),
                    _ => None,
                })?;
                Some((test, name))
            })
            .expect("a test that needs an optional parameter");
        let from = |source: &str, value: &str| {
            let capability = Capability {
                name: name.clone(),
                value: value.to_owned(),
                source: source.to_owned(),
            };
            claimed(test, &[capability]).len()
        };
        assert_eq!(from("profile", "yes"), 1);
        assert_eq!((from("factsheet", "SUPPORTED"), from("profile", "no")), (0, 0));
        let both = from("factsheet; the profile says the opposite", "SUPPORTED");
        assert_eq!(both, 0);
    }
}
