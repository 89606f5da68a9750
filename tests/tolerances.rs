//! No false accusation: whatever liberty a good vehicle takes, and whatever the timing, every test that runs is
//! decided, and none fails.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use vda5050_tck::pack::Pack;
use vda5050_tck::qualify::{Decider, decided};
use vda5050_tck::reference::deviations::agv::{FAULTS, TOLERANCES};
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{Library, VirtualRun, run_silently};
use vda5050_tck::verdict::Verdict;

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Liberties that exclude another one: of each pair the second is left out where all are taken at once.
const EXCLUDED: [&str; 12] = [
    // Beside single-precision, whose angles are rounded already.
    "angles-rounded",
    // Fewer tests apply to such a vehicle.
    "little-fits",
    "answers-slowly",
    "answers-very-slowly",
    "drives-slowly",
    "states-often",
    "visualization-often",
    "states-seldom",
    "actions-at-once",
    "visualization-off",
    "optional-omitted",
    "pretty-printed",
];

/// What cannot be seen of a vehicle with such a liberty, so that inconclusive is the right word.
const UNSEEN: [(&str, &str); 9] = [
    ("optional-omitted", "order-content/velocity-sign"), // It does not say how fast it drives.
    // Which of two warnings is meant is not told.
    ("vendor-warning", "errors/listed-while-it-lasts[warning]"),
    ("warning-comes-and-goes", "errors/listed-while-it-lasts[warning]"),
    ("vendor-warning", "errors/outlives-new-order"),
    ("warning-comes-and-goes", "errors/outlives-new-order"),
    // No state shows the brief time in which the action of the last node still runs and the vehicle is at the next.
    ("answers-slowly", "blocking/hard-beside-an-earlier-node"),
    ("answers-very-slowly", "blocking/hard-beside-an-earlier-node"),
    ("drives-slowly", "blocking/hard-beside-an-earlier-node"),
    ("states-coalesced", "blocking/hard-beside-an-earlier-node"),
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
fn blemishes(result: &RunResult, tolerances: &[&str]) -> Result<BTreeSet<String>, String> {
    let unseen = |place: &str| {
        let mut known = UNSEEN.iter();
        known.any(|(name, test)| tolerances.contains(name) && place.split(' ').next() == Some(*test))
    };
    let mut warnings = BTreeSet::new();
    let mut worse = String::new();
    for (decider, verdict) in decided(result) {
        let line = format!("{} {}", decider.requirement, decider.place);
        match verdict {
            Verdict::Pass => {}
            Verdict::Inconclusive if unseen(&decider.place) => {}
            Verdict::Warning => {
                warnings.insert(line);
            }
            _ => {
                let test = result
                    .tests
                    .iter()
                    .find(|test| decider.place.split(' ').next() == Some(&test.id));
                let reason = test.and_then(|test| test.reason.as_deref()).unwrap_or_default();
                let _ = writeln!(worse, "  {} {line}: {reason}", verdict.word());
            }
        }
    }
    let unjudged = result.tests.iter().filter(|test| test.decisions.is_empty());
    for test in unjudged.filter(|test| test.verdict.is_some_and(|verdict| verdict > Verdict::Warning)) {
        let _ = writeln!(worse, "  {} {}", test.verdict.unwrap().word(), test.id);
    }
    if worse.is_empty() { Ok(warnings) } else { Err(worse) }
}

/// Runs with each of these sets of tolerances; gives the warnings. Nothing may be worse.
fn warnings(sets: &[Vec<&str>]) -> String {
    let library = Library::load(None).unwrap();
    let pack = library.rules.packs.latest();
    let requests = sets.iter().map(|set| with(&library, pack, set)).collect();
    let mut worse = String::new();
    let mut warned = String::new();
    for (set, result) in sets.iter().zip(run_all(&library, pack, requests)) {
        let name = set.join(" + ");
        match blemishes(&result, set) {
            Ok(warnings) => {
                for line in warnings {
                    let _ = writeln!(warned, "{name}: {line}");
                }
            }
            Err(lines) => {
                let _ = write!(worse, "{name}:\n{lines}");
            }
        }
    }
    assert!(
        worse.is_empty(),
        "a vehicle is accused that does nothing wrong\n{worse}"
    );
    warned
}

/// So many sets hold all tolerances.
const SETS: usize = 8;

/// All of them. Those that exclude each other stand side by side, and so never meet in one set.
const ALL: [&str; 43] = [
    "answers-slowly",
    "answers-very-slowly",
    "states-coalesced",
    "states-seldom",
    "states-often",
    "every-state-twice",
    "visualization-off",
    "visualization-often",
    "drives-slowly",
    "actions-last",
    "actions-at-once",
    "reconnects-late",
    "keep-alive-20",
    "little-fits",
    "orders-spaced",
    "first-node-listed",
    "stops-on-nodes",
    "prepares-everything",
    "resumes-in-a-moment",
    "errors-stay",
    "vendor-fields",
    "vendor-information",
    "vendor-warning",
    "warning-comes-and-goes",
    "floats-for-integers",
    "exponents",
    "angles-rounded",
    "single-precision",
    "many-digits",
    "pretty-printed",
    "text-escaped",
    "keys-reordered",
    "optional-omitted",
    "optional-added",
    "seconds-whole",
    "seconds-fine",
    "descriptions-everywhere",
    "header-id-restarts",
    "online-twice",
    "factsheet-again",
    "subscribes-with-qos-1",
    "session-kept",
    "newest-mqtt",
];

#[test]
fn whatever_liberties_it_takes_everything_is_decided_and_nothing_fails() {
    let mut sets = vec![Vec::new(); SETS];
    for (at, name) in ALL.into_iter().enumerate() {
        sets[at % SETS].push(name);
    }
    let known: BTreeSet<&str> = TOLERANCES.iter().map(|tolerance| tolerance.name).collect();
    assert_eq!(ALL.into_iter().collect::<BTreeSet<_>>(), known);
    warnings(&sets);
}

/// Liberties that were once taken for defects only together: what a slow or talkative vehicle reports of its own
/// falls into the time of an answer.
const TOGETHER: [&[&str]; 11] = [
    &["answers-slowly", "states-often", "warning-comes-and-goes"],
    &["answers-very-slowly", "every-state-twice", "warning-comes-and-goes"],
    &[
        "answers-slowly",
        "states-coalesced",
        "warning-comes-and-goes",
        "vendor-warning",
    ],
    &["answers-very-slowly", "states-often", "vendor-warning"],
    &[
        "answers-slowly",
        "states-seldom",
        "warning-comes-and-goes",
        "errors-stay",
    ],
    &[
        "drives-slowly",
        "states-often",
        "warning-comes-and-goes",
        "actions-last",
    ],
    &["answers-slowly", "drives-slowly", "states-often", "visualization-often"],
    &[
        "stops-on-nodes",
        "prepares-everything",
        "every-state-twice",
        "warning-comes-and-goes",
    ],
    // What makes it slow, whichever was taken first.
    &["actions-at-once", "states-coalesced"],
    &["actions-last", "answers-very-slowly"],
    // The first node of an order is still to come, and the last node is that of the order before.
    &["first-node-listed", "header-id-restarts"],
];

#[test]
fn liberties_that_meet_in_time_accuse_nobody() {
    let sets: Vec<Vec<&str>> = TOGETHER.iter().map(|set| set.to_vec()).collect();
    warnings(&sets);
}

/// What a vehicle reports of its own hides no wrong refusal.
#[test]
fn a_warning_that_comes_and_goes_hides_no_fault() {
    let library = Library::load(None).unwrap();
    let pack = library.rules.packs.latest();
    let faults = FAULTS
        .iter()
        .filter(|fault| fault.breaks.iter().any(|id| REFUSALS.contains(id)));
    let faults: Vec<_> = faults.collect();
    let requests = faults.iter().map(|fault| {
        let mut request = with(&library, pack, TOGETHER[0]);
        request
            .tests
            .retain(|test| test.requirements().iter().any(|id| fault.breaks.contains(&id.as_str())));
        request.faults = vec![fault.name.to_owned()];
        request.complete = false;
        request
    });
    let results = run_all(&library, pack, requests.collect());
    let missed = faults.iter().zip(&results).filter(|(fault, result)| {
        let all = decided(result);
        let broken = |(decider, verdict): &(Decider, Verdict)| {
            fault.breaks.contains(&decider.requirement.as_str()) && matches!(verdict, Verdict::Fail | Verdict::Warning)
        };
        !all.iter().any(broken)
    });
    let missed: Vec<&str> = missed.map(|(fault, _)| fault.name).collect();
    assert!(faults.len() > 10, "only {} faults are about refusals", faults.len());
    assert_eq!(missed, [""; 0], "found without the warning, and not with it");
}

/// The type, level and references of a refusal.
const REFUSALS: [&str; 8] = [
    "ORD-REJ-02",
    "ORD-REJ-06",
    "ORD-REJ-07",
    "ORD-REJ-12",
    "ORD-REJ-14",
    "ORD-11",
    "ORD-FLOW-01",
    "ORD-FLOW-04",
];

#[test]
#[ignore = "takes a minute; CI runs it"]
fn with_each_tolerance_everything_is_decided_and_nothing_fails() {
    let sets: Vec<Vec<&str>> = ALL.into_iter().map(|name| vec![name]).collect();
    insta::assert_snapshot!(warnings(&sets));
}

#[test]
fn whatever_the_seed_the_verdicts_are_the_same() {
    same_verdicts(0..6);
}

#[test]
#[ignore = "takes a minute; CI runs it"]
fn with_fifty_seeds_the_verdicts_are_the_same() {
    same_verdicts(0..50);
}

fn same_verdicts(seeds: std::ops::Range<u64>) {
    let library = Library::load(None).unwrap();
    let pack = library.rules.packs.latest();
    let together: Vec<&str> = ALL.into_iter().filter(|name| !EXCLUDED.contains(name)).collect();
    let requests = seeds
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
            let unseen = UNSEEN.iter().any(|(_, other)| *other == test.id);
            format!("{} {}", test.id, if good || unseen { "ok" } else { "bad" })
        });
        let requirements = result.requirements.iter().map(|one| {
            let decided = one.verdict.is_some();
            format!("{} {}", one.id, if decided { "decided" } else { "open" })
        });
        tests.chain(requirements).collect()
    };
    let mut first: Option<Vec<String>> = None;
    for (seed, result) in run_all(&library, pack, requests).iter().enumerate() {
        if let Err(worse) = blemishes(result, &together) {
            panic!("seed {seed}:\n{worse}");
        }
        let verdicts = verdicts(result);
        let first = first.get_or_insert_with(|| verdicts.clone());
        let only = |these: &[String], those: &[String]| -> Vec<String> {
            these.iter().filter(|line| !those.contains(line)).cloned().collect()
        };
        let (gone, new) = (only(first, &verdicts), only(&verdicts, first));
        assert!(
            gone.is_empty() && new.is_empty(),
            "seed {seed}: gone {gone:?}, new {new:?}"
        );
    }
}
