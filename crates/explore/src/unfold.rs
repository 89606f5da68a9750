//! A grammar for one protocol version: a stimulus that breaks a message becomes as many as the schema has ways, and one with
//! words to choose from as many as there are mixtures.

use std::collections::BTreeMap;

use super::grammar::{Grammar, Stimulus};
use tck_pack::{Breakage, Pack, VersionRange};
use tck_suite::model::BrokenMember;

/// Where the patch goes that breaks the message.
const PATCH: &str = "${break.patch}";

impl Grammar {
    /// What a protocol version has: leaves out the stimuli and steps that are for others, and the stimuli `keeps` refuses. A
    /// stimulus that stands for many breakages becomes as many.
    #[must_use]
    pub fn only(mut self, pack: &Pack, keeps: impl Fn(&str, &Stimulus) -> bool) -> Self {
        let has = |spec: &str| {
            let range = spec.parse::<VersionRange>();
            range.is_ok_and(|range| range.contains(pack.version))
        };
        let usual = self.spec.clone();
        self.stimuli
            .retain(|name, stimulus| has(stimulus.spec.as_ref().unwrap_or(&usual)) && keeps(name, stimulus));
        for stimulus in self.stimuli.values_mut() {
            stimulus.sends = steps_of(&stimulus.sends, has);
            stimulus.hears = steps_of(&stimulus.hears, has);
        }
        for answer in self.answers.values_mut() {
            *answer = steps_of(answer, has);
        }
        self.stimuli = unfolded(self.stimuli, pack);
        self.spec = within_major(&usual, pack);
        self
    }
}

/// The steps that do not say by `spec:` that they are for other versions.
fn steps_of(text: &str, has: impl Fn(&str) -> bool) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut step = String::new();
    let mut finish = |step: &mut String| {
        let spec = step.lines().find_map(|line| line.strip_prefix("  spec: "));
        if spec.is_none_or(|spec| has(spec.trim_matches('"'))) {
            kept.push_str(step);
        }
        step.clear();
    };
    for line in text.lines() {
        if line.starts_with("- ") {
            finish(&mut step);
        }
        step.push_str(line);
        step.push('\n');
    }
    finish(&mut step);
    kept
}

/// A range of versions as far as it is of the major version of a pack: stimuli, breakages and steps were chosen for that.
fn within_major(range: &str, pack: &Pack) -> String {
    let major = pack.version.major;
    let whole = format!("{major}.0").parse();
    let has_whole = |range: VersionRange| whole.is_ok_and(|first| range.contains(first));
    match range.parse::<VersionRange>().is_ok_and(has_whole) {
        true => format!(">={major}.0, <{}", major + 1),
        false => format!("{range}, <{}", major + 1),
    }
}

/// Makes each stimulus that stands for many into as many. As a family they are drawn as often as the one they came from.
fn unfolded(stimuli: BTreeMap<String, Stimulus>, pack: &Pack) -> BTreeMap<String, Stimulus> {
    let families: Vec<(u32, Vec<(String, Stimulus)>)> = stimuli
        .into_iter()
        .map(|(name, stimulus)| (stimulus.weight.max(1), family_of(name, stimulus, pack)))
        .collect();
    let most = families.iter().map(|(_, members)| members.len()).max().unwrap_or(1);
    let scale = u32::try_from(most).unwrap_or(u32::MAX);
    let shared = families.into_iter().flat_map(|(weight, members)| {
        let count = u32::try_from(members.len().max(1)).unwrap_or(u32::MAX);
        let share = (weight.saturating_mul(scale) / count).max(1);
        members
            .into_iter()
            .map(move |(name, own)| (name, Stimulus { weight: share, ..own }))
    });
    shared.collect()
}

/// All that one stimulus of the grammar stands for.
fn family_of(name: String, stimulus: Stimulus, pack: &Pack) -> Vec<(String, Stimulus)> {
    if let Some(breaks) = &stimulus.breaks {
        let all = breaks.of(pack).into_iter();
        return all.map(|one| broken(&name, &stimulus, &one)).collect();
    }
    if stimulus.each.is_empty() {
        return vec![(name, stimulus)];
    }
    let mixtures = stimulus.each.iter().fold(vec![Vec::new()], |mixtures, (key, words)| {
        let longer = |mixture: &Vec<(String, String)>| {
            let mixture = mixture.clone();
            let with = move |word: &String| [mixture.clone(), vec![(key.clone(), word.clone())]].concat();
            words.iter().map(with).collect::<Vec<_>>()
        };
        mixtures.iter().flat_map(longer).collect()
    });
    mixtures
        .iter()
        .map(|mixture| mixed(&name, &stimulus, mixture))
        .collect()
}

fn broken(name: &str, stimulus: &Stimulus, one: &Breakage) -> (String, Stimulus) {
    let own = Stimulus {
        title: format!("{}: {} ({})", stimulus.title, one.member, one.way.word()),
        sends: stimulus.sends.replace(PATCH, &one.patch.to_string()),
        broken: Some(BrokenMember {
            member: one.member.clone(),
            way: one.way.word().to_owned(),
        }),
        ..stimulus.clone()
    };
    (format!("{name}.{}-{}", one.member, one.way.word()), own)
}

fn mixed(name: &str, stimulus: &Stimulus, mixture: &[(String, String)]) -> (String, Stimulus) {
    let fill = |text: &str| {
        let fill = |text: String, (key, word): &(String, String)| text.replace(&format!("${{each.{key}}}"), word);
        mixture.iter().fold(text.to_owned(), fill)
    };
    let words: Vec<&str> = mixture.iter().map(|(_, word)| word.as_str()).collect();
    let own = Stimulus {
        title: format!("{}: {}", stimulus.title, words.join(", ")),
        needs: stimulus.needs.iter().map(|need| fill(need)).collect(),
        sends: fill(&stimulus.sends),
        hears: fill(&stimulus.hears),
        gives: stimulus
            .gives
            .iter()
            .map(|(key, value)| (key.clone(), fill(value)))
            .collect(),
        ..stimulus.clone()
    };
    (format!("{name}.{}", words.join("-")), own)
}
