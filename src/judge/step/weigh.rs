//! Which of several messages an `expect` is about.
//!
//! An assertion about a new element (`$hasNew`) is about what the stimulus brought. A vehicle may report something of
//! its own in the meantime, so a message without the right element decides nothing yet: the step goes on looking
//! until its limit, and takes the first message that shows everything. If there is none, each assertion is judged
//! by the message that came closest. Where nothing is asserted of it, what the vehicle has reported before, without
//! this stimulus, is taken for the answer only if nothing better comes in good time.

use std::collections::BTreeSet;

use serde_json::Value;

use super::{Clause, Holds, Position, Selector, StepOutcome, bind_pattern};
use crate::journal::Entry;
use crate::journal::event::Event;
use crate::judge::window::Scene;
use crate::pattern::Bound;
use crate::suite::model::Expect;

/// So many earlier messages are asked whether an element was there before.
const LOOK_BACK: usize = 200;

pub(super) struct Weighing {
    /// Topic, and first journal number of what came after the stimulus.
    topic: String,
    mark: u64,
    /// Whether there are assertions, and whether a later message may be the one they mean.
    judges: bool,
    patient: bool,
    best: Option<Candidate>,
    /// An element names what was sent, so that it is the answer.
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
        let looks_back = verb.assert.iter().any(|assertion| {
            let bound = bind_pattern(assertion.selection.pattern.as_ref(), scene);
            bound.is_ok_and(|pattern| pattern.is_some_and(|pattern| pattern.looks_back()))
        });
        Self {
            topic: verb.subject().into_owned(),
            mark: position.mark,
            judges: !verb.assert.is_empty(),
            patient: looks_back,
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
        if self.judges && (!self.patient || !outcome.clauses.iter().any(missing)) {
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
        self.settled |= names_what_was_sent(entry, self.mark, selector, scene);
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
    !looks_back || is_novel(entry, topic, mark, selector, scene) || names_what_was_sent(entry, mark, selector, scene)
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

/// Whether a new element repeats a text of what was sent that was in no state before: the identifier of an order or of
/// an action.
fn names_what_was_sent(entry: &Entry, mark: u64, selector: &Selector, scene: &Scene<'_>) -> bool {
    let (Some(pattern), Some(message)) = (&selector.pattern, entry.subject()) else {
        return false;
    };
    let newcomers = pattern.newcomers(&message, selector.baseline.as_ref());
    if newcomers.is_empty() {
        return false;
    }
    let mut sent = BTreeSet::new();
    for stimulus in scene.entries.iter().rev().take_while(|entry| entry.seq() >= mark) {
        if let (Event::Sent { .. }, Some(message)) = (stimulus.event(), stimulus.json()) {
            texts(message, &mut |text| {
                sent.insert(text.to_owned());
            });
        }
    }
    if let Some(before) = &selector.baseline {
        texts(before, &mut |text| {
            sent.remove(text);
        });
    }
    let mut named = false;
    for element in newcomers {
        texts(element, &mut |text| named |= sent.contains(text));
    }
    named
}

/// All texts of a value.
fn texts(value: &Value, told: &mut dyn FnMut(&str)) {
    match value {
        Value::String(text) => told(text),
        Value::Array(items) => items.iter().for_each(|item| texts(item, told)),
        Value::Object(members) => members.values().for_each(|member| texts(member, told)),
        _ => {}
    }
}
