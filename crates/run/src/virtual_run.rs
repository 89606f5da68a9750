//! A whole run against a built-in device in virtual time, in one process and without a network.

use std::time::Duration;

use serde_json::{Map, Value};

use super::request::Request;
use super::selection::Selection;
use super::session::{Finished, Progress, run};
use super::setup::{BenchFacts, DeviceUnderTest};
use tck_base::clock::{Moment, Stamp};
use tck_engine::{Composer, Engine, EngineError, HookOutcome, Manners, Operator, Recorder};
use tck_journal::event::{Event, Occurrence, Setting, ShardRecord};
use tck_journal::file::JournalWriter;
use tck_journal::{Journal, Reason, Vantage};
use tck_judge::Library;
use tck_judge::RunJudge;
use tck_net::bench::LinkError;
use tck_net::link::Link;
use tck_net::link::memory::{MemoryLink, MemoryOptions};
use tck_pack::{Pack, Role};
use tck_simulate::BuiltIn;
use tck_simulate::ReferenceAgv;
use tck_simulate::ReferenceMasterControl;
use tck_suite::model::{Step, Test};

/// What is run.
#[derive(Clone)]
pub struct VirtualRun {
    /// The device.
    pub device: BuiltIn,
    /// Names of its faults.
    pub faults: Vec<String>,
    /// The tests, in order.
    pub tests: Selection,
    /// Which cases that come from a schema are run; all of them without a seed.
    pub draw: Option<u64>,
    /// Seed of the jitter.
    pub seed: u64,
    /// Jitter on every packet.
    pub jitter: Duration,
    /// Packets arrive in bundles of this period.
    pub coalesce: Duration,
    /// From where the harness sees.
    pub vantage: Vantage,
    /// Whether the vehicle may drive; `Err` says why not.
    pub motion: Result<(), Reason>,
    /// When it begins; virtual time goes on from here.
    pub begun: jiff::Timestamp,
    /// Identifier of the run.
    pub run: String,
    /// The command line, for the record.
    pub command: Vec<String>,
    /// Whether the run ends after the first test that fails.
    pub fail_fast: bool,
    /// How often each test is run.
    pub repeat: u32,
    /// How long the run may take; tests that do not fit into it are left out.
    pub budget: Option<Duration>,
    /// The records of a run that broke off, with which this one goes on.
    pub earlier: Option<Journal>,
    /// Whether nothing is left to choose: the run is for a certificate.
    pub certifies: bool,
    /// Effective settings, for the record.
    pub settings: Vec<Setting>,
    /// What restricts the statement because of what was asked for, one sentence each.
    pub limits: Vec<String>,
    /// Which part of a run it is.
    pub shard: Option<ShardRecord>,
    /// How the harness words its messages.
    pub manners: Manners,
}

impl VirtualRun {
    /// All tests against the faultless reference AGV, always at the same time of the same day.
    pub fn of(library: &Library, pack: &Pack) -> Self {
        Self::of_role(Role::Agv, library, pack)
    }

    /// All tests against the faultless reference device of a role, always at the same time of the same day.
    pub fn of_role(role: Role, library: &Library, pack: &Pack) -> Self {
        let device = match role {
            Role::Agv => ReferenceAgv::new(pack).into(),
            Role::MasterControl => ReferenceMasterControl::new(pack).into(),
        };
        Self {
            device,
            faults: Vec::new(),
            tests: Selection::all(library.tests(role, &pack.id)),
            draw: Some(1),
            seed: 1,
            jitter: Duration::ZERO,
            coalesce: Duration::ZERO,
            vantage: Vantage::Tap,
            motion: Ok(()),
            begun: jiff::Timestamp::UNIX_EPOCH,
            run: "virtual".to_owned(),
            command: Vec::new(),
            fail_fast: false,
            repeat: 1,
            budget: None,
            earlier: None,
            certifies: false,
            settings: Vec::new(),
            limits: Vec::new(),
            shard: None,
            manners: Manners::default(),
        }
    }
}

/// Hooks are commands to the device on the bus.
struct OnTheBus(&'static [&'static str]);

impl Operator for OnTheBus {
    fn hooks(&self) -> Vec<String> {
        self.0.iter().map(|hook| (*hook).to_owned()).collect()
    }

    async fn run(&mut self, _hook: &str, _parameters: Map<String, Value>) -> HookOutcome {
        HookOutcome::Missing
    }

    fn runs_on_the_link(&self) -> bool {
        true
    }
}

/// When a run begins that goes on with another one.
#[must_use]
pub fn going_on_at(earlier: Option<&Journal>) -> Moment {
    let last = earlier.and_then(|journal| journal.entries().last());
    last.map_or(Moment::START, |last| last.at().moment + Duration::from_secs(1))
}

/// Carries it out.
///
/// # Errors
/// When the journal cannot be written or judged.
pub async fn run_virtually(
    library: &Library,
    pack: &Pack,
    request: VirtualRun,
    writer: Option<JournalWriter>,
    interrupt: tokio::sync::watch::Receiver<bool>,
    progress: &mut dyn Progress,
    saved: &mut dyn FnMut(&RunJudge),
) -> Result<Finished, EngineError> {
    let device = &request.device;
    let start = Stamp {
        moment: going_on_at(request.earlier.as_ref()),
        utc: request.begun,
    };
    let faults: Vec<&str> = request.faults.iter().map(String::as_str).collect();
    let peer = device
        .peer(&faults)
        .map_err(|error| LinkError::Setup(error.to_string()))?;
    let options = MemoryOptions {
        device_topics: match device.fleet() {
            Some(fleet) => fleet.commanded(),
            None => device.subject().published(pack),
        },
        jitter: request.jitter,
        seed: request.seed,
        coalesce: request.coalesce,
        vantage: request.vantage,
        ..MemoryOptions::default()
    };
    let mut link = MemoryLink::new(start, vec![peer], options);
    for mock in device.mock_peers() {
        link.add_own_peer(mock);
    }
    let operator = OnTheBus(device.hooks());
    let mut tested = DeviceUnderTest::built_in(device, true);
    tested.settings.clone_from(&request.settings);
    if let Err(why) = &request.motion {
        tested.stand_still(why.clone());
    }
    let bench = BenchFacts {
        vantage: request.vantage,
        hooks: operator.hooks(),
        unattended: operator.unattended(),
        limits: Vec::new(),
        maps: Ok(()),
        secured_files: Ok(()),
    };
    let composer = Composer::new(&request.run).in_manners(request.manners.clone());
    let asked = Request {
        tests: request.tests,
        draw: request.draw,
        run: request.run,
        command: request.command,
        fail_fast: request.fail_fast,
        repeat: request.repeat,
        budget: request.budget,
        certifies: request.certifies,
        limits: request.limits,
        shard: request.shard,
        manners: request.manners,
    };
    let (header, setup) = tested.on(bench, asked, library, pack);
    let header = Box::new(header);
    let first = Occurrence::harness(link.now(), Event::RunBegun { header });
    let recorder = Recorder::begin(&library.rules, writer, request.earlier, first)?;
    let mut engine = Engine::new(link, operator, recorder, composer, interrupt);
    let end = run(&mut engine, setup, progress, saved, std::future::pending()).await;
    let recorder = engine.recorder;
    Ok(Finished {
        result: recorder.judge().result(),
        end,
        recorder,
    })
}

/// Nobody is watching.
pub struct Silent;

impl tck_engine::Watcher for Silent {
    fn waiting(&mut self, _step: &Step) {}
}

impl Progress for Silent {
    fn planned(&mut self, _plan: &tck_journal::event::Plan) {}
    fn test_begun(&mut self, _test: &Test, _number: usize, _of: usize) {}
    fn test_ended(&mut self, _result: &tck_result::TestResult) {}
    fn note(&mut self, _text: &str) {}
}

/// Carries it out on this thread, with nobody watching.
///
/// # Errors
/// When the journal cannot be judged.
pub fn run_silently(library: &Library, pack: &Pack, request: VirtualRun) -> Result<Finished, EngineError> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .build()
        .map_err(tck_engine::RecordError::Write)?;
    let (_keep, interrupt) = tokio::sync::watch::channel(false);
    runtime.block_on(run_virtually(
        library,
        pack,
        request,
        None,
        interrupt,
        &mut Silent,
        &mut |_| {},
    ))
}
