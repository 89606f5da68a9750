//! What a run will do, before anything is sent: which tests run, what stands in the way of the others, what people are asked
//! to do, how long it takes, and whether the vehicle moves.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Serialize, Serializer};
use serde_json::Value;

use super::draw::draw;
use super::estimate::{self, EDGE, Estimate};
use super::floor::Floor;
use super::risk::by_risk;
use super::session::Setup;
use tck_course::Layout;
use tck_journal::Reason;
use tck_pack::{Hooks, Pack, Participant, Role};
use tck_profile::{Hook, HookAction};
use tck_suite::model::{Test, Verb};

/// How a hook is done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum How {
    /// A person is asked to do it, with this text.
    Person(String),
    /// A program, an HTTP request, or the harness itself does it.
    Machine,
    /// The built-in device does it.
    BuiltIn,
}

impl How {
    /// Of a hook of a profile.
    #[must_use]
    pub fn of(action: &HookAction) -> Self {
        match action {
            HookAction::Prompt(text) => Self::Person(text.clone()),
            HookAction::Run(_)
            | HookAction::Http { .. }
            | HookAction::RestartDevice
            | HookAction::StopDevice
            | HookAction::StartDevice
            | HookAction::NaturalTraffic => Self::Machine,
        }
    }
}

/// What becomes of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Waits {
    /// It runs.
    Runs,
    /// It runs if the device says that it can do what the test needs.
    DependsOnDevice,
    /// Bench or profile lack something: the test is inconclusive.
    Inconclusive,
    /// The device is said not to have what the test is about.
    NotApplicable,
}

/// One test of a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PlanLine {
    /// Its id.
    pub id: String,
    /// What becomes of it.
    pub gate: Waits,
    /// Why it does not simply run.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "as_sentence")]
    pub why: Option<Reason>,
    /// Whether the vehicle drives.
    pub moves: bool,
    /// The hooks it uses, each as often as it does.
    pub hooks: Vec<String>,
}

/// A hook, and how much it is used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Use {
    /// Its name.
    pub hook: String,
    /// How it is done.
    pub how: How,
    /// How often.
    pub times: usize,
}

/// The plan of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct RunPlan {
    /// `vda5050-tck.plan/1`.
    pub format: &'static str,
    /// Manufacturer and serial number.
    pub device: String,
    /// Which side is tested.
    pub role: &'static str,
    /// By which version.
    pub protocol: String,
    /// The tests, in the order they run.
    pub tests: Vec<PlanLine>,
    /// How many cases from schemas and matrices were left out by the draw.
    pub not_drawn: usize,
    /// The hooks that are used, those of people first.
    pub hooks: Vec<Use>,
    /// How long it takes at least, in seconds, without the time that people need.
    pub seconds: u64,
    /// How far the vehicle drives, roughly, in metres.
    pub metres: f64,
    /// Why the vehicle does not move; absent when it may.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "as_sentence")]
    pub stands_still: Option<Reason>,
    /// The topics on which mock vehicles keep a message on a broker of somebody else, and which are cleared at the end.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub retained: Vec<String>,
    /// From where it is known what the vehicle can do, or why that is not known yet; absent where nobody could look.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known_from: Option<String>,
    /// The floor, if there is a layout.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor: Option<Floor>,
}

impl RunPlan {
    /// The plan of a set-up. What a test waits for is weighed as the run itself weighs it.
    pub(super) fn of(
        subject: &Participant,
        pack: &Pack,
        time: &Value,
        mut setup: Setup,
        (known, vocabulary): (&BTreeMap<String, How>, &Hooks),
    ) -> Self {
        if subject.role == Role::Agv {
            by_risk(&mut setup.tests, vocabulary, true);
        }
        if subject.role == Role::Agv {
            setup.fit_layout();
        }
        let gate = |test: &Test| gate(&setup, test);
        let may_run = |test: &Test| matches!(gate(test).0, Waits::Runs | Waits::DependsOnDevice);
        let all = setup.tests.len();
        let tests = match setup.draw {
            Some(seed) => draw(&setup.tests, seed, may_run).tests,
            None => setup.tests.clone(),
        };
        let lines = tests.iter().map(|test| {
            let (gate, why) = gate(test);
            PlanLine {
                id: test.id.clone(),
                gate,
                why,
                moves: test.moves,
                hooks: hooks(test),
            }
        });
        let lines: Vec<PlanLine> = lines.collect();
        let running: Vec<&Test> = tests.iter().map(AsRef::as_ref).filter(|test| may_run(test)).collect();
        let estimate = Estimate::of(
            Some(time),
            setup.capabilities.factsheet.as_deref(),
            setup.layout.as_ref(),
            Duration::from_secs(1),
        );
        let edges: usize = running.iter().filter(|test| test.moves).map(|test| edges(test)).sum();
        Self {
            format: "vda5050-tck.plan/1",
            device: format!("{} {}", subject.manufacturer, subject.serial_number),
            role: subject.role.word(),
            protocol: pack.version.to_string(),
            not_drawn: all - tests.len(),
            hooks: uses(&running, known),
            seconds: estimate.of_tests(running.iter().copied()).as_secs(),
            metres: (edges as f64 * mean_edge(setup.layout.as_ref())).round(),
            stands_still: setup.capabilities.motion.err(),
            tests: lines,
            retained: Vec::new(),
            known_from: None,
            floor: setup
                .layout
                .as_ref()
                .map(|layout| Floor::of(layout, running.iter().copied())),
        }
    }

    /// The tests of which this becomes.
    pub fn of_kind(&self, gate: Waits) -> impl Iterator<Item = &PlanLine> {
        self.tests.iter().filter(move |line| line.gate == gate)
    }

    /// How many tests run in which the vehicle moves.
    #[must_use]
    pub fn moving(&self) -> usize {
        let running = self.of_kind(Waits::Runs).chain(self.of_kind(Waits::DependsOnDevice));
        running.filter(|line| line.moves).count()
    }

    /// Why tests do not run, with the tests, the reason that stops most of them first.
    #[must_use]
    pub fn reasons(&self, gate: Waits) -> Vec<(&Reason, Vec<&str>)> {
        let mut reasons: Vec<(&Reason, Vec<&str>)> = Vec::new();
        for line in self.of_kind(gate) {
            let Some(why) = &line.why else { continue };
            match reasons.iter_mut().find(|(known, _)| *known == why) {
                Some((_, tests)) => tests.push(&line.id),
                None => reasons.push((why, vec![&line.id])),
            }
        }
        reasons.sort_by_key(|(_, tests)| std::cmp::Reverse(tests.len()));
        reasons
    }

    /// How long it takes, in words.
    #[must_use]
    pub fn duration(&self) -> String {
        estimate::in_words(Duration::from_secs(self.seconds))
    }
}

/// What becomes of a test, and why. What the profile lacks is said before what only the device can say.
fn gate(setup: &Setup, test: &Test) -> (Waits, Option<Reason>) {
    match setup.capabilities.weigh(test) {
        Err(why) => (Waits::NotApplicable, Some(why)),
        Ok(open) => {
            let mut lacking = open.iter().filter(|why| !why.is_said_by_the_device());
            if let Some(why) = lacking.next() {
                return (Waits::Inconclusive, Some(why.clone()));
            }
            if setup.layout.is_none() && !test.course.nodes.is_empty() {
                return (Waits::Inconclusive, Some(Reason::NoLayout));
            }
            match open.into_iter().next() {
                Some(why) => (Waits::DependsOnDevice, Some(why)),
                None => (Waits::Runs, None),
            }
        }
    }
}

/// Writes a reason as the sentence that people read.
#[expect(clippy::ref_option, reason = "serde hands over the field as it is")]
fn as_sentence<S: Serializer>(why: &Option<Reason>, serializer: S) -> Result<S::Ok, S::Error> {
    why.as_ref().map(ToString::to_string).serialize(serializer)
}

fn hooks(test: &Test) -> Vec<String> {
    let steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let hooks = steps.filter_map(|step| match &*step.verb {
        Verb::Operator(operator) => Some(operator.hook.clone()),
        _ => None,
    });
    hooks.collect()
}

/// How often a person is asked in a test, with these hooks of a profile.
#[must_use]
pub fn prompts(test: &Test, known: &BTreeMap<String, Hook>) -> usize {
    let is_asked = |name: &String| {
        known
            .get(name)
            .is_some_and(|hook| matches!(hook.action, HookAction::Prompt(_)))
    };
    hooks(test).iter().filter(|name| is_asked(name)).count()
}

/// How many edges the orders of a test release.
fn edges(test: &Test) -> usize {
    let steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
    let routes = steps.filter_map(|step| match &*step.verb {
        Verb::Send(send) => send.route.as_ref(),
        _ => None,
    });
    routes.map(|route| route.base.len().saturating_sub(1)).sum()
}

/// The mean length of an edge, in metres.
fn mean_edge(layout: Option<&Layout>) -> f64 {
    let Some(layout) = layout else { return EDGE };
    let lengths = layout.edges().filter_map(|edge| {
        let (start, end) = (layout.node(&edge.start)?, layout.node(&edge.end)?);
        Some(start.distance(end.x, end.y))
    });
    let lengths: Vec<f64> = lengths.collect();
    if lengths.is_empty() {
        return EDGE;
    }
    lengths.iter().sum::<f64>() / lengths.len() as f64
}

fn uses(running: &[&Test], known: &BTreeMap<String, How>) -> Vec<Use> {
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for hook in running.iter().flat_map(|test| hooks(test)) {
        *times.entry(hook).or_default() += 1;
    }
    let mut uses: Vec<Use> = times
        .into_iter()
        .filter_map(|(hook, times)| {
            let how = known.get(&hook)?.clone();
            Some(Use { hook, how, times })
        })
        .collect();
    uses.sort_by_key(|one| (!matches!(one.how, How::Person(_)), std::cmp::Reverse(one.times)));
    uses
}
