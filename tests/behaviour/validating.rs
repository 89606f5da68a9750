//! `validate` for messages: many at once, each judged by itself, and every finding in its place.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

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

/// The most memory that a process has had so far, in kilobytes; `None` when it is gone or nobody says.
fn peak(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().trim_end_matches("kB").trim().parse().ok()
}

/// Writes as many messages of one kilobyte, as lines or as an array.
fn write_many(path: &Path, count: usize, is_array: bool) {
    let mut file = std::io::BufWriter::new(fs::File::create(path).unwrap());
    // What cannot be told by its members is refused without being judged, which takes a moment of each.
    let message = serde_json::json!({ "text": "x".repeat(1_000) }).to_string();
    if is_array {
        file.write_all(b"[").unwrap();
    }
    for at in 0..count {
        let between = match (is_array, at) {
            (_, 0) => "",
            (true, _) => ",",
            (false, _) => "\n",
        };
        write!(file, "{between}{message}").unwrap();
    }
    if is_array {
        file.write_all(b"]").unwrap();
    }
}

#[test]
fn memory_does_not_grow_with_the_number_of_messages() {
    let bench = Bench::new();
    let mut peaks = Vec::new();
    for (name, is_array) in [("many.json", true), ("many.jsonl", false)] {
        for count in [100, 40_000] {
            write_many(&bench.path().join(name), count, is_array);
            let mut command = tool(bench.path(), &["validate", name, "--format", "json"]);
            command.stdout(std::process::Stdio::null());
            let mut child = command.spawn().unwrap();
            let mut most = 0;
            let status = loop {
                most = most.max(peak(child.id()).unwrap_or_default());
                match child.try_wait().unwrap() {
                    Some(status) => break status,
                    None => std::thread::sleep(Duration::from_millis(5)),
                }
            };
            assert_eq!(status.code(), Some(2), "{name}");
            peaks.push(most);
        }
    }
    if peaks.contains(&0) {
        eprintln!("skipped: nobody says how much memory a process has");
        return;
    }
    let (few, many) = (peaks[0].max(peaks[2]), peaks[1].max(peaks[3]));
    // The beginning of a file, of which up to 32 MiB are looked at, and some room.
    assert!(
        many < few + 160_000,
        "{few} kB of a few messages, {many} kB of 40 MB of them"
    );
}

#[test]
fn one_message_that_is_too_large_is_refused_where_it_stands_and_the_others_are_judged() {
    let bench = Bench::new();
    let mut large = good();
    large["information"] = vec![serde_json::json!({ "infoType": "x", "infoLevel": "INFO" }); 40_000].into();
    let mut wrong = good();
    wrong["operatingMode"] = "AUTO".into();
    let deep = format!("{{\"nodeStates\":{}{}}}", "[".repeat(500), "]".repeat(500));
    let all = [good().to_string(), large.to_string(), wrong.to_string(), deep];
    fs::write(bench.path().join("lines.jsonl"), all.join("\n")).unwrap();
    fs::write(bench.path().join("array.json"), format!("[{}]", all.join(",\n"))).unwrap();
    for name in ["lines.jsonl", "array.json"] {
        let ended = bench.run(&["validate", name, "--format", "json"]).code(2);
        let found = findings(&ended.stdout);
        let of = |line: u64| found.iter().filter(move |one| one["line"] == line);
        assert_eq!(of(1).count(), 0, "{name}");
        let refused = of(2).next().unwrap();
        assert!(
            refused["title"].as_str().unwrap().contains("1048576 are the most"),
            "{refused}"
        );
        assert!(refused["hint"].is_string() && refused["message"] == 2, "{refused}");
        assert!(of(3).any(|one| one["pointer"] == "/operatingMode"), "{name}");
        assert!(
            of(4).next().unwrap()["title"].as_str().unwrap().contains("not judged"),
            "{name}"
        );
        let last: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
        assert_eq!(
            (&last["messages"], &last["withViolations"]),
            (&4.into(), &3.into()),
            "{name}"
        );
    }
    fs::write(bench.path().join("alone.json"), large.to_string()).unwrap();
    bench
        .run(&["validate", "alone.json"])
        .code(2)
        .prints("alone.json:1:1: FAIL not judged: the message has");
    fs::write(bench.path().join("open.json"), format!("[{},\n{}", good(), good())).unwrap();
    bench
        .run(&["validate", "open.json"])
        .code(2)
        .prints("FAIL the array is not closed");
}

#[test]
fn own_suites_are_checked_with_their_own_requirements_actions_and_stimuli() {
    let own = fixture("own");
    let file = |name: &str| format!("{own}/{name}");
    let files = [
        file("requirements/SYS.yaml"),
        file("agv/sys/blinks.yaml"),
        file("agv/sys/keeps-the-number.yaml"),
        file("explore/agv/sys.yaml"),
    ];
    let [requirements, blinks, keeps, explore] = files.each_ref().map(String::as_str);
    let checked = run(&["validate", "--suites", &own, requirements, blinks, keeps, explore]).code(0);
    for what in ["a file of 4 requirements", "a test", "a file of 1 stimulus"] {
        assert!(checked.stdout.contains(what), "{}", checked.stdout);
    }
    run(&["validate", keeps]).code(2).prints("unknown requirement `SYS-12`");
    // One that the vehicle does not have makes the test not applicable, and what is nearly a known one is a slip.
    let planned = run(&["run", "--plan", "--suites", &own, "sys/*", "--format", "json"]).code(0);
    let planned: Value = serde_json::from_str(&planned.stdout).unwrap();
    let gates: Vec<&Value> = planned["tests"]
        .as_array()
        .unwrap()
        .iter()
        .map(|test| &test["gate"])
        .collect();
    assert_eq!(gates, ["not-applicable", "runs", "inconclusive"]);
    let folder = tempfile::tempdir().unwrap();
    let slip = fs::read_to_string(blinks)
        .unwrap()
        .replace("action blink ", "action startPuase ");
    fs::write(folder.path().join("slip.yaml"), slip).unwrap();
    run_in(folder.path(), &["validate", "--suites", &own, "slip.yaml"])
        .code(2)
        .prints("did you mean `startPause`?");
}

#[test]
fn mistakes_in_own_requirements_and_stimuli_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    let good = fs::read_to_string(fixture("own/requirements/SYS.yaml")).unwrap();
    write("SYS.yaml", &good.replace("mood: shall", "mood: must"));
    write(
        "explore/agv/lost.yaml",
        "blink: { title: It blinks, in: [nowhere], sends: \"\" }\n",
    );
    run_in(folder.path(), &["validate", "SYS.yaml"])
        .code(2)
        .prints("`must` is not known for `mood`");
    run_in(folder.path(), &["validate", "explore/agv/lost.yaml"])
        .code(2)
        .prints("names the situation `nowhere`");
}
