//! Which of several messages an `expect` is about.
//!
//! An assertion about a new element (`$hasNew`) is about what the stimulus brought. The first message with the answer
//! is judged, and a later, better one changes nothing. The answer is a new element that names what was sent, or one of
//! the asserted kind that was not there before. A vehicle may report something of its own in the meantime: a message
//! with nothing but that decides nothing yet, and the step goes on looking until its limit. If no answer can be told
//! from the rest, each assertion is judged by the message that came closest. Where nothing is asserted of it, what the
//! vehicle has reported before, without this stimulus, is taken for the answer only if nothing better comes in good
//! time.

use std::collections::BTreeSet;

use serde_json::Value;

use super::{Clause, Holds, Position, Selector, StepOutcome, bind_pattern};
use crate::journal::Entry;
use crate::journal::event::Event;
use crate::judge::window::Scene;
use crate::pattern::Bound;
use crate::suite::model::{Assertion, Expect};

/// So many earlier messages are asked whether an element was there before.
const LOOK_BACK: usize = 200;
/// So many are asked about one of the asserted kind: what comes and goes of its own shows up in them, and a refusal
/// of an earlier test, in the same words, does not.
const LOOK_BACK_KIND: usize = 12;

pub(super) struct Weighing {
    /// Topic, and first journal number of what came after the stimulus.
    topic: String,
    mark: u64,
    /// Whether there are assertions, and whether a later message may be the one they mean.
    judges: bool,
    patient: bool,
    /// What is asserted of new elements.
    asserted: Vec<Bound>,
    best: Option<Candidate>,
    /// Nothing is asserted, and something new was there.
    settled: bool,
}

/// The best so far.
struct Candidate {
    outcome: StepOutcome,
    rank: (usize, bool),
    /// By clause: whether it holds, whether the message shows something never seen before, and how much of the picture.
    weights: Vec<(bool, bool, f64)>,
}

impl Weighing {
    pub(super) fn of(verb: &Expect, position: Position, scene: &Scene<'_>) -> Self {
        let bound = |assertion: &Assertion| {
            let bound = bind_pattern(assertion.selection.pattern.as_ref(), scene).ok()??;
            bound.looks_back().then_some(bound)
        };
        let patient = verb.assert.iter().any(|assertion| bound(assertion).is_some());
        Self {
            topic: verb.subject().into_owned(),
            mark: position.mark,
            judges: !verb.assert.is_empty(),
            patient,
            asserted: verb.assert.iter().chain(&verb.prefer).filter_map(bound).collect(),
            best: None,
            settled: false,
        }
    }

    /// Looks at what one message comes to; gives it back when the step has seen enough.
    pub(super) fn weigh(
        &mut self,
        outcome: StepOutcome,
        shares: &[f64],
        entry: &Entry,
        selector: &Selector,
        scene: &Scene<'_>,
    ) -> Option<StepOutcome> {
        let missing = |clause: &Clause| clause.word == "assert" && clause.holds == Holds::No;
        let shows_all = || !outcome.clauses.iter().any(missing);
        if self.judges && (!self.patient || shows_all() || self.answers(entry, selector, scene)) {
            return Some(outcome);
        }
        if !self.judges {
            if convinces(entry, &self.topic, self.mark, selector, scene) {
                return Some(outcome);
            }
            // It may be something of the vehicle's own; a moment will tell.
            self.settled = true;
        }
        let novel = is_novel(entry, &self.topic, self.mark, selector, scene);
        let held = outcome.clauses.iter().filter(|clause| !missing(clause)).count();
        let weights: Vec<(bool, bool, f64)> = outcome
            .clauses
            .iter()
            .zip(shares)
            .map(|(clause, share)| (!missing(clause), novel, *share))
            .collect();
        let rank = (held, novel);
        let Some(best) = &mut self.best else {
            self.best = Some(Candidate { outcome, rank, weights });
            return None;
        };
        // Every assertion by the message that comes closest; the rest by the message that shows most of them.
        let mut outcome = outcome;
        let mut weights = weights;
        let better = rank > best.rank;
        let pairs = outcome.clauses.iter_mut().zip(&mut weights);
        let others = best.outcome.clauses.iter_mut().zip(&mut best.weights);
        for ((clause, weight), (other, other_weight)) in pairs.zip(others) {
            let closer = if clause.word == "assert" {
                *weight > *other_weight
            } else {
                better
            };
            if closer != better {
                std::mem::swap(clause, other);
                std::mem::swap(weight, other_weight);
            }
        }
        if better {
            *best = Candidate { outcome, rank, weights };
        }
        None
    }

    /// Whether the message holds the answer to what was sent.
    fn answers(&self, entry: &Entry, selector: &Selector, scene: &Scene<'_>) -> bool {
        let Some(message) = entry.subject() else { return false };
        let selected = selector.pattern.iter().filter(|pattern| pattern.looks_back());
        selected.chain(&self.asserted).any(|pattern| {
            let new = pattern.newcomers(&message, selector.baseline.as_ref());
            if new.is_empty() {
                return false;
            }
            let kinds = self
                .asserted
                .iter()
                .chain(&selector.pattern)
                .flat_map(Bound::kinds_of_new);
            let kinds: Vec<(&str, &Bound)> = kinds.collect();
            let of_kind = |element: &&&Value| {
                let fits = |(name, kind): &(&str, &Bound)| element.get(name).is_some_and(|it| kind.matches(it, None));
                kinds.iter().any(fits)
            };
            let of_kind: Vec<&Value> = new.iter().filter(of_kind).copied().collect();
            name_what_was_sent(&new, self.mark, selector, scene)
                || any_was_not_there(of_kind, pattern, &message, &self.topic, self.mark, scene)
        })
    }

    /// Whether the outcome is known, but for what may come before an answer is called slow.
    pub(super) fn is_settled(&self) -> bool {
        self.settled
    }

    /// What the step comes to when nothing better came.
    pub(super) fn best(&mut self, seen: u64, cut_short: Option<&str>) -> Option<StepOutcome> {
        let mut outcome = self.best.take()?.outcome;
        outcome.seen = seen;
        if let Some(why) = cut_short {
            for clause in &mut outcome.clauses {
                if clause.word == "assert" && clause.holds == Holds::No {
                    clause.holds = Holds::Unseen(why.to_owned());
                    why.clone_into(&mut clause.message);
                }
            }
        }
        Some(outcome)
    }
}

/// Whether what is new in a message is more than what the vehicle reports from time to time: it was never there before,
/// or it names what was sent. True where nothing new is looked for.
pub(super) fn convinces(entry: &Entry, topic: &str, mark: u64, selector: &Selector, scene: &Scene<'_>) -> bool {
    let looks_back = selector.pattern.as_ref().is_some_and(Bound::looks_back);
    !looks_back
        || was_provoked(mark, scene)
        || is_novel(entry, topic, mark, selector, scene)
        || names_what_was_sent(entry, mark, selector, scene)
}

/// Whether the stimulus was a hook: what an operator provokes may be what he has provoked before, in the same words.
fn was_provoked(mark: u64, scene: &Scene<'_>) -> bool {
    let since = scene.entries.iter().rev().take_while(|entry| entry.seq() >= mark);
    let mut since = since;
    since.any(|entry| matches!(entry.event(), Event::Hook { ok: true, .. }))
}

/// Whether the message shows an element that none of those before the stimulus showed.
fn is_novel(entry: &Entry, topic: &str, mark: u64, selector: &Selector, scene: &Scene<'_>) -> bool {
    let (Some(pattern), Some(message)) = (&selector.pattern, entry.subject()) else {
        return false;
    };
    let all = scene.timeline.of(topic);
    let before = &all[..all.partition_point(|entry| entry.seq() < mark)];
    // Most messages show what the one before showed: only where they differ is there anything to compare.
    let members = pattern.members_that_look_back();
    let mut compared: Option<Vec<Option<&Value>>> = None;
    before.iter().rev().take(LOOK_BACK).all(|older| {
        if let (Some(members), Some(json)) = (&members, older.json()) {
            let shown: Vec<_> = members.iter().map(|member| json.get(member)).collect();
            if compared.as_ref() == Some(&shown) {
                return true;
            }
            compared = Some(shown);
        }
        pattern.matches(&message, older.json())
    })
}

/// Whether one of the new elements was in none of the last messages before the stimulus.
fn any_was_not_there(
    mut elements: Vec<&Value>,
    pattern: &Bound,
    message: &Value,
    topic: &str,
    mark: u64,
    scene: &Scene<'_>,
) -> bool {
    let all = scene.timeline.of(topic);
    let before = &all[..all.partition_point(|entry| entry.seq() < mark)];
    for older in before.iter().rev().take(LOOK_BACK_KIND) {
        if elements.is_empty() {
            return false;
        }
        let new = pattern.newcomers(message, older.json());
        elements.retain(|element| new.contains(element));
    }
    !elements.is_empty()
}

/// Whether a new element of the message names what was sent.
fn names_what_was_sent(entry: &Entry, mark: u64, selector: &Selector, scene: &Scene<'_>) -> bool {
    let (Some(pattern), Some(message)) = (&selector.pattern, entry.subject()) else {
        return false;
    };
    let newcomers = pattern.newcomers(&message, selector.baseline.as_ref());
    name_what_was_sent(&newcomers, mark, selector, scene)
}

/// Whether one of the elements repeats something of what was sent that was in no state before: a text, such as the
/// identifier of an order or of an action, or a number under its name, such as the orderUpdateId.
fn name_what_was_sent(elements: &[&Value], mark: u64, selector: &Selector, scene: &Scene<'_>) -> bool {
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
