//! What a profile can say is heeded: no setting is documented, checked, shown, and then read by nobody.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::path::Path;

use vda5050_tck::profile::{KEYS, SAMPLE_ACTIONS, STATEMENTS};

/// Settings whose field does not have the name of the key.
const FIELDS: [(&str, &str); 7] = [
    ("bench.password-env", "bench.password"),
    ("bench.password-file", "bench.password"),
    ("vehicles.manufacturer", "wanted.manufacturer"),
    ("vehicles.start-node", "wanted.start_node"),
    ("layout.lif", "LayoutSource::Lif"),
    ("layout.vehicle-type", "vehicle_type"),
    ("maps.files", "profile.maps"),
];

/// Everything with this extension below a folder, without `left_out` and without lines that are comments.
fn text_below(folder: &Path, extension: &str, left_out: &str) -> String {
    let mut all = String::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.to_string_lossy();
            if path.is_dir() {
                if !name.ends_with(left_out) && !name.ends_with("/tests") {
                    open.push(path);
                }
            } else if name.ends_with(extension) && !name.ends_with("tests.rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                let lines = text.lines().filter(|line| !line.trim_start().starts_with("//"));
                all.extend(lines.flat_map(|line| [line, "\n"]));
            }
        }
    }
    all
}

/// Whether the code, or a suite, names what the setting is about.
fn is_read(path: &str, code: &str, suites: &str) -> bool {
    if let Some((_, field)) = FIELDS.iter().find(|(key, _)| *key == path) {
        return code.contains(field);
    }
    let (section, name) = path.split_once('.').expect("section and name");
    if STATEMENTS.iter().any(|statement| statement.name == name) {
        return suites.contains(&format!("profile {name}"));
    }
    if let Some(sample) = SAMPLE_ACTIONS.iter().find(|sample| sample.name == name) {
        // A table of cases names it as the value of a column.
        return ["device.", ": "]
            .iter()
            .any(|before| suites.contains(&format!("{before}{}", sample.variable)));
    }
    if section == "certificate" {
        return code.contains(&format!("\"{path}\""));
    }
    if section == "time" {
        let mut words = name.split('-');
        let first = words.next().unwrap_or_default().to_owned();
        let name = words.fold(first, |all, word| {
            let (head, tail) = word.split_at(1);
            all + &head.to_uppercase() + tail
        });
        let field: String = name
            .chars()
            .flat_map(|c| {
                if c.is_uppercase() {
                    vec!['_', c.to_ascii_lowercase()]
                } else {
                    vec![c]
                }
            })
            .collect();
        let in_code = [
            format!("\"time.{name}\""),
            format!("time(\"{name}\")"),
            format!("setting.time.{field}"),
        ];
        return suites.contains(&format!("time.{name}")) || in_code.iter().any(|text| code.contains(text));
    }
    code.contains(&format!("{section}.{}", name.replace('-', "_")))
}

#[test]
fn every_setting_is_read_by_somebody() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let code = text_below(&root.join("src"), ".rs", "/profile") + &text_below(&root.join("crates"), ".rs", "/profile");
    let suites = text_below(&root.join("suites"), ".yaml", "/requirements");
    let ignored: Vec<&str> = KEYS
        .iter()
        .map(|key| key.path)
        .filter(|path| !is_read(path, &code, &suites))
        .collect();
    assert!(ignored.is_empty(), "nobody reads: {}", ignored.join(", "));
    assert!(!is_read("bench.colour", &code, &suites) && !is_read("time.tea", &code, &suites));
}
