//! `run --resume`: goes on with a run that broke off.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_journal::Journal;
use tck_journal::event::{Event, RunHeader, Setting, ShardRecord};
use tck_journal::file::{self, Recording};
use tck_judge as judge;
use tck_judge::Library;
use tck_pack::{Pack, Participant};
use tck_run::Selection;
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
    /// The tests that it has left, which are complete if its plan was made of every test.
    pub tests: Selection,
    /// How many tests are kept.
    pub kept: usize,
    /// How often each of its tests was to be run.
    pub repeat: u32,
}

/// What to do about a run that is about something else.
pub(super) const ONE_THING: &str =
    "give the flags and the profile of that run, for the same device; what is joined has to be about one thing";

/// Where the device and people connect may change.
const WHERE: [&str; 2] = ["bench.listen", "bench.page"];

/// What a run is about, beside its suites.
pub(super) struct AboutRun<'a> {
    pub(super) subject: &'a Participant,
    pub(super) vantage: &'a str,
    pub(super) mode: Option<&'a str>,
    pub(super) settings: &'a [Setting],
    pub(super) files: &'a BTreeMap<String, String>,
}

impl Earlier {
    /// Reads the bundle of a run that broke off, or that had no time for all of its tests.
    pub(super) fn read(folder: &Path, all: &[Arc<Test>], library: &Library) -> Result<Self, Problem> {
        let wrong = |title: String| Problem::from(Diagnostic::whole("resume", title));
        // `latest` leads elsewhere once the next run begins.
        let folder = &folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let path = file::find(folder);
        let Recording { journal, torn } = file::read(&path).map_err(|error| wrong(error.to_string()))?;
        if torn {
            eprintln!("the last line of the journal is cut off, as after a crash; everything before it is used");
        }
        let headers = journal.beside_messages().rev().filter_map(|entry| match entry.event() {
            Event::RunBegun { header } => Some((**header).clone()),
            _ => None,
        });
        let header = headers.into_iter().next();
        let header = header.ok_or_else(|| wrong(format!("{}: there is no run in it", path.display())))?;
        let mut plans = journal.beside_messages().filter_map(|entry| match entry.event() {
            Event::Planned { plan } => Some((plan.complete, plan.repeat.unwrap_or(1))),
            _ => None,
        });
        let Some((complete, repeat)) = plans.next() else {
            let title = format!("{}: the run broke off before it had a plan", folder.display());
            return Err(Diagnostic::whole("resume", title).hint("run it anew").into());
        };
        drop(plans);
        let judged = judge::judged(&library.rules, journal.entries());
        let judged = judged.map_err(|error| wrong(format!("{}: {error}", folder.display())))?;
        if let Some(lost) = journal.lost() {
            return Err(wrong(lost.to_string()));
        }
        let result = judged.result();
        if !result.partial && !result.ran_out_of_time() {
            let why = format!("the run in {} came to its end: nothing is left of it", folder.display());
            return Err(Problem::NothingToDo(why));
        }
        let mut left = judged.left();
        if !result.partial {
            // What else could not be decided was tried.
            let untried = |id: &String| result.tests.iter().any(|test| test.id == *id && test.ran_out_of_time());
            left.retain(untried);
        }
        let known = left.iter().filter_map(|id| all.iter().find(|test| test.id == *id));
        let tests: Vec<Arc<Test>> = known.cloned().collect();
        if tests.is_empty() {
            let why = format!("every planned test of the run in {} is decided", folder.display());
            return Err(Problem::NothingToDo(why));
        }
        let kept = result.tests.len().saturating_sub(tests.len());
        let tests = if complete {
            Selection::all(tests)
        } else {
            Selection::some(tests)
        };
        Ok(Self {
            journal,
            path,
            header,
            tests,
            kept,
            repeat,
        })
    }

    /// Which part of a run it was.
    pub(super) fn part(&self) -> Option<ShardRecord> {
        self.header.shard.clone()
    }

    /// Refuses to join what is about something else.
    pub(super) fn is_about(&self, now: &AboutRun<'_>, pack: &Pack, library: &Library) -> Result<(), Problem> {
        let header = &self.header;
        let facts = [
            ("manufacturer", &header.manufacturer, &now.subject.manufacturer),
            ("serial number", &header.serial_number, &now.subject.serial_number),
            ("role", &header.role, &now.subject.role.word().to_owned()),
            ("protocol version", &header.protocol, &pack.version.to_string()),
            ("vantage", &header.vantage, &now.vantage.to_owned()),
            ("hash of the suites", &header.suites, &library.rules.sha256),
        ];
        if header.mode.as_deref() != now.mode {
            let command = |mode: Option<&str>| mode.unwrap_or("run").to_owned();
            let before = command(header.mode.as_deref());
            return Err(refused(format!(
                "it was made by `{before}`, and this is `{}`",
                command(now.mode)
            )));
        }
        let differs = facts.into_iter().find(|(_, before, now)| before != now);
        if let Some((what, before, now)) = differs {
            return Err(refused(format!("its {what} was `{before}`, and is `{now}` now")));
        }
        if let Some((name, before, now)) = setting(&header.settings, now.settings) {
            let shown = |value: Option<&str>| value.map_or("not set".to_owned(), |value| format!("`{value}`"));
            let what = format!("the setting {name} was {}, and is {} now", shown(before), shown(now));
            return Err(refused(what));
        }
        let names = header.files.keys().chain(now.files.keys());
        // A journal of an older tool names no files.
        let mut names = names.filter(|_| !header.files.is_empty());
        match names.find(|name| header.files.get(*name) != now.files.get(*name)) {
            Some(name) => Err(refused(format!("the {name} is not the file that it was"))),
            None => Ok(()),
        }
    }

    /// What nobody can say of a device that the harness does not start, and of which no version is named.
    pub(super) fn limit(now: &AboutRun<'_>) -> Option<String> {
        let says = |name: &str| {
            now.settings
                .iter()
                .any(|setting| setting.name == name && !setting.value.is_empty())
        };
        let is_known = says("device.command") || says("certificate.firmware-version");
        let is_foreign = says("device.serial-number");
        (is_foreign && !is_known).then(|| {
            "Whether the device is of the same firmware as before the interruption is not known: the profile names neither \
             its program (device.command) nor its version (certificate.firmware-version)."
                .to_owned()
        })
    }
}

fn refused(what: String) -> Problem {
    let title = format!("the run cannot be resumed: {what}");
    Diagnostic::whole("resume", title).hint(ONE_THING).into()
}

/// The first setting that is another one than it was.
fn setting<'a>(before: &'a [Setting], now: &'a [Setting]) -> Option<(&'a str, Option<&'a str>, Option<&'a str>)> {
    let value = |all: &'a [Setting], name: &str| {
        let found = all.iter().find(|setting| setting.name == name);
        found.map(|setting| setting.value.as_str())
    };
    let mut names = before.iter().chain(now).map(|setting| setting.name.as_str());
    names.find_map(|name| {
        let (before, now) = (value(before, name), value(now, name));
        (before != now && !WHERE.contains(&name)).then_some((name, before, now))
    })
}
