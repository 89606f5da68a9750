//! `validate` for messages: many at once, each judged by itself, and every finding in its place.

use std::fs;

use serde_json::Value;

use crate::bench::Bench;
use crate::tool::{Running, run, run_in, tool};

fn fixture(name: &str) -> String {
    format!("{}/fixtures/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn good() -> Value {
    let text = fs::read_to_string(fixture("messages/2.1/good/state-idle.json")).unwrap();
    let mut state: Value = serde_json::from_str(&text).unwrap();
    state["timestamp"] = "2026-03-02T08:15:30.00Z".into();
    state
}

fn findings(stdout: &str) -> Vec<Value> {
    let lines = stdout.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.filter(|line| line.get("code").is_some()).collect()
}

#[test]
fn of_many_messages_each_finding_has_its_line_its_requirement_and_a_proposal() {
    let ended = run(&["validate", &fixture("captures/states.jsonl"), "--format", "json"]).code(2);
    let all = findings(&ended.stdout);
    let of_line = |line: u64| -> Vec<&Value> { all.iter().filter(|one| one["line"] == line).collect() };
    assert!(of_line(1).is_empty(), "{:?}", of_line(1));
    assert!(
        of_line(2)
            .iter()
            .all(|one| one["verdict"] == "warning" && one["pointer"] == "/timestamp")
    );
    let mode = of_line(3);
    assert!(!mode.is_empty());
    let line = fs::read_to_string(fixture("captures/states.jsonl")).unwrap();
    let line = line.lines().nth(2).unwrap().to_owned();
    for one in &mode {
        assert_eq!(one["pointer"], "/operatingMode", "{one}");
        assert_eq!(one["hint"], "did you mean `AUTOMATIC`?", "{one}");
        let column = usize::try_from(one["column"].as_u64().unwrap()).unwrap();
        assert!(line[column - 1..].starts_with("\"AUTOMATISCH\""), "{one}");
        assert!(!one["requirements"].as_array().unwrap().is_empty() && one["sentence"].is_string());
    }
    assert!(
        of_line(4)
            .iter()
            .any(|one| one["pointer"] == "/driving" && one["verdict"] == "warning")
    );
    assert!(
        of_line(5)
            .iter()
            .any(|one| one["verdict"] == "fail" && one["column"].as_u64() > Some(1))
    );
    let last: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
    assert_eq!((&last["messages"], &last["withViolations"]), (&5.into(), &2.into()));
    let text = run(&["validate", &fixture("captures/states.jsonl")]).code(2);
    insta::with_settings!({ filters => vec![(r"\S*/fixtures/", "fixtures/")] }, {
        insta::assert_snapshot!(text.stdout);
    });
}

#[test]
fn what_a_message_alone_can_break_beyond_its_schema_is_found() {
    let bench = Bench::new();
    let text = fs::read_to_string(fixture("messages/2.1/good/order-full.json")).unwrap();
    let mut order: Value = serde_json::from_str(&text).unwrap();
    order["timestamp"] = "2026-03-02T08:15:30.00Z".into();
    order["edges"][0]["startNodeId"] = "nowhere".into();
    let mut twice = good();
    twice["operatingMode"] = "AUTO".into();
    fs::create_dir(bench.path().join("messages")).unwrap();
    fs::write(bench.path().join("messages/order.json"), order.to_string()).unwrap();
    fs::write(
        bench.path().join("messages/array.json"),
        serde_json::json!([good(), twice, good()]).to_string(),
    )
    .unwrap();
    let ended = bench.run(&["validate", "messages", "--format", "json"]).code(2);
    let all = findings(&ended.stdout);
    let order: Vec<&Value> = all.iter().filter(|one| one["file"] == "messages/order.json").collect();
    assert!(order.iter().any(|one| one["verdict"] == "fail"), "{order:?}");
    assert!(
        order.iter().all(|one| one["code"] != "message/schema-of-commands"),
        "{order:?}"
    );
    let array: Vec<&Value> = all.iter().filter(|one| one["file"] == "messages/array.json").collect();
    assert!(
        !array.is_empty() && array.iter().all(|one| one["message"] == 2),
        "{array:?}"
    );
}

#[test]
fn standard_input_is_judged_and_a_recording_is_sent_to_the_audit() {
    let bench = Bench::new();
    let line = serde_json::json!({ "topic": "a/v2/b/c/state", "payload": good() });
    fs::write(bench.path().join("recorded.json"), line.to_string()).unwrap();
    run_in(bench.path(), &["validate", "recorded.json"])
        .code(2)
        .prints("vda5050-tck audit");
    let many = format!("{}\n{}\n", good(), good());
    fs::write(bench.path().join("many"), many).unwrap();
    let mut piped = tool(bench.path(), &["validate", "-"]);
    piped.stdin(fs::File::open(bench.path().join("many")).unwrap());
    let ended = Running::start(&mut piped).end().code(0);
    assert!(
        ended.stdout.contains("2 messages, 0 with violations"),
        "{}",
        ended.stdout
    );
}
