//! The suites that ship with the tool load without a complaint; `list coverage` says what they cover.

#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests")]

use std::collections::BTreeSet;
use std::path::Path;

use vda5050_tck::checks;
use vda5050_tck::pack::{Assets, Catalogue, Hooks, Packs, Role};
use vda5050_tck::suite::{CheckInfo, Suites};

fn load() -> Suites {
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
    Suites::load(&assets, &packs, &catalogue, &known, &hooks).unwrap_or_else(|diagnostics| {
        for diagnostic in &diagnostics {
            println!("{}", diagnostic.render(false));
        }
        panic!("{} diagnostics", diagnostics.len())
    })
}

#[test]
fn every_suite_loads_without_a_complaint() {
    let suites = load();
    let agv = suites.tests.iter().filter(|test| test.device == Role::Agv);
    let files: BTreeSet<&str> = agv.map(|test| test.id.split('[').next().unwrap_or_default()).collect();
    assert!(files.len() >= 60, "only {} files", files.len());
}

#[test]
fn every_title_is_a_sentence_without_holes() {
    let suites = load();
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
    let suites = load();
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
    let suites = load();
    for test in &suites.tests {
        assert!(!test.requirements().is_empty(), "{} decides nothing", test.id);
    }
}
