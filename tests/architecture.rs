//! The shape of the program, held by a test: dependencies point one way, and what is named stays in its place.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Modules by layer; an arrow may point to the same layer or down, never up.
const LAYERS: [(&str, u8); 26] = [
    ("main", 6),
    ("cli", 6),
    ("ui", 6),
    ("run", 5),
    ("report", 5),
    ("engine", 4),
    ("judge", 4),
    ("reference", 4),
    ("result", 3),
    ("link", 3),
    ("broker", 3),
    ("tap", 3),
    ("maps", 3),
    ("suite", 2),
    ("pattern", 2),
    ("checks", 2),
    ("journal", 2),
    ("pack", 1),
    ("profile", 1),
    ("course", 1),
    ("verdict", 0),
    ("diagnostic", 0),
    ("clock", 0),
    ("yaml", 0),
    ("nurbs", 0),
    ("lib", 7),
];

fn sources() -> Vec<(PathBuf, String)> {
    let mut all = Vec::new();
    let mut open = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("src is readable") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).expect("source");
                all.push((path, text));
            }
        }
    }
    assert!(all.len() > 50, "the sources were not found");
    all
}

/// First folder or file name below `src`.
fn module(path: &Path) -> String {
    let below = path
        .strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("src"))
        .expect("below src");
    let first = below
        .components()
        .next()
        .expect("a component")
        .as_os_str()
        .to_string_lossy()
        .into_owned();
    first.trim_end_matches(".rs").to_owned()
}

fn below_src(path: &Path) -> String {
    path.strip_prefix(Path::new(env!("CARGO_MANIFEST_DIR")).join("src"))
        .expect("below src")
        .display()
        .to_string()
}

/// Code lines: no comments, and nothing after the unit tests begin.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines()
        .enumerate()
        .take_while(|(_, line)| !line.starts_with("#[cfg(test)]"))
        .filter(|(_, line)| !line.trim_start().starts_with("//"))
        .map(|(at, line)| (at + 1, line))
}

fn is_test_file(path: &Path) -> bool {
    let name = below_src(path);
    name.ends_with("tests.rs") || name.contains("/tests/") || name.ends_with("properties.rs")
}

#[test]
fn dependencies_point_down() {
    let layers: BTreeMap<&str, u8> = LAYERS.into_iter().collect();
    let mut wrong = Vec::new();
    for (path, text) in sources().iter().filter(|(path, _)| !is_test_file(path)) {
        let here = module(path);
        let Some(own) = layers.get(here.as_str()) else {
            panic!("{here} has no layer in this test");
        };
        for (line, content) in code(text) {
            for part in content.split("crate::").skip(1) {
                let names: Vec<String> = match part.strip_prefix('{') {
                    Some(list) => list
                        .split(',')
                        .map(|name| name.trim().split([':', '}']).next().unwrap_or("").to_owned())
                        .collect(),
                    None => vec![
                        part.split(|c: char| !c.is_alphanumeric() && c != '_')
                            .next()
                            .unwrap_or("")
                            .to_owned(),
                    ],
                };
                for name in names {
                    let Some(other) = layers.get(name.as_str()) else {
                        continue;
                    };
                    if other > own {
                        wrong.push(format!(
                            "{}:{line}: {here} (layer {own}) names {name} (layer {other})",
                            below_src(path)
                        ));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_judging_side_knows_no_clock_and_no_runtime() {
    let forbidden = [
        "tokio",
        "Instant::now",
        "SystemTime",
        "WallClock",
        "Timestamp::now",
        "std::thread::sleep",
    ];
    refuse(&["judge", "pattern", "checks", "report", "reference"], &forbidden, &[]);
}

#[test]
fn libraries_stay_in_their_place() {
    let everywhere: Vec<&str> = LAYERS.iter().map(|(name, _)| *name).collect();
    refuse(&everywhere, &["rumqttc"], &["link/mqtt", "link/device", "broker/"]);
    refuse(&everywhere, &["mqtt5::", "mqtt5_protocol"], &["broker", "tap"]);
    refuse(&everywhere, &["saphyr"], &["yaml.rs"]);
    refuse(&everywhere, &["junit_report"], &["report/junit"]);
}

#[test]
fn versions_are_data() {
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        for (line, content) in code(&text) {
            for digit in ["\"1.", "\"2.", "\"3."] {
                for rest in content.split(digit).skip(1) {
                    let version = rest.split('"').next().unwrap_or("");
                    if !version.is_empty() && version.chars().all(|c| c.is_ascii_digit() || c == '.') {
                        wrong.push(format!(
                            "{}:{line}: a version literal {digit}{version}\"",
                            below_src(&path)
                        ));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn incoming_messages_stay_values() {
    // Typed structs would repair what has to be detected: only the journal's own records, the results, the
    // profile and the packs are deserialized into types.
    let allowed = [
        "journal", "result", "report", "profile", "pack", "course", "verdict", "clock", "link",
    ];
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        for (line, content) in code(&text) {
            if content.contains("derive(")
                && content.contains("Deserialize")
                && !allowed.contains(&module(&path).as_str())
                // A master control reads of a state what it needs; it judges nothing.
                && below_src(&path) != "reference/master_control/seen.rs"
            {
                wrong.push(format!("{}:{line}: {}", below_src(&path), content.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_reference_master_control_keeps_to_the_standard() {
    // What can be done otherwise stands below deviations, and takes hold at the seam.
    let words = ["fault", "tolerance", "libert", "deviation", "persona", "lapse"];
    // Members of the protocol, and what every language has.
    let others = [
        "default",
        "alloweddeviation",
        "deviation_xy",
        "deviation_theta",
        "deviation_range",
    ];
    let mut wrong = Vec::new();
    let room = |name: &str| name.starts_with("reference/master_control/") && !name.ends_with("/seam.rs");
    for (path, text) in sources()
        .iter()
        .filter(|(path, _)| room(&below_src(path)) && !is_test_file(path))
    {
        for (line, content) in text.lines().enumerate() {
            let plain = others
                .iter()
                .fold(content.to_lowercase(), |text, other| text.replace(other, ""));
            if words.iter().any(|word| plain.contains(word)) {
                wrong.push(format!("{}:{}: {}", below_src(path), line + 1, content.trim()));
            }
        }
        if text.lines().count() > 400 {
            wrong.push(format!("{} is longer than 400 lines", below_src(path)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_module_says_what_it_is_for() {
    let silent: Vec<String> = sources()
        .iter()
        .filter(|(path, text)| !text.starts_with("//!") && !is_test_file(path))
        .map(|(path, _)| below_src(path))
        .collect();
    assert!(silent.is_empty(), "{silent:?}");
}

#[test]
fn no_file_is_two_ideas() {
    let long: Vec<String> = sources()
        .iter()
        .filter(|(path, text)| text.lines().count() > 600 && !is_test_file(path))
        .map(|(path, text)| format!("{}: {}", below_src(path), text.lines().count()))
        .collect();
    assert!(long.is_empty(), "{long:?}");
}

/// No code line of these modules names one of these words, but in these places.
fn refuse(modules: &[&str], words: &[&str], places: &[&str]) {
    let mut wrong = Vec::new();
    for (path, text) in sources()
        .iter()
        .filter(|(path, _)| modules.contains(&module(path).as_str()))
    {
        let name = below_src(path);
        if places.iter().any(|place| name.starts_with(place)) {
            continue;
        }
        for (line, content) in code(text) {
            for word in words {
                if content.contains(word) {
                    wrong.push(format!("{name}:{line}: names {word}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
