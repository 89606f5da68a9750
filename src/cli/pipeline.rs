//! What a pipeline asks for by its environment: annotations and a summary page.

use std::io::Write as _;

use tck_report::markdown;
use tck_report::no_result::NoResult;
use tck_report::sources::Sources;
use tck_result::RunResult;

/// Names the file of the summary page of a step, on GitHub.
const SUMMARY: &str = "GITHUB_STEP_SUMMARY";
/// Set to `true` on GitHub.
const ACTIONS: &str = "GITHUB_ACTIONS";

/// Tells the pipeline about a run. A page that cannot be written changes no verdict.
pub(super) fn tell(result: &RunResult, sources: &Sources, report: &str) {
    if std::env::var(ACTIONS).is_ok_and(|value| value == "true") {
        eprint!("{}", markdown::annotations(result, sources));
    }
    append(&markdown::summary(result, sources, Some(report)));
}

/// Tells the pipeline that nothing came of a command; the summary page is for commands that test.
pub(super) fn tell_of_nothing(nothing: &NoResult, tests: bool) {
    if std::env::var(ACTIONS).is_ok_and(|value| value == "true") {
        super::tell(nothing.annotations().trim_end());
    }
    if tests {
        append(&nothing.markdown());
    }
}

/// Appends to the summary page.
fn append(page: &str) {
    let Some(path) = std::env::var_os(SUMMARY).filter(|path| !path.is_empty()) else {
        return;
    };
    let page = format!("{page}\n");
    let file = std::fs::OpenOptions::new().append(true).create(true).open(&path);
    if let Err(error) = file.and_then(|mut file| file.write_all(page.as_bytes())) {
        eprintln!(
            "the summary page {} ({SUMMARY}) cannot be written: {error}",
            path.display()
        );
    }
}
