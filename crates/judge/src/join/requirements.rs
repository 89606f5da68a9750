//! What all parts together say of each requirement, and in which of them it was decided.

use std::collections::{BTreeMap, BTreeSet};

use super::RunPart;
use crate::requirement_verdict::RequirementVerdict;
use crate::rules::Rules;
use tck_base::verdict::Verdict;
use tck_pack::Role;
use tck_result::{MergeTrouble, NotDecided, Part as _, RequirementResult, TestResult, TroubleKind};

/// Where a decider stands: tests in the order of the suites, those that ran first, then monitors in theirs.
type Place = (bool, bool, usize);

/// One verdict of one decider in one part.
struct Opinion {
    place: Place,
    by: String,
    verdict: Verdict,
    ran: bool,
    shard: usize,
}

/// The requirements of the whole, in the order of the catalogue.
pub(super) fn requirements(
    rules: &Rules,
    role: Role,
    own: &[&RunPart],
    tests: &[TestResult],
    troubles: &[MergeTrouble],
) -> Vec<RequirementResult> {
    let places = Places::of(rules);
    let mut opinions: BTreeMap<&str, Vec<Opinion>> = BTreeMap::new();
    let mut known: BTreeMap<&str, &RequirementResult> = BTreeMap::new();
    let mut reasons: BTreeMap<&str, Vec<&NotDecided>> = BTreeMap::new();
    for part in own {
        let aside: BTreeSet<&str> = part
            .result
            .tests
            .iter()
            .filter(|test| test.journal.is_none())
            .map(|test| test.id.as_str())
            .collect();
        for requirement in &part.result.requirements {
            known.entry(&requirement.id).or_insert(requirement);
            let all = opinions.entry(&requirement.id).or_default();
            for (verdict, by) in given(requirement) {
                let ran = !aside.contains(by);
                all.push(Opinion {
                    place: places.place(by, ran),
                    by: by.to_owned(),
                    verdict,
                    ran,
                    shard: part.index(),
                });
            }
            reasons
                .entry(&requirement.id)
                .or_default()
                .extend(&requirement.not_decided);
        }
    }
    let is_missing = troubles.iter().any(|trouble| trouble.kind == TroubleKind::Missing);
    let mut all: Vec<RequirementResult> = Vec::new();
    for (id, first) in known {
        let mut given = opinions.remove(id).unwrap_or_default();
        given.sort_by(|one, other| (one.place, &one.by, one.shard).cmp(&(other.place, &other.by, other.shard)));
        let mut joined = RequirementVerdict::default();
        for one in &given {
            joined.add(one.verdict, &one.by, one.ran);
        }
        let verdict = joined.verdict();
        let shards: BTreeSet<usize> = given.iter().map(|one| one.shard).collect();
        let why = reasons.remove(id).unwrap_or_default();
        all.push(RequirementResult {
            id: id.to_owned(),
            own: first.own.clone(),
            verdict,
            verdicts: joined.verdicts(),
            decided_by: joined.by,
            shards: shards.into_iter().collect(),
            not_decided: verdict
                .is_none()
                .then(|| why_not(rules, role, id, &why, tests, is_missing)),
        });
    }
    let catalogue = rules.catalogue.all().enumerate();
    let order: BTreeMap<&str, usize> = catalogue.map(|(at, one)| (one.id.as_str(), at)).collect();
    all.sort_by_key(|one| order.get(one.id.as_str()).copied().unwrap_or(usize::MAX));
    all
}

/// What a part says of a requirement: every decider with its verdict.
fn given(requirement: &RequirementResult) -> Vec<(Verdict, &str)> {
    let differ = requirement.verdicts.iter();
    let differ = differ.flat_map(|given| given.by.iter().map(|by| (given.verdict, by.as_str())));
    let differ: Vec<(Verdict, &str)> = differ.collect();
    match requirement.verdict {
        Some(verdict) if differ.is_empty() => {
            let all = requirement.decided_by.iter();
            all.map(|by| (verdict, by.as_str())).collect()
        }
        _ => differ,
    }
}

/// Why nothing decided a requirement in any part.
fn why_not(
    rules: &Rules,
    role: Role,
    id: &str,
    why: &[&NotDecided],
    tests: &[TestResult],
    is_missing: bool,
) -> NotDecided {
    let fixed = why
        .iter()
        .find(|why| matches!(why, NotDecided::NotTestable(_) | NotDecided::NoTest));
    if let Some(why) = fixed {
        return (**why).clone();
    }
    let mut deciding = rules.suites.deciding(id).iter().filter(|test| test.device == role);
    let reason = deciding.find_map(|test| {
        let result = tests.iter().find(|result| result.id == test.id)?;
        result.not_applicable.clone()
    });
    match (reason, why.first()) {
        (Some(reason), _) => NotDecided::NotApplicable(reason),
        (None, _) if is_missing => NotDecided::Other("not decided in the parts that are there".to_owned()),
        (None, Some(NotDecided::NothingCame)) => NotDecided::NothingCame,
        (None, _) => NotDecided::NotSelected,
    }
}

/// Where tests and monitors stand in the suites.
struct Places<'r> {
    tests: BTreeMap<&'r str, usize>,
    monitors: BTreeMap<&'r str, usize>,
}

impl<'r> Places<'r> {
    fn of(rules: &'r Rules) -> Self {
        let tests = rules.suites.tests.iter().enumerate();
        let monitors = rules.suites.monitors.iter().enumerate();
        Self {
            tests: tests.map(|(at, test)| (test.id.as_str(), at)).collect(),
            monitors: monitors.map(|(at, monitor)| (monitor.id.as_str(), at)).collect(),
        }
    }

    fn place(&self, id: &str, ran: bool) -> Place {
        match (self.tests.get(id), self.monitors.get(id)) {
            (Some(at), _) => (false, !ran, *at),
            (None, Some(at)) => (true, false, *at),
            (None, None) => (true, true, usize::MAX),
        }
    }
}
