//! One mistake per file of `fixtures/bad-suites/`: found, named by its code, shown at its place with a hint.
//!
//! The first line of a file names the code it expects. The file is read as if it lay at
//! `suites/agv/bad/<name>.yaml`, a `monitor-…` below `suites/monitors/`, a `state-…` below `suites/states/` with
//! a test that uses it, a `master-control-…` below `suites/master-control/`. Every other mistake in it would be a
//! second diagnostic, and the test would fail.

#![allow(clippy::expect_used, clippy::panic)]

use std::fmt::Write;
use std::path::Path;

use vda5050_tck::diagnostic::Diagnostic;
use vda5050_tck::pack::{Catalogue, Hooks, Packs};
use vda5050_tck::suite::{CheckInfo, PackVocabulary, Suites};

const CHECKS: [CheckInfo; 1] = [CheckInfo {
    name: "header/id-rises",
    decides: &["HDR-02"],
    arguments: &["topic"],
    needs: &[],
}];

fn good_state(name: &str) -> (String, String) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("fixtures/good-suites/states/{name}.yaml"));
    let text = std::fs::read_to_string(file).expect("a good state");
    (format!("suites/states/{name}.yaml"), text)
}

fn files(name: &str, text: &str) -> Vec<(String, String)> {
    let mut files = vec![good_state("idle"), good_state("reach")];
    if name.starts_with("state-") {
        files.push((format!("suites/states/{name}.yaml"), text.to_owned()));
        let user = [
            "test: bad/user",
            "title: Uses the state",
            "device: agv",
            "spec: \">=2.0, <3\"",
            "why: A state is only read where it is used.",
            "given:",
            &format!("  - use: {name}"),
            "steps:",
            "  - expect: state",
            "    checks: [STATE-01]",
            "    within: 5 s",
        ];
        files.push(("suites/agv/bad/user.yaml".to_owned(), user.join("\n")));
    } else if name.starts_with("monitor-") {
        files.push((format!("suites/monitors/bad/{name}.yaml"), text.to_owned()));
    } else if name.starts_with("master-control-") {
        files.push((format!("suites/master-control/bad/{name}.yaml"), text.to_owned()));
    } else {
        files.push((format!("suites/agv/bad/{name}.yaml"), text.to_owned()));
    }
    files
}

#[test]
fn every_bad_suite_yields_the_one_diagnostic_it_expects() {
    let assets = vda5050_tck::embedded();
    let packs = Packs::load(&assets).expect("packs");
    let catalogue = Catalogue::load(&assets).expect("catalogue");
    let hooks = Hooks::load(&assets).expect("hooks");
    let vocabulary = PackVocabulary::new(&packs, &catalogue, &hooks);
    let mut count = 0;
    let mut others = String::new();
    insta::glob!("../fixtures/bad-suites", "*.yaml", |path| {
        count += 1;
        let text = std::fs::read_to_string(path).expect("text");
        let name = path.file_stem().expect("name").to_string_lossy();
        let expected = text.lines().next().and_then(|line| line.strip_prefix("# expect: "));
        let expected = expected.unwrap_or_else(|| panic!("{name}: the first line is `# expect: CODE`"));
        let files = files(&name, &text);
        let files = files.iter().map(|(path, text)| (path.as_str(), text.as_str()));
        let problems = Suites::load_files(files, &vocabulary, &CHECKS)
            .err()
            .unwrap_or_default();
        let rendered = problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
        let codes: Vec<&str> = problems.iter().map(|problem: &Diagnostic| problem.code).collect();
        if codes != [expected] {
            let _ = writeln!(others, "{name}: {expected} was expected\n{rendered}");
        }
        insta::assert_snapshot!("diagnostic", rendered);
    });
    assert!(others.is_empty(), "{others}");
    assert!(count >= 60, "only {count} bad suites");
}
