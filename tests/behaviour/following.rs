//! Programs that follow a run or read what a command says.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::bench::{Bench, Profile, QUICK, REFUSAL};
use crate::tool::{Running, run, tool};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The lines of a stream, each held against the schema.
pub fn events(text: &str) -> Vec<Value> {
    let schema = fs::read_to_string(root().join("schemas/events.schema.json")).unwrap();
    let schema: Value = serde_json::from_str(&schema).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let events = text.lines().map(|line| {
        let event: Value = serde_json::from_str(line).unwrap();
        let wrong: Vec<String> = validator.iter_errors(&event).map(|error| error.to_string()).collect();
        assert!(wrong.is_empty(), "{line}\n{wrong:?}");
        event
    });
    events.collect()
}

fn names(events: &[Value]) -> Vec<&str> {
    events.iter().map(|event| event["event"].as_str().unwrap()).collect()
}

#[test]
fn a_run_is_followed_by_its_events_and_every_kind_is_documented() {
    let bench = Bench::new();
    let fault = ["--fault", "validation-error-fatal"];
    let ended = bench
        .run(&[&["run", "--virtual", QUICK, REFUSAL, "--events", "-"], &fault[..]].concat())
        .code(1);
    let seen = events(&ended.stdout);
    let names = names(&seen);
    assert_eq!((names[0], names[names.len() - 1]), ("run-begun", "run-ended"));
    assert_eq!(names.iter().filter(|name| **name == "test-ended").count(), 2);
    let last = &seen[seen.len() - 1];
    assert_eq!(
        (&last["verdict"], &last["exit"]),
        (&Value::from("fail"), &Value::from(1))
    );
    let manifest = fs::read_to_string(bench.bundle().join("manifest.json")).unwrap();
    let root_hash = last["root"].as_str().unwrap().strip_prefix("sha256:").unwrap();
    assert!(manifest.contains(root_hash));
    let broken: Vec<&Value> = seen.iter().filter(|event| event["event"] == "requirement").collect();
    assert!(broken.iter().any(|event| event["verdict"] == "fail"), "{broken:?}");
    let page = fs::read_to_string(root().join("docs/events.md")).unwrap();
    let schema = fs::read_to_string(root().join("schemas/events.schema.json")).unwrap();
    let schema: Value = serde_json::from_str(&schema).unwrap();
    for kind in schema["oneOf"].as_array().unwrap() {
        let name = kind["properties"]["event"]["const"].as_str().unwrap();
        let row = page.lines().find(|line| line.starts_with(&format!("| `{name}` |")));
        let row = row.unwrap_or_else(|| panic!("{name} is not documented"));
        for member in kind["properties"]
            .as_object()
            .unwrap()
            .keys()
            .filter(|member| *member != "event")
        {
            assert!(
                row.contains(&format!("`{member}`")),
                "{name}: `{member}` is not documented"
            );
        }
    }
}

#[test]
fn events_go_into_a_file_beside_what_a_person_sees() {
    let bench = Bench::new();
    let (run, port) = bench.start(&Profile::default(), &[QUICK, "--events", "events.jsonl"]);
    let _agv = bench.agv(port, &[]);
    run.end().code(0).prints("PASS");
    let seen = events(&fs::read_to_string(bench.path().join("events.jsonl")).unwrap());
    let names = names(&seen);
    for name in ["device-expected", "planned", "test-begun", "step-begun", "note"] {
        assert!(names.contains(&name), "no {name} in {names:?}");
    }
    bench
        .run(&["run", "--virtual", QUICK, "--events", "no/such/folder/x"])
        .code(5);
}

#[test]
#[cfg(target_os = "linux")]
fn the_report_is_shown_when_that_is_asked_for() {
    use std::os::unix::fs::PermissionsExt as _;
    let bench = Bench::new();
    let script = bench.path().join("xdg-open");
    fs::write(&script, "#!/bin/sh\necho \"$1\" > \"$0.shown\"\n").unwrap();
    fs::set_permissions(&script, fs::Permissions::from_mode(0o755)).unwrap();
    let path = format!("{}:{}", bench.path().display(), std::env::var("PATH").unwrap());
    let mut command = tool(bench.path(), &["run", "--virtual", QUICK, "--open"]);
    Running::start(command.env("PATH", path)).end().code(0);
    let shown = bench.path().join("xdg-open.shown");
    let begun = std::time::Instant::now();
    while !fs::read_to_string(&shown).is_ok_and(|text| text.ends_with('\n')) {
        assert!(begun.elapsed().as_secs() < 30, "nothing was shown");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(fs::read_to_string(&shown).unwrap().trim().ends_with("report.html"));
}

fn json(arguments: &[&str]) -> Vec<Value> {
    let ended = run(arguments).code(0);
    ended
        .stdout
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

#[test]
fn what_is_explained_is_there_for_programs() {
    let requirement = &json(&["explain", "ORD-REJ-10", "--format", "json"])[0];
    assert_eq!(
        (&requirement["kind"], &requirement["id"]),
        (&"requirement".into(), &"ORD-REJ-10".into())
    );
    assert!(!requirement["tests"].as_array().unwrap().is_empty());
    assert!(!requirement["provedWith"].as_array().unwrap().is_empty());
    let resting = &json(&["explain", "ORD-FLOW-06", "--format", "json"])[0];
    assert_eq!(resting["restsOn"], serde_json::json!(["ORD-04"]));
    let test = &json(&["explain", "order-rejection/lower-update-id", "--format", "json"])[0];
    assert_eq!(test["kind"], "test");
    assert!(
        test["decides"]
            .as_array()
            .unwrap()
            .iter()
            .any(|one| one["requirement"] == "ORD-REJ-10")
    );
    for (id, kind) in [
        ("state/period", "monitor"),
        ("power-cycle", "hook"),
        ("outdated-update-taken-over", "fault"),
    ] {
        assert_eq!(json(&["explain", id, "--format", "json"])[0]["kind"], kind);
    }
}

#[test]
fn mistakes_are_there_for_programs_whatever_the_command() {
    for arguments in [
        &["run", "no/such-test"][..],
        &["run", "--no-such-flag"],
        &["list", "nothing"],
        &["explain", "nothing-of-that-name"],
        &["report", "nowhere"],
        &["simulate", "agv", "--fault", "nothing"],
        &["init", "--suites", "."],
        &["validate", "nowhere.json"],
        &["audit", "nowhere.jsonl"],
        &["qualify", "no/such-test"],
        &["watch", "--for", "never"],
        &["explore", "--virtual", "--fault", "nothing"],
        &["discover", "--seconds", "0"],
    ] {
        let ended = run(&[arguments, &["--format", "json"]].concat()).code(2);
        let line = ended.stderr.lines().last().unwrap_or_default().to_owned();
        let error: Value =
            serde_json::from_str(&line).unwrap_or_else(|why| panic!("{arguments:?}: {why}: {}", ended.stderr));
        assert_eq!(
            (&error["error"]["kind"], &error["error"]["exit"]),
            (&"usage".into(), &2.into()),
            "{line}"
        );
        assert!(
            !error["error"]["problems"][0]["title"].as_str().unwrap().is_empty(),
            "{line}"
        );
    }
}
