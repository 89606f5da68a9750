//! What is judged by, and why a journal cannot be judged.

use std::sync::Arc;

use tck_check::Check;
use tck_pack::{Catalogue, Hooks, Packs};
use tck_suite::Suites;

/// The rules a run is judged by.
#[derive(Clone)]
pub struct Rules {
    /// The named checks that tests and monitors refer to.
    pub checks: &'static [Check],
    /// All protocol versions.
    pub packs: Arc<Packs>,
    /// The requirements.
    pub catalogue: Arc<Catalogue>,
    /// What can be done to a device, and what follows from it.
    pub hooks: Arc<Hooks>,
    /// Tests and monitors.
    pub suites: Arc<Suites>,
    /// SHA-256 over suites, schemas and requirements.
    pub sha256: String,
}

/// Why a journal cannot be judged.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum JudgeError {
    /// It does not begin with `RunBegun`.
    #[error("the journal does not begin with the record of a run")]
    NoHeader,
    /// It was made for a protocol version this program does not have.
    #[error("the journal is about protocol version {0}, which this program does not have")]
    Version(String),
    /// It is about a side of the interface nobody knows.
    #[error("the journal is about the role `{0}`, which there is not")]
    Role(String),
    /// A run goes on in it with one that was about something else.
    #[error("the journal goes on with a run about another device, version or vantage, or with other suites")]
    AnotherRun,
    /// It names a test the suites do not have.
    #[error("the journal names the test `{0}`, which the suites do not have")]
    UnknownTest(String),
}
