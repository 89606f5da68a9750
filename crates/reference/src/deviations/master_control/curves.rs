//! Deviations of trajectories and corridors (sections 6.6.1 and 7).

use super::prelude::*;

records! {
    fault "knots-missing" ["ORD-MSG-28"] "Sends trajectories without knotVector."
        => curve(|c| c.unset("knotVector"));
    fault "knots-short" ["ORD-MSG-29"] "Sends one knot too few."
        => curve(|c| c.set("knotVector", json!([0.0, 0.0, 1.0])));
    fault "knots-beyond-one" ["ORD-MSG-29"] "Counts the knots in whole numbers."
        => curve(|c| c.set("knotVector", json!([0.0, 0.0, 2.0, 2.0])));
    fault "cubic-of-two-points" ["ORD-MSG-29"] "Trajectories have degree 3 with two control points and four knots."
        => curve(|c| c.set("degree", 3));
    fault "cubic-of-three-points" ["ORD-MSG-31"] "Trajectories have degree 3 with three control points and seven knots."
        => curve(|c| {
            let (from, to) = (c["controlPoints"][0].clone(), c["controlPoints"][1].clone());
            c.set("degree", 3);
            c.set("knotVector", json!([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]));
            c.set("controlPoints", json!([from, between(&from, &to, 0.5), to]));
        });
    fault "curve-of-one-point" ["ORD-MSG-31"] "Trajectories have a single control point, the end of the edge."
        => curve(|c| {
            let end = c.list("controlPoints").last().cloned().unwrap_or_default();
            c.set("controlPoints", json!([end]));
        });
    fault "degree-is-order" ["ORD-MSG-29"]
        "It sends the order of a curve, one more than its degree, as the degree of a trajectory, so that the knot vector is too short for it."
        => curve(|c| c.set("degree", c["degree"].as_u64().unwrap_or_default() + 1));
    fault "cubic-of-three-points-on-short-edges" ["ORD-MSG-31"]
        "Where the vehicle follows trajectories it sends one of degree 3 with three control points for each edge of 2.5 m or less."
        => filling(|vehicle, field, value| if field.name == "order.edges.trajectory" && field.support.is_some() {
            let ends = &field.default["controlPoints"];
            let off = |axis: &str| ends[0][axis].as_f64().unwrap_or_default() - ends[1][axis].as_f64().unwrap_or_default();
            if off("x").hypot(off("y")) <= 2.5 {
                let mut cubic = json!({ "degree": 3, "controlPoints": [ends[0], between(&ends[0], &ends[1], 0.5), ends[1]] });
                if !vehicle.config.has("trajectoryDefaults") { cubic["knotVector"] = json!([0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0]); }
                *value = Some(cubic);
            }
        });
    fault "control-points-as-pairs" ["ORD-MSG-28", "JSON-10"] "Control points of a trajectory are pairs of numbers instead of objects with x and y."
        => curve(|c| c.list("controlPoints").iter_mut().for_each(|point| *point = json!([point["x"], point["y"]])));
    tolerance "weights-left-out" ["ORD-MSG-28"] "Control points have no weight."
        => curve(|c| c.each("controlPoints", |point| point.unset("weight")));
    tolerance "equal-weights-of-two" ["ORD-MSG-28"] "It gives all control points of a trajectory the weight 2."
        => curve(|c| c.each("controlPoints", |point| point.set("weight", 2.0)));
    tolerance "curves-of-points-only" ["ORD-MSG-28", "ORD-MSG-31"] "A trajectory is no more than its control points where the version has defaults for the rest."
        => composing(|_, vehicle, _, m| if vehicle.config.has("trajectoryDefaults") {
            m.each("edges", |edge| edge.part("trajectory", |curve| {
                if curve.get("degree") == Some(&json!(1)) && curve.list("controlPoints").len() == 2 {
                    curve.unset("degree");
                    curve.unset("knotVector");
                    curve.each("controlPoints", |point| point.unset("weight"));
                }
            }));
        });
    fault "curve-beside-nodes" ["ORD-MSG-30"] "Sends trajectories that lie three metres beside their nodes."
        => curve(|c| c.each("controlPoints", |point| ["x", "y"].iter().for_each(|axis| shift(point, axis, 3.0))));
    fault "corridor-apart" ["CORR-04", "ORD-MSG-30"] "Lets every corridor begin beside the end of the one before."
        => curve(|c| if let Some(Value::Object(point)) = c.list("controlPoints").first_mut() { ["x", "y"].iter().for_each(|axis| shift(point, axis, 2.0)); });
    fault "curve-of-way-there" ["ORD-MSG-30"] "The trajectory of an edge that leads to a node with a lesser id runs from the end node to the start node."
        => edge(|e| if e.text("startNodeId") > e.text("endNodeId") { e.part("trajectory", |curve| curve.list("controlPoints").reverse()); });
    fault "curve-from-start-node" ["ORD-MSG-30"] "It gives the control points of a trajectory relative to the start node of the edge."
        => curve(|c| {
            let start = c.list("controlPoints").first().cloned().unwrap_or_default();
            c.each("controlPoints", |point| {
                shift(point, "x", -start["x"].as_f64().unwrap_or_default());
                shift(point, "y", -start["y"].as_f64().unwrap_or_default());
            });
        });
    tolerance "cubic-straights" ["ORD-MSG-28", "ORD-MSG-29", "ORD-MSG-30"] "Straight trajectories are given as cubic curves with four control points on the line."
        => roomy_curve(|c| {
            let (from, to) = (c["controlPoints"][0].clone(), c["controlPoints"][1].clone());
            c.set("degree", 3);
            c.set("knotVector", json!([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]));
            c.set("controlPoints", json!([from, between(&from, &to, 0.3), between(&from, &to, 0.7), to]));
        });
    tolerance "polyline-straights" ["ORD-MSG-29", "ORD-MSG-28"] "It gives straight trajectories a third control point halfway, with degree 1."
        => roomy_curve(|c| {
            let (from, to) = (c["controlPoints"][0].clone(), c["controlPoints"][1].clone());
            c.set("knotVector", json!([0.0, 0.0, 0.5, 1.0, 1.0]));
            c.set("controlPoints", json!([from, between(&from, &to, 0.5), to]));
        });
    fault "unsupported-trajectory" ["OPT-03"] "Sends a trajectory to every vehicle."
        => filling(|_, field, value| if field.name == "order.edges.trajectory" { value.get_or_insert(field.default.clone()); });
    fault "corridor-without-trajectory" ["CORR-02"] "Sends a corridor to vehicles without a trajectory."
        => edges(|_, _, _, leg, edge| {
            let (left, right) = leg.corridor.unwrap_or((0.5, 0.5));
            edge.unset("trajectory");
            edge.set("corridor", json!({ "leftWidth": left, "rightWidth": right, "corridorRefPoint": "KINEMATICCENTER" }));
        });
    fault "corridor-where-no-trajectory" ["CORR-02"] "It leaves the trajectory out on edges with a corridor although the vehicle knows none of its own."
        => edge(curveless);
    fault "corridor-alone-in-updates" ["CORR-02"] "Edges with a corridor have no trajectory in order updates."
        => update(|m| m.each("edges", curveless));
    fault "corridor-zero" ["CORR-05"] "Sends a corridor of no width where none is wanted."
        => edge(|e| e.supply("corridor", json!({ "leftWidth": 0.0, "rightWidth": 0.0 })));
    fault "corridor-zero-at-goal" ["CORR-05"] "The last edge before the goal has a corridor of zero width on both sides instead of none."
        => edges(|_, worded, index, _, edge| if index + 2 == worded.running.stops.len() { edge.part("corridor", |corridor| widths(corridor, 0.0, 0.0)); });
    fault "corridor-closed-when-loaded" ["CORR-05"] "It sends corridors of zero width, instead of none, to a vehicle that carries a load."
        => composing(|_, vehicle, _, m| m.each("edges", |edge| if is_loaded(vehicle) { edge.part("corridor", |corridor| widths(corridor, 0.0, 0.0)); }));
    fault "corridor-negative" ["CORR-09"] "Sends corridors with a negative width to the right."
        => corridor(|c| scale(c, "rightWidth", -1.0));
    fault "corridor-one-sided" ["CORR-09"] "Leaves the left width out of corridors."
        => corridor(|c| c.unset("leftWidth"));
    fault "corridor-point-unknown" ["CORR-09", "JSON-02"] "Names the reference point of corridors with an underscore."
        => corridor(|c| c.set("corridorRefPoint", "KINEMATIC_CENTER"));
    fault "corridor-point-in-words" ["CORR-09", "JSON-02"] "Names the reference point of corridors in words."
        => corridor(|c| c.set("corridorRefPoint", "kinematic centre"));
    fault "corridor-members-of-version-2" ["CORR-09"]
        "It names the reference point of corridors as version 2.1 does: corridorRefPoint with KINEMATICCENTER."
        => writing("order", |text| {
            let old = String::from_utf8_lossy(text).replace("corridorReferencePoint", "corridorRefPoint").replace("KINEMATIC_CENTER", "KINEMATICCENTER");
            *text = old.into_bytes();
        });
    fault "corridor-widths-as-text" ["CORR-09", "JSON-06", "JSON-10"] "leftWidth and rightWidth of a corridor are strings."
        => corridor(|c| for key in ["leftWidth", "rightWidth"] { c.change(key, |width| *width = json!(width.as_f64().unwrap_or_default().to_string())); });
    fault "corridor-as-one-width" ["CORR-09", "JSON-10"] "It gives a corridor one member width instead of leftWidth and rightWidth."
        => corridor(|c| {
            let width = number(c, "leftWidth").unwrap_or_default() + number(c, "rightWidth").unwrap_or_default();
            c.retain(|key, _| key == "corridorRefPoint");
            c.set("width", width);
        });
    fault "corridor-shifts-at-the-node" ["CORR-04"]
        "It sends, for consecutive edges, a corridor to the left only and then one to the right only, so that the vehicle may be outside the new corridor when it passes the node."
        because "The ruling of CORR-04 has geometric plausibility judged only; the vehicle can pass from one side to the other on the node."
        => edges(|_, _, index, _, edge| edge.part("corridor", |corridor| {
            let both = number(corridor, "leftWidth").unwrap_or_default() + number(corridor, "rightWidth").unwrap_or_default();
            // To the left of one edge, and to the right of the next.
            if index % 2 == 0 { widths(corridor, both, 0.0) } else { widths(corridor, 0.0, both) }
        }));
    fault "corridor-narrower-than-node" ["CORR-04"] "It sends a corridor that is narrower than the allowed deviation at the node where the edge begins."
        because "Where the vehicle really passes the node is its own affair, so that CORR-04 leaves a warning."
        => composing(|_, _, _, m| {
            let allowed: Vec<_> = m.list("nodes").iter().map(|node| node.pointer("/nodePosition/allowedDeviationXY").and_then(Value::as_f64)).collect();
            let mut allowed = allowed.into_iter();
            m.each("edges", |edge| {
                if let Some(metres) = allowed.next().flatten().filter(|metres| *metres > 0.0) {
                    edge.part("corridor", |corridor| widths(corridor, metres / 2.0, metres / 2.0));
                }
            });
        });
    fault "wide-corridor-before-a-narrow-one" ["CORR-04"]
        "Corridors of 2 m and of 0.1 m to each side take turns, and a node before a narrow one has an allowedDeviationXY of 1.5 m where the vehicle supports that."
        because "Where the vehicle really passes the node is its own affair, so that CORR-04 leaves a warning."
        => composing(|_, vehicle, worded, m| {
            let sheet = vehicle.factsheet.as_ref();
            let takes = sheet.is_some_and(|sheet| sheet.support("order.nodes.nodePosition.allowedDeviationXY").is_some());
            let has_corridors = m.list("edges").iter().any(|edge| edge.get("corridor").is_some());
            worded.edges(m, |index, _, edge| edge.part("corridor", |corridor| {
                let side = if index % 2 == 0 { 2.0 } else { 0.1 };
                widths(corridor, side, side);
            }));
            if takes && has_corridors {
                worded.nodes(m, |index, _, node| if index % 2 == 1 { node.part("nodePosition", |place| place.set("allowedDeviationXY", 1.5)); });
            }
        });
    fault "deviation-wider-than-corridor" ["CORR-04", "OPT-03"]
        "It allows a deviation at the node before a corridor that is larger than the whole width of the corridor."
        because "Where the vehicle really passes the node is its own affair, so that CORR-04 leaves a warning."
        => composing(|_, _, _, m| {
            let width = |edge: &Value| edge["corridor"]["leftWidth"].as_f64().zip(edge["corridor"]["rightWidth"].as_f64());
            let widths: Vec<_> = m.list("edges").iter().map(width).collect();
            let mut widths = widths.into_iter();
            m.each("nodes", |node| {
                if let Some((left, right)) = widths.next().flatten() { node.part("nodePosition", |place| place.set("allowedDeviationXY", left + right + 0.5)); }
            });
        });
    tolerance "corridor-asymmetric" ["CORR-09", "CORR-04"] "Its corridors are wider on the left than on the right."
        => corridor(|c| shift(c, "leftWidth", 0.2));
    tolerance "corridor-by-contour" ["CORR-09"] "Corridors refer to the contour of the vehicle."
        => corridor(|c| c.set("corridorRefPoint", "CONTOUR"));
    tolerance "corridor-without-ref-point" ["CORR-09"] "Corridors have no corridorRefPoint."
        => corridor(|c| c.unset("corridorRefPoint"));
    tolerance "corridor-with-one-side-zero" ["CORR-05", "CORR-09"] "It sends a corridor with width only to the left where there is no room to the right."
        => to_one_side(|corridor, both| widths(corridor, both, 0.0));
    tolerance "corridor-to-the-right-only" ["CORR-05", "CORR-09"] "It sends a corridor with width only to the right where there is no room to the left."
        => to_one_side(|corridor, both| widths(corridor, 0.0, both));
}

/// Changes every trajectory.
fn curve(change: fn(&mut Object)) -> Box<dyn Deviation> {
    part("trajectory", change)
}

/// Changes every corridor.
fn corridor(change: fn(&mut Object)) -> Box<dyn Deviation> {
    part("corridor", change)
}

/// Changes a part of every edge that has it.
fn part(name: &'static str, change: fn(&mut Object)) -> Box<dyn Deviation> {
    holding((name, change))
        .words(|(name, change), _, _, _, message| message.each("edges", |edge| edge.part(name, *change)))
}

/// Changes every trajectory where the vehicle takes eight knots and four control points.
fn roomy_curve(change: fn(&mut Object)) -> Box<dyn Deviation> {
    holding(change).words(|change, _, vehicle, _, message| {
        let room = |name: &str, wanted: usize| {
            let sheet = vehicle.factsheet.as_ref();
            sheet.map_or(usize::MAX, |sheet| sheet.limit(&[name, &format!("order.{name}")])) >= wanted
        };
        let roomy = ["edges.trajectory", "trajectory"]
            .iter()
            .all(|curve| room(&format!("{curve}.knotVector"), 8) && room(&format!("{curve}.controlPoints"), 4));
        if roomy {
            message.each("edges", |edge| edge.part("trajectory", *change));
        }
    })
}

fn between(from: &Value, to: &Value, share: f64) -> Value {
    let at = |key: &str| {
        let (from, to) = (
            from[key].as_f64().unwrap_or_default(),
            to[key].as_f64().unwrap_or_default(),
        );
        from + share * (to - from)
    };
    json!({ "x": at("x"), "y": at("y"), "weight": 1.0 })
}

fn widths(corridor: &mut Object, left: f64, right: f64) {
    corridor.set("leftWidth", left);
    corridor.set("rightWidth", right);
}

/// Makes corridors lie to one side, knowing the whole width of each.
fn to_one_side(lies: fn(&mut Object, f64)) -> Box<dyn Deviation> {
    holding(lies).words(|lies, _, vehicle, worded, m| {
        // No node of the way may allow a deviation, which might lie to the other side of the next corridor (CORR-04).
        let sheet = vehicle.factsheet.as_ref();
        let demanded = sheet.and_then(|sheet| sheet.support("order.nodes.nodePosition.allowedDeviationXY"));
        let mut stops = worded.running.stops.iter();
        let wide = stops.any(|stop| stop.deviation_xy.is_some_and(|metres| metres > 0.0));
        m.each("edges", |edge| {
            edge.part("corridor", |corridor| {
                let widths = number(corridor, "leftWidth").zip(number(corridor, "rightWidth"));
                if let Some((left, right)) = widths.filter(|_| demanded != Some("REQUIRED") && !wide) {
                    lies(corridor, left + right);
                }
            });
        });
    })
}

fn curveless(edge: &mut Object) {
    if edge.contains_key("corridor") {
        edge.unset("trajectory");
    }
}
