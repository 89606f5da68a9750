//! `migrate`: what a device has to change to speak a later version, from the bundle of a run and from recordings.

use std::fs;

use serde_json::Value;

use crate::bench::{Bench, QUICK, bundles};
use crate::tool::{Ended, run};

/// The version it is about.
const TO: &str = "3.0.0";

fn json(ended: &Ended) -> Value {
    serde_json::from_str(&ended.stdout).unwrap()
}

fn capture(name: &str) -> String {
    format!("{}/fixtures/captures/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn the_bundle_of_a_run_says_what_its_device_has_to_change() {
    let bench = Bench::new();
    bench
        .run(&["run", "--virtual", QUICK, "--seed", "1", "--quiet", "--out", "archive"])
        .code(0);
    let bundle = bundles(&bench.path().join("archive")).pop().unwrap();
    let bundle = bundle.to_string_lossy();
    let papers = ["--as", "html=migration.html", "--as", "markdown=migration.md"];
    let asked = ["migrate", &bundle, "--to", TO];
    let text = bench.run(&[&asked[..], &papers].concat()).code(0).stdout;
    for part in [
        "from VDA 5050 2.1.0 to 3.0.0",
        "renamed  state agvPosition -> mobileRobotPosition, in ",
        "renamed  factsheet agvGeometry -> mobileRobotGeometry, in ",
        "state/operatingMode TEACHIN -> TEACH_IN, not in its messages",
        "\nGone\n",
        "\nChanged\n",
        "\nNew\n",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    for name in ["migration.html", "migration.md"] {
        let paper = fs::read_to_string(bench.path().join(name)).unwrap();
        assert!(
            paper.contains("mobileRobotPosition") && paper.contains("IACT-STATE-08"),
            "{name}"
        );
    }
    let whole = json(&bench.run(&[&asked[..], &["--format", "json"]].concat()).code(0));
    assert_eq!(whole["role"], "agv");
    assert_eq!(whole["from"], "2.1.0");
    assert!(whole["messages"].as_u64().unwrap() > 0 && whole["recordings"][0]["sha256"].is_string());
    let rows = whole["requirements"].as_array().unwrap();
    let row = |id: &str| rows.iter().find(|row| row["id"] == id).unwrap();
    let lists = row("IACT-STATE-08");
    assert_eq!(lists["change"], "new");
    assert_eq!(lists["then"], "fail");
    assert!(
        lists["monitors"]
            .as_array()
            .unwrap()
            .contains(&"message/schema-of-robots".into())
    );
    let gone = row("CONN-04");
    assert!(gone["before"]["text"].is_string() && gone["after"].is_null() && gone["why"].is_string());
    let changed = rows.iter().filter(|row| row["change"] == "changed");
    for row in changed {
        assert!(
            row["before"]["text"].is_string() && row["after"]["text"].is_string(),
            "{row}"
        );
    }
}

#[test]
fn of_a_recording_one_device_is_meant() {
    let site = capture("two-versions.jsonl");
    run(&["migrate", &site, "--to", TO])
        .code(2)
        .says("the recording has 2 vehicles")
        .says("--vehicle");
    let one = |more: &[&str]| run(&[&["migrate", &site, "--format", "json"][..], more].concat());
    let older = json(&one(&["--vehicle", "mock-0", "--to", "2.1"]).code(0));
    assert_eq!(older["from"], "2.0.0");
    assert_eq!(older["to"], "2.1.0");
    assert_eq!(older["device"], "vda5050-tck/mock-0");
    one(&["--vehicle", "mock-1", "--to", "2.1"])
        .code(2)
        .says("it speaks VDA 5050 2.1.0, which is not earlier than 2.1.0");
    let fleet = json(&one(&["--vehicle", "mock-1", "--role", "master-control", "--to", TO]).code(0));
    let members = fleet["members"].as_array().unwrap();
    let ends = members
        .iter()
        .find(|member| member["before"] == "edges/*/startNodeId")
        .unwrap();
    assert_eq!(ends["kind"], "gone");
    assert!(ends["messages"].as_u64().unwrap() > 0, "{ends}");
    one(&["--vehicle", "nobody", "--to", TO]).code(4);
    one(&["--vehicle", "mock-1", "--to", "9.0"])
        .code(2)
        .says("known versions");
}
