//! Which stimuli were tried in which situation.

use std::collections::{BTreeMap, BTreeSet};

use super::broken::family;
use super::grammar::Grammar;

/// How often each stimulus came in each situation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage(BTreeMap<String, BTreeMap<String, u64>>);

impl Coverage {
    /// One more.
    pub fn note(&mut self, situation: &str, stimulus: &str) {
        let of_situation = self.0.entry(situation.to_owned()).or_default();
        *of_situation.entry(stimulus.to_owned()).or_default() += 1;
    }

    /// Whether it was tried.
    #[must_use]
    pub fn tried(&self, situation: &str, stimulus: &str) -> bool {
        self.count(situation, stimulus) > 0
    }

    /// How often it was tried.
    #[must_use]
    pub fn count(&self, situation: &str, stimulus: &str) -> u64 {
        let counted = self.0.get(situation).and_then(|all| all.get(stimulus));
        counted.copied().unwrap_or(0)
    }

    /// How often each stimulus came, by situation.
    #[must_use]
    pub fn table(&self) -> &BTreeMap<String, BTreeMap<String, u64>> {
        &self.0
    }

    /// How many pairs of a situation and a stimulus were tried, out of how many the grammar has.
    #[must_use]
    pub fn pairs(&self, grammar: &Grammar) -> (usize, usize) {
        let families = grammar.stimuli.iter().flat_map(|(name, stimulus)| {
            let situations = stimulus.situations.iter();
            situations.map(move |situation| (situation.as_str(), family(name)))
        });
        let all: BTreeSet<(&str, &str)> = families.collect();
        let of = all.len();
        let tried = all
            .iter()
            .filter(|(situation, name)| self.tried(situation, name))
            .count();
        (tried, of)
    }
}
