//! A vehicle is tested on a layout as integrators write them: its curves and its actions go into orders as far as the vehicle takes
//! them, and the plan says what does not.

use std::fs;

use crate::bench::{Bench, Profile};
use crate::tool::{Running, tool};

/// A test that drives over four nodes, one by one.
const DRIVING: &str = "order-acceptance/node-by-node";

fn fixture(name: &str) -> String {
    format!("{}/fixtures/layouts/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Writes a profile with this layout in the place of the usual nodes.
fn with_layout(bench: &Bench, lif: &str) {
    let profile = Profile {
        motion: true,
        ..Profile::default()
    };
    let text = profile.text();
    let (head, rest) = text.split_once("[layout]").unwrap();
    let (_, time) = rest.split_once("[time]").unwrap();
    let text = format!("{head}[layout]\nlif = \"{lif}\"\n[time]{time}");
    fs::write(bench.path().join("device.toml"), text).unwrap();
}

/// Runs the driving test with a vehicle of this kind; gives the orders it got, as the journal has them.
fn driven(bench: &Bench, vehicle: &str) -> Vec<String> {
    let mut running = Running::start(&mut tool(bench.path(), &["run", "--profile", "device.toml", DRIVING]));
    let address = running.line("the device is expected at mqtt://");
    let port = address.rsplit(':').next().and_then(|port| port.parse().ok()).unwrap();
    let _vehicle = bench.agv_with(port, &["--vehicle", vehicle]);
    running.end().code(0);
    let journal = bench.journal();
    let orders = journal
        .lines()
        .filter(|line| line.contains("/order\"") && line.contains("nodeId"));
    orders.map(str::to_owned).collect()
}

#[test]
fn curves_and_required_actions_of_a_layout_go_into_the_orders_of_a_vehicle_that_takes_them() {
    let bench = Bench::new();
    with_layout(&bench, &fixture("curved.lif.json"));
    let orders = driven(&bench, "free");
    for said in ["trajectory", "controlPoints", "beep", "maxHeight", "TANGENTIAL"] {
        assert!(orders.iter().any(|order| order.contains(said)), "no order says {said}");
    }
    assert!(
        !orders.iter().any(|order| order.contains("minHeight")),
        "the vehicle does not take it"
    );
    let limits = bench.result()["limits"].to_string();
    assert!(limits.contains("minHeight of 1 edge goes into no order"), "{limits}");
    bench.is_whole();
}

#[test]
fn a_vehicle_that_takes_no_curves_gets_none_from_a_draft_of_lif_2() {
    let bench = Bench::new();
    with_layout(&bench, &fixture("curved-2.lif.json"));
    let orders = driven(&bench, "usual");
    assert!(orders.iter().any(|order| order.contains("beep")));
    assert!(!orders.iter().any(|order| order.contains("trajectory")));
    let limits = bench.result()["limits"].to_string();
    assert!(limits.contains("trajectory of 2 edges goes into no order"), "{limits}");
    assert!(limits.contains("corridor of 1 edge is not read"), "{limits}");
}

#[test]
fn a_curve_that_misses_its_node_is_named_by_validate_and_in_the_plan_and_is_never_sent() {
    let bench = Bench::new();
    let text = fs::read_to_string(fixture("curved.lif.json")).unwrap();
    let wrong = text.replacen("\"x\": 0.0, \"y\": 2.0}]", "\"x\": 9.0, \"y\": 2.0}]", 1);
    assert_ne!(text, wrong);
    fs::write(bench.path().join("wrong.lif.json"), wrong).unwrap();
    let named = "the curve of edge `A1-A2` ends 9.0 m from node `A2`";
    bench.run(&["validate", "wrong.lif.json"]).code(0).prints(named);
    with_layout(&bench, "wrong.lif.json");
    bench
        .run(&["run", "--profile", "device.toml", "--plan", DRIVING])
        .code(0)
        .prints(named)
        .prints("not in orders")
        .prints("whether trajectory of 2 edges goes into orders is open");
    let orders = driven(&bench, "free");
    let curves = orders.iter().map(|order| order.matches("controlPoints").count()).max();
    assert_eq!(
        curves,
        Some(0),
        "only the other direction has a curve that can be driven"
    );
}
