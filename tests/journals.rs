//! Journals that must be judged the same for ever.
//!
//! Every folder of `fixtures/journals/` holds what happened in `journal.jsonl`, and in `expected.json` why it is kept and
//! what has to come out. A false accusation that was mended, or a fault that was missed once, ends up here: no reference
//! device has to be able to do it again. `DEVELOPING.md` says how a case is added.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use vda5050_tck::audit::{Options, own_run};
use vda5050_tck::capture::{Item, Mapping, Recorded};
use vda5050_tck::journal::file::JournalWriter;
use vda5050_tck::judge::judge;
use vda5050_tck::judge::{Library, Rules};
use vda5050_tck::pack::{AssetFile, Assets, Catalogue, Role};
use vda5050_tck::qualify::decided;
use vda5050_tck::report::findings::{Finding, findings};
use vda5050_tck::report::sources::Sources;
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{Selection, VirtualRun, run_silently, sources};
use vda5050_tck::verdict::{Accumulated, Verdict};

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Requirement id to verdict; nothing means that it must not be decided.
type Verdicts = BTreeMap<String, Option<Verdict>>;

/// What has to come out. What is not mentioned may come out one way or the other.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Expected {
    /// What the case is about, and why it must be judged so.
    why: String,
    /// By test or monitor: the worst that it decides about a requirement.
    #[serde(default)]
    by: BTreeMap<String, Verdicts>,
    /// The worst that is decided about a requirement by anything.
    #[serde(default)]
    requirements: Verdicts,
    /// Whether nothing at all may be found to be broken, which the rest of the file then need not repeat.
    #[serde(default)]
    accuses_nobody: bool,
}

fn worst(result: &RunResult, requirement: &str, by: Option<&str>) -> Option<Verdict> {
    let all = decided(result).into_iter();
    let own = all.filter(|(decider, _)| {
        let place = decider.place.split(' ').next();
        decider.requirement == requirement && by.is_none_or(|by| place == Some(by))
    });
    own.map(|(_, verdict)| verdict).collect::<Accumulated>().get()
}

fn differences(result: &RunResult, expected: &Expected) -> String {
    let mut text = String::new();
    let mut hold = |by: Option<&str>, verdicts: &Verdicts| {
        for (requirement, wanted) in verdicts {
            let found = worst(result, requirement, by);
            if found != *wanted {
                let word = |verdict: Option<Verdict>| verdict.map_or("not decided", Verdict::word);
                let by = by.map(|by| format!(" by {by}")).unwrap_or_default();
                let _ = writeln!(text, "  {requirement}{by}: {}, expected {}", word(found), word(*wanted));
            }
        }
    };
    for (by, verdicts) in &expected.by {
        hold(Some(by), verdicts);
    }
    hold(None, &expected.requirements);
    if expected.accuses_nobody {
        for (decider, verdict) in decided(result) {
            if matches!(verdict, Verdict::Fail | Verdict::Warning) {
                let _ = writeln!(
                    text,
                    "  {} by {}: {}",
                    decider.requirement,
                    decider.place,
                    verdict.word()
                );
            }
        }
    }
    text
}

#[test]
fn journals_are_judged_as_they_always_were() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/journals");
    let mut cases: Vec<_> = std::fs::read_dir(&folder)
        .expect("fixtures/journals")
        .map(|entry| entry.expect("a folder").path())
        .filter(|path| path.is_dir())
        .collect();
    cases.sort();
    assert!(!cases.is_empty());
    let mut wrong = String::new();
    for case in cases {
        let name = case.file_name().unwrap().to_string_lossy().into_owned();
        let expected = std::fs::read_to_string(case.join("expected.json")).expect("expected.json");
        let expected: Expected = serde_json::from_str(&expected).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(expected.why.len() > 30, "{name} does not say why");
        assert!(
            expected.accuses_nobody || !expected.by.is_empty() || !expected.requirements.is_empty(),
            "{name} expects nothing"
        );
        let saved = vda5050_tck::journal::file::read(&case.join("journal.jsonl")).expect("a journal");
        let result = judge(&library.rules, saved.journal.entries()).unwrap_or_else(|error| panic!("{name}: {error}"));
        let found = differences(&result, &expected);
        if !found.is_empty() {
            let _ = write!(wrong, "{name}: {}\n{found}", expected.why);
        }
    }
    assert!(
        wrong.is_empty(),
        "these are judged otherwise than they have to be:\n{wrong}"
    );
}

#[test]
fn a_journal_without_its_end_gives_no_better_verdict() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = std::fs::read_dir(root.join("fixtures/journals")).expect("fixtures/journals");
    let mut all: Vec<_> = kept.map(|entry| entry.expect("a folder").path()).collect();
    all.retain(|path| path.is_dir());
    all.push(root.join("reports/example"));
    for folder in all {
        let name = folder.display();
        let saved = vda5050_tck::journal::file::read(&folder.join("journal.jsonl")).expect("a journal");
        let entries = saved.journal.entries();
        let cuts = (1..entries.len()).step_by((entries.len() / 60).max(1));
        for cut in cuts.chain([entries.len() - 1]) {
            let beginning =
                judge(&library.rules, entries.iter().take(cut)).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!(beginning.partial, "{name}, {cut} records");
            assert!(
                beginning
                    .verdict
                    .is_some_and(|verdict| verdict >= Verdict::Inconclusive),
                "{name}, {cut} records: {:?}",
                beginning.verdict
            );
        }
    }
}

/// Monitor, requirement, verdict and count of what monitors found.
type Found = BTreeSet<(String, String, Verdict, u64)>;

fn of_run(result: &RunResult) -> Found {
    let monitors = result.monitors.iter();
    let all = monitors.flat_map(|monitor| monitor.findings.iter().map(move |finding| (monitor, finding)));
    all.map(|(monitor, finding)| {
        let requirement = finding.requirement.clone();
        (monitor.id.clone(), requirement, finding.verdict, finding.count)
    })
    .collect()
}

/// What the audit finds in the file, which knows nothing of the run.
fn of_audit(library: &Library, journal: &Path) -> Found {
    let name = journal.display();
    let mut recorded = Recorded::open(journal, 0, Mapping::default()).unwrap_or_else(|error| panic!("{error}"));
    let Ok(Some(Item::Record(first))) = recorded.read() else {
        panic!("{name} is no journal");
    };
    let vehicle = own_run(&library.rules, &Options::default(), 0, *first, &mut recorded);
    let vehicle = vehicle.unwrap_or_else(|error| panic!("{name}: {error}"));
    let sides = vehicle.sides.into_iter();
    let all = sides.flat_map(|side| [side.findings, side.information].concat());
    all.map(|finding| (finding.monitor, finding.requirement, finding.verdict, finding.count))
        .collect()
}

#[test]
fn the_journal_of_a_run_is_audited_like_the_run_was_judged() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let kept = std::fs::read_dir(root.join("fixtures/journals")).expect("fixtures/journals");
    let mut journals: Vec<PathBuf> = kept.map(|entry| entry.expect("a folder").path()).collect();
    journals.retain(|path| path.is_dir());
    journals.push(root.join("reports/example"));
    for folder in journals {
        let path = folder.join("journal.jsonl");
        let saved = vda5050_tck::journal::file::read(&path).expect("a journal");
        let result = judge(&library.rules, saved.journal.entries()).expect("judged");
        assert_eq!(of_audit(&library, &path), of_run(&result), "{}", path.display());
    }
    for (role, faults) in [
        (Role::Agv, &["header-id-constant", "horizon-not-reported"][..]),
        (Role::MasterControl, &["other-serial-number"][..]),
    ] {
        let faultless = library.rules.packs.of_role(role).map(|pack| (pack, None));
        let faulty = faults.iter().map(|fault| (library.rules.packs.latest(), Some(*fault)));
        let mut found = 0;
        for (pack, fault) in faultless.chain(faulty) {
            let mut request = VirtualRun::of_role(role, &library, pack);
            request.faults.extend(fault.map(str::to_owned));
            let run = run_silently(&library, pack, request).expect("a run");
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("journal.jsonl");
            let mut writer = JournalWriter::create(&path).expect("a file");
            for entry in run.recorder.journal().entries() {
                writer.write(&entry.record).expect("written");
            }
            drop(writer);
            let of_run = of_run(&run.result);
            found += of_run.len();
            let what = format!("{role} {fault:?}, VDA 5050 {}", pack.version);
            assert_eq!(of_audit(&library, &path), of_run, "{what}");
        }
        assert!(found > 0, "{role}: nothing was found that could be compared");
    }
}

/// The same rules, where no requirement rests on another one.
fn resting_on_nothing(rules: &Rules) -> Rules {
    let assets = vda5050_tck::embedded();
    let files = assets.under("suites/requirements/").map(|file| {
        let lines = file.text.lines();
        let lines = lines.filter(|line| !line.trim_start().starts_with("rests-on:"));
        AssetFile {
            path: file.path.clone(),
            text: lines.collect::<Vec<_>>().join("\n") + "\n",
        }
    });
    let catalogue = Catalogue::load(&Assets::built_in(files)).unwrap_or_else(|all| panic!("{}", all[0]));
    assert!(catalogue.all().all(|requirement| requirement.rests_on.is_empty()));
    Rules {
        catalogue: Arc::new(catalogue),
        ..rules.clone()
    }
}

/// Holds that every requirement has the verdict it has where nothing follows from anything, and that causes are told. Gives what
/// follows from what.
fn following(result: &RunResult, quoted: &Sources, name: &str) -> BTreeSet<(String, String)> {
    let mut apart = quoted.clone();
    for requirement in &mut apart.requirements {
        requirement.rests_on.clear();
    }
    let verdicts = |all: &[Finding<'_>]| -> BTreeMap<String, Verdict> {
        let all = all.iter();
        all.map(|finding| (finding.requirement.to_owned(), finding.verdict))
            .collect()
    };
    let told = findings(result, quoted);
    assert_eq!(verdicts(&told), verdicts(&findings(result, &apart)), "{name}");
    let mut following = BTreeSet::new();
    for finding in &told {
        if let Some(cause) = finding.follows {
            let of_cause = told.iter().find(|other| other.requirement == cause);
            let of_cause = of_cause.unwrap_or_else(|| panic!("{name}: {cause} is not told"));
            assert!(of_cause.follows.is_none(), "{name}: {cause} is no cause");
            assert!(of_cause.verdict >= finding.verdict, "{name}: {cause}");
            following.insert((finding.requirement.to_owned(), cause.to_owned()));
            continue;
        }
        let mut all = result.requirements.iter();
        let known = all.find(|known| known.id == finding.requirement);
        if finding.verdict == Verdict::Fail && known.is_some() {
            let verdict = known.and_then(|known| known.verdict);
            assert_eq!(verdict, Some(Verdict::Fail), "{name}: {}", finding.requirement);
        }
    }
    following
}

#[test]
fn no_verdict_changes_by_what_follows_from_what() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let rules = &library.rules;
    let apart = resting_on_nothing(rules);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/journals");
    let kept = std::fs::read_dir(folder).expect("fixtures/journals");
    let kept = kept.map(|entry| entry.expect("a folder").path());
    for folder in kept.filter(|path| path.is_dir()) {
        let name = folder.display().to_string();
        let saved = vda5050_tck::journal::file::read(&folder.join("journal.jsonl")).expect("a journal");
        let entries = saved.journal.entries();
        let result = judge(rules, entries).expect("judged");
        assert!(result == judge(&apart, entries).expect("judged"), "{name}");
        let pack = rules.packs.get(&result.protocol).expect("a version");
        following(&result, &sources(&library, pack), &name);
    }
}

#[test]
fn an_outdated_update_that_is_taken_over_is_one_mistake() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest();
    let mut request = VirtualRun::of(&library, pack);
    let mut tests = library.tests(Role::Agv, &pack.id);
    tests.retain(|test| test.id.starts_with("order-rejection/lower-update-id"));
    request.tests = Selection::some(tests);
    request.faults.push("outdated-update-taken-over".to_owned());
    let run = run_silently(&library, pack, request).expect("a run");
    let quoted = sources(&library, pack);
    let following = following(&run.result, &quoted, "an outdated update");
    for requirement in ["STATE-12", "NODE-03"] {
        let tie = (requirement.to_owned(), "ORD-REJ-10".to_owned());
        assert!(following.contains(&tie), "{requirement}: {following:?}");
    }
    let told = findings(&run.result, &quoted);
    let causes = told.iter().filter(|finding| finding.follows.is_none());
    let causes: Vec<&str> = causes.map(|finding| finding.requirement).collect();
    assert_eq!(causes, ["ORD-REJ-10"]);
}
