//! `run`: test a device, write the evidence, say the verdict.

mod conclude;
mod prepared;
mod resume;
mod saving;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::watch;

use prepared::prepared;
use resume::{AboutRun, Earlier};
use saving::saving;

use super::args;
use super::device::tolerate;
use super::ending::Ending;
use super::events::{About, Followed};
use super::exit::Exit;
use super::like::Harness;
use super::outputs::Outputs;
use super::page::{self, ServedPage};
use super::problem::Problem;
use super::reference::{self, Asked};
use super::screen::{Screen, Show};
use crate::ui::Prompter;
use tck_base::clock::WallClock;
use tck_base::diagnostic::{Diagnostic, Source, Span};
use tck_base::secrets::Secrets;
use tck_base::shard::Shard;
use tck_journal::event::Setting;
use tck_journal::file::JournalWriter;
use tck_journal::{Reason, Vantage};
use tck_judge::Library;
use tck_net::bench::LinkError;
use tck_net::bench::endpoint::Access;
use tck_net::bench::tls::TlsFiles;
use tck_net::link::mqtt::BrokerChoice;
use tck_pack::Participant;
use tck_pack::{Pack, Role};
use tck_page::Page;
use tck_profile::{Effective, Surroundings};
use tck_report::statement::many;
use tck_run::{
    Answering, AnsweringError, Bundle, Hold, LATEST, LiveRun, Person, ProfileContext, Request, RunError, RunPlan,
    VirtualRun, going_on_at, run_virtually,
};
use tck_simulate::{BuiltIn, ReferenceAgv, ReferenceMasterControl, USUAL_FLEET};

pub(super) use prepared::check;

/// What `run` and `certify` have in common.
struct Job {
    desk: Prompter,
    /// The page for people elsewhere, where there is one.
    page: Option<Page>,
    library: Library,
    pack: Arc<Pack>,
    effective: Effective,
    request: Request,
    output: args::OutputArgs,
    no_motion: bool,
    certifies: bool,
    /// The run that this one goes on with.
    earlier: Option<Earlier>,
    /// How many mock AGVs are asked for when a master control is tested.
    vehicles: Option<usize>,
    /// How the harness behaves.
    harness: Harness,
    /// Turns true when nobody waits any more for the run to end in good order.
    quit: Option<watch::Receiver<bool>>,
}

/// `run`.
pub fn run_command(arguments: &args::Run, outputs: &Outputs<'_>) -> Result<Exit, Problem> {
    let surroundings = Surroundings::of_process();
    let library = crate::assets::library(arguments.suites.own())?;
    let (mut job, built_in) = prepared(arguments, library, &surroundings, &super::tell)?;
    super::open_files::allow(arguments.vehicles.unwrap_or_default());
    if arguments.selection.plan {
        if !arguments.pipeline.renderings.is_empty() {
            let title = "a plan runs nothing, so there is nothing that `--as` could write";
            return Err(Diagnostic::whole("usage", title)
                .hint("leave one of the two out")
                .into());
        }
        return job.plan(arguments, built_in, &surroundings);
    }
    if job.certifies && !built_in {
        let mut plan = job.of_profile(arguments, &surroundings)?;
        plan.overhear(&job.pack).map_err(|error| job.could_not_begin(error))?;
        super::plan::complete(&job.planned(plan))?;
    }
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    let mut desk = job.desk.clone();
    let mut served = None;
    let outcome = runtime.block_on(async {
        let ending = Ending::listen()?;
        let interrupt = ending.interrupt.clone();
        job.desk = ending.desk.clone();
        job.quit = Some(ending.quit);
        desk = job.desk.clone();
        let answering = match &arguments.people.questions {
            Some(listen) => Some(Answering::start(listen, desk.board()).await.map_err(not_answering)?),
            None => None,
        };
        if let Some(answering) = &answering {
            eprintln!("questions are answered at {} (docs/events.md)", answering.url());
        }
        if !arguments.in_virtual_time {
            served = ServedPage::start(&job.effective, &desk, interrupt.clone()).await?;
            job.page = served.as_ref().map(|served| served.page.clone());
        }
        if arguments.in_virtual_time {
            job.virtually(arguments, interrupt, outputs).await
        } else if built_in {
            job.built_in(arguments, interrupt, outputs).await
        } else {
            job.device(arguments, interrupt, &surroundings, outputs).await
        }
    });
    if let Some(served) = served {
        runtime.block_on(served.finish());
    }
    // Sockets of a silent peer must not keep the process from ending.
    runtime.shutdown_background();
    desk.at_rest();
    outcome
}

/// Who keeps hold of a device that a run starts, and where it is said at once what becomes of it.
pub(super) fn hold(desk: &Prompter) -> Hold {
    let desk = desk.clone();
    Hold {
        // Where this program cannot be found, the process group of the device has to do.
        supervisor: std::env::current_exe().ok(),
        tell: Some(Arc::new(move |text| desk.say(text))),
    }
}

/// The desk, where somebody sits there who can be asked, or can answer from elsewhere.
pub(super) fn person(desk: &Prompter, answers_elsewhere: bool) -> Option<Arc<dyn Person>> {
    (answers_elsewhere || Prompter::is_attended()).then(|| Arc::new(desk.clone()) as Arc<dyn Person>)
}

impl Job {
    fn bundle(&self, subject: &Participant, utc: jiff::Timestamp) -> Result<Bundle, Problem> {
        let bundle = Bundle::create(
            &self.output.out,
            &subject.manufacturer,
            &subject.serial_number,
            utc,
            &self.request.run,
        );
        let bundle = bundle.map_err(environment)?;
        if bundle.is_one_of_several() {
            super::tell(&format!(
                "another run is going on below {}, so `{LATEST}` leads to neither of them; give each a folder of its own with \
                 --out",
                self.output.out.display()
            ));
        }
        Ok(bundle)
    }

    /// Shows what would be run.
    fn plan(self, arguments: &args::Run, built_in: bool, surroundings: &Surroundings) -> Result<Exit, Problem> {
        let mut run = if built_in {
            LiveRun::built_in(self.built_in_device(arguments)?, &[], &self.library, &self.pack)
        } else {
            self.of_profile(arguments, surroundings)?
        };
        if self.no_motion {
            run.device.stand_still(Reason::MotionRuledOut);
        }
        run.overhear(&self.pack).map_err(|error| self.could_not_begin(error))?;
        let plan = self.planned(run);
        if let Some(file) = &arguments.selection.floor {
            super::plan::draw(&plan, file)?;
        }
        super::plan::show(&plan, self.output.format)
    }

    fn planned(&self, mut run: LiveRun) -> RunPlan {
        run.request.clone_from(&self.request);
        run.plan(&self.library, &self.pack)
    }

    fn of_profile(&self, arguments: &args::Run, surroundings: &Surroundings) -> Result<LiveRun, Problem> {
        let profile = arguments.device.profile.as_deref();
        let place = ProfileContext {
            profile: profile.map(Path::to_owned),
            folder: profile
                .and_then(Path::parent)
                .map_or_else(PathBuf::new, Path::to_path_buf),
            person: person(
                &self.desk,
                arguments.people.questions.is_some() || self.effective.profile.bench.page.is_some(),
            ),
            vehicles: self.vehicles,
            shard: self
                .request
                .shard
                .as_ref()
                .filter(|_| self.effective.profile.device.command.is_none())
                .and_then(|own| Shard::new(own.index, own.of)),
        };
        let mut run = LiveRun::of_profile(&self.effective, &self.library, &self.pack, surroundings, place)?;
        run.device.claims_add = !self.certifies;
        self.harness.shape(run.device.fleet.as_mut());
        run.device.settings.extend(self.harness.setting());
        Ok(run)
    }

    async fn virtually(
        self,
        arguments: &args::Run,
        interrupt: watch::Receiver<bool>,
        outputs: &Outputs<'_>,
    ) -> Result<Exit, Problem> {
        let device = self.built_in_device(arguments)?;
        let utc = WallClock::start().now().utc;
        let settings = self.settings(arguments);
        self.is_resumable(&AboutRun {
            subject: device.subject(),
            vantage: Vantage::Tap.word(),
            mode: mode(self.certifies),
            settings: &settings,
            files: &BTreeMap::new(),
        })?;
        let bundle = self.bundle(device.subject(), utc)?;
        let writer = self.journal(&bundle)?;
        let mut terminal = self.screen(device.subject(), &bundle)?;
        let mut run = VirtualRun::of_role(device.role(), &self.library, &self.pack);
        run.device = device;
        run.faults.clone_from(&arguments.fault);
        run.tests.clone_from(&self.request.tests);
        run.draw = self.request.draw;
        run.seed = arguments.seed.unwrap_or(1);
        run.begun = utc;
        run.run.clone_from(&self.request.run);
        run.command.clone_from(&self.request.command);
        run.fail_fast = self.request.fail_fast;
        run.repeat = self.request.repeat;
        run.budget = self.request.budget;
        run.limits.clone_from(&self.request.limits);
        run.manners.clone_from(&self.request.manners);
        run.shard.clone_from(&self.request.shard);
        run.settings = settings;
        run.earlier = self.earlier.as_ref().map(|earlier| earlier.journal.clone());
        if self.no_motion {
            run.motion = Err(Reason::MotionRuledOut);
        }
        let mut saved = saving(&bundle, None);
        let finished = run_virtually(
            &self.library,
            &self.pack,
            run,
            Some(writer),
            interrupt,
            &mut terminal,
            &mut saved,
        )
        .await;
        self.conclude(&bundle, finished.map_err(environment)?, terminal, outputs)
    }

    fn built_in_device(&self, arguments: &args::Run) -> Result<BuiltIn, Problem> {
        let mut device: BuiltIn = match self.effective.profile.device.role {
            Role::Agv => ReferenceAgv::of(arguments.vehicle.0, &self.pack).into(),
            Role::MasterControl => {
                let vehicles = self.vehicles.unwrap_or(USUAL_FLEET);
                ReferenceMasterControl::with_vehicles(vehicles, &self.pack).into()
            }
        };
        tolerate(&mut device, &arguments.tolerance)?;
        self.harness.shape_built_in(&mut device);
        Ok(device)
    }

    /// What makes device and harness others than the usual ones, for the record.
    fn settings(&self, arguments: &args::Run) -> Vec<Setting> {
        let mut all = reference::settings(&Asked::of_run(arguments));
        all.extend(self.harness.setting());
        all
    }

    async fn built_in(
        self,
        arguments: &args::Run,
        interrupt: watch::Receiver<bool>,
        outputs: &Outputs<'_>,
    ) -> Result<Exit, Problem> {
        let device = self.built_in_device(arguments)?;
        let mut run = LiveRun::built_in(device, &arguments.fault, &self.library, &self.pack);
        let bench = &self.effective.profile.bench;
        if arguments.device.listen.is_some() {
            run.options.listen.clone_from(&bench.listen);
        }
        let identity = bench.client_cert.clone().zip(bench.client_key.clone());
        run.options.cluster.clone_from(&bench.cluster);
        if let Some(url) = &bench.broker {
            run.options.broker = BrokerChoice::External {
                url: url.clone(),
                access: Access {
                    authority: bench.tls_ca.clone(),
                    identity: identity.map(|(certificate, key)| TlsFiles { certificate, key }),
                    ..Access::default()
                },
            };
        }
        run.device.settings.clone_from(&self.effective.settings);
        run.device.settings.extend(self.settings(arguments));
        self.over_sockets(run, interrupt, outputs).await
    }

    async fn device(
        self,
        arguments: &args::Run,
        interrupt: watch::Receiver<bool>,
        surroundings: &Surroundings,
        outputs: &Outputs<'_>,
    ) -> Result<Exit, Problem> {
        let run = self.of_profile(arguments, surroundings)?;
        self.over_sockets(run, interrupt, outputs).await
    }

    async fn over_sockets(
        self,
        mut run: LiveRun,
        interrupt: watch::Receiver<bool>,
        outputs: &Outputs<'_>,
    ) -> Result<Exit, Problem> {
        if self.no_motion {
            run.device.stand_still(Reason::MotionRuledOut);
        }
        run.request = self.request.clone();
        if let Some(earlier) = &self.earlier {
            let vantage = if run.options.tap {
                Vantage::Tap
            } else {
                Vantage::Subscriber
            };
            let about = AboutRun {
                subject: &run.device.subject,
                vantage: vantage.word(),
                mode: mode(self.certifies),
                settings: &run.device.settings,
                files: &run.device.files,
            };
            self.is_resumable(&about)?;
            run.request.limits.extend(Earlier::limit(&about));
            run.options.clock = WallClock::going_on(going_on_at(Some(&earlier.journal)));
            run.earlier = Some(earlier.journal.clone());
        }
        let bundle = self.bundle(&run.device.subject, run.options.clock.origin_stamp().utc)?;
        let writer = self.journal(&bundle)?;
        run.device_log = Some(bundle.folder().join("device.log"));
        run.hold = hold(&self.desk);
        run.quit.clone_from(&self.quit);
        run.stopped_at = self.desk.stopped_at();
        if let Some(page) = &self.page {
            let role = run.device.subject.role;
            page.asks(page::asks(&self.library.rules.catalogue, &self.pack));
            page.prompts(page::prompts(&self.request, &self.effective.profile));
            page.reads_back(writer.shelf());
            run.onlooker = Some(page::onlooker(page.clone(), role, Arc::clone(&self.pack)));
            if let Some(layout) = run.device.layout.as_ref().filter(|_| role == Role::Agv) {
                page.floor(page::floor(layout));
            }
        }
        let mut terminal = self.screen(&run.device.subject, &bundle)?;
        let mut saved = saving(&bundle, self.page.clone());
        let finished = run.carry_out(
            &self.library,
            &self.pack,
            Some(writer),
            interrupt,
            &mut terminal,
            &mut saved,
        );
        let finished = match finished.await {
            Ok(finished) => finished,
            Err(error) => {
                drop(saved);
                bundle.abandon();
                return Err(self.could_not_begin(error));
            }
        };
        self.conclude(&bundle, finished, terminal, outputs)
    }

    /// Why a run could not begin, at the place of the profile that it comes from.
    fn could_not_begin(&self, error: RunError) -> Problem {
        let setting = match &error {
            RunError::Device(_) => Some("device.command"),
            RunError::Bench(LinkError::Listen { .. }) => Some("bench.listen"),
            RunError::Bench(_) => Some("bench.broker"),
            RunError::Profile(_) | RunError::Unknown(_) | RunError::Record(_) | RunError::Engine(_) => None,
        };
        match (error, setting) {
            (RunError::Profile(all), _) => Problem::Usage(all),
            (RunError::Unknown(unknown), _) => Diagnostic::whole("fault", unknown.to_string()).into(),
            (error, Some(setting)) => {
                let text = crate::ui::escaped(&error.to_string());
                let complaint = without_secrets(self.effective.complain(setting, "bench", text, "this one"));
                match error {
                    // To try again starts no program that is not there.
                    RunError::Device(why) if why.kind() == std::io::ErrorKind::NotFound => {
                        Problem::Usage(vec![complaint])
                    }
                    _ => Problem::Bench(Box::new(complaint)),
                }
            }
            (error, None) => environment(error),
        }
    }

    /// The journal of the bundle. That of a run that is resumed begins with what is there already.
    fn journal(&self, bundle: &Bundle) -> Result<JournalWriter, Problem> {
        let writer = match &self.earlier {
            Some(earlier) => bundle.journal_after(&earlier.path),
            None => bundle.journal(),
        };
        writer.map_err(environment)
    }

    /// Whether the run before this one, if there is one, was about the same.
    fn is_resumable(&self, about: &AboutRun<'_>) -> Result<(), Problem> {
        let Some(earlier) = &self.earlier else { return Ok(()) };
        earlier.is_about(about, &self.pack, &self.library)?;
        let (kept, left) = (earlier.kept, self.request.tests.len());
        let verb = |count| if count == 1 { "is" } else { "are" };
        eprintln!(
            "resumed: {} {} kept, {} {} left",
            many(kept, "test"),
            verb(kept),
            many(left, "test"),
            verb(left)
        );
        Ok(())
    }

    fn screen(&self, device: &Participant, bundle: &Bundle) -> Result<Followed, Problem> {
        let show = match (self.output.format, self.output.quiet, self.output.failures) {
            _ if self.output.speaks_events() => Show::Nothing,
            (args::Format::Json, ..) | (_, true, _) => Show::Nothing,
            (_, _, true) => Show::Failures,
            _ => Show::All,
        };
        if self.output.verbose > 0 {
            for setting in &self.effective.settings {
                eprintln!("{} = {}  ({})", setting.name, setting.value, setting.origin);
            }
        }
        let protocol = self.pack.version.to_string();
        let screen = Screen::new(device.to_string(), protocol.clone(), show, self.desk.clone());
        let screen = if self.output.verbose >= 2 {
            screen.beside_log()
        } else {
            screen
        };
        let mut followed = Followed::new(screen, self.output.events.as_deref(), self.page.clone())?;
        if let Some(follower) = followed.follower() {
            self.desk.is_followed_by(follower);
        }
        followed.begun(&About {
            run: &self.request.run,
            role: device.role.word(),
            protocol: &protocol,
            manufacturer: &device.manufacturer,
            serial_number: &device.serial_number,
            bundle: bundle.folder(),
            command: mode(self.certifies).unwrap_or("run"),
            broker: &page::broker(&self.effective),
        });
        Ok(followed)
    }
}

/// Why questions cannot be answered over HTTP.
fn not_answering(error: AnsweringError) -> Problem {
    match error {
        AnsweringError::Listen { .. } => environment(error),
        AnsweringError::Address(_) | AnsweringError::NotLocal(_) => {
            Diagnostic::whole("questions", error.to_string()).into()
        }
    }
}

/// Which command a run is of, as its header says.
fn mode(certifies: bool) -> Option<&'static str> {
    certifies.then_some(tck_result::CERTIFY)
}

/// A complaint with the line of the profile as it may be read by anybody: an address may hold a token.
fn without_secrets(mut complaint: Diagnostic) -> Diagnostic {
    if let Some(span) = &complaint.span {
        let shown = Secrets::default().out_of(span.text());
        let text = &span.source.text;
        let hidden = format!("{}{shown}{}", &text[..span.start], &text[span.end..]);
        let source = Source::new(span.source.name.as_str(), hidden);
        complaint.span = Some(Span::new(&source, span.start, span.start + shown.len()));
    }
    complaint
}

fn environment(error: impl std::fmt::Display) -> Problem {
    Problem::Environment(error.to_string())
}
