use super::*;
use std::f64::consts::FRAC_PI_4;

/// A vehicle that plans its way, follows trajectories and keeps to corridors.
pub(super) fn free() -> AgvConfig {
    let mut config = AgvConfig {
        trajectories: true,
        plans: true,
        ..config()
    };
    config.features.insert("corridors".to_owned());
    config
}

/// A vehicle on lines: from n1 to the left n6, straight n5, to the right n2.
pub(super) fn line_guided() -> AgvConfig {
    let branch = |from: &str, direction: &str, to: &str| (from.to_owned(), direction.to_owned(), to.to_owned());
    AgvConfig {
        branches: Some(vec![
            branch("n1", "left", "n6"),
            branch("n1", "right", "n2"),
            branch("n1", "straight", "n5"),
            branch("n2", "back", "n1"),
        ]),
        stops_between_nodes: false,
        ..config()
    }
}

fn straight() -> Value {
    json!({ "degree": 1, "knotVector": [0, 0, 1, 1], "controlPoints": [{ "x": 0, "y": 0 }, { "x": 3, "y": 0 }] })
}

/// A bow to the left from n1 to n2, that begins at 45 degrees and is 0.75 m away from the line at its tip.
fn bow() -> Value {
    json!({ "degree": 2, "knotVector": [0, 0, 0, 1, 1, 1], "controlPoints": [
        { "x": 0, "y": 0 }, { "x": 1.5, "y": 1.5 }, { "x": 3, "y": 0 },
    ] })
}

fn over(trajectory: Value) -> Value {
    with(order("o1", 0, 0, "n1 n2 | n3"), "/edges/0/trajectory", trajectory)
}

fn in_corridor(point: &str) -> Value {
    let corridor = json!({ "leftWidth": 0.8, "rightWidth": 0.6, "corridorRefPoint": point });
    with(over(straight()), "/edges/0/corridor", corridor)
}

fn seen(bench: &mut Bench, seconds: f64) -> (f64, f64, f64) {
    bench.wait(seconds);
    let id = format!("look-{}", bench.header_id);
    bench.instant("stateRequest", &id, json!({}));
    let state = bench.state();
    let member = |name: &str| state["agvPosition"][name].as_f64().unwrap();
    (member("x"), member("y"), member("theta"))
}

#[test]
fn a_curve_is_followed_along_its_tangent() {
    let mut bench = Bench::with(free(), &[]);
    bench.order(over(bow()));
    // It turns by 45 degrees in a quarter of a second, and the bow is about 3.44 m long.
    let (x, y, theta) = seen(&mut bench, 0.25 + 0.05);
    assert!(x > 0.0 && (theta - FRAC_PI_4).abs() < 0.1, "{x} {y} {theta}");
    let (x, y2, theta) = seen(&mut bench, 0.81);
    assert!(
        y < y2 && (x - 1.5).abs() < 0.1 && (y2 - 0.75).abs() < 0.02 && theta.abs() < 0.1,
        "{x} {y2} {theta}"
    );
    bench.wait(3.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
    let mut cut = Bench::with(free(), &["trajectory-cut"]);
    cut.order(over(bow()));
    assert!(seen(&mut cut, 0.8).1.abs() < 1e-6);
}

#[test]
fn a_stop_on_a_curve_is_followed_by_its_rest() {
    let mut bench = Bench::with(free(), &[]);
    bench.order(over(bow()));
    bench.wait(1.0);
    bench.instant("startPause", "p", json!({}));
    let (x, y, _) = seen(&mut bench, 1.0);
    bench.instant("stopPause", "q", json!({}));
    let (x2, y2, _) = seen(&mut bench, 0.05);
    assert!((x - x2).hypot(y - y2) < 0.11 && y > 0.3);
    bench.wait(3.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn a_trajectory_is_refused_that_is_no_curve_or_leads_elsewhere_or_is_not_supported() {
    for (config, trajectory, error) in [
        (config(), straight(), "orderError"),
        (free(), json!({ "degree": 1 }), "validationError"),
        (free(), with(straight(), "/controlPoints/1/x", json!(1.0)), "orderError"),
    ] {
        let mut bench = Bench::with(config, &[]);
        bench.order(over(trajectory));
        assert_eq!(bench.error_types(), [error]);
        assert_eq!(bench.state()["orderId"], "");
    }
}

#[test]
fn an_obstacle_is_passed_within_the_corridor_or_waited_for() {
    for (point, aside) in [("KINEMATICCENTER", 0.72), ("CONTOUR", 0.36)] {
        let mut bench = Bench::with(free(), &[]);
        let order = in_corridor(point);
        bench.command("place-obstacle", json!({ "edgeId": order["edges"][0]["edgeId"] }));
        bench.order(order);
        let mut farthest: f64 = 0.0;
        for _ in 0..60 {
            farthest = farthest.max(seen(&mut bench, 0.05).1);
        }
        assert!((farthest - aside).abs() < 0.02, "{point}: {farthest}");
        assert_eq!(bench.state()["lastNodeId"], "n2");
    }
    let mut bench = Bench::with(free(), &[]);
    let order = over(straight());
    let edge = order["edges"][0]["edgeId"].clone();
    bench.command("place-obstacle", json!({ "edgeId": edge }));
    bench.order(order);
    bench.wait(5.0);
    assert_eq!(bench.state()["driving"], false);
    bench.command("remove-obstacle", json!({ "edgeId": edge }));
    bench.wait(5.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn outside_its_corridor_it_stops_and_says_so_until_it_is_back() {
    let mut bench = Bench::with(free(), &[]);
    bench.order(in_corridor("KINEMATICCENTER"));
    bench.wait(0.5);
    bench.command("push-out", json!({}));
    bench.wait(10.0);
    assert_eq!(
        (bench.error_types(), &bench.state()["driving"]),
        (vec!["outsideOfCorridor".to_owned()], &json!(false))
    );
    bench.command("move-to", json!({ "nodeId": "n1" }));
    assert!(bench.error_types().is_empty());
    bench.order(with(order("o2", 0, 0, "n1 n2"), "/orderId", json!("o2")));
    bench.wait(5.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn a_planned_path_stands_at_every_edge_and_a_given_one_is_kept() {
    let mut bench = Bench::with(free(), &[]);
    bench.order(over(bow()));
    let edges = bench.state()["edgeStates"].clone();
    assert_eq!(edges[0]["trajectory"], bow());
    assert_eq!(edges[1]["trajectory"]["controlPoints"][1]["x"], 6.0);
}

#[test]
fn on_lines_the_direction_decides_and_places_have_no_coordinates() {
    for (faults, direction, reached) in [
        (&[][..], "right", "n2"),
        (&[], "straight", "n5"),
        (&["direction-ignored"], "right", "n6"),
        (&["direction-mistaken"], "right", "n5"),
    ] {
        let mut bench = Bench::with(line_guided(), faults);
        bench.order(with(order("o1", 0, 0, "n1 n2"), "/edges/0/direction", json!(direction)));
        assert!(bench.state()["agvPosition"].is_null());
        bench.wait(5.0);
        assert_eq!(bench.state()["lastNodeId"], reached, "{direction} {faults:?}");
    }
    let mut bench = Bench::with(line_guided(), &[]);
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/edges/0/direction", json!("up")));
    assert_eq!(bench.error_types(), ["orderError"]);
}

/// What trajectories and corridors make of a vehicle.
pub(super) fn curved_ways(bench: &mut Bench) {
    bench.order(order("o0", 0, 0, "n1 n2 n3"));
    bench.wait(5.0);
    bench.command("move-to", json!({ "nodeId": "n1" }));
    bench.order(over(bow()));
    for _ in 0..8 {
        seen(bench, 0.3);
    }
    bench.instant("cancelOrder", "c", json!({}));
    for point in ["KINEMATICCENTER", "CONTOUR"] {
        bench.command("move-to", json!({ "nodeId": "n1" }));
        let order = with(in_corridor(point), "/orderId", json!(point));
        let edge = order["edges"][0]["edgeId"].clone();
        bench.command("place-obstacle", json!({ "edgeId": edge }));
        bench.order(order);
        for _ in 0..8 {
            seen(bench, 0.3);
        }
        bench.command("remove-obstacle", json!({ "edgeId": edge }));
        bench.instant("cancelOrder", point, json!({}));
    }
    bench.command("move-to", json!({ "nodeId": "n1" }));
    bench.order(with(in_corridor("KINEMATICCENTER"), "/orderId", json!("o3")));
    bench.wait(0.5);
    bench.command("push-out", json!({}));
    bench.wait(3.0);
}

/// Two branches of a junction.
pub(super) fn branches(bench: &mut Bench) {
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/edges/0/direction", json!("right")));
    bench.wait(5.0);
}
