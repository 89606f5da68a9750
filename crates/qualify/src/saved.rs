//! The outcome of a qualification as it is written and read again, and parts of it put together.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::decider::Decider;
use super::earlier;
use super::find::is_found;
use super::kill::Kill;
use super::outcome::Qualification;
use tck_base::verdict::{Accumulated, Verdict};
use tck_journal::event::ShardRecord;
use tck_judge::Library;
use tck_pack::{Pack, Role};
use tck_reference::Fault;
use tck_result::{MergedBundle, MergedParts, Part, gathered};
use tck_simulate::BuiltIn;

/// Format of the result of a qualification.
pub const RESULT_FORMAT: &str = "vda5050-tck.qualification/1";

/// The result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct QualificationResult {
    /// [`RESULT_FORMAT`].
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// SHA-256 over suites, schemas and requirements.
    pub suites_sha256: String,
    /// The tests that were asked for, as they were named; none is all of them.
    pub tests: Vec<String>,
    /// The faults that were asked for by name; none is all of them.
    pub faults: Vec<String>,
    /// Pass or fail; inconclusive where a part is missing.
    pub verdict: Option<Verdict>,
    /// Which part of the faults was tried; absent when all of them were.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<ShardRecord>,
    /// The parts that were joined into it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merged: Option<MergedParts>,
    /// Each role and version.
    pub sides: Vec<QualifiedSide>,
}

/// A role and a version.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct QualifiedSide {
    /// `agv` or `master-control`.
    pub role: String,
    /// Protocol version.
    pub protocol: String,
    /// What passes on the faultless device.
    pub deciders: Vec<Decider>,
    /// What does not.
    pub blemishes: Vec<Judged>,
    /// The faults that were tried.
    pub kills: Vec<TriedFault>,
    /// What is wrong, a line each.
    pub complaints: Vec<String>,
}

/// A decider with its verdict.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Judged {
    /// What decides.
    #[serde(flatten)]
    pub decider: Decider,
    /// How.
    pub verdict: Verdict,
}

/// A fault, and what failed or warned because of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TriedFault {
    /// Its name.
    pub fault: String,
    /// The worst verdict of the runs.
    pub verdict: Option<Verdict>,
    /// Whether it was found as it should be.
    pub found: bool,
    /// What failed or warned.
    pub deciders: Vec<Judged>,
}

impl QualifiedSide {
    /// Of an outcome. `clauses` says whether all clauses were to be proven, `whole` whether all that is wrong counts.
    #[must_use]
    pub fn of(outcome: &Qualification, pack: &Pack, clauses: bool, whole: bool) -> Self {
        let judged = |(decider, verdict): (&Decider, &Verdict)| Judged {
            decider: decider.clone(),
            verdict: *verdict,
        };
        let kills = outcome.kills.iter().map(|kill| TriedFault {
            fault: kill.fault.name.to_owned(),
            verdict: kill.verdict,
            found: is_found(outcome.role, kill),
            deciders: kill.deciders.iter().map(judged).collect(),
        });
        let blemishes = outcome
            .blemishes
            .iter()
            .map(|(decider, verdict)| judged((decider, verdict)));
        let complaints = if whole {
            outcome.complaints(clauses)
        } else {
            outcome
                .blemishes
                .iter()
                .map(|(decider, verdict)| format!("{decider} is {verdict} without a fault"))
                .collect()
        };
        Self {
            role: outcome.role.word().to_owned(),
            protocol: pack.version.to_string(),
            deciders: outcome.deciders.iter().cloned().collect(),
            blemishes: blemishes.collect(),
            kills: kills.collect(),
            complaints,
        }
    }

    /// The side under test.
    #[must_use]
    pub fn role(&self) -> Role {
        if self.role == Role::MasterControl.word() {
            Role::MasterControl
        } else {
            Role::Agv
        }
    }

    /// The outcome again, without faults that this program does not know.
    #[must_use]
    pub fn outcome(&self, library: &Library, pack: &Pack) -> Qualification {
        let role = self.role();
        let known =
            |name: &str| -> Option<Fault> { BuiltIn::faults(role).iter().find(|fault| fault.name == name).copied() };
        let kills = self.kills.iter().filter_map(|kill| {
            Some(Kill {
                fault: known(&kill.fault)?,
                deciders: kill
                    .deciders
                    .iter()
                    .map(|one| (one.decider.clone(), one.verdict))
                    .collect(),
                verdict: kill.verdict,
            })
        });
        Qualification {
            role,
            owes_faults: pack.finds_every_fault(),
            earlier: earlier(library, pack, role),
            blemishes: self
                .blemishes
                .iter()
                .map(|one| (one.decider.clone(), one.verdict))
                .collect(),
            deciders: self.deciders.iter().cloned().collect(),
            kills: kills.collect(),
            exceptions: library.rules.suites.exceptions.of(role, pack.version),
        }
    }
}

impl QualificationResult {
    /// Whether everything was asked for: then every fault has to be found, and every clause to be proven.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.tests.is_empty() && self.faults.is_empty()
    }

    /// Puts the verdict together: what is wrong, and what is missing.
    pub fn conclude(&mut self) {
        let sides = self.sides.iter().map(|side| match side.complaints.is_empty() {
            true => Verdict::Pass,
            false => Verdict::Fail,
        });
        let troubles = self.merged.iter().flat_map(|merged| &merged.troubles);
        let open = troubles.map(|_| Verdict::Inconclusive);
        self.verdict = sides.chain(open).collect::<Accumulated>().get();
    }
}

/// A part of a qualification.
#[derive(Clone, Debug, PartialEq)]
pub struct QualificationPart {
    /// What came out of it.
    pub result: QualificationResult,
    /// Where its bundle is.
    pub bundle: String,
    /// SHA-256 of its result, in hexadecimal.
    pub sha256: String,
}

impl Part for QualificationPart {
    fn shard(&self) -> Option<&ShardRecord> {
        self.result.shard.as_ref()
    }

    fn evidence(&self) -> &str {
        &self.sha256
    }

    fn name(&self) -> String {
        format!("the qualification in {}", self.bundle)
    }

    fn facts(&self) -> BTreeMap<String, String> {
        let result = &self.result;
        let all = [
            ("tool", result.tool.clone()),
            ("hash of the suites", result.suites_sha256.clone()),
            ("choice of tests", result.tests.join(", ")),
            ("choice of faults", result.faults.join(", ")),
        ];
        all.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// Joins parts of a qualification; what all of them leave unproven is still to be tried. One that is given twice counts once.
/// `None` when there is no part among them.
#[must_use]
pub fn join(parts: &[QualificationPart]) -> Option<QualificationResult> {
    let parts = gathered(parts)?;
    let own = &parts.own;
    let first = &own.first()?.result;
    let mut sides: BTreeMap<(String, String), Vec<&QualifiedSide>> = BTreeMap::new();
    for side in own.iter().flat_map(|part| &part.result.sides) {
        sides
            .entry((side.role.clone(), side.protocol.clone()))
            .or_default()
            .push(side);
    }
    let merged = MergedParts {
        of: parts.of,
        parts: parts
            .all
            .iter()
            .map(|(part, counts)| merged_bundle(part, *counts))
            .collect(),
        troubles: parts.troubles,
    };
    let mut result = QualificationResult {
        shard: None,
        merged: Some(merged),
        sides: sides.into_values().filter_map(|all| side(&all)).collect(),
        ..first.clone()
    };
    result.conclude();
    Some(result)
}

fn merged_bundle(part: &QualificationPart, counts: bool) -> MergedBundle {
    MergedBundle {
        index: part.index(),
        counts,
        verdict: part.result.verdict,
        size: part.result.sides.iter().map(|side| side.kills.len()).sum(),
        bundle: part.bundle.clone(),
        sha256: part.sha256.clone(),
    }
}

/// One role and version of all parts.
fn side(all: &[&QualifiedSide]) -> Option<QualifiedSide> {
    let first = all.first()?;
    let deciders: BTreeSet<&Decider> = all.iter().flat_map(|side| &side.deciders).collect();
    let blemishes: BTreeSet<&Judged> = all.iter().flat_map(|side| &side.blemishes).collect();
    let complaints: BTreeSet<&String> = all.iter().flat_map(|side| &side.complaints).collect();
    let mut kills: BTreeMap<usize, TriedFault> = BTreeMap::new();
    let faults = BuiltIn::faults(first.role());
    for kill in all.iter().flat_map(|side| &side.kills) {
        let place = faults
            .iter()
            .position(|fault| fault.name == kill.fault)
            .unwrap_or(usize::MAX);
        match kills.get_mut(&place) {
            Some(known) => both(known, kill),
            None => {
                kills.insert(place, kill.clone());
            }
        }
    }
    Some(QualifiedSide {
        role: first.role.clone(),
        protocol: first.protocol.clone(),
        deciders: deciders.into_iter().cloned().collect(),
        blemishes: blemishes.into_iter().cloned().collect(),
        kills: kills.into_values().collect(),
        complaints: complaints.into_iter().cloned().collect(),
    })
}

/// Adds what another part found with the same fault.
fn both(known: &mut TriedFault, other: &TriedFault) {
    let mut all: BTreeMap<Decider, Verdict> = BTreeMap::new();
    for one in known.deciders.iter().chain(&other.deciders) {
        let verdict = all.entry(one.decider.clone()).or_insert(one.verdict);
        *verdict = verdict.join(one.verdict);
    }
    known.deciders = all
        .into_iter()
        .map(|(decider, verdict)| Judged { decider, verdict })
        .collect();
    known.verdict = known.verdict.max(other.verdict);
    known.found |= other.found;
}
