//! Stimuli that break one member of a message: a stimulus of the grammar stands for as many as the schema has ways.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;

use super::grammar::Stimulus;
use crate::pack::{Breakage, Ground, Pack, Way};

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

/// Where the patch goes that breaks the message.
const PATCH: &str = "${break.patch}";

impl Breaks {
    /// Every breakage of a required member; the header, which all topics have, is left to the suites.
    fn of(&self, pack: &Pack) -> Vec<Breakage> {
        let Some(schema) = pack.schema(&self.topic) else {
            return Vec::new();
        };
        let ground = Ground {
            elements: self.elements.clone(),
            ..Ground::default()
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

/// The same stimuli, in which each that breaks a message has become one for every breakage. As a family they are drawn as
/// often as the one they came from.
pub(super) fn unfolded(stimuli: BTreeMap<String, Stimulus>, pack: &Pack) -> BTreeMap<String, Stimulus> {
    let mut all = BTreeMap::new();
    let folded: Vec<(String, Stimulus, Vec<Breakage>)> = stimuli
        .into_iter()
        .map(|(name, stimulus)| {
            let breakages = stimulus.breaks.as_ref().map(|breaks| breaks.of(pack));
            (name, stimulus, breakages.unwrap_or_default())
        })
        .collect();
    let most = folded
        .iter()
        .map(|(_, _, breakages)| breakages.len())
        .max()
        .unwrap_or(0);
    let scale = u32::try_from(most.max(1)).unwrap_or(u32::MAX);
    for (name, stimulus, breakages) in folded {
        let weight = stimulus.weight.max(1).saturating_mul(scale);
        if stimulus.breaks.is_none() {
            all.insert(name, Stimulus { weight, ..stimulus });
            continue;
        }
        let share = (weight / u32::try_from(breakages.len().max(1)).unwrap_or(u32::MAX)).max(1);
        for one in breakages {
            let own = Stimulus {
                title: format!("{}: {} ({})", stimulus.title, one.member, one.way.word()),
                sends: stimulus.sends.replace(PATCH, &one.patch.to_string()),
                weight: share,
                ..stimulus.clone()
            };
            all.insert(format!("{name}.{}-{}", one.member, one.way.word()), own);
        }
    }
    all
}
