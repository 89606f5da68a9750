//! No false accusation: whatever liberty a good vehicle takes, and whatever the timing, every test that runs is
//! decided, and none fails.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use vda5050_tck::pack::Pack;
use vda5050_tck::reference::agv::TOLERANCES;
use vda5050_tck::report::result::RunResult;
use vda5050_tck::run::{Library, VirtualRun, decided, run_silently};
use vda5050_tck::verdict::Verdict;

/// Liberties that exclude another one: of each pair the second is left out where all are taken at once.
const EXCLUDED: [&str; 6] = [
    "answers-very-slowly",
    "states-seldom",
    "actions-at-once",
    "visualization-off",
    "optional-omitted",
    "pretty-printed",
];

/// Runs everything on all cores; the results come in the order of the requests.
fn run_all(library: &Library, pack: &Pack, requests: Vec<VirtualRun>) -> Vec<RunResult> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(request) = requests.get(at) else { break };
                    let finished = run_silently(library, pack, request.clone()).unwrap();
                    results.lock().unwrap().push((at, finished.result));
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap();
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

fn with(library: &Library, pack: &Pack, tolerances: &[&str]) -> VirtualRun {
    let mut request = VirtualRun::of(library, pack);
    for name in tolerances {
        request.device.tolerate(name).unwrap();
    }
    request
}

/// What is worse than a pass, one line each; `Err` when anything is worse than a warning.
fn blemishes(result: &RunResult) -> Result<BTreeSet<String>, String> {
    let mut warnings = BTreeSet::new();
    let mut worse = String::new();
    for (decider, verdict) in decided(result) {
        let line = format!("{} {}", decider.requirement, decider.place);
        match verdict {
            Verdict::Pass => {}
            Verdict::Warning => {
                warnings.insert(line);
            }
            _ => {
                let _ = writeln!(worse, "  {} {line}", verdict.word());
            }
        }
    }
    let unjudged = result.tests.iter().filter(|test| test.decisions.is_empty());
    for test in unjudged.filter(|test| test.verdict.is_some_and(|verdict| verdict > Verdict::Warning)) {
        let _ = writeln!(worse, "  {} {}", test.verdict.unwrap().word(), test.id);
    }
    if worse.is_empty() { Ok(warnings) } else { Err(worse) }
}

#[test]
fn with_each_tolerance_everything_is_decided_and_nothing_fails() {
    let library = Library::load(None).unwrap();
    let pack = library.rules.packs.latest();
    let requests = TOLERANCES
        .iter()
        .map(|tolerance| with(&library, pack, &[tolerance.name]))
        .collect();
    let mut worse = String::new();
    let mut warned = String::new();
    for (tolerance, result) in TOLERANCES.iter().zip(run_all(&library, pack, requests)) {
        match blemishes(&result) {
            Ok(warnings) => {
                for line in warnings {
                    let _ = writeln!(warned, "{}: {line}", tolerance.name);
                }
            }
            Err(lines) => {
                let _ = write!(worse, "{}:\n{lines}", tolerance.name);
            }
        }
    }
    assert!(
        worse.is_empty(),
        "a vehicle is accused that does nothing wrong\n{worse}"
    );
    insta::assert_snapshot!(warned);
}

#[test]
fn whatever_the_seed_the_verdicts_are_the_same() {
    let library = Library::load(None).unwrap();
    let pack = library.rules.packs.latest();
    let together: Vec<&str> = TOLERANCES
        .iter()
        .map(|tolerance| tolerance.name)
        .filter(|name| !EXCLUDED.contains(name))
        .collect();
    let requests = (0..50)
        .map(|seed| {
            // One of two runs is of a vehicle with its own manners, under the weather of a busy network.
            let mut request = with(&library, pack, if seed % 2 == 0 { &[] } else { &together });
            request.seed = seed;
            request.jitter = Duration::from_millis(5 * (seed % 5));
            request.coalesce = Duration::from_millis(10 * (seed % 4));
            request
        })
        .collect();
    let verdicts = |result: &RunResult| -> Vec<String> {
        let tests = result.tests.iter().map(|test| {
            let good = test.verdict.is_none_or(|verdict| verdict <= Verdict::Warning);
            format!("{} {}", test.id, if good { "ok" } else { "bad" })
        });
        let requirements = result.requirements.iter().map(|one| {
            let decided = one.verdict.is_some();
            format!("{} {}", one.id, if decided { "decided" } else { "open" })
        });
        tests.chain(requirements).collect()
    };
    let mut first: Option<Vec<String>> = None;
    for (seed, result) in run_all(&library, pack, requests).iter().enumerate() {
        if let Err(worse) = blemishes(result) {
            panic!("seed {seed}:\n{worse}");
        }
        let verdicts = verdicts(result);
        let first = first.get_or_insert_with(|| verdicts.clone());
        assert_eq!(*first, verdicts, "seed {seed}");
    }
}
