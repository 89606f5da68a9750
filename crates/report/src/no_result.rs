//! A run that never came to be: the command line, the profile, a suite or the bench stood in its way. What a pipeline reads is
//! written all the same, and is red, so that nobody takes the file of an earlier run for this one.

use std::fmt::Write as _;

use serde_json::json;

use super::cases::{Case, NOT_APPLICABLE, RUN_CASE, RUN_SUITE};
use super::clean::{block, line};
use super::junit::{self, JunitError, Plain};
use super::markdown_table::cell as escaped;
use tck_base::verdict::Verdict;

/// A run without a result.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NoResult {
    /// Name and version of the tool.
    pub tool: String,
    /// The exit code of the process.
    pub exit: u8,
    /// What that code means.
    pub meaning: String,
    /// The profile, if one was named.
    pub profile: Option<String>,
    /// What stood in the way; at least one.
    pub problems: Vec<Obstacle>,
}

/// One thing that stood in the way of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Obstacle {
    /// What it is, in one line.
    pub title: String,
    /// The title with place and hint, as the terminal shows it.
    pub text: String,
    /// File and line, where it stands in one.
    pub place: Option<(String, usize)>,
}

impl NoResult {
    fn titles(&self) -> String {
        let titles: Vec<&str> = self.problems.iter().map(|problem| problem.title.as_str()).collect();
        titles.join("; ")
    }

    fn texts(&self) -> String {
        let texts: Vec<&str> = self.problems.iter().map(|problem| problem.text.as_str()).collect();
        texts.join("\n\n")
    }

    /// The case of the run, red.
    pub(super) fn case(&self) -> Case<'_> {
        Case {
            suite: RUN_SUITE,
            name: RUN_CASE.to_owned(),
            title: "",
            seconds: 0.0,
            verdict: Some(Verdict::Error),
            absent: NOT_APPLICABLE,
            elsewhere: None,
            kind: "",
            message: self.titles(),
            details: self.texts(),
            remark: None,
            requirements: Vec::new(),
            test: None,
        }
    }

    /// JUnit XML: the case of the run, red.
    ///
    /// # Errors
    /// When the XML writer refuses; it has no reason to.
    pub fn junit(&self) -> Result<String, JunitError> {
        junit::plain(&[Plain {
            suite: RUN_SUITE.to_owned(),
            name: RUN_CASE.to_owned(),
            verdict: Verdict::Error,
            elsewhere: None,
            // The first line becomes the message of the case.
            text: format!("{}\n\n{}", self.titles(), self.texts()),
        }])
    }

    /// JSON in the place of a statement: no reader of statements takes it for one.
    #[must_use]
    pub fn no_statement(&self) -> String {
        let nothing = json!({
            "noResult": { "tool": line(&self.tool), "exit": self.exit, "meaning": line(&self.meaning), "why": line(&self.titles()) },
        });
        format!("{nothing:#}\n")
    }

    /// Markdown for a summary page.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text = format!("## NO RESULT\n\nExit code {}: {}.\n", self.exit, escaped(&self.meaning));
        for problem in &self.problems {
            let _ = write!(text, "\n- {}", escaped(&problem.title));
            if let Some((file, at)) = &problem.place {
                let _ = write!(text, " ({}:{at})", escaped(&line(file)));
            }
        }
        text.push('\n');
        text
    }

    /// Workflow commands of GitHub: an annotation for each problem, at its place.
    #[must_use]
    pub fn annotations(&self) -> String {
        let mut text = String::new();
        for problem in self.problems.iter().take(super::markdown::ANNOTATIONS) {
            let place = match (&problem.place, &self.profile) {
                (Some((file, line)), _) => format!("file={},line={line},", super::markdown::property(file)),
                (None, Some(file)) => format!("file={},", super::markdown::property(file)),
                (None, None) => String::new(),
            };
            let message = super::markdown::command(&block(&problem.title));
            let _ = writeln!(text, "::error {place}title=vda5050-tck::{message}");
        }
        text
    }
}
