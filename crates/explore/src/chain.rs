//! A list of stimuli that a grammar allows, one after the other.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::grammar::Grammar;
use super::model::Model;
use super::writing::{self, ConversationFile};

/// More stimuli than lead from the beginning to another one.
const LONGEST_LEAD: usize = 6;

/// A conversation, by the names of its stimuli.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Chain(Vec<String>);

impl Chain {
    /// These stimuli, when a grammar allows them in this order.
    #[must_use]
    pub fn of(grammar: &Grammar, names: &[String]) -> Option<Self> {
        let mut model = Model::begin(grammar);
        for name in names {
            let stimulus = grammar.stimuli.get(name).filter(|stimulus| model.allows(stimulus))?;
            model.hear(stimulus, String::new());
        }
        Some(Self(names.to_vec()))
    }

    /// These stimuli, each of which was allowed when it was put behind the others.
    pub(super) fn allowed(names: Vec<String>) -> Self {
        Self(names)
    }

    /// The names of its stimuli.
    #[must_use]
    pub fn stimuli(&self) -> &[String] {
        &self.0
    }

    /// The chain up to a stimulus, counted from zero, and with it.
    #[must_use]
    pub fn until(&self, at: usize) -> Self {
        Self(self.0.iter().take(at + 1).cloned().collect())
    }

    /// The shortest chain that ends with a stimulus; `None` when nothing leads to it.
    #[must_use]
    pub fn shortest_to(grammar: &Grammar, wanted: &str) -> Option<Self> {
        way(grammar, Model::begin(grammar), |name| name == wanted).map(|(names, _)| Self(names))
    }

    /// The shortest chain to one stimulus of every kind: of those that come from one in the grammar, one for each set of needs.
    /// What nothing leads to within a few stimuli is missing.
    #[must_use]
    pub fn to_every_kind(grammar: &Grammar) -> BTreeMap<&str, Self> {
        let kinds = grammar.kinds();
        let mut found: BTreeMap<&str, Self> = BTreeMap::new();
        let begin = Model::begin(grammar);
        let mut seen = BTreeSet::from([(begin.situation.clone(), begin.facts.clone())]);
        let mut open = VecDeque::from([(begin, Vec::new())]);
        while let Some((model, names)) = open.pop_front() {
            if found.len() == kinds.len() || names.len() >= LONGEST_LEAD {
                break;
            }
            for (name, next) in kinds.iter().filter(|(_, next)| model.allows(next)) {
                let longer = [names.as_slice(), &[(*name).to_owned()]].concat();
                found.entry(*name).or_insert_with(|| Self(longer.clone()));
                let mut after = model.clone();
                after.hear(next, String::new());
                if seen.insert((after.situation.clone(), after.facts.clone())) {
                    open.push_back((after, longer));
                }
            }
        }
        found
    }

    /// These stimuli, those that lead to each of them, and those that lead from each of them to the next one.
    #[must_use]
    pub fn around(grammar: &Grammar, wanted: &BTreeSet<String>) -> BTreeSet<String> {
        let mut all = wanted.clone();
        for name in wanted {
            let Some((there, after)) = way(grammar, Model::begin(grammar), |other| other == name) else {
                continue;
            };
            all.extend(there);
            let on = way(grammar, after, |other| wanted.contains(other));
            all.extend(on.into_iter().flat_map(|(names, _)| names));
        }
        all
    }

    /// The conversation as a test of this id.
    #[must_use]
    pub fn file(&self, grammar: &Grammar, id: &str, why: &str) -> ConversationFile {
        writing::file(&self.0, grammar, id, why)
    }
}

/// The shortest way to a stimulus that is wanted, and what is known behind it.
fn way(grammar: &Grammar, from: Model, is_wanted: impl Fn(&str) -> bool) -> Option<(Vec<String>, Model)> {
    let mut seen = BTreeSet::new();
    let mut open = VecDeque::from([(from, Vec::new())]);
    while let Some((model, names)) = open.pop_front() {
        if !seen.insert((model.situation.clone(), model.facts.clone())) {
            continue;
        }
        let allowed = grammar.stimuli.iter().filter(|(_, next)| model.allows(next));
        let steps = allowed.map(|(name, next)| {
            let mut after = model.clone();
            after.hear(next, String::new());
            (name, ([names.as_slice(), std::slice::from_ref(name)].concat(), after))
        });
        for (name, (names, after)) in steps {
            if is_wanted(name) {
                return Some((names, after));
            }
            open.push_back((after, names));
        }
    }
    None
}
