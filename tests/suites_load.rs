//! The suites that ship with the tool load without a complaint, and what they cover is written down.

#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use vda5050_tck::checks;
use vda5050_tck::pack::{Assets, Catalogue, Hooks, Packs, Role};
use vda5050_tck::suite::{CheckInfo, Suites};

fn load() -> (Suites, Catalogue) {
    // Files of a folder are linted; those the program carries were, by this test.
    let assets = Assets::of_folder(Path::new(env!("CARGO_MANIFEST_DIR"))).expect("suites and schemas");
    let packs = Packs::load(&assets).expect("packs");
    let catalogue = Catalogue::load(&assets).expect("catalogue");
    let known: Vec<CheckInfo> = checks::REGISTRY
        .iter()
        .map(|check| CheckInfo {
            name: check.name,
            decides: check.decides,
            arguments: check.arguments,
            needs: check.needs,
        })
        .collect();
    let hooks = Hooks::load(&assets).expect("hooks");
    let suites = Suites::load(&assets, &packs, &catalogue, &known, &hooks).unwrap_or_else(|diagnostics| {
        for diagnostic in &diagnostics {
            println!("{}", diagnostic.render(false));
        }
        panic!("{} diagnostics", diagnostics.len())
    });
    (suites, catalogue)
}

#[test]
fn every_suite_loads_without_a_complaint() {
    let (suites, _) = load();
    let agv = suites.tests.iter().filter(|test| test.device == Role::Agv);
    let files: BTreeSet<&str> = agv.map(|test| test.id.split('[').next().unwrap_or_default()).collect();
    assert!(files.len() >= 60, "only {} files", files.len());
}

#[test]
fn every_title_is_a_sentence_without_holes() {
    let (suites, _) = load();
    for test in &suites.tests {
        let steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
        let titles = steps.filter_map(|step| step.title.as_deref());
        for title in titles.chain([test.title.as_str()]) {
            assert!(!title.contains("${"), "{}: {title}", test.id);
        }
    }
    for monitor in &suites.monitors {
        assert!(!monitor.title.contains("${"), "{}: {}", monitor.id, monitor.title);
    }
}

#[test]
fn every_named_check_has_a_monitor_or_a_test() {
    let (suites, _) = load();
    for check in checks::REGISTRY {
        let named = format!("check: {}", check.name);
        let runs = |text: &str| text.split(&named).skip(1).any(|rest| rest.starts_with(['\n', ' ']));
        assert!(
            suites.monitors.iter().any(|monitor| monitor.id == check.name)
                || suites.tests.iter().any(|test| runs(&test.source.text)),
            "{} is never run",
            check.name
        );
    }
}

#[test]
fn every_test_decides_something() {
    let (suites, _) = load();
    for test in &suites.tests {
        assert!(!test.requirements().is_empty(), "{} decides nothing", test.id);
    }
}

/// Requirements of each side, and the tests and monitors that decide them.
#[test]
fn the_requirements_covered_are_written_down() {
    insta::assert_snapshot!("agv_requirements", covered(Role::Agv));
    insta::assert_snapshot!("master_control_requirements", covered(Role::MasterControl));
}

fn covered(role: Role) -> String {
    let (suites, catalogue) = load();
    let mut by: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for test in suites.tests.iter().filter(|test| test.device == role) {
        let file = test.id.split('[').next().unwrap_or_default();
        for requirement in test.requirements() {
            by.entry(requirement.to_string()).or_default().insert(file.to_owned());
        }
    }
    let monitors = suites.monitors.iter();
    for monitor in monitors.filter(|monitor| monitor.device.is_none_or(|device| device == role)) {
        for binding in &monitor.checks {
            let entry = by.entry(binding.requirement.to_string()).or_default();
            entry.insert(format!("monitor {}", monitor.id));
        }
    }
    let mut text = String::new();
    for requirement in catalogue.all().filter(|requirement| requirement.role.concerns(role)) {
        let deciders = by.get(requirement.id.as_str()).map_or_else(
            || "-".to_owned(),
            |names| names.iter().cloned().collect::<Vec<_>>().join(", "),
        );
        let _ = writeln!(text, "{}: {deciders}", requirement.id);
    }
    text
}
