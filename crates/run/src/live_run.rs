//! A run over real sockets: the bench is put up, the device of a profile is awaited or a built-in one is started, and all
//! is taken down again.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use serde_json::Value;

use super::device::{Surroundings as Onlookers, Tell};
use super::files::files;
use super::hooks::Means;
use super::operators::{Commands, hooks_of};
use super::overheard::{Overheard, overhear};
use super::person::{Person, Place};
use super::plan::{How, RunPlan};
use super::request::Request;
use super::selection::Selection;
use super::session::{Finished, Patience, Progress, run};
use super::setup::{BenchFacts, DeviceUnderTest};
use super::sheet::Sheet;
use super::site::{Topics, bench_of, certificates, reach, resolve, secured_files};
use super::virtual_run::{Silent, VirtualRun, run_silently};
use tck_base::clock::WallClock;
use tck_base::diagnostic::Diagnostic;
use tck_base::shard::Shard;
use tck_engine::{Composer, Engine, EngineError, Onlooker, Operator, RecordError, Recorder};
use tck_journal::event::{Event, Occurrence, Source as Seen};
use tck_journal::file::JournalWriter;
use tck_journal::{Journal, Reason, Vantage};
use tck_judge::Library;
use tck_judge::RunJudge;
use tck_net::bench::LinkError;
use tck_net::bench::endpoint::{Access, Endpoint};
use tck_net::bench::leavings::clear;
use tck_net::bench::own::OwnNames;
use tck_net::link::mqtt::{BenchInfo, BenchOptions, BrokerChoice, MqttBench, MqttLink};
use tck_pack::Pack;
use tck_profile::{Effective, Profile, Secrets, Surroundings};
use tck_simulate::{BuiltIn, UnknownName};
use tck_simulate::{Leavings, WithFleet};

/// A run over real sockets.
pub struct LiveRun {
    /// What is known of the device.
    pub device: DeviceUnderTest,
    /// What is run.
    pub request: Request,
    /// How the bench is put up.
    pub options: BenchOptions,
    /// How the device comes to be there.
    source: Source,
    /// Whether the device can reach the map server; `Err` says why not.
    maps: Result<(), Reason>,
    /// The records of a run that broke off, with which this one goes on; its clock has to go on with theirs.
    pub earlier: Option<Journal>,
    /// Where a device prints that the harness starts itself.
    pub device_log: Option<PathBuf>,
    /// Who keeps hold of such a device, and who is told at once what becomes of it.
    pub hold: Hold,
    /// Turns true when nobody waits any more for the run to end in good order.
    pub quit: Option<tokio::sync::watch::Receiver<bool>>,
    /// Where a person has ended the run, once one has; a signal says nothing of that.
    pub stopped_at: Arc<OnceLock<Place>>,
    /// Who is shown every record.
    pub onlooker: Option<Onlooker>,
    /// What the vehicle has left at its broker, once somebody has looked.
    overheard: Option<Overheard>,
}

/// What a device needs that the harness starts itself.
#[derive(Clone, Default)]
pub struct Hold {
    /// The program that can be called as a [`super::supervisor`].
    pub supervisor: Option<PathBuf>,
    /// Who looks on.
    pub tell: Option<Tell>,
}

/// Where the device comes from.
#[expect(clippy::large_enum_variant, reason = "there is one in a process")]
enum Source {
    BuiltIn {
        device: BuiltIn,
        faults: Vec<String>,
    },
    Profile {
        profile: Profile,
        folder: PathBuf,
        person: Option<Arc<dyn Person>>,
        secrets: Secrets,
    },
}

/// Why a run could not begin or go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The profile is wrong, or a file that it names.
    #[error("{}", titles(.0))]
    Profile(Vec<Diagnostic>),
    /// The built-in device has nothing of that name.
    #[error(transparent)]
    Unknown(#[from] UnknownName),
    /// Ports, broker or certificates.
    #[error(transparent)]
    Bench(#[from] LinkError),
    /// The journal cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The run cannot be carried out.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The device cannot be started (`NotFound` where its program is what cannot be started), or no port is free for it.
    #[error(transparent)]
    Device(#[from] std::io::Error),
}

fn titles(all: &[Diagnostic]) -> String {
    let titles: Vec<String> = all.iter().map(ToString::to_string).collect();
    titles.join("\n")
}

impl From<Vec<Diagnostic>> for RunError {
    fn from(all: Vec<Diagnostic>) -> Self {
        Self::Profile(all)
    }
}

impl LiveRun {
    /// All tests against a built-in device on loopback; in a hurry, and with these faults.
    #[must_use]
    pub fn built_in(mut device: BuiltIn, faults: &[String], library: &Library, pack: &Pack) -> Self {
        device.hurry();
        let tested = DeviceUnderTest::built_in(&device, false);
        Self {
            request: Request::all(device.role(), library, pack),
            options: BenchOptions::loopback(tested.published(pack)),
            device: tested,
            source: Source::BuiltIn {
                device,
                faults: faults.to_vec(),
            },
            maps: Ok(()),
            earlier: None,
            device_log: None,
            hold: Hold::default(),
            quit: None,
            stopped_at: Arc::default(),
            onlooker: None,
            overheard: None,
        }
    }

    /// All tests against the device of a profile. Its hooks are run in `folder`; its person is asked what they
    /// leave to one.
    ///
    /// # Errors
    /// What the profile lacks, and files or a password that it names and that are not there.
    pub fn of_profile(
        effective: &Effective,
        library: &Library,
        pack: &Pack,
        surroundings: &Surroundings,
        place: ProfileContext,
    ) -> Result<Self, Vec<Diagnostic>> {
        let profile = &effective.profile;
        let mut device = DeviceUnderTest::of_profile(effective, &library.rules.packs, pack, place.vehicles)?;
        if let (Some(fleet), Some(shard)) = (&mut device.fleet, place.shard) {
            fleet.keep(shard.of_many(fleet.vehicles.len()));
        }
        device.files = files(effective, place.profile.as_deref(), &place.folder);
        let topics = Topics {
            device: device.published(pack),
            harness: device.told(pack),
        };
        let options = bench_of(profile, topics, surroundings)?;
        let mut profile = profile.clone();
        let secrets = resolve(&mut profile, &options, surroundings)?;
        let profile = &profile;
        certificates(effective)?;
        let maps = match device.fleet {
            Some(_) => Ok(()),
            None => reach(&options, profile.device.command.is_some()),
        };
        Ok(Self {
            request: Request::all(profile.device.role, library, pack),
            options,
            device,
            source: Source::Profile {
                profile: profile.clone(),
                folder: place.folder,
                person: place.person,
                secrets,
            },
            maps,
            earlier: None,
            device_log: None,
            hold: Hold::default(),
            quit: None,
            stopped_at: Arc::default(),
            onlooker: None,
            overheard: None,
        })
    }

    /// Looks what a vehicle has left at a broker of its own: its factsheet says what it can do before it is there.
    ///
    /// # Errors
    /// When the address of the broker, or a certificate, cannot be used.
    pub fn overhear(&mut self, pack: &Pack) -> Result<(), RunError> {
        let (Source::Profile { .. }, BrokerChoice::External { url, access }, None) =
            (&self.source, &self.options.broker, &self.device.fleet)
        else {
            return Ok(());
        };
        let endpoint = Endpoint::parse(url, access)?;
        let Some(topic) = self.device.subject.topics(pack).remove("factsheet") else {
            return Ok(());
        };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()?;
        self.overheard = Some(runtime.block_on(overhear(
            endpoint,
            self.options.own.client("plan"),
            &topic,
            pack.names(),
        )));
        runtime.shutdown_background();
        Ok(())
    }

    /// What it would do, without a network: which tests, and what stands in the way of the others. What only the device
    /// can say is known of a built-in one; of others it is left open.
    #[must_use]
    pub fn plan(self, library: &Library, pack: &Pack) -> RunPlan {
        let (hooks, factsheet): (BTreeMap<String, How>, _) = match &self.source {
            Source::BuiltIn { device, .. } => {
                let hooks = device.hooks().iter().map(|name| ((*name).to_owned(), How::BuiltIn));
                (hooks.collect(), factsheet_of(device, library, pack))
            }
            Source::Profile { profile, .. } => {
                let hooks = profile.hooks.values();
                let hooks = hooks.map(|hook| (hook.name.clone(), How::of(&hook.action)));
                let sheet = match &self.overheard {
                    Some(Overheard::Factsheet(sheet)) => Some(sheet.clone()),
                    _ => None,
                };
                (hooks.collect(), sheet)
            }
        };
        let bench = BenchFacts {
            vantage: if self.options.tap {
                Vantage::Tap
            } else {
                Vantage::Subscriber
            },
            hooks: hooks.keys().cloned().collect(),
            unattended: Vec::new(),
            limits: Vec::new(),
            maps: self.maps,
            secured_files: secured_files(&self.options),
        };
        let retained = match (&self.device.fleet, &self.options.broker) {
            (Some(fleet), BrokerChoice::External { .. }) => fleet.retained(),
            _ => Vec::new(),
        };
        let subject = self.device.subject.clone();
        let time = Value::Object(self.device.time.bindings());
        let (_, mut setup) = self.device.on(bench, self.request, library, pack);
        if factsheet.is_some() && self.overheard.is_none() {
            let statements = &mut setup.capabilities.statements;
            statements.insert("active-map".to_owned(), true);
        }
        setup.capabilities.factsheet = factsheet.or(setup.capabilities.factsheet);
        RunPlan {
            retained,
            known_from: self.overheard.as_ref().map(Overheard::sentence),
            ..RunPlan::of(&subject, pack, &time, setup, (&hooks, &library.rules.hooks))
        }
    }

    /// Carries the run out on this thread until it is over, with nobody watching and without a bundle.
    ///
    /// # Errors
    /// When it cannot begin.
    pub fn carry_out_silently(self, library: &Library, pack: &Pack) -> Result<Finished, RunError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()?;
        let (_keep, interrupt) = tokio::sync::watch::channel(false);
        let finished = runtime.block_on(self.carry_out(library, pack, None, interrupt, &mut Silent, &mut |_| {}));
        // Sockets of a silent peer must not keep it from ending.
        runtime.shutdown_background();
        finished
    }

    /// Puts the bench up, carries the run out and takes everything down again.
    ///
    /// # Errors
    /// When it cannot begin. What breaks later is how the run ended.
    pub async fn carry_out(
        self,
        library: &Library,
        pack: &Pack,
        writer: Option<JournalWriter>,
        interrupt: tokio::sync::watch::Receiver<bool>,
        progress: &mut dyn Progress,
        saved: &mut dyn FnMut(&RunJudge),
    ) -> Result<Finished, RunError> {
        let clock = self.options.clock;
        let vantage = if self.options.tap {
            Vantage::Tap
        } else {
            Vantage::Subscriber
        };
        let rests = Rests::of(&self.device, &self.options)?;
        if let Some(rests) = &rests {
            let cleared = rests.clear().await?;
            if !cleared.is_empty() {
                progress.note(&format!(
                    "cleared what an earlier run has left on the broker: {}",
                    cleared.join(", ")
                ));
            }
        }
        let secured_files = secured_files(&self.options);
        let (link, info) = MqttBench::start(self.options).await?;
        let stage = Stage {
            library,
            pack,
            writer,
            interrupt,
            device: self.device,
            request: self.request,
            maps: self.maps,
            secured_files,
            vantage,
            clock,
            earlier: self.earlier,
            quit: self.quit,
            stopped_at: self.stopped_at,
            onlooker: self.onlooker,
            rests,
        };
        match self.source {
            Source::BuiltIn { device, faults } => {
                let faults: Vec<&str> = faults.iter().map(String::as_str).collect();
                let endpoint = Endpoint::parse(&info.device_address, &Access::default())?;
                let operator = Commands {
                    device: device.start(&faults, endpoint, clock)?,
                    hooks: device.hooks(),
                };
                stage.run(link, &info, operator, progress, saved).await
            }
            Source::Profile {
                profile,
                folder,
                person,
                secrets,
            } => {
                let means = Means {
                    authority: profile.bench.tls_ca.clone(),
                    secrets,
                };
                let onlookers = Onlookers {
                    reporter: Some(link.reporter()),
                    kin: link.kin(),
                    tell: self.hold.tell,
                    secrets: means.secrets.clone(),
                    supervisor: self.hold.supervisor,
                };
                let log = (self.device_log, onlookers);
                let operator = hooks_of(&profile, &info, log, folder, (person, means)).await?;
                progress.expects_device(&info);
                stage.run(link, &info, operator, progress, saved).await
            }
        }
    }
}

/// What belongs to a profile and does not stand in it.
#[derive(Clone, Debug, Default)]
pub struct ProfileContext {
    /// The file, if there is one.
    pub profile: Option<PathBuf>,
    /// Where its commands are run.
    pub folder: PathBuf,
    /// Who can be asked.
    pub person: Option<Arc<dyn Person>>,
    /// How many mock AGVs a master control gets at least; the usual number unless said.
    pub vehicles: Option<usize>,
    /// Which part of the mock AGVs, where other processes have the rest.
    pub shard: Option<Shard>,
}

/// Everything but link and operator.
struct Stage<'a> {
    library: &'a Library,
    pack: &'a Pack,
    writer: Option<JournalWriter>,
    interrupt: tokio::sync::watch::Receiver<bool>,
    device: DeviceUnderTest,
    request: Request,
    maps: Result<(), Reason>,
    secured_files: Result<(), Reason>,
    vantage: Vantage,
    clock: WallClock,
    earlier: Option<Journal>,
    quit: Option<tokio::sync::watch::Receiver<bool>>,
    stopped_at: Arc<OnceLock<Place>>,
    onlooker: Option<Onlooker>,
    rests: Option<Rests>,
}

/// What mock vehicles would leave behind on a broker of somebody else.
struct Rests {
    broker: Endpoint,
    own: OwnNames,
    leavings: Leavings,
}

impl Rests {
    /// `None` where nothing stays behind: vehicles of others are their own business, and the embedded broker goes with the run.
    fn of(device: &DeviceUnderTest, options: &BenchOptions) -> Result<Option<Self>, LinkError> {
        let (Some(fleet), BrokerChoice::External { url, access }) = (&device.fleet, &options.broker) else {
            return Ok(None);
        };
        Ok(Some(Self {
            broker: Endpoint::parse(url, access)?,
            own: options.own.clone(),
            leavings: fleet.leavings(),
        }))
    }

    /// Clears it, and names the topics.
    async fn clear(&self) -> Result<Vec<String>, LinkError> {
        let is_own = |topic: &str| self.leavings.is_own(topic);
        clear(&self.broker, self.own.client("clears"), self.leavings.filters(), is_own).await
    }
}

impl Stage<'_> {
    async fn run<O: Operator>(
        self,
        link: MqttLink,
        info: &BenchInfo,
        operator: O,
        progress: &mut dyn Progress,
        saved: &mut dyn FnMut(&RunJudge),
    ) -> Result<Finished, RunError> {
        let bench = BenchFacts {
            vantage: self.vantage,
            hooks: operator.hooks(),
            unattended: operator.unattended(),
            limits: info.limits.clone(),
            maps: self.maps,
            secured_files: self.secured_files,
        };
        let fleet = self.device.fleet.clone();
        let composer = Composer::new(&self.request.run).in_manners(self.request.manners.clone());
        let (header, setup) = self.device.on(bench, self.request, self.library, self.pack);
        let header = Box::new(header);
        let first = Occurrence::harness(self.clock.now(), Event::RunBegun { header });
        let mut recorder = Recorder::begin(&self.library.rules, self.writer, self.earlier, first)?;
        recorder.is_timed_by(self.clock);
        if let Some(onlooker) = self.onlooker {
            recorder.is_watched_by(onlooker);
        }
        let operator = match &fleet {
            None => WithFleet::alone(operator),
            Some(fleet) => WithFleet::start(operator, fleet, &info.broker, self.clock, &link.reporter()),
        };
        // It is recorded when it comes, whatever the harness is doing then.
        let (mut interrupted, reporter, stopped_at) = (self.interrupt.clone(), link.reporter(), self.stopped_at);
        let recorded = tokio::spawn(async move {
            if interrupted.wait_for(|interrupted| *interrupted).await.is_ok() {
                reporter.report(Seen::Operator, None, Event::Interrupted).await;
                if let Some(place) = stopped_at.get() {
                    let text = format!("the run was ended {place}");
                    reporter.report(Seen::Operator, None, Event::Note { text }).await;
                }
            }
        });
        let patience = Patience {
            interrupt: self.interrupt.clone(),
            quit: self.quit,
        };
        let mut engine = Engine::new(link, operator, recorder, composer, self.interrupt);
        let end = run(&mut engine, setup, progress, saved, patience.ends()).await;
        recorded.abort();
        let Engine {
            link,
            recorder,
            mut operator,
            ..
        } = engine;
        operator.end().await;
        operator.stop().await;
        if let Some(rests) = &self.rests
            && let Err(error) = rests.clear().await
        {
            progress.note(&format!(
                "retained messages of the mock vehicles may have stayed on the broker: {error}; the next run clears them"
            ));
        }
        link.stop().await;
        Ok(Finished {
            result: recorder.judge().result(),
            end,
            recorder,
        })
    }
}

/// What a built-in vehicle says it can do.
fn factsheet_of(device: &BuiltIn, library: &Library, pack: &Pack) -> Option<Sheet> {
    let mut run = VirtualRun::of_role(device.role(), library, pack);
    run.device = device.clone();
    run.tests = Selection::default();
    let finished = run_silently(library, pack, run).ok()?;
    let timeline = finished.recorder.judge().timeline();
    let mut sheets = timeline.of("factsheet").iter().rev();
    let message = sheets.find_map(|entry| entry.json())?;
    Some(Sheet::read(message, timeline.names()))
}
