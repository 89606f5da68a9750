//! Where conversations are carried out: on the device of a profile, or on a built-in one.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::runtime::Runtime;
use tokio::sync::watch;

use crate::cli::args::Explore;
use crate::cli::device::tolerate;
use crate::cli::ending::stop;
use crate::cli::exit::Exit;
use crate::cli::page::{self, OnPage, ServedPage};
use crate::cli::problem::Problem;
use crate::cli::run::{hold, person};
use crate::ui::Prompter;
use tck_base::clock::WallClock;
use tck_course::HERE;
use tck_explore::saved::ExploredResult;
use tck_explore::{ConversationFile, Explored, Purpose, Round, Shown, Stage};
use tck_journal::Reason;
use tck_journal::event::Event;
use tck_journal::file::JournalWriter;
use tck_judge::Library;
use tck_judge::RunJudge;
use tck_pack::{Catalogue, Pack, Participant, Role};
use tck_page::{Facts, Outcome, Page};
use tck_profile::{Effective, Surroundings};
use tck_report::junit::Inconclusive;
use tck_run::{
    Bundle, Finished, LiveRun, ProfileContext, Progress, Request, Selection, Silent, VirtualRun, run_virtually,
    sources, write_all,
};
use tck_simulate::{BuiltIn, ReferenceAgv, ReferenceMasterControl, USUAL_FLEET};
use tck_suite::model::Test;

/// So many seeds are drawn from where nobody names one.
const SEEDS: u64 = 1_000_000;

/// What is explored.
pub(super) enum Device {
    /// A built-in device in virtual time.
    Virtual { device: BuiltIn, faults: Vec<String> },
    /// A built-in device over sockets.
    BuiltIn { device: BuiltIn, faults: Vec<String> },
    /// The device of a profile.
    Profile {
        effective: Effective,
        surroundings: Surroundings,
        folder: PathBuf,
        still: bool,
    },
}

impl Device {
    /// The seed where nobody names one: a built-in device is told the same every time, and others something else.
    pub(super) fn usual_seed(&self) -> u64 {
        match self {
            Self::Virtual { .. } | Self::BuiltIn { .. } => 1,
            Self::Profile { .. } => u64::try_from(WallClock::start().now().utc.as_millisecond()).unwrap_or(1) % SEEDS,
        }
    }

    /// How many conversations are drawn at once at most: what was learned of a device on a clock is used soon.
    pub(super) fn most_at_once(&self) -> usize {
        match self {
            Self::Virtual { .. } => 200,
            Self::BuiltIn { .. } | Self::Profile { .. } => 8,
        }
    }

    pub(super) fn of(
        arguments: &Explore,
        effective: &Effective,
        pack: &Pack,
        surroundings: &Surroundings,
    ) -> Result<Self, Problem> {
        let device = &effective.profile.device;
        let foreign =
            arguments.device.profile.is_some() || device.manufacturer.is_some() || device.serial_number.is_some();
        if foreign {
            let profile = arguments.device.profile.as_deref();
            return Ok(Self::Profile {
                effective: effective.clone(),
                surroundings: surroundings.clone(),
                folder: profile
                    .and_then(Path::parent)
                    .map_or_else(PathBuf::new, Path::to_path_buf),
                still: arguments.device.no_motion,
            });
        }
        let mut device: BuiltIn = match device.role {
            Role::Agv => ReferenceAgv::of(arguments.vehicle.0, pack).into(),
            Role::MasterControl => ReferenceMasterControl::with_vehicles(USUAL_FLEET, pack).into(),
        };
        tolerate(&mut device, &arguments.tolerance)?;
        let faults = arguments.fault.clone();
        Ok(if arguments.in_virtual_time {
            Self::Virtual { device, faults }
        } else {
            Self::BuiltIn { device, faults }
        })
    }
}

/// The stage of the command line: conversations and evidence leave a report, probes and trials none.
pub(super) struct OnStage {
    library: Library,
    pack: Arc<Pack>,
    device: Device,
    reports: PathBuf,
    runtime: Runtime,
    interrupt: watch::Receiver<bool>,
    /// When the exploration began.
    begun: Instant,
    desk: Prompter,
    /// The page for people elsewhere, where there is one.
    served: Option<ServedPage>,
    rounds: u32,
    kept: Option<PathBuf>,
    /// The report whose tests are the conversations of the findings.
    evidence: Option<PathBuf>,
}

impl OnStage {
    pub(super) fn new(library: Library, pack: Arc<Pack>, device: Device, reports: &Path) -> Result<Self, Problem> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
        let stop = runtime.block_on(async { stop() })?;
        Ok(Self {
            library,
            pack,
            device,
            reports: reports.to_owned(),
            runtime,
            interrupt: stop.subscribe(),
            desk: Prompter::new(stop),
            served: None,
            begun: Instant::now(),
            rounds: 0,
            kept: None,
            evidence: None,
        })
    }

    /// Serves a page where the profile says so; a device in virtual time has none.
    pub(super) fn serve_page(&mut self, effective: &Effective) -> Result<(), Problem> {
        if matches!(self.device, Device::Virtual { .. }) {
            return Ok(());
        }
        let served = ServedPage::start(effective, &self.desk, self.interrupt.clone());
        self.served = self.runtime.block_on(served)?;
        let Some(page) = self.page() else { return Ok(()) };
        self.desk.is_followed_by(page::follower(page.clone()));
        let subject = self.subject();
        page.asks(page::asks(&self.library.rules.catalogue, &self.pack));
        page.begun(Facts {
            command: "explore".to_owned(),
            role: subject.role.word().to_owned(),
            protocol: self.pack.version.to_string(),
            manufacturer: subject.manufacturer,
            serial_number: subject.serial_number,
            run: String::new(),
            broker: page::broker(effective),
        });
        Ok(())
    }

    /// What the page shows, where there is one.
    pub(super) fn page(&self) -> Option<Page> {
        self.served.as_ref().map(|served| served.page.clone())
    }

    /// The page says how it ended, and is served no more.
    pub(super) fn finish(&mut self, exit: Option<&Exit>) {
        let Some(served) = self.served.take() else { return };
        if let Some(exit) = exit {
            let verdict = match exit {
                Exit::Conforms => "pass",
                Exit::DoesNotConform => "fail",
                Exit::Undecided => "inconclusive",
                _ => "none",
            };
            served.page.ended(Outcome {
                verdict: verdict.to_owned(),
                statement: "The exploration is over; the terminal says what was found.".to_owned(),
                report: self
                    .kept
                    .as_ref()
                    .map_or_else(|| "none".to_owned(), |folder| folder.display().to_string()),
            });
        }
        self.runtime.block_on(served.finish());
    }

    pub(super) fn catalogue(&self) -> &Catalogue {
        &self.library.rules.catalogue
    }

    /// Says of the result of a part what it is about.
    pub(super) fn describe(&self, result: &mut ExploredResult) {
        result.suites_sha256.clone_from(&self.library.rules.sha256);
        result.protocol = self.pack.version.to_string();
        result.manufacturer = self.subject().manufacturer;
    }

    /// The report that was written last.
    pub(super) fn report(&self) -> Option<&Path> {
        self.kept.as_deref()
    }

    /// The folder that holds the conversations of the findings: the tests of the last report, or, where the exploration was
    /// interrupted before they were carried out for it, a folder of their own.
    pub(super) fn conversations(&self, explored: &Explored) -> Result<PathBuf, Problem> {
        if let Some(evidence) = &self.evidence {
            return Ok(evidence.join("tests"));
        }
        self.written(&explored.findings)
    }

    /// The folder that holds the conversations of the remarks.
    pub(super) fn remarks(&self, explored: &Explored) -> Result<PathBuf, Problem> {
        self.written(&explored.remarks)
    }

    fn written(&self, all: &[Shown]) -> Result<PathBuf, Problem> {
        let folder = self.reports.join("conversations");
        for shown in all {
            write(&folder, &shown.file)?;
        }
        Ok(folder)
    }

    fn request(tests: Vec<Arc<Test>>, run: &str, purpose: Purpose) -> Request {
        Request {
            // No test fits into no time.
            budget: (purpose == Purpose::Gates).then_some(Duration::ZERO),
            tests: Selection::some(tests),
            run: run.to_owned(),
            command: std::env::args().collect(),
            repeat: 1,
            limits: vec!["This is a part of an exploration, which ends when its time is up (--budget).".to_owned()],
            ..Request::default()
        }
    }

    /// What ends a run: a person, or the end of its time.
    fn end(&self, within: Option<Duration>) -> watch::Receiver<bool> {
        let Some(within) = within else {
            return self.interrupt.clone();
        };
        let time_is_up = Instant::now() + within;
        let mut person = self.interrupt.clone();
        let (ends, end) = watch::channel(false);
        self.runtime.spawn(async move {
            tokio::select! {
                () = tokio::time::sleep_until(time_is_up.into()) => {}
                _ = person.wait_for(|interrupted| *interrupted) => {}
                () = ends.closed() => {}
            }
            ends.send_replace(true);
        });
        end
    }

    fn finished(
        &self,
        library: &Library,
        tests: Vec<Arc<Test>>,
        (run, purpose): (&str, Purpose),
        writer: Option<JournalWriter>,
        interrupt: watch::Receiver<bool>,
    ) -> Result<Finished, Problem> {
        let request = Self::request(tests, run, purpose);
        let pack = &self.pack;
        match &self.device {
            Device::Virtual { device, faults } => {
                let asked = VirtualRun {
                    device: device.clone(),
                    faults: faults.clone(),
                    tests: request.tests,
                    draw: None,
                    begun: WallClock::start().now().utc,
                    run: request.run,
                    command: request.command,
                    budget: request.budget,
                    ..VirtualRun::of_role(device.role(), library, pack)
                };
                let (mut nobody, mut nowhere) = (Silent, |_: &RunJudge| {});
                let run = run_virtually(library, pack, asked, writer, interrupt, &mut nobody, &mut nowhere);
                self.runtime.block_on(run).map_err(environment)
            }
            Device::BuiltIn { device, faults } => {
                let run = LiveRun::built_in(device.clone(), faults, library, pack);
                self.over_sockets(library, run, request, writer, interrupt)
            }
            Device::Profile {
                effective,
                surroundings,
                folder,
                still,
            } => {
                let place = ProfileContext {
                    profile: None,
                    folder: folder.clone(),
                    person: person(&self.desk, self.served.is_some()),
                    vehicles: None,
                    shard: None,
                };
                let mut run = LiveRun::of_profile(effective, library, pack, surroundings, place)?;
                if *still {
                    run.device.stand_still(Reason::MotionRuledOut);
                }
                self.over_sockets(library, run, request, writer, interrupt)
            }
        }
    }

    fn over_sockets(
        &self,
        library: &Library,
        mut run: LiveRun,
        request: Request,
        writer: Option<JournalWriter>,
        interrupt: watch::Receiver<bool>,
    ) -> Result<Finished, Problem> {
        run.request = request;
        run.hold = hold(&self.desk);
        let pack = &self.pack;
        run.stopped_at = self.desk.stopped_at();
        let mut nowhere = |_: &RunJudge| {};
        let mut onlooker: Box<dyn Progress> = match self.page() {
            None => Box::new(Silent),
            Some(page) => {
                let role = run.device.subject.role;
                page.begins_anew();
                run.onlooker = Some(page::onlooker(page.clone(), role, Arc::clone(pack)));
                if let Some(layout) = run.device.layout.as_ref().filter(|_| role == Role::Agv) {
                    page.floor(page::floor(layout));
                }
                Box::new(OnPage(page))
            }
        };
        let run = run.carry_out(library, pack, writer, interrupt, &mut *onlooker, &mut nowhere);
        self.runtime.block_on(run).map_err(environment)
    }

    fn subject(&self) -> Participant {
        match &self.device {
            Device::Virtual { device, .. } | Device::BuiltIn { device, .. } => device.subject().clone(),
            Device::Profile { effective, .. } => {
                let device = &effective.profile.device;
                Participant {
                    role: device.role,
                    manufacturer: device.manufacturer.clone().unwrap_or_default(),
                    serial_number: device.serial_number.clone().unwrap_or_default(),
                    topic_template: device.topic_template.clone(),
                }
            }
        }
    }
}

impl Stage for OnStage {
    type Error = Problem;

    fn carry_out(
        &mut self,
        files: &[ConversationFile],
        purpose: Purpose,
        within: Option<Duration>,
    ) -> Result<Round, Problem> {
        let side = self.subject().role.word();
        let places = files.iter().map(|file| (file.place(side), file.text.clone()));
        let places: Vec<(String, String)> = places.collect();
        // Each round stands by itself: what was tried before may be tried again under its name.
        let mut library = self.library.clone();
        let tests = library.add(&places)?;
        // Tests are added in the order of their ids; they are carried out as they were given.
        let mut tests: Vec<Arc<Test>> = tests;
        tests.sort_by_key(|test| files.iter().position(|file| file.id == test.id));
        self.rounds += 1;
        let run = format!("explore-{}", self.rounds);
        if matches!(purpose, Purpose::Gates | Purpose::Probe | Purpose::Trial) {
            return Ok(round(self.finished(
                &library,
                tests,
                (&run, purpose),
                None,
                self.end(within),
            )?));
        }
        let subject = self.subject();
        let utc = WallClock::start().now().utc;
        let bundle = Bundle::create(&self.reports, &subject.manufacturer, &subject.serial_number, utc, &run);
        let bundle = bundle.map_err(environment)?;
        for file in files {
            write(&bundle.folder().join("tests"), file)?;
        }
        let writer = bundle.journal().map_err(environment)?;
        let finished = self.finished(&library, tests, (&run, purpose), Some(writer), self.end(within))?;
        let quoted = sources(&library, &self.pack);
        let journal = finished.recorder.journal();
        write_all(&bundle, &finished.result, &quoted, journal, Inconclusive::default()).map_err(environment)?;
        self.kept = Some(bundle.folder().to_owned());
        self.evidence = (purpose == Purpose::Evidence).then(|| bundle.folder().to_owned());
        Ok(round(finished))
    }

    fn spent(&self) -> Duration {
        self.begun.elapsed()
    }

    fn interrupted(&self) -> bool {
        *self.interrupt.borrow()
    }
}

/// What came of a run, and where its conversations began.
fn round(finished: Finished) -> Round {
    let entries = finished.recorder.journal().beside_messages();
    let began = entries.filter_map(|entry| match entry.event() {
        Event::TestBegun { test, bindings, .. } => {
            let node = bindings.get("course")?.get(HERE)?.as_str()?;
            Some((test.clone(), node.to_owned()))
        }
        _ => None,
    });
    Round {
        began: began.collect(),
        result: finished.result,
    }
}

/// Writes a conversation below a folder, by its id.
fn write(folder: &Path, file: &ConversationFile) -> Result<(), Problem> {
    let name = file.id.rsplit('/').next().unwrap_or(&file.id);
    let written =
        std::fs::create_dir_all(folder).and_then(|()| std::fs::write(folder.join(format!("{name}.yaml")), &file.text));
    written.map_err(environment)
}

fn environment(error: impl std::fmt::Display) -> Problem {
    Problem::Environment(error.to_string())
}
