//! Which breakages of a message a stimulus stands for, and how they are named.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;

use tck_pack::{Breakage, BreakageScope, Pack, Way};

/// Which breakages a stimulus stands for.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Breaks {
    /// The topic whose schema is asked.
    pub topic: String,
    /// The ways to break a member, in the words of `cases: { from-schema: … }`.
    pub ways: BTreeSet<String>,
    /// The lists that are entered, and which element is broken.
    #[serde(default)]
    pub elements: BTreeMap<String, usize>,
}

impl Breaks {
    /// Every breakage of a required member; the header, which all topics have, is left to the suites.
    pub(super) fn of(&self, pack: &Pack) -> Vec<Breakage> {
        let Some(schema) = pack.schema(&self.topic) else {
            return Vec::new();
        };
        let ground = BreakageScope {
            elements: self.elements.clone(),
            ..BreakageScope::default()
        };
        let word = |way: Way| Way::ALL.iter().find(|(_, one)| *one == way).map(|(word, _)| *word);
        let header = header(pack);
        let mut all = schema.breakages(&ground);
        all.retain(|one| {
            let first = one.member.split('.').next().unwrap_or_default();
            one.optional.is_none()
                && !header.contains(first)
                && word(one.way).is_some_and(|word| self.ways.contains(word))
        });
        all
    }
}

/// The members that the messages of every topic have.
fn header(pack: &Pack) -> BTreeSet<String> {
    let topics = ["order", "instantActions", "state", "connection"];
    let members = topics.iter().filter_map(|topic| Some(pack.schema(topic)?.members(&[])));
    let sets = members.map(BTreeSet::from_iter);
    sets.reduce(|one, other: BTreeSet<String>| one.intersection(&other).cloned().collect())
        .unwrap_or_default()
}

/// The stimulus of the grammar that a stimulus came from: itself, unless it is one of many breakages.
#[must_use]
pub fn family(name: &str) -> &str {
    name.split_once('.').map_or(name, |(family, _)| family)
}
