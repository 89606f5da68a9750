//! Which tests are run, how much is said about them, and which failures a pipeline bears.

use crate::bench::{Bench, Profile, QUICK, REFUSAL};
use crate::tool::run;

const FAULT: [&str; 2] = ["--fault", "validation-error-fatal"];

fn ids(bench: &Bench) -> Vec<String> {
    let result = bench.result();
    let tests = result["tests"].as_array().unwrap().iter();
    tests.map(|test| test["id"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn tests_are_selected_by_what_they_decide_and_left_out_by_name() {
    let all = Bench::new();
    all.run(&["run", "--virtual", "--requirement", "ORD-REJ-02"]).code(0);
    let all = ids(&all);
    assert!(
        all.iter().any(|id| id == REFUSAL) && !all.iter().any(|id| id == QUICK),
        "{all:?}"
    );
    let fewer = Bench::new();
    fewer
        .run(&["run", "--virtual", "--requirement", "ORD-REJ-02", "--exclude", REFUSAL])
        .code(0);
    let fewer = ids(&fewer);
    assert_eq!(fewer.len() + 1, all.len());
    assert!(!fewer.iter().any(|id| id == REFUSAL));
}

#[test]
fn an_expression_selects_tests_and_lists_them() {
    let bench = Bench::new();
    let filter = format!("requirement(ORD-REJ-02) and not test({REFUSAL})");
    bench
        .run(&["run", "--virtual", "--filter", &filter, "--filter", "tag(stands)"])
        .code(0);
    let found = ids(&bench);
    assert!(!found.is_empty() && !found.iter().any(|id| id == REFUSAL), "{found:?}");
    let listed = run(&[
        "list",
        "tests",
        "--role",
        "agv",
        "--filter",
        "hook(set-mode) and tag(hook)",
    ])
    .code(0);
    assert!(listed.stdout.contains("hook set-mode") && !listed.stdout.contains(QUICK));
    run(&["list", "tests", "--filter", "tag(hok)"])
        .code(2)
        .says("did you mean `hook`?");
    run(&["list", "tests", "--filter", "hook(dispatch) and hook(set-mode)"]).code(4);
    run(&["run", "--virtual", "--filter", "chapter(9.9)"])
        .code(2)
        .says("this selects no test");
    run(&["run", "--virtual", "--filter", "(tag(moves)"])
        .code(2)
        .says("`)` was expected here");
}

#[test]
fn a_typo_in_a_selection_is_2_and_nothing_left_is_4() {
    run(&["run", "--virtual", "--requirement", "ORD-RJE-02"])
        .code(2)
        .says("no requirement matches");
    run(&["run", "--virtual", "--chapter", "cooking"])
        .code(2)
        .says("no chapter has");
    run(&["run", "--virtual", "--exclude", "no/such-test"])
        .code(2)
        .says("no test matches");
    run(&["run", "--virtual", QUICK, "--requirement", "ORD-REJ-02"]).code(4);
    run(&["run", "--virtual", REFUSAL, "--exclude", REFUSAL]).code(4);
    run(&["run", "--virtual", "--last-failed"])
        .code(2)
        .says("no latest run");
}

#[test]
fn what_failed_can_be_run_again_alone_and_the_first_failure_can_end_a_run() {
    let bench = Bench::new();
    let table = "order-rejection/unreadable";
    bench
        .run(&[&["run", "--virtual", QUICK, table, "--fail-fast"], &FAULT[..]].concat())
        .code(1);
    let result = bench.result();
    let tests = result["tests"].as_array().unwrap();
    let failed: Vec<&str> = tests
        .iter()
        .filter(|test| test["verdict"] == "fail")
        .map(|test| test["id"].as_str().unwrap())
        .collect();
    assert_eq!(failed.len(), 1, "{failed:?}");
    let left_out = tests
        .iter()
        .filter(|test| test["reason"].as_str().is_some_and(|why| why.contains("--fail-fast")));
    assert!(left_out.count() > 0);
    let again = bench
        .run(&[&["run", "--virtual", "--last-failed"], &FAULT[..]].concat())
        .code(1);
    let lines: Vec<&str> = again.stdout.lines().filter(|line| line.starts_with("fail ")).collect();
    assert!(lines.len() == 1 && lines[0].contains(failed[0]), "{}", again.stdout);
    assert!(!again.stdout.contains(QUICK));
}

#[test]
fn findings_stand_below_the_verdict_and_as_much_is_said_as_is_wanted() {
    let usual = run(&[&["run", "--virtual", QUICK, REFUSAL, "--slowest", "1"], &FAULT[..]].concat()).code(1);
    let place = |text: &str| {
        let found = usual.stdout.find(text);
        found.unwrap_or_else(|| panic!("no {text}:\n{}", usual.stdout))
    };
    assert!(place("Slowest tests:") < place("\nFAIL  vda5050-tck"));
    assert!(place("\nFAIL  vda5050-tck") < place("Findings:"));
    assert!(place("      seen   ") < place("\ntests "));
    let only = run(&[&["run", "--virtual", QUICK, REFUSAL, "--failures"], &FAULT[..]].concat()).code(1);
    assert!(
        !only.stdout.contains(QUICK) && only.stdout.contains(REFUSAL),
        "{}",
        only.stdout
    );
    let quiet = run(&[&["run", "--virtual", QUICK, REFUSAL, "-q"], &FAULT[..]].concat()).code(1);
    assert!(quiet.stdout.starts_with("FAIL  "), "{}", quiet.stdout);
}

#[test]
#[cfg(unix)]
fn the_latest_report_has_a_name_that_stays() {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", QUICK]).code(0);
    bench.run(&["report", "reports/latest", "--verify"]).code(0);
}

#[test]
fn a_known_failure_changes_the_exit_code_and_nothing_else() {
    let known = |entry: &str| Profile {
        more: format!("[known]\n{entry}\n"),
        ..Profile::default()
    };
    let run = |profile: &Profile| {
        let bench = Bench::new();
        let (run, port) = bench.start(profile, &[REFUSAL]);
        let _device = bench.agv(port, &FAULT[1..]);
        let ended = run.end();
        let verdict = bench.result()["verdict"].clone();
        assert_eq!(verdict, "fail");
        ended
    };
    let borne = format!("\"{REFUSAL}\" = {{ reason = \"ticket 1\", until = \"2999-12-31\" }}");
    run(&known(&borne))
        .code(0)
        .prints("FAIL  ACME 0001")
        .prints("known failures");
    let expired = format!("\"{REFUSAL}\" = {{ reason = \"ticket 1\", until = \"2020-12-31\" }}");
    run(&known(&expired)).code(1).prints("expired");
    let other = "HDR-01 = { reason = \"ticket 1\", until = \"2999-12-31\" }";
    run(&known(other))
        .code(1)
        .prints("failures that are not known")
        .prints("take it out");
}
