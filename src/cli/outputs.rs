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
use super::within::Bundles;
use tck_journal::tool;
use tck_report::junit::{self, Flavour};
use tck_report::keys::Keys;
use tck_report::manifest::{self, Manifest};
use tck_report::no_result::{NoResult, Obstacle};
use tck_report::sources::Sources;
use tck_report::{allure, attestation, clean, ctrf, cyclonedx, issues, markdown};
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
        let bundles = Bundles::of(command);
        let files = |all: &[RenderedTo]| all.iter().filter(|one| is_owed(one, &bundles)).cloned().collect();
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
                .filter(|wanted| is_owed(wanted, &Bundles::default()))
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
            let content: Content = match wanted.rendering {
                Rendering::Junit | Rendering::JunitRequirements | Rendering::JunitProperties => nothing
                    .junit()
                    .map_err(|error| Problem::Environment(error.to_string()))?
                    .into(),
                Rendering::Ctrf => ctrf::no_result(nothing).into(),
                Rendering::Allure => Content::Folder(allure::no_result(nothing)),
                Rendering::Markdown => nothing.markdown().into(),
                Rendering::CodeQuality => issues::code_quality_of(nothing).into(),
                Rendering::Sarif => issues::sarif_of(nothing).into(),
                Rendering::Cyclonedx | Rendering::Svr => nothing.no_statement().into(),
            };
            write(wanted, Ok(content)).map_err(Problem::Environment)?;
        }
        Ok(())
    }
}

/// Whether something is written at all: to a file, and to none in a bundle, which is refused.
fn is_owed(wanted: &RenderedTo, bundles: &Bundles) -> bool {
    let file = wanted.file.as_deref();
    file.is_some_and(|file| bundles.around(file).is_none())
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
        self.write_each(|rendering| shown.content(rendering))
    }

    /// Writes into every file what this makes of its kind.
    pub(super) fn write_each(&self, content: impl Fn(Rendering) -> Result<Content, String>) -> Result<(), String> {
        self.settled.set(true);
        for wanted in self.files {
            write(wanted, content(wanted.rendering))?;
        }
        Ok(())
    }
}

/// What a rendering is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// One text.
    Text(String),
    /// Files of a folder: name and text.
    Folder(Vec<(String, String)>),
}

impl From<String> for Content {
    fn from(text: String) -> Self {
        Self::Text(text)
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
    /// Keys of test management beside those of the profile.
    pub(super) keys: Keys,
}

impl Shown<'_> {
    /// The run as a rendering of a kind.
    pub(super) fn content(&self, rendering: Rendering) -> Result<Content, String> {
        let (result, sources) = (self.result, self.sources);
        let how = self.inconclusive.into();
        let flavour = Flavour {
            inconclusive: how,
            root: self.root,
        };
        let text = match rendering {
            Rendering::Junit => junit::render(result, flavour).map_err(|error| error.to_string())?,
            Rendering::JunitRequirements => {
                junit::by_requirement(result, sources, flavour).map_err(|error| error.to_string())?
            }
            Rendering::JunitProperties => {
                let keys = Keys::of_run(result)
                    .map_err(|error| error.to_string())?
                    .under(self.keys.clone());
                for id in keys.unmet(result) {
                    super::tell(&format!(
                        "nothing in this run is called `{}`: its key is not used",
                        clean::line(id)
                    ));
                }
                junit::with_keys(result, sources, &keys, flavour).map_err(|error| error.to_string())?
            }
            Rendering::Ctrf => ctrf::render(result, sources, how),
            Rendering::Allure => return Ok(Content::Folder(allure::render(result, sources, how))),
            Rendering::Markdown => markdown::summary(result, sources, self.folder.to_str()),
            Rendering::CodeQuality => issues::code_quality(result, sources),
            Rendering::Sarif => issues::sarif(result, sources),
            Rendering::Cyclonedx => cyclonedx::render(result, sources, &self.manifest()?),
            Rendering::Svr => {
                let path = self.folder.join(manifest::NAME);
                let bytes = std::fs::read(&path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
                attestation::simple(result, &bytes, &self.manifest()?.root)
            }
        };
        Ok(text.into())
    }

    fn manifest(&self) -> Result<Manifest, String> {
        Manifest::read(self.folder).map_err(|error| error.to_string())
    }
}

fn write(wanted: &RenderedTo, content: Result<Content, String>) -> Result<(), String> {
    let Some(file) = &wanted.file else { return Ok(()) };
    match content? {
        Content::Text(text) => write_whole(file, text.as_bytes()).map_err(|error| error.to_string()),
        Content::Folder(files) => {
            forget(file).map_err(|error| format!("cannot write {}: {error}", file.display()))?;
            for (name, text) in files {
                write_whole(&file.join(name), text.as_bytes()).map_err(|error| error.to_string())?;
            }
            Ok(())
        }
    }
}

/// Takes away what an earlier run has left in a folder of Allure, and nothing else: it would be shown beside this run.
fn forget(folder: &Path) -> std::io::Result<()> {
    let entries = match std::fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        entries => entries?,
    };
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name();
        let is_ours = |name: &str| name.starts_with(allure::BEGINS) && name.ends_with(allure::ENDS);
        if name.to_str().is_some_and(is_ours) {
            std::fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
