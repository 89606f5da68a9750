//! A version that devices are judged by as far as its tests go: messages, both sides, what changed on the way to it.

use std::fs;

use serde_json::{Value, json};

use crate::bench::{Bench, MANUFACTURER, Profile, QUICK, SERIAL};
use crate::scripted::Scripted;
use crate::tool::{run, run_in};

/// The version.
const VERSION: &str = "3.0.0";

fn good(name: &str) -> Value {
    let path = format!("{}/fixtures/messages/3.0/good/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn objects(stdout: &str) -> Vec<Value> {
    stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn messages_of_all_eight_topics_are_judged_and_told_by_their_members() {
    let bench = Bench::new();
    for topic in [
        "order",
        "instantActions",
        "state",
        "visualization",
        "connection",
        "factsheet",
        "zoneSet",
        "responses",
    ] {
        let name = match topic {
            "connection" => "connection-online".to_owned(),
            "instantActions" => "instantActions-several".to_owned(),
            "responses" => "responses-several".to_owned(),
            "state" => "state-driving".to_owned(),
            _ => format!("{topic}-full"),
        };
        let mut message = good(&name);
        fs::write(bench.path().join("good.json"), message.to_string()).unwrap();
        let ended = run_in(bench.path(), &["validate", "good.json"]).code(0);
        let said = format!("a valid {topic} message of VDA 5050 {VERSION}");
        assert!(ended.stdout.contains(&said), "{topic}: {}", ended.stdout);
        message.as_object_mut().unwrap().remove("headerId");
        fs::write(bench.path().join("broken.json"), message.to_string()).unwrap();
        let ended = run_in(bench.path(), &["validate", "broken.json"]).code(2);
        assert!(ended.stdout.contains("HDR-01"), "{topic}: {}", ended.stdout);
    }
}

#[test]
fn a_broken_member_names_the_requirement_in_the_words_of_the_version() {
    let bench = Bench::new();
    let judged = |message: &Value| {
        fs::write(bench.path().join("message.json"), message.to_string()).unwrap();
        run_in(bench.path(), &["validate", "message.json"]).code(2).stdout
    };
    let mut zones = good("zoneSet-full");
    zones["zoneSet"]["zones"][5]
        .as_object_mut()
        .unwrap()
        .remove("maximumSpeed");
    let found = judged(&zones);
    assert!(found.contains("ZSET-20") && found.contains("maximumSpeed"), "{found}");
    let mut state = good("state-driving");
    state["operatingMode"] = "TEACHIN".into();
    let found = judged(&state);
    assert!(found.contains("MODE-01") && found.contains("INTERVENED"), "{found}");
    assert!(found.contains("did you mean `TEACH_IN`?"), "{found}");
    let mut responses = good("responses-several");
    responses["responses"][0]["leaseExpiry"] = "2026-03-02T08:16:30.000Z".into();
    assert!(judged(&responses).contains("REQ-05"), "a lease belongs to a grant");
}

#[test]
fn either_reading_of_what_is_disputed_is_right_and_named() {
    let bench = Bench::new();
    let mut sheet = good("factsheet-full");
    let kind = sheet["typeSpecification"].as_object_mut().unwrap();
    let kinematics = kind.shift_remove("mobileRobotKinematics").unwrap();
    kind.insert("mobileRobotKinematic".to_owned(), kinematics);
    sheet["protocolFeatures"]["mobileRobotActions"][0]["pauseAllowed"] = "true".into();
    fs::write(bench.path().join("sheet.json"), sheet.to_string()).unwrap();
    let ended = run_in(bench.path(), &["validate", "sheet.json"]).code(0);
    assert!(
        ended
            .stdout
            .contains("HINT disputed, and right: the member is called mobileRobotKinematic, as in"),
        "{}",
        ended.stdout
    );
    assert!(
        ended
            .stdout
            .contains("HINT disputed, and right: flags of actions are texts, as in"),
        "{}",
        ended.stdout
    );
    sheet["protocolFeatures"]["mobileRobotActions"][0]["pauseAllowed"] = "yes".into();
    fs::write(bench.path().join("sheet.json"), sheet.to_string()).unwrap();
    let ended = run_in(bench.path(), &["validate", "sheet.json"]).code(2);
    assert!(ended.stdout.contains("FACT-07"), "{}", ended.stdout);
}

#[test]
fn a_recording_is_judged_message_by_message() {
    let bench = Bench::new();
    let line = |second: u32, name: &str, message: &Value| {
        let topic = format!("vda5050/v3/RobotCompany/KIT-0001/{name}");
        json!({ "tst": format!("2026-03-02T08:15:{second:02}.000Z"), "topic": topic, "payload": message }).to_string()
    };
    let state = |id: u64| {
        let mut state = good("state-driving");
        state["headerId"] = id.into();
        state["timestamp"] = format!("2026-03-02T08:15:{id:02}.000Z").into();
        state
    };
    let mut zones = good("zoneSet-full");
    zones["timestamp"] = "2026-03-02T08:15:32.000Z".into();
    let mut last = state(34);
    last["powerSupply"]["batteryHealth"] = json!(98.5);
    let lines = |broken: bool| {
        let mut middle = state(33);
        if broken {
            middle["zoneRequests"][0].as_object_mut().unwrap().remove("trajectory");
        }
        [
            line(31, "state", &state(31)),
            line(32, "state", &state(32)),
            line(32, "zoneSet", &zones),
            line(33, "state", &middle),
            line(34, "state", &last),
        ]
        .join("\n")
    };
    fs::write(bench.path().join("site.jsonl"), lines(true)).unwrap();
    let ended = run_in(bench.path(), &["audit", "site.jsonl"]).code(1);
    assert!(
        ended.stdout.contains(VERSION) && ended.stdout.contains("ZREQ-07"),
        "{}",
        ended.stdout
    );
    assert!(ended.stdout.contains("disputed, and right"), "{}", ended.stdout);
    fs::write(bench.path().join("site.jsonl"), lines(false)).unwrap();
    run_in(bench.path(), &["audit", "site.jsonl"]).code(0);
}

#[test]
fn the_reference_fleet_control_passes_what_its_tests_decide() {
    let bench = Bench::new();
    let fleet = ["--protocol", VERSION, "--role", "master-control"];
    let words = |command: &[&'static str], test: &'static str| -> Vec<&'static str> {
        let command: Vec<&str> = command.to_vec();
        command.into_iter().chain(fleet).chain([test]).collect()
    };
    run_in(bench.path(), &words(&["run", "--virtual"], "dispatch/one-edge")).code(0);
    let faulty = ["run", "--virtual", "--fault", "instant-action-blocks-all"];
    let ended = run_in(bench.path(), &words(&faulty, "cancel/instant-action")).code(1);
    assert!(ended.stdout.contains("IACT-08"), "{}", ended.stdout);
}

#[test]
fn the_reference_robot_passes_what_its_tests_decide() {
    let bench = Bench::new();
    let ended = run_in(bench.path(), &["run", "--virtual", "--protocol", VERSION]);
    let ended = ended.code(0);
    assert!(
        ended.stdout.contains("pass") || ended.stderr.contains("pass"),
        "{}",
        ended.stdout
    );
    let faulty = [
        "run",
        "--virtual",
        "--protocol",
        VERSION,
        "--fault",
        "cancels-whatever-order",
        "cancel-order/another-by-name",
    ];
    run_in(bench.path(), &faulty).code(1);
}

#[test]
fn the_catalogue_knows_it() {
    let all = objects(
        &run(&["list", "requirements", "--protocol", VERSION, "--format", "json"])
            .code(0)
            .stdout,
    );
    // Of 608 eleven bind neither side.
    assert_eq!(all.len(), 597);
    let topics = all.iter().find(|one| one["id"] == "TOPIC-01").unwrap();
    assert!(topics["text"].as_str().unwrap().contains("zoneSet"), "{topics}");
    let coverage = objects(
        &run(&["list", "coverage", "--protocol", VERSION, "--format", "json"])
            .code(0)
            .stdout,
    );
    let total = |role: &Value| {
        let counts = ["decided", "operator", "notTestable"].map(|name| role[name].as_u64().unwrap());
        counts.iter().sum::<u64>() + role["uncovered"].as_array().unwrap().len() as u64
    };
    // 457 of the robot and 104 of the fleet control, and 36 of both.
    assert_eq!(coverage.iter().map(total).collect::<Vec<_>>(), [493, 140]);
    assert!(
        coverage.iter().all(|role| role["decided"].as_u64().unwrap() > 25),
        "{coverage:?}"
    );
    let explained = run(&["explain", "ZSET-20", "--protocol", VERSION]).code(0).stdout;
    assert!(
        explained.contains("VDA 5050 3.0") && explained.contains("message/schema-of-fleet-control"),
        "{explained}"
    );
}

#[test]
fn what_became_of_requirements_is_listed_with_both_sentences() {
    let text = run(&["list", "requirements", "--changes", "2.1.0..3.0.0"])
        .code(0)
        .stdout;
    let first = text.lines().next().unwrap();
    assert!(first.starts_with("VDA 5050 2.1.0 to 3.0.0: "), "{first}");
    for heading in ["\ngone\n", "\nchanged\n", "\nreworded\n", "\nnew\n"] {
        assert!(text.contains(heading), "{heading}");
    }
    assert!(!text.contains("\nsame\n"));
    let objects = objects(
        &run(&["list", "requirements", "--changes", "2.1..3.0", "--format", "json"])
            .code(0)
            .stdout,
    );
    let one = |id: &str| objects.iter().find(|one| one["id"] == id).unwrap();
    assert_eq!(one("CONN-04")["change"], "gone");
    assert!(one("CONN-04")["after"].is_null() && one("CONN-04")["why"].is_string());
    let renamed = one("ORD-REJ-12");
    assert!(
        renamed["before"]["text"].as_str().unwrap().contains("orderUpdateError"),
        "{renamed}"
    );
    assert!(
        renamed["after"]["text"]
            .as_str()
            .unwrap()
            .contains("OUTDATED_ORDER_UPDATE"),
        "{renamed}"
    );
    assert_eq!(one("HIB-01")["change"], "new");
    let of_fleet = [
        "list",
        "requirements",
        "--changes",
        "2.0..2.1",
        "--role",
        "master-control",
    ];
    assert!(
        run(&of_fleet)
            .code(0)
            .stdout
            .starts_with("VDA 5050 2.0.0 to 2.1.0: 0 gone")
    );
    run(&["list", "requirements", "--changes", "3.0..2.1"])
        .code(2)
        .says("is not later than");
    run(&["list", "requirements", "--changes", "2.1"])
        .code(2)
        .says("is no range of versions");
    run(&["list", "tests", "--changes", "2.1..3.0"])
        .code(2)
        .says("list requirements");
}

#[test]
fn a_device_that_speaks_it_and_is_judged_by_another_version_is_told_so_in_one_sentence() {
    let bench = Bench::new();
    let mut state = good("state-idle");
    state["manufacturer"] = MANUFACTURER.into();
    state["serialNumber"] = SERIAL.into();
    let (run, port) = bench.start(&Profile::default(), &[QUICK]);
    let mut device = Scripted::online(port);
    device.publish("state", state.to_string().as_bytes(), false);
    let sentence = format!("the device speaks VDA 5050 {VERSION} (see #");
    run.end().code(2).says(&sentence).says("was to be judged by 2.1.0");
    assert_eq!(bench.result()["verdict"], Value::Null);

    let line = |second: u32| {
        let topic = "vda5050/v3/RobotCompany/KIT-0001/state";
        json!({ "tst": format!("2026-03-02T08:15:{second:02}.000Z"), "topic": topic, "payload": good("state-idle") })
    };
    let lines: Vec<String> = (31..35).map(|second| line(second).to_string()).collect();
    fs::write(bench.path().join("site.jsonl"), lines.join("\n")).unwrap();
    let ended = run_in(bench.path(), &["audit", "site.jsonl", "--protocol", "2.1.0"]).code(3);
    let sentence = format!("it speaks version {VERSION} and was to be judged by 2.1.0");
    assert!(ended.stdout.contains(&sentence), "{}", ended.stdout);
    assert!(!ended.stdout.contains("FAIL"), "{}", ended.stdout);
}
