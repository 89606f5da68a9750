//! Two runs with one seed are alike.

use serde_json::Value;

use crate::bench::{Bench, REFUSAL};

/// What a run of this seed decided, and how.
fn decided(tests: &str, seed: &str) -> Value {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", tests, "--seed", seed]).code(0);
    let mut result = bench.result();
    for name in ["started", "settings"] {
        result.as_object_mut().unwrap().remove(name);
    }
    // The clock of the day stands in what some assertions expect.
    let times = regex::Regex::new(r"\d{4}-\d\d-\d\dT[\d:.]+Z").unwrap();
    serde_json::from_str(&times.replace_all(&result.to_string(), "TIME")).unwrap()
}

#[test]
fn two_runs_in_virtual_time_with_one_seed_are_the_same_down_to_the_message() {
    let first = decided("instant-actions", "5");
    assert_eq!(first, decided("instant-actions", "5"));
}

#[test]
fn another_seed_gives_other_names_and_the_same_verdict() {
    let (first, second) = (decided(REFUSAL, "5"), decided(REFUSAL, "6"));
    assert_eq!(first["verdict"], second["verdict"]);
    assert_ne!(first["run"], second["run"]);
}
