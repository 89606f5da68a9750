//! What is known of a conversation after every stimulus: the situation, the facts, and the order the device has.

use std::collections::BTreeSet;

use super::grammar::{Grammar, Stimulus};

/// The order can be sent again as it was.
const REPEATABLE: &str = "repeatable";
/// The order was updated.
const UPDATED: &str = "updated";

/// Where a conversation is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Model {
    /// The situation.
    pub situation: String,
    /// The facts that hold.
    pub facts: BTreeSet<String>,
    /// The place on the way where the vehicle is, or where it will come to rest.
    pub place: usize,
    /// How many orders were taken.
    pub order: u64,
    /// The orderUpdateId of the order.
    pub update: u64,
    /// The sequenceId of the node at `place`.
    pub sequence: u64,
    /// The number of the next stimulus.
    pub number: u64,
    /// What was sent with the last order that was taken, placeholders filled in.
    pub last: String,
}

impl Model {
    /// The beginning: an order of one node is complete.
    #[must_use]
    pub fn begin(grammar: &Grammar) -> Self {
        Self {
            situation: grammar.begins.clone(),
            facts: BTreeSet::new(),
            place: 0,
            order: 0,
            update: 0,
            sequence: 0,
            number: 1,
            last: String::new(),
        }
    }

    /// Whether a stimulus may come now.
    #[must_use]
    pub fn allows(&self, stimulus: &Stimulus) -> bool {
        stimulus.situations.contains(&self.situation)
            && stimulus.with.is_subset(&self.facts)
            && stimulus.without.is_disjoint(&self.facts)
    }

    /// What is so after a stimulus, of which `sent` was sent.
    pub fn hear(&mut self, stimulus: &Stimulus, sent: String) {
        let then = &stimulus.then;
        if let Some(situation) = &then.situation {
            self.situation.clone_from(situation);
        }
        if then.order {
            self.order += 1;
            self.update = 0;
            self.sequence = 0;
            self.facts.remove(UPDATED);
        }
        if then.update > 0 {
            self.update += then.update;
            self.facts.insert(UPDATED.to_owned());
        }
        self.place += then.forward;
        self.sequence += 2 * then.forward as u64;
        if then.order || then.update > 0 {
            if then.once {
                self.facts.remove(REPEATABLE);
            } else {
                self.facts.insert(REPEATABLE.to_owned());
            }
            self.last = sent;
        }
        self.facts.extend(then.set.iter().cloned());
        self.facts.extend(stimulus.sole.clone());
        self.facts.retain(|fact| !then.clear.contains(fact));
        self.number += 1;
    }

    /// Whether all is as it was, but for the number of stimuli.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        let known = |model: &Self| Self {
            number: 0,
            ..model.clone()
        };
        known(self) == known(other)
    }

    /// What `${now.…}` names, moved by so much.
    pub(super) fn value(&self, grammar: &Grammar, name: &str, by: u64) -> Option<String> {
        Some(match name {
            "here" => grammar.node(self.place + usize::try_from(by).ok()?).to_owned(),
            "order" => (self.order + by).to_string(),
            "update" => (self.update + by).to_string(),
            "sequence" => (self.sequence + by).to_string(),
            "number" => (self.number + by).to_string(),
            "last" => self.last.clone(),
            _ => return None,
        })
    }
}
