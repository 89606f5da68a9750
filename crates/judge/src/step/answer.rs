//! Which message answers what was sent: the first answer is judged, and a later, better one changes nothing.
//!
//! Of the messages that a step picks the first is the answer, unless the step is about something new (`$hasNew`): the
//! vehicle may report something of its own before it answers. Then a message is the answer if an element of it is new and
//! names what was sent, or is new, of the asserted type, and was not there shortly before; or if it shows all that is
//! asserted. If no answer comes, the first message that shows something never seen before is judged, else the first.

use std::collections::BTreeSet;

use serde_json::Value;

use super::{Clause, ClauseOutcome, Position, Selector, StepOutcome, bind_pattern};
use crate::eval_context::EvalContext;
use tck_base::pattern::Bound;
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_suite::model::{Assertion, Expect};

/// How many earlier messages are asked whether an element was there before.
const LOOK_BACK: usize = 200;
/// How many earlier messages are asked whether an element of the asserted type was there: what comes and goes of its own shows up in them, and a refusal
/// of an earlier test, in the same words, does not.
const LOOK_BACK_FOR_TYPE: usize = 12;

/// What makes a message the answer to the stimulus of a step.
pub(super) struct Question {
    /// The topic of the answer, and the journal number from which on it may come.
    topic: String,
    mark: u64,
    /// What is asserted, or preferred, of new elements.
    asked: Vec<Bound>,
}

impl Question {
    /// A step of which only the picking decides.
    pub(super) fn of_picking(topic: &str, position: Position) -> Self {
        Self {
            topic: topic.to_owned(),
            mark: position.mark,
            asked: Vec::new(),
        }
    }

    /// Whether a message that the step picks is the answer.
    pub(super) fn is_answered_by(&self, entry: &Entry, selector: &Selector, scene: &EvalContext<'_>) -> bool {
        let picking = selector.pattern.iter().filter(|pattern| pattern.looks_back());
        let patterns: Vec<&Bound> = picking.chain(&self.asked).collect();
        let Some(message) = entry.subject().filter(|_| !patterns.is_empty()) else {
            return true;
        };
        if self.asked.is_empty() && was_provoked(self.mark, scene) {
            return true;
        }
        let picked_without = |pattern: &&Bound| pattern.looks_back() && pattern.matches(&message, Some(&message));
        if selector.pattern.iter().any(|pattern| picked_without(&pattern)) {
            // It was picked for something else than what is new.
            return true;
        }
        let types: Vec<(&str, &Bound)> = patterns.iter().flat_map(|pattern| pattern.kinds_of_new()).collect();
        let is_asked_for = |element: &&Value| match types.is_empty() {
            true => self.asked.is_empty(),
            false => types
                .iter()
                .any(|(name, wanted)| element.get(name).is_some_and(|it| wanted.matches(it, None))),
        };
        patterns.iter().any(|pattern| {
            let new = new_elements(pattern, &message, selector.baseline.as_ref());
            let asked_for = new.iter().copied().filter(is_asked_for).collect();
            name_what_was_sent(&new, self.mark, selector, scene)
                || self.any_was_not_there(asked_for, pattern, &message, scene)
        })
    }

    /// Whether one of the elements was in none of the last messages before the stimulus.
    fn any_was_not_there(
        &self,
        mut elements: Vec<&Value>,
        pattern: &Bound,
        message: &Value,
        scene: &EvalContext<'_>,
    ) -> bool {
        let all = scene.timeline.of(&self.topic);
        let before = &all[..all.partition_point(|entry| entry.seq() < self.mark)];
        let far = match self.asked.is_empty() {
            true => LOOK_BACK,
            false => LOOK_BACK_FOR_TYPE,
        };
        // Most messages show what the one before showed: only where they differ is there anything to compare.
        let members = pattern.members_that_look_back().unwrap_or_default();
        let mut compared: Option<Vec<Option<&Value>>> = None;
        for older in before.iter().rev().take(far) {
            if elements.is_empty() {
                return false;
            }
            let json = older.json();
            let shown: Vec<_> = members.iter().map(|member| json?.get(member)).collect();
            if !members.is_empty() && compared.as_ref() == Some(&shown) {
                continue;
            }
            compared = Some(shown);
            let new = pattern.newcomers(message, json);
            elements.retain(|element| new.contains(element));
        }
        !elements.is_empty()
    }
}

/// The search of an `expect` for its answer.
pub(super) struct FirstAnswer {
    question: Question,
    /// Whether an assertion, and not only a preference, depends on it.
    asserts: bool,
    /// What the step comes to if no answer can be told from the rest, and whether it shows something never seen before.
    otherwise: Option<(bool, StepOutcome)>,
}

impl FirstAnswer {
    pub(super) fn of(verb: &Expect, position: Position, scene: &EvalContext<'_>) -> Self {
        let bound = |assertion: &Assertion| {
            let bound = bind_pattern(assertion.selection.pattern.as_ref(), &verb.subject(), scene).ok()??;
            bound.looks_back().then_some(bound)
        };
        let asserted: Vec<Bound> = verb.assert.iter().filter_map(bound).collect();
        let asserts = !asserted.is_empty();
        Self {
            question: Question {
                asked: asserted
                    .into_iter()
                    .chain(verb.prefer.iter().filter_map(bound))
                    .collect(),
                ..Question::of_picking(&verb.subject(), position)
            },
            asserts,
            otherwise: None,
        }
    }

    /// Takes in what one message comes to; gives it back if the message is the answer.
    pub(super) fn offer(
        &mut self,
        outcome: StepOutcome,
        entry: &Entry,
        selector: &Selector,
        scene: &EvalContext<'_>,
    ) -> Option<StepOutcome> {
        let shows_all = !self.question.asked.is_empty() && !outcome.clauses.iter().any(is_missed);
        if shows_all || self.question.is_answered_by(entry, selector, scene) {
            return Some(outcome);
        }
        let picking = Question {
            topic: self.question.topic.clone(),
            asked: Vec::new(),
            ..self.question
        };
        let is_unseen = picking.is_answered_by(entry, selector, scene);
        if self.otherwise.as_ref().is_none_or(|(unseen, _)| is_unseen && !unseen) {
            self.otherwise = Some((is_unseen, outcome));
        }
        None
    }

    /// Whether the verdict is known, but for what may come before an answer is called slow.
    pub(super) fn is_settled(&self) -> bool {
        !self.asserts && self.otherwise.is_some()
    }

    /// What the step comes to when no answer came.
    pub(super) fn otherwise(&mut self, seen: u64, cut_short: Option<&str>) -> Option<StepOutcome> {
        let (_, mut outcome) = self.otherwise.take()?;
        outcome.seen = seen;
        if let Some(why) = cut_short {
            for clause in outcome.clauses.iter_mut().filter(|clause| is_missed(clause)) {
                clause.holds = ClauseOutcome::Unobservable(why.to_owned());
                why.clone_into(&mut clause.message);
            }
        }
        Some(outcome)
    }
}

/// Whether the message does not show what is asserted or preferred.
fn is_missed(clause: &Clause) -> bool {
    matches!(clause.word, "assert" | "prefer")
        && matches!(clause.holds, ClauseOutcome::Violated | ClauseOutcome::Warning)
}

/// Whether the stimulus was a hook: what an operator provokes may be what he has provoked before, in the same words.
fn was_provoked(mark: u64, scene: &EvalContext<'_>) -> bool {
    let mut since = scene.entries.iter().rev().take_while(|entry| entry.seq() >= mark);
    since.any(|entry| matches!(entry.event(), Event::Hook { ok: true, .. }))
}

/// The elements that were not there before. One that was there and is only worded otherwise now, of the same type and
/// with the same references, is not new.
fn new_elements<'a>(pattern: &Bound, message: &'a Value, before: Option<&Value>) -> Vec<&'a Value> {
    let gone = before.map(|before| pattern.newcomers(before, Some(message)));
    let mut gone = gone.unwrap_or_default();
    let mut new = pattern.newcomers(message, before);
    new.retain(|element| {
        let reworded = gone.iter().position(|old| is_reworded(old, element));
        reworded.map(|at| gone.swap_remove(at)).is_none()
    });
    new
}

/// Whether two elements are about the same: everything agrees that is a type or a reference.
fn is_reworded(one: &Value, other: &Value) -> bool {
    let about = |element: &'_ Value| -> Option<Vec<(String, Value)>> {
        let members = element.as_object()?.iter();
        let about = members.filter(|(name, _)| name.ends_with("Type") || name.ends_with("References"));
        Some(about.map(|(name, value)| (name.clone(), value.clone())).collect())
    };
    about(one).is_some_and(|about_one| !about_one.is_empty() && Some(about_one) == about(other))
}

/// Whether one of the elements repeats something of what was sent that was in no state before: a text, such as the
/// identifier of an order or of an action, or a number under its name, such as the orderUpdateId.
fn name_what_was_sent(elements: &[&Value], mark: u64, selector: &Selector, scene: &EvalContext<'_>) -> bool {
    if elements.is_empty() {
        return false;
    }
    let mut sent = BTreeSet::new();
    for stimulus in scene.entries.iter().rev().take_while(|entry| entry.seq() >= mark) {
        if let (Event::Sent { .. }, Some(message)) = (stimulus.event(), stimulus.json()) {
            facts(message, "", &mut |fact| {
                sent.insert(fact);
            });
        }
    }
    if let Some(before) = &selector.baseline {
        facts(before, "", &mut |fact| {
            sent.remove(&fact);
        });
    }
    let mut named = false;
    for element in elements {
        facts(element, "", &mut |fact| named |= sent.contains(&fact));
        references(element, &mut |key, value| {
            // A number is referenced as text.
            named |= sent.contains(&Fact::Number(key.to_owned(), value.to_owned()));
        });
    }
    named
}

/// Something a message says.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Fact {
    /// A text, wherever it stands.
    Text(String),
    /// A whole number, as text, under a name.
    Number(String, String),
}

/// All that a value says.
fn facts(value: &Value, name: &str, told: &mut dyn FnMut(Fact)) {
    match value {
        Value::String(text) => told(Fact::Text(text.clone())),
        Value::Number(number) => told(Fact::Number(name.to_owned(), number.to_string())),
        Value::Array(items) => items.iter().for_each(|item| facts(item, name, told)),
        Value::Object(members) => members.iter().for_each(|(name, member)| facts(member, name, told)),
        _ => {}
    }
}

/// The references of an element: objects of a name and its value.
fn references(value: &Value, told: &mut dyn FnMut(&str, &str)) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| references(item, told)),
        Value::Object(members) => {
            let ending = |end: &str| {
                let mut found = members.iter().filter(|(name, _)| name.ends_with(end));
                found.find_map(|(_, value)| match value {
                    Value::String(text) => Some(text.clone()),
                    Value::Number(number) => Some(number.to_string()),
                    _ => None,
                })
            };
            if let (Some(key), Some(value)) = (ending("Key"), ending("Value")) {
                told(&key, &value);
            }
            members.values().for_each(|member| references(member, told));
        }
        _ => {}
    }
}
