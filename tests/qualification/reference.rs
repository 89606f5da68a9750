//! Proof of every check, in virtual time: the faultless reference device of each side passes everything without a
//! warning, and every clause and monitor is failed by a named fault. The kill matrices are snapshots.
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use vda5050_tck::pack::{Pack, Role};
use vda5050_tck::run::{Decider, Library, Qualification, VirtualRun, decided, qualify, run_silently};
use vda5050_tck::simulate::BuiltIn;
use vda5050_tck::verdict::Verdict;

/// What is excused on one side of the interface.
struct Side {
    role: Role,
    /// Faults that no test or monitor finds, and why not.
    unfound: &'static str,
    /// Faults for which the report names something else first than what they break, and why.
    first: &'static str,
    /// Faults of blind rounds that are found: fault, requirement, the tests that find it together.
    found: &'static str,
    /// Name of the snapshot.
    matrix: &'static str,
}

const AGV: Side = Side {
    role: Role::Agv,
    unfound: include_str!("unfound.tsv"),
    first: include_str!("first.tsv"),
    found: include_str!("found.tsv"),
    matrix: "kill_matrix",
};

const MASTER_CONTROL: Side = Side {
    role: Role::MasterControl,
    unfound: include_str!("master-control-unfound.tsv"),
    first: include_str!("master-control-first.tsv"),
    found: include_str!("master-control-found.tsv"),
    matrix: "master_control_kill_matrix",
};

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
fn every_check_of_an_agv_passes_without_a_fault_and_is_failed_by_one() {
    prove(&AGV);
}

#[test]
fn every_check_of_a_master_control_passes_without_a_fault_and_is_failed_by_one() {
    prove(&MASTER_CONTROL);
}

/// Every version is proven by itself: what holds in the newest one says nothing about the others.
fn prove(side: &Side) {
    super::stand_back();
    let library = library();
    for pack in library.rules.packs.all() {
        prove_version(side, &library, pack);
    }
}

/// The rows of a table that hold for a version: those that name none, and those that name it.
fn rows(text: &str, library: &Library, pack: &Pack) -> Vec<(String, String)> {
    let versions: Vec<&str> = library.rules.packs.all().iter().map(|pack| pack.id.as_str()).collect();
    let of_version = |(key, reason): (String, String)| match key.rsplit_once(' ') {
        Some((key, version)) if versions.contains(&version) => (version == pack.id).then(|| (key.to_owned(), reason)),
        _ => Some((key, reason)),
    };
    table(text).into_iter().filter_map(of_version).collect()
}

fn prove_version(side: &Side, library: &Library, pack: &Pack) {
    let is_latest = pack.id == library.rules.packs.latest().id;
    let faults = [BuiltIn::faults(side.role), BuiltIn::blind_faults(side.role)].concat();
    let outcome = qualify(library, pack, side.role, &faults).expect("qualified");
    assert_eq!(blemishes(&outcome), "", "not a pass on the faultless reference device");

    // All that is wrong is told at once: each look costs minutes.
    let mut wrong = String::new();
    let mut tell = |what: &str, all: &dyn std::fmt::Debug, is_empty: bool| {
        if !is_empty {
            wrong.push_str(&format!("{what}:\n{all:#?}\n"));
        }
    };
    let new = outcome.unexcused();
    tell("no fault can fail these", &new, new.is_empty());
    let old = outcome.stale_excuses();
    tell(
        "these are proven by now; take them out of suites/qualification",
        &old,
        old.is_empty(),
    );
    let unproven = outcome.unproven();
    tell("so much is unproven", &unproven.len(), unproven.len() < 10);

    let excused = rows(side.unfound, library, pack);
    let unfound: Vec<String> = outcome.missed().iter().map(|kill| kill.fault.name.to_owned()).collect();
    let is_excused = |one: &&String| excused.iter().any(|(key, _)| key == *one);
    let new: Vec<_> = unfound.iter().filter(|one| !is_excused(one)).collect();
    tell("no requirement they name fails with these faults", &new, new.is_empty());
    let old: Vec<_> = excused.iter().filter(|(key, _)| !unfound.contains(key)).collect();
    tell(
        "these are found by now; take them out of unfound.tsv",
        &old,
        old.is_empty(),
    );

    let mut outcome = retried(library, pack, side.role, outcome);
    let matrix = outcome.matrix();
    let proven = BuiltIn::faults(side.role);
    outcome
        .kills
        .retain(|kill| proven.iter().any(|fault| fault.name == kill.fault.name));
    // In an older version some of it is a recommendation only, and other requirements come first.
    if is_latest {
        let named = lapses_and_faults(side.role, &outcome, &excused);
        tell(
            "these faults fail nothing, and are not among the lapses",
            &named.0,
            named.0.is_empty(),
        );
        tell(
            "these lapses fail something: they are faults",
            &named.1,
            named.1.is_empty(),
        );
        let first = what_is_first(rows(side.first, library, pack), &outcome);
        tell(
            "something else is reported first than what these break",
            &first.0,
            first.0.is_empty(),
        );
        tell("take these out of first.tsv", &first.1, first.1.is_empty());
    }
    assert!(wrong.is_empty(), "{}, VDA 5050 {}:\n{wrong}", side.role, pack.version);
    let name = match is_latest {
        true => side.matrix.to_owned(),
        false => format!("{}_{}", side.matrix, pack.id),
    };
    insta::assert_snapshot!(name, matrix);
}

/// What the report names first is what the fault breaks, or stands in the table with the reason: what does not, and which
/// rows say nothing any more.
fn what_is_first(excused: Vec<(String, String)>, outcome: &Qualification) -> (Vec<(String, String)>, Vec<String>) {
    let wrong = outcome.kills.iter().filter(|kill| !kill.named_first());
    let wrong = wrong.filter_map(|kill| {
        let (decider, _) = kill.first.as_ref()?;
        Some((
            format!("{} {}", kill.fault.name, decider.requirement),
            decider.place.clone(),
        ))
    });
    let wrong: Vec<(String, String)> = wrong.collect();
    let keys = excused.into_iter().map(|(key, _)| key);
    let (kept, old): (Vec<String>, Vec<String>) = keys.partition(|known| wrong.iter().any(|(key, _)| key == known));
    (wrong.into_iter().filter(|(key, _)| !kept.contains(key)).collect(), old)
}

/// A fault that only brought a warning where it was tried is tried on everything.
fn retried(library: &Library, pack: &Pack, role: Role, mut outcome: Qualification) -> Qualification {
    for kill in &mut outcome.kills {
        let is_proven = BuiltIn::faults(role).iter().any(|fault| fault.name == kill.fault.name);
        if is_proven && kill.verdict != Some(Verdict::Fail) && BuiltIn::lapse(role, kill.fault.name).is_none() {
            let alone = qualify(library, pack, role, &[kill.fault]).expect("qualified");
            kill.verdict = alone.kills[0].verdict;
        }
    }
    outcome
}

/// A fault ends in a fail, and a lapse in no more than a warning, or undecided: the faults and the lapses that do not. What
/// cannot show in a version is excused there.
fn lapses_and_faults(
    role: Role,
    outcome: &Qualification,
    excused: &[(String, String)],
) -> (Vec<&'static str>, Vec<&'static str>) {
    let named = |fails: bool| {
        let kills = outcome.kills.iter();
        let shows = kills.filter(|kill| !excused.iter().any(|(name, _)| name == kill.fault.name));
        let wrong = shows.filter(move |kill| {
            (kill.verdict == Some(Verdict::Fail)) == fails && BuiltIn::lapse(role, kill.fault.name).is_some() == fails
        });
        wrong.map(|kill| kill.fault.name).collect::<Vec<_>>()
    };
    (named(false), named(true))
}

/// A fault of a blind round, the requirement that is found broken, and the tests it takes: `*` for all of them.
struct Found<'t> {
    fault: &'t str,
    requirement: &'t str,
    tests: Vec<&'t str>,
}

impl Found<'_> {
    /// Whether it is found, on one of the devices that the suites are proven on.
    fn is_found(&self, library: &Library, pack: &Pack, role: Role) -> bool {
        BuiltIn::variants(role, pack).into_iter().any(|device| {
            let mut request = VirtualRun {
                device,
                ..VirtualRun::of_role(role, library, pack)
            };
            // What shows only behind other tests is found by all of them together.
            if self.tests != ["*"] {
                request.tests.retain(|test| self.tests.contains(&test.id.as_str()));
                request.draw = None;
            }
            request.complete = false;
            request.faults = vec![self.fault.to_owned()];
            if request.tests.is_empty() {
                return false;
            }
            let result = run_silently(library, pack, request).expect("a run").result;
            decided(&result).into_iter().any(|(decider, verdict)| {
                decider.requirement == self.requirement && matches!(verdict, Verdict::Fail | Verdict::Warning)
            })
        })
    }
}

/// What was found of a blind round stays found, each fault by the tests that found it.
#[test]
fn what_was_found_of_blind_rounds_is_found_again() {
    super::stand_back();
    let library = library();
    let pack = library.rules.packs.latest();
    let mut all = Vec::new();
    for side in [&AGV, &MASTER_CONTROL] {
        let lines = side
            .found
            .lines()
            .filter(|line| !line.starts_with('#') && !line.is_empty());
        for line in lines {
            let mut cells = line.split('\t');
            let mut cell = || cells.next().expect("three columns");
            let (fault, requirement, tests) = (cell(), cell(), cell().split(' ').collect());
            let found = Found {
                fault,
                requirement,
                tests,
            };
            let known = BuiltIn::blind_faults(side.role).iter().find(|one| one.name == fault);
            let known = known.unwrap_or_else(|| panic!("there is no fault {fault}"));
            assert!(
                known.breaks.contains(&requirement),
                "{fault} does not break {requirement}"
            );
            all.push((side.role, found));
        }
    }
    let next = AtomicUsize::new(0);
    let lost = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((role, found)) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if !found.is_found(&library, pack, *role) {
                        lost.lock().unwrap().push(found.fault);
                    }
                }
            });
        }
    });
    let mut lost = lost.into_inner().unwrap();
    lost.sort_unstable();
    assert!(lost.is_empty(), "not found any more: {lost:#?}");
    // So many there are, and so many are found.
    let mut shares = String::new();
    for side in [&AGV, &MASTER_CONTROL] {
        let found = all.iter().filter(|(role, _)| *role == side.role).count();
        let of = BuiltIn::blind_faults(side.role).len();
        shares.push_str(&format!("{}: {found} of {of}\n", side.role));
    }
    insta::assert_snapshot!("found_of_blind_rounds", shares);
}

#[test]
fn the_older_version_passes_without_a_fault_too() {
    super::stand_back();
    let library = library();
    for (role, pack) in [Role::Agv, Role::MasterControl]
        .into_iter()
        .flat_map(|role| library.rules.packs.all().iter().map(move |pack| (role, pack)))
    {
        let outcome = qualify(&library, pack, role, &[]).expect("qualified");
        assert_eq!(blemishes(&outcome), "", "{role}, VDA 5050 {}", pack.version);
        assert!(
            outcome.deciders.len() > 100,
            "{role}, VDA 5050 {}: only {} deciders",
            pack.version,
            outcome.deciders.len()
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
        ("pick-at-once", "capabilities/scope", "FACT-15"),
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
        request.complete = false;
        request.faults = vec!["actions-renamed".to_owned(), fault.to_owned()];
        let result = run_silently(&library, pack, request).expect("a run").result;
        let found = decided(&result).into_iter().any(|(decider, verdict)| {
            verdict == Verdict::Fail && decider.requirement == requirement && decider.place.starts_with(test)
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
    request.complete = false;
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
