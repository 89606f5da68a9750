//! The canonical result of a run; every rendering is a pure function of it (and of the journal).
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod exploration;
mod merged;
mod message_coverage;
mod not_decided;
mod on_word;
mod parts;
mod program;
mod sent;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

pub use self::exploration::{Answers, ExplorationResult, MemberResult, SaidResult};
pub use self::merged::{MergeTrouble, MergedBundle, MergedPart, MergedParts, MergedRun, TroubleKind};
pub use self::message_coverage::{ActionCoverage, MemberCoverage, MessageCoverage, NeverShown, TopicCoverage, Unseen};
pub use self::not_decided::NotDecided;
pub use self::on_word::{OnWord, WordKind};
pub use self::parts::{Gathered, Part, gathered, most_common, others};
pub use self::program::{ProgramEnd, ProgramResult};
pub use self::sent::{Sent, SentMember};
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::event::{Setting, ShardRecord};
use tck_journal::{OwnLatency, Reason};

/// `result.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunResult {
    /// `vda5050-tck.result/1`.
    pub format: String,
    /// Tool name and version.
    pub tool: String,
    /// Identifier of the run.
    pub run: String,
    /// `certify` when nothing was left to choose; absent otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// Start in UTC, RFC 3339 with milliseconds.
    pub started: String,
    /// Length of the run in seconds.
    pub seconds: f64,
    /// `agv` or `master-control`.
    pub role: String,
    /// Protocol version judged by.
    pub protocol: String,
    /// Whether the run ended before its plan did.
    pub partial: bool,
    /// Why it is partial.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub partial_reason: Option<String>,
    /// Join over tests, monitors, and what became of the program that was started; absent when nothing was decided.
    pub verdict: Option<Verdict>,
    /// What became of the program that the run has started; absent when it has started none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<ProgramResult>,
    /// Why it is not certain that it was the device that was judged; absent as long as nothing speaks against it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mixed: Option<String>,
    /// The device.
    pub device: DeviceIdentity,
    /// `tap` or `subscriber`.
    pub vantage: String,
    /// SHA-256 over suites, schemas and requirements.
    pub suites_sha256: String,
    /// Whether the suites differ from the built-in ones.
    pub suites_modified: bool,
    /// Where the journal is, beside this file.
    pub journal: String,
    /// The runs that broke off and that this one goes on with, the first one first; their journal is the beginning of this.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joined: Vec<JoinedRun>,
    /// Which part of a run it is; absent when it is all of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<ShardRecord>,
    /// The parts that were joined into it; absent when it was carried out as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merged: Option<MergedRun>,
    /// Tests in the order they ran; not applicable ones after them.
    pub tests: Vec<TestResult>,
    /// Monitors.
    pub monitors: Vec<MonitorResult>,
    /// Requirements of this role and version, in catalogue order, decided or not.
    pub requirements: Vec<RequirementResult>,
    /// Where capabilities come from: name, value, source (factsheet, profile, contradiction).
    pub capabilities: Vec<Capability>,
    /// How a master control commanded its vehicles; absent when an AGV was tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fleet: Option<FleetResult>,
    /// What came of conversations; absent when no test is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exploration: Option<ExplorationResult>,
    /// Which members, words and action types of the standard came by, and which never did; absent in results of old.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message_coverage: Option<MessageCoverage>,
    /// How long the harness took with messages itself; absent in virtual time, and in results of old.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub harness_latency: Option<OwnLatency>,
    /// What rests on a person's word.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub on_word: Vec<OnWord>,
    /// What restricts this statement, one sentence each.
    pub limits: Vec<String>,
    /// Declared deviations of the profile: requirement id to reason.
    pub deviations: BTreeMap<String, String>,
    /// Effective settings with their origins.
    pub settings: Vec<Setting>,
}

/// A run that broke off, and with which another one goes on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JoinedRun {
    /// Identifier of the run.
    pub run: String,
    /// Start in UTC, RFC 3339 with milliseconds.
    pub started: String,
    /// Length in seconds.
    pub seconds: f64,
    /// Why it broke off.
    pub reason: String,
    /// How many of its tests are kept, because they were decided.
    pub kept: usize,
    /// How many records of the journal are its own.
    pub records: u64,
}

/// How a master control commanded its vehicles (MQTT-11; informative).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct FleetResult {
    /// How many mock AGVs there were.
    pub vehicles: usize,
    /// How many of them were sent an order.
    pub commanded: usize,
    /// From a state of a vehicle to the next order message for it; absent when none came.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reaction: Option<ReactionTimes>,
    /// Each vehicle, in the order of the fleet.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub each: Vec<CommandedVehicle>,
}

/// How one vehicle of a fleet was commanded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct CommandedVehicle {
    /// Serial number.
    pub serial_number: String,
    /// How many order messages it was sent.
    pub orders: usize,
    /// Half of its waits for an order are no longer, in milliseconds; absent when none was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub median: Option<f64>,
    /// Its longest wait, in milliseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub longest: Option<f64>,
}

/// A distribution of times, in milliseconds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct ReactionTimes {
    /// How many were measured.
    pub count: usize,
    /// The shortest.
    pub shortest: f64,
    /// Half of them are no longer.
    pub median: f64,
    /// Nine of ten are no longer.
    pub most: f64,
    /// Ninety-nine of a hundred are no longer.
    pub nearly_all: f64,
    /// The longest.
    pub longest: f64,
    /// How many are up to each of [`ReactionTimes::BOUNDS`] and above the one before; the last is above all bounds.
    pub buckets: Vec<usize>,
}

/// [`RunResult::mode`] of a run for a certificate.
pub const CERTIFY: &str = "certify";

impl RunResult {
    /// What counts beside tests and monitors: a program that ended by itself, and doubt about who was judged.
    #[must_use]
    pub fn aside(&self) -> Option<Verdict> {
        let program = self.program.as_ref().and_then(ProgramResult::verdict);
        let mixed = self.mixed.as_ref().map(|_| Verdict::Inconclusive);
        program.into_iter().chain(mixed).collect::<Accumulated>().get()
    }

    /// Whether nothing was left to choose in the run, so that a certificate can be given.
    #[must_use]
    pub fn certifies(&self) -> bool {
        self.mode.as_deref() == Some(CERTIFY)
    }

    /// Whether tests were left out because there was no time for them: they can be carried out later.
    #[must_use]
    pub fn ran_out_of_time(&self) -> bool {
        self.tests.iter().any(TestResult::ran_out_of_time)
    }

    /// The value of a setting, if it is set.
    #[must_use]
    pub fn setting(&self, name: &str) -> Option<&str> {
        let found = self.settings.iter().find(|setting| setting.name == name);
        found.map(|setting| setting.value.as_str())
    }
}

impl ReactionTimes {
    /// Upper bounds of the buckets in milliseconds: 1, 2, 5, 10 and so on, up to 50 s.
    pub const BOUNDS: [f64; 15] = [
        1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1_000.0, 2_000.0, 5_000.0, 10_000.0, 20_000.0, 50_000.0,
    ];

    /// The distribution of times in microseconds; `None` of none.
    #[must_use]
    pub fn of(micros: &[u32]) -> Option<Self> {
        let mut sorted = micros.to_vec();
        sorted.sort_unstable();
        let millis = |micros: u32| f64::from(micros) / 1_000.0;
        let at = |share: usize| {
            let place = (sorted.len() * share).div_ceil(100).saturating_sub(1);
            sorted.get(place).copied().map(millis)
        };
        let mut buckets = vec![0; Self::BOUNDS.len() + 1];
        for one in &sorted {
            let bucket = Self::BOUNDS.partition_point(|bound| *bound < millis(*one));
            buckets[bucket] += 1;
        }
        Some(Self {
            count: sorted.len(),
            shortest: millis(*sorted.first()?),
            median: at(50)?,
            most: at(90)?,
            nearly_all: at(99)?,
            longest: millis(*sorted.last()?),
            buckets,
        })
    }
}

/// Who was judged.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct DeviceIdentity {
    /// Manufacturer.
    pub manufacturer: String,
    /// Serial number.
    pub serial_number: String,
    /// Series name of the factsheet, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub series_name: Option<String>,
}

/// One test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestResult {
    /// Id.
    pub id: String,
    /// Title.
    pub title: String,
    /// Verdict; absent when not applicable.
    pub verdict: Option<Verdict>,
    /// Why it does not apply.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_applicable: Option<String>,
    /// How long it took.
    pub seconds: f64,
    /// Why the verdict is not a pass, in one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Of which kind that is, or why it does not apply; absent where only the text tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<Reason>,
    /// `reviewed`, `not reviewed` or `watchlist`.
    pub maturity: String,
    /// When it was reviewed and what was looked at, or what is disputed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maturity_note: Option<String>,
    /// First and last journal number.
    pub journal: Option<(u64, u64)>,
    /// What was decided.
    pub decisions: Vec<Decision>,
    /// The steps as they went.
    pub steps: Vec<StepResult>,
    /// Lasting mistakes of the device that would have stood in the way, and what else had to be done to get here.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub allowances: Vec<String>,
    /// Every time it was run, where the run was told to repeat tests; all else is of the worst of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub repetitions: Vec<Repetition>,
}

/// One of several times that a test was run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repetition {
    /// Which, counted from 1.
    pub number: u32,
    /// Its verdict.
    pub verdict: Option<Verdict>,
    /// How long it took.
    pub seconds: f64,
    /// Why the verdict is not a pass, in one line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// First and last journal number; absent when it was asked for and not done.
    pub journal: Option<(u64, u64)>,
}

impl Repetition {
    /// Whether it was carried out, and not only asked for.
    #[must_use]
    pub fn was_done(&self) -> bool {
        self.journal.is_some()
    }
}

impl TestResult {
    /// Whether the repetitions that were carried out have different verdicts.
    #[must_use]
    pub fn is_flaky(&self) -> bool {
        let mut done = self.repetitions.iter().filter(|one| one.was_done());
        let first = done.next();
        first.is_some_and(|first| done.any(|other| other.verdict != first.verdict))
    }

    /// Whether it was left out, or not repeated, because there was no time for it.
    #[must_use]
    pub fn ran_out_of_time(&self) -> bool {
        matches!(self.cause, Some(Reason::OverBudget { .. }))
    }

    /// How many of its repetitions were asked for and not carried out.
    #[must_use]
    pub fn left_out(&self) -> usize {
        self.repetitions.iter().filter(|one| !one.was_done()).count()
    }

    /// The decisions that are not a pass.
    pub fn findings(&self) -> impl Iterator<Item = &Decision> {
        self.decisions
            .iter()
            .filter(|decision| decision.verdict() != Verdict::Pass)
    }

    /// Whether every one of its steps was carried out, whatever came of them.
    #[must_use]
    pub fn came_to_its_end(&self) -> bool {
        self.journal.is_some() && self.steps.iter().all(|step| step.outcome != StepResult::NOT_RUN)
    }
}

impl StepResult {
    /// The outcome of a step that came to its end.
    pub const DONE: &str = "done";
    /// The outcome of a step that was not reached.
    pub const NOT_RUN: &str = "not run";
}

/// One step of a test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepResult {
    /// Path.
    pub path: String,
    /// Verb and object, such as `expect state`.
    pub verb: String,
    /// Title.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// File and line.
    pub place: String,
    /// `done`, `failed`, `not run`, `broken` or `interrupted`.
    pub outcome: String,
    /// First and last journal number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub journal: Option<(u64, u64)>,
    /// The message it took, by journal number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub took: Option<u64>,
    /// How long it took.
    pub seconds: f64,
}

/// One requirement decided by one clause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// Requirement id.
    pub requirement: String,
    /// What was decided. It is given once, and nothing changes it afterwards.
    verdict: Verdict,
    /// Path of the clause, such as `steps[6].assert`.
    pub clause: String,
    /// File and line of the clause.
    pub place: String,
    /// The message that decided it, by journal number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub witness: Option<u64>,
    /// One line.
    pub message: String,
    /// The last message that the test had sent; only where something is broken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sent: Option<Sent>,
    /// What was expected, values filled in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<String>,
    /// The nearest miss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearest: Option<NearestMiss>,
    /// What was waited for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waited: Option<Waited>,
    /// The failure as rustc would show it, without colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub explanation: Option<String>,
    /// The ruling of the catalogue this rests on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpretation: Option<String>,
}

impl Decision {
    /// A decision with nothing to show but its message.
    #[must_use]
    pub fn new(requirement: &str, verdict: Verdict, clause: String, place: String, message: String) -> Self {
        Self {
            requirement: requirement.to_owned(),
            verdict,
            clause,
            place,
            witness: None,
            message,
            sent: None,
            expected: None,
            nearest: None,
            waited: None,
            explanation: None,
            interpretation: None,
        }
    }

    /// What was decided.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// Whether it wants to be shown in full: something was seen that should not be, or a search can show what
    /// came closest. What merely could not be decided is listed.
    #[must_use]
    pub fn is_finding(&self) -> bool {
        match self.verdict {
            Verdict::Pass => false,
            Verdict::Warning | Verdict::Fail => true,
            Verdict::Inconclusive | Verdict::Error => self.explanation.is_some() || self.nearest.is_some(),
        }
    }
}

/// The message that came closest to what was expected.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NearestMiss {
    /// Journal number.
    pub seq: u64,
    /// Path of the value that did not fit.
    pub path: String,
    /// What stood there, bounded.
    pub found: String,
    /// What should have stood there.
    pub expected: String,
}

impl NearestMiss {
    /// The path, or that it is the message itself.
    #[must_use]
    pub fn place(&self) -> &str {
        if self.path.is_empty() {
            "the message"
        } else {
            &self.path
        }
    }
}

/// A wait that was part of a decision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waited {
    /// How long, in seconds.
    pub seconds: f64,
    /// Since which journal number.
    pub since: u64,
    /// How many messages on the topic came meanwhile.
    pub messages: u64,
}

/// One monitor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MonitorResult {
    /// Id.
    pub id: String,
    /// Title.
    pub title: String,
    /// Verdict; absent when there was nothing to judge.
    pub verdict: Option<Verdict>,
    /// How many messages it judged.
    pub judged: u64,
    /// What it found.
    pub findings: Vec<MonitorFinding>,
}

/// All findings of a monitor of one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MonitorFinding {
    /// Requirement id.
    pub requirement: String,
    /// How bad.
    pub verdict: Verdict,
    /// How often.
    pub count: u64,
    /// The first journal numbers.
    pub first: Vec<u64>,
    /// One line about the first occurrence.
    pub message: String,
    /// The ruling of the catalogue this rests on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpretation: Option<String>,
}

/// A verdict on a requirement, and who gave it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Given {
    /// The verdict.
    pub verdict: Verdict,
    /// Tests and monitors.
    pub by: Vec<String>,
}

/// What is known about one requirement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RequirementResult {
    /// Requirement id.
    pub id: String,
    /// The title of its chapter, where it is a requirement of somebody's own and none of the standard.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own: Option<String>,
    /// Join over everything that decided it; absent when nothing did.
    pub verdict: Option<Verdict>,
    /// Tests and monitors that decided it.
    pub decided_by: Vec<String>,
    /// The parts in which they did, where parts were joined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shards: Vec<usize>,
    /// Where they disagree: every verdict with those that gave it, the worst first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub verdicts: Vec<Given>,
    /// Why nothing did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_decided: Option<NotDecided>,
}

/// A capability and its source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Capability {
    /// Name, such as `action downloadMap INSTANT`.
    pub name: String,
    /// `yes`, `no`, or a value.
    pub value: String,
    /// `factsheet`, `profile`, or both when they contradict each other.
    pub source: String,
}
