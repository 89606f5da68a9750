//! What was said in the conversations of a run, in which situations, and what came of it.

use serde::{Deserialize, Serialize};

/// The conversations of an exploration, counted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct ExplorationResult {
    /// Every stimulus that was said in a situation.
    pub said: Vec<SaidResult>,
    /// Every member that was broken in a way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<MemberResult>,
}

/// A stimulus in a situation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct SaidResult {
    /// What the conversation had come to.
    pub situation: String,
    /// What was said.
    pub stimulus: String,
    /// What came of it.
    pub answers: Answers,
}

/// A member of a message that was broken in one way.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct MemberResult {
    /// The stimulus that broke it.
    pub stimulus: String,
    /// Its path in the message.
    pub member: String,
    /// How it was broken.
    pub way: String,
    /// What came of it.
    pub answers: Answers,
}

/// How often the device answered in which manner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Answers {
    /// As the standard demands.
    pub as_demanded: usize,
    /// Otherwise: a requirement is broken, or a remark is due.
    pub broken: usize,
    /// In a manner that decides nothing.
    pub undecided: usize,
}

impl Answers {
    /// How often it was said.
    #[must_use]
    pub fn tried(self) -> usize {
        self.as_demanded + self.broken + self.undecided
    }
}
