//! Ctrl-C: the run ends in good order, and what was decided is kept.

use std::time::{Duration, Instant};

use crate::bench::{Bench, Profile, REFUSAL};
use crate::broken::step_begun;
use crate::tool::{Running, tool};

/// Leaves the vehicle with an order until its postamble.
const WAITING: &str = "order-acceptance/horizon-not-entered";

/// Runs after both: it may do more to the vehicle.
const AFTERWARDS: &str = "connection/after-cut-listens-again";

/// Begins with a hook.
const GOODBYE: &str = "connection/graceful-goodbye";

#[test]
fn in_the_middle_of_a_test_the_vehicle_is_still_brought_back_and_the_report_is_partial() {
    let bench = Bench::new();
    let mut profile = Profile::default().with(&[("quiet", "40 s")]);
    profile.motion = true;
    let (mut run, port) = bench.start(&profile, &[WAITING, AFTERWARDS]);
    let _agv = bench.agv(port, &[]);
    // The vehicle waits at the decision point, with a horizon left that only a cancelOrder can end.
    step_begun(&bench, &mut run, (WAITING, "steps[1]"));
    run.interrupt();
    let interrupted = Instant::now();
    run.end().code(130);
    assert!(interrupted.elapsed() < Duration::from_secs(20), "it waited to the end");
    let journal = bench.journal();
    assert!(
        journal.contains("\"kind\":\"step-begun\",\"path\":\"finally"),
        "the postamble was left out"
    );
    assert!(
        !journal.contains(&format!("\"kind\":\"test-begun\",\"test\":\"{AFTERWARDS}\"")),
        "it went on"
    );
    assert!(journal.contains("interrupted by the user"));
    bench.is_partial();
}

#[test]
fn other_signals_that_ask_it_to_end_are_obeyed_like_ctrl_c() {
    for name in ["TERM", "HUP"] {
        let bench = Bench::new();
        let mut profile = Profile::default().with(&[("quiet", "40 s")]);
        profile.motion = true;
        let (mut run, port) = bench.start(&profile, &[WAITING]);
        let _agv = bench.agv(port, &[]);
        step_begun(&bench, &mut run, (WAITING, "steps[1]"));
        run.signal(name);
        run.end().code(130);
        let journal = bench.journal();
        assert!(
            journal.contains("cancelOrder"),
            "after {name} the vehicle was left with its order"
        );
        assert!(bench.bundle().join("junit.xml").exists(), "{name}");
        bench.is_partial();
    }
}

#[test]
fn while_it_waits_for_the_device_it_ends_at_once() {
    let bench = Bench::new();
    let (run, _) = bench.start(&Profile::default(), &[REFUSAL]);
    std::thread::sleep(Duration::from_millis(200));
    run.interrupt();
    let interrupted = Instant::now();
    run.end().code(130);
    assert!(interrupted.elapsed() < Duration::from_secs(10));
    bench.is_partial();
}

#[test]
fn in_virtual_time_it_ends_as_well() {
    let bench = Bench::new();
    let mut run = Running::start(&mut tool(bench.path(), &["run", "--virtual"]));
    run.until("a first test", |run| run.stdout().contains('\n').then_some(()));
    run.interrupt();
    run.end().code(130);
    bench.is_partial();
}

#[test]
fn a_hook_that_takes_for_ever_is_given_up() {
    let bench = Bench::new();
    let profile = Profile {
        more: "[hooks.shutdown]\nrun = [\"sleep\", \"300\"]\ntimeout = \"5 min\"\n[hooks.start]\nrun = [\"true\"]"
            .to_owned(),
        ..Profile::default()
    };
    let (mut run, port) = bench.start(&profile, &[GOODBYE]);
    let _agv = bench.agv(port, &[]);
    step_begun(&bench, &mut run, (GOODBYE, "steps[0]"));
    run.interrupt();
    let interrupted = Instant::now();
    run.end().code(130);
    assert!(
        interrupted.elapsed() < Duration::from_secs(20),
        "it waited for the hook"
    );
    let journal = bench.journal();
    assert!(journal.contains("given up: the user has interrupted the run"));
    bench.is_partial();
}
