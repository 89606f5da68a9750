use super::*;

fn near(a: &Value, b: f64) -> bool {
    (a.as_f64().unwrap() - b).abs() < 1e-6
}

#[test]
fn position_and_velocity_are_those_of_the_way() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.75);
    bench.instant("stateRequest", "s", json!({}));
    let state = bench.state();
    assert!(near(&state["agvPosition"]["x"], 1.5) && near(&state["velocity"]["vx"], 2.0));
    bench.wait(0.75);
    let state = bench.state();
    assert_eq!((&state["lastNodeId"], &state["driving"]), (&json!("n2"), &json!(false)));
    assert!(near(&state["agvPosition"]["x"], 3.0) && near(&state["velocity"]["vx"], 0.0));
}

#[test]
fn the_vehicle_turns_towards_its_way_and_says_so() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n6"));
    bench.wait(0.25);
    bench.instant("stateRequest", "s", json!({}));
    assert!(near(
        &bench.state()["agvPosition"]["theta"],
        std::f64::consts::FRAC_PI_4
    ));
    assert_eq!(bench.state()["driving"], true);
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n6");
}

#[test]
fn a_node_with_an_orientation_is_traversed_once_the_vehicle_has_it() {
    let mut bench = Bench::new();
    let position = json!({ "x": 3.0, "y": 0.0, "theta": 1.5, "allowedDeviationTheta": 0.1, "mapId": "hall" });
    bench.order(with(order("o1", 0, 0, "n1 n2 n3"), "/nodes/1/nodePosition", position));
    bench.wait(20.0);
    let states = bench.states();
    let there = states.iter().find(|state| state["lastNodeId"] == "n2").unwrap();
    assert!(near(&there["agvPosition"]["theta"], 1.5));
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn an_edge_driven_backwards_shows_a_negative_speed() {
    for edge in [("orientation", json!(3.1)), ("orientation", json!(-3.1))] {
        let mut bench = Bench::new();
        bench.order(with(
            order("o1", 0, 0, "n1 n2"),
            &format!("/edges/0/{}", edge.0),
            edge.1,
        ));
        bench.wait(1.5);
        bench.instant("stateRequest", "s", json!({}));
        assert!(near(&bench.state()["velocity"]["vx"], -2.0));
    }
}

#[test]
fn the_speed_of_the_edge_is_kept() {
    let mut bench = Bench::new();
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/edges/0/maxSpeed", json!(0.5)));
    bench.wait(5.9);
    assert_eq!(bench.state()["lastNodeId"], "n1");
    bench.wait(0.2);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn the_node_state_goes_with_the_last_node_in_one_state() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3 n4"));
    bench.wait(30.0);
    for state in bench.states() {
        let last = state["lastNodeSequenceId"].as_u64().unwrap();
        let open = state["nodeStates"]
            .as_array()
            .unwrap()
            .iter()
            .map(|node| node["sequenceId"].as_u64().unwrap());
        let edges = state["edgeStates"]
            .as_array()
            .unwrap()
            .iter()
            .map(|edge| edge["sequenceId"].as_u64().unwrap());
        if state["orderId"] == "o1" {
            assert!(open.chain(edges).all(|sequence_id| sequence_id > last));
        }
    }
}

#[test]
fn plain_nodes_are_passed_without_a_stop() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(2.9);
    assert!(bench.states().iter().skip(2).all(|state| state["driving"] == true));
    assert_eq!(bench.trail(), ["n1/0", "n2/2"]);
}

#[test]
fn the_map_changes_at_the_node_of_the_lift() {
    let mut bench = Bench::with(many_maps(), &[]);
    let upstairs = json!({ "x": 3.0, "y": 0.0, "mapId": "loft" });
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/1/nodePosition", upstairs));
    bench.wait(1.0);
    assert_eq!(bench.state()["agvPosition"]["mapId"], "hall");
    bench.wait(5.0);
    assert_eq!(bench.state()["agvPosition"]["mapId"], "loft");
}

#[test]
fn a_new_base_is_asked_for_on_the_last_edge_of_the_base_only() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2 n3 n4 | n5"));
    let asked = |bench: &Bench| bench.state()["newBaseRequest"] == true;
    assert!(!asked(&bench));
    bench.wait(1.6);
    assert!(!asked(&bench));
    bench.wait(1.5);
    assert!(asked(&bench));
    bench.order(order("o1", 1, 6, "n4"));
    assert!(!asked(&bench));
}

#[test]
fn semiautomatic_driving_is_slower() {
    let mut bench = Bench::new();
    bench.command("set-mode", json!({ "mode": "SEMIAUTOMATIC" }));
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(1.0);
    bench.instant("stateRequest", "s", json!({}));
    assert!(near(&bench.state()["velocity"]["vx"], 1.0));
}
