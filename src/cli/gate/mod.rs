//! The gate: which exit a run means for the pipeline that started it.
//!
//! One sentence holds for it, and its tests try every combination of what can come of a run: it lets through only when every
//! selected test that applies was carried out on the device that was started, and was decided. Nothing else in the program
//! gives a run its exit.

use super::exit::Exit;
use tck_base::verdict::Verdict;
use tck_profile::KnownFailure;
use tck_report::known::{Measured, measure};
use tck_report::statement;
use tck_result::RunResult;
use tck_run::End;

/// What came of a run.
pub(super) struct Gate<'a> {
    /// How it ended.
    pub(super) end: &'a End,
    /// What came out.
    pub(super) result: &'a RunResult,
    /// Failures that the profile bears; none where nothing may be borne.
    pub(super) known: &'a [KnownFailure],
    /// Whether everything that was asked for could be written.
    pub(super) written: bool,
}

impl Gate<'_> {
    /// The result, measured by the list of known failures.
    pub(super) fn measured(&self) -> Option<Measured> {
        (!self.known.is_empty()).then(|| measure(self.result, self.known))
    }

    /// The exit.
    pub(super) fn exit(&self) -> Exit {
        let verdict = self.result.verdict;
        match self.end {
            End::Interrupted => return Exit::of_partial(verdict, true),
            End::Stranger(_) | End::Changed(_) => return Exit::Usage,
            End::NoDevice(_) | End::Lost(_) | End::Flooded(_) | End::Broken(_) => {
                return Exit::of_partial(verdict, false);
            }
            End::Completed if self.result.partial || !self.written => return Exit::of_partial(verdict, false),
            End::Completed => {}
        }
        let exit = match (verdict, self.measured()) {
            (Some(Verdict::Fail), Some(measured)) => Exit::of(measured.rest),
            (verdict, _) => Exit::of(verdict),
        };
        // Verdicts are joined elsewhere; that nothing was left out on the way is held here once more.
        match exit {
            Exit::Conforms if statement::trouble(self.result).is_some() => Exit::Undecided,
            Exit::Conforms if !self.result.tests.iter().all(statement::is_settled) => Exit::Undecided,
            exit => exit,
        }
    }
}

#[cfg(test)]
mod tests;
