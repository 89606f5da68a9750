//! What was seen and what was declared: message coverage, and the profile of a run that is run again.

use std::fs;

use serde_json::Value;

use crate::bench::{Bench, Profile, QUICK, REFUSAL};
use crate::tool::{Running, tool};

/// A vehicle that says one word all the time, as one line a message.
fn recorded() -> String {
    let line = |number: usize| {
        let timestamp = format!("2026-11-27T08:00:{number:02}.00Z");
        let payload = serde_json::json!({
            "headerId": number, "timestamp": timestamp, "version": "2.1.0", "manufacturer": "ACME", "serialNumber": "1",
            "orderId": "", "orderUpdateId": 0, "lastNodeId": "", "lastNodeSequenceId": 0, "driving": false,
            "nodeStates": [], "edgeStates": [], "actionStates": [], "errors": [], "operatingMode": "MANUAL",
            "batteryState": { "batteryCharge": 80.0, "charging": false },
            "safetyState": { "eStop": "NONE", "fieldViolation": false }, "ownMember": 1,
        });
        let message = serde_json::json!({ "tst": timestamp, "topic": "uagv/v2/ACME/1/state", "payload": payload });
        format!("{message}\n")
    };
    (0..5).map(line).collect()
}

fn topic<'a>(coverage: &'a Value, name: &str) -> &'a Value {
    let mut topics = coverage["topics"].as_array().unwrap().iter();
    topics.find(|topic| topic["topic"] == name).unwrap()
}

#[test]
fn a_run_says_what_was_shown_and_its_journal_says_it_again() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", QUICK, REFUSAL]).code(0);
    let bundle = bench.bundle();
    let result = bench.result();
    let coverage = &result["message_coverage"];
    let state = topic(coverage, "state");
    let member = |name: &str| {
        let mut all = state["members"].as_array().unwrap().iter();
        all.find(|member| member["member"] == name).unwrap()
    };
    assert_eq!(member("/operatingMode")["messages"], state["messages"]);
    assert!(member("/operatingMode")["words"]["AUTOMATIC"].as_u64().unwrap() > 0);
    assert_eq!(member("/operatingMode")["words"]["TEACHIN"], 0);
    assert_eq!(member("/headerId")["mandatory"], true);
    let mut actions = coverage["actions"].as_array().unwrap().iter();
    let asked = actions.find(|known| known["action"] == "factsheetRequest").unwrap();
    assert!(
        asked["sent"].as_u64().unwrap() > 0 && asked["reported"].as_u64().unwrap() > 0,
        "{asked}"
    );
    let page = fs::read_to_string(bundle.join("report.html")).unwrap();
    assert!(page.contains("Message coverage") && page.contains("TEACHIN"));
    let shown = bundle.display().to_string();
    bench
        .run(&["report", &shown, "--rejudge"])
        .code(0)
        .prints("byte for byte");
    bench
        .run(&["report", &shown, "--profile"])
        .code(2)
        .says("there is no profile in");
}

#[test]
fn an_audit_says_what_nobody_has_seen_and_what_is_undecided_for_it() {
    let bench = Bench::new();
    fs::write(bench.path().join("site.jsonl"), recorded()).unwrap();
    let audited = bench.run(&["audit", "site.jsonl", "--format", "json"]);
    let audited: Value = serde_json::from_str(&audited.stdout).unwrap_or_else(|error| panic!("{error}: {audited:?}"));
    let coverage = &audited["vehicles"][0]["messageCoverage"];
    let state = topic(coverage, "state");
    let never: Vec<&str> = state["members"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|member| member["messages"] == 0)
        .map(|member| member["member"].as_str().unwrap())
        .collect();
    assert!(
        never.contains(&"/agvPosition") && !never.contains(&"/driving"),
        "{never:?}"
    );
    assert_eq!(state["others"], serde_json::json!(["/ownMember"]));
    assert_eq!(topic(coverage, "factsheet")["messages"], 0);
    let undecided = coverage["undecided"].to_string();
    assert!(undecided.contains(r#"{"topic":"factsheet"}"#), "{undecided}");
}

#[test]
fn the_profile_of_a_run_is_run_again() {
    let bench = Bench::new();
    let profile = Profile {
        more: "[hooks.power-cycle]\nrun = [\"true\", \"--token\", \"s3cret\"]\n".to_owned(),
        ..Profile::default()
    };
    let (run, port) = bench.start(&profile, &[QUICK]);
    let device = bench.agv(port, &[]);
    run.end().code(0);
    drop(device);
    let shown = bench.bundle().display().to_string();
    let written = bench.run(&["report", &shown, "--profile"]).code(0).stdout;
    assert!(!written.contains("s3cret"), "{written}");
    assert!(written.contains("# hooks.power-cycle is not written here"), "{written}");
    fs::rename(bench.path().join("reports"), bench.path().join("before")).unwrap();
    fs::write(bench.path().join("again.toml"), &written).unwrap();
    let mut again = Running::start(&mut tool(bench.path(), &["run", "--profile", "again.toml", QUICK]));
    let address = again.line("the device is expected at mqtt://");
    let port = address.rsplit(':').next().unwrap().parse().unwrap();
    let _device = bench.agv(port, &[]);
    again.end().code(0);
    let shown = bench.bundle().display().to_string();
    let once_more = bench.run(&["report", &shown, "--profile"]).code(0).stdout;
    let values = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
        lines.map(str::to_owned).collect()
    };
    assert_eq!(values(&once_more), values(&written));
}

#[test]
fn a_run_says_how_long_the_harness_took_itself() {
    let bench = Bench::new();
    bench
        .run(&["run", QUICK])
        .code(0)
        .prints("harness       messages passed on in ");
    let result = bench.result();
    for what in ["passedOn", "judged"] {
        let spread = &result["harness_latency"][what];
        let micros = |name: &str| spread[name].as_u64().unwrap();
        assert!(spread["count"].as_u64().unwrap() > 1, "{spread}");
        assert!(
            micros("medianMicros") <= micros("p99Micros") && micros("p99Micros") <= micros("worstMicros"),
            "{spread}"
        );
        // Half a minute would be no measurement of this machine any more, but a mistake.
        assert!(micros("worstMicros") < 30_000_000, "{spread}");
    }
    let bundle = bench.bundle();
    let page = fs::read_to_string(bundle.join("report.html")).unwrap();
    assert!(page.contains("How long the harness took itself"));
    bench
        .run(&["report", &bundle.display().to_string(), "--rejudge"])
        .code(0)
        .prints("byte for byte");
}
