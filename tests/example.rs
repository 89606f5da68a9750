//! The example of a report in `reports/example/` has the shape of what the program makes today. It is made anew on release:
//! `INSTA_UPDATE=always cargo test --test example`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde_json::Value;
use vda5050_tck::report::junit::Inconclusive;
use vda5050_tck::run::{Bundle, VirtualRun, run_silently, sources, write_all};

const FILES: [&str; 6] = [
    "journal.jsonl",
    "junit-requirements.xml",
    "junit.xml",
    "manifest.json",
    "report.html",
    "result.json",
];

fn make(folder: &Path) {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest().clone();
    let mut request = VirtualRun::of(&library, &pack);
    let wanted = [
        "order-rejection/lower-update-id",
        "order-update/",
        "cancel-order/while-driving",
    ];
    request
        .tests
        .retain(|test| wanted.iter().any(|prefix| test.id.starts_with(prefix)));
    request.faults = vec!["outdated-update-taken-over".to_owned()];
    request.begun = "2026-01-01T08:00:00Z".parse().expect("a time");
    "example".clone_into(&mut request.run);
    let finished = run_silently(&library, &pack, request).expect("a run");
    let bundle = Bundle::open(folder);
    let mut writer = bundle.journal().expect("a journal");
    for entry in finished.recorder.journal().entries() {
        writer.write(&entry.record).expect("written");
    }
    let quoted = sources(&library, &pack);
    write_all(
        &bundle,
        &finished.result,
        &quoted,
        finished.recorder.journal(),
        Inconclusive::Error,
    )
    .expect("written");
}

#[test]
fn the_example_has_the_shape_of_what_the_program_makes_today() {
    let checked_in = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("reports/example");
    let made = tempfile::tempdir().expect("a folder");
    make(made.path());
    if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        std::fs::create_dir_all(&checked_in).expect("a folder");
        for file in FILES {
            std::fs::copy(made.path().join(file), checked_in.join(file)).expect("copied");
        }
    }
    let shape = |folder: &Path, file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).unwrap_or_else(|_| panic!("{file} is missing"));
        let mut all = BTreeSet::new();
        match file.rsplit('.').next() {
            Some("json") => paths(&serde_json::from_str(&text).expect("JSON"), "", &mut all),
            Some("jsonl") => {
                for line in text.lines() {
                    let record: Value = serde_json::from_str(line).expect("JSON");
                    all.extend(record.as_object().expect("an object").keys().cloned());
                }
            }
            Some("xml") => {
                let document = roxmltree::Document::parse(&text).expect("XML");
                let elements = document.descendants().filter(roxmltree::Node::is_element);
                all.extend(elements.map(|element| element.tag_name().name().to_owned()));
            }
            _ => all.extend(
                text.split("<h2")
                    .skip(1)
                    .filter_map(|rest| Some(rest.split_once("</h2>")?.0.to_owned())),
            ),
        }
        assert!(!all.is_empty(), "{file} is empty");
        all
    };
    for file in FILES {
        let (today, then) = (shape(made.path(), file), shape(&checked_in, file));
        let other: Vec<&String> = today.symmetric_difference(&then).collect();
        assert!(
            other.is_empty(),
            "reports/example/{file} has another shape than what the program makes today: {other:#?}\nMake it anew with\n\
             INSTA_UPDATE=always cargo test --test example"
        );
    }
}

/// The members of a JSON text, the elements of an array counting as one. Names that are data stand for themselves.
fn paths(value: &Value, at: &str, all: &mut BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members {
                let at = format!("{at}/{name}");
                all.insert(at.clone());
                paths(member, &at, all);
            }
        }
        Value::Array(elements) => elements
            .iter()
            .for_each(|element| paths(element, &format!("{at}/-"), all)),
        _ => {}
    }
}

#[test]
fn the_same_run_twice_gives_the_same_bytes() {
    let (one, two) = (
        tempfile::tempdir().expect("a folder"),
        tempfile::tempdir().expect("a folder"),
    );
    make(one.path());
    make(two.path());
    for file in FILES {
        let bytes = |folder: &Path| std::fs::read(folder.join(file)).expect("made");
        assert!(bytes(one.path()) == bytes(two.path()), "{file}");
    }
}
