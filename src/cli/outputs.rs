//! `--as KIND=FILE`: what a pipeline reads of a run, written in every case.
//!
//! Each file is there, and red, before anything else happens, and is written again when the run is over or nothing came of it.
//! So no file of an earlier run is taken for this one, whatever happens to the process.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use super::args::{self, Command, InconclusiveArg, RenderedTo, Rendering};
use super::exit::Exit;
use super::pipeline;
use super::problem::Problem;
use tck_journal::tool;
use tck_report::junit::{self, Flavour, JunitError};
use tck_report::no_result::{NoResult, Obstacle};
use tck_report::sources::Sources;
use tck_report::{issues, markdown};
use tck_result::RunResult;
use tck_run::{forget_latest, write_whole};

/// What a command owes to a pipeline.
#[derive(Clone, Debug, Default)]
pub(super) struct Owed {
    /// The files.
    files: Vec<RenderedTo>,
    /// The folder of reports, if the command is one that tests: `latest` in it must not lead to an earlier run.
    reports: Option<PathBuf>,
    /// The profile, if one is named.
    profile: Option<PathBuf>,
}

impl Owed {
    /// By a command.
    pub(super) fn by(command: &Command) -> Self {
        let files = |all: &[RenderedTo]| all.iter().filter(|one| one.file.is_some()).cloned().collect();
        match command {
            // A plan tests nothing.
            Command::Run(run) if run.selection.plan => Self::default(),
            Command::Run(run) => Self {
                files: files(&run.pipeline.renderings),
                reports: Some(run.output.out.clone()),
                profile: run.device.profile.clone(),
            },
            Command::Certify(certify) => Self {
                files: files(&certify.pipeline.renderings),
                reports: Some(certify.output.out.clone()),
                profile: certify.profile.clone(),
            },
            Command::Report(report) => Self {
                files: files(&report.renderings),
                ..Self::default()
            },
            _ => Self::default(),
        }
    }

    /// By a command line that cannot be read: as far as it is plain what it asks for.
    pub(super) fn by_words(words: &[String]) -> Self {
        let values = |name: &str| {
            let joined = format!("{name}=");
            let beside = words
                .windows(2)
                .filter(|pair| pair[0] == name)
                .map(|pair| pair[1].clone());
            let inside = words
                .iter()
                .filter_map(|word| word.strip_prefix(&joined).map(str::to_owned));
            beside.chain(inside).collect::<Vec<String>>()
        };
        let tests = words.iter().skip(1).any(|word| word == "run" || word == "certify");
        let by_variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
        let folder = || {
            let said = values("--out").pop().or_else(|| by_variable("VDA5050_TCK_OUT"));
            PathBuf::from(said.unwrap_or_else(|| args::REPORTS.to_owned()))
        };
        let profile = values("--profile").pop().or_else(|| by_variable("VDA5050_TCK_PROFILE"));
        Self {
            files: values("--as")
                .iter()
                .filter_map(|text| args::to_file(text).ok())
                .collect(),
            reports: tests.then(folder),
            profile: profile.filter(|_| tests).map(PathBuf::from),
        }
    }

    /// Does the command, and writes what it owes.
    pub(super) fn around(&self, command: impl FnOnce(&Outputs<'_>) -> Result<Exit, Problem>) -> Result<Exit, Problem> {
        let unfinished = NoResult {
            tool: tool(),
            exit: Exit::Broken.code(),
            meaning: Exit::Broken.meaning().to_owned(),
            profile: self.profile(),
            problems: vec![Obstacle {
                title: "the run has not come to its end: it goes on, or was killed".to_owned(),
                ..Obstacle::default()
            }],
        };
        let before = Self {
            // What is no file, such as a pipe, gets what came out and nothing before it.
            files: self
                .files
                .iter()
                .filter(|wanted| !wanted.is_stream())
                .cloned()
                .collect(),
            ..Self::default()
        };
        before.write_no_result(&unfinished)?;
        let outputs = Outputs {
            files: &self.files,
            settled: Cell::new(false),
        };
        let outcome = command(&outputs);
        if let Err(problem) = &outcome
            && !outputs.settled.get()
        {
            self.settle(problem);
        }
        outcome
    }

    /// Nothing came of the command: the files say so, `latest` leads to no earlier run, and the pipeline is told.
    pub(super) fn settle(&self, problem: &Problem) {
        let nothing = problem.no_result(self.profile());
        if let Some(reports) = &self.reports {
            forget_latest(reports);
        }
        if let Err(unwritten) = self.write_no_result(&nothing) {
            super::tell(&unwritten.render(console::colors_enabled_stderr()));
        }
        pipeline::tell_of_nothing(&nothing, self.reports.is_some());
    }

    fn profile(&self) -> Option<String> {
        self.profile.as_ref().map(|path| path.display().to_string())
    }

    fn write_no_result(&self, nothing: &NoResult) -> Result<(), Problem> {
        for wanted in &self.files {
            let text = match wanted.rendering {
                Rendering::Junit | Rendering::JunitRequirements => nothing.junit(),
                Rendering::Markdown => Ok(nothing.markdown()),
                Rendering::CodeQuality => Ok(issues::code_quality_of(nothing)),
                Rendering::Sarif => Ok(issues::sarif_of(nothing)),
            };
            write(wanted, text).map_err(Problem::Environment)?;
        }
        Ok(())
    }
}

/// The files of a run that goes on.
pub(super) struct Outputs<'a> {
    files: &'a [RenderedTo],
    /// Whether they hold what came out.
    settled: Cell<bool>,
}

impl Outputs<'_> {
    /// Writes what came out of a run into every file.
    pub(super) fn write(&self, shown: &Shown<'_>) -> Result<(), String> {
        self.write_each(|rendering| shown.as_text(rendering))
    }

    /// Writes into every file what this makes of its kind.
    pub(super) fn write_each(&self, text: impl Fn(Rendering) -> Result<String, JunitError>) -> Result<(), String> {
        self.settled.set(true);
        for wanted in self.files {
            write(wanted, text(wanted.rendering))?;
        }
        Ok(())
    }
}

/// A run, and what its renderings need beside it.
pub(super) struct Shown<'a> {
    pub(super) result: &'a RunResult,
    pub(super) sources: &'a Sources,
    pub(super) inconclusive: InconclusiveArg,
    pub(super) root: Option<&'a str>,
    /// The folder of the evidence.
    pub(super) folder: &'a Path,
}

impl Shown<'_> {
    /// The run as a text of a kind.
    pub(super) fn as_text(&self, rendering: Rendering) -> Result<String, JunitError> {
        let flavour = Flavour {
            inconclusive: self.inconclusive.into(),
            root: self.root,
        };
        match rendering {
            Rendering::Junit => junit::render(self.result, flavour),
            Rendering::JunitRequirements => junit::by_requirement(self.result, self.sources, flavour),
            Rendering::Markdown => Ok(markdown::summary(self.result, self.sources, self.folder.to_str())),
            Rendering::CodeQuality => Ok(issues::code_quality(self.result, self.sources)),
            Rendering::Sarif => Ok(issues::sarif(self.result, self.sources)),
        }
    }
}

fn write(wanted: &RenderedTo, text: Result<String, JunitError>) -> Result<(), String> {
    let Some(file) = &wanted.file else { return Ok(()) };
    let text = text.map_err(|error| error.to_string())?;
    write_whole(file, text.as_bytes()).map_err(|error| error.to_string())
}
