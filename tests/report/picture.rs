//! The sequence diagram.

use std::collections::{BTreeMap, BTreeSet};

use roxmltree::Document;
use serde_json::json;
use vda5050_tck::journal::event::LinkFault;
use vda5050_tck::journal::{Event, Journal};
use vda5050_tck::report::sequence::{self, Options, ROW_LIMIT};

use crate::samples::{self, Recorder, state};

fn draw(journal: &Journal, marked: &BTreeMap<u64, String>, linked: &BTreeSet<u64>, limit: usize) -> String {
    let steps = BTreeMap::from([("steps[4]".to_owned(), "The refusal is reported".to_owned())]);
    let options = Options {
        id: "seq1",
        title: "What happened",
        linked,
        marked,
        steps: &steps,
        limit,
    };
    sequence::render(journal, (1, u64::MAX), &options).expect("svg")
}

fn plain(journal: &Journal) -> String {
    draw(journal, &BTreeMap::new(), &BTreeSet::new(), ROW_LIMIT)
}

#[test]
fn the_failing_sample_as_a_diagram() {
    let (result, journal) = samples::fail();
    let witness = result.tests[0].decisions[1].witness.expect("witness");
    let svg = draw(
        &journal,
        &BTreeMap::from([(witness, "fail".to_owned())]),
        &BTreeSet::from([witness]),
        ROW_LIMIT,
    );
    insta::assert_snapshot!("sequence_fail", svg);
    let document = Document::parse(&svg).expect("well-formed");
    assert!(svg.contains(&format!("<a href=\"#m{witness}\">")));
    assert_eq!(svg.matches("<a href").count(), 1, "only what the page shows is linked");
    let title = document
        .descendants()
        .find(|node| node.has_tag_name(("http://www.w3.org/2000/svg", "title")));
    assert_eq!(title.and_then(|title| title.text()), Some("What happened"));
}

#[test]
fn both_sightings_of_a_message_are_one_arrow() {
    let mut record = Recorder::new();
    record.receive("state", &state(1, 0, "n1", &json!([])));
    record.send("order", &samples::order(0, &["n1"], &[]));
    assert_eq!(plain(&record.journal).matches("class=\"arrow\"").count(), 2);
}

#[test]
fn a_message_the_tap_never_saw_comes_from_the_broker_and_one_that_was_lost_ends_there() {
    let mut record = Recorder::new();
    record.receive("state", &state(1, 0, "n1", &json!([])));
    record.deliver("connection", br#"{"connectionState":"CONNECTIONBROKEN"}"#);
    let svg = plain(&record.journal);
    assert!(
        svg.contains("x1=\"880\" y1=\"76\" x2=\"240\""),
        "from the device to the harness"
    );
    assert!(
        svg.contains("x1=\"560\" y1=\"116\" x2=\"240\""),
        "from the broker to the harness"
    );
    assert!(!svg.contains("class=\"unseen\""));
}

#[test]
fn without_a_tap_the_way_beyond_the_broker_is_drawn_as_unseen() {
    let mut record = Recorder::new();
    record.deliver("state", state(1, 0, "n1", &json!([])).to_string().as_bytes());
    assert!(plain(&record.journal).contains("class=\"unseen\""));
}

#[test]
fn states_that_say_nothing_new_are_counted_until_something_happens() {
    let mut record = Recorder::new();
    for header in 0..50 {
        record.wait(500).receive("state", &state(header, 0, "n1", &json!([])));
        record
            .wait(10)
            .receive("visualization", &json!({ "agvPosition": { "x": header } }));
    }
    record.harness(Event::Fault {
        fault: LinkFault::Cut { reset: true },
    });
    record.wait(500).receive("state", &state(51, 0, "n1", &json!([])));
    record.wait(500).receive("state", &state(52, 0, "n2", &json!([])));
    let svg = plain(&record.journal);
    assert_eq!(svg.matches("class=\"arrow\"").count(), 4, "{svg}");
    assert!(
        svg.contains("× 50, unchanged up to #198") && svg.contains("× 50, unchanged up to #200"),
        "{svg}"
    );
    assert!(svg.contains("link cut"));
}

#[test]
fn a_message_that_is_pointed_out_is_never_counted_away() {
    let mut record = Recorder::new();
    let seqs: Vec<u64> = (0..5)
        .map(|header| record.receive("state", &state(header, 0, "n1", &json!([]))))
        .collect();
    let svg = draw(
        &record.journal,
        &BTreeMap::from([(seqs[3], "fail".to_owned())]),
        &BTreeSet::new(),
        ROW_LIMIT,
    );
    assert!(svg.contains(&format!(">#{}</text>", seqs[3])) && svg.contains("▶ fail"));
}

#[test]
fn a_long_window_keeps_the_rows_around_what_is_pointed_out() {
    let mut record = Recorder::new();
    let mut middle = 0;
    for at in 0..2_000 {
        let seq = record.wait(100).receive("state", &state(at, at, "n1", &json!([])));
        middle = if at == 1_200 { seq } else { middle };
    }
    let svg = draw(
        &record.journal,
        &BTreeMap::from([(middle, "fail".to_owned())]),
        &BTreeSet::new(),
        40,
    );
    assert_eq!(svg.matches("class=\"arrow\"").count(), 40);
    assert!(svg.contains("▶ fail"));
    assert_eq!(svg.matches("left out").count(), 2);
    let ends = draw(&record.journal, &BTreeMap::new(), &BTreeSet::new(), 40);
    assert_eq!(ends.matches("left out").count(), 1, "without a mark both ends stay");
}

#[test]
fn an_empty_window_and_one_beyond_the_journal_are_drawn_empty() {
    let svg = plain(&Journal::new());
    assert!(Document::parse(&svg).is_ok());
    let steps = BTreeMap::new();
    let (marked, linked) = (BTreeMap::new(), BTreeSet::new());
    let options = Options {
        id: "s",
        title: "t",
        linked: &linked,
        marked: &marked,
        steps: &steps,
        limit: 10,
    };
    let journal = samples::fail().1;
    for window in [(500, 600), (9, 3), (0, 0)] {
        assert!(
            !sequence::render(&journal, window, &options)
                .expect("svg")
                .contains("class=\"arrow\"")
        );
    }
}

#[test]
fn hostile_strings_stay_text() {
    let (_, journal, _) = samples::hostile();
    let svg = plain(&journal);
    assert!(Document::parse(&svg).is_ok(), "{svg}");
    assert!(!svg.contains("<script"));
}
