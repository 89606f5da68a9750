//! The journal is the evidence: from it alone everything else is made again, and a change of it is seen.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::bench::{Bench, Profile, REFUSAL};
use crate::broken::{WATCHING, step_begun};

/// A finished run in virtual time that fails one requirement.
fn failed_run() -> (Bench, String) {
    let bench = Bench::new();
    let fault = ["--fault", "validation-error-misspelled"];
    bench
        .run(&[&["run", "--virtual", "order-rejection/unreadable"], &fault[..]].concat())
        .code(1);
    let folder = bench.bundle().display().to_string();
    (bench, folder)
}

fn change(file: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(file).unwrap();
    assert!(text.contains(from), "nothing to change");
    fs::write(file, text.replace(from, to)).unwrap();
}

#[test]
fn a_virtual_run_is_judged_again_to_the_same_bytes_whether_it_passed_or_failed() {
    let (bench, _) = failed_run();
    bench.is_whole();
    let bench = Bench::new();
    bench.run(&["run", "--virtual", "order-update"]).code(0);
    bench.is_whole();
}

#[test]
fn a_message_of_the_journal_is_printed_by_its_number() {
    let (bench, folder) = failed_run();
    let fails = bench.result()["tests"][0]["decisions"].clone();
    let fails = fails
        .as_array()
        .unwrap()
        .iter()
        .find(|decision| decision["verdict"] == "fail");
    let seen = fails.unwrap()["witness"].to_string();
    bench
        .run(&["report", &folder, "--message", &seen])
        .code(0)
        .prints(&format!("#{seen} state"))
        .prints("\"errorType\": ");
    bench
        .run(&["report", &folder, "--message", "999999"])
        .code(2)
        .says("the journal has no record #999999");
}

#[test]
fn a_journal_line_that_was_edited_is_noticed() {
    let (bench, folder) = failed_run();
    change(
        &bench.bundle().join("journal.jsonl"),
        "validationOrder",
        "validationError",
    );
    bench
        .run(&["report", &folder, "--rejudge"])
        .code(2)
        .says("the journal was changed");
    bench
        .run(&["report", &folder, "--verify"])
        .code(1)
        .prints("journal.jsonl");
}

#[test]
fn a_result_that_was_edited_is_noticed() {
    let (bench, folder) = failed_run();
    change(
        &bench.bundle().join("result.json"),
        "\"verdict\": \"fail\"",
        "\"verdict\": \"pass\"",
    );
    bench
        .run(&["report", &folder, "--rejudge"])
        .code(1)
        .prints("ORD-REJ-02");
    bench
        .run(&["report", &folder, "--verify"])
        .code(1)
        .prints("result.json");
}

#[test]
fn rendering_again_gives_the_same_bytes() {
    let (bench, folder) = failed_run();
    let files = ["report.html", "junit.xml", "result.json", "manifest.json"];
    let read = || files.map(|name| fs::read_to_string(bench.bundle().join(name)).unwrap());
    let before = read();
    for name in &files[..2] {
        fs::remove_file(bench.bundle().join(name)).unwrap();
    }
    bench.run(&["report", &folder]).code(1).prints("FAIL  ");
    for (name, (before, after)) in files.into_iter().zip(before.into_iter().zip(read())) {
        assert!(before == after, "{name} differs");
    }
}

#[test]
fn a_journal_that_ends_in_the_middle_of_a_line_gives_a_partial_report() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", "order-rejection/unreadable"]).code(0);
    let folder = bench.bundle();
    let journal = folder.join("journal.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    let begun = "\"kind\":\"test-begun\",\"test\":\"order-rejection/unreadable[truncated]\"";
    // In the middle of the last test, and in the middle of a line.
    let cut = text.find(begun).unwrap();
    let cut = cut + text[cut..].match_indices('\n').nth(4).unwrap().0 + 40;
    fs::write(&journal, &text.as_bytes()[..cut]).unwrap();
    for name in ["report.html", "junit.xml", "result.json", "manifest.json"] {
        fs::remove_file(folder.join(name)).unwrap();
    }
    let ended = bench
        .run(&["report", &folder.display().to_string()])
        .says("the last line of the journal is cut off");
    assert_ne!(
        ended.status.code(),
        Some(0),
        "a run that broke off says nothing about what it did not come to"
    );
    assert_eq!(bench.result()["partial"], true);
    let tests = bench.result()["tests"].clone();
    let verdicts: Vec<&Value> = tests.as_array().unwrap().iter().map(|test| &test["verdict"]).collect();
    assert_eq!(verdicts, ["pass", "pass", "inconclusive"]);
    assert!(
        fs::read_to_string(folder.join("report.html"))
            .unwrap()
            .contains("the journal breaks off here")
    );
}

#[test]
fn a_journal_whose_end_is_missing_makes_no_failed_run_conform() {
    let (bench, folder) = failed_run();
    let journal = bench.bundle().join("journal.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    let beginning: String = text.split_inclusive('\n').take(7).collect();
    fs::write(&journal, beginning).unwrap();
    let before = fs::read(bench.bundle().join("manifest.json")).unwrap();
    bench
        .run(&["report", &folder])
        .code(2)
        .says("nothing is written over it");
    assert_eq!(
        fs::read(bench.bundle().join("manifest.json")).unwrap(),
        before,
        "a changed bundle was made intact"
    );
    bench.run(&["report", &folder, "--verify"]).code(1);
    fs::remove_file(bench.bundle().join("manifest.json")).unwrap();
    bench.run(&["report", &folder]).code(3);
    let result = bench.result();
    assert_eq!(
        (&result["partial"], &result["verdict"]),
        (&true.into(), &"inconclusive".into())
    );
}

#[test]
fn a_journal_without_some_of_its_records_is_refused() {
    let (bench, folder) = failed_run();
    let journal = bench.bundle().join("journal.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    let lines = text.split_inclusive('\n').enumerate();
    let without: String = lines.filter(|(at, _)| *at != 20).map(|(_, line)| line).collect();
    fs::write(&journal, without).unwrap();
    bench
        .run(&["report", &folder, "--rejudge"])
        .code(2)
        .says("records are missing");
}

#[test]
fn what_is_no_run_is_2() {
    let bench = Bench::new();
    bench.run(&["report", "nowhere"]).code(2).says("nowhere");
    fs::write(bench.path().join("journal.jsonl"), "").unwrap();
    bench.run(&["report", "."]).code(2);
    fs::write(bench.path().join("journal.jsonl"), "{\"seq\": 1}\n{}\nhello\n").unwrap();
    bench.run(&["report", "."]).code(2).says("journal.jsonl");
    bench.run(&["report", ".", "--verify"]).code(2).says("manifest.json");
    bench.run(&["report", "--compare", ".", "nowhere"]).code(2);
}

#[test]
fn two_runs_are_compared_and_a_worse_one_is_1() {
    // A fault that does not make the run longer: in a longer one monitors decide more.
    let bad = Bench::new();
    let refusal = ["run", "--virtual", "order-rejection/unreadable"];
    bad.run(&[&refusal[..], &["--fault", "validation-error-fatal"]].concat())
        .code(1);
    let bad_folder = bad.bundle().display().to_string();
    let good = Bench::new();
    good.run(&refusal).code(0);
    let good_folder = good.bundle().display().to_string();
    bad.run(&["report", "--compare", &good_folder, &bad_folder])
        .code(1)
        .prints("ORD-REJ-02");
    bad.run(&["report", "--compare", &bad_folder, &good_folder])
        .code(0)
        .prints("ORD-REJ-02");
    bad.run(&["report", "--compare", &good_folder, &good_folder]).code(0);
}

#[test]
fn the_format_for_programs_is_the_result_itself() {
    let (bench, folder) = failed_run();
    let ended = bench.run(&["report", &folder, "--format", "json"]).code(1);
    assert_eq!(
        ended.stdout,
        fs::read_to_string(bench.bundle().join("result.json")).unwrap()
    );
    assert!(ended.stdout.contains(REFUSAL));
}

/// A quick test that runs before [`WATCHING`].
const BEFORE: &str = REFUSAL;

#[test]
fn a_harness_that_is_killed_leaves_a_journal_that_is_judged_as_far_as_it_goes() {
    let bench = Bench::new();
    let (mut run, port) = bench.start(&Profile::default().with(&[("quiet", "30 s")]), &[BEFORE, WATCHING.0]);
    let _agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, WATCHING);
    run.kill();
    let folder = bench.bundle().display().to_string();
    bench.run(&["report", &folder]).code(3);
    let result = bench.result();
    assert_eq!(result["partial"], true, "{result}");
    let verdict = |id: &str| {
        let tests = result["tests"].as_array().unwrap();
        tests.iter().find(|test| test["id"] == id).unwrap()["verdict"].clone()
    };
    assert_eq!(verdict(BEFORE), "pass", "what was decided before stands");
    assert_eq!(verdict(WATCHING.0), "inconclusive");
}

/// What a report shows of the message with this number: its text without markup, and without the spaces it is laid out with.
fn shown(page: &str, number: u64) -> String {
    let (_, rest) = page.split_once(&format!("id=\"m{number}\"")).unwrap();
    let (_, rest) = rest.split_once("<div class=\"source\"").unwrap();
    let (_, line) = rest.lines().next().unwrap().split_once('>').unwrap();
    let text: String = line.split('<').map(|part| part.rsplit('>').next().unwrap()).collect();
    let text = text.replace("&#34;", "\"").replace("&#60;", "<").replace("&#62;", ">");
    without_spaces(&text.replace("&#38;", "&"))
}

fn without_spaces(text: &str) -> String {
    text.chars().filter(|c| !c.is_whitespace()).collect()
}

#[test]
fn of_a_fleet_the_first_and_the_last_message_are_in_the_report_as_they_were_though_the_run_keeps_few() {
    let bench = Bench::new();
    let fleet = [
        "run",
        "--virtual",
        "--role",
        "master-control",
        "--vehicles",
        "4",
        "--seed",
        "3",
    ];
    let tests = [
        "fleet",
        "dispatch/one-edge",
        "order-update/there-and-back",
        "order-update/lost-state",
    ];
    bench
        .run(&[&fleet[..], &["--fault", "version-missing"], &tests].concat())
        .code(1);
    let records: Vec<Value> = bench
        .journal()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let page = fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    let sent = records.iter().filter_map(|record| {
        let number = record["seq"].as_u64().unwrap();
        let payload = record["event"]["payload"].as_str()?;
        page.contains(&format!("id=\"m{number}\"")).then_some((number, payload))
    });
    let all: Vec<(u64, &str)> = sent.collect();
    let (first, last) = (all[0], all[all.len() - 1]);
    assert!(last.0 - first.0 > 1_000, "#{} to #{}", first.0, last.0);
    assert!(records.len() as u64 - first.0 > 1_000, "{} records", records.len());
    let folder = bench.bundle().display().to_string();
    for (number, payload) in [first, last] {
        assert_eq!(shown(&page, number), without_spaces(payload), "#{number}");
        let told = bench.run(&["report", &folder, "--message", &number.to_string(), "--format", "json"]);
        let told: Value = serde_json::from_str(&told.code(0).stdout).unwrap();
        assert_eq!(told["event"]["payload"], payload, "#{number}");
    }
    bench.is_whole();
    bench.run(&["report", &folder]).code(1);
    let again = fs::read_to_string(bench.bundle().join("report.html")).unwrap();
    assert!(again == page, "the report that is made of the journal is another one");
}
