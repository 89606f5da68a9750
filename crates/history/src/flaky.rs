//! Whether a requirement is flaky: the same test says once that it is kept and once that it is broken, and nothing that the runs
//! name lies between.

use serde::Serialize;

use crate::seen::SeenRun;
use tck_base::verdict::Verdict;

/// Where it shows that a requirement is flaky.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Flaky {
    /// The test or monitor.
    pub by: String,
    /// The runs, by number: one whose repetitions differ, or those between which the verdict turned.
    pub runs: Vec<usize>,
}

/// How often a verdict has to turn under the same conditions: once may be a change of the device that nobody has named.
const TURNS: usize = 2;

/// The last place where it shows that the requirement is flaky.
pub(crate) fn find(id: &str, runs: &[SeenRun]) -> Option<Flaky> {
    let mut deciders: Vec<&str> = Vec::new();
    for run in runs {
        let by = run.of(id).into_iter().flat_map(|seen| seen.by.keys());
        for decider in by.map(String::as_str) {
            if !deciders.contains(&decider) {
                deciders.push(decider);
            }
        }
    }
    let all = deciders.into_iter().filter_map(|decider| of_decider(id, decider, runs));
    all.max_by_key(|flaky| flaky.runs.last().copied())
}

fn of_decider(id: &str, decider: &str, runs: &[SeenRun]) -> Option<Flaky> {
    let mut found = None;
    // The runs between which the verdict turned, as long as nothing else did.
    let mut turns: Vec<usize> = Vec::new();
    let mut last: Option<(usize, bool)> = None;
    for (at, run) in runs.iter().enumerate() {
        let Some(fails) = verdict(id, decider, run) else {
            continue;
        };
        if run.flaky.contains(decider) {
            found = Some(vec![at + 1]);
        }
        match last {
            Some((before, failed)) if are_alike(decider, &runs[before], run) => {
                if failed != fails {
                    if turns.is_empty() {
                        turns.push(before + 1);
                    }
                    turns.push(at + 1);
                }
                if turns.len() > TURNS && failed != fails {
                    found = Some(turns.clone());
                }
            }
            _ => turns.clear(),
        }
        last = Some((at, fails));
    }
    found.map(|runs| Flaky {
        by: decider.to_owned(),
        runs,
    })
}

/// Whether a test or monitor found the requirement broken; nothing when it did not decide it.
fn verdict(id: &str, decider: &str, run: &SeenRun) -> Option<bool> {
    match run.of(id)?.by.get(decider)? {
        Verdict::Fail => Some(true),
        Verdict::Pass | Verdict::Warning => Some(false),
        Verdict::Inconclusive | Verdict::Error => None,
    }
}

/// Whether two runs were made in the same way, as far as they say. A monitor sees what the tests bring about, so these have to
/// be the same, too.
fn are_alike(decider: &str, one: &SeenRun, other: &SeenRun) -> bool {
    let is_test = one.tests.contains(decider) && other.tests.contains(decider);
    let same_tests = one.tests == other.tests && one.partial.is_none() && other.partial.is_none();
    (is_test || same_tests) && one.conditions.changes(&other.conditions).is_empty()
}
