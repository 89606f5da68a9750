//! Tests of the checks on edges with a trajectory.

use std::f64::consts::FRAC_PI_4;

use serde_json::{Value, json};

use super::tests::Drive;

/// From n1 (0, 0) to n2 (4, 0) in a bow to the left, one metre away from the line at its tip.
fn bow() -> Value {
    json!({ "degree": 2, "knotVector": [0, 0, 0, 1, 1, 1], "controlPoints": [
        { "x": 0, "y": 0 }, { "x": 2, "y": 2 }, { "x": 4, "y": 0 },
    ] })
}

fn line(from: (f64, f64), to: (f64, f64)) -> Value {
    let point = |(x, y): (f64, f64)| json!({ "x": x, "y": y });
    json!({ "degree": 1, "knotVector": [0, 0, 1, 1], "controlPoints": [point(from), point(to)] })
}

fn on_edge(edge: &Value, places: &[(f64, f64, f64)]) -> Drive {
    let mut drive = Drive::with_edge(edge);
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), Some((0.0, 0.0)));
    for place in places {
        drive.seen(0.5, 1, *place, Some((1.0, 0.0)));
    }
    drive
}

const FOLLOWED: &str = "motion/trajectory";

#[test]
fn a_vehicle_on_the_curve_is_right_and_one_on_the_straight_line_is_not() {
    let edge = json!({ "trajectory": bow() });
    on_edge(&edge, &[(1.0, 0.8, 0.5), (2.0, 1.1, 0.0)]).right(FOLLOWED);
    on_edge(&edge, &[(2.0, 0.0, 0.0)]).wrong(FOLLOWED, &["-"]);
    // Near a node the curve cannot be told from the line, and in a corridor it may be left.
    on_edge(&edge, &[(0.2, 0.1, 0.0), (3.9, 0.0, 0.0)]).not_judged(FOLLOWED);
    let corridor = json!({ "leftWidth": 2.0, "rightWidth": 2.0 });
    on_edge(
        &json!({ "trajectory": bow(), "corridor": corridor }),
        &[(2.0, 0.0, 0.0)],
    )
    .not_judged(FOLLOWED);
    on_edge(&json!({ "trajectory": { "degree": 3 } }), &[(2.0, 3.0, 0.0)]).not_judged(FOLLOWED);
}

const OWN_WAY: &str = "motion/trajectory-disregarded";

#[test]
fn a_way_of_its_own_is_one_that_is_nowhere_on_the_curve() {
    let edge = json!({ "trajectory": bow() });
    on_edge(&edge, &[(1.0, 0.8, 0.5), (2.0, 1.1, 0.0)]).right(OWN_WAY);
    on_edge(&edge, &[(2.0, 0.0, 0.0)]).wrong(OWN_WAY, &["ORD-18 warning"]);
    on_edge(&edge, &[(1.5, 0.0, 0.0), (2.0, 0.0, 0.0)]).wrong(OWN_WAY, &["ORD-18 warning", "ORD-18"]);
    on_edge(&edge, &[(2.0, 1.0, 0.0), (2.5, 0.0, 0.0), (3.0, 0.0, 0.0)]).wrong(OWN_WAY, &["ORD-18 warning"]);
}

const ORIENTATION: &str = "motion/curve-orientation";

#[test]
fn the_orientation_is_meant_against_the_curve() {
    let edge = json!({ "trajectory": bow(), "orientation": 0.0, "orientationType": "TANGENTIAL" });
    // At x = 3.5 the bow points 0.64 rad to the right.
    on_edge(&edge, &[(3.5, 0.4375, -0.6)]).right(ORIENTATION);
    on_edge(&edge, &[(3.5, 0.4375, 0.0)]).wrong(ORIENTATION, &["-"]);
    on_edge(&edge, &[(3.5, 0.4375, -0.33)]).wrong(ORIENTATION, &["- warning"]);
    // Where it leads as the line does, in the first half, and against the map, nothing is said about it.
    on_edge(&edge, &[(2.2, 1.0, FRAC_PI_4), (0.5, 0.4375, 0.0)]).not_judged(ORIENTATION);
    let global = json!({ "trajectory": bow(), "orientation": 0.0, "orientationType": "GLOBAL" });
    on_edge(&global, &[(3.5, 0.4375, 0.0)]).not_judged(ORIENTATION);
}

const CORRIDOR: &str = "motion/corridor";

#[test]
fn a_corridor_is_as_wide_as_it_is_on_that_side() {
    let corridor = json!({ "leftWidth": 1.0, "rightWidth": 0.5 });
    let edge = json!({ "trajectory": line((0.0, 0.0), (4.0, 0.0)), "corridor": corridor });
    on_edge(&edge, &[(2.0, 1.05, 0.0), (3.0, -0.5, 0.0)]).right(CORRIDOR);
    on_edge(&edge, &[(2.0, 1.2, 0.0)]).wrong(CORRIDOR, &["-"]);
    on_edge(&edge, &[(2.0, -0.8, 0.0)]).wrong(CORRIDOR, &["-"]);
    on_edge(&edge, &[(2.0, 0.1, 0.0)]).not_judged(CORRIDOR);
    // How wide the vehicle is, nobody has said.
    let corridor = json!({ "leftWidth": 1.0, "rightWidth": 0.5, "corridorRefPoint": "CONTOUR" });
    let edge = json!({ "trajectory": line((0.0, 0.0), (4.0, 0.0)), "corridor": corridor });
    on_edge(&edge, &[(2.0, 0.9, 0.0)]).not_judged("motion/corridor-point");
}

const NEXT: &str = "motion/next-corridor";

#[test]
fn a_node_is_reported_inside_the_corridor_behind_it() {
    let next = json!({
        "trajectory": line((4.0, 0.0), (4.0, 4.0)), "corridor": { "leftWidth": 0.2, "rightWidth": 0.2 },
    });
    let reported = |x: f64| {
        let mut drive = Drive::ordered([json!({}), json!({}), json!({})], [json!({}), next.clone()]);
        drive.seen(0.0, 1, (3.0, 0.0, 0.0), Some((0.1, 0.0)));
        drive.seen(0.5, 2, (x, 0.0, 0.0), Some((0.1, 0.0)));
        drive
    };
    reported(3.9).right(NEXT);
    reported(3.3).wrong(NEXT, &["- warning"]);
    // It may have been there, and gone on since.
    reported(3.72).not_judged(NEXT);
}
