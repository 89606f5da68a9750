//! No false accusation: whatever liberty a good vehicle takes, and whatever the timing, every test that runs is
//! decided, and none fails; what cannot be decided stands in a table with the reason.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

#[path = "imperfect/share.rs"]
mod share;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use vda5050_tck::judge::Library;
use vda5050_tck::pack::{Pack, Role};
use vda5050_tck::qualify::{Decider, decided, on_all_cores};
use vda5050_tck::reference::Fault;
use vda5050_tck::reference::deviations::agv::{FAULTS, TOLERANCES};
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{VirtualRun, run_silently};
use vda5050_tck::verdict::Verdict;

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// What one vehicle has all at once: liberties of which none stands in the way of another.
const MANNERS: [&str; 31] = [
    "states-coalesced",
    "every-state-twice",
    "actions-last",
    "reconnects-late",
    "keep-alive-20",
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
    "single-precision",
    "many-digits",
    "text-escaped",
    "keys-reordered",
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

/// What cannot be seen of a vehicle with such a liberty, so that inconclusive is the right word: liberty and test.
fn unseen() -> BTreeSet<(&'static str, &'static str)> {
    let table = include_str!("imperfect/agv-undecided.tsv");
    let rows = table.lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        let [tolerance, test, reason] = columns[..] else {
            panic!("three columns are wanted: {line}");
        };
        assert!(reason.len() > 15, "no reason: {line}");
        assert!(all().any(|name| name == tolerance), "there is no liberty {tolerance}");
        (tolerance, test)
    })
    .collect()
}

/// The versions that vehicles are accused by of everything a fault can be found by: in them nobody may be accused.
fn versions(library: &Library) -> Vec<Arc<Pack>> {
    let packs = library.rules.packs.of_role(Role::Agv);
    packs.filter(|pack| pack.finds_every_fault()).cloned().collect()
}

/// Runs everything on all cores; the results come in the order of the requests.
fn run_all(library: &Library, pack: &Pack, requests: &[VirtualRun]) -> Vec<RunResult> {
    on_all_cores(requests, |request| {
        run_silently(library, pack, request.clone()).unwrap().result
    })
}

fn with(library: &Library, pack: &Pack, tolerances: &[&str]) -> VirtualRun {
    let mut request = VirtualRun::of(library, pack);
    let exceptions = library.rules.suites.exceptions.of(Role::Agv, pack.version);
    for name in tolerances.iter().filter(|name| !exceptions.is_forbidden(name)) {
        request.device.tolerate(name).unwrap();
    }
    request
}

/// How much of a vehicle has to be decided.
#[derive(Clone, Copy)]
enum Wanted {
    /// All but what cannot be seen of it.
    Everything,
    /// No more than there is: liberties that stand in each other's way hide what is to be judged.
    NoAccusation,
}

/// What is worse than a pass, one line each; `Err` when anything is worse than a warning.
fn blemishes(result: &RunResult, tolerances: &[&str], wanted: Wanted) -> Result<BTreeSet<String>, String> {
    let known = unseen();
    let in_table = |test: &str| tolerances.iter().any(|name| known.contains(&(*name, test)));
    let unseen = |place: &str| {
        let test = place.split(' ').next().unwrap_or_default();
        matches!(wanted, Wanted::NoAccusation) || in_table(test) || follows(result, test, &in_table)
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
        let verdict = test.verdict.unwrap();
        if verdict > Verdict::Inconclusive || !unseen(&test.id) {
            let _ = writeln!(worse, "  {} {}", verdict.word(), test.id);
        }
    }
    if worse.is_empty() { Ok(warnings) } else { Err(worse) }
}

/// Whether a test was set aside because of tests for which a predicate holds.
fn follows(result: &RunResult, id: &str, holds: &impl Fn(&str) -> bool) -> bool {
    let test = result.tests.iter().find(|test| test.id == id);
    let reason = test.and_then(|test| test.reason.as_deref()).unwrap_or_default();
    let aside = reason.strip_prefix("set aside: ");
    let names = aside.and_then(|reason| Some(reason.split_once(" was not reached in ")?.1));
    names.is_some_and(|names| names.split(", ").all(holds))
}

/// Runs with each of these sets of tolerances; gives the warnings in the version of the tables. Nothing may be worse there; in the
/// others nobody may be accused.
fn warnings(sets: &[Vec<&str>], wanted: Wanted) -> String {
    let library = vda5050_tck::library(None).unwrap();
    let mut worse = String::new();
    let mut warned = String::new();
    for pack in versions(&library) {
        let is_of_tables = pack.id == library.rules.packs.latest().id;
        let wanted = if is_of_tables { wanted } else { Wanted::NoAccusation };
        let requests: Vec<_> = sets.iter().map(|set| with(&library, &pack, set)).collect();
        for (set, result) in sets.iter().zip(run_all(&library, &pack, &requests)) {
            let name = format!("{} {}", pack.id, set.join(" + "));
            match blemishes(&result, set, wanted) {
                Ok(_) if !is_of_tables => {}
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
    }
    assert!(
        worse.is_empty(),
        "a vehicle is accused that does nothing wrong\n{worse}"
    );
    warned
}

/// How many sets all tolerances are spread over. Records of one topic stand side by side, so that those which exclude each other
/// seldom meet in one set.
const SETS: usize = 8;

fn all() -> impl Iterator<Item = &'static str> {
    TOLERANCES.iter().map(|tolerance| tolerance.name)
}

#[test]
fn whatever_liberties_it_takes_nothing_fails() {
    let mut sets = vec![Vec::new(); SETS];
    for (at, name) in all().enumerate() {
        sets[at % SETS].push(name);
    }
    warnings(&sets, Wanted::NoAccusation);
}

/// Liberties that were once taken for defects only together: what a slow or talkative vehicle reports of its own
/// falls into the time of an answer.
const TOGETHER: [&[&str]; 12] = [
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
    // An ONLINE with every breath is a sign of nothing.
    &["online-behind-every-state", "states-often"],
    // The first node of an order is still to come, and the last node is that of the order before.
    &["first-node-listed", "header-id-restarts"],
];

#[test]
fn liberties_that_meet_in_time_accuse_nobody() {
    let sets: Vec<Vec<&str>> = TOGETHER.iter().map(|set| set.to_vec()).collect();
    warnings(&sets, Wanted::Everything);
}

/// What a vehicle reports of its own hides no wrong refusal.
#[test]
fn a_warning_that_comes_and_goes_hides_no_fault() {
    let library = vda5050_tck::library(None).unwrap();
    let pack = library.rules.packs.latest();
    let faults = FAULTS
        .iter()
        .filter(|fault| fault.breaks.iter().any(|id| REFUSALS.contains(id)));
    let faults: Vec<_> = faults.collect();
    let missed = |faults: &[&'static Fault], tolerances: &[&str]| -> Vec<&'static Fault> {
        let requests = faults.iter().map(|fault| {
            let mut request = with(&library, pack, tolerances);
            request
                .tests
                .retain(|test| test.requirements().iter().any(|id| fault.breaks.contains(&id.as_str())));
            request.faults = vec![fault.name.to_owned()];
            request
        });
        let results = run_all(&library, pack, &requests.collect::<Vec<_>>());
        let missed = faults.iter().zip(&results).filter(|(fault, result)| {
            let all = decided(result);
            let broken = |(decider, verdict): &(Decider, Verdict)| {
                fault.breaks.contains(&decider.requirement.as_str())
                    && matches!(verdict, Verdict::Fail | Verdict::Warning)
            };
            !all.iter().any(broken)
        });
        missed.map(|(fault, _)| *fault).collect()
    };
    let with_it = missed(&faults, TOGETHER[0]);
    // What only a case shows that was not drawn is missed without the warning as well.
    let without: Vec<&str> = missed(&with_it, &[]).iter().map(|fault| fault.name).collect();
    let missed = with_it
        .iter()
        .map(|fault| fault.name)
        .filter(|name| !without.contains(name));
    let missed: Vec<&str> = missed.collect();
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
#[ignore = "takes minutes; CI runs a share of it each day"]
fn with_each_tolerance_everything_is_decided_and_nothing_fails() {
    let sets: Vec<Vec<&str>> = share::of(all()).map(|name| vec![name]).collect();
    let warned = warnings(&sets, Wanted::Everything);
    let tolerance = |line: &str| -> Option<String> { Some(line.split_once(' ')?.1.split(':').next()?.to_owned()) };
    let is_tried = |line: &&str| {
        sets.iter()
            .any(|set| tolerance(line).as_deref() == set.first().copied())
    };
    let known: Vec<&str> = include_str!("imperfect/agv-warned.txt")
        .lines()
        .filter(is_tried)
        .collect();
    assert_eq!(warned.lines().collect::<Vec<_>>(), known);
}

#[test]
fn whatever_the_seed_the_verdicts_are_the_same() {
    same_verdicts(0..6);
}

/// Twenty of them meet each jitter with each coalescing once.
#[test]
#[ignore = "takes a minute; CI runs it"]
fn with_twenty_seeds_the_verdicts_are_the_same() {
    same_verdicts(0..20);
}

fn same_verdicts(seeds: std::ops::Range<u64>) {
    let library = vda5050_tck::library(None).unwrap();
    for pack in versions(&library) {
        same_verdicts_in(&library, &pack, seeds.clone());
    }
}

fn same_verdicts_in(library: &Library, pack: &Pack, seeds: std::ops::Range<u64>) {
    let requests: Vec<_> = seeds
        .map(|seed| {
            // One of two runs is of a vehicle with its own manners, under the weather of a busy network.
            let mut request = with(library, pack, if seed % 2 == 0 { &[] } else { &MANNERS });
            request.seed = seed;
            request.jitter = Duration::from_millis(5 * (seed % 5));
            request.coalesce = Duration::from_millis(10 * (seed % 4));
            request
        })
        .collect();
    let known = unseen();
    let verdicts = |result: &RunResult| -> Vec<String> {
        let tests = result.tests.iter().map(|test| {
            let good = test.verdict.is_none_or(|verdict| verdict <= Verdict::Warning);
            let unseen = known.iter().any(|(_, other)| *other == test.id);
            format!("{} {}", test.id, if good || unseen { "ok" } else { "bad" })
        });
        let requirements = result.requirements.iter().map(|one| {
            let decided = one.verdict.is_some();
            format!("{} {}", one.id, if decided { "decided" } else { "open" })
        });
        tests.chain(requirements).collect()
    };
    let mut first: Option<Vec<String>> = None;
    for (seed, result) in run_all(library, pack, &requests).iter().enumerate() {
        if let Err(worse) = blemishes(result, &MANNERS, Wanted::Everything) {
            panic!("VDA 5050 {}, seed {seed}:\n{worse}", pack.version);
        }
        let verdicts = verdicts(result);
        let first = first.get_or_insert_with(|| verdicts.clone());
        let only = |these: &[String], those: &[String]| -> Vec<String> {
            these.iter().filter(|line| !those.contains(line)).cloned().collect()
        };
        let (gone, new) = (only(first, &verdicts), only(&verdicts, first));
        assert!(
            gone.is_empty() && new.is_empty(),
            "VDA 5050 {}, seed {seed}: gone {gone:?}, new {new:?}",
            pack.version
        );
    }
}
