//! No false accusation of a master control: whatever liberty a good one takes, and whatever the timing, none fails.
//!
//! Unlike a vehicle, a master control chooses what it sends: one that releases the whole way at once gives nothing to
//! judge where an update is needed, so that inconclusive is the right word there. Each of these stands in a table with
//! the reason.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

#[path = "imperfect/share.rs"]
mod share;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use vda5050_tck::judge::Library;
use vda5050_tck::pack::{Pack, Role};
use vda5050_tck::qualify::{decided, on_all_cores};
use vda5050_tck::reference::deviations::master_control::TOLERANCES;
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{VirtualRun, run_silently};
use vda5050_tck::verdict::Verdict;

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Runs everything on all cores; the results come in the order of the requests.
fn run_all(library: &Library, pack: &Pack, requests: &[VirtualRun]) -> Vec<RunResult> {
    on_all_cores(requests, |request| {
        run_silently(library, pack, request.clone()).unwrap().result
    })
}

fn with(library: &Library, pack: &Pack, tolerances: &[&str]) -> VirtualRun {
    let mut request = VirtualRun::of_role(Role::MasterControl, library, pack);
    let exceptions = library.rules.suites.exceptions.of(Role::MasterControl, pack.version);
    for name in tolerances.iter().filter(|name| !exceptions.is_forbidden(name)) {
        request.device.tolerate(name).unwrap();
    }
    request
}

/// What is worse than a pass, by requirement and place; `Err` names what is worse than inconclusive.
fn blemishes(result: &RunResult) -> Result<Vec<String>, String> {
    let mut mild = Vec::new();
    let mut worse = String::new();
    for (decider, verdict) in decided(result) {
        let line = format!("{} {} {}", verdict.word(), decider.requirement, decider.place);
        match verdict {
            Verdict::Pass => {}
            Verdict::Warning | Verdict::Inconclusive => mild.push(line),
            Verdict::Error | Verdict::Fail => {
                let _ = writeln!(worse, "  {line}");
            }
        }
    }
    mild.sort();
    mild.dedup();
    if worse.is_empty() { Ok(mild) } else { Err(worse) }
}

/// The versions that master controls are accused by of everything a fault can be found by: in them nobody may be accused.
fn versions(library: &Library) -> Vec<Arc<Pack>> {
    let packs = library.rules.packs.of_role(Role::MasterControl);
    packs.filter(|pack| pack.finds_every_fault()).cloned().collect()
}

/// Runs with each of these sets of tolerances. Nothing may fail; gives what was not a pass in the version of the table.
fn accused(sets: &[Vec<&str>]) -> String {
    let library = vda5050_tck::library(None).unwrap();
    let mut worse = String::new();
    let mut mild = String::new();
    for pack in versions(&library) {
        let requests: Vec<VirtualRun> = sets.iter().map(|set| with(&library, &pack, set)).collect();
        for (set, result) in sets.iter().zip(run_all(&library, &pack, &requests)) {
            let name = set.join(" + ");
            match blemishes(&result) {
                Ok(lines) if pack.id == library.rules.packs.latest().id => {
                    for line in lines {
                        let _ = writeln!(mild, "{name}: {line}");
                    }
                }
                Ok(_) => {}
                Err(lines) => {
                    let _ = write!(worse, "{} {name}:\n{lines}", pack.id);
                }
            }
        }
    }
    assert!(
        worse.is_empty(),
        "a master control is accused that does nothing wrong\n{worse}"
    );
    mild
}

#[test]
fn whatever_liberties_it_takes_nothing_fails() {
    const SETS: usize = 4;
    let mut sets = vec![Vec::new(); SETS];
    for (at, tolerance) in TOLERANCES.iter().enumerate() {
        sets[at % SETS].push(tolerance.name);
    }
    accused(&sets);
}

#[test]
#[ignore = "takes minutes; CI runs a share of it each day"]
fn with_each_tolerance_nothing_fails() {
    let names = TOLERANCES.iter().map(|tolerance| tolerance.name);
    let sets: Vec<Vec<&str>> = share::of(names).map(|name| vec![name]).collect();
    let excused = undecided();
    let found = accused(&sets);
    let found: Vec<&str> = found.lines().collect();
    let new: Vec<_> = found.iter().filter(|line| !excused.contains_key(**line)).collect();
    assert!(
        new.is_empty(),
        "these are no pass, and have no reason in the table:\n{new:#?}"
    );
    let is_tried = |key: &&String| sets.iter().any(|set| key.split(':').next() == set.first().copied());
    let old: Vec<_> = excused
        .keys()
        .filter(is_tried)
        .filter(|key| !found.contains(&key.as_str()))
        .collect();
    assert!(
        old.is_empty(),
        "these are decided by now; take them out of the table:\n{old:#?}"
    );
}

/// Where nothing must be sent, to decline what a hook asks for is the best answer there is, and decides; what is awaited elsewhere
/// is asked for again when the vehicle is there.
#[test]
fn nothing_is_undecided_by_hooks_that_refuse_truthfully() {
    let library = vda5050_tck::library(None).unwrap();
    let pack = library.rules.packs.latest();
    let mut request = with(&library, pack, &["declines-what-it-may-not-send"]);
    let declines = |id: &str| DECLINING.iter().any(|group| id.starts_with(group));
    request.tests.retain(|test| declines(&test.id));
    let results = run_all(&library, pack, &[request]);
    let declined =
        |step: &vda5050_tck::result::StepResult| step.verb.starts_with("operator") && step.outcome == "failed";
    let steps = results[0].tests.iter().flat_map(|test| &test.steps);
    assert!(steps.filter(|step| declined(step)).count() > 10, "little was declined");
    match blemishes(&results[0]) {
        Ok(mild) => assert!(mild.is_empty(), "{mild:#?}"),
        Err(worse) => panic!("{worse}"),
    }
}

/// Groups of tests in which a master control is asked for what it must not do.
const DECLINING: [&str; 6] = [
    "connection/",
    "modes/",
    "traffic/",
    "reported/",
    "capabilities/",
    "cancel/",
];

/// What is not a pass with a tolerance, as [`accused`] words it, and why it cannot be.
fn undecided() -> BTreeMap<String, String> {
    let table = include_str!("imperfect/master-control-undecided.tsv");
    let rows = table.lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let columns: Vec<&str> = line.split('\t').collect();
        let [tolerance, verdict, requirement, place, reason] = columns[..] else {
            panic!("five columns are wanted: {line}");
        };
        assert!(reason.len() > 15, "no reason: {line}");
        (
            format!("{tolerance}: {verdict} {requirement} {place}"),
            reason.to_owned(),
        )
    })
    .collect()
}

#[test]
fn whatever_the_seed_the_verdicts_are_the_same() {
    same_verdicts(0..4);
}

/// Twenty of them meet each jitter with each coalescing once.
#[test]
#[ignore = "takes a minute; CI runs it"]
fn with_twenty_seeds_the_verdicts_are_the_same() {
    same_verdicts(0..20);
}

fn same_verdicts(seeds: std::ops::Range<u64>) {
    let library = vda5050_tck::library(None).unwrap();
    let pack = library.rules.packs.latest();
    let requests: Vec<VirtualRun> = seeds
        .map(|seed| {
            let mut request = with(&library, pack, &[]);
            request.seed = seed;
            request.jitter = Duration::from_millis(2 * (seed % 5));
            request.coalesce = Duration::from_millis(5 * (seed % 4));
            request
        })
        .collect();
    let verdicts = |result: &RunResult| -> Vec<String> {
        let tests = result
            .tests
            .iter()
            .map(|test| format!("{} {:?}", test.id, test.verdict));
        let requirements = result
            .requirements
            .iter()
            .map(|one| format!("{} {:?}", one.id, one.verdict));
        tests.chain(requirements).collect()
    };
    let mut first: Option<Vec<String>> = None;
    for (seed, result) in run_all(&library, pack, &requests).iter().enumerate() {
        match blemishes(result) {
            Ok(mild) => assert!(mild.is_empty(), "seed {seed}: {mild:#?}"),
            Err(worse) => panic!("seed {seed}:\n{worse}"),
        }
        let verdicts = verdicts(result);
        let first = first.get_or_insert_with(|| verdicts.clone());
        assert_eq!(*first, verdicts, "seed {seed}");
    }
}
