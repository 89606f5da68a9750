//! Which tests are run: by name, by what they decide, by what is left out, and by what failed before.

mod expression;
mod pattern;

use std::collections::BTreeSet;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::latest::newest;
use super::outputs::sources;
use tck_base::diagnostic::{self, Diagnostic};
use tck_base::verdict::Verdict;
use tck_judge::Library;
use tck_pack::Pack;
use tck_report::json;
use tck_report::sources::Sources;
use tck_suite::model::Test;

pub use expression::meant;
pub use pattern::{matches, select};

/// The tests of a run in their order, and whether these are all that there are. A test that is taken away is remembered:
/// the report of a selection never claims the whole suite.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    tests: Vec<Arc<Test>>,
    partial: bool,
}

impl Selection {
    /// Every test there is.
    #[must_use]
    pub fn all(tests: Vec<Arc<Test>>) -> Self {
        Self { tests, partial: false }
    }

    /// Some of the tests, or others than there are.
    #[must_use]
    pub fn some(tests: Vec<Arc<Test>>) -> Self {
        Self { tests, partial: true }
    }

    /// Keeps the tests for which this holds.
    pub fn retain(&mut self, mut keeps: impl FnMut(&Test) -> bool) {
        let before = self.tests.len();
        self.tests.retain(|test| keeps(test));
        self.partial |= self.tests.len() < before;
    }

    /// Whether every test is among them.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        !self.partial
    }

    /// The tests.
    #[must_use]
    pub fn into_tests(self) -> Vec<Arc<Test>> {
        self.tests
    }
}

impl Deref for Selection {
    type Target = [Arc<Test>];

    fn deref(&self) -> &Self::Target {
        &self.tests
    }
}

impl<'a> IntoIterator for &'a Selection {
    type Item = &'a Arc<Test>;
    type IntoIter = std::slice::Iter<'a, Arc<Test>>;

    fn into_iter(self) -> Self::IntoIter {
        self.tests.iter()
    }
}

/// By what tests are selected; all of it has to hold. Without any of it every test is.
#[derive(Clone, Debug, Default)]
pub struct Criteria {
    /// The id matches one of these: an id, a group or table, or `*` for anything.
    pub patterns: Vec<String>,
    /// The test decides one of these requirements, by id or by the beginning of ids.
    pub requirements: Vec<String>,
    /// The test decides a requirement of a chapter with one of these in its title.
    pub chapters: Vec<String>,
    /// All of these expressions hold, such as `chapter(6.6) and not tag(moves)`.
    pub filters: Vec<String>,
    /// The id matches none of these.
    pub exclude: Vec<String>,
    /// The test failed or broke in the latest run below this folder.
    pub failed_in: Option<PathBuf>,
}

/// Why tests cannot be selected.
#[derive(Debug, thiserror::Error)]
pub enum SelectionError {
    /// A name or an expression is wrong.
    #[error("{0}")]
    Wrong(Box<Diagnostic>),
    /// It is right, and holds for no test.
    #[error("{0}")]
    Nothing(String),
}

impl From<Diagnostic> for SelectionError {
    fn from(wrong: Diagnostic) -> Self {
        Self::Wrong(Box::new(wrong))
    }
}

impl Criteria {
    /// The tests among all for which it holds, in their order.
    ///
    /// # Errors
    /// When a part of it means nothing that there is, or holds for no test: neither may look like a small, green run.
    pub fn among(&self, all: &[Arc<Test>], library: &Library, pack: &Pack) -> Result<Selection, SelectionError> {
        let mut tests = Selection::all(all.to_vec());
        if !self.patterns.is_empty() {
            select(all, &self.patterns)?;
            tests.retain(|test| self.patterns.iter().any(|pattern| matches(pattern, &test.id)));
        }
        let quoted = || sources(library, pack);
        if !self.requirements.is_empty() || !self.chapters.is_empty() {
            let quoted = quoted();
            let mut ids = BTreeSet::new();
            for pattern in &self.requirements {
                ids.extend(requirements(&quoted, pattern)?);
            }
            for title in &self.chapters {
                ids.extend(chapter(&quoted, title)?);
            }
            tests.retain(|test| test.requirements().iter().any(|id| ids.contains(id.as_str())));
            if tests.is_empty() {
                let title =
                    "no selected test decides one of these requirements (`vda5050-tck explain ID` says what does)";
                return Err(SelectionError::Nothing(title.to_owned()));
            }
        }
        for filter in &self.filters {
            let own = meant(filter, all, &tests, &quoted())?;
            let own: BTreeSet<&str> = own.iter().map(|test| test.id.as_str()).collect();
            tests.retain(|test| own.contains(test.id.as_str()));
            if tests.is_empty() {
                let title = format!("`--filter {filter}` holds for none of the selected tests");
                return Err(SelectionError::Nothing(title));
            }
        }
        if let Some(reports) = &self.failed_in {
            let failed = failed_before(&newest(reports))?;
            tests.retain(|test| failed.contains(test.id.as_str()));
            if tests.is_empty() {
                let title =
                    "of the selected tests none failed in the latest run; what monitors found is judged in every run";
                return Err(SelectionError::Nothing(title.to_owned()));
            }
        }
        if !self.exclude.is_empty() {
            select(all, &self.exclude)?;
            tests.retain(|test| !self.exclude.iter().any(|pattern| matches(pattern, &test.id)));
        }
        Ok(tests)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use tck_pack::Role;

    #[test]
    fn a_selection_of_which_something_was_taken_away_is_not_complete() {
        let library = tck_testing::library();
        let pack = library.rules.packs.latest();
        let all = library.tests(Role::Agv, &pack.id);
        let whole = Criteria::default().among(&all, library, pack).unwrap();
        assert!(whole.is_complete() && whole.len() == all.len());
        let mut some = whole.clone();
        some.retain(|_| true);
        assert!(some.is_complete());
        some.retain(|test| test.id.starts_with("order-rejection/"));
        assert!(!some.is_complete() && !some.is_empty());
        let named = Criteria {
            patterns: vec!["order-rejection".to_owned()],
            ..Criteria::default()
        };
        let named = named.among(&all, library, pack).unwrap();
        assert_eq!((named.len(), named.is_complete()), (some.len(), false));
        let mistyped = Criteria {
            patterns: vec!["order-rejektion".to_owned()],
            ..Criteria::default()
        };
        assert!(matches!(
            mistyped.among(&all, library, pack),
            Err(SelectionError::Wrong(_))
        ));
    }
}
