//! `history`: many bundles, what became of every requirement in them, and what is no evidence.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::bench::{Bench, QUICK};
use vda5050_tck::report::manifest::Manifest;

const TEST: &str = "order-rejection/lower-update-id";
const FAULT: &str = "outdated-update-taken-over";

/// A run of one test into the archive, with a fault or without.
fn run(bench: &Bench, fault: Option<&str>) {
    let fault: Vec<&str> = fault.into_iter().flat_map(|fault| ["--fault", fault]).collect();
    let words = ["run", "--virtual", TEST, "--seed", "1", "--quiet", "--out", "archive"];
    bench
        .run(&[&words[..], &fault].concat())
        .code(i32::from(!fault.is_empty()));
}

/// The bundles of the archive, the earliest first.
fn bundles(bench: &Bench) -> Vec<std::path::PathBuf> {
    let mut all = crate::bench::bundles(&bench.path().join("archive"));
    all.sort();
    all
}

/// The history as JSON, held against its schema.
fn history(bench: &Bench, folder: &str) -> Value {
    let ended = bench.run(&["history", folder, "--format", "json"]).code(0);
    let value: Value = serde_json::from_str(&ended.stdout).unwrap();
    let schema = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/history.schema.json")).unwrap();
    let schema: Value = serde_json::from_str(&schema).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let wrong: Vec<String> = validator.iter_errors(&value).map(|error| error.to_string()).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
    value
}

fn course<'v>(series: &'v Value, id: &str) -> &'v Value {
    let all = series["requirements"].as_array().unwrap();
    all.iter().find(|course| course["id"] == id).unwrap()
}

/// Copies the files of a bundle.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

#[test]
fn what_fails_has_a_beginning_and_what_is_mended_an_end() {
    let bench = Bench::new();
    run(&bench, None);
    run(&bench, Some(FAULT));
    let found = history(&bench, "archive");
    let series = &found["series"][0];
    let broken = course(series, "ORD-REJ-10");
    assert_eq!(
        (&broken["state"], &broken["since"], &broken["keptIn"]),
        (&json!("fails"), &json!(2), &json!(1))
    );
    assert_eq!(broken["by"], json!([TEST]));
    assert_eq!(broken["runs"], json!(["pass", "fail"]));
    let changes = json!([
        { "what": "profile", "name": "built-in.fault", "after": FAULT },
        { "what": "command", "before": format!("run --virtual {TEST}"), "after": format!("run --virtual {TEST} --fault {FAULT}") },
    ]);
    assert_eq!(broken["changes"], changes);
    assert_eq!(series["runs"][1]["changes"], broken["changes"]);
    // What another test cannot see is not mended by it.
    bench
        .run(&["run", "--virtual", QUICK, "--quiet", "--out", "archive"])
        .code(0);
    assert_eq!(
        course(&history(&bench, "archive")["series"][0], "ORD-REJ-10")["state"],
        "unseen"
    );
    run(&bench, None);
    let found = history(&bench, "archive");
    let fixed = course(&found["series"][0], "ORD-REJ-10");
    assert_eq!(
        (&fixed["state"], &fixed["fixedIn"], &fixed["last"]),
        (&json!("fixed"), &json!(4), &json!(2))
    );
    bench
        .run(&["history", "archive"])
        .code(0)
        .prints("FIXED  ORD-REJ-10  fixed in #4")
        .prints("between: profile built-in.fault: outdated-update-taken-over -> nothing; command: run --virtual");
}

/// Two devices of one name that are tested at once, as a campaign does, may begin in the same millisecond and with the same
/// seed; the same run that was rendered anew is known by its first record.
#[test]
fn runs_that_begin_together_are_told_apart_and_one_rendered_anew_is_not_counted() {
    let bench = Bench::new();
    run(&bench, None);
    let archive = bench.path().join("archive");
    let first = bundles(&bench).remove(0);
    for (name, seed) in [("beside", "--seed=1"), ("anew", "--seed\",\"1")] {
        let copied = archive.join("copies").join(name);
        copy(&first, &copied);
        let journal = copied.join("journal.jsonl");
        let text = fs::read_to_string(&journal).unwrap();
        fs::write(&journal, text.replacen("--seed\",\"1", seed, 1)).unwrap();
        fs::write(copied.join("notes.txt"), name).unwrap();
        Manifest::write(&copied).unwrap();
    }
    let found = history(&bench, "archive");
    assert_eq!(found["bundles"], 2, "{found:#}");
    let left: Vec<&Value> = found["leftOut"].as_array().unwrap().iter().collect();
    assert_eq!(left.len(), 1, "{left:?}");
    assert_eq!(left[0]["why"], "twice");
}

#[test]
fn nothing_is_mixed_that_does_not_belong_together_and_what_is_no_evidence_is_named() {
    let bench = Bench::new();
    run(&bench, None);
    run(&bench, Some(FAULT));
    let archive = bench.path().join("archive");
    let all = bundles(&bench);
    copy(&all[0], &archive.join("copies/again"));
    copy(&all[1], &archive.join("copies/changed"));
    let result = archive.join("copies/changed/result.json");
    let text = fs::read_to_string(&result).unwrap().replace("\"fail\"", "\"pass\"");
    fs::write(&result, text).unwrap();
    copy(&all[1], &archive.join("copies/killed"));
    fs::remove_file(archive.join("copies/killed/manifest.json")).unwrap();
    fs::create_dir_all(archive.join("copies/torn")).unwrap();
    fs::copy(all[1].join("journal.jsonl"), archive.join("copies/torn/journal.jsonl")).unwrap();
    fs::create_dir_all(archive.join("copies/foreign")).unwrap();
    fs::write(archive.join("copies/foreign/result.json"), "{}").unwrap();
    Manifest::write(&archive.join("copies/foreign")).unwrap();
    let capture = format!("{}/fixtures/captures/horizon-missing.jsonl", env!("CARGO_MANIFEST_DIR"));
    bench
        .run(&["audit", &capture, "--out", "archive/audits/monday"])
        .code(1);
    bench
        .run(&[
            "run",
            "--virtual",
            "--role",
            "master-control",
            "dispatch",
            "--quiet",
            "--out",
            "archive",
        ])
        .code(0);
    let found = history(&bench, "archive");
    let left: Vec<(&str, &str)> = found["leftOut"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| (one["path"].as_str().unwrap(), one["why"].as_str().unwrap()))
        .collect();
    let again = |one: &&(&str, &str)| one.1 == "twice";
    assert_eq!(left.iter().filter(again).count(), 1, "{left:?}");
    for expected in [
        ("copies/changed", "damaged"),
        ("copies/killed", "no-manifest"),
        ("copies/torn", "no-result"),
        ("copies/foreign", "unreadable"),
    ] {
        assert!(left.contains(&expected), "{expected:?} {left:?}");
    }
    assert_eq!(left.len(), 5);
    let series = found["series"].as_array().unwrap();
    let of = |kind: &str, role: &str| {
        series
            .iter()
            .filter(|one| one["kind"] == kind && one["role"] == role)
            .count()
    };
    assert_eq!(
        (of("run", "agv"), of("run", "master-control"), of("audit", "agv")),
        (1, 1, 1)
    );
    let own = series
        .iter()
        .find(|one| one["kind"] == "run" && one["role"] == "agv")
        .unwrap();
    assert_eq!(own["runs"].as_array().unwrap().len(), 2);
    let audit = series.iter().find(|one| one["kind"] == "audit").unwrap();
    assert_eq!(course(audit, "STATE-12")["state"], "fails");
    bench
        .run(&["history", "archive"])
        .code(0)
        .prints("left out, and no part of the above")
        .prints("damaged        copies/changed: changed  result.json");
}

#[test]
fn a_page_leads_to_the_evidence_from_where_it_lies() {
    let bench = Bench::new();
    run(&bench, None);
    run(&bench, Some(FAULT));
    bench
        .run(&[
            "history",
            "archive",
            "--as",
            "html=pages/history.html",
            "--as",
            "markdown=history.md",
            "--format",
            "json",
        ])
        .code(0);
    let page = fs::read_to_string(bench.path().join("pages/history.html")).unwrap();
    assert!(
        !page.contains("<script") && !page.contains("<link") && !page.contains("src="),
        "a page of one file"
    );
    assert!(page.find("What happened").unwrap() < page.find("The runs").unwrap());
    let links: Vec<&str> = page
        .split("href=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    let files: Vec<&str> = links.into_iter().filter(|link| !link.starts_with('#')).collect();
    assert!(files.len() > 3, "{files:?}");
    for link in files {
        let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
        let report = fs::read_to_string(bench.path().join("pages").join(file)).unwrap();
        assert!(
            anchor.is_empty() || report.contains(&format!("id=\"{anchor}\"")),
            "{link}"
        );
    }
    assert!(page.contains("#r-ORD-REJ-10"));
    let markdown = fs::read_to_string(bench.path().join("history.md")).unwrap();
    assert!(markdown.contains("| fails | **ORD-REJ-10** |"), "{markdown}");
    let page = bench.run(&["history", "archive", "--as", "html"]).code(0).stdout;
    assert!(page.contains("href=\"archive/vda5050-tck-reference-agv/"));
}

#[test]
fn three_hundred_requirements_in_fifty_runs_are_one_readable_page() {
    let bench = Bench::new();
    run(&bench, Some(FAULT));
    let bundle = bundles(&bench).remove(0);
    let text = fs::read_to_string(bundle.join("result.json")).unwrap();
    let result: Value = serde_json::from_str(&text).unwrap();
    for number in 0..50 {
        let mut result = result.clone();
        result["started"] = format!("2026-{:02}-{:02}T08:00:00.000Z", 1 + number / 28, 1 + number % 28).into();
        let requirements = result["requirements"].as_array_mut().unwrap();
        for at in requirements.len()..300 {
            requirements.push(json!({ "id": format!("X-{at}"), "verdict": "pass", "decided_by": ["x/y"] }));
        }
        for requirement in requirements.iter_mut().skip(number % 7).step_by(40) {
            *requirement = json!({ "id": requirement["id"], "verdict": "fail", "decided_by": ["x/<hostile>"] });
        }
        let folder = bench.path().join(format!("many/{number}"));
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join("result.json"), result.to_string()).unwrap();
        fs::write(folder.join("report.html"), "").unwrap();
        Manifest::write(&folder).unwrap();
    }
    bench
        .run(&["history", "many", "--as", "html=history.html"])
        .code(0)
        .prints("… and 30 earlier");
    let page = fs::read_to_string(bench.path().join("history.html")).unwrap();
    assert!(page.len() < 1_500_000, "{} bytes", page.len());
    assert!(
        page.matches("<tr").count() > 350,
        "a row for each requirement and each run"
    );
    assert!(page.contains("x/&#60;hostile&#62;") && !page.contains("<hostile>"));
}

#[test]
fn where_there_is_nothing_the_exit_code_says_so() {
    let bench = Bench::new();
    bench.run(&["history", "nowhere"]).code(2).says("nowhere");
    fs::create_dir(bench.path().join("empty")).unwrap();
    bench
        .run(&["history", "empty"])
        .code(4)
        .says("no bundle that can be taken");
    bench
        .run(&["history", "empty", "--as", "pdf"])
        .code(2)
        .says("html, markdown, json");
}
