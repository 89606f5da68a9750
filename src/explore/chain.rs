//! A list of stimuli that a grammar allows, one after the other.

use super::grammar::Grammar;
use super::model::Model;
use super::writing;

/// A conversation, by the names of its stimuli.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Chain(Vec<String>);

/// A conversation as an ordinary test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConversationFile {
    /// The id of the test.
    pub id: String,
    /// The text of the file.
    pub text: String,
    /// The last line of each stimulus, counted from one.
    ends: Vec<u32>,
    /// Where the body begins.
    first: u32,
}

impl ConversationFile {
    pub(super) fn new(id: String, text: String, first: u32, ends: Vec<u32>) -> Self {
        Self { id, text, ends, first }
    }

    /// A conversation that was written before; `None` when the text does not begin with the id of a test.
    #[must_use]
    pub fn read(text: String) -> Option<Self> {
        let id = text
            .lines()
            .find_map(|line| line.strip_prefix("test:"))?
            .trim()
            .to_owned();
        Some(Self::new(id, text, 0, Vec::new()))
    }

    /// Which stimulus a line belongs to, counted from zero.
    #[must_use]
    pub fn stimulus_at(&self, line: u32) -> Option<usize> {
        if line < self.first {
            return None;
        }
        self.ends.iter().position(|end| line <= *end)
    }
}

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

    /// The same up to a stimulus, counted from zero, and with it.
    #[must_use]
    pub fn until(&self, at: usize) -> Self {
        Self(self.0.iter().take(at + 1).cloned().collect())
    }

    /// The shortest chain that ends with a stimulus; `None` when nothing leads to it.
    #[must_use]
    pub fn shortest_to(grammar: &Grammar, wanted: &str) -> Option<Self> {
        let stimulus = grammar.stimuli.get(wanted)?;
        let mut seen = std::collections::BTreeSet::new();
        let mut open = std::collections::VecDeque::from([(Model::begin(grammar), Vec::new())]);
        while let Some((model, names)) = open.pop_front() {
            if model.allows(stimulus) {
                return Some(Self([names, vec![wanted.to_owned()]].concat()));
            }
            if !seen.insert((model.situation.clone(), model.facts.clone())) {
                continue;
            }
            for (name, next) in grammar.stimuli.iter().filter(|(_, next)| model.allows(next)) {
                let mut after = model.clone();
                after.hear(next, String::new());
                open.push_back((after, [names.clone(), vec![name.clone()]].concat()));
            }
        }
        None
    }

    /// The conversation as a test of this id.
    #[must_use]
    pub fn file(&self, grammar: &Grammar, id: &str, why: &str) -> ConversationFile {
        writing::file(self, grammar, id, why)
    }
}
