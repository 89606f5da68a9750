//! The same seed gives the same run.

use serde_json::Value;

use crate::bench::Bench;

/// What a run of this seed decided, and how.
fn decided(seed: &str) -> Value {
    let bench = Bench::new();
    bench.run(&["run", "--virtual", "order-rejection", "instant-actions", "--seed", seed]).code(0);
    let mut result = bench.result();
    for name in ["started", "settings"] {
        result.as_object_mut().unwrap().remove(name);
    }
    result
}

#[test]
fn two_runs_in_virtual_time_with_one_seed_are_the_same_down_to_the_message() {
    let first = decided("5");
    assert_eq!(first, decided("5"));
    let others = decided("6");
    assert_eq!(first["verdict"], others["verdict"]);
    assert_ne!(first["run"], others["run"], "a seed names the run");
}
