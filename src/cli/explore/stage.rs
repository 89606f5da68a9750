//! Where conversations are carried out: on the device of a profile, or on a built-in one.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::runtime::Runtime;
use tokio::sync::watch;

use crate::cli::args::Explore;
use crate::cli::device::tolerate;
use crate::cli::ending::stop;
use crate::cli::problem::Problem;
use crate::cli::run::{hold, person};
use crate::ui::Prompter;
use tck_base::clock::WallClock;
use tck_explore::{ConversationFile, Explored, Purpose, Stage};
use tck_journal::Reason;
use tck_journal::file::JournalWriter;
use tck_judge::Library;
use tck_judge::RunJudge;
use tck_pack::{Catalogue, Pack, Participant, Role};
use tck_profile::{Effective, Surroundings};
use tck_report::junit::Inconclusive;
use tck_result::RunResult;
use tck_run::{
    Bundle, Finished, LiveRun, ProfileContext, Request, Selection, Silent, VirtualRun, run_virtually, sources,
    write_all,
};
use tck_simulate::{BuiltIn, ReferenceAgv, ReferenceMasterControl, USUAL_FLEET};
use tck_suite::model::Test;

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
    /// How long stimuli are tried and conversations carried out, and since when.
    budget: Option<(Instant, Duration)>,
    desk: Prompter,
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
            budget: None,
            rounds: 0,
            kept: None,
            evidence: None,
        })
    }

    /// Sets the time after which no conversation that was drawn begins. Stimuli are tried one by one for half of
    /// this time at most.
    pub(super) fn within(self, budget: Option<Duration>) -> Self {
        Self {
            budget: budget.map(|budget| (Instant::now(), budget)),
            ..self
        }
    }

    pub(super) fn catalogue(&self) -> &Catalogue {
        &self.library.rules.catalogue
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
        let folder = self.reports.join("conversations");
        for shown in &explored.findings {
            write(&folder, &shown.file)?;
        }
        Ok(folder)
    }

    fn request(tests: Vec<Arc<Test>>, run: &str) -> Request {
        Request {
            tests: Selection::some(tests),
            run: run.to_owned(),
            command: std::env::args().collect(),
            repeat: 1,
            ..Request::default()
        }
    }

    /// What ends a run: a person, or the end of its time.
    fn end(&self, purpose: Purpose) -> watch::Receiver<bool> {
        let end = self.budget.and_then(|(begun, budget)| match purpose {
            Purpose::Probe => Some(begun + budget / 2),
            Purpose::Conversations => Some(begun + budget),
            Purpose::Trial | Purpose::Evidence => None,
        });
        let Some(time_is_up) = end else {
            return self.interrupt.clone();
        };
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
        tests: Vec<Arc<Test>>,
        run: &str,
        writer: Option<JournalWriter>,
        interrupt: watch::Receiver<bool>,
    ) -> Result<Finished, Problem> {
        let request = Self::request(tests, run);
        let (library, pack) = (&self.library, &self.pack);
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
                    ..VirtualRun::of_role(device.role(), library, pack)
                };
                let (mut nobody, mut nowhere) = (Silent, |_: &RunJudge| {});
                let run = run_virtually(library, pack, asked, writer, interrupt, &mut nobody, &mut nowhere);
                self.runtime.block_on(run).map_err(environment)
            }
            Device::BuiltIn { device, faults } => {
                let run = LiveRun::built_in(device.clone(), faults, library, pack);
                self.over_sockets(run, request, writer, interrupt)
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
                    person: person(&self.desk, false),
                    vehicles: None,
                };
                let mut run = LiveRun::of_profile(effective, library, pack, surroundings, place)?;
                if *still {
                    run.device.stand_still(Reason::MotionRuledOut);
                }
                self.over_sockets(run, request, writer, interrupt)
            }
        }
    }

    fn over_sockets(
        &self,
        mut run: LiveRun,
        request: Request,
        writer: Option<JournalWriter>,
        interrupt: watch::Receiver<bool>,
    ) -> Result<Finished, Problem> {
        run.request = request;
        run.hold = hold(&self.desk);
        let (library, pack) = (&self.library, &self.pack);
        let (mut nobody, mut nowhere) = (Silent, |_: &RunJudge| {});
        let run = run.carry_out(library, pack, writer, interrupt, &mut nobody, &mut nowhere);
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

    fn carry_out(&mut self, files: &[ConversationFile], purpose: Purpose) -> Result<RunResult, Problem> {
        let side = self.subject().role.word();
        let places = files.iter().map(|file| (file.place(side), file.text.clone()));
        let places: Vec<(String, String)> = places.collect();
        let tests = self.library.add(&places)?;
        // Tests are added in the order of their ids; they are carried out as they were given.
        let mut tests: Vec<Arc<Test>> = tests;
        tests.sort_by_key(|test| files.iter().position(|file| file.id == test.id));
        self.rounds += 1;
        let run = format!("explore-{}", self.rounds);
        if matches!(purpose, Purpose::Probe | Purpose::Trial) {
            return Ok(self.finished(tests, &run, None, self.end(purpose))?.result);
        }
        let subject = self.subject();
        let utc = WallClock::start().now().utc;
        let bundle = Bundle::create(&self.reports, &subject.manufacturer, &subject.serial_number, utc, &run);
        let bundle = bundle.map_err(environment)?;
        for file in files {
            write(&bundle.folder().join("tests"), file)?;
        }
        let writer = bundle.journal().map_err(environment)?;
        let finished = self.finished(tests, &run, Some(writer), self.end(purpose))?;
        let quoted = sources(&self.library, &self.pack);
        let journal = finished.recorder.journal();
        write_all(&bundle, &finished.result, &quoted, journal, Inconclusive::default()).map_err(environment)?;
        self.kept = Some(bundle.folder().to_owned());
        self.evidence = (purpose == Purpose::Evidence).then(|| bundle.folder().to_owned());
        Ok(finished.result)
    }

    fn interrupted(&self) -> bool {
        *self.interrupt.borrow()
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
