//! A list of stimuli that a grammar allows, one after the other.

use super::grammar::Grammar;
use super::model::Model;
use super::writing::{self, ConversationFile};

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
        writing::file(&self.0, grammar, id, why)
    }
}
