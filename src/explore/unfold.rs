//! A grammar for one protocol version: a stimulus that breaks a message becomes as many as the schema has ways.

use std::collections::BTreeMap;

use super::grammar::{Grammar, Stimulus};
use crate::pack::{Breakage, Pack, VersionRange};
use crate::suite::model::BrokenMember;

/// Where the patch goes that breaks the message.
const PATCH: &str = "${break.patch}";

impl Grammar {
    /// The same without the stimuli that a protocol version does not have, and those `keeps` refuses. A stimulus that stands
    /// for many breakages has become as many.
    #[must_use]
    pub fn only(mut self, pack: &Pack, keeps: impl Fn(&str, &Stimulus) -> bool) -> Self {
        self.stimuli.retain(|name, stimulus| {
            let spec = stimulus
                .spec
                .as_deref()
                .and_then(|spec| spec.parse::<VersionRange>().ok());
            spec.is_none_or(|spec| spec.contains(pack.version)) && keeps(name, stimulus)
        });
        self.stimuli = unfolded(self.stimuli, pack);
        self
    }
}

/// The same stimuli, in which each that breaks a message has become one for every breakage. As a family they are drawn as
/// often as the one they came from.
fn unfolded(stimuli: BTreeMap<String, Stimulus>, pack: &Pack) -> BTreeMap<String, Stimulus> {
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
                broken: Some(BrokenMember {
                    member: one.member.clone(),
                    way: one.way.word().to_owned(),
                }),
                ..stimulus.clone()
            };
            all.insert(format!("{name}.{}-{}", one.member, one.way.word()), own);
        }
    }
    all
}
