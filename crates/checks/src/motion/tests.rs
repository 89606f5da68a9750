use std::f64::consts::{FRAC_PI_2, PI};

use serde_json::{Value, json};

use crate::trace::{Trace, merged};

/// A drive from n1 (0, 0) over n2 (4, 0) to n3 (4, 4) as it is seen.
pub(super) struct Drive {
    trace: Trace,
    order: Value,
    /// What the next states have otherwise.
    over: Value,
}

impl Drive {
    /// Orders it, with the nodes and edges changed as given.
    pub fn ordered(nodes: [Value; 3], edges: [Value; 2]) -> Self {
        let places = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0)];
        let nodes: Vec<Value> = (1..)
            .zip(places)
            .zip(nodes)
            .map(|((number, (x, y)), over)| {
                let node = json!({
                    "nodeId": format!("n{number}"), "sequenceId": 2 * (number - 1), "released": true, "actions": [],
                    "nodePosition": { "x": x, "y": y, "mapId": "hall" },
                });
                merged(node, &over)
            })
            .collect();
        let edges: Vec<Value> = (1..)
            .zip(edges)
            .map(|(number, over)| {
                let edge = json!({
                    "edgeId": format!("e{number}"), "sequenceId": 2 * number - 1, "released": true, "actions": [],
                    "startNodeId": format!("n{number}"), "endNodeId": format!("n{}", number + 1),
                });
                merged(edge, &over)
            })
            .collect();
        let mut trace = Trace::subscriber();
        let order = json!({ "orderId": "o", "orderUpdateId": 0, "nodes": nodes, "edges": edges });
        trace.sent("order", &order);
        Self {
            trace,
            order,
            over: json!({}),
        }
    }

    pub fn with_edge(edge: &Value) -> Self {
        Self::ordered([json!({}), json!({}), json!({})], [edge.clone(), json!({})])
    }

    /// After `seconds` a state comes: last node `n`, pose, and velocity (vx, omega) if it is reported.
    pub fn seen(
        &mut self,
        seconds: f64,
        last: usize,
        (x, y, theta): (f64, f64, f64),
        velocity: Option<(f64, f64)>,
    ) -> &mut Self {
        let left = |list: &str, id: &str| -> Value {
            let all = self.order[list].as_array().unwrap().iter();
            all.filter(|one| one["sequenceId"].as_u64().unwrap() > 2 * (last as u64 - 1))
                .map(|one| json!({ id: one[id], "sequenceId": one["sequenceId"], "released": true }))
                .collect()
        };
        let mut state = json!({
            "orderId": "o", "lastNodeId": format!("n{last}"), "lastNodeSequenceId": 2 * (last - 1),
            "nodeStates": left("nodes", "nodeId"), "edgeStates": left("edges", "edgeId"), "driving": last < 3,
            "agvPosition": { "x": x, "y": y, "theta": theta, "mapId": "hall" },
        });
        if let Some((vx, omega)) = velocity {
            state["velocity"] = json!({ "vx": vx, "vy": 0.0, "omega": omega });
            state["driving"] = json!(vx != 0.0 || omega != 0.0);
        }
        self.trace.wait(seconds).state(&merged(state, &self.over));
        self
    }

    fn judged(&self, check: &str) -> (Vec<String>, usize) {
        let outcome = self.trace.judge(check);
        (outcome.summary(), outcome.judged)
    }

    pub fn right(&self, check: &str) {
        let (summary, judged) = self.judged(check);
        assert!(summary.is_empty() && judged > 0, "{summary:?}, {judged} judged");
    }

    pub fn wrong(&self, check: &str, summary: &[&str]) {
        assert_eq!(self.judged(check).0, summary);
    }

    pub fn not_judged(&self, check: &str) {
        assert_eq!(self.judged(check), (Vec::new(), 0));
    }
}

const SPEED: &str = "motion/edge-speed";

fn slow() -> Drive {
    Drive::with_edge(&json!({ "maxSpeed": 0.5 }))
}

#[test]
fn a_vehicle_at_the_limit_with_a_little_noise_is_right() {
    let mut drive = slow();
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), Some((0.0, 0.0)));
    drive.seen(0.1, 1, (0.0, 0.0, 0.0), Some((0.5, 0.0)));
    drive.seen(4.0, 1, (2.0, 0.0, 0.0), Some((0.53, 0.0)));
    drive.seen(4.0, 2, (4.0, 0.0, 0.0), Some((2.0, 0.0)));
    drive.seen(2.0, 3, (4.0, 4.0, 0.0), Some((0.0, 0.0)));
    drive.right(SPEED);
}

#[test]
fn the_first_state_on_an_edge_may_show_the_speed_of_the_edge_before() {
    let mut drive = Drive::ordered(
        [json!({}), json!({}), json!({})],
        [json!({}), json!({ "maxSpeed": 0.5 })],
    );
    drive.seen(0.0, 1, (3.5, 0.0, 0.0), Some((2.0, 0.0)));
    drive.seen(0.1, 2, (4.0, 0.0, 0.0), Some((2.0, 0.0)));
    drive.seen(1.0, 2, (4.0, 0.5, FRAC_PI_2), Some((0.5, 0.0)));
    drive.right(SPEED);
    drive.seen(1.0, 2, (4.0, 1.0, FRAC_PI_2), Some((2.0, 0.0)));
    drive.wrong(SPEED, &["-"]);
}

#[test]
fn two_states_are_enough_to_see_a_way_that_was_made_too_fast() {
    let mut drive = slow();
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), None);
    drive.seen(2.0, 2, (4.0, 0.0, 0.0), None);
    drive.wrong(SPEED, &["-"]);
    let mut drive = slow();
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), None);
    drive.seen(8.0, 2, (4.0, 0.0, 0.0), None);
    drive.right(SPEED);
}

#[test]
fn a_state_that_was_held_up_on_its_way_accuses_nobody() {
    let mut drive = slow();
    // Written eight seconds before the second one, and delivered together with it.
    drive.over = json!({ "timestamp": "2026-01-01T12:00:00.00Z" });
    drive.seen(8.0, 1, (0.0, 0.0, 0.0), None);
    drive.over = json!({});
    drive.seen(0.1, 2, (4.0, 0.0, 0.0), None);
    drive.right(SPEED);
}

#[test]
fn a_position_that_jumps_is_a_warning_where_the_speed_was_reported_and_right() {
    let mut drive = slow();
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), Some((0.5, 0.0)));
    drive.seen(1.0, 1, (0.5, 0.0, 0.0), Some((0.5, 0.0)));
    drive.seen(0.1, 1, (3.0, 0.0, 0.0), Some((0.5, 0.0)));
    drive.wrong(SPEED, &["- warning"]);
}

#[test]
fn nothing_is_judged_without_limit_or_without_data() {
    let mut drive = Drive::with_edge(&json!({}));
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), Some((9.0, 9.0)));
    drive.seen(0.1, 1, (1.0, 0.0, 0.0), Some((9.0, 9.0)));
    drive.not_judged(SPEED);
    drive.not_judged("motion/edge-rotation-speed");
    drive.not_judged("motion/edge-orientation");
    drive.not_judged("motion/rotation-place");
}

#[test]
fn a_cancelled_order_and_a_state_of_no_known_order_are_not_judged() {
    let mut drive = slow();
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), None);
    drive.trace.instant("cancelOrder", "x", &json!([]));
    drive.seen(0.1, 1, (2.0, 0.0, 0.0), Some((9.0, 0.0)));
    drive.seen(0.1, 1, (3.0, 0.0, 0.0), Some((9.0, 0.0)));
    drive.not_judged(SPEED);
    let mut trace = Trace::subscriber();
    trace
        .state(&json!({ "orderId": "other" }))
        .state(&json!({ "orderId": "other" }));
    assert_eq!(trace.judge(SPEED).judged, 0);
}

const ROTATION: &str = "motion/edge-rotation-speed";

#[test]
fn a_turn_on_the_edge_keeps_its_limit() {
    let edge = json!({ "maxRotationSpeed": 0.5 });
    let mut drive = Drive::with_edge(&edge);
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), Some((0.0, 0.0)));
    // On the node it may turn as it likes.
    drive.seen(0.5, 1, (0.0, 0.0, 1.0), Some((0.0, 3.0)));
    drive.seen(1.0, 1, (1.0, 0.0, 1.0), Some((0.5, 0.5)));
    drive.seen(1.0, 1, (2.0, 0.0, 0.5), Some((0.5, -0.5)));
    drive.right(ROTATION);
    drive.seen(1.0, 1, (2.5, 0.0, 0.2), Some((0.5, -0.9)));
    drive.wrong(ROTATION, &["-"]);
}

#[test]
fn a_turn_is_seen_in_the_orientation_too_and_the_short_way_round() {
    let edge = json!({ "maxRotationSpeed": 0.5 });
    let mut drive = Drive::with_edge(&edge);
    drive.seen(0.0, 1, (0.0, 0.0, 3.1), None);
    drive.seen(1.0, 1, (1.0, 0.0, 3.1), None);
    drive.seen(0.2, 1, (1.1, 0.0, -3.1), None);
    drive.right(ROTATION);
    drive.seen(0.2, 1, (1.2, 0.0, 0.0), None);
    drive.wrong(ROTATION, &["-"]);
}

#[test]
fn a_turn_at_the_start_is_a_warning_and_only_where_it_belongs_to_the_edge() {
    let turn = |edge: Value| {
        let mut drive = Drive::with_edge(&edge);
        drive.seen(0.0, 1, (0.0, 0.0, 3.0), Some((0.0, 0.0)));
        drive.seen(0.1, 1, (0.0, 0.0, 2.5), Some((0.0, -5.0)));
        drive
    };
    let belongs = json!({ "maxRotationSpeed": 0.5, "rotationAllowed": true, "orientation": 0.0 });
    turn(belongs).wrong(ROTATION, &["- warning"]);
    turn(json!({ "maxRotationSpeed": 0.5, "rotationAllowed": false, "orientation": 0.0 })).not_judged(ROTATION);
    turn(json!({ "maxRotationSpeed": 0.5 })).not_judged(ROTATION);
}

const ORIENTATION: &str = "motion/edge-orientation";

fn driven(edge: &Value, theta: f64) -> Drive {
    let mut drive = Drive::with_edge(edge);
    drive.seen(0.0, 1, (0.0, 0.0, 1.0), Some((0.0, 0.0)));
    drive.seen(1.0, 1, (1.0, 0.05, 1.0), Some((0.5, 0.4)));
    drive.seen(1.0, 1, (3.0, 0.05, theta), Some((0.5, 0.0)));
    drive
}

#[test]
fn an_orientation_is_read_by_its_type() {
    let tangential = json!({ "orientation": PI });
    driven(&tangential, -3.1).right(ORIENTATION);
    driven(&tangential, 0.0).wrong(ORIENTATION, &["-"]);
    driven(&tangential, 2.9).wrong(ORIENTATION, &["- warning"]);
    let mut second = Drive::ordered(
        [json!({}), json!({}), json!({})],
        [json!({}), json!({ "orientation": 0.0, "orientationType": "GLOBAL" })],
    );
    second.seen(0.0, 2, (4.0, 0.0, 0.0), Some((1.0, 0.0)));
    second.seen(1.0, 2, (4.0, 3.0, 0.0), Some((1.0, 0.0)));
    second.right(ORIENTATION);
    second.seen(0.1, 2, (4.0, 3.1, FRAC_PI_2), Some((1.0, 0.0)));
    second.wrong(ORIENTATION, &["-"]);
    driven(&json!({ "orientation": 0.0, "orientationType": "SOMEHOW" }), 2.0).not_judged(ORIENTATION);
}

#[test]
fn a_vehicle_that_still_turns_or_turns_for_the_next_node_is_not_judged() {
    let edge = json!({ "orientation": 0.0 });
    let mut drive = Drive::with_edge(&edge);
    drive.seen(0.0, 1, (0.0, 0.0, 1.0), Some((0.0, 0.0)));
    drive.seen(1.0, 1, (3.0, 0.0, 1.0), Some((0.5, -0.3)));
    drive.not_judged(ORIENTATION);
    let node = json!({ "nodePosition": { "theta": 1.0 } });
    let mut drive = Drive::ordered([json!({}), node, json!({})], [edge, json!({})]);
    drive.seen(0.0, 1, (0.0, 0.0, 1.0), Some((0.0, 0.0)));
    drive.seen(1.0, 1, (3.0, 0.0, 1.0), Some((0.5, 0.0)));
    drive.not_judged(ORIENTATION);
}

#[test]
fn off_the_straight_line_and_on_a_curve_nothing_is_judged() {
    let mut drive = Drive::with_edge(&json!({ "orientation": 0.0 }));
    drive.seen(0.0, 1, (0.0, 0.0, 1.0), Some((0.0, 0.0)));
    drive.seen(1.0, 1, (3.0, 0.9, 1.0), Some((0.5, 0.0)));
    drive.not_judged(ORIENTATION);
    driven(&json!({ "orientation": 0.0, "trajectory": { "degree": 2 } }), 2.0).not_judged(ORIENTATION);
}

const PLACE: &str = "motion/rotation-place";

#[test]
fn a_vehicle_that_turns_on_the_nodes_only_is_right() {
    let mut drive = Drive::with_edge(&json!({ "rotationAllowed": false, "orientation": 0.0 }));
    drive.seen(0.0, 1, (0.0, 0.0, 2.0), Some((0.0, -1.0)));
    drive.seen(2.0, 1, (0.2, 0.0, 0.1), Some((0.5, 0.0)));
    drive.seen(2.0, 1, (1.0, 0.0, -0.1), Some((0.5, 0.0)));
    drive.seen(2.0, 1, (3.9, 0.0, 0.9), Some((0.0, 1.0)));
    drive.right(PLACE);
}

#[test]
fn a_turn_on_an_edge_that_forbids_it_is_found() {
    let mut drive = Drive::with_edge(&json!({ "rotationAllowed": false }));
    drive.seen(0.0, 1, (0.0, 0.0, 2.0), None);
    drive.seen(2.0, 1, (1.0, 0.0, 2.0), None);
    drive.not_judged(PLACE);
    drive.seen(2.0, 1, (2.0, 0.0, 0.0), None);
    drive.wrong(PLACE, &["-"]);
    let mut drive = Drive::with_edge(&json!({ "rotationAllowed": false, "orientation": 0.0 }));
    drive.seen(0.0, 1, (1.0, 0.0, 2.0), None);
    drive.wrong(PLACE, &["-"]);
    let mut drive = Drive::with_edge(&json!({ "rotationAllowed": true }));
    drive.seen(0.0, 1, (1.0, 0.0, 2.0), None);
    drive.seen(2.0, 1, (2.0, 0.0, 0.0), None);
    drive.not_judged(PLACE);
}

const TOLERANCE: &str = "motion/node-tolerance";

fn arrived(node: Value, before: Option<(f64, f64)>, (x, y, theta): (f64, f64, f64)) -> Drive {
    let mut drive = Drive::ordered([json!({}), json!({}), node], [json!({}), json!({})]);
    drive.seen(0.0, 2, (4.0, 2.0, FRAC_PI_2), before);
    drive.seen(2.0, 3, (x, y, theta), before.map(|_| (0.0, 0.0)));
    drive
}

#[test]
fn a_node_is_traversed_within_its_deviation() {
    let exact = || json!({ "nodePosition": { "allowedDeviationXY": 0.0 } });
    let wide = || json!({ "nodePosition": { "allowedDeviationXY": 1.0 } });
    let run = Some((1.0, 0.0));
    arrived(exact(), run, (4.05, 3.95, FRAC_PI_2)).right(TOLERANCE);
    arrived(exact(), run, (4.0, 3.5, FRAC_PI_2)).wrong(TOLERANCE, &["- warning"]);
    arrived(exact(), None, (4.0, 3.5, FRAC_PI_2)).wrong(TOLERANCE, &["- warning"]);
    arrived(wide(), run, (4.0, 3.1, FRAC_PI_2)).right(TOLERANCE);
    arrived(wide(), run, (4.0, 2.5, FRAC_PI_2)).wrong(TOLERANCE, &["- warning"]);
    arrived(json!({}), run, (4.0, 2.5, FRAC_PI_2)).not_judged(TOLERANCE);
}

#[test]
fn the_usual_tolerance_can_be_stated() {
    let mut drive = arrived(
        json!({ "nodePosition": { "allowedDeviationXY": 0.0 } }),
        None,
        (4.0, 3.5, FRAC_PI_2),
    );
    drive.trace.with.insert("tolerance".into(), json!(0.6));
    drive.right(TOLERANCE);
}

#[test]
fn a_node_passed_between_two_states_is_judged_with_the_way_since_then() {
    let node = json!({ "nodePosition": { "allowedDeviationXY": 0.0, "theta": 0.0 } });
    let passed = |velocity: Option<(f64, f64)>| {
        let mut drive = Drive::ordered([json!({}), node.clone(), json!({})], [json!({}), json!({})]);
        drive.seen(0.0, 1, (3.0, 0.0, 0.0), velocity);
        drive.seen(1.5, 2, (4.0, 1.0, FRAC_PI_2), velocity);
        drive
    };
    for check in [TOLERANCE, "motion/node-theta"] {
        passed(Some((1.0, 1.5))).not_judged(check);
        passed(None).not_judged(check);
    }
    passed(Some((0.1, 0.1))).wrong(TOLERANCE, &["- warning"]);
    passed(Some((0.1, 0.1))).not_judged("motion/node-theta");
}

#[test]
fn a_node_with_actions_may_have_moved_the_vehicle() {
    let node = json!({
        "nodePosition": { "allowedDeviationXY": 0.0, "theta": 0.0 },
        "actions": [{ "actionId": "dock", "actionType": "dock", "blockingType": "HARD" }],
    });
    let drive = arrived(node, None, (4.0, 3.5, FRAC_PI_2));
    drive.not_judged(TOLERANCE);
    drive.not_judged("motion/node-theta");
}

#[test]
fn the_orientation_of_a_node_is_compared_the_short_way_round() {
    let check = "motion/node-theta";
    let node = |over: Value| merged(json!({ "nodePosition": { "theta": -3.1 } }), &over);
    let run = Some((1.0, 0.0));
    arrived(node(json!({})), run, (4.0, 4.0, 3.1)).right(check);
    arrived(node(json!({})), run, (4.0, 4.0, FRAC_PI_2)).wrong(check, &["-"]);
    arrived(node(json!({})), run, (4.0, 4.0, 2.9)).wrong(check, &["- warning"]);
    let wide = json!({ "nodePosition": { "allowedDeviationTheta": PI } });
    arrived(node(wide), run, (4.0, 4.0, 0.0)).right(check);
    arrived(json!({}), run, (4.0, 4.0, 0.0)).not_judged(check);
}

#[test]
fn a_vehicle_may_turn_on_the_last_node_after_it_has_reported_it() {
    let check = "motion/node-theta";
    let node = json!({ "nodePosition": { "theta": 0.0 } });
    let on_node = |theta: f64| {
        let mut drive = Drive::ordered([json!({}), json!({}), node.clone()], [json!({}), json!({})]);
        drive.seen(0.0, 2, (4.0, 2.0, FRAC_PI_2), Some((1.0, 0.0)));
        drive.seen(2.0, 3, (4.0, 4.0, FRAC_PI_2), Some((0.3, 0.0)));
        drive.seen(2.0, 3, (4.0, 4.0, theta), Some((0.0, 0.0)));
        drive
    };
    on_node(0.0).wrong(check, &["- warning"]);
    on_node(FRAC_PI_2).wrong(check, &["-"]);
}

const AXES: &str = "motion/axes";

/// At rest on n1, then by order on n2, at the reported places.
fn moved((x1, y1): (f64, f64), (x2, y2): (f64, f64), from: (f64, f64), to: (f64, f64)) -> (Vec<String>, usize) {
    let mut trace = Trace::subscriber();
    for (order, (node, (x, y)), (rx, ry)) in [("o1", ("n1", (x1, y1)), from), ("o2", ("n2", (x2, y2)), to)] {
        trace.sent(
            "order",
            &json!({ "orderId": order, "orderUpdateId": 0, "edges": [], "nodes": [{
                "nodeId": node, "sequenceId": 0, "released": true, "actions": [],
                "nodePosition": { "x": x, "y": y, "mapId": "hall" },
            }] }),
        );
        trace.wait(1.0).state(&json!({
            "orderId": order, "lastNodeId": node,
            "agvPosition": { "x": rx, "y": ry, "mapId": "hall" },
        }));
    }
    let outcome = trace.judge(AXES);
    (outcome.summary(), outcome.judged)
}

#[test]
fn positions_that_move_as_the_nodes_lie_are_right() {
    assert_eq!(moved((0.0, 0.0), (2.0, 3.0), (0.1, 0.0), (2.0, 3.1)), (vec![], 1));
    // An offset is another matter, and so is a vehicle that is somewhere else.
    assert_eq!(moved((0.0, 0.0), (2.0, 3.0), (9.0, 9.0), (11.0, 12.0)), (vec![], 1));
    assert_eq!(moved((0.0, 0.0), (2.0, 3.0), (0.0, 0.0), (7.0, 1.0)), (vec![], 0));
    assert_eq!(moved((0.0, 0.0), (0.2, 0.0), (0.0, 0.0), (-0.2, 0.0)), (vec![], 0));
}

#[test]
fn mirrored_and_swapped_axes_are_found() {
    for reported in [(2.0, -3.0), (-2.0, 3.0), (-2.0, -3.0)] {
        assert_eq!(moved((0.0, 0.0), (2.0, 3.0), (0.0, 0.0), reported).0, ["-"]);
    }
    assert_eq!(moved((0.0, 0.0), (0.5, 4.0), (0.0, 0.0), (4.0, 0.5)).0, ["-"]);
}

const SIGN: &str = "motion/velocity-sign";

#[test]
fn forwards_is_positive_and_backwards_negative() {
    for (theta, sign) in [(0.0, 1.0), (PI, -1.0)] {
        let mut drive = Drive::with_edge(&json!({}));
        let mut wrong = Drive::with_edge(&json!({}));
        for at in [0.0, 1.0, 2.0, 3.0] {
            drive.seen(1.0, 1, (at, 0.0, theta), Some((sign, 0.0)));
            wrong.seen(1.0, 1, (at, 0.0, theta), Some((-sign, 0.0)));
        }
        drive.right(SIGN);
        wrong.wrong(SIGN, &["-", "-"]);
    }
}

#[test]
fn a_vehicle_that_shunts_once_turns_or_drives_sideways_is_not_accused() {
    let mut drive = Drive::with_edge(&json!({}));
    drive.seen(0.0, 1, (0.0, 0.0, 0.0), Some((1.0, 0.0)));
    drive.seen(1.0, 1, (2.0, 0.0, 0.0), Some((-0.5, 0.0)));
    drive.seen(1.0, 1, (1.5, 0.0, 0.0), Some((-0.5, 0.0)));
    assert!(drive.judged(SIGN).0.is_empty());
    let mut drive = Drive::with_edge(&json!({}));
    for at in [1.0, 2.0, 3.0] {
        drive.seen(1.0, 1, (at, 0.0, FRAC_PI_2), Some((-0.5, 0.0)));
    }
    drive.not_judged(SIGN);
}
