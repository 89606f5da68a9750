//! The verdict lattice.
//!
//! A verdict can only get worse: the one way to combine two verdicts is [`Verdict::join`], and the one
//! way to change an [`Accumulated`] verdict is to join another onto it. Nothing here can lower one.
//! Whether a test applies at all is decided before it runs and stands apart, in [`Outcome`].

use serde::{Deserialize, Serialize};

/// What a decision says about a requirement, worst last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The obligation was seen to be met.
    Pass,
    /// A `should` was broken, or a ruling of the catalogue asks for a remark.
    Warning,
    /// The precondition was not reached or the fact could not be observed.
    Inconclusive,
    /// Our own trouble: broker, suite or host.
    Error,
    /// A `shall` was broken. Stands whatever happens afterwards.
    Fail,
}

impl Verdict {
    /// All verdicts, best first.
    pub const ALL: [Self; 5] = [Self::Pass, Self::Warning, Self::Inconclusive, Self::Error, Self::Fail];

    /// The worse of the two; associative, commutative and idempotent.
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        self.max(other)
    }

    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Warning => "warning",
            Self::Inconclusive => "inconclusive",
            Self::Error => "error",
            Self::Fail => "fail",
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.word())
    }
}

/// A verdict under construction. Empty at first, and then only ever worse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Accumulated(Option<Verdict>);

impl Accumulated {
    /// Joins one more decision onto this one.
    pub fn add(&mut self, verdict: Verdict) {
        self.0 = Some(self.0.map_or(verdict, |have| have.join(verdict)));
    }

    /// The verdict so far; `None` while nothing was decided.
    #[must_use]
    pub fn get(self) -> Option<Verdict> {
        self.0
    }
}

impl FromIterator<Verdict> for Accumulated {
    fn from_iter<T: IntoIterator<Item = Verdict>>(iter: T) -> Self {
        let mut all = Self::default();
        iter.into_iter().for_each(|verdict| all.add(verdict));
        all
    }
}

/// What became of a test: judged, or set aside before it ran.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The test ran and this is the join of its decisions.
    Judged(Verdict),
    /// The device declares that it lacks what the test needs; the text says what.
    NotApplicable(String),
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_verdict() -> impl Strategy<Value = Verdict> {
        prop::sample::select(Verdict::ALL.to_vec())
    }

    proptest! {
        #[test]
        fn no_sequence_of_decisions_lowers_a_verdict(decisions in prop::collection::vec(any_verdict(), 1..40)) {
            let mut all = Accumulated::default();
            for decision in decisions {
                let before = all.get();
                all.add(decision);
                prop_assert!(all.get() >= before);
                prop_assert!(all.get() >= Some(decision));
            }
        }

        #[test]
        fn join_is_a_semilattice(a in any_verdict(), b in any_verdict(), c in any_verdict()) {
            prop_assert_eq!(a.join(b), b.join(a));
            prop_assert_eq!(a.join(a), a);
            prop_assert_eq!(a.join(b).join(c), a.join(b.join(c)));
        }
    }
}
