//! `run` and `certify`: test a device, write the evidence, say the verdict.

mod conclude;
mod hooks;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::args;
use super::device::{check_faults, claims, pack_of, statements, tolerate};
use super::exit::Exit;
use super::problem::Problem;
use super::screen::Screen;
use crate::clock::WallClock;
use crate::course::Layout;
use crate::diagnostic::Diagnostic;
use crate::engine::{Composer, Engine, Operator, Recorder};
use crate::journal::event::{Event, Occurrence, Setting};
use crate::judge::RunJudge;
use crate::link::mqtt::endpoint::{Credentials, Endpoint};
use crate::link::mqtt::{BenchInfo, BenchOptions, BrokerChoice, MqttBench, MqttLink};
use crate::link::{LinkError, Vantage};
use crate::pack::{Pack, Role};
use crate::profile::{self, Effective, Profile, Surroundings, TimeLimits};
use crate::run::{
    BuiltIn, Bundle, Capabilities, Finished, Fleet, HeaderParts, Library, ReferenceAgv, ReferenceMasterControl, Setup,
    Subject, USUAL_FLEET, VirtualRun, WithFleet, run, run_virtually, write_result,
};
use crate::suite::model::Test;

/// What `run` and `certify` have in common.
struct Job {
    library: Library,
    pack: Arc<Pack>,
    effective: Effective,
    tests: Vec<Arc<Test>>,
    complete: bool,
    /// Which cases that come from a schema are run.
    draw: Option<u64>,
    output: args::OutputArgs,
    command: Vec<String>,
    run: String,
    no_motion: bool,
    certifies: bool,
    /// How many mock AGVs there are when a master control is tested.
    vehicles: usize,
}

/// `run`.
pub fn run_command(arguments: &args::Run) -> Result<Exit, Problem> {
    let surroundings = Surroundings::of_process();
    let effective = profile::load(
        arguments.device.profile.as_deref(),
        &arguments.device.settings(),
        &surroundings,
    )?;
    let library = Library::load(arguments.suites.suites.as_deref())?;
    let pack = pack_of(&library, &effective)?;
    let role = effective.profile.device.role;
    let all = library.tests(role, &pack.id);
    let mut tests = super::select::select(&all, &arguments.tests)?;
    if let Some(shard) = arguments.shard {
        let mut place = 0;
        tests.retain(|_| {
            place += 1;
            shard.takes(place - 1)
        });
    }
    if tests.is_empty() {
        return Err(Problem::NothingToDo("no test was selected".to_owned()));
    }
    let random = uuid::Uuid::new_v4();
    let run = match arguments.seed {
        Some(seed) => format!("seed{seed}"),
        None => random.simple().to_string()[..8].to_owned(),
    };
    // Whoever names a single case means it; the parts of one run have to draw the same.
    let whole = arguments.thorough || arguments.tests.iter().any(|pattern| pattern.contains('['));
    let draw = match arguments.seed {
        _ if whole => None,
        Some(seed) => Some(seed),
        None if arguments.shard.is_some() || arguments.certificate => Some(1),
        None => Some(u64::from(random.as_fields().0)),
    };
    let device = &effective.profile.device;
    let built_in =
        arguments.device.profile.is_none() && device.manufacturer.is_none() && device.serial_number.is_none();
    let altered = !arguments.fault.is_empty()
        || !arguments.tolerance.is_empty()
        || arguments.vehicle.0 != crate::run::Vehicle::default();
    if !built_in && altered {
        let title = "`--fault`, `--tolerance` and `--vehicle` are for the built-in device, and another device is tested \
                     here";
        return Err(Diagnostic::whole("usage", title).into());
    }
    if role == Role::MasterControl && arguments.vehicle.0 != crate::run::Vehicle::default() {
        let title = "`--vehicle` is for the reference AGV, and a master control is tested here";
        return Err(Diagnostic::whole("usage", title).into());
    }
    if role == Role::Agv && arguments.vehicles.is_some() {
        let title = "`--vehicles` is for a master control under test, and an AGV is tested here";
        return Err(Diagnostic::whole("usage", title)
            .hint("add `--role master-control`")
            .into());
    }
    check_faults(role, &arguments.fault)?;
    let job = Job {
        complete: tests.len() == all.len(),
        draw,
        library,
        pack,
        effective,
        tests,
        output: arguments.output.clone(),
        command: std::env::args().collect(),
        run,
        no_motion: arguments.device.no_motion,
        certifies: arguments.certifies,
        vehicles: arguments.vehicles.map_or(USUAL_FLEET, |count| count as usize),
    };
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    let outcome = runtime.block_on(async {
        let interrupt = interrupts();
        if arguments.in_virtual_time {
            job.virtually(arguments, interrupt).await
        } else if built_in {
            job.built_in(arguments, interrupt).await
        } else {
            job.device(arguments, interrupt, &surroundings).await
        }
    });
    // Sockets of a silent peer must not keep the process from ending.
    runtime.shutdown_background();
    outcome
}

/// `certify`: the same with nothing left to choose.
pub fn certify_command(arguments: &args::Certify) -> Result<Exit, Problem> {
    let surroundings = Surroundings::of_process();
    let effective = profile::load(arguments.profile.as_deref(), &[], &surroundings)?;
    let contract = effective.profile.time.contract();
    if let Some(changed) = contract.first() {
        let diagnostic = Diagnostic::whole(
            "certify",
            format!("a certificate is given for default timings, and {changed}"),
        );
        return Err(diagnostic
            .hint("take it out of the section [time] of the profile, or wherever `run -v` says it comes from, or use `run`")
            .into());
    }
    let device = &effective.profile.device;
    let is_foreign = arguments.profile.is_some() || device.manufacturer.is_some() || device.serial_number.is_some();
    if is_foreign && device.role == Role::Agv && !effective.profile.motion.allowed {
        let title = "a certificate is about driving, too, and the profile does not allow motion";
        return Err(Diagnostic::whole("certify", title)
            .hint(
                "set `allowed = true` in the section [motion] of the profile where the vehicle may drive, or use `run`",
            )
            .into());
    }
    run_command(&args::Run {
        certifies: true,
        device: args::DeviceArgs {
            profile: arguments.profile.clone(),
            ..args::DeviceArgs::default()
        },
        output: arguments.output.clone(),
        thorough: arguments.thorough,
        certificate: true,
        ..args::Run::default()
    })
}

/// Ctrl-C once ends the run in good order, twice at once.
fn interrupts() -> watch::Receiver<bool> {
    let (sender, receiver) = watch::channel(false);
    tokio::spawn(async move {
        let mut times = 0;
        while tokio::signal::ctrl_c().await.is_ok() {
            times += 1;
            if times > 1 {
                std::process::exit(i32::from(Exit::Interrupted.code()));
            }
            let _ = sender.send(true);
        }
        // The sender stays alive as long as the process.
        std::future::pending::<()>().await;
    });
    receiver
}

impl Job {
    fn bundle(&self, subject: &Subject, utc: jiff::Timestamp) -> Result<Bundle, Problem> {
        let bundle = Bundle::create(
            &self.output.out,
            &subject.manufacturer,
            &subject.serial_number,
            utc,
            &self.run,
        );
        bundle.map_err(|error| Problem::Environment(error.to_string()))
    }

    async fn virtually(self, arguments: &args::Run, interrupt: watch::Receiver<bool>) -> Result<Exit, Problem> {
        let mut device = self.built_in_device(arguments);
        tolerate(&mut device, &arguments.tolerance)?;
        let utc = WallClock::start().now().utc;
        let bundle = self.bundle(device.subject(), utc)?;
        let writer = bundle
            .journal()
            .map_err(|error| Problem::Environment(error.to_string()))?;
        let device_name = device.subject().to_string();
        let mut request = VirtualRun::of_role(device.role(), &self.library, &self.pack);
        request.device = device;
        request.faults.clone_from(&arguments.fault);
        request.tests.clone_from(&self.tests);
        request.complete = self.complete;
        request.draw = self.draw;
        request.seed = arguments.seed.unwrap_or(1);
        request.begun = utc;
        request.run.clone_from(&self.run);
        request.command.clone_from(&self.command);
        request.motion = self.motion();
        let mut terminal = self.screen(&device_name);
        let mut saved = saving(&bundle);
        let finished = run_virtually(
            &self.library,
            &self.pack,
            request,
            Some(writer),
            interrupt,
            &mut terminal,
            &mut saved,
        )
        .await;
        let finished = finished.map_err(|error| Problem::Environment(error.to_string()))?;
        self.conclude(&bundle, finished, terminal)
    }

    fn built_in_device(&self, arguments: &args::Run) -> BuiltIn {
        match self.effective.profile.device.role {
            Role::Agv => ReferenceAgv::of(arguments.vehicle.0, &self.pack).into(),
            Role::MasterControl => ReferenceMasterControl::with_vehicles(self.vehicles, &self.pack).into(),
        }
    }

    async fn built_in(self, arguments: &args::Run, interrupt: watch::Receiver<bool>) -> Result<Exit, Problem> {
        let mut device = self.built_in_device(arguments);
        device.hurry();
        tolerate(&mut device, &arguments.tolerance)?;
        let mut options = BenchOptions::loopback(match device.fleet() {
            Some(fleet) => fleet.commanded(&self.pack),
            None => device.subject().published(&self.pack),
        });
        let bench = &self.effective.profile.bench;
        if arguments.device.listen.is_some() {
            options.listen.clone_from(&bench.listen);
        }
        options.broker = broker_choice(bench.broker.as_deref(), &self.effective.profile, None);
        let clock = options.clock;
        let bundle = self.bundle(device.subject(), clock.origin_stamp().utc)?;
        let (link, info) = MqttBench::start(options).await.map_err(link_problem)?;
        let faults: Vec<&str> = arguments.fault.iter().map(String::as_str).collect();
        let endpoint = Endpoint::parse(&info.device_address, None, None).map_err(link_problem)?;
        let running = device.start(&faults, endpoint, clock);
        let operator = hooks::Commands {
            device: running.map_err(|error| Problem::from(Diagnostic::whole("fault", error.to_string())))?,
            hooks: device.hooks(),
        };
        let capabilities = Capabilities {
            factsheet: None,
            statements: device.statements(),
            samples: device.device_bindings(),
            claims: BTreeMap::new(),
            vantage: Vantage::Tap,
            hooks: operator.hooks(),
            maps: true,
            motion: self.motion(),
            claims_add: true,
        };
        let session = SessionParts {
            subject: device.subject().clone(),
            time: device.time().clone(),
            device: device.device_bindings(),
            layout: Some(device.layout().clone()),
            capabilities,
            limits: vec![device.limit(false)],
            deviations: BTreeMap::new(),
            fleet: device.fleet().cloned(),
        };
        let at = Surrounding { info: &info, clock };
        self.carry_out(session, &bundle, link, operator, &at, interrupt).await
    }

    async fn device(
        self,
        arguments: &args::Run,
        interrupt: watch::Receiver<bool>,
        surroundings: &Surroundings,
    ) -> Result<Exit, Problem> {
        let profile = self.effective.profile.clone();
        let subject = Self::subject(&profile)?;
        let layout = Layout::of_profile(&profile)?;
        let fleet = match subject.role {
            Role::Agv => None,
            Role::MasterControl => Some(self.fleet(&profile, layout.as_ref())),
        };
        let password = profile.bench.password.password(surroundings);
        let password = password.map_err(|error| Problem::from(Diagnostic::whole("password", error.to_string())))?;
        let credentials = profile.bench.username.clone().map(|username| Credentials {
            username,
            password: password
                .map(|password| password.reveal().to_owned())
                .unwrap_or_default(),
        });
        let mut options = BenchOptions::loopback(match &fleet {
            Some(fleet) => fleet.commanded(&self.pack),
            None => subject.published(&self.pack),
        });
        options.listen.clone_from(&profile.bench.listen);
        options.tap = profile.bench.tap;
        options.maps_listen.clone_from(&profile.bench.maps_listen);
        options.tls = match (&profile.bench.tls_cert, &profile.bench.tls_key) {
            (Some(certificate), Some(key)) => Some(crate::tap::tls::TlsFiles {
                certificate: certificate.clone(),
                key: key.clone(),
            }),
            _ => None,
        };
        options.broker = broker_choice(profile.bench.broker.as_deref(), &profile, credentials);
        let clock = options.clock;
        let tap = options.tap;
        let bundle = self.bundle(&subject, clock.origin_stamp().utc)?;
        let (link, info) = MqttBench::start(options).await.map_err(link_problem)?;
        let folder = arguments
            .device
            .profile
            .as_deref()
            .and_then(Path::parent)
            .map_or_else(PathBuf::new, Path::to_path_buf);
        let operator = hooks::of_profile(&profile, &info, &bundle, &folder)?;
        eprintln!("the device is expected at mqtt://{}", info.device_address);
        let motion = match (self.no_motion, profile.motion.allowed) {
            // The vehicles are the harness's own.
            _ if fleet.is_some() => Ok(()),
            (true, _) => Err(NO_MOTION.to_owned()),
            (false, false) => Err("the profile does not allow motion ([motion] allowed = true)".to_owned()),
            (false, true) => Ok(()),
        };
        let limits: Vec<String> = profile.time.contract().iter().map(ToString::to_string).collect();
        let capabilities = Capabilities {
            factsheet: None,
            statements: statements(&profile.device),
            samples: profile.device.bindings(),
            claims: claims(&profile.device),
            vantage: if tap { Vantage::Tap } else { Vantage::Subscriber },
            hooks: operator.hooks(),
            maps: true,
            motion,
            claims_add: !self.certifies,
        };
        let session = SessionParts {
            subject,
            time: profile.time.clone(),
            device: profile.device.bindings(),
            layout: layout.or_else(|| fleet.is_some().then(Layout::built_in)),
            fleet,
            capabilities,
            limits,
            deviations: profile
                .deviations
                .iter()
                .map(|deviation| (deviation.requirement.as_str().to_owned(), deviation.reason.clone()))
                .collect(),
        };
        let at = Surrounding { info: &info, clock };
        self.carry_out(session, &bundle, link, operator, &at, interrupt).await
    }

    /// The mock AGVs of a profile.
    fn fleet(&self, profile: &Profile, layout: Option<&Layout>) -> Fleet {
        let mut like = ReferenceAgv::new(&self.pack);
        if let Some(layout) = layout {
            like.live_on(layout.clone());
        }
        like.furnish(&profile.device.sample_actions);
        like.subject.topic_template.clone_from(&profile.device.topic_template);
        let wanted = &profile.vehicles;
        let count = self.vehicles.max(wanted.serial_numbers.len());
        let mut fleet = Fleet::new(&like, &wanted.manufacturer, &wanted.serial_numbers, count, &self.pack);
        if let (Some(vehicle), Some(node)) = (fleet.vehicles.first_mut(), &wanted.start_node) {
            vehicle.config.start_node.clone_from(node);
        }
        fleet
    }

    fn motion(&self) -> Result<(), String> {
        if self.no_motion {
            Err(NO_MOTION.to_owned())
        } else {
            Ok(())
        }
    }

    fn screen(&self, device: &str) -> Screen {
        let results = self.output.format == args::Format::Text;
        if self.output.verbose > 0 {
            for setting in &self.effective.settings {
                eprintln!("{} = {}  ({})", setting.name, setting.value, setting.origin);
            }
        }
        Screen::new(device.to_owned(), self.pack.version.to_string(), results)
    }

    fn subject(profile: &Profile) -> Result<Subject, Problem> {
        let missing = |setting: &str, flag: &str| -> Problem {
            let title = format!("the device is not named: `{setting}` is missing");
            let diagnostic = Diagnostic::whole("missing-setting", title);
            diagnostic.hint(format!("set it in the profile, or with {flag}")).into()
        };
        let device = &profile.device;
        Ok(Subject {
            role: device.role,
            manufacturer: device
                .manufacturer
                .clone()
                .ok_or_else(|| missing("device.manufacturer", "--manufacturer"))?,
            serial_number: device
                .serial_number
                .clone()
                .ok_or_else(|| missing("device.serial-number", "--serial"))?,
            topic_template: device.topic_template.clone(),
        })
    }

    async fn carry_out<O: Operator>(
        self,
        session: SessionParts,
        bundle: &Bundle,
        link: MqttLink,
        operator: O,
        at: &Surrounding<'_>,
        interrupt: watch::Receiver<bool>,
    ) -> Result<Exit, Problem> {
        let device_name = session.subject.to_string();
        let mocks = session.fleet.as_ref();
        let mocks = mocks.map_or_else(Vec::new, |fleet| fleet.mock_vehicles(&self.pack));
        let vehicles = mocks.len();
        let header = HeaderParts {
            subject: &session.subject,
            pack: &self.pack,
            run: &self.run,
            vantage: session.capabilities.vantage,
            suites: &self.library.rules.sha256,
            modified: self.library.assets.modified(),
            time: session.time.bindings(),
            device: session.device,
            vehicles: mocks,
            fleet: session.fleet.as_ref().map_or_else(Vec::new, Fleet::bindings),
            settings: settings(&self.effective),
            command: self.command.clone(),
        };
        let first = Occurrence::harness(
            at.clock.now(),
            Event::RunBegun {
                header: Box::new(header.header()),
            },
        );
        let writer = bundle
            .journal()
            .map_err(|error| Problem::Environment(error.to_string()))?;
        let recorder = Recorder::begin(&self.library.rules, Some(writer), first);
        let recorder = recorder.map_err(|error| Problem::Environment(error.to_string()))?;
        let operator = match &session.fleet {
            None => WithFleet::alone(operator),
            Some(fleet) => WithFleet::start(operator, fleet, &at.info.broker, at.clock, &link.reporter())
                .map_err(|error| Problem::Environment(error.to_string()))?,
        };
        let mut engine = Engine::new(link, operator, recorder, Composer::new(&self.run), interrupt);
        let setup = Setup {
            tests: self.tests.clone(),
            complete: self.complete,
            draw: self.draw,
            capabilities: session.capabilities,
            layout: session.layout,
            vehicles,
            deviations: session.deviations,
            limits: session.limits,
            run: self.run.clone(),
        };
        let mut terminal = self.screen(&device_name);
        let mut saved = saving(bundle);
        let end = run(&mut engine, setup, &mut terminal, &mut saved).await;
        let Engine {
            link,
            recorder,
            operator,
            ..
        } = engine;
        operator.stop().await;
        link.stop().await;
        let finished = Finished {
            result: recorder.judge().result(),
            end,
            recorder,
        };
        self.conclude(bundle, finished, terminal)
    }
}

/// How long a result on the disk may be behind the journal. Written after every test, the results of a long run cost more
/// than the run; what a crash leaves is complete in the journal, and `report` reads it from there.
const SAVED_EVERY: Duration = Duration::from_secs(5);

/// Keeps `result.json` on the disk while a run goes on.
fn saving(bundle: &Bundle) -> impl FnMut(&RunJudge) + '_ {
    let mut last: Option<Instant> = None;
    move |judge| {
        if last.is_none_or(|last| last.elapsed() >= SAVED_EVERY) {
            last = Some(Instant::now());
            drop(write_result(bundle, &judge.result()));
        }
    }
}

const NO_MOTION: &str = "motion was ruled out by --no-motion";

/// What differs between the built-in device and one of a profile.
struct SessionParts {
    subject: Subject,
    time: TimeLimits,
    device: serde_json::Map<String, serde_json::Value>,
    layout: Option<Layout>,
    capabilities: Capabilities,
    limits: Vec<String>,
    deviations: BTreeMap<String, String>,
    /// The mock AGVs, when a master control is tested.
    fleet: Option<Fleet>,
}

/// Where a run over real sockets takes place.
struct Surrounding<'a> {
    info: &'a BenchInfo,
    clock: WallClock,
}

fn settings(effective: &Effective) -> Vec<Setting> {
    effective.settings.clone()
}

fn link_problem(error: LinkError) -> Problem {
    Problem::Environment(error.to_string())
}

fn broker_choice(url: Option<&str>, profile: &Profile, credentials: Option<Credentials>) -> BrokerChoice {
    match url {
        None => BrokerChoice::Embedded,
        Some(url) => BrokerChoice::External {
            url: url.to_owned(),
            authority: profile.bench.tls_ca.clone(),
            credentials,
        },
    }
}
