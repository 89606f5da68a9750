//! What is left out of a page that would be too large to be opened: first what shows how tests passed, then what happened in
//! undecided tests. What shows a failure, a remark or an error is never left out.

use std::collections::BTreeSet;

use crate::undecided;
use tck_base::verdict::Verdict;
use tck_result::RunResult;

/// The size from which on a page is thinned, in bytes.
pub const LARGE: usize = 4_800_000;

/// How much is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Thinning {
    /// Nothing.
    None,
    /// The steps of tests that passed.
    Passed,
    /// And what happened in undecided tests, but for the first one of each cause.
    Alike,
    /// And what happened in all undecided tests.
    Undecided,
}

impl Thinning {
    /// All of them, the mildest first.
    pub const ALL: [Self; 4] = [Self::None, Self::Passed, Self::Alike, Self::Undecided];

    /// What is said about it beside the tests.
    pub fn said(self) -> Option<&'static str> {
        match self {
            Self::None => None,
            Self::Passed => Some("the steps of tests that passed"),
            Self::Alike => Some(
                "the steps of tests that passed, and messages, diagrams and steps of undecided tests, except for the first test of each cause",
            ),
            Self::Undecided => {
                Some("the steps of tests that passed, and messages, diagrams and steps of undecided tests")
            }
        }
    }

    /// The tests whose evidence is left out.
    pub fn of(self, result: &RunResult) -> Thinned<'_> {
        let first: BTreeSet<&str> = match self {
            Self::Alike => undecided::groups(result)
                .iter()
                .filter_map(|group| group.tests.first().copied())
                .collect(),
            _ => BTreeSet::new(),
        };
        Thinned { how: self, first }
    }
}

/// Which tests a page is thinned by.
pub struct Thinned<'a> {
    how: Thinning,
    /// Undecided tests that are shown for all of their cause.
    first: BTreeSet<&'a str>,
}

impl Thinned<'_> {
    /// Whether steps, messages, diagram and source of a test are left out.
    pub fn leaves_out(&self, id: &str, verdict: Option<Verdict>) -> bool {
        match verdict {
            Some(Verdict::Pass) => self.how != Thinning::None,
            Some(Verdict::Inconclusive) => match self.how {
                Thinning::None | Thinning::Passed => false,
                Thinning::Alike => !self.first.contains(id),
                Thinning::Undecided => true,
            },
            _ => false,
        }
    }
}
