//! axe-core has nothing to say against the pages, as far as it can be asked without a browser. What is folded is judged, too.

use std::path::Path;
use std::process::{Command, Stdio};

use vda5050_tck::history::{gather, page};
use vda5050_tck::report::manifest::Manifest;
use vda5050_tck::report::{certificate, html, json, side_by_side};
use vda5050_tck::result::{CommandedVehicle, FleetResult, ReactionTimes, RunResult};

use crate::certificate::{ROOT, certified};
use crate::samples;

/// A run with a fleet of two vehicles, one of which was never sent an order.
fn fleet() -> String {
    let (mut result, journal) = samples::pass();
    let vehicle = |serial: &str, orders: usize, wait: Option<f64>| CommandedVehicle {
        serial_number: serial.to_owned(),
        orders,
        median: wait,
        longest: wait,
    };
    let mut buckets = vec![0; ReactionTimes::BOUNDS.len() + 1];
    buckets[1] = 3;
    result.fleet = Some(FleetResult {
        vehicles: 2,
        commanded: 1,
        reaction: Some(ReactionTimes {
            count: 3,
            shortest: 3.0,
            median: 4.0,
            most: 5.0,
            nearly_all: 5.0,
            longest: 5.0,
            buckets,
        }),
        each: vec![vehicle("0001", 3, Some(4.0)), vehicle("0002", 0, None)],
    });
    html::render(&result, &samples::sources(), Some(&journal)).expect("html")
}

/// The history of these runs, a day between each, and of a bundle that is damaged.
fn history(runs: &[RunResult]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    for (at, run) in runs.iter().enumerate() {
        let mut run = run.clone();
        run.started = format!("2026-01-0{}T08:00:00.000Z", at + 1);
        let bundle = folder.path().join(at.to_string());
        std::fs::create_dir(&bundle).expect("a folder");
        std::fs::write(bundle.join("report.html"), "").expect("a page");
        json::write(&bundle.join("result.json"), &run).expect("a result");
        Manifest::write(&bundle).expect("a manifest");
    }
    let damaged = folder.path().join("damaged");
    std::fs::create_dir(&damaged).expect("a folder");
    std::fs::write(damaged.join("result.json"), "{}").expect("a result");
    Manifest::write(&damaged).expect("a manifest");
    std::fs::write(damaged.join("result.json"), "[]").expect("a result");
    let history = gather(folder.path()).expect("a history");
    assert_eq!((history.bundles, history.left_out.len()), (runs.len(), 1));
    let sources = runs
        .iter()
        .map(|run| (run.protocol.clone(), samples::sources()))
        .collect();
    page::render(&history, &sources, "").expect("a page")
}

#[test]
fn axe_finds_nothing_in_any_page() {
    let sources = samples::sources();
    let (pass, pass_journal) = samples::pass();
    let (fail, fail_journal) = samples::fail();
    // Its strings are hostile, it is partial, and it has an exploration.
    let (hostile, hostile_journal, hostile_sources) = samples::hostile();
    let runs = [pass.clone(), fail.clone()];
    let names = ["run-1".to_owned(), "run-2".to_owned()];
    let pages = [
        (
            "pass",
            html::render(&pass, &sources, Some(&pass_journal)).expect("html"),
        ),
        (
            "fail",
            html::render(&fail, &sources, Some(&fail_journal)).expect("html"),
        ),
        (
            "exploration",
            html::render(&hostile, &hostile_sources, Some(&hostile_journal)).expect("html"),
        ),
        ("fleet", fleet()),
        ("course", crate::course::page()),
        (
            "certificate",
            certificate::render(&certified(pass), &sources, ROOT).expect("a certificate"),
        ),
        (
            "test-report",
            certificate::render(&certified(fail), &sources, ROOT).expect("a report"),
        ),
        (
            "comparison",
            side_by_side::render(&runs, &names, &sources).expect("a page"),
        ),
        ("history", history(&runs)),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    let mut files = Vec::new();
    for (name, page) in pages {
        let path = folder.path().join(format!("{name}.html"));
        std::fs::write(&path, page).expect("a file");
        files.push(path);
    }
    let mut check = Command::new("node");
    check
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/page"))
        .arg("check.mjs")
        .args(&files)
        .stdin(Stdio::null());
    let missing = |what: &str| {
        assert!(std::env::var_os("CI").is_none(), "{what} is missing");
        eprintln!("skipped: {what} is missing");
    };
    let Ok(output) = check.output() else {
        return missing("node");
    };
    let complaint = String::from_utf8_lossy(&output.stderr);
    if complaint.contains("ERR_MODULE_NOT_FOUND") {
        return missing("axe-core, which `npm ci` in fixtures/page installs,");
    }
    assert_eq!(String::from_utf8_lossy(&output.stdout), "done\n", "{complaint}");
}
