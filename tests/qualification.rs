//! Proof of every check, in virtual time: the faultless reference AGV passes everything without a warning, and
//! every clause and monitor is failed by a named fault. The kill matrix is a snapshot.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use vda5050_tck::pack::Pack;
use vda5050_tck::reference::agv::{FAULTS, lapse};
use vda5050_tck::run::{Decider, Library, Qualification, qualify};
use vda5050_tck::verdict::Verdict;

/// Clauses and monitors no fault can fail yet: place, requirement, and why not.
const UNPROVEN: &str = include_str!("qualification/unproven.tsv");

/// Faults that no test or monitor finds yet, and why not: what they break is decided by tests to come.
const UNFOUND: &str = include_str!("qualification/unfound.tsv");

/// Faults with which another requirement is reported first, and why it is broken, too.
const FIRST: &str = include_str!("qualification/first.tsv");

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

    let outcome = retried(&library, &pack, outcome);
    hold_to_failing(&outcome);
    hold_to_what_is_first(&outcome);
    insta::assert_snapshot!("kill_matrix", outcome.matrix());
}

/// What the report names first is what the fault breaks, or stands in the table with the reason.
fn hold_to_what_is_first(outcome: &Qualification) {
    let excused = table(FIRST);
    let wrong = outcome.kills.iter().filter(|kill| !kill.named_first());
    let wrong = wrong.filter_map(|kill| {
        let (decider, _) = kill.first.as_ref()?;
        Some((
            format!("{} {}", kill.fault.name, decider.requirement),
            decider.place.clone(),
        ))
    });
    let wrong: Vec<(String, String)> = wrong.collect();
    let new: Vec<_> = wrong
        .iter()
        .filter(|(key, _)| !excused.iter().any(|(known, _)| known == key))
        .collect();
    assert!(
        new.is_empty(),
        "something else is reported first than what these break:\n{new:#?}"
    );
    let old: Vec<_> = excused
        .iter()
        .filter(|(known, _)| !wrong.iter().any(|(key, _)| key == known))
        .collect();
    assert!(old.is_empty(), "take these out of first.tsv:\n{old:#?}");
}

/// A fault that only brought a warning where it was tried is tried on everything.
fn retried(library: &Library, pack: &Pack, mut outcome: Qualification) -> Qualification {
    for kill in &mut outcome.kills {
        if kill.verdict != Some(Verdict::Fail) && lapse(kill.fault.name).is_none() {
            let alone = qualify(library, pack, &[kill.fault]).expect("qualified");
            kill.verdict = alone.kills[0].verdict;
        }
    }
    outcome
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
