//! Our own reference devices: without a fault everything passes, and the faults of this share are found.
//!
//! The whole proof, every fault and every clause in every version, is `vda5050-tck qualify`, which CI runs. Here a share
//! of the faults is tried: those that the change is about, and one part of eight. CI leaves the newest version of each side that finds every fault out
//! here (`QUALIFY_VERSIONS=older`), since it tries all of that one, and takes another part each day.

use vda5050_tck::judge::Library;
use vda5050_tck::pack::{Pack, Role};
use vda5050_tck::qualify::{Depth, Qualification, decided, qualify};
use vda5050_tck::reference::Fault;
use vda5050_tck::run::{VirtualRun, run_silently};
use vda5050_tck::simulate::BuiltIn;
use vda5050_tck::verdict::Verdict;

use super::share;

fn library() -> Library {
    vda5050_tck::library(None)
        .unwrap_or_else(|all| panic!("{}", all.iter().map(ToString::to_string).collect::<String>()))
}

fn tried(library: &Library, pack: &Pack, role: Role, faults: &[Fault]) -> Qualification {
    let tests = library.tests(role, &pack.id);
    qualify(library, pack, &tests, faults, Depth::Faults).expect("qualified")
}

#[test]
fn an_agv_passes_without_a_fault_and_the_faults_of_this_share_are_found() {
    prove(Role::Agv);
}

#[test]
fn a_master_control_passes_without_a_fault_and_the_faults_of_this_share_are_found() {
    prove(Role::MasterControl);
}

/// Every version is proven by itself: what holds in the newest one says nothing about the others.
fn prove(role: Role) {
    super::stand_back();
    let library = library();
    let faults = share::faults(&library, role);
    assert!(!faults.is_empty(), "no fault is drawn");
    let packs = &library.rules.packs;
    let proven = packs.of_role(role).filter(|pack| pack.finds_every_fault());
    let newest = proven.last().map(|newest| &newest.id);
    let older_only = std::env::var("QUALIFY_VERSIONS").is_ok_and(|said| said == "older");
    for pack in packs
        .of_role(role)
        .filter(|pack| !older_only || Some(&pack.id) != newest)
    {
        let outcome = tried(&library, pack, role, &faults);
        println!("{role}, VDA 5050 {}: {}", pack.version, outcome.summary());
        assert!(outcome.deciders.len() > 100, "only {} deciders", outcome.deciders.len());
        let complaints = outcome.complaints(false);
        assert!(
            complaints.is_empty(),
            "{role}, VDA 5050 {}:\n{}",
            pack.version,
            complaints.join("\n")
        );
    }
}

/// Who finds everything wrong proves nothing: a fault that is not there is missed, and said so.
#[test]
fn a_fault_that_does_nothing_is_missed() {
    let library = library();
    let pack = library.rules.packs.latest();
    let mut tests = library.tests(Role::Agv, &pack.id);
    tests.retain(|test| test.id == "order-rejection/lower-update-id");
    let named = |name: &str| -> Vec<Fault> {
        let mut all = BuiltIn::faults(Role::Agv).iter();
        vec![*all.find(|fault| fault.name == name).expect("a fault")]
    };
    let found = qualify(
        &library,
        pack,
        &tests,
        &named("outdated-update-taken-over"),
        Depth::Faults,
    )
    .expect("qualified");
    assert_eq!(found.complaints(false), [""; 0]);
    let missed = qualify(&library, pack, &tests, &named("download-finished-early"), Depth::Faults).expect("qualified");
    let complaints = missed.complaints(true).join("\n");
    let missing = "fault download-finished-early (";
    assert!(
        complaints
            .lines()
            .any(|line| line.starts_with(missing) && line.contains("is not found")),
        "{complaints}"
    );
    let clause = "order-rejection/lower-update-id";
    assert!(
        complaints
            .lines()
            .any(|line| line.starts_with("no fault fails ORD-REJ") && line.contains(clause)),
        "{complaints}"
    );
    assert_eq!(found.kills[0].named(), Some(Verdict::Fail));
}

/// The exceptions of the suites speak of faults that there are.
#[test]
fn what_nothing_finds_is_a_fault() {
    let library = library();
    for one in &library.rules.suites.exceptions.unfound {
        let mut all = BuiltIn::faults(one.role).iter();
        assert!(
            all.any(|fault| fault.name == one.fault),
            "there is no fault {}",
            one.fault
        );
    }
}

/// Older versions call the array of instant actions otherwise. A master control that still does so must not pass where
/// something must not come.
#[test]
fn what_must_not_come_is_found_under_the_older_name_of_the_array() {
    let library = library();
    let pack = library.rules.packs.latest();
    for (fault, test, requirement) in [
        ("pick-at-once", "actions/order-only", "ACT-08"),
        ("scope-ignored", "instant-actions/not-offered", "FACT-15"),
        (
            "position-during-order",
            "instant-actions/position-under-way[standing]",
            "IACT-02",
        ),
        ("actions-in-service", "modes/no-actions[service.own]", "MODE-04"),
        ("information-obeyed", "reported/information-dispatch", "INFO-02"),
    ] {
        let mut request = VirtualRun::of_role(Role::MasterControl, &library, pack);
        request.tests.retain(|one| one.id == test);
        request.draw = None;
        request.faults = vec!["actions-renamed".to_owned(), fault.to_owned()];
        let result = run_silently(&library, pack, request).expect("a run").result;
        let found = decided(&result).into_iter().any(|(decider, verdict)| {
            matches!(verdict, Verdict::Fail | Verdict::Warning)
                && decider.requirement == requirement
                && decider.place.starts_with(test)
        });
        assert!(found, "{fault} is not found by {test}");
    }
}

/// A vehicle whose states forget the order is failed for that. Whether it drove as it should could not be observed.
#[test]
fn what_a_broken_report_hides_is_not_held_against_the_vehicle() {
    let library = library();
    let pack = library.rules.packs.latest();
    let mut request = VirtualRun::of_role(Role::Agv, &library, pack);
    request
        .tests
        .retain(|one| one.id == "order-acceptance/execution-begins");
    request.faults = vec!["order-id-reset-when-done".to_owned()];
    let result = run_silently(&library, pack, request).expect("a run").result;
    let verdicts = |requirement: &str| -> Vec<Verdict> {
        let all = decided(&result).into_iter();
        let own = all.filter(|(decider, _)| decider.requirement == requirement);
        own.map(|(_, verdict)| verdict).collect()
    };
    assert!(verdicts("STATE-MSG-02").contains(&Verdict::Fail));
    assert!(verdicts("ORD-06").contains(&Verdict::Inconclusive));
    assert!(!verdicts("ORD-06").contains(&Verdict::Fail));
    let reason = result.tests[0].reason.clone().unwrap_or_default();
    assert!(
        reason.contains("`orderId`") && reason.contains("state/order-kept"),
        "{reason}"
    );
    assert_eq!(result.verdict, Some(Verdict::Fail));
}
