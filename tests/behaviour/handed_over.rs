//! Single messages, layouts and recordings as people hand them over: all that is wrong with one is named at once, what only
//! looks like a slip is a hint, and what is not read is refused with its reason.

use std::fs;

use serde_json::Value;

use crate::bench::Bench;
use crate::tool::{Ended, run};

fn handed(name: &str) -> String {
    format!("{}/fixtures/handed-over/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// What `validate` says of a file: its lines without the name of the file.
fn validated(name: &str, code: i32) -> Vec<String> {
    let file = handed(name);
    let ended = run(&["validate", &file]).code(code);
    ended.stdout.lines().map(|line| line.replace(&file, "")).collect()
}

/// The lines that say what is wrong, or what is seldom.
fn found(lines: &[String]) -> Vec<&str> {
    let is_found = |line: &&String| {
        ["FAIL", "WARN", "HINT"]
            .iter()
            .any(|word| line.contains(&format!(" {word} ")))
    };
    lines.iter().filter(is_found).map(String::as_str).collect()
}

fn result(ended: &Ended) -> Value {
    serde_json::from_str(&ended.stdout).unwrap()
}

/// A message as a line of a recording.
fn recorded(topic: &str, file: &str) -> String {
    let payload: Value = serde_json::from_str(&fs::read_to_string(handed(file)).unwrap()).unwrap();
    let time = "2026-05-18T12:00:00.00Z";
    serde_json::json!({ "tst": time, "topic": format!("uagv/v2/ACME/0001/{topic}"), "qos": 0, "retain": 0,
        "payload": payload })
    .to_string()
}

#[test]
fn everything_that_is_missing_is_named_at_once() {
    let lines = validated("several-missing.json", 2);
    for name in ["version", "manufacturer", "orderUpdateId", "nodeStates", "edgeStates"] {
        let wanted = format!("FAIL state/{name}: `{name}` is missing");
        assert_eq!(
            lines.iter().filter(|line| line.ends_with(&wanted)).count(),
            1,
            "{lines:#?}"
        );
    }
    let bench = Bench::new();
    fs::write(
        bench.path().join("one.jsonl"),
        recorded("state", "several-missing.json"),
    )
    .unwrap();
    let audited = bench.run(&["audit", "one.jsonl", "--protocol", "2.1.0"]).code(1);
    for name in ["version", "manufacturer", "orderUpdateId", "nodeStates", "edgeStates"] {
        let wanted = format!("state/{name}: `{name}` is missing");
        assert!(audited.stdout.contains(&wanted), "{}", audited.stdout);
    }
}

#[test]
fn one_mistake_is_one_finding_by_the_place_where_it_stands() {
    let will = validated("will-of-1970.json", 2);
    assert_eq!(found(&will).len(), 1, "{will:#?}");
    assert!(
        will[0].starts_with(":3:15: FAIL connection/timestamp: 0 is"),
        "{will:#?}"
    );
    assert!(will[1].contains("HDR-03") && will[1].contains("JSON-06"), "{will:#?}");
    let singular = validated("action-singular.json", 2);
    let wanted = ":34:3: FAIL order/edges/0/actions: `actions` is missing, and \"action\" stands there";
    assert_eq!(found(&singular), [wanted]);
    assert!(singular[1].contains("ORD-MSG-06"), "{singular:#?}");
}

#[test]
fn what_is_seldom_is_a_warning_and_what_one_message_shows_is_found() {
    let charge = validated("charge-of-105.json", 0);
    assert!(
        found(&charge)[0].contains("WARN state/batteryState/batteryCharge: 105.3"),
        "{charge:#?}"
    );
    assert!(charge[1].contains("STATE-MSG-15"), "{charge:#?}");
    let curve = validated("curve-beside-nodes.json", 2);
    assert!(curve.iter().any(|line| line.contains("ORD-MSG-30")), "{curve:#?}");
    assert_eq!(found(&curve).len(), 1, "{curve:#?}");
    let bench = Bench::new();
    for (topic, file, code, requirement) in [
        ("state", "charge-of-105.json", 0, "STATE-MSG-15"),
        ("order", "curve-beside-nodes.json", 1, "ORD-MSG-30"),
    ] {
        fs::write(bench.path().join("one.jsonl"), recorded(topic, file)).unwrap();
        bench.run(&["audit", "one.jsonl"]).code(code).prints(requirement);
    }
}

#[test]
fn a_slip_that_is_allowed_is_a_hint_and_no_failure() {
    let lines = validated("cancel-misspelled.json", 0);
    let wanted = ":10:18: HINT `canceOrder` is no action of the protocol: did you mean `cancelOrder`?";
    assert_eq!(found(&lines), [wanted]);
    let bench = Bench::new();
    fs::write(
        bench.path().join("one.jsonl"),
        recorded("instantActions", "cancel-misspelled.json"),
    )
    .unwrap();
    let audited = bench.run(&["audit", "one.jsonl", "--format", "json"]).code(0);
    let hint = &result(&audited)["vehicles"][0]["hints"][0];
    assert_eq!(
        (&hint["pointer"], &hint["count"]),
        (&"/actions/0/actionType".into(), &1.into()),
        "{hint}"
    );
    bench
        .run(&["audit", "one.jsonl"])
        .code(0)
        .prints("did you mean `cancelOrder`?");
}

#[test]
fn what_is_wrapped_or_in_another_form_is_refused_with_its_reason() {
    let bench = Bench::new();
    run(&["validate", &handed("factsheet-wrapped.json")])
        .code(2)
        .prints("FAIL the members of the factsheet lie inside `factsheet`");
    let state = fs::read_to_string(handed("charge-of-105.json")).unwrap();
    let state: Value = serde_json::from_str(&state).unwrap();
    for (wrapped, wanted) in [
        (
            serde_json::json!({ "data": state }),
            "the members of the state lie inside `data`",
        ),
        (
            serde_json::json!({ "all": [state] }),
            "the members of the state lie inside `all`",
        ),
        (
            serde_json::json!({ "body": state.to_string() }),
            "lie inside `body`, as a text",
        ),
    ] {
        fs::write(bench.path().join("wrapped.json"), wrapped.to_string()).unwrap();
        bench.run(&["validate", "wrapped.json"]).code(2).prints(wanted);
    }
    run(&["validate", &handed("wide.json")]).code(2).prints("is UTF-16");
    fs::write(bench.path().join("packed.json"), [0x1f, 0x8b, 8, 0, 0, 0]).unwrap();
    bench
        .run(&["validate", "packed.json"])
        .code(2)
        .prints("is packed with gzip");
    run(&["validate", &handed("lif-2.json")])
        .code(2)
        .prints("no node has vehicleTypeNodeProperties");
    let bench = Bench::new();
    let later = fs::read_to_string(handed("lif-2.json"))
        .unwrap()
        .replace("2.0.0", "3.0.0");
    fs::write(bench.path().join("lif-3.json"), later).unwrap();
    bench
        .run(&["validate", "lif-3.json"])
        .code(2)
        .prints("a layout of LIF 3.0.0; LIF 1.0 is read, and drafts of LIF 2");
}

#[test]
fn a_curve_of_a_layout_that_begins_beside_its_node_is_named() {
    let lines = validated("curve-of-layout.lif.json", 0);
    assert!(
        lines.iter().any(|line| line.contains("begins 5.0 m from node `N1`")),
        "{lines:#?}"
    );
    assert!(
        lines
            .iter()
            .any(|line| line.contains("go into orders as far as its factsheet lists them")),
        "{lines:#?}"
    );
}

#[test]
fn topics_that_are_nearly_right_below_a_known_vehicle_are_named() {
    let file = handed("topics-misnamed.jsonl");
    let ended = run(&["audit", &file]).code(1);
    for name in ["orders", "instantactions"] {
        let wanted = format!("the last level of \"fleet/v2/ACME/0001/{name}\" is no topic name");
        assert!(ended.stdout.contains(&wanted), "{}", ended.stdout);
    }
    assert!(ended.stdout.contains("TOPIC-01"), "{}", ended.stdout);
    // What the vendor publishes beside the right topics is its own affair.
    let bench = Bench::new();
    let text = fs::read_to_string(&file).unwrap();
    let right = text
        .replace("/orders\"", "/order\"")
        .replace("/instantactions\"", "/instantActions\"");
    let more = right.replace("/order\"", "/orders\"");
    let more: String = more.lines().filter(|line| line.contains("/orders\"")).collect();
    fs::write(
        bench.path().join("both.jsonl"),
        format!("{}\n{more}\n", right.trim_end()),
    )
    .unwrap();
    let both = bench.run(&["audit", "both.jsonl", "--only", "TOPIC-01"]);
    assert!(!both.stdout.contains("is no topic name"), "{}", both.stdout);
    let sliced = run(&["audit", &file, "--slice", "TOPIC-01"]).code(1);
    fs::write(bench.path().join("slice.jsonl"), &sliced.stdout).unwrap();
    bench.run(&["audit", "slice.jsonl"]).code(1).prints("TOPIC-01");
}

#[test]
fn a_recording_that_says_nothing_of_what_was_stored_is_judged_as_one_that_does() {
    let bench = Bench::new();
    let whole = format!("{}/fixtures/captures/one-idle-state.jsonl", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(whole).unwrap();
    let bare = text.lines().map(|line| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        line.as_object_mut().unwrap().remove("retain");
        format!("{line}\n")
    });
    fs::write(bench.path().join("bare.jsonl"), bare.collect::<String>()).unwrap();
    bench
        .run(&["audit", "bare.jsonl"])
        .code(1)
        .prints("STATE-12")
        .prints("NODE-03");
    // What was written long before it came may come from the store of the broker.
    let late = text.lines().map(|line| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        line.as_object_mut().unwrap().remove("retain");
        let later = line["tst"].as_str().unwrap().replace("2026-", "2027-");
        line["tst"] = later.into();
        format!("{line}\n")
    });
    fs::write(bench.path().join("late.jsonl"), late.collect::<String>()).unwrap();
    let late = bench.run(&["audit", "late.jsonl", "--format", "json"]);
    assert_eq!(result(&late)["vehicles"][0]["retained"], 3, "{}", late.stdout);
}

#[test]
fn a_version_of_two_numbers_is_said_once() {
    let ended = run(&["audit", &handed("version-of-two-numbers.jsonl")]).code(1);
    assert_eq!(ended.stdout.matches("HDR-04").count(), 1, "{}", ended.stdout);
    assert!(
        ended.stdout.contains("HDR-04 header/version, 3 times"),
        "{}",
        ended.stdout
    );
}

#[test]
fn an_audit_is_evidence_like_a_run() {
    let bench = Bench::new();
    let good = format!("{}/fixtures/captures/two-versions.jsonl", env!("CARGO_MANIFEST_DIR"));
    let bad = format!("{}/fixtures/captures/horizon-missing.jsonl", env!("CARGO_MANIFEST_DIR"));
    fs::copy(&bad, bench.path().join("site.jsonl")).unwrap();
    bench
        .run(&["audit", "site.jsonl", "--out", "monday"])
        .code(1)
        .says("root hash sha256:");
    bench
        .run(&["report", "--verify", "monday"])
        .code(0)
        .prints("intact: root")
        .prints("recording site.jsonl: as it was");
    bench.run(&["audit", "site.jsonl", "--out", "tuesday"]).code(1);
    bench
        .run(&["report", "--compare", "monday", "tuesday"])
        .code(0)
        .prints("both are about the same recordings");
    bench.run(&["audit", &good, "--out", "before"]).code(0);
    let worse = bench.run(&["report", "--compare", "before", "monday"]).code(1);
    assert!(worse.stdout.contains("agv: STATE-12"), "{}", worse.stdout);
    for (kind, wanted) in [
        ("junit", "type=\"STATE-12\""),
        ("markdown", "STATE-12"),
        ("code-quality", "\"check_name\": \"STATE-12\""),
        ("sarif", "\"ruleId\": \"STATE-12\""),
    ] {
        bench.run(&["report", "--as", kind, "monday"]).code(0).prints(wanted);
    }
    bench.run(&["report", "monday"]).code(1).prints("STATE-12");
    bench
        .run(&["report", "--rejudge", "monday"])
        .code(2)
        .says("--verify, --compare and --as");
    // The slice says what it is a part of.
    let sliced = bench.run(&["audit", "site.jsonl", "--slice", "STATE-12"]).code(1);
    let first: Value = serde_json::from_str(sliced.stdout.lines().next().unwrap()).unwrap();
    let origin = first.to_string();
    let saved: Value =
        serde_json::from_str(&fs::read_to_string(bench.path().join("monday/result.json")).unwrap()).unwrap();
    let hash = saved["recordings"][0]["sha256"].as_str().unwrap();
    for wanted in [hash, "site.jsonl", "\"places\":[", "STATE-12"] {
        assert!(origin.contains(wanted), "{wanted}: {origin}");
    }
    // What was changed since is named.
    fs::write(bench.path().join("site.jsonl"), "\n").unwrap();
    bench
        .run(&["report", "--verify", "monday"])
        .code(1)
        .prints("recording site.jsonl: changed since it was judged");
    fs::remove_file(bench.path().join("site.jsonl")).unwrap();
    bench.run(&["report", "--verify", "monday"]).code(0).prints("not there");
    let path = bench.path().join("monday/result.json");
    let text = fs::read_to_string(&path).unwrap().replace("\"fail\"", "\"pass\"");
    fs::write(&path, text).unwrap();
    bench
        .run(&["report", "--verify", "monday"])
        .code(1)
        .prints("changed  result.json");
    bench.run(&["report", "--as", "junit", "monday"]).code(2);
}

#[test]
fn names_and_places_can_be_left_out_of_what_is_handed_on() {
    let bench = Bench::new();
    let bad = format!("{}/fixtures/captures/horizon-missing.jsonl", env!("CARGO_MANIFEST_DIR"));
    assert!(fs::read_to_string(&bad).unwrap().contains("/reference-agv/state"));
    let redacted = bench
        .run(&["audit", &bad, "--redact", "--out", "out", "--slice", "STATE-12"])
        .code(1);
    let saved = |name: &str| fs::read_to_string(bench.path().join("out").join(name)).unwrap();
    for written in [
        redacted.stdout.clone(),
        saved("result.json"),
        saved("report.html"),
        saved("junit.xml"),
    ] {
        assert!(!written.contains("reference-agv"), "{written}");
        assert!(written.contains("STATE-12"), "{written}");
    }
    fs::write(bench.path().join("slice.jsonl"), &redacted.stdout).unwrap();
    bench
        .run(&["audit", "slice.jsonl"])
        .code(1)
        .prints("maker-1 vehicle-1")
        .prints("STATE-12");
}
