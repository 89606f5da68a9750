//! What may be said, when, and what must be heard: the grammar of conversations, read from its file.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::broken::{Breaks, family};
use tck_base::diagnostic::Source;
use tck_base::yaml;
use tck_pack::{Assets, Pack, Role, VersionRange};
use tck_suite::model::BrokenMember;

/// Why there is no grammar.
#[derive(Debug, thiserror::Error)]
pub enum GrammarError {
    /// No file says how to explore this side.
    #[error("there is no grammar of conversations for this side of the interface ({0})")]
    Missing(String),
    /// The file cannot be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// Which.
        path: String,
        /// What is wrong.
        reason: String,
    },
}

/// All that may be said to one side.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Grammar {
    /// Which side.
    explore: String,
    /// Protocol versions, as in a test.
    pub spec: String,
    /// The situation in which a conversation begins.
    pub begins: String,
    /// The nodes of the way, which is walked to its end and back again.
    pub nodes: Vec<String>,
    /// Steps behind the last stimulus that judge the conversation as a whole.
    #[serde(default)]
    pub closing: String,
    /// Steps that bring device and harness to the beginning of every conversation.
    pub given: String,
    /// What a conversation can have come to, with one sentence each.
    pub situations: BTreeMap<String, String>,
    /// Answers that stimuli share.
    pub answers: BTreeMap<String, String>,
    /// The stimuli by name; those of the files beside it among them.
    #[serde(default)]
    pub stimuli: BTreeMap<String, Stimulus>,
    /// What brings the device back to rest.
    pub endings: Vec<Ending>,
}

/// One thing that may be said.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Stimulus {
    /// One sentence.
    pub title: String,
    /// The situations in which it may come.
    #[serde(rename = "in")]
    pub situations: BTreeSet<String>,
    /// Facts that must hold.
    #[serde(default)]
    pub with: BTreeSet<String>,
    /// Facts that must not hold.
    #[serde(default)]
    pub without: BTreeSet<String>,
    /// Protocol versions, when they are fewer than those of the grammar.
    #[serde(default)]
    pub spec: Option<String>,
    /// What device, bench or profile must offer, as in a test.
    #[serde(default)]
    pub needs: BTreeSet<String>,
    /// The breakages it stands for, one of which goes where `sends` says `${break.patch}`.
    #[serde(default)]
    pub breaks: Option<Breaks>,
    /// Words of which it takes one each, where a text says `${each.…}`; it stands for every mixture of them.
    #[serde(default)]
    pub each: BTreeMap<String, Vec<String>>,
    /// What it breaks, when it is one of many breakages.
    #[serde(skip)]
    pub broken: Option<BrokenMember>,
    /// How often it is drawn, compared with others.
    #[serde(default = "once")]
    pub weight: u32,
    /// Steps that say it.
    #[serde(default)]
    pub sends: String,
    /// Steps that hear what comes of it.
    #[serde(default)]
    pub hears: String,
    /// A shared answer that is heard afterwards.
    #[serde(default)]
    pub answer: Option<String>,
    /// The answer when the fact `sole` holds already.
    #[serde(default)]
    pub again: Option<String>,
    /// A fact that holds afterwards, and beside which the answer cannot be told from an older one.
    #[serde(default)]
    pub sole: Option<String>,
    /// What it gives to the shared answer.
    #[serde(default)]
    pub gives: BTreeMap<String, String>,
    /// What is so afterwards.
    #[serde(default)]
    pub then: Then,
}

fn once() -> u32 {
    1
}

/// What a stimulus changes.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Then {
    /// The situation afterwards, when it is another one.
    #[serde(default, rename = "in")]
    pub situation: Option<String>,
    /// Whether it is an order, with ids of its own.
    #[serde(default)]
    pub order: bool,
    /// By how much the orderUpdateId grows.
    #[serde(default)]
    pub update: u64,
    /// By how many nodes the vehicle gets on.
    #[serde(default)]
    pub forward: usize,
    /// Whether the order cannot be sent again as it was, because its actions would get other ids.
    #[serde(default)]
    pub once: bool,
    /// Facts that hold afterwards.
    #[serde(default)]
    pub set: BTreeSet<String>,
    /// Facts that do not hold afterwards.
    #[serde(default)]
    pub clear: BTreeSet<String>,
}

/// Steps at the end of a conversation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ending {
    /// Facts that must hold for them.
    #[serde(default)]
    pub with: BTreeSet<String>,
    /// The steps.
    pub steps: String,
}

impl Grammar {
    /// The grammar of a side.
    ///
    /// # Errors
    /// There is none, or its file is wrong.
    pub fn load(assets: &Assets, role: Role) -> Result<Self, GrammarError> {
        let path = format!("suites/explore/{}.yaml", role.word());
        let file = assets
            .get(&path)
            .ok_or_else(|| GrammarError::Missing(role.word().to_owned()))?;
        let mut grammar: Self = parsed(&path, &file.text)?;
        for part in assets.under(&format!("suites/explore/{}/", role.word())) {
            let stimuli: BTreeMap<String, Stimulus> = parsed(&part.path, &part.text)?;
            for (name, stimulus) in stimuli {
                if grammar.stimuli.insert(name.clone(), stimulus).is_some() {
                    return Err(unreadable(
                        &part.path,
                        format!("the stimulus `{name}` is there already"),
                    ));
                }
            }
        }
        grammar.checked(&path)
    }

    /// Checks a file of stimuli beside the head of a grammar and the stimuli that are there; how many it has.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check_part(assets: &Assets, role: Role, path: &str, text: &str) -> Result<usize, GrammarError> {
        let mut grammar = Self::load(assets, role)?;
        let stimuli: BTreeMap<String, Stimulus> = parsed(path, text)?;
        let count = stimuli.len();
        grammar.stimuli = stimuli;
        grammar.checked(path)?;
        Ok(count)
    }

    /// Reads a grammar that stands in one file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(path: &str, text: &str) -> Result<Self, GrammarError> {
        parsed::<Self>(path, text)?.checked(path)
    }

    fn checked(self, path: &str) -> Result<Self, GrammarError> {
        match self.complaint() {
            Some(why) => Err(unreadable(path, why)),
            None => Ok(self),
        }
    }

    /// The first thing that is named and is not there.
    fn complaint(&self) -> Option<String> {
        if !self.situations.contains_key(&self.begins) {
            return Some(format!("it begins in `{}`, which is no situation", self.begins));
        }
        if self.nodes.len() < 2 {
            return Some("the way has fewer than two nodes".to_owned());
        }
        self.stimuli.iter().find_map(|(name, stimulus)| {
            if family(name) != name {
                return Some(format!("the stimulus `{name}` has a dot in its name"));
            }
            let then = stimulus.then.situation.iter();
            let lost = stimulus
                .situations
                .iter()
                .chain(then)
                .find(|one| !self.situations.contains_key(*one));
            if let Some(lost) = lost {
                return Some(format!(
                    "the stimulus `{name}` names the situation `{lost}`, which there is not"
                ));
            }
            let answers = stimulus.answer.iter().chain(&stimulus.again);
            let lost = answers.into_iter().find(|one| !self.answers.contains_key(*one));
            if let Some(lost) = lost {
                return Some(format!(
                    "the stimulus `{name}` names the answer `{lost}`, which there is not"
                ));
            }
            let spec = stimulus.spec.as_deref().unwrap_or(&self.spec);
            spec.parse::<VersionRange>()
                .is_err()
                .then(|| format!("the stimulus `{name}` has a range of versions that is none: {spec}"))
        })
    }

    /// The first stimulus of every family, and every stimulus that has none.
    pub fn heads(&self) -> impl Iterator<Item = &String> {
        let mut seen = BTreeSet::new();
        self.stimuli.keys().filter(move |name| seen.insert(family(name)))
    }

    /// One stimulus of every kind: of those that come from one in the grammar, one for each set of needs.
    #[must_use]
    pub fn kinds(&self) -> Vec<(&str, &Stimulus)> {
        let mut seen = BTreeSet::new();
        let all = self.stimuli.iter().map(|(name, stimulus)| (name.as_str(), stimulus));
        all.filter(|&(name, stimulus)| seen.insert((family(name), &stimulus.needs)))
            .collect()
    }

    /// Leaves out every stimulus of the kind of this one.
    pub(super) fn leave_out(&mut self, name: &str) {
        let Some(needs) = self.stimuli.get(name).map(|stimulus| stimulus.needs.clone()) else {
            return;
        };
        self.stimuli
            .retain(|other, stimulus| family(other) != family(name) || stimulus.needs != needs);
    }

    /// Whether it says how devices of a protocol version are spoken to.
    #[must_use]
    pub fn speaks(&self, pack: &Pack) -> bool {
        let range = self.spec.parse::<VersionRange>();
        range.is_ok_and(|range| range.contains(pack.version))
    }

    /// The side it is for, in the word of a test.
    #[must_use]
    pub fn side(&self) -> &str {
        &self.explore
    }

    /// The role of the side it is for.
    #[must_use]
    pub fn role(&self) -> Role {
        if self.explore == Role::MasterControl.word() {
            Role::MasterControl
        } else {
            Role::Agv
        }
    }

    /// The node at a place of the way.
    #[must_use]
    pub fn node(&self, place: usize) -> &str {
        let turn = 2 * (self.nodes.len() - 1);
        let at = place % turn;
        &self.nodes[if at < self.nodes.len() { at } else { turn - at }]
    }
}

fn parsed<T: DeserializeOwned>(path: &str, text: &str) -> Result<T, GrammarError> {
    let tree = yaml::tree(&Source::new(path, text)).map_err(|all| {
        let all: Vec<String> = all.iter().map(ToString::to_string).collect();
        unreadable(path, all.join("; "))
    })?;
    serde_json::from_value(yaml::value(&tree)).map_err(|error| unreadable(path, error.to_string()))
}

fn unreadable(path: &str, reason: String) -> GrammarError {
    GrammarError::Unreadable {
        path: path.to_owned(),
        reason,
    }
}
