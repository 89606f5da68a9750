//! Where a vehicle was: a failed test in which it moved shows its course, and no other test does.

use std::sync::Arc;

use serde_json::{Value, json};
use vda5050_tck::journal::Journal;
use vda5050_tck::report::html;
use vda5050_tck::report::junit::Inconclusive;
use vda5050_tck::result::RunResult;
use vda5050_tck::run::{Bundle, VirtualRun, run_silently, sources, write_all};
use vda5050_tck::verdict::Verdict;

use crate::samples::{self, Recorder};

/// What stands above each picture.
const HEADING: &str = "<h4>Where the vehicle was</h4>";

/// An order along the x axis with a curve at its end.
fn order() -> Value {
    let mut order = samples::order(0, &["n1", "n2"], &["n3"]);
    for (at, node) in order["nodes"].as_array_mut().into_iter().flatten().enumerate() {
        node["nodePosition"] = json!({ "x": 4 * at, "y": if at == 2 { 4 } else { 0 }, "mapId": "hall <1>" });
    }
    let curve = json!({ "degree": 2, "knotVector": [0, 0, 0, 1, 1, 1],
        "controlPoints": [{ "x": 4, "y": 0 }, { "x": 8, "y": 0 }, { "x": 8, "y": 4 }] });
    order["edges"] = json!([
        { "edgeId": "e1", "sequenceId": 1, "released": true, "startNodeId": "n1", "endNodeId": "n2", "actions": [] },
        { "edgeId": "e2", "sequenceId": 3, "released": false, "startNodeId": "n2", "endNodeId": "n3", "actions": [],
          "trajectory": curve },
    ]);
    order
}

/// A run of one test, during which the vehicle leaves its way; with what a monitor found of it.
fn driven() -> (RunResult, Journal) {
    let mut record = Recorder::new();
    record.step("steps[0]");
    record.send("order", &order());
    let mut seen = 0;
    for at in 0..9 {
        let mut state = samples::state(at, 0, "n1", &json!([]));
        let aside = if at > 5 { 0.4 * (at - 5) as f64 } else { 0.0 };
        state["driving"] = json!(true);
        state["agvPosition"] = json!({ "x": at as f64 / 2.0, "y": aside, "theta": 0.3, "mapId": "hall <1>",
                                       "positionInitialized": true });
        seen = record.wait(500).receive("state", &state);
    }
    let (mut result, _) = samples::fail();
    result.tests.truncate(1);
    let test = &mut result.tests[0];
    test.journal = Some((1, seen));
    test.steps.clear();
    for decision in &mut test.decisions {
        decision.witness = Some(seen - 2);
        (decision.nearest, decision.waited, decision.sent) = (None, None, None);
    }
    result.monitors.truncate(1);
    let finding = &mut result.monitors[0].findings[0];
    (finding.verdict, finding.first) = (Verdict::Fail, vec![seen]);
    (result, record.journal)
}

/// The page of a run in which a vehicle left its way.
pub fn page() -> String {
    let (result, journal) = driven();
    html::render(&result, &samples::sources(), Some(&journal)).expect("html")
}

#[test]
fn a_failed_test_shows_where_the_vehicle_was_and_so_does_what_a_monitor_found() {
    let page = page();
    assert_eq!(page.matches(HEADING).count(), 1);
    assert_eq!(page.matches("<h3>Where the vehicle was</h3>").count(), 1);
    assert_eq!(page.matches("class=\"course\"").count(), 2);
    for words in [
        "hall &#60;1&#62;",
        "n1, n2",
        "order-7c1e, update 0",
        "<th scope=\"row\">Arrow 1</th>",
        "m from the nearest edge of the base, last node n1, driving",
    ] {
        assert!(page.contains(words), "{words:?} is missing");
    }
}

#[test]
fn a_passed_test_and_one_without_a_journal_have_no_picture() {
    let (mut result, journal) = driven();
    let bare = html::render(&result, &samples::sources(), None).expect("html");
    assert!(!bare.contains("class=\"course\""));
    result.monitors.clear();
    result.tests[0].verdict = Some(Verdict::Pass);
    let passed = html::render(&result, &samples::sources(), Some(&journal)).expect("html");
    assert!(!passed.contains("class=\"course\""));
}

#[test]
fn a_page_has_a_bounded_number_of_pictures() {
    let (mut result, journal) = driven();
    let test = result.tests[0].clone();
    for at in 0..200 {
        let mut another = test.clone();
        another.id = format!("order/another-{at}");
        result.tests.push(another);
    }
    let page = html::render(&result, &samples::sources(), Some(&journal)).expect("html");
    assert_eq!(page.matches("class=\"course\"").count(), 40);
}

#[test]
fn a_run_with_a_driving_test_that_fails_draws_it_and_draws_it_again_from_its_bundle() {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest().clone();
    let mut request = VirtualRun::of(&library, &pack);
    request
        .tests
        .retain(|test| test.id == "order-rejection/lower-update-id");
    request.faults = vec!["outdated-update-taken-over".to_owned()];
    request.begun = "2026-01-01T08:00:00Z".parse().expect("a time");
    let finished = run_silently(&library, &pack, request).expect("a run");
    let folder = tempfile::tempdir().expect("a folder");
    let bundle = Bundle::open(folder.path());
    let quoted = sources(&library, &pack);
    let write = |result: &RunResult, journal: &Journal| {
        write_all(&bundle, result, &quoted, journal, Inconclusive::Error).expect("written");
        std::fs::read_to_string(folder.path().join("report.html")).expect("a page")
    };
    let mut writer = bundle.journal().expect("a journal");
    for entry in finished.recorder.journal().entries() {
        writer.write(&entry.record).expect("written");
    }
    drop(writer);
    let page = write(&finished.result, finished.recorder.journal());
    let failed: Vec<&str> = page
        .split("<details class=\"test ")
        .skip(1)
        .filter(|card| card.contains(HEADING))
        .collect();
    assert!(
        !failed.is_empty() && failed.iter().all(|card| card.starts_with("of-fail")),
        "{}",
        failed.len()
    );
    let svg = failed[0]
        .split_once("<svg xmlns")
        .and_then(|(_, rest)| rest.split_once("</svg>"));
    let (svg, _) = svg.expect("a picture");
    for class in ["base", "horizon", "after", "vehicle"] {
        assert!(svg.contains(&format!("class=\"{class}\"")), "{class}: {svg}");
    }
    let read = vda5050_tck::journal::file::read(&folder.path().join("journal.jsonl"));
    let mut again = read.expect("a journal").journal;
    again.set_names(&Arc::new(finished.recorder.journal().names().clone()));
    assert!(
        write(&finished.result, &again) == page,
        "another page from the same bundle"
    );
}
