//! `explore`: conversations with the built-in vehicle, what they find, and that a finding can be carried out again.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::bench::{Bench, Profile};
use crate::broken::started_by_the_harness;
use crate::tool::{Ended, run, run_in};

fn prints(ended: &Ended, text: &str) {
    assert!(ended.stdout.contains(text), "{}", ended.stdout);
}

fn conversation() -> String {
    format!("{}/fixtures/conversations/outdated.yaml", env!("CARGO_MANIFEST_DIR"))
}

/// The reports of a folder, by the order in which they were made.
fn reports(folder: &Path) -> Vec<PathBuf> {
    let device = folder.join("reports/vda5050-tck-reference-agv");
    let mut all: Vec<PathBuf> = fs::read_dir(device)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    all.sort();
    all
}

#[test]
fn what_may_be_said_is_shown() {
    insta::assert_snapshot!("stimuli", run(&["explore", "--stimuli"]).code(0).stdout);
}

#[test]
fn conversations_with_a_faultless_vehicle_find_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let ended = run_in(
        folder.path(),
        &["explore", "--virtual", "--conversations", "4", "--format", "json"],
    )
    .code(0);
    let explored: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(explored["conversations"], 4);
    assert_eq!(explored["undecided"], 0);
    assert_eq!(explored["findings"].as_array().unwrap().len(), 0);
    let order = &explored["coverage"]["rest"]["order-next"];
    assert!(order["asDemanded"].as_u64().unwrap() > 0, "{}", explored["coverage"]);
    assert_eq!(order["broken"], 0);
    let report = explored["report"].as_str().unwrap();
    let written = |name: &str| fs::read_to_string(folder.path().join(report).join(name)).unwrap();
    let result: Value = serde_json::from_str(&written("result.json")).unwrap();
    let said = result["exploration"]["said"].as_array().unwrap();
    let answered = |one: &Value| one["situation"] == "waiting" && one["answers"]["asDemanded"] != 0;
    assert!(said.iter().any(answered), "{said:?}");
    assert!(written("report.html").contains("Situations and stimuli"));
    prints(
        &run_in(folder.path(), &["report", report, "--rejudge"]).code(0),
        "byte for byte",
    );
}

#[test]
fn a_finding_is_shrunk_to_a_test_that_fails_again() {
    let folder = tempfile::tempdir().unwrap();
    let fault = ["--fault", "outdated-update-taken-over"];
    let explore = ["explore", "--virtual", "--conversations", "6", "--format", "json"];
    let ended = run_in(folder.path(), &[explore.as_slice(), &fault].concat()).code(1);
    let explored: Value = serde_json::from_str(&ended.stdout).unwrap();
    let findings = explored["findings"].as_array().unwrap();
    let found = findings.iter().find(|one| one["stimulus"] == "outdated").unwrap();
    assert_eq!(found["requirement"], "ORD-REJ-10");
    assert_eq!(found["shortest"].as_array().unwrap().len(), 2, "{found}");
    assert_eq!(found["shows"]["times"], found["shows"]["of"]);
    let file = found["file"].as_str().unwrap();
    run_in(folder.path(), &["validate", file]).code(0);
    let replay = ["explore", "--virtual", "--replay", file];
    let again = run_in(folder.path(), &[replay.as_slice(), &fault].concat()).code(1);
    prints(&again, "ORD-REJ-10 fail");
    run_in(folder.path(), &replay).code(0);
    let evidence = reports(folder.path()).pop().unwrap();
    assert!(evidence.join("report.html").is_file());
}

#[test]
fn the_conversations_end_when_the_time_is_up_and_what_was_found_is_shrunk() {
    let folder = tempfile::tempdir().unwrap();
    let explore = [
        "explore",
        "--virtual",
        "--focus",
        "outdated",
        "--conversations",
        "1500",
        "--budget",
        "6s",
        "--format",
        "json",
    ];
    let fault = ["--fault", "outdated-update-taken-over"];
    let ended = run_in(folder.path(), &[explore.as_slice(), &fault].concat()).code(1);
    let explored: Value = serde_json::from_str(&ended.stdout).unwrap();
    assert!(
        explored["conversations"].as_u64().unwrap() < 1500,
        "{}",
        explored["conversations"]
    );
    assert_eq!(explored["interrupted"], false);
    let findings = explored["findings"].as_array().unwrap();
    assert!(
        findings.iter().any(|one| one["requirement"] == "ORD-REJ-10"),
        "{findings:?}"
    );
}

#[test]
fn a_conversation_is_carried_out_over_sockets() {
    let folder = tempfile::tempdir().unwrap();
    let ended = run_in(folder.path(), &["explore", "--replay", &conversation()]).code(0);
    prints(&ended, "explore/ord-rej-10-3: pass");
}

#[test]
fn mistakes_of_the_user_are_named() {
    run(&["explore", "--virtual", "--focus", "outdatd"])
        .code(2)
        .says("outdated");
    run(&["explore", "--virtual", "--fault", "no-such-fault"])
        .code(2)
        .says("no-such-fault");
    run(&["explore", "--virtual", "--replay", "missing.yaml"])
        .code(2)
        .says("missing.yaml");
}

/// Five nodes in a line around a corner, in whose middle the built-in vehicle starts.
const LINE: &str = r#"
nodes = [
  { id = "A3", x = 0.0, y = 4.0, map = "reference-floor" }, { id = "A2", x = 0.0, y = 2.0, map = "reference-floor" },
  { id = "A1", x = 0.0, y = 0.0, map = "reference-floor" }, { id = "B1", x = 2.0, y = 0.0, map = "reference-floor" },
  { id = "C1", x = 4.0, y = 0.0, map = "reference-floor" },
]
edges = [
  { id = "A3-A2", from = "A3", to = "A2" }, { id = "A2-A3", from = "A2", to = "A3" },
  { id = "A2-A1", from = "A2", to = "A1" }, { id = "A1-A2", from = "A1", to = "A2" },
  { id = "A1-B1", from = "A1", to = "B1" }, { id = "B1-A1", from = "B1", to = "A1" },
  { id = "B1-C1", from = "B1", to = "C1" }, { id = "C1-B1", from = "C1", to = "B1" },
]
"#;

#[test]
fn a_plain_profile_is_explored_and_the_vehicle_is_driven_to_where_conversations_fit() {
    let bench = Bench::new();
    let profile = Profile {
        device: started_by_the_harness(),
        motion: true,
        ..Profile::default()
    };
    let profile = profile.text();
    let (before, rest) = profile.split_once("[layout]").unwrap();
    let (_, behind) = rest.split_once("[time]").unwrap();
    let profile = format!("{before}[layout]{LINE}[time]{behind}");
    fs::write(bench.path().join("device.toml"), profile).unwrap();
    let explore = [
        "explore",
        "--profile",
        "device.toml",
        "--focus",
        "order-open",
        "--focus",
        "pick",
    ];
    let rest = [
        "--conversations",
        "2",
        "--length",
        "2",
        "--seed",
        "1",
        "--format",
        "json",
    ];
    let explored = bench.run(&[&explore[..], &rest].concat()).code(0);
    let explored: Value = serde_json::from_str(&explored.stdout).unwrap();
    assert_eq!(explored["conversations"], 2, "{explored}");
    assert_eq!(explored["undecided"], 0, "{explored}");
    assert!(explored["findings"].as_array().unwrap().is_empty(), "{explored}");
    let left_out = explored["leftOut"].as_array().unwrap();
    let is_left_out = |name: &str| left_out.iter().any(|one| one["stimulus"] == name);
    assert!(is_left_out("pick") && !is_left_out("order-open"), "{explored}");
    let report = bench.path().join(explored["report"].as_str().unwrap());
    let journal = fs::read_to_string(report.join("journal.jsonl")).unwrap();
    assert!(
        journal.contains("the vehicle is driven to node"),
        "it stood in the middle of a line"
    );
}
