//! Which stimuli were tried in which situation, what came of them, and how often they are worth another try.

use std::collections::{BTreeMap, BTreeSet};

use super::broken::family;
use super::grammar::Grammar;
use tck_result::{Answers, ExplorationResult};

/// What is known of one stimulus in one situation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Known {
    /// How often it was drawn.
    drawn: u64,
    /// What came of it.
    answers: Answers,
}

/// How often each stimulus came in each situation, and how it was answered.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coverage(BTreeMap<(String, String), Known>);

impl Coverage {
    /// It was drawn once more.
    pub fn note(&mut self, situation: &str, stimulus: &str) {
        self.known(situation, stimulus).drawn += 1;
    }

    /// What conversations have shown.
    pub fn learn(&mut self, result: &ExplorationResult) {
        for said in &result.said {
            let answers = &mut self.known(&said.situation, &said.stimulus).answers;
            answers.as_demanded += said.answers.as_demanded;
            answers.broken += said.answers.broken;
            answers.undecided += said.answers.undecided;
        }
    }

    fn known(&mut self, situation: &str, stimulus: &str) -> &mut Known {
        self.0.entry((situation.to_owned(), stimulus.to_owned())).or_default()
    }

    fn of(&self, situation: &str, stimulus: &str) -> Known {
        let key = (situation.to_owned(), stimulus.to_owned());
        self.0.get(&key).copied().unwrap_or_default()
    }

    /// How many times more often than at least it is drawn. What was not tried comes first. What failed ends the
    /// conversation, and hides what comes behind; what decides nothing teaches nothing.
    #[must_use]
    pub fn worth(&self, situation: &str, stimulus: &str) -> u64 {
        const UNTRIED: u64 = 64;
        const TRIED: u64 = 8;
        const FRUITLESS: u64 = 1;
        let known = self.of(situation, stimulus);
        let answers = known.answers;
        if known.drawn == 0 && answers.tried() == 0 {
            UNTRIED
        } else if answers.as_demanded == 0 && answers.tried() > 0 {
            FRUITLESS
        } else {
            TRIED
        }
    }

    /// Whether it was said, and not only drawn.
    #[must_use]
    pub fn tried(&self, situation: &str, stimulus: &str) -> bool {
        self.of(situation, stimulus).answers.tried() > 0
    }

    /// What came of each stimulus that was said, by situation.
    #[must_use]
    pub fn table(&self) -> BTreeMap<&str, BTreeMap<&str, Answers>> {
        let mut table: BTreeMap<&str, BTreeMap<&str, Answers>> = BTreeMap::new();
        for ((situation, stimulus), known) in self.0.iter().filter(|(_, known)| known.answers.tried() > 0) {
            table.entry(situation).or_default().insert(stimulus, known.answers);
        }
        table
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
