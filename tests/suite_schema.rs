//! `schemas/suite.schema.json` agrees with the loader: it takes every good suite and refuses what it can see.

#![allow(clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};

use serde_json::Value;
use vda5050_tck::diagnostic::Source;
use vda5050_tck::pack::{HookChange, HookEffect, HookRisk};
use vda5050_tck::yaml;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn schema() -> jsonschema::Validator {
    schema_of("suite")
}

fn schema_of(what: &str) -> jsonschema::Validator {
    let text = std::fs::read_to_string(root().join(format!("schemas/{what}.schema.json"))).expect("schema");
    let schema: Value = serde_json::from_str(&text).expect("JSON");
    jsonschema::draft202012::meta::validate(&schema).expect("a schema of 2020-12");
    jsonschema::validator_for(&schema).expect("a schema")
}

fn suites_below(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries {
        let path = entry.expect("entry").path();
        let of_another_form = [
            "suites/requirements",
            "suites/qualification",
            "suites/explore",
            "suites/hooks",
        ];
        if path.is_dir() && !of_another_form.iter().any(|folder| path.ends_with(folder)) {
            suites_below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "yaml") {
            found.push(path);
        }
    }
}

/// All files of YAML below a folder.
fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            files_below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "yaml") {
            found.push(path);
        }
    }
}

#[test]
fn requirements_stimuli_and_hooks_have_schemas_of_their_own() {
    for (what, least) in [("requirements", 20), ("explore", 20), ("hooks", 2)] {
        let schema = schema_of(what);
        let mut files = Vec::new();
        for suites in ["suites", "fixtures/own"] {
            files_below(&root().join(suites).join(what), &mut files);
        }
        assert!(files.len() > least, "{what}");
        for path in files {
            let value = read(&path).unwrap_or_else(|| panic!("{} is no YAML", path.display()));
            let objections: Vec<String> = schema.iter_errors(&value).map(|error| error.to_string()).collect();
            assert!(objections.is_empty(), "{}: {objections:#?}", path.display());
        }
    }
    let own = read(&root().join("fixtures/own/requirements/SYS.yaml")).expect("YAML");
    let schema = schema_of("requirements");
    for (member, wrong) in [
        ("id", serde_json::json!("SYS")),
        ("link", serde_json::json!("tracker")),
        ("role", serde_json::json!("agx")),
        ("reason", serde_json::json!("it is testable")),
        ("observes", serde_json::json!("x")),
    ] {
        let mut broken = own.clone();
        broken["requirements"][0][member] = wrong;
        assert!(!schema.is_valid(&broken), "{member}");
    }
    let stimuli = read(&root().join("fixtures/own/explore/agv/sys.yaml")).expect("YAML");
    let mut broken = stimuli.clone();
    broken["blink"]["sedns"] = "".into();
    assert!(!schema_of("explore").is_valid(&broken));
    let hooks = read(&root().join("fixtures/own/hooks/sys.yaml")).expect("YAML");
    let schema = schema_of("hooks");
    for (member, wrong) in [
        ("hook", serde_json::json!("Turn key")),
        ("effects", serde_json::json!(["turns"])),
        ("changes", serde_json::json!("pause")),
        ("risk", serde_json::json!("high")),
        (
            "parameters",
            serde_json::json!({ "to": { "about": "where it points to" } }),
        ),
        ("undo", serde_json::json!("x")),
    ] {
        let mut broken = hooks.clone();
        broken["hooks"][0][member] = wrong;
        assert!(!schema.is_valid(&broken), "{member}");
    }
}

#[test]
fn the_schema_of_hooks_knows_the_words_of_the_program() {
    let text = std::fs::read_to_string(root().join("schemas/hooks.schema.json")).expect("schema");
    let schema: Value = serde_json::from_str(&text).expect("JSON");
    let properties = &schema["$defs"]["hook"]["properties"];
    assert_eq!(
        properties["effects"]["items"]["enum"],
        serde_json::json!(HookEffect::ALL)
    );
    assert_eq!(
        properties["changes"]["items"]["enum"],
        serde_json::json!(HookChange::ALL)
    );
    assert_eq!(properties["risk"]["enum"], serde_json::json!(HookRisk::ALL));
}

fn read(path: &Path) -> Option<Value> {
    let text = std::fs::read_to_string(path).expect("text");
    let source = Source::new(path.to_string_lossy(), text);
    yaml::tree(&source).ok().map(|tree| yaml::value(&tree))
}

#[test]
fn every_suite_is_valid() {
    let schema = schema();
    let mut files = Vec::new();
    suites_below(&root().join("fixtures/good-suites"), &mut files);
    suites_below(&root().join("suites"), &mut files);
    assert!(files.len() >= 12);
    for path in files {
        let value = read(&path).unwrap_or_else(|| panic!("{} is no YAML", path.display()));
        let objections: Vec<String> = schema
            .iter_errors(&value)
            .map(|error| format!("{}: {error:.300}", error.instance_path()))
            .collect();
        assert!(objections.is_empty(), "{}: {objections:#?}", path.display());
    }
}

#[test]
fn mistakes_of_form_are_refused() {
    const OF_FORM: [&str; 20] = [
        "always-without-extent",
        "bad-duration",
        "bad-need",
        "bad-node-name",
        "bad-version-range",
        "bad-walk",
        "empty-cases",
        "empty-steps",
        "half-broken",
        "horizon-without-base",
        "monitor-rule",
        "recordings-without-reason",
        "unknown-behaviour",
        "unknown-certificate-file",
        "unknown-device",
        "unknown-fault",
        "unknown-operator",
        "unknown-recordings",
        "unknown-verb",
        "wrong-type",
    ];
    let schema = schema();
    let mut files = Vec::new();
    suites_below(&root().join("fixtures/bad-suites"), &mut files);
    let mut refused = 0;
    for path in files {
        let text = std::fs::read_to_string(&path).expect("text");
        let code = text.lines().next().and_then(|line| line.strip_prefix("# expect: "));
        let (Some(code), Some(value)) = (code, read(&path)) else {
            continue;
        };
        if OF_FORM.contains(&code) {
            assert!(!schema.is_valid(&value), "{} is taken", path.display());
            refused += 1;
        }
    }
    assert!(refused >= OF_FORM.len(), "only {refused} refused");
}
