//! The course of a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Map, Value};

use super::between::{Presence, recover, revive, says_online, settle_link};
use super::bindings::{course_of, own_bindings};
use super::capabilities::Capabilities;
use super::estimate::{self, Estimate};
use crate::course::Layout;
use crate::engine::vehicle::is_idle;
use crate::engine::{Engine, EngineError, Operator, Watcher};
use crate::journal::event::{Event, Gate, Plan, PlannedTest};
use crate::judge::RunJudge;
use crate::link::Link;
use crate::pack::Role;
use crate::report::result::TestResult;
use crate::suite::model::Test;

/// What a run is about.
pub struct Setup {
    /// The selected tests, in the order they should run.
    pub tests: Vec<Arc<Test>>,
    /// Whether that is every test there is for this role and version.
    pub complete: bool,
    /// What is known before the device is there.
    pub capabilities: Capabilities,
    /// Where the vehicle may drive.
    pub layout: Option<Layout>,
    /// How many mock AGVs the harness has; none when an AGV is tested.
    pub vehicles: usize,
    /// Deviations the profile declares.
    pub deviations: BTreeMap<String, String>,
    /// What restricts the statement from the start.
    pub limits: Vec<String>,
    /// Identifier of the run; makes ids unique.
    pub run: String,
}

/// How a run ended.
#[derive(Debug)]
pub enum End {
    /// The plan was carried out.
    Completed,
    /// The device never showed up; the text says how long was waited.
    NoDevice(String),
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
}

/// Carries out a run. `saved` is called after every test, so that a crash loses nothing.
pub async fn run<L: Link, O: Operator>(
    engine: &mut Engine<L, O>,
    setup: Setup,
    progress: &mut dyn Progress,
    saved: &mut dyn FnMut(&RunJudge),
) -> End {
    let end = match Session::new(engine, setup, progress).carry_out(saved).await {
        Ok(end) => end,
        Err(error) => End::Broken(error),
    };
    let (partial, reason) = match &end {
        End::Completed => (false, None),
        End::NoDevice(why) | End::Flooded(why) => (true, Some(why.clone())),
        End::Interrupted => (true, Some("interrupted by the user".to_owned())),
        End::Broken(error) => (true, Some(error.to_string())),
    };
    let recorded = engine.note(Event::RunEnded { partial, reason });
    let synced = engine.recorder.sync();
    match (recorded, synced) {
        (Ok(_), Ok(())) => end,
        (Err(error), _) => End::Broken(error),
        (_, Err(error)) => End::Broken(error.into()),
    }
}

pub(super) struct Session<'a, L, O> {
    pub(super) engine: &'a mut Engine<L, O>,
    pub(super) setup: Setup,
    pub(super) progress: &'a mut dyn Progress,
    /// Why the vehicle is not moved any more.
    pub(super) halted: Option<String>,
}

impl<'a, L: Link, O: Operator> Session<'a, L, O> {
    fn new(engine: &'a mut Engine<L, O>, setup: Setup, progress: &'a mut dyn Progress) -> Self {
        Self {
            engine,
            setup,
            progress,
            halted: None,
        }
    }

    async fn carry_out(mut self, saved: &mut dyn FnMut(&RunJudge)) -> Result<End, EngineError> {
        if let Err(why) = self.admit().await? {
            let end = self.stopped().unwrap_or_else(|| End::NoDevice(why.clone()));
            let tests = self.setup.tests.iter().map(|test| PlannedTest {
                test: test.id.clone(),
                gate: Gate::Unobservable(why.clone()),
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
        self.tell_estimate(&plan);
        let tests = self.setup.tests.clone();
        let runs = plan.tests.iter().filter(|planned| planned.gate == Gate::Runs).count();
        let mut number = 0;
        let mut gone: Option<String> = None;
        for (at, test) in tests.iter().enumerate() {
            if plan.tests[at].gate != Gate::Runs {
                continue;
            }
            if self.engine.interrupted() {
                break;
            }
            number += 1;
            if gone.is_none() {
                gone = self.be_there().await?;
            }
            if gone.is_none() && test.device == Role::MasterControl {
                self.let_it_finish().await?;
            }
            let ready = match (&gone, &self.halted) {
                (Some(why), _) => Err(why.clone()),
                (None, Some(why)) if test.moves => Err(why.clone()),
                _ => self.bindings(test, number),
            };
            let ready = match ready {
                Err(_) if gone.is_none() && test.device == Role::MasterControl => {
                    self.bring_back().await?;
                    self.bindings(test, number)
                }
                ready => ready,
            };
            match ready {
                Err(why) => plan.tests[at].gate = Gate::Unobservable(why),
                Ok(own) => {
                    self.progress.test_begun(test, number, runs);
                    self.engine
                        .run_test(test, own, &mut AsWatcher(&mut *self.progress))
                        .await?;
                    if let Some(result) = self.engine.recorder.judge().done().last() {
                        self.progress.test_ended(result);
                    }
                    self.after(test).await?;
                    saved(self.engine.recorder.judge());
                }
            }
        }
        self.record_plan(&plan)?;
        Ok(self.stopped().unwrap_or(End::Completed))
    }

    /// How the run ended before its time, if it did.
    fn stopped(&self) -> Option<End> {
        let flooded = self.engine.recorder.flood().map(|why| End::Flooded(why.to_owned()));
        flooded.or(self.engine.interrupted().then_some(End::Interrupted))
    }

    /// Says how long the run will take; in virtual time it is over before that is read.
    fn tell_estimate(&mut self, plan: &Plan) {
        if self.engine.operator.runs_on_the_link() {
            return;
        }
        let times = self.engine.recorder.judge().ground().bindings.get("time");
        let estimate = Estimate::of(
            times,
            self.setup.capabilities.factsheet.as_ref(),
            self.setup.layout.as_ref(),
            self.engine.operator.usual_time(),
        );
        let planned = self.setup.tests.iter().zip(&plan.tests);
        let running = planned.filter(|(_, planned)| planned.gate == Gate::Runs);
        let estimate = estimate.of_tests(running.map(|(test, _)| &**test));
        self.progress.note(&format!(
            "this takes {}, if the device keeps nobody waiting",
            estimate::in_words(estimate)
        ));
    }

    fn plan(&self, tests: Vec<PlannedTest>) -> Plan {
        let series = self
            .setup
            .capabilities
            .factsheet
            .as_ref()
            .and_then(|sheet| sheet.pointer("/typeSpecification/seriesName"));
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
            series_name: series
                .and_then(Value::as_str)
                .map(|name| name.chars().take(200).collect()),
            complete: self.setup.complete,
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
        self.progress.note("the device is not connected; waiting for it");
        revive(self).await
    }

    fn bindings(&self, test: &Test, number: usize) -> Result<Map<String, Value>, String> {
        let judge = self.engine.recorder.judge();
        let course = course_of(test, self.setup.layout.as_ref(), judge)?;
        Ok(own_bindings(test, course, judge, &self.setup.run, number))
    }

    /// Restores the link, and makes sure the vehicle stands idle.
    async fn after(&mut self, test: &Test) -> Result<(), EngineError> {
        settle_link(self).await?;
        self.engine.drain().await?;
        if self.engine.recorder.judge().role() == Role::MasterControl {
            return self.tidy_fleet(test).await;
        }
        let judge = self.engine.recorder.judge();
        if (is_idle(judge) && says_online(judge))
            || !Presence::of(self.engine.recorder.judge(), self.setup.capabilities.vantage).is_there()
        {
            return Ok(());
        }
        if !recover(self).await? {
            let why = format!(
                "After test {} the vehicle did not return to idle; no test that moves it was run from then on.",
                test.id
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
    fn waiting(&mut self, step: &crate::suite::model::Step) {
        self.0.waiting(step);
    }
}
