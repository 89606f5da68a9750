//! What one run, or one side of an audit, has seen of each requirement.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::conditions::Conditions;
use tck_audit::result::{AuditResult, SideResult, VehicleResult};
use tck_base::verdict::Verdict;
use tck_journal::event::RunHeader;
use tck_report::clean::{line, short};
use tck_report::compare::Standing;
use tck_report::findings::PROGRAM;
use tck_report::statement;
use tck_result::{NotDecided, RequirementResult, RunResult};

/// Of which kind the runs of a series are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Tests of suites.
    Run,
    /// Random conversations.
    Exploration,
    /// Recorded traffic.
    Audit,
}

impl Kind {
    /// The word used in every output.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Exploration => "exploration",
            Self::Audit => "audit",
        }
    }
}

/// Who was judged, and by what: runs of one subject are one series.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Subject {
    pub manufacturer: String,
    pub serial_number: String,
    pub role: String,
    pub protocol: String,
    pub kind: Kind,
}

/// Who decides when a device's program may end: it has the place of a test or monitor.
const STARTED: &str = "the program that was started";
/// How long a sentence about a finding may be.
const LONGEST: usize = 300;

/// A run of one subject.
#[derive(Clone, Debug)]
pub(crate) struct SeenRun {
    pub subject: Subject,
    /// The folder of the bundle.
    pub path: String,
    /// Identifier of the run; nothing for an audit.
    pub run: Option<String>,
    pub started: String,
    /// The command line as typed; empty for an audit, and where it is not known.
    pub command: Vec<String>,
    pub verdict: Option<Verdict>,
    /// Why it is partial.
    pub partial: Option<String>,
    /// Whether tests that there are were not selected.
    pub selection: bool,
    /// The root hash of the bundle.
    pub root: String,
    /// Whether there is a page for people.
    pub has_report: bool,
    pub conditions: Conditions,
    /// The tests that ran, cases by the name of their table.
    pub tables: BTreeSet<String>,
    /// The tests that ran, and all cases.
    pub tests: BTreeSet<String>,
    /// The tests whose repetitions differ.
    pub flaky: BTreeSet<String>,
    /// Each requirement.
    pub requirements: BTreeMap<String, Seen>,
    /// The requirements in the order of the result.
    pub order: Vec<String>,
}

/// What was seen of one requirement.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seen {
    pub standing: Option<Standing>,
    /// The verdict of each test and monitor that decided it.
    pub by: BTreeMap<String, Verdict>,
    /// What was seen that should not be.
    pub text: Option<String>,
}

impl SeenRun {
    /// What a run has seen.
    pub fn of_run(result: &RunResult, header: Option<&RunHeader>, path: String, root: String) -> Self {
        let done = || result.tests.iter().filter(|test| test.journal.is_some());
        let texts = texts(result);
        let mut requirements: Vec<(String, Seen)> = result
            .requirements
            .iter()
            .map(|requirement| (requirement.id.clone(), seen(requirement, &texts)))
            .collect();
        if let Some(program) = &result.program {
            let verdict = program.verdict().unwrap_or(Verdict::Pass);
            requirements.push((
                PROGRAM.to_owned(),
                Seen {
                    standing: Some(Standing::Decided(verdict)),
                    by: BTreeMap::from([(STARTED.to_owned(), verdict)]),
                    text: program.story().map(|story| told(&story)),
                },
            ));
        }
        let not_selected =
            |requirement: &RequirementResult| matches!(requirement.not_decided, Some(NotDecided::NotSelected));
        let reason = || "it ended before its plan did".to_owned();
        Self {
            subject: Subject {
                manufacturer: result.device.manufacturer.clone(),
                serial_number: result.device.serial_number.clone(),
                role: result.role.clone(),
                protocol: result.protocol.clone(),
                kind: match result.exploration {
                    Some(_) => Kind::Exploration,
                    None => Kind::Run,
                },
            },
            path,
            run: Some(result.run.clone()),
            started: result.started.clone(),
            command: header.map(|header| header.command.clone()).unwrap_or_default(),
            verdict: result.verdict,
            partial: result
                .partial
                .then(|| result.partial_reason.clone().unwrap_or_else(reason)),
            selection: result.requirements.iter().any(not_selected),
            root,
            has_report: false,
            conditions: Conditions::of_run(result, header),
            tables: done().map(|test| table(&test.id).to_owned()).collect(),
            tests: done().map(|test| test.id.clone()).collect(),
            flaky: result
                .tests
                .iter()
                .filter(|test| test.is_flaky())
                .map(|test| test.id.clone())
                .collect(),
            order: requirements.iter().map(|(id, _)| id.clone()).collect(),
            requirements: requirements.into_iter().collect(),
        }
    }

    /// What an audit has seen: one for each side of each vehicle of which something was decided.
    pub fn of_audit(result: &AuditResult, path: &str, root: &str) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for vehicle in &result.vehicles {
            for side in vehicle.sides.iter().filter(|side| !side.requirements.is_empty()) {
                let one = Self::of_side(result, vehicle, side, path, root);
                match all.iter_mut().find(|known| known.subject == one.subject) {
                    Some(known) => known.join(one),
                    None => all.push(one),
                }
            }
        }
        all
    }

    fn of_side(result: &AuditResult, vehicle: &VehicleResult, side: &SideResult, path: &str, root: &str) -> Self {
        let requirements = side.requirements.iter().map(|decided| {
            let found = || side.findings.iter().filter(|finding| finding.requirement == decided.id);
            let mut by: BTreeMap<String, Verdict> = decided
                .decided_by
                .iter()
                .map(|monitor| (monitor.clone(), Verdict::Pass))
                .collect();
            for finding in found() {
                let known = by.entry(finding.monitor.clone()).or_insert(finding.verdict);
                *known = known.join(finding.verdict);
            }
            let seen = Seen {
                standing: Some(Standing::Decided(decided.verdict)),
                by,
                text: found().next().map(|finding| told(&finding.text)),
            };
            (decided.id.clone(), seen)
        });
        Self {
            subject: Subject {
                manufacturer: vehicle.manufacturer.clone(),
                serial_number: vehicle.serial_number.clone(),
                role: side.role.clone(),
                protocol: vehicle.protocol.clone().unwrap_or_else(|| "unknown".to_owned()),
                kind: Kind::Audit,
            },
            path: path.to_owned(),
            run: None,
            started: result.first.clone().unwrap_or_default(),
            command: Vec::new(),
            verdict: side.verdict,
            partial: None,
            selection: false,
            root: root.to_owned(),
            has_report: false,
            conditions: Conditions::of_audit(&result.tool, &vehicle.vantage),
            tables: BTreeSet::new(),
            tests: BTreeSet::new(),
            flaky: BTreeSet::new(),
            order: side.requirements.iter().map(|decided| decided.id.clone()).collect(),
            requirements: requirements.collect(),
        }
    }

    /// Takes in another part of the same side.
    fn join(&mut self, other: Self) {
        self.verdict = match (self.verdict, other.verdict) {
            (Some(one), Some(other)) => Some(one.join(other)),
            (one, other) => one.or(other),
        };
        for (id, seen) in other.requirements {
            let Some(known) = self.requirements.get_mut(&id) else {
                self.order.push(id.clone());
                self.requirements.insert(id, seen);
                continue;
            };
            for (by, verdict) in seen.by {
                let known = known.by.entry(by).or_insert(verdict);
                *known = known.join(verdict);
            }
            known.standing = match (known.standing, seen.standing) {
                (Some(one), Some(other)) => Some(one.join(other)),
                (one, other) => one.or(other),
            };
            known.text = known.text.take().or(seen.text);
        }
    }

    /// What it has seen of a requirement.
    pub fn of(&self, requirement: &str) -> Option<&Seen> {
        self.requirements.get(requirement)
    }

    /// How many requirements it has decided one way or the other.
    pub fn decided(&self) -> usize {
        let decided = |seen: &Seen| {
            matches!(
                seen.standing,
                Some(Standing::Decided(Verdict::Pass | Verdict::Warning | Verdict::Fail))
            )
        };
        self.requirements.values().filter(|seen| decided(seen)).count()
    }
}

/// The table that a case is of; a test that is no case stands for itself.
pub(crate) fn table(id: &str) -> &str {
    match id.strip_suffix(']').and_then(|id| id.split_once('[')) {
        Some((table, _)) => table,
        None => id,
    }
}

/// The first sentence about each requirement that is broken, or about which there is a remark, the worst first.
fn texts(result: &RunResult) -> BTreeMap<&str, (Verdict, &str)> {
    let of_tests = result.tests.iter().flat_map(|test| &test.decisions);
    let of_tests = of_tests.map(|one| (one.requirement.as_str(), one.verdict(), one.message.as_str()));
    let of_monitors = result.monitors.iter().flat_map(|monitor| &monitor.findings);
    let of_monitors = of_monitors.map(|one| (one.requirement.as_str(), one.verdict, one.message.as_str()));
    let mut all: BTreeMap<&str, (Verdict, &str)> = BTreeMap::new();
    for (id, verdict, text) in of_tests.chain(of_monitors) {
        let is_finding = matches!(verdict, Verdict::Fail | Verdict::Warning);
        if is_finding && all.get(id).is_none_or(|(known, _)| *known < verdict) {
            all.insert(id, (verdict, text));
        }
    }
    all
}

fn seen(requirement: &RequirementResult, texts: &BTreeMap<&str, (Verdict, &str)>) -> Seen {
    let mut by = BTreeMap::new();
    if let (Some(verdict), true) = (requirement.verdict, requirement.verdicts.is_empty()) {
        by.extend(requirement.decided_by.iter().map(|one| (one.clone(), verdict)));
    }
    for given in &requirement.verdicts {
        by.extend(given.by.iter().map(|one| (one.clone(), given.verdict)));
    }
    Seen {
        standing: Some(match statement::gap(requirement) {
            // What no test can decide is no gap that could be closed.
            Some(statement::Gap::NotTestable) => Standing::NotApplicable,
            _ => Standing::of_requirement(Some(requirement)),
        }),
        by,
        text: texts.get(requirement.id.as_str()).map(|(_, text)| told(text)),
    }
}

fn told(text: &str) -> String {
    short(&line(text), LONGEST).into_owned()
}
