//! Deviations of driving: setting out, the way over an edge, reaching a node (sections 6.6.1, 6.10.2 and 6.12).

use std::f64::consts::{FRAC_PI_2, PI};

use crate::agv::motion::Facing;
use crate::agv::order_message::Corridor;
use crate::agv::way::is_backwards;
use crate::agv::{Mode, motion};
use tck_base::nurbs::Path;

use super::prelude::*;

/// So long it waits for a release.
const PATIENCE: Duration = Duration::from_secs(15);

records! {
    fault "stops-on-link-loss" ["MQTT-04"] "Stands still as long as the link is down."
        => forbidding(|agv, what| matches!(what, Permission::Drive) && !agv.connection.online);
    fault "next-edge-not-entered-offline" ["MQTT-04"] "Without a link the vehicle ends the edge it is on and then stands on its next node, although more of its base is left, until the link has been back for a second."
        => keep::<Option<Moment>>()
            .happens(|back, agv, event| if event == Event::Connected && agv.connection.sessions > 1 {
                *back = Some(agv.moment());
            })
            .allows(|back, agv, what, usual| {
                let waits = back.is_some_and(|back| agv.moment().since(back) < Duration::from_secs(1));
                let stands = !agv.connection.online || waits;
                usual && !(stands && matches!(what, Permission::SetOut(_)) && !agv.order.entered && agv.order.edge_ahead().is_some())
            });
    // Stranded between two nodes, it would be of no use for any further test.
    fault "stops-before-end-of-base" ["ORD-06"] "Stops one node before the end of the base."
        => forbidding(|agv, what| matches!(what, Permission::SetOut(stop) if stop.node.sequence_id == agv.order.base_end.1 && agv.config.node(&agv.order.last_node).is_some()));
    fault "horizon-driven" ["ORD-07", "ORD-UPD-01", "MQTT-05", "MQTT-04"] "Drives into the horizon without waiting for its release."
        => letting(|_, what| matches!(what, Permission::Enter));
    fault "horizon-driven-offline" ["MQTT-05", "ORD-07", "MQTT-04"] "Drives into the horizon while the link is down."
        => letting(|agv, what| matches!(what, Permission::Enter) && !agv.connection.online);
    fault "horizon-slipped-into" ["ORD-07", "MQTT-04"] "Stops at the decision point and rolls on into the horizon a moment later."
        => slipping(|speed| speed * 4.0);
    fault "horizon-crept-into" ["ORD-UPD-01", "ORD-07"] "Waits at the decision point for a moment and creeps on into the horizon."
        => slipping(|speed| speed / 40.0);
    fault "horizon-entered-after-waiting" ["ORD-UPD-01", "ORD-07"] "It waits at the decision point for fifteen seconds, and then drives to the first node of the horizon without a release."
        => keep::<Option<Moment>>()
            .happens(|since, agv, event| match event {
                Event::NodeReached(_) | Event::Begun => *since = None,
                Event::Settled | Event::Woken => {
                    let waits = agv.waits_at_decision_point() && agv.order.cancel.is_none();
                    *since = waits.then(|| since.unwrap_or(agv.moment()));
                }
                _ => {}
            })
            .allows(|since, agv, what, usual| {
                let waited = since.is_some_and(|since| agv.moment().since(since) >= PATIENCE);
                usual || waited && matches!(what, Permission::Enter)
            })
            .due(|since, agv| since.map(|since| since + PATIENCE).filter(|end| *end > agv.moment()));
    fault "warning-blocks" ["ERR-03", "ORD-06", "ORD-FLOW-12"] "Does not drive while it reports a warning."
        => forbidding(|agv, what| matches!(what, Permission::Drive) && !agv.errors.is_empty());
    fault "node-skipped" ["ORD-01", "STATE-06", "NODE-03"] "Leaves plain nodes between others out of its reports."
        => forbidding(|agv, what| matches!(what, Permission::Note(stop) if stop.node.actions.is_empty() && stop.node.sequence_id > 0 && goes_on(agv)));
    fault "traversal-split" ["NODE-03"] "Removes the node state and updates the last node in two states." because "Two states of one moment are remarked on; tests that look at single states are not reached."
        => plain().happens(|(), agv, event| if matches!(event, Event::NodeReached(_)) { agv.flush() });
    fault "last-node-stale" ["NODE-03", "STATE-MSG-04", "STATE-06"] "Reports the new lastNodeId with the old lastNodeSequenceId."
        => noted(|agv, _| agv.order.last_sequence = agv.order.previous.1);
    fault "last-sequence-of-old-order-kept" ["STATE-MSG-04", "NODE-03"] "It keeps the lastNodeSequenceId of the previous order when a new order begins at the node on which it already stands."
        => noted(|agv, sequence_id| if sequence_id == 0 && agv.order.previous.0 == agv.order.last_node {
            agv.order.last_sequence = agv.order.previous.1;
        });
    fault "loop-confused" ["ORD-UPD-13", "NODE-03"] "Reports the sequenceId of the first visit on every visit of a node."
        => keep::<BTreeMap<String, u32>>().happens(|visits, agv, event| match event {
            Event::NodeNoted(sequence_id) => agv.order.last_sequence = *visits.entry(agv.order.last_node.clone()).or_insert(sequence_id),
            Event::Begun => visits.clear(),
            _ => {}
        });
    fault "loop-clears-both-visits" ["ORD-UPD-13", "STATE-12"] "It removes reached nodes from nodeStates by nodeId, so that the first visit of a loop node removes the later one as well."
        => keep::<BTreeSet<u32>>()
            .happens(|hidden, agv, event| match event {
                Event::NodeNoted(_) => {
                    let reached = agv.order.left.0.iter().map(|stop| &stop.node.id);
                    let again = reached.flat_map(|id| agv.order.nodes.iter().filter(move |ahead| ahead.node.id == *id));
                    hidden.extend(again.map(|ahead| ahead.node.sequence_id));
                }
                Event::Begun => hidden.clear(),
                _ => {}
            })
            .says(|hidden, _, part, _| !matches!(part, Part::Node(stop) if hidden.contains(&stop.node.sequence_id)));
    fault "loop-cut-short" ["ORD-UPD-13", "ORD-06"] "When the vehicle passes a node that is also the last one of its base it takes the order for done and drops the rest."
        => plain().happens(|(), agv, event| if let Event::NodePassed(sequence_id) = event {
            let reached = agv.order.left.0.as_ref().map(|stop| &stop.node.id);
            let again = reached == Some(&agv.order.base_end.0) && agv.order.base_end.1 > sequence_id;
            if again && agv.order.cancel.is_none() {
                agv.order.drop_route();
                let behind = |action: &&mut Action| matches!(action.origin, Origin::Node(id) | Origin::Edge(id) if id > sequence_id);
                agv.actions.iter_mut().filter(behind).for_each(|action| action.end(Status::Failed));
            }
        });
    fault "theta-ignored" ["ORD-MSG-10", "ORD-MSG-14", "NODE-01"] "Does not turn to the orientation a node asks for."
        => facing(|_, _, _| None);
    fault "theta-at-end-only" ["ORD-MSG-10", "NODE-01"] "It assumes the theta of the last node of the base only, and passes nodes before that as it comes."
        => facing(|agv, stop, theta| (stop.node.sequence_id == agv.order.base_end.1).then_some(theta));
    fault "no-turn-after-fixed-edge" ["ORD-MSG-11", "ORD-MSG-10"] "After an edge with rotationAllowed false the vehicle does not assume the theta of the node either."
        => facing(|agv, _, theta| {
            let fixed = agv.order.edge_ahead().and_then(|edge| edge.rotation_allowed) == Some(false);
            (!fixed).then_some(theta)
        });
    fault "theta-taken-as-axis" ["ORD-MSG-10", "ORD-MSG-14", "NODE-01"] "It counts a node with theta as traversed also when it looks the opposite way."
        => facing(|agv, stop, theta| {
            let allowed = stop.node.position.as_ref().and_then(|position| position.allowed_deviation_theta);
            let allowed = allowed.filter(|allowed| *allowed > 0.0).unwrap_or(agv.config.reach_theta);
            let off = motion::wrapped(theta - agv.motion.pose(agv.moment()).theta).abs();
            (PI - off > allowed).then_some(theta)
        });
    fault "max-speed-ignored" ["ORD-MSG-20", "OPT-01"] "Drives with its own speed whatever the edge permits."
        => planning(|_, leg| leg.permitted = None);
    fault "max-speed-ignored-backwards" ["ORD-MSG-20"] "It ignores maxSpeed on edges that it drives backwards."
        => planning(|_, leg| leg.permitted = leg.permitted.filter(|_| !leg.backwards));
    fault "max-speed-of-edge-before" ["ORD-MSG-20", "OPT-01"] "It keeps to the maxSpeed of the edge before the one it drives on."
        => planning(|agv, leg| leg.permitted = agv.order.left.1.as_ref().and_then(|left| left.max_speed));
    fault "brakes-only-on-the-slow-edge" ["ORD-MSG-20"] "It brakes for a slower edge when it is on it, and drives its first metre as fast as the edge before."
        => keep::<Option<(Moment, f64)>>()
            .happens(|rolls, agv, event| if matches!(event, Event::EdgeLeft(_)) {
                let permitted = agv.order.left.1.as_ref().and_then(|edge| edge.max_speed);
                let speed = permitted.map_or(agv.config.speed, |permitted| permitted.min(agv.config.speed));
                *rolls = Some((agv.moment(), speed));
            })
            .plans(|rolls, agv, leg| if let Some((_, speed)) = rolls.filter(|(at, _)| *at == agv.moment())
                && leg.is_whole()
                && leg.permitted.is_some_and(|permitted| permitted < speed)
            {
                leg.permitted = Some(speed);
                (leg.way, leg.to_node) = (leg.distance.min(2.0) / 2.0, false);
            });
    fault "max-speed-forgotten-in-pause" ["ORD-MSG-20"] "After a pause on an edge it drives the rest of that edge at its own speed, whatever maxSpeed says."
        => keep::<bool>()
            .does(|hurried, agv, action| {
                *hurried |= is(action, Effect::StopPause) && lifts_pause(agv) && agv.order.entered && agv.holds.pause;
                None
            })
            .happens(|hurried, _, event| *hurried &= !matches!(event, Event::NodeReached(_) | Event::Begun))
            .plans(|hurried, _, leg| leg.permitted = leg.permitted.filter(|_| !*hurried));
    fault "semiautomatic-faster" ["MODE-03"] "Drives faster in SEMIAUTOMATIC."
        => planning(|agv, leg| if agv.mode == Mode::Semiautomatic { leg.own = agv.config.speed * 2.0 });
    fault "max-rotation-speed-ignored" ["ORD-MSG-25"] "Turns with its own speed whatever the edge permits." because "The turn takes place while the edge is entered; whether it belongs to the edge yet is a matter of reading."
        => adopting(|_, order| order.edges.iter_mut().for_each(|edge| edge.max_rotation_speed = None));
    fault "edge-orientation-ignored" ["ORD-MSG-22", "OPT-01"] "Drives forwards whatever orientation the edge asks for."
        => adopting(|_, order| order.edges.iter_mut().for_each(|edge| edge.orientation = None));
    fault "global-as-tangential" ["ORD-MSG-22"] "It reads the orientation of an edge against the path also when orientationType is GLOBAL."
        => adopting(|_, order| order.edges.iter_mut().for_each(|edge| edge.global = false));
    fault "backwards-edge-driven-forwards" ["ORD-MSG-22"] "It drives an edge with TANGENTIAL orientation pi forwards."
        => adopting(|_, order| for edge in &mut order.edges {
            let turned = |angle: &f64| motion::wrapped(*angle).abs() > FRAC_PI_2;
            edge.orientation = edge.orientation.filter(|angle| edge.global || !turned(angle));
        });
    fault "turns-on-edge" ["ORD-MSG-24", "ORD-MSG-12"] "Turns to the orientation of an edge when it is on it already."
        => letting(|agv, what| matches!(what, Permission::RollAsTurned) && turns_late(agv)).plans(|_, agv, leg| if turns_late(agv) && leg.is_whole() {
            (leg.way, leg.to_node) = (leg.distance / 3.0, false);
        });
    fault "traversed-early" ["ORD-MSG-13", "NODE-01", "NODE-02"] "Reports a node traversed half a metre before it is there."
        => ending_early(|_| true);
    fault "zero-deviation-unlimited" ["ORD-MSG-13", "NODE-01"] "It reports a node with allowedDeviationXY 0 traversed half a metre before it gets there."
        because "What is usual is stated by the vendor; the ruling of ORD-MSG-13 warns where the default of 0.1 m is passed."
        => ending_early(|stop| stop.node.position.as_ref().and_then(|position| position.allowed_deviation) == Some(0.0));
    fault "absent-deviation-unlimited" ["ORD-MSG-32"] "It reports a node without allowedDeviationXY traversed half a metre before it gets there."
        because "What is usual is stated by the vendor; where the default of 0.1 m is passed, it is warned of."
        => ending_early(|stop| stop.node.position.as_ref().is_some_and(|position| position.allowed_deviation.is_none()));
    fault "tangent-ignored" ["ORD-MSG-23"] "Looks the same way all along a curve."
        => steering(|_, course| if course.curved {
            course.heading = course.straight;
            course.backwards = course.edge.is_some_and(|edge| is_backwards(edge, course.heading));
        })
        .plans(|_, agv, leg| leg.facing = Facing::Fixed(agv.motion.pose(agv.moment()).theta));
    fault "trajectory-cut" ["ORD-MSG-26"] "Drives straight to the end of an edge that has a trajectory." because "It breaks a recommendation only."
        => bending(|_, _, _| None);
    fault "free-vehicle-cuts-trajectories" ["ORD-18", "ORD-MSG-26"] "A freely navigating vehicle drives its own straight way over an edge that was sent with a trajectory."
        => bending(|agv, edge, path| (!agv.config.plans || edge.trajectory.is_none()).then_some(path));
    fault "corners-cut-from-wide-nodes" ["NODE-08"] "It turns to the next node as soon as it is inside a wide deviation range, and comes back to its line nowhere."
        => planning(|agv, leg| if let Some(early) = wide_by(agv, leg.stop).filter(|_| leg.is_whole()) {
            leg.end_before(early);
        });
    fault "drives-the-control-polygon" ["ORD-MSG-26"] "It drives from control point to control point in straight lines instead of along the curve."
        because "ORD-MSG-26, that a trajectory is followed, is a recommendation; the control points are reached."
        => bending(|agv, edge, path| match &edge.trajectory {
            Some(trajectory) if !agv.obstacles.contains(&edge.id) => Some(control_polygon(&trajectory.sent)),
            _ => Some(path),
        });
    fault "direction-ignored" ["ORD-MSG-27", "STATE-MSG-04"] "Takes the same branch at a junction whatever direction it is given."
        => branching(|branches, _| branches.first().cloned());
    fault "direction-mistaken" ["ORD-MSG-27", "STATE-MSG-04"] "Takes the branch beside the one it is told."
        => branching(|branches, told| {
            let at = branches.iter().position(|branch| branch == told)?;
            branches.iter().cycle().nth(at + 1).cloned()
        });
    fault "corridor-overrun" ["CORR-01", "CORR-03"] "Drives round an obstacle as if its corridor were twice as wide."
        => keeping(|corridor| {
            corridor.left *= 2.0;
            corridor.right *= 2.0;
        });
    fault "corridor-sides-swapped" ["CORR-01", "CORR-06"] "The vehicle takes leftWidth for the right side of its corridor and rightWidth for the left."
        => keeping(|corridor| std::mem::swap(&mut corridor.left, &mut corridor.right));
    fault "corridor-is-symmetric" ["CORR-01"] "It takes the greater of leftWidth and rightWidth for both sides when it goes round an obstacle."
        => keeping(|corridor| {
            let wider = corridor.left.max(corridor.right);
            (corridor.left, corridor.right) = (wider, wider);
        });
    fault "corridor-contour-ignored" ["CORR-03", "CORR-01"] "Keeps only its centre inside a corridor that is meant for its contour." because "CORR-03 is a recommendation, and by the kinematic centre CORR-01 is kept."
        => keeping(|corridor| corridor.contour = false);
    fault "corridor-left-unwatched" ["CORR-06", "CORR-07"] "It watches only the right boundary of its corridor."
        => forbidding(|_, what| matches!(what, Permission::Watch(_, true)));
    fault "corridor-of-update-not-watched" ["CORR-06", "CORR-07"] "It does not watch the corridors of edges that an update has added."
        => keep::<Option<u32>>()
            .adopts(|joint, agv, adoption| {
                *joint = adoption.update.then(|| joint.unwrap_or(agv.order.base_end.1));
                true
            })
            .allows(|joint, _, what, usual| usual && !matches!(what, Permission::Watch(edge, _) if joint.is_some_and(|joint| edge.sequence_id > joint)));
    fault "corridor-exit-driven-on" ["CORR-06"] "Drives on when it finds itself outside its corridor."
        => when(Event::Strayed, |agv| agv.set_holds(|holds| holds.outside = false));
    fault "corridor-exit-forgotten" ["CORR-06"] "Stops for a moment when it finds itself outside its corridor, and drives on."
        => when(Event::Strayed, |agv| {
            agv.set_holds(|holds| holds.outside = false);
            agv.lingers_until = Some(agv.moment() + MOMENT);
        });
    fault "corridor-exit-silent" ["CORR-07"] "Stops outside its corridor and does not say why."
        => raising(|_, cause, _| !matches!(cause, Cause::Outside));
    fault "planned-path-missing" ["STATE-14"] "Plans its path and does not report it."
        => edge(|_, _, m| {
            m.unset("trajectory");
            true
        });
    fault "planned-path-of-base-only" ["STATE-14"] "Reports the path it planned for the base only."
        => edge(|_, edge, m| {
            if !edge.released {
                m.unset("trajectory");
            }
            true
        });
    fault "trajectory-without-points" ["ORD-MSG-28", "JSON-10"] "Reports the trajectory it planned without control points."
        => edge(|_, _, m| {
            m.set("trajectory", json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0] }));
            true
        });
    fault "planned-path-changes" ["STATE-15"] "Plans anew when it enters an edge."
        => path(|agv, edge, points, knots| {
            if agv.order.entered && agv.order.edge_ahead() == Some(edge) {
                let ((x1, y1), (x2, y2)) = (points[0], points[1]);
                points.insert(1, (f64::midpoint(x1, x2) + 1.0, f64::midpoint(y1, y2) + 1.0));
                knots.insert(2, 0.5);
            }
        });
    fault "planned-path-without-ends" ["ORD-MSG-30"] "Reports control points that are not those of its own curve."
        => path(|_, _, points, knots| {
            let (from, to) = (points[0], points[1]);
            let part = |share: f64| (from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share);
            *points = vec![part(-0.7), part(0.5), part(1.7)];
            knots.insert(2, 0.5);
        });
    fault "trajectories-of-degree-three" ["ORD-MSG-31"] "It reports trajectories with degree 3, whatever number of control points they have."
        => edge(|_, _, m| {
            m.part("trajectory", |path| {
                let points = path.list("controlPoints").len();
                let knots: Vec<f64> = (0..points + 4).map(|knot| if knot < 4 { 0.0 } else { 1.0 }).collect();
                path.set("degree", 3);
                path.set("knotVector", knots);
            });
            true
        });
    fault "knots-too-few" ["ORD-MSG-29"] "Leaves the last knot out of the trajectory it reports."
        => edge(|_, _, m| {
            m.part("trajectory", |path| if let Some(Value::Array(knots)) = path.get_mut("knotVector") {
                knots.pop();
            });
            true
        });
    fault "knots-not-normalized" ["ORD-MSG-29", "STATE-14"] "The knotVector of the reported trajectories runs from 0 to the length of the edge in metres."
        => path(|_, _, points, knots| {
            let (from, to) = (points[0], points[1]);
            let length = (to.0 - from.0).hypot(to.1 - from.1).max(2.0);
            for knot in knots.iter_mut() {
                *knot *= length;
            }
        });
    fault "axes-mirrored" ["MAP-01"] "Reports its position with y to the right."
        => mirrored();
    tolerance "stops-on-nodes" ["ORD-06", "STATE-08"] "Stops for a moment on every node."
        => plain().happens(|(), agv, event| if matches!(event, Event::NodeReached(_)) { linger(agv, 100) });
    tolerance "stops-short-of-node" ["ORD-MSG-13", "NODE-01"] "It counts a node that allows a deviation as traversed eight centimetres before it, and stands there."
        => planning(|agv, leg| {
            let allowed = leg.stop.node.position.as_ref().and_then(|position| position.allowed_deviation);
            if allowed.is_some_and(|allowed| allowed > 0.16) && leg.distance > 1.0 && leg.is_whole() {
                leg.way = leg.distance - f64::min(0.08, agv.config.reach * 0.8);
            }
        });
    tolerance "lib-early-traversal" ["NODE-01"] "It reports a node traversed as soon as it enters the deviation range of the node, or 0.3 m before it."
        => planning(|agv, leg| if let Some(early) = early_by(agv, leg.stop).filter(|_| leg.is_whole()) {
            leg.end_before(early);
        })
        .happens(|_, agv, event| {
            // It ends on the node now and not before it: the rest of the way is planned anew.
            if event == Event::CancelBegun && agv.order.cancel.as_ref().is_some_and(|cancel| cancel.to_node) {
                agv.motion.halt(agv.moment());
            }
        });
    tolerance "crawls-offline" ["MQTT-04", "MQTT-05"] "While the link is down it drives every edge behind the first one of its order so slowly that it takes more than five seconds."
        => planning(|agv, leg| if !agv.connection.online && leg.is_whole() && leg.stop.node.sequence_id > 2 {
            leg.own = leg.own.min(leg.distance / 5.5);
        });
    tolerance "semiautomatic-at-full-speed" ["MODE-03"] "It drives as fast in SEMIAUTOMATIC as in AUTOMATIC."
        => planning(|agv, leg| leg.own = agv.config.speed);
    tolerance "keeps-below-max-speed" ["ORD-MSG-20"] "It drives at four fifths of the maxSpeed of an edge."
        => planning(|_, leg| leg.permitted = leg.permitted.map(|permitted| permitted * 0.8));
    tolerance "turns-the-long-way" ["ORD-MSG-10", "ORD-MSG-24"] "The vehicle turns to an orientation the long way round."
        => letting(|_, what| matches!(what, Permission::TurnTheLongWay));
    tolerance "own-orientation-at-end" ["ORD-MSG-10"] "On the last node of its base, where the order asks for no theta, the vehicle turns to an orientation of its own before it reports the node."
        => plain().faces(|(), agv, stop, wanted| {
            let ends = stop.node.sequence_id > 0 && stop.node.sequence_id == agv.order.base_end.1;
            wanted.or((ends && stop.node.position.is_some()).then_some(0.0))
        });
    tolerance "backs-up" ["MAP-03", "ORD-MSG-22"] "Where an edge asks for no orientation the vehicle drives backwards to a node that lies behind it instead of turning."
        => steering(|agv, course| {
            let free = course.edge.is_some_and(|edge| edge.orientation.is_none()) && !course.curved;
            let behind = motion::wrapped(course.heading - agv.motion.pose(agv.moment()).theta).abs() > FRAC_PI_2 + 0.1;
            course.backwards |= free && behind;
        });
    tolerance "paths-reported" ["STATE-14", "STATE-MSG-13"] "It reports the trajectory it drives on in its edge states although it does not plan its path itself."
        => letting(|agv, what| matches!(what, Permission::ReportPath) && !agv.config.line_guided());
    tolerance "position-trembles" ["STATE-MSG-05", "STATE-MSG-08"] "The position it reports varies by some millimetres, also when it stands."
        => position(|agv, p| {
            let trembling = [0.0, 0.003, -0.002, 0.001, -0.003][usize::try_from(agv.states_sent % 5).unwrap_or_default()];
            p.change("x", |x| *x = json!(x.as_f64().unwrap_or_default() + trembling));
        });
    tolerance "theta-minus-pi" ["MAP-02", "STATE-MSG-05"] "It reports an orientation of half a turn as minus pi."
        => position(|_, p| if p.get("theta").and_then(Value::as_f64).is_some_and(|theta| theta > PI - 1e-9) {
            p.set("theta", -PI);
        });
    tolerance "position-rounded" ["STATE-MSG-05", "MAP-02"] "It rounds its position to whole centimetres and its orientation to milliradians."
        => position(|_, p| {
            number(p, "x", |x| (x * 100.0).round() / 100.0);
            number(p, "y", |y| (y * 100.0).round() / 100.0);
            number(p, "theta", |theta| (theta * 1000.0).trunc() / 1000.0);
        });
    tolerance "velocity-trembles" ["STATE-MSG-08", "STATE-MSG-05"] "It reports velocities of about a millimetre per second at standstill."
        => velocity(|agv, v| {
            let noise = [0.001, -0.001, 0.0][usize::try_from(agv.states_sent % 3).unwrap_or_default()];
            if !agv.motion.is_moving() {
                v.set("vx", noise);
            }
            v.set("vy", -noise);
            v.change("omega", |omega| if omega.as_f64() == Some(0.0) {
                *omega = json!(noise);
            });
        });
    tolerance "node-positions-from-layout" ["STATE-MSG-13"] "The nodeStates give a nodePosition also where the order had none, from the layout of the vehicle."
        => node(|agv, stop, m| {
            if !agv.config.line_guided() && !m.contains_key("nodePosition") {
                m.set("nodePosition", json!({ "x": stop.place.x, "y": stop.place.y, "mapId": stop.place.map_id }));
            }
            true
        });
}

/// Drives on into the horizon by itself, a moment after it has stopped at the decision point.
fn slipping(speed: fn(f64) -> f64) -> Box<dyn Deviation> {
    #[derive(Clone, Default)]
    struct Slip {
        due: Option<Moment>,
        slipped: bool,
    }
    impl Slip {
        fn happens(&mut self, agv: &Agv, event: Event) {
            match event {
                Event::Begun => *self = Self::default(),
                Event::NodePassed(_) if agv.order.cancel.is_none() && agv.waits_at_decision_point() => {
                    self.due = Some(agv.moment() + MOMENT);
                }
                Event::Woken => self.slipped |= self.due.take_if(|due| *due <= agv.moment()).is_some(),
                _ => {}
            }
        }
    }
    holding((speed, Slip::default()))
        .happens(|(_, slip), agv, event| slip.happens(agv, event))
        .allows(|(_, slip), _, what, usual| usual || slip.slipped && matches!(what, Permission::Enter))
        .plans(|(speed, slip), agv, leg| {
            if slip.slipped && agv.mode != Mode::Semiautomatic {
                leg.own = speed(agv.config.speed);
            }
        })
        .due(|(_, slip), _| slip.due)
}

type Noted = fn(&mut Agv, u32);

/// Does something when a node counts as the last one; its sequenceId.
fn noted(then: Noted) -> Box<Hooks<Noted>> {
    holding(then).happens(|then, agv, event| {
        if let Event::NodeNoted(sequence_id) = event {
            then(agv, sequence_id);
        }
    })
}

/// Rolls on as it stands, until the node it left is well behind.
fn turns_late(agv: &Agv) -> bool {
    let pose = agv.motion.pose(agv.moment());
    let behind = |left: &Stop| pose.distance(left.place.x, left.place.y) > 0.2;
    !agv.order.left.0.as_ref().is_some_and(behind)
}

type Early = fn(&Stop) -> bool;

/// Counts nodes as reached half a metre before them, and ends the way to the last one later.
fn ending_early(which: Early) -> Box<Hooks<Early>> {
    holding(which)
        .plans(|which, _, leg| {
            if which(leg.stop) && leg.is_whole() {
                leg.end_before(0.5);
            }
        })
        .happens(|which, agv, event| {
            let left = agv.order.left.0.as_ref().filter(|left| which(left));
            let Some(to) = left.map(|left| (left.place.x, left.place.y)) else {
                return;
            };
            let moment = agv.moment();
            let stands = event == Event::Settled && !agv.motion.is_moving() && agv.next_stop().is_none();
            if stands && agv.may_drive() && agv.motion.pose(moment).distance(to.0, to.1) > 1e-6 {
                agv.motion.roll(moment, to, 0.5, false, false);
            }
        })
}

type Bending = fn(&Agv, &Edge, Path) -> Option<Path>;

/// Takes another way than the trajectory of an edge; a straight one where there is none.
fn bending(way: Bending) -> Box<dyn Deviation> {
    holding(way).bends(|way, agv, edge, path| way(agv, edge, path))
}

/// The way from control point to control point of a trajectory.
fn control_polygon(trajectory: &Value) -> Path {
    let points = trajectory.get("controlPoints").and_then(Value::as_array);
    let number = |point: &Value, key: &str| point.get(key).and_then(Value::as_f64);
    let points = points.into_iter().flatten();
    Path::through(points.filter_map(|point| number(point, "x").zip(number(point, "y"))))
}

type Branching = fn(&[String], &String) -> Option<String>;

/// Takes another branch than it is told; of all branches at that node.
fn branching(choice: Branching) -> Box<Hooks<Branching>> {
    holding(choice).adopts(|choice, agv, adoption| {
        for edge in &mut adoption.order.edges {
            let all = agv.config.branches.iter().flatten();
            let here: Vec<String> = all
                .filter(|(from, ..)| *from == edge.start)
                .map(|(_, name, _)| name.clone())
                .collect();
            edge.direction = edge.direction.take().map(|told| choice(&here, &told).unwrap_or(told));
        }
        true
    })
}

/// Understands its corridors otherwise.
fn keeping(change: fn(&mut Corridor)) -> Box<dyn Deviation> {
    holding(change).keeps_to(|change, _, corridor| change(corridor))
}

type Points = Vec<(f64, f64)>;

type Planned = fn(&Agv, &Edge, &mut Points, &mut Vec<f64>);

/// Reports another path than the straight one it has planned: its points and knots.
fn path(change: Planned) -> Box<dyn Deviation> {
    holding(change).says(|change, agv, part, words| {
        if let Part::Edge(edge) = part
            && edge.trajectory.is_none()
        {
            words.part("trajectory", |path| {
                let number = |point: &Value, axis: &str| point[axis].as_f64().unwrap_or_default();
                let points = path.list("controlPoints").iter();
                let mut points: Points = points.map(|point| (number(point, "x"), number(point, "y"))).collect();
                let mut knots = vec![0.0, 0.0, 1.0, 1.0];
                change(agv, edge, &mut points, &mut knots);
                let point = |(x, y): (f64, f64)| json!({ "x": x, "y": y, "weight": 1.0 });
                path.set("controlPoints", points.into_iter().map(point).collect::<Vec<_>>());
                path.set("knotVector", knots);
            });
        }
        true
    })
}

/// Counts y to the right: what it reports, and what it is told of places it does not know.
fn mirrored() -> Box<dyn Deviation> {
    plain()
        .says(|(), agv, part, words| {
            match part {
                Part::Position => number(words, "y", |y| -y),
                Part::Node(stop) if agv.config.node(&stop.node.id).is_none() => {
                    words.part("nodePosition", |place| number(place, "y", |y| -y));
                }
                _ => {}
            }
            true
        })
        .reads(|(), agv, message| {
            let nodes = message.get_mut("nodes").and_then(Value::as_array_mut);
            for node in nodes.into_iter().flatten() {
                let known = node["nodeId"].as_str().is_some_and(|id| agv.config.node(id).is_some());
                if let Some(Value::Object(place)) = node.get_mut("nodePosition").filter(|_| !known) {
                    number(place, "y", |y| -y);
                }
            }
        })
        .does(|(), agv, action| {
            let mut turned = action.clone();
            let y = turned.request.parameters.iter_mut().find(|(key, _)| key == "y");
            let value = y.filter(|_| is(action, Effect::InitPosition)).map(|(_, value)| value)?;
            *value = json!(-value.as_f64()?);
            Some(agv.init_position(&turned).into())
        })
}

/// How far before a node on its way it may report it.
///
/// Not where it has something to do or to look somewhere, nor where a corridor begins (NODE-02): then it has to be on the
/// node itself.
fn early_by(agv: &Agv, stop: &Stop) -> Option<f64> {
    let sequence_id = stop.node.sequence_id;
    let passes = sequence_id < agv.order.base_end.1 && agv.order.cancel.is_none();
    let mut ahead = agv.order.edges.iter().filter(|edge| edge.sequence_id > sequence_id);
    let free = stop.node.actions.is_empty() && ahead.next().is_none_or(|edge| edge.corridor.is_none());
    let position = stop.node.position.as_ref().filter(|_| passes && free);
    let allowed = position
        .filter(|position| position.theta.is_none())?
        .allowed_deviation?;
    (allowed > agv.config.reach).then_some((allowed * 0.9).min(0.3))
}

/// How far before a node on the way it leaves for the next one, where the node allows much.
fn wide_by(agv: &Agv, stop: &Stop) -> Option<f64> {
    let passes = stop.node.sequence_id < agv.order.base_end.1;
    let position = stop.node.position.as_ref().filter(|_| passes)?;
    position
        .allowed_deviation
        .filter(|allowed| *allowed >= 0.5)
        .map(|allowed| allowed * 0.9)
}
