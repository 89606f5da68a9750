//! A run in a few words, for a test suite of one's own.

use std::fmt;
use std::path::{Path, PathBuf};

use super::assets::{Own, library};
use tck_base::clock::WallClock;
use tck_base::diagnostic::Diagnostic;
use tck_base::verdict::Verdict;
use tck_pack::Role;
use tck_profile::{self as profile, Surroundings};
use tck_report::junit::Inconclusive;
use tck_report::overview;
use tck_report::sources::Sources;
use tck_report::statement;
use tck_report::text::Color;
use tck_result::RunResult;
use tck_run::{
    Bundle, BundleError, End, Finished, LiveRun, OutputError, ProfileContext, RequestBuilder, RunError, SelectionError,
    VirtualRun, pack_of, run_silently, sources, write_all,
};

/// What is tested, and by what. Unless a seed is given, the cases that come from schemas and matrices are the same in every
/// run.
#[derive(Clone, Debug)]
pub struct Tck {
    device: Device,
    suites: Option<PathBuf>,
    request: RequestBuilder,
}

#[derive(Clone, Debug)]
enum Device {
    BuiltIn { role: Role, faults: Vec<String> },
    Profile(PathBuf),
}

/// Why a run could not begin, or left no report.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The suites or the profile are wrong.
    #[error("{}", rendered(.0))]
    Wrong(Vec<Diagnostic>),
    /// The selection is wrong, or holds for no test.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// The run could not be carried out.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The bundle could not be written.
    #[error(transparent)]
    Bundle(#[from] OutputError),
}

fn rendered(all: &[Diagnostic]) -> String {
    let all: Vec<String> = all.iter().map(|one| one.render(false)).collect();
    all.join("\n\n")
}

impl From<Vec<Diagnostic>> for Error {
    fn from(all: Vec<Diagnostic>) -> Self {
        Self::Wrong(all)
    }
}

impl From<BundleError> for Error {
    fn from(error: BundleError) -> Self {
        Self::Bundle(error.into())
    }
}

impl Tck {
    /// The reference device of a role, in virtual time: it shows how the suites work, and own tests that they do.
    #[must_use]
    pub fn built_in(role: Role) -> Self {
        Self::of(Device::BuiltIn {
            role,
            faults: Vec::new(),
        })
    }

    /// The device that a profile describes (`device.toml`), over real sockets.
    #[must_use]
    pub fn of_profile(profile: impl Into<PathBuf>) -> Self {
        Self::of(Device::Profile(profile.into()))
    }

    fn of(device: Device) -> Self {
        Self {
            device,
            suites: None,
            request: RequestBuilder::new().same_draw(),
        }
    }

    /// Adds the suites of a folder, laid out like `suites/`, to the built-in ones.
    #[must_use]
    pub fn suites(mut self, folder: impl Into<PathBuf>) -> Self {
        self.suites = Some(folder.into());
        self
    }

    /// Selects the tests that match: an id, a group or table, or `*` for anything. May be called again for more of them.
    #[must_use]
    pub fn select(mut self, pattern: impl Into<String>) -> Self {
        self.request = self.request.select(pattern);
        self
    }

    /// Draws by this seed, and makes ids from it, so that the run is the same again.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.request = self.request.seed(seed);
        self
    }

    /// Tries all cases that come from schemas and matrices.
    #[must_use]
    pub fn thorough(mut self) -> Self {
        self.request = self.request.thorough();
        self
    }

    /// Chooses by more than names and seed.
    #[must_use]
    pub fn request(mut self, request: RequestBuilder) -> Self {
        self.request = request;
        self
    }

    /// Gives a built-in device a defect (`vda5050-tck list faults`), to see a test fail. Other devices have their own.
    #[must_use]
    pub fn fault(mut self, name: impl Into<String>) -> Self {
        if let Device::BuiltIn { faults, .. } = &mut self.device {
            faults.push(name.into());
        }
        self
    }

    /// Carries it out on this thread until it is over.
    ///
    /// # Errors
    /// When it cannot begin. What breaks later is how it ended, and conforms to nothing.
    pub fn run(self) -> Result<Outcome, Error> {
        let library = library(self.suites.as_deref().map(Own::Added))?;
        let (finished, pack) = match self.device {
            Device::BuiltIn { role, faults } => {
                let pack = library.rules.packs.latest().clone();
                let request = self.request.build(role, &library, &pack)?;
                let run = VirtualRun {
                    faults,
                    tests: request.tests,
                    draw: request.draw,
                    run: request.run,
                    command: request.command,
                    fail_fast: request.fail_fast,
                    repeat: request.repeat,
                    budget: request.budget,
                    certifies: request.certifies,
                    limits: request.limits,
                    begun: WallClock::start().now().utc,
                    ..VirtualRun::of_role(role, &library, &pack)
                };
                (run_silently(&library, &pack, run).map_err(RunError::from)?, pack)
            }
            Device::Profile(path) => {
                let surroundings = Surroundings::of_process();
                let effective = profile::load(Some(&path), &[], &surroundings, &library.rules.hooks)?;
                let pack = pack_of(&library, &effective).map_err(|wrong| vec![wrong])?;
                let place = ProfileContext {
                    folder: path.parent().map_or_else(PathBuf::new, Path::to_path_buf),
                    profile: Some(path),
                    ..ProfileContext::default()
                };
                let role = effective.profile.device.role;
                let mut run = LiveRun::of_profile(&effective, &library, &pack, &surroundings, place)?;
                run.request = self.request.build(role, &library, &pack)?;
                (run.carry_out_silently(&library, &pack)?, pack)
            }
        };
        let sources = sources(&library, &pack);
        Ok(Outcome { finished, sources })
    }
}

/// What came of a run; it displays what the terminal shows at the end of `run`.
pub struct Outcome {
    finished: Finished,
    sources: Sources,
}

impl Outcome {
    /// Whether the run came to its end, everything in it was decided, and nothing is worse than a warning: where `run`
    /// exits with 0 for a profile without known failures.
    #[must_use]
    pub fn conforms(&self) -> bool {
        let result = self.result();
        let ended = matches!(self.finished.end, End::Completed) && !result.partial;
        let decided = statement::trouble(result).is_none() && result.tests.iter().all(statement::is_settled);
        ended && decided && matches!(self.verdict(), Some(Verdict::Pass | Verdict::Warning))
    }

    /// The worst that was decided; nothing when nothing was.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.result().verdict
    }

    /// Everything that was decided, as it stands in `result.json`.
    #[must_use]
    pub fn result(&self) -> &RunResult {
        &self.finished.result
    }

    /// Writes a bundle with journal, report and JUnit below this folder, as `run` does, and gives its folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, reports: impl AsRef<Path>) -> Result<PathBuf, Error> {
        let (result, journal) = (self.result(), self.finished.recorder.journal());
        let device = &result.device;
        let begun = journal
            .entries()
            .first()
            .map_or(jiff::Timestamp::UNIX_EPOCH, |first| first.at().utc);
        let reports = reports.as_ref();
        let bundle = Bundle::create(reports, &device.manufacturer, &device.serial_number, begun, &result.run)?;
        let mut writer = bundle.journal()?;
        for entry in journal.entries() {
            writer.write(&entry.record).map_err(|reason| BundleError::Write {
                path: bundle.folder().to_owned(),
                reason,
            })?;
        }
        drop(writer);
        let mut result = result.clone();
        bundle.pack_journal()?.clone_into(&mut result.journal);
        write_all(&bundle, &result, &self.sources, journal, Inconclusive::Error)?;
        Ok(bundle.folder().to_owned())
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let journal = Some(self.finished.recorder.journal());
        let nowhere = overview::Bundle::default();
        f.write_str(&overview::overview(
            self.result(),
            &self.sources,
            journal,
            nowhere,
            Color::Never,
        ))
    }
}
