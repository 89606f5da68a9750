//! A vehicle with one lasting mistake is judged all the same: every test that is not about the mistake is decided as
//! without it.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::{BTreeMap, BTreeSet};

use vda5050_tck::journal::event::Event;
use vda5050_tck::judge::Library;
use vda5050_tck::pack::Pack;
use vda5050_tck::qualify::on_all_cores;
use vda5050_tck::reference::deviations::agv::FAULTS;
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{VirtualRun, run_silently};
use vda5050_tck::verdict::Verdict;

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Mistakes that show in every state from some moment on, or that a test leaves behind in the vehicle.
const LASTING: [&str; 20] = [
    "cancel-leaves-nodes",
    "cancel-leaves-waiting",
    "cancel-never-finished",
    "driving-as-text",
    "driving-at-decision-point",
    "driving-kept",
    "edge-states-stay",
    "emergency-stop-null",
    "emergency-stop-spelled",
    "empty-lists-null",
    "finished-order-listed",
    "init-position-unchecked",
    "last-edge-listed",
    "last-route-listed",
    "mode-lower-case",
    "mode-missing",
    "mode-numeric",
    "safety-state-missing",
    "state-request-stuck",
    "traversed-nodes-listed",
];

/// Tests that depend on what is wrong, with the reason: fault, test (a `*` at its end stands for anything), reason.
const DEPENDENT: &str = include_str!("imperfect/dependent.tsv");

fn run_all(library: &Library, pack: &Pack, requests: &[VirtualRun]) -> Vec<RunResult> {
    on_all_cores(requests, |request| {
        run_silently(library, pack, request.clone()).unwrap().result
    })
}

fn verdicts(result: &RunResult) -> BTreeMap<&str, Option<Verdict>> {
    let tests = result.tests.iter();
    tests.map(|test| (test.id.as_str(), test.verdict)).collect()
}

/// Whether everything a test found is what the fault is about.
fn is_about(result: &RunResult, test: &str, breaks: &[&str]) -> bool {
    let found = result.tests.iter().find(|result| result.id == test);
    found.is_some_and(|found| {
        let mut bad = found
            .decisions
            .iter()
            .filter(|decision| decision.verdict() > Verdict::Inconclusive);
        let first = bad.next();
        first.is_some()
            && first
                .into_iter()
                .chain(bad)
                .all(|one| breaks.contains(&one.requirement.as_str()))
    })
}

#[test]
fn every_test_that_is_not_about_a_lasting_mistake_is_decided_as_without_it() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{all:?}"));
    let pack = library.rules.packs.get("2.1.0").unwrap();
    let mut requests = vec![VirtualRun::of(&library, pack)];
    requests.extend(LASTING.iter().map(|fault| VirtualRun {
        faults: vec![(*fault).to_owned()],
        ..VirtualRun::of(&library, pack)
    }));
    let results = run_all(&library, pack, &requests);
    let without = verdicts(&results[0]);
    let rows: Vec<Vec<&str>> = DEPENDENT
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
        .map(|line| line.split('\t').collect())
        .collect();
    let mut needed = BTreeSet::new();
    let mut wrong = String::new();
    for (fault, result) in LASTING.iter().zip(&results[1..]) {
        let breaks = FAULTS.iter().find(|one| one.name == *fault).unwrap().breaks;
        for (test, verdict) in verdicts(result) {
            if without.get(test) == Some(&verdict) || is_about(result, test, breaks) {
                continue;
            }
            let depends = |row: &Vec<&str>| {
                row[0] == *fault
                    && row[1]
                        .strip_suffix('*')
                        .map_or(row[1] == test, |start| test.starts_with(start))
            };
            match rows.iter().position(depends) {
                Some(row) => _ = needed.insert(row),
                None => wrong.push_str(&format!("{fault}\t{test}\t{verdict:?}\n")),
            }
        }
    }
    let stale = (0..rows.len()).filter(|row| !needed.contains(row));
    wrong.extend(stale.map(|row| format!("not needed: {}\n", rows[row].join("\t"))));
    assert!(wrong.is_empty(), "decided otherwise:\n{wrong}");
}

/// A test that is tried once more says nothing that was said before: a vehicle that takes the same order for one it has is right.
#[test]
fn a_test_that_is_tried_once_more_has_ids_of_its_own() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{all:?}"));
    let pack = library.rules.packs.get("2.1.0").unwrap();
    let mut request = VirtualRun {
        faults: vec!["finished-order-listed".to_owned()],
        ..VirtualRun::of(&library, pack)
    };
    request.tests.retain(|test| test.id.starts_with("order-acceptance/"));
    let finished = run_silently(&library, pack, request).unwrap();
    let mut sent: BTreeMap<String, usize> = BTreeMap::new();
    let (mut begun, mut again) = (Vec::new(), 0);
    for entry in finished.recorder.journal().entries() {
        match entry.event() {
            Event::TestBegun { test, .. } => {
                again += usize::from(begun.contains(test));
                begun.push(test.clone());
            }
            Event::Sent { topic, payload, .. } if topic.ends_with("/order") => {
                let order: serde_json::Value = serde_json::from_slice(payload.bytes()).unwrap_or_default();
                if let Some(order) = order["orderId"].as_str().map(str::to_owned) {
                    let first = *sent.entry(order.clone()).or_insert(begun.len());
                    assert_eq!(first, begun.len(), "{order} is sent in {:?} and before", begun.last());
                }
            }
            _ => {}
        }
    }
    assert!(again > 0, "no test was tried once more");
}

/// A vehicle that a message strikes dumb is started again before the next test, and no later test is blamed for it.
#[test]
fn a_vehicle_that_falls_silent_is_blamed_where_it_did() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{all:?}"));
    let pack = library.rules.packs.get("2.1.0").unwrap();
    let mut request = VirtualRun {
        faults: vec!["dumb-after-malformed".to_owned()],
        ..VirtualRun::of(&library, pack)
    };
    let strikes =
        |id: &str| id.starts_with("order-rejection/schema-at-rest") || id.starts_with("order-rejection/unreadable");
    request
        .tests
        .retain(|test| strikes(&test.id) || test.id.starts_with("order-update/"));
    let finished = run_silently(&library, pack, request).unwrap();
    let (mut struck, mut behind) = (false, 0);
    for test in finished.result.tests.iter().filter(|test| test.verdict.is_some()) {
        if strikes(&test.id) {
            struck = true;
            continue;
        }
        assert_eq!(test.verdict, Some(Verdict::Pass), "{}: {:?}", test.id, test.reason);
        behind += usize::from(struck);
    }
    assert!(behind > 5, "only {behind} tests came behind it");
    let limits = &finished.result.limits;
    assert!(
        limits.iter().any(|limit| limit.contains("has said nothing since")),
        "{limits:?}"
    );
}

#[test]
fn what_was_read_over_stands_at_the_test() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{all:?}"));
    let pack = library.rules.packs.get("2.1.0").unwrap();
    let request = VirtualRun {
        faults: vec!["finished-order-listed".to_owned()],
        ..VirtualRun::of(&library, pack)
    };
    let finished = run_silently(&library, pack, request).unwrap();
    let told = finished
        .result
        .tests
        .iter()
        .filter(|test| !test.allowances.is_empty())
        .count();
    assert!(told > 50, "{told}");
    let entries = finished.recorder.journal().entries();
    let again = vda5050_tck::judge::judge(&library.rules, entries).unwrap();
    assert_eq!(again, finished.result, "judged again, it comes to the same");
}
