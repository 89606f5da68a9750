//! A journal of a run, judged again.

use std::path::Path;

use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_journal::{Journal, file};
use tck_judge::{self as judge, Library};
use tck_result::RunResult;

/// What the journal of a run says, judged again; with the folder of the run, and where its journal is.
pub(super) fn judged(
    library: &Library,
    journal: &Journal,
    (folder, path): (&Path, &Path),
) -> Result<RunResult, Problem> {
    let wrong = |why: &dyn std::fmt::Display| {
        Problem::from(Diagnostic::whole("journal", format!("{}: {why}", folder.display())))
    };
    let mut result = judge::judge(&library.rules, journal.entries()).map_err(|error| wrong(&error))?;
    if let Some(lost) = journal.lost() {
        return Err(wrong(lost));
    }
    result.journal = file::name_of(path);
    Ok(result)
}
