//! The course of a run.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};
use tokio::sync::watch;

use super::bindings::{course_of, own_bindings};
use super::capabilities::Capabilities;
use super::draw::draw;
use super::estimate::Outlook;
use super::idle::{Home, Obstacle};
use super::precondition_breaker::PreconditionBreaker;
use super::presence::{Presence, gone};
use super::risk::{FailingTables, by_risk};
use super::sheet::Sheet;
use tck_base::verdict::Verdict;
use tck_course::Layout;
use tck_engine::{Engine, EngineError, Operator, Recorder, Watcher};
use tck_journal::event::{Event, Gate, Plan, PlannedTest};
use tck_journal::{OwnLatency, Reason};
use tck_judge::RunJudge;
use tck_net::link::Link;
use tck_net::link::mqtt::BenchInfo;
use tck_pack::Role;
use tck_result::{RunResult, TestResult};
use tck_suite::model::Test;

/// What a run is about.
pub struct Setup {
    /// The selected tests, in the order they should run.
    pub tests: Vec<Arc<Test>>,
    /// Whether that is every test there is for this role and version.
    pub complete: bool,
    /// Of the cases that come from a schema, those are run that this seed draws; all of them without one.
    pub draw: Option<u64>,
    /// What is known before the device is there.
    pub capabilities: Capabilities,
    /// Where the vehicle may drive.
    pub layout: Option<Layout>,
    /// How many mock AGVs the harness has; none when an AGV is tested.
    pub vehicles: usize,
    /// Map files the device can read; without one, ours are served.
    pub maps: Vec<bytes::Bytes>,
    /// Deviations the profile declares.
    pub deviations: BTreeMap<String, String>,
    /// What restricts the statement from the start.
    pub limits: Vec<String>,
    /// Identifier of the run; makes ids unique.
    pub run: String,
    /// Whether it ends after the first test that fails.
    pub fail_fast: bool,
    /// How often each test is run.
    pub repeat: u32,
    /// How long the run may take; tests that do not fit into it are left out.
    pub budget: Option<Duration>,
}

/// A finished run.
pub struct Finished {
    /// How it ended.
    pub end: End,
    /// What came out.
    pub result: RunResult,
    /// Journal and judge.
    pub recorder: Recorder,
}

/// How a run ended.
#[derive(Debug)]
pub enum End {
    /// The plan was carried out.
    Completed,
    /// The device never showed up; the text says how long was waited.
    NoDevice(String),
    /// Another device speaks than the one that was to be judged; the text says which. Nothing is judged.
    Stranger(String),
    /// The run goes on with another one, and the device is not what it was then; the text says what differs. Nothing of it
    /// is judged.
    Changed(String),
    /// The device went away, and did not come back.
    Lost(String),
    /// The user stopped it.
    Interrupted,
    /// The device sent more than can be kept.
    Flooded(String),
    /// Link, journal or host broke.
    Broken(EngineError),
}

/// Tells a person how the run is getting on.
pub trait Progress: Watcher {
    /// The plan is made.
    fn planned(&mut self, plan: &Plan);
    /// A test begins.
    fn test_begun(&mut self, test: &Test, number: usize, of: usize);
    /// A test has ended.
    fn test_ended(&mut self, result: &TestResult);
    /// Something worth knowing.
    fn note(&mut self, text: &str);
    /// How much of the run is left, as far as can be told now.
    fn left(&mut self, left: Duration) {
        let _ = left;
    }
    /// The bench stands, and a device that is not ours is expected there.
    fn expects_device(&mut self, bench: &BenchInfo) {
        let _ = bench;
    }
}

/// How long a run that somebody interrupts may take to end in good order: to call off what the device was given, and to bring
/// it back.
pub const ENDS_WITHIN: Duration = Duration::from_secs(60);

/// How long is waited for a run that somebody has interrupted.
pub struct Patience {
    /// Turns true when somebody does.
    pub interrupt: watch::Receiver<bool>,
    /// Turns true when nobody waits any more.
    pub quit: Option<watch::Receiver<bool>>,
}

impl Patience {
    /// Ends when the run is not waited for any more.
    pub async fn ends(mut self) {
        let interrupted = async {
            if self.interrupt.wait_for(|interrupted| *interrupted).await.is_err() {
                std::future::pending::<()>().await;
            }
            tokio::time::sleep(ENDS_WITHIN).await;
        };
        let quit = async {
            let quit = match &mut self.quit {
                Some(quit) => quit.wait_for(|quit| *quit).await.is_ok(),
                None => false,
            };
            if !quit {
                std::future::pending::<()>().await;
            }
        };
        tokio::select! {
            () = interrupted => {}
            () = quit => {}
        }
    }
}

/// Carries out a run. `saved` is called after every test, so that a crash loses nothing. When `given_up` ends, what the run
/// still wants to do is left undone.
pub async fn run<L: Link, O: Operator>(
    engine: &mut Engine<L, O>,
    mut setup: Setup,
    progress: &mut dyn Progress,
    saved: &mut dyn FnMut(&RunJudge),
    given_up: impl Future<Output = ()>,
) -> End {
    engine.map_files = std::mem::take(&mut setup.maps);
    let mut is_given_up = false;
    let end = tokio::select! {
        biased;
        end = Session::new(engine, setup, progress).carry_out(saved) => end.unwrap_or_else(End::Broken),
        () = given_up => {
            is_given_up = true;
            End::Interrupted
        }
    };
    if matches!(end, End::Interrupted) && !engine.recorder.judge().is_interrupted() {
        let _ = engine.note(Event::Interrupted);
    }
    let (partial, reason) = match &end {
        End::Completed => (false, None),
        End::NoDevice(why) | End::Stranger(why) | End::Changed(why) | End::Lost(why) | End::Flooded(why) => {
            (true, Some(why.clone()))
        }
        End::Interrupted if is_given_up => (true, Some(GIVEN_UP.to_owned())),
        End::Interrupted => (true, Some("interrupted by the user".to_owned())),
        End::Broken(error) => (true, Some(error.to_string())),
    };
    let stranger = matches!(end, End::Stranger(_) | End::Changed(_));
    let recorded = engine.note(Event::RunEnded {
        partial,
        reason,
        stranger,
        latency: OwnLatency::of(engine.link.time_to_pass_on(), engine.recorder.time_to_judge()),
    });
    let synced = engine.recorder.sync();
    match (recorded, synced) {
        (Ok(_), Ok(())) => end,
        (Err(error), _) => End::Broken(error),
        (_, Err(error)) => End::Broken(error.into()),
    }
}

/// Why a run has ended whose end was not waited for.
const GIVEN_UP: &str =
    "interrupted by the user; what the device was given was not called off to the end, and it may go on with it";

pub(super) struct Session<'a, L, O> {
    pub(super) engine: &'a mut Engine<L, O>,
    pub(super) setup: Setup,
    pub(super) progress: &'a mut dyn Progress,
    /// Why the vehicle is not moved any more.
    pub(super) halted: Option<String>,
    /// What the vehicle was like before.
    pub(super) home: Home,
    /// How often in a row the way back to rest was tried in vain.
    pub(super) ladders: u32,
    /// Whether the vehicle empties its list of instant actions when it is told to.
    pub(super) empties_lists: bool,
    /// The id of the last cancelOrder on that way.
    pub(super) cancelled: Option<String>,
    /// The vehicle was found to refuse every order, until it was restarted.
    pub(super) refuses: bool,
    /// How often it was restarted because it flooded the harness.
    pub(super) floods: u32,
    /// How often in a row a restart did not make it take orders again.
    pub(super) unhelped: u32,
    /// How many orders were sent on that way.
    pub(super) orders: u32,
    /// From which record on the device has what it needs after a start.
    pub(super) ready_since: u64,
    /// Preconditions that are not reached again and again.
    strikes: PreconditionBreaker,
    /// What each of the tests was to take, and how long the run still takes; in virtual time nobody waits for it.
    pub(super) estimates: Vec<Duration>,
    pub(super) outlook: Outlook,
}

/// A test that is tried once more has a number beyond those of all tests, which its ids are made of.
const TRIED_AGAIN: usize = 5_000;

impl<'a, L: Link, O: Operator> Session<'a, L, O> {
    fn new(engine: &'a mut Engine<L, O>, mut setup: Setup, progress: &'a mut dyn Progress) -> Self {
        let ground = engine.recorder.judge().ground();
        if ground.role == Role::Agv {
            let somebody_waits = !engine.operator.runs_on_the_link();
            by_risk(&mut setup.tests, &ground.hooks, somebody_waits);
        }
        Self {
            engine,
            setup,
            progress,
            halted: None,
            home: Home::default(),
            ladders: 0,
            empties_lists: true,
            cancelled: None,
            refuses: false,
            unhelped: 0,
            floods: 0,
            orders: 0,
            ready_since: 0,
            strikes: PreconditionBreaker::default(),
            estimates: Vec::new(),
            outlook: Outlook::default(),
        }
    }

    async fn carry_out(mut self, saved: &mut dyn FnMut(&RunJudge)) -> Result<End, EngineError> {
        let run_begun = self.engine.link.now().moment;
        let admitted = self.admit().await?;
        self.draw();
        if let Err(why) = admitted {
            let end = self
                .stopped()
                .unwrap_or_else(|| match (self.is_another(), self.somebody_else()) {
                    (Some(what), _) => End::Changed(what),
                    (None, Some(who)) => End::Stranger(who),
                    (None, None) => End::NoDevice(why.clone()),
                });
            let tests = self.setup.tests.iter().map(|test| PlannedTest {
                test: test.id.clone(),
                gate: Gate::Unobservable(Reason::observed(why.clone())),
            });
            let plan = self.plan(tests.collect());
            self.record_plan(&plan)?;
            saved(self.engine.recorder.judge());
            return Ok(end);
        }
        let gates = self.setup.tests.iter().map(|test| PlannedTest {
            test: test.id.clone(),
            gate: self.setup.capabilities.gate(test),
        });
        let mut plan = self.plan(gates.collect());
        self.record_plan(&plan)?;
        self.progress.planned(&plan);
        self.estimate(&plan);
        let tests = self.setup.tests.clone();
        let runs = plan.tests.iter().filter(|planned| planned.gate == Gate::Runs).count();
        let runs = runs * self.setup.repeat as usize;
        let mut number = 0;
        let mut gone: Option<String> = None;
        let mut failed: Option<String> = None;
        let mut is_short_of_time = false;
        // In virtual time nobody does.
        let somebody_waits = !self.engine.operator.runs_on_the_link();
        let mut failing = FailingTables::default();
        // What nobody answered is asked again when all else is done.
        let mut queue: VecDeque<(usize, bool)> = (0..tests.len()).map(|at| (at, false)).collect();
        while let Some((at, again)) = queue.pop_front() {
            let test = &tests[at];
            if plan.tests[at].gate != Gate::Runs {
                continue;
            }
            if self.engine.interrupted() {
                break;
            }
            if let Some(first) = &failed {
                plan.tests[at].gate = Gate::Unobservable(Reason::AfterFailure { test: first.clone() });
                continue;
            }
            for repetition in 1..=self.setup.repeat {
                if self.engine.interrupted() || failed.is_some() || repetition > 1 && gone.is_some() {
                    break;
                }
                let over_budget = self.over_budget(at, run_begun);
                if over_budget.is_some() && again {
                    break;
                }
                if let Some(why) = over_budget {
                    if !std::mem::replace(&mut is_short_of_time, true) {
                        self.progress
                            .note("tests that do not fit into the budget any more are left out");
                    }
                    plan.tests[at].gate = Gate::Unobservable(why);
                    break;
                }
                self.engine.repetition = (self.setup.repeat > 1).then_some(repetition);
                number += 1;
                if gone.is_none() {
                    gone = self.be_there().await?;
                }
                if gone.is_none() && test.device == Role::MasterControl {
                    self.let_it_finish().await?;
                }
                if gone.is_none() && test.device == Role::Agv {
                    self.drive_to_fit(test).await?;
                }
                let aside = gone.clone().map(Reason::observed);
                let aside = aside.or_else(|| self.strikes.against(test));
                let ready = match (&aside, &self.halted) {
                    (Some(why), _) => Err(why.clone()),
                    (None, Some(why)) if test.moves => Err(Reason::observed(why.clone())),
                    _ => self.bindings(test, number),
                };
                let ready = match ready {
                    Err(_) if gone.is_none() && test.device == Role::MasterControl => {
                        self.bring_back().await?;
                        match self.bindings(test, number) {
                            Err(_) => {
                                self.put_to_fit(test).await?;
                                self.bindings(test, number)
                            }
                            ready => ready,
                        }
                    }
                    ready => ready,
                };
                match ready {
                    // What came of it the first time stands.
                    Err(_) if again => {}
                    Err(why) => plan.tests[at].gate = Gate::Unobservable(why),
                    Ok(own) => {
                        self.progress.test_begun(test, number.min(runs), runs);
                        if again {
                            self.progress
                                .note(&format!("nobody answered in {} before; it is asked again", test.id));
                        }
                        self.engine.unanswered = false;
                        let begun = self.engine.link.now().moment;
                        gone = self.run_and_restore(test, own, number).await?;
                        if let Some(result) = self.engine.recorder.judge().done().last() {
                            self.progress.test_ended(result);
                            let fails = result.verdict == Some(Verdict::Fail);
                            if self.setup.fail_fast && fails {
                                failed = Some(result.id.clone());
                            }
                            if fails && somebody_waits && failing.failed(test, &tests, &mut queue) {
                                self.progress
                                    .note("the tests like this one come at the end: three of them have failed");
                            }
                            // What was decided before the question stands, and is not taken back by another try.
                            let mut decisions = result.decisions.iter();
                            let is_open = self.engine.unanswered
                                && decisions.all(|decision| decision.verdict() == Verdict::Inconclusive);
                            if is_open && !again && self.setup.repeat == 1 {
                                queue.push_back((at, true));
                            }
                        }
                        self.tell_left(at, begun);
                        saved(self.engine.recorder.judge());
                    }
                }
            }
        }
        if let (Some(why), None) = (&gone, self.stopped()) {
            self.record_plan(&plan)?;
            return Ok(End::Lost(why.clone()));
        }
        self.record_plan(&plan)?;
        Ok(self.stopped().unwrap_or(End::Completed))
    }

    /// Leaves out cases that come from a schema or a matrix, where the run need not be thorough.
    fn draw(&mut self) {
        let Some(seed) = self.setup.draw else { return };
        let runs = |test: &Test| self.setup.capabilities.gate(test) == Gate::Runs;
        let drawing = draw(&self.setup.tests, seed, runs);
        if drawing.taken < drawing.of {
            self.setup.limits.push(format!(
                "Of {} cases from schemas and matrices, {} were to be tried, drawn by the seed {seed}; `--thorough` tries \
                 all of them.",
                drawing.of, drawing.taken
            ));
        }
        self.setup.tests = drawing.tests;
    }

    /// How the run ended before its time, if it did.
    fn stopped(&self) -> Option<End> {
        let flooded = self.engine.recorder.flood().map(|why| {
            End::Flooded(format!(
                "{why}; the run was ended before this machine runs out of memory, and what was found until then stands"
            ))
        });
        flooded.or(self.engine.interrupted().then_some(End::Interrupted))
    }

    fn plan(&self, tests: Vec<PlannedTest>) -> Plan {
        let series = self.setup.capabilities.factsheet.as_ref().and_then(Sheet::series);
        let mut limits = self.setup.limits.clone();
        if let Err(why) = &self.setup.capabilities.motion {
            limits.push(format!("No test that moves the vehicle was run: {why}."));
        }
        limits.extend(self.halted.clone());
        if !self.setup.complete {
            limits.push("Only a selection of the tests was run.".to_owned());
        }
        Plan {
            tests,
            capabilities: self.setup.capabilities.list(),
            limits,
            deviations: self.setup.deviations.clone(),
            series_name: series.map(|name| name.chars().take(200).collect()),
            complete: self.setup.complete,
            repeat: (self.setup.repeat > 1).then_some(self.setup.repeat),
        }
    }

    fn record_plan(&mut self, plan: &Plan) -> Result<(), EngineError> {
        let mut plan = plan.clone();
        plan.limits = self.plan(Vec::new()).limits;
        self.engine.note(Event::Planned { plan: Box::new(plan) })?;
        Ok(())
    }

    /// Makes sure the device is connected before a test; gives the reason when it stays away.
    async fn be_there(&mut self) -> Result<Option<String>, EngineError> {
        self.engine.drain().await?;
        if Presence::of(self.engine.recorder.judge(), self.setup.capabilities.vantage).is_there() {
            return Ok(None);
        }
        let gone = gone(self.engine.recorder.judge());
        let gone = gone.as_deref().unwrap_or("the device is not connected");
        self.progress.note(&format!("{gone}; waiting for it"));
        self.revive().await
    }

    fn bindings(&self, test: &Test, number: usize) -> Result<Map<String, Value>, Reason> {
        let judge = self.engine.recorder.judge();
        let course = course_of(test, self.setup.layout.as_ref(), judge, &self.home)?;
        Ok(own_bindings(test, course, judge, &self.setup.run, number))
    }

    /// Runs a test and brings the vehicle back. One whose precondition was not reached is run once more, when something
    /// was learned about the vehicle or it could be restarted. Gives the reason when the device stays away.
    async fn run_and_restore(
        &mut self,
        test: &Arc<Test>,
        own: Map<String, Value>,
        number: usize,
    ) -> Result<Option<String>, EngineError> {
        let known = self.engine.recorder.judge().ground().waivers.len();
        self.look_at_home();
        self.engine
            .run_test(test, own, &mut AsWatcher(&mut *self.progress))
            .await?;
        self.outlast_flood(test).await?;
        self.after(test).await?;
        if test.device == Role::MasterControl {
            return Ok(None);
        }
        let Some(place) = self.unreached(test) else {
            self.strikes.reached(test);
            return Ok(None);
        };
        if self.engine.interrupted() {
            return Ok(None);
        }
        let learned = self.engine.recorder.judge().ground().waivers.len() > known;
        if !learned && self.strikes.is_worth_a_restart(&place) {
            if !self.can_restart() || !self.restart().await? {
                self.strikes.missed(test, &place);
                return Ok(None);
            }
        } else if !learned {
            self.strikes.missed(test, &place);
            return Ok(None);
        }
        if let Some(why) = self.be_there().await? {
            return Ok(Some(why));
        }
        self.drive_to_fit(test).await?;
        // What it sends may stand elsewhere now, and goes by names of its own.
        if let Ok(own) = self.bindings(test, number + TRIED_AGAIN) {
            self.progress
                .note("the precondition was not reached; the test is tried once more");
            self.look_at_home();
            self.engine
                .run_test(test, own, &mut AsWatcher(&mut *self.progress))
                .await?;
            self.outlast_flood(test).await?;
            self.after(test).await?;
        }
        match self.unreached(test) {
            Some(place) => self.strikes.missed(test, &place),
            None => self.strikes.reached(test),
        }
        Ok(None)
    }

    fn look_at_home(&mut self) {
        self.home.before = self.engine.recorder.judge().state();
        self.home.since = self.engine.link.now().moment;
    }

    /// Where the precondition of the test that ended last was not reached.
    fn unreached(&self, test: &Test) -> Option<String> {
        let result = self.engine.recorder.judge().done().last()?;
        let mut steps = result.steps.iter();
        let failed = steps.find(|step| step.path.starts_with("given") && step.outcome == "failed")?;
        (result.id == test.id).then(|| failed.place.clone())
    }

    /// Restores the link, and makes sure the vehicle is at rest.
    async fn after(&mut self, test: &Test) -> Result<(), EngineError> {
        self.settle_link().await?;
        self.engine.drain().await?;
        if self.was_started()
            && let Err(why) = self.after_start().await?
        {
            self.progress.note(&why);
        }
        if self.engine.recorder.judge().role() == Role::MasterControl {
            return self.tidy_fleet(test).await;
        }
        if !Presence::of(self.engine.recorder.judge(), self.setup.capabilities.vantage).is_there() {
            return Ok(());
        }
        self.outlast_silence(test).await?;
        self.read_over(self.engine.link.now().moment).await?;
        let left = if self.obstacles().is_empty() {
            Vec::new()
        } else {
            self.bring_to_rest().await?
        };
        if left.is_empty() {
            self.empty_list().await?;
            self.still_takes_orders().await?;
        }
        if !left.iter().any(Obstacle::halts) {
            self.halted = None;
        } else if self.halted.is_none() {
            let all: Vec<String> = left.iter().map(Obstacle::describe).collect();
            let why = format!(
                "After test {} the vehicle did not return to idle ({}); no test that moves it was run from then on.",
                test.id,
                all.join("; ")
            );
            self.progress.note(&why);
            self.halted = Some(why);
        }
        Ok(())
    }
}

/// Shows the engine only the part of the progress it needs.
struct AsWatcher<'a>(&'a mut dyn Progress);

impl Watcher for AsWatcher<'_> {
    fn waiting(&mut self, step: &tck_suite::model::Step) {
        self.0.waiting(step);
    }

    fn awaits(&mut self, left: Duration) {
        self.0.awaits(left);
    }

    fn gone(&mut self, how: &str) {
        self.0.note(how);
    }
}
