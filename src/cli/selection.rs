//! Which tests are run: by what they decide, by what is left out, and by what failed before.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use super::args::SelectionArgs;
use super::problem::Problem;
use super::select::{matches, select};
use tck_base::diagnostic::{self, Diagnostic};
use tck_base::verdict::Verdict;
use tck_judge::Library;
use tck_pack::Pack;
use tck_report::json;
use tck_report::sources::Sources;
use tck_run::{newest, sources};
use tck_suite::model::Test;

/// The tests that patterns and flags select of all, in their order.
pub(super) fn selected(
    all: &[Arc<Test>],
    patterns: &[String],
    wanted: &SelectionArgs,
    reports: &Path,
    library: &Library,
    pack: &Pack,
) -> Result<Vec<Arc<Test>>, Problem> {
    let mut tests = select(all, patterns)?;
    if !wanted.requirement.is_empty() || !wanted.chapter.is_empty() {
        let quoted = sources(&library.rules.catalogue, &library.rules.suites, pack);
        let mut ids = BTreeSet::new();
        for pattern in &wanted.requirement {
            ids.extend(requirements(&quoted, pattern)?);
        }
        for title in &wanted.chapter {
            ids.extend(chapter(&quoted, title)?);
        }
        tests.retain(|test| test.requirements().iter().any(|id| ids.contains(id.as_str())));
        if tests.is_empty() {
            let title = "no selected test decides one of these requirements (`vda5050-tck explain ID` says what does)";
            return Err(Problem::NothingToDo(title.to_owned()));
        }
    }
    for filter in &wanted.filter {
        let quoted = sources(&library.rules.catalogue, &library.rules.suites, pack);
        tests = super::expression::meant(filter, all, &tests, &quoted)?;
        if tests.is_empty() {
            let title = format!("`--filter {filter}` holds for none of the selected tests");
            return Err(Problem::NothingToDo(title));
        }
    }
    if wanted.last_failed {
        let failed = failed_before(&newest(reports))?;
        tests.retain(|test| failed.contains(test.id.as_str()));
        if tests.is_empty() {
            let title =
                "of the selected tests none failed in the latest run; what monitors found is judged in every run";
            return Err(Problem::NothingToDo(title.to_owned()));
        }
    }
    if !wanted.exclude.is_empty() {
        let without = select(all, &wanted.exclude)?;
        tests.retain(|test| without.iter().all(|other| other.id != test.id));
    }
    Ok(tests)
}

/// The requirements that are meant: by id, by the beginning of an id, or with `*` for anything.
fn requirements(quoted: &Sources, pattern: &str) -> Result<Vec<String>, Diagnostic> {
    let begins = |id: &str| id.strip_prefix(pattern).is_some_and(|rest| rest.starts_with('-'));
    let known = quoted.requirements.iter().map(|requirement| requirement.id.as_str());
    let meant: Vec<String> = known
        .clone()
        .filter(|id| matches(pattern, id) || begins(id))
        .map(str::to_owned)
        .collect();
    if meant.is_empty() {
        let hint = match diagnostic::closest(pattern, known) {
            Some(close) => format!("did you mean `{close}`?"),
            None => "`vda5050-tck list requirements` shows them all".to_owned(),
        };
        let title = format!("no requirement matches `{pattern}`");
        return Err(Diagnostic::whole("unknown-requirement", title).hint(hint));
    }
    Ok(meant)
}

/// The requirements of the chapters whose title has a text.
fn chapter(quoted: &Sources, text: &str) -> Result<Vec<String>, Diagnostic> {
    let wanted = text.to_lowercase();
    let all = quoted.requirements.iter();
    let meant: Vec<String> = all
        .filter(|requirement| requirement.chapter.to_lowercase().contains(&wanted))
        .map(|requirement| requirement.id.clone())
        .collect();
    if meant.is_empty() {
        let chapters: BTreeSet<&str> = quoted.requirements.iter().map(|one| one.chapter.as_str()).collect();
        let chapters: Vec<&str> = chapters.into_iter().collect();
        let title = format!("no chapter has `{text}` in its title");
        return Err(Diagnostic::whole("unknown-chapter", title).hint(format!("there are: {}", chapters.join("; "))));
    }
    Ok(meant)
}

/// The ids of the tests that failed or broke in a finished run.
fn failed_before(folder: &Path) -> Result<BTreeSet<String>, Diagnostic> {
    let path = folder.join("result.json");
    let result = json::read(&path).map_err(|error| {
        let title = format!("there is no latest run to take failures from: {error}");
        Diagnostic::whole("result", title)
            .hint("run without --last-failed first, or give its folder of reports with --out")
    })?;
    let failed = result
        .tests
        .iter()
        .filter(|test| matches!(test.verdict, Some(Verdict::Fail | Verdict::Error)));
    Ok(failed.map(|test| test.id.clone()).collect())
}
