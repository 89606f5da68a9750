//! The example of a report in `reports/example/` is what the program makes today.
//!
//! To make it anew: `INSTA_UPDATE=always cargo test --test example`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::path::{Path, PathBuf};

use vda5050_tck::pack::Role;
use vda5050_tck::run::{Bundle, Library, VirtualRun, run_silently, sources, write_all};

const FILES: [&str; 5] = [
    "journal.jsonl",
    "junit.xml",
    "manifest.json",
    "report.html",
    "result.json",
];

fn make(folder: &Path) {
    let library = Library::load(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest().clone();
    let mut request = VirtualRun::of(&library, &pack);
    let wanted = [
        "order-rejection/lower-update-id",
        "order-update/",
        "cancel-order/while-driving",
    ];
    request.tests = library.tests(Role::Agv, &pack.id);
    request
        .tests
        .retain(|test| wanted.iter().any(|prefix| test.id.starts_with(prefix)));
    request.complete = false;
    request.faults = vec!["outdated-update-taken-over".to_owned()];
    request.begun = "2026-01-01T08:00:00Z".parse().expect("a time");
    "example".clone_into(&mut request.run);
    let finished = run_silently(&library, &pack, request).expect("a run");
    let bundle = Bundle::open(folder);
    let mut writer = bundle.journal().expect("a journal");
    for entry in finished.recorder.journal().entries() {
        writer.write(&entry.record).expect("written");
    }
    let quoted = sources(&library.rules.catalogue, &library.rules.suites, &pack);
    write_all(&bundle, &finished.result, &quoted, finished.recorder.journal()).expect("written");
}

#[test]
fn the_example_is_what_the_program_makes_today() {
    let checked_in = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("reports/example");
    let made = tempfile::tempdir().expect("a folder");
    make(made.path());
    if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        std::fs::create_dir_all(&checked_in).expect("a folder");
        for file in FILES {
            std::fs::copy(made.path().join(file), checked_in.join(file)).expect("copied");
        }
    }
    for file in FILES {
        let today = std::fs::read(made.path().join(file)).expect("made");
        let then = std::fs::read(checked_in.join(file)).unwrap_or_default();
        assert!(
            today == then,
            "reports/example/{file} is not what the program makes today; look at the difference, and make it anew with\n\
             INSTA_UPDATE=always cargo test --test example"
        );
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
