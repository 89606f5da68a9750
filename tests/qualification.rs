//! Proof of every check, in virtual time: the faultless reference AGV passes everything without a warning, and
//! every clause and monitor is failed by a named fault. The kill matrix is a snapshot.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use vda5050_tck::reference::agv::{FAULTS, lapse};
use vda5050_tck::run::{Decider, Kill, Library, Qualification, qualify};
use vda5050_tck::verdict::Verdict;

/// Clauses and monitors no fault can fail yet: place, requirement, and why not.
const UNPROVEN: &str = include_str!("qualification/unproven.tsv");

/// Faults that no test or monitor finds yet, and why not: what they break is decided by tests to come.
const UNFOUND: &str = include_str!("qualification/unfound.tsv");

fn library() -> Library {
    Library::load(None).unwrap_or_else(|all| panic!("{}", all.iter().map(ToString::to_string).collect::<String>()))
}

fn blemishes(outcome: &Qualification) -> String {
    let line = |(decider, verdict): &(Decider, Verdict)| format!("{verdict} {} {}", decider.requirement, decider.place);
    outcome.blemishes.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Lines of a table: the first column is the key, the last one a reason, which has to be there.
fn table(text: &str) -> Vec<(String, String)> {
    let rows = text
        .lines()
        .filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    rows.map(|line| {
        let (key, reason) = line.rsplit_once('\t').unwrap_or_else(|| panic!("no reason: {line}"));
        assert!(reason.len() > 15, "no reason: {line}");
        (key.replace('\t', " "), reason.to_owned())
    })
    .collect()
}

#[test]
fn every_check_passes_without_a_fault_and_is_failed_by_one() {
    let library = library();
    let pack = library.rules.packs.latest().clone();
    let outcome = qualify(&library, &pack, FAULTS).expect("qualified");
    assert_eq!(blemishes(&outcome), "", "not a pass on the faultless reference AGV");

    assert_eq!(
        accused_first(&outcome),
        "",
        "what the report names first is not what the fault breaks"
    );

    let excused = table(UNPROVEN);
    let unproven: Vec<String> = outcome
        .unproven()
        .iter()
        .map(|decider| format!("{} {}", decider.requirement, decider.place))
        .collect();
    let new: Vec<_> = unproven
        .iter()
        .filter(|one| !excused.iter().any(|(key, _)| key == *one))
        .collect();
    assert!(new.is_empty(), "no fault can fail these:\n{new:#?}");
    let old: Vec<_> = excused.iter().filter(|(key, _)| !unproven.contains(key)).collect();
    assert!(
        old.is_empty(),
        "these are proven by now; take them out of unproven.tsv:\n{old:#?}"
    );

    let excused = table(UNFOUND);
    let unfound: Vec<String> = outcome.missed().iter().map(|kill| kill.fault.name.to_owned()).collect();
    let new: Vec<_> = unfound
        .iter()
        .filter(|one| !excused.iter().any(|(key, _)| key == *one))
        .collect();
    assert!(
        new.is_empty(),
        "no requirement they name fails with these faults:\n{new:#?}"
    );
    let old: Vec<_> = excused.iter().filter(|(key, _)| !unfound.contains(key)).collect();
    assert!(
        old.is_empty(),
        "these are found by now; take them out of unfound.tsv:\n{old:#?}"
    );

    hold_to_failing(&outcome);
    assert_eq!(
        accused_first(&outcome),
        "",
        "what the report names first is not what the fault breaks"
    );
    insta::assert_snapshot!("kill_matrix", outcome.matrix());
}

/// Faults with which something else is reported first than what they break.
fn accused_first(outcome: &Qualification) -> String {
    let wrong = outcome.kills.iter().filter(|kill| !kill.named_first());
    let line = |kill: &Kill| {
        let first = kill.first.as_ref();
        let first = first.map_or_else(String::new, |(decider, _)| {
            format!("{} {}", decider.requirement, decider.place)
        });
        format!("{} breaks {}: {first}\n", kill.fault.name, kill.fault.breaks.join(", "))
    };
    wrong.map(line).collect()
}

/// A fault ends in a fail, and a lapse in no more than a warning, or undecided.
fn hold_to_failing(outcome: &Qualification) {
    let named = |fails: bool| {
        let kills = outcome.kills.iter();
        let wrong = kills.filter(move |kill| {
            (kill.verdict == Some(Verdict::Fail)) == fails && lapse(kill.fault.name).is_some() == fails
        });
        wrong.map(|kill| kill.fault.name).collect::<Vec<_>>()
    };
    assert_eq!(
        named(false),
        [""; 0],
        "these faults fail nothing, and are not among the lapses"
    );
    assert_eq!(named(true), [""; 0], "these lapses fail something: they are faults");
}

#[test]
fn the_older_version_passes_without_a_fault_too() {
    let library = library();
    for pack in library.rules.packs.all() {
        let outcome = qualify(&library, pack, &[]).expect("qualified");
        assert_eq!(blemishes(&outcome), "", "VDA 5050 {}", pack.version);
        assert!(
            outcome.deciders.len() > 100,
            "VDA 5050 {}: only {} deciders",
            pack.version,
            outcome.deciders.len()
        );
    }
}
