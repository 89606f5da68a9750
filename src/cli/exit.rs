//! Exit codes, and which one a verdict means.

use tck_base::verdict::Verdict;

/// What the process says to the script that started it. A code never means two things.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Exit {
    /// The device conforms: everything that was decided passed, warnings included.
    Conforms,
    /// The device does not conform: at least one requirement is broken.
    DoesNotConform,
    /// The command line, the profile or a suite is wrong; nothing was judged.
    Usage,
    /// Nothing failed, but something could not be decided.
    Undecided,
    /// No test was selected, or none of those selected applies to the device.
    NothingToDo,
    /// The harness, its broker or its host broke.
    Broken,
    /// Somebody interrupted it.
    Interrupted,
}

impl Exit {
    /// Every exit there is.
    pub const ALL: [Self; 7] = [
        Self::Conforms,
        Self::DoesNotConform,
        Self::Usage,
        Self::Undecided,
        Self::NothingToDo,
        Self::Broken,
        Self::Interrupted,
    ];

    /// The exit code.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::Conforms => 0,
            Self::DoesNotConform => 1,
            Self::Usage => 2,
            Self::Undecided => 3,
            Self::NothingToDo => 4,
            Self::Broken => 5,
            Self::Interrupted => 130,
        }
    }

    /// What it means, for `--help`.
    #[must_use]
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Conforms => "conforms",
            Self::DoesNotConform => "does not conform",
            Self::Usage => "usage, profile or suite wrong",
            Self::Undecided => "undecided: no failure, but something inconclusive",
            Self::NothingToDo => "nothing selected or applicable",
            Self::Broken => "the harness or its environment broke",
            Self::Interrupted => "interrupted",
        }
    }

    /// The exit of a run that came to its end. `None` is a run that decided nothing.
    #[must_use]
    pub fn of(verdict: Option<Verdict>) -> Self {
        match verdict {
            Some(Verdict::Pass | Verdict::Warning) => Self::Conforms,
            Some(Verdict::Fail) => Self::DoesNotConform,
            Some(Verdict::Inconclusive) => Self::Undecided,
            Some(Verdict::Error) => Self::Broken,
            None => Self::NothingToDo,
        }
    }

    /// The exit of a run that was interrupted or broke down after deciding this much. A failure stands on
    /// its evidence; anything else says nothing about the tests that did not run.
    #[must_use]
    pub fn of_partial(verdict: Option<Verdict>, interrupted: bool) -> Self {
        match (verdict, interrupted) {
            (_, true) => Self::Interrupted,
            (Some(Verdict::Fail), false) => Self::DoesNotConform,
            (_, false) => Self::Broken,
        }
    }
}

impl From<Exit> for std::process::ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit.code())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_run_that_decided_something_and_broke_nothing_exits_with_zero() {
        let zero = |exit: Exit| exit.code() == 0;
        assert!(
            Verdict::ALL
                .into_iter()
                .all(|verdict| zero(Exit::of(Some(verdict))) == matches!(verdict, Verdict::Pass | Verdict::Warning))
        );
        assert!(!zero(Exit::of(None)));
        for verdict in Verdict::ALL.map(Some).into_iter().chain([None]) {
            assert!(!zero(Exit::of_partial(verdict, true)) && !zero(Exit::of_partial(verdict, false)));
        }
    }

    #[test]
    fn a_worse_verdict_never_looks_better() {
        // Of a failure and a breakdown the failure is what counts, so the codes follow the lattice but for that.
        assert_eq!(Exit::of(Some(Verdict::Fail.join(Verdict::Error))), Exit::DoesNotConform);
        assert_eq!(Exit::of(Some(Verdict::Error.join(Verdict::Inconclusive))), Exit::Broken);
        assert_eq!(Exit::of_partial(Some(Verdict::Fail), false), Exit::DoesNotConform);
    }

    #[test]
    fn no_two_exits_share_a_code() {
        let mut codes: Vec<u8> = Exit::ALL.into_iter().map(Exit::code).collect();
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes, [0, 1, 2, 3, 4, 5, 130]);
    }
}
