//! Tests that are run several times, runs that go on where another one broke off, and journals that are packed.

use std::fs;
use std::time::Duration;

use serde_json::Value;

use crate::bench::{Bench, Profile, QUICK, REFUSAL, bundles};
use crate::broken::step_begun;
use crate::papers::certified_within;

/// Leaves the vehicle with an order until its postamble.
const WAITING: &str = "order-acceptance/horizon-not-entered";

fn verdicts(result: &Value) -> Vec<(&str, &str)> {
    let tests = result["tests"].as_array().unwrap().iter();
    tests
        .map(|test| (test["id"].as_str().unwrap(), test["verdict"].as_str().unwrap_or("none")))
        .collect()
}

#[test]
fn a_test_that_is_run_several_times_is_one_test_with_its_repetitions() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", REFUSAL, QUICK, "--repeat", "3"])
        .code(0)
        .prints("(time 3)");
    let result = bench.result();
    assert_eq!(verdicts(&result).len(), 2);
    for test in result["tests"].as_array().unwrap() {
        let repetitions = test["repetitions"].as_array().unwrap();
        let numbers: Vec<u64> = repetitions.iter().map(|one| one["number"].as_u64().unwrap()).collect();
        assert_eq!(numbers, [1, 2, 3]);
        let windows: Vec<&Value> = repetitions.iter().map(|one| &one["journal"]).collect();
        assert!(windows[0] != windows[1] && windows[1] != windows[2], "{windows:?}");
    }
    let page = fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    assert!(page.contains("run 3 times: 3 pass") && !page.contains("flaky</span>"));
    let junit = fs::read_to_string(bench.bundle().join("junit.xml")).unwrap();
    assert!(junit.contains("run 3 times: 3 pass"));
    bench.is_whole();
}

/// A run of a few tests, cut off in the middle of one as if it had been killed.
fn killed(bench: &Bench, of: &str) -> std::path::PathBuf {
    bench
        .run(&[
            "run",
            "--virtual",
            "order-rejection/unreadable",
            QUICK,
            "--out",
            "before",
        ])
        .code(0);
    let whole = bundles(&bench.path().join("before")).remove(0);
    let text = fs::read_to_string(whole.join("journal.jsonl")).unwrap();
    let begun = format!("\"kind\":\"test-begun\",\"test\":\"{of}\"");
    let cut = text.find(&begun).unwrap();
    let cut = cut + text[cut..].match_indices('\n').nth(3).unwrap().0 + 30;
    let folder = bench.path().join("killed");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("journal.jsonl"), &text.as_bytes()[..cut]).unwrap();
    folder
}

#[test]
fn a_killed_run_is_gone_on_with_and_its_evidence_is_part_of_the_bundle() {
    let bench = Bench::new();
    let folder = killed(&bench, REFUSAL);
    let before = fs::read_to_string(folder.join("journal.jsonl")).unwrap();
    bench
        .run(&["run", "--virtual", "--resume", "killed"])
        .code(0)
        .says("3 tests are kept, 1 test is left")
        .prints("Joined from 2 runs");
    let result = bench.result();
    assert_eq!(result["partial"], false);
    assert!(
        verdicts(&result).iter().all(|(_, verdict)| *verdict == "pass"),
        "{result}"
    );
    assert_eq!(verdicts(&result).len(), 4);
    assert_eq!(result["joined"][0]["kept"], 3);
    assert_eq!(result["joined"][0]["reason"], "the journal breaks off here");
    let journal = fs::read_to_string(bench.bundle().join("journal.jsonl")).unwrap();
    let (whole_lines, _) = before.rsplit_once('\n').unwrap();
    assert!(journal.starts_with(whole_lines), "the evidence was changed");
    let page = fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    assert!(page.contains("Joined from 2 runs"));
    bench.is_whole();
    // What was joined cannot be taken out or changed without notice.
    let path = bench.bundle().join("journal.jsonl");
    fs::write(&path, journal.replacen("factsheet", "factsheeT", 1)).unwrap();
    let shown = bench.bundle().display().to_string();
    bench.run(&["report", "--rejudge", &shown]).code(2).says("was changed");
}

#[test]
fn a_failure_from_before_the_interruption_stays() {
    let bench = Bench::new();
    let fault = ["--fault", "validation-error-fatal"];
    bench
        .run(
            &[
                &[
                    "run",
                    "--virtual",
                    "order-rejection/unreadable",
                    QUICK,
                    "--out",
                    "before",
                ],
                &fault[..],
            ]
            .concat(),
        )
        .code(1);
    let whole = bundles(&bench.path().join("before")).remove(0);
    let text = fs::read_to_string(whole.join("journal.jsonl")).unwrap();
    let last = text.match_indices("\"kind\":\"test-begun\"").last().unwrap().0;
    let end = text[..last].rfind('\n').unwrap() + 1;
    fs::create_dir(bench.path().join("killed")).unwrap();
    fs::write(bench.path().join("killed/journal.jsonl"), &text[..end]).unwrap();
    bench
        .run(&[&["run", "--virtual", "--resume", "killed"], &fault[..]].concat())
        .code(1)
        .prints("Findings:");
    bench.is_whole();
}

#[test]
fn an_interrupted_run_is_gone_on_with_against_the_same_device_and_no_other() {
    let bench = Bench::new();
    let mut profile = Profile::default().with(&[("quiet", "8 s"), ("connect", "50 s")]);
    profile.motion = true;
    let (mut run, port) = bench.start(&profile, &[QUICK, WAITING]);
    let agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, (WAITING, "steps[1]"));
    run.interrupt();
    run.end().code(130);
    drop(agv);
    let first = bench.bundle();
    fs::rename(&first, bench.path().join("interrupted")).unwrap();
    let resume = |more: &[&str]| {
        let arguments = [&["run", "--profile", "device.toml", "--resume", "interrupted"], more].concat();
        bench.run(&arguments)
    };
    resume(&["--serial", "0002"])
        .code(2)
        .says("its serial number was `0001`");
    resume(&["--protocol", "2.0.0"]).code(2).says("its protocol version");
    resume(&[QUICK]).code(2);
    assert!(
        bundles(&bench.path().join("reports")).is_empty(),
        "a refusal leaves a bundle"
    );
    let (run, port) = bench.start(&profile, &["--resume", "interrupted"]);
    let _agv = bench.agv(port, &[]);
    run.end().code(0).prints("Joined from 2 runs");
    let result = bench.result();
    assert_eq!(verdicts(&result), [(QUICK, "pass"), (WAITING, "pass")]);
    bench.is_whole();
    let folder = bench.bundle().display().to_string();
    bench
        .run(&["run", "--profile", "device.toml", "--resume", &folder])
        .code(4)
        .says("came to its end");
}

#[test]
fn what_does_not_fit_into_the_budget_is_left_out_by_name_and_gone_on_with() {
    let bench = Bench::new();
    let drives = "order-update";
    let plain = |more: &[&str]| bench.run(&[&["run", "--virtual", "--seed", "3"], more].concat());
    plain(&[QUICK, drives]).code(0);
    let whole = bench.result();
    let all = verdicts(&whole).len();
    fs::remove_dir_all(bench.path().join("reports")).unwrap();
    plain(&[QUICK, drives, "--budget", "6s"])
        .code(3)
        .prints("give the run more time (--budget), or go on with what is left (--resume)");
    let result = bench.result();
    assert_eq!(result["partial"], false);
    let left: Vec<&Value> = result["tests"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|test| test["cause"]["kind"] == "over-budget")
        .collect();
    assert!(!left.is_empty() && left.len() < all, "{} of {all}", left.len());
    for test in &left {
        assert_eq!(test["verdict"], "inconclusive");
        assert_eq!(test["reason"], "not carried out: budget (--budget 6s)");
        assert_eq!(test["cause"]["budget"], 6);
    }
    let limits = result["limits"].to_string();
    assert!(
        limits.contains(&format!("Of the selected tests {} had no time (--budget)", left.len())),
        "{limits}"
    );
    fs::rename(bench.bundle(), bench.path().join("first")).unwrap();
    bench
        .run(&["run", "--virtual", "--seed", "3", "--resume", "first"])
        .code(0)
        .prints("Joined from 2 runs");
    let result = bench.result();
    assert!(!result["limits"].to_string().contains("--budget"), "{result}");
    assert_eq!(verdicts(&result).len(), all);
    assert!(
        verdicts(&result).iter().all(|(_, verdict)| *verdict == "pass"),
        "{result}"
    );
    bench.is_whole();
}

#[test]
fn a_repetition_that_has_no_time_is_undecided() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", WAITING, "--repeat", "50", "--budget", "10s"])
        .code(3)
        .prints("give the run more time (--budget)");
    let why = bench.result()["tests"][0]["reason"].as_str().unwrap().to_owned();
    assert!(
        why.ends_with("of 50 times: not carried out: budget (--budget 10s)"),
        "{why}"
    );
    bench.is_whole();
}

#[test]
fn a_certification_without_time_is_no_paper_and_goes_on_as_a_certification_only() {
    let bench = Bench::new();
    certified_within(&bench.path().join("run"), Some(Duration::from_secs(6)));
    let result = fs::read_to_string(bench.path().join("run/result.json")).unwrap();
    let result: Value = serde_json::from_str(&result).unwrap();
    let decided = verdicts(&result)
        .iter()
        .filter(|(_, verdict)| *verdict == "pass")
        .count();
    assert!(decided > 0 && decided < verdicts(&result).len(), "{decided}");
    bench
        .run(&["report", "--certificate", "run"])
        .code(2)
        .says("`certify --resume` goes on with it");
    bench
        .run(&["run", "--virtual", "--resume", "run"])
        .code(2)
        .says("it was made by `certify`, and this is `run`");
}

#[test]
fn what_cannot_be_gone_on_with_is_2() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", "--resume", "nowhere"])
        .code(2)
        .says("journal.jsonl");
    fs::create_dir(bench.path().join("empty")).unwrap();
    fs::write(bench.path().join("empty/journal.jsonl"), "").unwrap();
    bench
        .run(&["run", "--virtual", "--resume", "empty"])
        .code(2)
        .says("no run in it");
}

#[test]
fn a_large_journal_is_packed_and_read_by_every_command() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", "order-update", "order-acceptance"])
        .code(0);
    let folder = bench.bundle();
    assert!(!folder.join("journal.jsonl").exists());
    let packed = fs::metadata(folder.join("journal.jsonl.gz")).unwrap().len();
    assert!(packed < 500_000, "{packed} bytes");
    assert_eq!(bench.result()["journal"], "journal.jsonl.gz");
    bench.is_whole();
    let shown = folder.display().to_string();
    bench.run(&["report", &shown]).code(0);
    bench.run(&["report", "--as", "junit", &shown]).code(0);
    bench.run(&["report", "--attestation", &shown]).code(0);
    let journal = folder.join("journal.jsonl.gz").display().to_string();
    bench.run(&["audit", &journal]).code(0);
}
