//! What rests on a person's word: no message shows it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Something that a test rests on and that only a person says.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OnWord {
    /// The test.
    pub test: String,
    /// How it was said.
    pub kind: WordKind,
    /// What was asked of the person, or what the profile claims.
    pub what: String,
}

/// How a person has said something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WordKind {
    /// A prompt was answered: it is done.
    Answer,
    /// The profile claims a capability that the factsheet does not list.
    Claim,
}

/// In one line, of what a device or a profile may have chosen: not clean, and not escaped for a format.
impl fmt::Display for OnWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            WordKind::Answer => write!(f, "a person answered that this is done: {}", self.what),
            WordKind::Claim => write!(f, "the profile claims it, and no factsheet lists it: {}", self.what),
        }
    }
}
