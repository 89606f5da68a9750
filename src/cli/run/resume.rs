//! `run --resume`: goes on with a run that broke off.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_journal::Journal;
use tck_journal::event::{Event, RunHeader};
use tck_journal::file::{self, Recording};
use tck_judge as judge;
use tck_judge::Library;
use tck_pack::{Pack, Participant};
use tck_suite::model::Test;

/// A run that broke off.
#[derive(Debug)]
pub(super) struct Earlier {
    /// Its records.
    pub journal: Journal,
    /// Where they lie.
    pub path: PathBuf,
    /// What it was about.
    header: RunHeader,
    /// The tests that it has left.
    pub tests: Vec<Arc<Test>>,
    /// Whether its plan was made of every test.
    pub complete: bool,
    /// How many tests are kept.
    pub kept: usize,
}

impl Earlier {
    /// Reads a bundle.
    pub(super) fn read(folder: &Path, all: &[Arc<Test>], library: &Library) -> Result<Self, Problem> {
        let wrong = |title: String| Problem::from(Diagnostic::whole("resume", title));
        let path = file::find(folder);
        let Recording { journal, torn } = file::read(&path).map_err(|error| wrong(error.to_string()))?;
        if torn {
            eprintln!("the last line of the journal is cut off, as after a crash; everything before it is used");
        }
        let headers = journal.entries().iter().rev().filter_map(|entry| match entry.event() {
            Event::RunBegun { header } => Some((**header).clone()),
            _ => None,
        });
        let header = headers.into_iter().next();
        let header = header.ok_or_else(|| wrong(format!("{}: there is no run in it", path.display())))?;
        let mut plans = journal.entries().iter().filter_map(|entry| match entry.event() {
            Event::Planned { plan } => Some(plan),
            _ => None,
        });
        let Some(plan) = plans.next() else {
            let title = format!("{}: the run broke off before it had a plan", folder.display());
            return Err(Diagnostic::whole("resume", title).hint("run it anew").into());
        };
        let complete = plan.complete;
        let judged = judge::judged(&library.rules, journal.entries());
        let judged = judged.map_err(|error| wrong(format!("{}: {error}", folder.display())))?;
        let result = judged.result();
        if !result.partial {
            let why = format!("the run in {} came to its end: nothing is left of it", folder.display());
            return Err(Problem::NothingToDo(why));
        }
        let left = judged.left();
        let known = left.iter().filter_map(|id| all.iter().find(|test| test.id == *id));
        let tests: Vec<Arc<Test>> = known.cloned().collect();
        if tests.is_empty() {
            let why = format!("every planned test of the run in {} is decided", folder.display());
            return Err(Problem::NothingToDo(why));
        }
        Ok(Self {
            kept: result.tests.len().saturating_sub(tests.len()),
            journal,
            path,
            header,
            tests,
            complete,
        })
    }

    /// Refuses to join what is about something else.
    pub(super) fn is_about(
        &self,
        subject: &Participant,
        pack: &Pack,
        library: &Library,
        vantage: &str,
    ) -> Result<(), Problem> {
        let header = &self.header;
        let now = [
            ("manufacturer", &header.manufacturer, &subject.manufacturer),
            ("serial number", &header.serial_number, &subject.serial_number),
            ("role", &header.role, &subject.role.word().to_owned()),
            ("protocol version", &header.protocol, &pack.version.to_string()),
            ("vantage", &header.vantage, &vantage.to_owned()),
            ("hash of the suites", &header.suites, &library.rules.sha256),
        ];
        let differs = now.into_iter().find(|(_, before, now)| before != now);
        let Some((what, before, now)) = differs else {
            return Ok(());
        };
        let title = format!("the run cannot be resumed: its {what} was `{before}`, and is `{now}` now");
        let hint = "give the flags and the profile of that run; what is joined has to be about one thing";
        Err(Diagnostic::whole("resume", title).hint(hint).into())
    }
}
