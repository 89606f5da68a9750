//! A check that reads a member no version has would never find anything: the members that checks name are members of some
//! version, and so are those of the tables in the packs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use regex::Regex;
use serde_json::Value;

use super::REGISTRY;
use tck_check::find;
use tck_pack::{Assets, Catalogue, Packs};

/// Names that are read of something else than a message: arguments of checks, what the run knows, and the vocabulary of the
/// packs.
const OTHERS: [&str; 11] = [
    "action",
    "corridorReference",
    "device",
    "error",
    "factsheet",
    "optional",
    "order",
    "parameters",
    "scopes",
    "statuses",
    "time",
];

fn members(of: &Value, all: &mut BTreeSet<String>) {
    match of {
        Value::Object(object) => {
            if let Some(properties) = object.get("properties").and_then(Value::as_object) {
                all.extend(properties.keys().cloned());
            }
            object.values().for_each(|value| members(value, all));
        }
        Value::Array(items) => items.iter().for_each(|value| members(value, all)),
        _ => {}
    }
}

fn known() -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for file in Assets::of_source_tree().unwrap().under("schemas/") {
        let is_of_a_version = file.path.matches('/').count() == 2 && file.path.ends_with(".schema.json");
        if is_of_a_version {
            members(&serde_json::from_str(&file.text).unwrap(), &mut all);
        }
    }
    all
}

fn sources(folder: &Path, all: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, all);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            all.push(path);
        }
    }
}

/// What a source reads of messages, without its tests.
fn read(text: &str) -> Vec<String> {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let mut names = Vec::new();
    for one in Regex::new(r#"\.get\(\s*"([A-Za-z]+)"\s*\)"#)
        .unwrap()
        .captures_iter(code)
    {
        names.push(one[1].to_owned());
    }
    for one in Regex::new(r#"pointer\(\s*"([^"]+)"\s*\)"#).unwrap().captures_iter(code) {
        let parts = one[1]
            .split('/')
            .filter(|part| !part.is_empty() && part.parse::<u32>().is_err());
        names.extend(parts.map(str::to_owned));
    }
    names
}

#[test]
fn every_member_that_a_check_reads_is_one_of_some_version() {
    let known = known();
    let arguments: BTreeSet<&str> = REGISTRY.iter().flat_map(|check| check.arguments).copied().collect();
    let mut files = Vec::new();
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    sources(&own.join("src"), &mut files);
    sources(&own.join("../world/src"), &mut files);
    let mut seen = 0;
    for file in files.iter().filter(|file| {
        !["trace.rs", "tests.rs", "known_members.rs"]
            .iter()
            .any(|name| file.ends_with(name))
    }) {
        for name in read(&std::fs::read_to_string(file).unwrap()) {
            seen += 1;
            let is_known = known.contains(&name) || arguments.contains(name.as_str()) || OTHERS.contains(&&*name);
            assert!(is_known, "{} reads `{name}`, which no version has", file.display());
        }
    }
    assert!(seen > 40, "only {seen} members were found in the code");
}

#[test]
fn a_member_that_no_version_has_is_seen() {
    let names = read("value.get(\"noSuchMember\")?; state.pointer(\"/agvPosition/0/mapld\")");
    assert_eq!(names, ["noSuchMember", "agvPosition", "mapld"]);
    assert!(!known().contains("noSuchMember") && !known().contains("mapld") && known().contains("agvPosition"));
}

#[test]
fn the_tables_of_fields_name_members_of_their_version_and_requirements_that_the_check_decides() {
    let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
    let catalogue = Catalogue::load(&Assets::of_source_tree().unwrap()).unwrap();
    let check = find(REGISTRY, "message/schema").unwrap();
    for pack in packs.all() {
        let mut known = BTreeSet::new();
        for topic in pack.topics() {
            let path = format!("schemas/{}/{}.schema.json", pack.id, topic.name);
            let schema = Assets::of_source_tree().unwrap().get(&path).unwrap().text.clone();
            members(&serde_json::from_str(&schema).unwrap(), &mut known);
        }
        let mut lines = 0;
        for (names, requirement) in pack.fields() {
            lines += 1;
            for name in names {
                assert!(known.contains(name), "VDA 5050 {} has no `{name}`", pack.id);
            }
            if let Some(requirement) = requirement {
                assert!(catalogue.get(requirement).is_some(), "there is no {requirement}");
                assert!(check.decides.contains(&requirement), "{requirement} is not the check's");
            }
        }
        assert!(lines > 40, "VDA 5050 {} has only {lines} lines", pack.id);
    }
}
