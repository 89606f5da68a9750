//! What an audit found, for programs.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::time_line::TimeLine;
use super::time_stretch::TimeStretch;
use tck_base::verdict::{Accumulated, Verdict};
use tck_capture::{Counted, SourcePosition};
use tck_journal::event::ShardRecord;
use tck_pack::Role;
use tck_report::course::CoursePicture;
use tck_report::manifest::digest;
use tck_result::{MergedParts, MessageCoverage};

/// Format of the result of an audit.
pub const RESULT_FORMAT: &str = "vda5050-tck.audit/1";
/// Of so many messages it is known where they stand.
const PLACES: usize = 16_384;

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct AuditResult {
    /// [`RESULT_FORMAT`].
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// The worst of all sides; `None` when nothing was judged.
    pub verdict: Option<Verdict>,
    /// The recordings.
    pub recordings: Vec<Recording>,
    /// Messages in all.
    pub messages: u64,
    /// When the first one was recorded.
    pub first: Option<String>,
    /// When the last one was recorded.
    pub last: Option<String>,
    /// Messages on topics of no vehicle, or of one that is not wanted.
    pub elsewhere: u64,
    /// Messages of vehicles beyond those that are judged at once.
    pub beyond: u64,
    /// Messages of vehicles that another part judges.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub others: u64,
    /// Which part of the vehicles was judged; absent when all of them were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<ShardRecord>,
    /// The parts that were joined into it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merged: Option<MergedParts>,
    /// The master control as a whole, where more than one vehicle heard of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub master_control: Option<Whole>,
    /// The vehicles.
    pub vehicles: Vec<VehicleResult>,
}

/// The master control over all vehicles that it commands.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Whole {
    /// The worst of all vehicles.
    pub verdict: Option<Verdict>,
    /// How many vehicles it commands.
    pub vehicles: usize,
    /// Its messages.
    pub messages: u64,
    /// What was decided, the worst first.
    pub requirements: Vec<WholeDecided>,
}

/// A requirement of the master control over all vehicles.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct WholeDecided {
    /// Its id.
    pub id: String,
    /// The worst of all vehicles.
    pub verdict: Verdict,
    /// With how many vehicles it stands so.
    pub vehicles: usize,
}

/// One recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Recording {
    /// Its name.
    pub name: String,
    /// What it consists of: `line`, or `frame` of captured traffic.
    pub unit: String,
    /// Its length in bytes, as it lies there; unknown of standard input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
    /// Its SHA-256 in hexadecimal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Lines in all.
    pub lines: u64,
    /// Lines that hold no message.
    pub skipped: u64,
    /// Frames of connections that are encrypted, and were not read.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub encrypted: u64,
    /// Frames of connections that speak WebSocket, and were not read.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub web_socket: u64,
}

impl Recording {
    /// The recording of that name, after so much was read of it.
    #[must_use]
    pub fn new(name: String, unit: &str, counted: Counted) -> Self {
        Self {
            name,
            unit: unit.to_owned(),
            bytes: None,
            sha256: None,
            lines: counted.lines,
            skipped: counted.skipped,
            encrypted: counted.encrypted,
            web_socket: counted.web_socket,
        }
    }

    /// Takes the fingerprint of the file of that name, where it is one.
    #[must_use]
    pub fn hashed(mut self) -> Self {
        let path = Path::new(&self.name);
        if let Some((bytes, sha256)) = path.is_file().then(|| digest(path).ok()).flatten() {
            self.bytes = Some(bytes);
            self.sha256 = Some(sha256);
        }
        self
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// One vehicle, with the master control that commands it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct VehicleResult {
    /// Manufacturer.
    pub manufacturer: String,
    /// Serial number.
    pub serial_number: String,
    /// Its topics, with `{topic}` for the name.
    pub topics: String,
    /// Protocol version it is judged by.
    pub protocol: Option<String>,
    /// Which stretch of its time it is, where time was cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stretch: Option<TimeStretch>,
    /// Why it is not judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_judged: Option<String>,
    /// Messages by topic name.
    pub messages: BTreeMap<String, u64>,
    /// How often messages are missing.
    pub holes: u64,
    /// Messages that were recorded twice.
    pub twice: u64,
    /// Messages that were stored by the broker, or may have been: they are not judged.
    pub retained: u64,
    /// `subscriber`, or `tap` where packets were recorded.
    pub vantage: String,
    /// What is allowed in its messages and in those to it, and looks like a slip.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hints: Vec<HintResult>,
    /// What it did over time.
    #[serde(default, skip_serializing_if = "TimeLine::is_empty")]
    pub time_line: TimeLine,
    /// Where it was in orders during which something was found.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub courses: Vec<CoursePicture>,
    /// What its messages and those to it never had of that which the standard has; absent in results of old.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message_coverage: Option<MessageCoverage>,
    /// Its sides.
    pub sides: Vec<SideResult>,
}

/// One side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SideResult {
    /// `agv` or `master-control`.
    pub role: String,
    /// `None` when nothing was judged.
    pub verdict: Option<Verdict>,
    /// Messages of this side.
    pub messages: u64,
    /// How many monitors had something to judge.
    pub judged: usize,
    /// Fails and warnings, the worst first.
    pub findings: Vec<FindingResult>,
    /// The mistakes behind them, in the same order: one for each finding that follows from no other one. Of an audit that is over.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<CauseResult>,
    /// What is worth knowing, and decides nothing.
    pub information: Vec<FindingResult>,
    /// The requirements that were decided.
    pub requirements: Vec<Decided>,
    /// The monitors that could not judge.
    pub undecided: Vec<Undecided>,
    /// Why nothing is said of this side, though messages of it came.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_judged: Option<String>,
    /// Live messages of this side that were held against those before them.
    pub compared: u64,
    /// Those that were not.
    pub not_compared: u64,
    /// Where those stand, as far as they are kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stretches: Vec<Stretch>,
}

/// Messages that come one after the other and were not held against those before them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Stretch {
    /// How many of this side.
    pub messages: u64,
    /// The first one.
    pub from: Whereabouts,
    /// The last one.
    pub to: Whereabouts,
    /// Why.
    pub why: String,
}

/// Where a message stands, and when it came.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Whereabouts {
    /// Its number, counted from 1.
    pub message: u64,
    /// Number of its recording, counted from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<usize>,
    /// Its line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// When it came.
    pub at: String,
}

/// What a monitor found, with all of its kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FindingResult {
    /// Id of the monitor.
    pub monitor: String,
    /// The requirement.
    pub requirement: String,
    /// The verdict.
    pub verdict: Verdict,
    /// How often.
    pub count: u64,
    /// Number of the first message that shows it, counted from 1.
    pub message: u64,
    /// Number of its recording, counted from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<usize>,
    /// Its line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// When it was found first.
    pub first: String,
    /// When it was found last.
    pub last: String,
    /// What is wrong, of the first one.
    pub text: String,
    /// The first message that shows it, as far as it is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shown: Option<String>,
    /// The ruling it rests on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpretation: Option<String>,
}

/// Something that is allowed and looks like a slip, with all of its kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct HintResult {
    /// Topic name of the messages.
    pub topic: String,
    /// Where it stands in the first one, as a JSON pointer.
    pub pointer: String,
    /// One line.
    pub text: String,
    /// How often.
    pub count: u64,
    /// The first message with it.
    #[serde(flatten)]
    pub first: Whereabouts,
}

/// A finding that follows from no other one, and those that follow from it, by their numbers among the findings of the side,
/// counted from 0.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct CauseResult {
    /// The finding.
    pub finding: usize,
    /// This thing, found as a breach of another requirement or by another monitor.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub same: Vec<usize>,
    /// What rests on what it breaks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub follows: Vec<usize>,
}

/// A requirement that was decided.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Decided {
    /// Its id.
    pub id: String,
    /// How.
    pub verdict: Verdict,
    /// By which monitors.
    pub decided_by: Vec<String>,
}

/// A monitor that could not judge.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Undecided {
    /// Its id.
    pub monitor: String,
    /// Why.
    pub why: String,
    /// The messages for which that holds, where it does not hold for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stretch: Option<Stretch>,
}

impl SideResult {
    /// Puts a side together.
    #[must_use]
    pub fn new(
        role: Role,
        messages: u64,
        judged: usize,
        found: Vec<FindingResult>,
        passed: BTreeSet<(String, String)>,
        undecided: Vec<Undecided>,
    ) -> Self {
        let is_finding = |finding: &FindingResult| matches!(finding.verdict, Verdict::Fail | Verdict::Warning);
        let (mut findings, information): (Vec<_>, Vec<_>) = found.into_iter().partition(is_finding);
        findings.sort_by(|one, other| {
            let key = |finding: &FindingResult| (Reverse(finding.verdict), finding.message, Reverse(finding.count));
            key(one).cmp(&key(other))
        });
        let mut verdict: Accumulated = findings.iter().map(|finding| finding.verdict).collect();
        if judged > 0 {
            verdict.add(Verdict::Pass);
        }
        let mut decided: BTreeMap<String, (Verdict, BTreeSet<String>)> = BTreeMap::new();
        let passed = passed.into_iter().map(|(id, monitor)| (id, Verdict::Pass, monitor));
        let broken = findings.iter().map(|finding| {
            let FindingResult {
                requirement, monitor, ..
            } = finding;
            (requirement.clone(), finding.verdict, monitor.clone())
        });
        for (id, verdict, monitor) in passed.chain(broken) {
            let known = decided.entry(id).or_insert((verdict, BTreeSet::new()));
            known.0 = known.0.join(verdict);
            known.1.insert(monitor);
        }
        let requirements = decided.into_iter().map(|(id, (verdict, by))| Decided {
            id,
            verdict,
            decided_by: by.into_iter().collect(),
        });
        Self {
            role: role.word().to_owned(),
            verdict: verdict.get(),
            messages,
            judged,
            causes: Vec::new(),
            findings,
            information,
            requirements: requirements.collect(),
            undecided,
            not_judged: None,
            compared: 0,
            not_compared: 0,
            stretches: Vec::new(),
        }
    }

    /// Takes back that something is kept where too little was seen; what is wrong is wrong.
    #[must_use]
    pub fn unless(mut self, why: Option<&str>) -> Self {
        if let Some(why) = why {
            self.not_judged = Some(why.to_owned());
            self.requirements.retain(|known| known.verdict != Verdict::Pass);
            self.verdict = self.verdict.filter(|verdict| *verdict != Verdict::Pass);
        }
        self
    }
}

impl AuditResult {
    /// Takes in what was found of a vehicle beside the audit. Where the audit has found the same, that counts once more.
    pub fn add(&mut self, (manufacturer, serial_number): (&str, &str), finding: FindingResult) {
        let mut vehicles = self.vehicles.iter_mut().rev();
        let vehicle =
            vehicles.find(|vehicle| vehicle.manufacturer == manufacturer && vehicle.serial_number == serial_number);
        let sides = vehicle.into_iter().flat_map(|vehicle| &mut vehicle.sides);
        let Some(side) = sides.into_iter().find(|side| side.role == Role::Agv.word()) else {
            return;
        };
        side.add(finding);
        self.conclude();
    }

    /// Puts together what was found of the vehicles.
    pub fn conclude(&mut self) {
        self.verdict = verdict_of(&self.vehicles);
        self.master_control = whole(&self.vehicles);
    }
}

/// What was found of the master control of all vehicles; `None` when it commands fewer than two.
pub(super) fn whole(vehicles: &[VehicleResult]) -> Option<Whole> {
    let sides = vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    let sides: Vec<&SideResult> = sides.filter(|side| side.role == Role::MasterControl.word()).collect();
    let commanded: BTreeSet<(&str, &str)> = vehicles
        .iter()
        .filter(|vehicle| vehicle.sides.iter().any(|side| side.role == Role::MasterControl.word()))
        .map(|vehicle| (vehicle.manufacturer.as_str(), vehicle.serial_number.as_str()))
        .collect();
    if commanded.len() < 2 {
        return None;
    }
    let mut decided: BTreeMap<&str, Vec<Verdict>> = BTreeMap::new();
    for known in sides.iter().flat_map(|side| &side.requirements) {
        decided.entry(&known.id).or_default().push(known.verdict);
    }
    let requirements = decided.into_iter().filter_map(|(id, all)| {
        let worst = all.iter().copied().collect::<Accumulated>().get()?;
        Some(WholeDecided {
            id: id.to_owned(),
            verdict: worst,
            vehicles: all.iter().filter(|verdict| **verdict == worst).count(),
        })
    });
    let mut requirements: Vec<WholeDecided> = requirements.collect();
    requirements.sort_by_key(|known| (std::cmp::Reverse(known.verdict), std::cmp::Reverse(known.vehicles)));
    Some(Whole {
        verdict: sides
            .iter()
            .filter_map(|side| side.verdict)
            .collect::<Accumulated>()
            .get(),
        vehicles: commanded.len(),
        messages: sides.iter().map(|side| side.messages).sum(),
        requirements,
    })
}

impl SideResult {
    fn add(&mut self, finding: FindingResult) {
        self.put(finding, |_, _| true);
    }

    /// Takes in a finding; one that says something else is another one.
    pub(super) fn add_apart(&mut self, finding: FindingResult) {
        self.put(finding, |known, new| known.text == new.text);
    }

    fn put(&mut self, finding: FindingResult, is_alike: impl Fn(&FindingResult, &FindingResult) -> bool) {
        let verdict = finding.verdict;
        self.verdict = Some(self.verdict.map_or(verdict, |known| known.join(verdict)));
        match self.requirements.iter_mut().find(|one| one.id == finding.requirement) {
            Some(decided) => {
                decided.verdict = decided.verdict.join(verdict);
                if !decided.decided_by.contains(&finding.monitor) {
                    decided.decided_by.push(finding.monitor.clone());
                }
            }
            None => self.requirements.push(Decided {
                id: finding.requirement.clone(),
                verdict,
                decided_by: vec![finding.monitor.clone()],
            }),
        }
        let is_same = |known: &&mut FindingResult| {
            (&known.monitor, &known.requirement, known.verdict) == (&finding.monitor, &finding.requirement, verdict)
                && is_alike(known, &finding)
        };
        match self.findings.iter_mut().find(is_same) {
            Some(known) => {
                known.count += finding.count;
                known.last = finding.last;
            }
            None => {
                let at = self.findings.partition_point(|known| known.verdict >= verdict);
                self.findings.insert(at, finding);
                self.own_cause(at);
            }
        }
    }
}

impl SideResult {
    /// A finding has come to stand at this number, and follows from nothing, where it is known already what follows from what.
    fn own_cause(&mut self, at: usize) {
        if self.causes.is_empty() {
            return;
        }
        for cause in &mut self.causes {
            let moved = std::iter::once(&mut cause.finding)
                .chain(&mut cause.same)
                .chain(&mut cause.follows);
            moved.filter(|number| **number >= at).for_each(|number| *number += 1);
        }
        let place = self.causes.partition_point(|cause| cause.finding < at);
        let own = CauseResult {
            finding: at,
            same: Vec::new(),
            follows: Vec::new(),
        };
        self.causes.insert(place, own);
    }
}

/// The worst verdict of all sides.
fn verdict_of(vehicles: &[VehicleResult]) -> Option<Verdict> {
    let sides = vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    sides.filter_map(|side| side.verdict).collect::<Accumulated>().get()
}

/// Where the last messages stand.
#[derive(Debug, Default)]
pub struct Whence(VecDeque<(u64, SourcePosition)>);

impl Whence {
    pub(super) fn note(&mut self, message: u64, place: SourcePosition) {
        if self.0.len() == PLACES {
            self.0.pop_front();
        }
        self.0.push_back((message, place));
    }

    /// Where a message stands, if that is still known.
    pub(super) fn of(&self, message: u64) -> Option<SourcePosition> {
        let at = self.0.binary_search_by_key(&message, |(number, _)| *number).ok()?;
        self.0.get(at).map(|(_, place)| *place)
    }
}
