use super::*;
use crate::deviations::agv::FAULTS;

#[test]
fn a_vehicle_with_any_single_fault_lives_through_a_day() {
    for fault in FAULTS.iter() {
        let mut bench = Bench::with(config(), &[fault.name]);
        super::scenarios::day(&mut bench);
        bench.wait(30.0);
        let states = bench.publications("/state").len() + bench.publications("/states").len();
        assert!(states > 1, "{}", fault.name);
    }
}

#[test]
fn most_faults_show_in_some_scenario() {
    let run = |(config, scenario): &(AgvConfig, fn(&mut Bench)), faults: &[&str]| {
        let mut bench = Bench::with(config.clone(), faults);
        let before = bench.options();
        scenario(&mut bench);
        let after = bench.options();
        (bench.outputs, before, after)
    };
    let scenarios = super::scenarios::all();
    let good: Vec<_> = scenarios.iter().map(|scenario| run(scenario, &[])).collect();
    let shows = |name: &str| {
        // Named where a scenario panics.
        println!("{name}");
        scenarios
            .iter()
            .zip(&good)
            .any(|(scenario, good)| run(scenario, &[name]) != *good)
    };
    let hidden: Vec<&str> = FAULTS
        .iter()
        .map(|fault| fault.name)
        .filter(|name| !shows(name))
        .collect();
    // They need more than the scenarios here do; qualification shows each of them.
    insta::assert_snapshot!(hidden.join("\n"));
}

#[test]
fn an_unknown_fault_is_refused_by_name() {
    let error = deviations::built(config(), &["no-will", "no-such-fault"]).unwrap_err();
    assert_eq!(error.to_string(), "the reference AGV has no fault `no-such-fault`");
}

#[test]
fn every_fault_breaks_a_requirement_and_says_what_is_wrong() {
    for fault in FAULTS.iter() {
        assert!(!fault.breaks.is_empty() && fault.wrong.ends_with('.'), "{}", fault.name);
    }
    assert!(FAULTS.len() >= 80);
}

#[test]
fn an_outdated_update_taken_over_is_taken_over() {
    let mut bench = Bench::with(config(), &["outdated-update-taken-over"]);
    bench.order(order("o1", 1, 0, "n1 n2 | n3"));
    bench.order(order("o1", 0, 0, "n1 n2 | n3"));
    assert_eq!(bench.state()["orderUpdateId"], 0);
    assert!(bench.error_types().is_empty());
}

#[test]
fn the_nul_byte_comes_with_periodic_states_only() {
    let mut bench = Bench::with(config(), &["nul-after-json"]);
    bench.wait(25.0);
    let ends: Vec<bool> = bench
        .publications("/state")
        .iter()
        .map(|state| state.payload.ends_with(b"}\0"))
        .collect();
    assert_eq!(ends, [false, true, true]);
}
