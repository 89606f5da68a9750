//! The parts that a result was joined from, and what keeps them from being all of it.

use std::fmt;

use serde::{Deserialize, Serialize};

use tck_base::verdict::Verdict;

/// The parts of a run that were joined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct MergedRun {
    /// Into how many parts the whole was divided.
    pub of: usize,
    /// The parts that were given, by their numbers; those that do not belong to it, too.
    pub parts: Vec<MergedPart>,
    /// Why it is not the whole, or not certain to be; nothing when every part is there once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub troubles: Vec<MergeTrouble>,
}

impl MergedRun {
    /// The parts in which a test was run.
    #[must_use]
    pub fn of_test(&self, id: &str) -> Vec<usize> {
        let own = self.parts.iter().filter(|part| part.counts);
        let own = own.filter(|part| part.tests.iter().any(|test| test == id));
        own.map(|part| part.index).collect()
    }
}

/// One part, and where its evidence is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct MergedPart {
    /// Which part, counted from 1; 0 of what is no part.
    pub index: usize,
    /// Identifier of its run.
    pub run: String,
    /// Start in UTC, RFC 3339 with milliseconds.
    pub started: String,
    /// Length in seconds.
    pub seconds: f64,
    /// Serial number of its device.
    pub serial_number: String,
    /// Its own verdict.
    pub verdict: Option<Verdict>,
    /// Whether it belongs to the whole and is joined.
    pub counts: bool,
    /// The tests that it ran.
    pub tests: Vec<String>,
    /// Where its bundle was when it was joined.
    pub bundle: String,
    /// Name of its journal in the bundle.
    pub journal: String,
    /// Length of the journal in bytes.
    pub journal_bytes: u64,
    /// SHA-256 of the journal, in hexadecimal.
    pub journal_sha256: String,
    /// Root hash of its bundle; absent when it has no manifest, as after a crash.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub root: Option<String>,
}

/// Of which kind something is that keeps joined parts from being the whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TroubleKind {
    /// A part was not given.
    Missing,
    /// A part did not come to its end.
    Partial,
    /// A part was given more than once, with different evidence.
    Duplicate,
    /// Something was given that is no part of it.
    Foreign,
}

impl TroubleKind {
    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Partial => "partial",
            Self::Duplicate => "duplicate",
            Self::Foreign => "foreign",
        }
    }
}

/// Something that keeps joined parts from being the whole.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct MergeTrouble {
    /// Of which kind.
    pub kind: TroubleKind,
    /// Which part it is about, counted from 1; 0 of what is no part.
    pub index: usize,
    /// What it is, in one sentence without its end.
    pub text: String,
}

impl fmt::Display for MergeTrouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// The parts of an audit or a qualification that were joined.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct MergedParts {
    /// Into how many parts the whole was divided.
    pub of: usize,
    /// The parts that were given, by their numbers; those that do not belong to it, too.
    pub parts: Vec<MergedBundle>,
    /// Why it is not the whole; nothing when every part is there once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub troubles: Vec<MergeTrouble>,
}

/// One part of an audit or a qualification.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct MergedBundle {
    /// Which part, counted from 1; 0 of what is no part.
    pub index: usize,
    /// Whether it belongs to the whole and is joined.
    pub counts: bool,
    /// Its own verdict.
    pub verdict: Option<Verdict>,
    /// How many vehicles or faults it has tried.
    pub size: usize,
    /// Where its bundle was when it was joined.
    pub bundle: String,
    /// SHA-256 of its result, in hexadecimal.
    pub sha256: String,
}
