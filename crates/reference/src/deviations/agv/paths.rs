//! Deviations of the paths that a freely navigating vehicle shares, and of how it says that it is lost (sections 6.8 and 7.8 of 3.0).

use super::prelude::*;

records! {
    fault "own-path-missing" ["PATH-01"] "It shares its next metres, and not the path that it has planned."
        => state(|_, m| m.unset("plannedPath"));
    fault "intermediate-path-missing" ["PATH-01"] "It shares the path that it has planned, and not its next metres."
        => state(|_, m| m.unset("intermediatePath"));
    fault "paths-only-at-rest" ["PATH-01"] "It shares its paths as long as it stands, and none while it drives."
        => state(|agv, m| if agv.motion.is_moving() {
            m.unset("plannedPath");
            m.unset("intermediatePath");
        });
    fault "planned-path-begins-ahead" ["PATH-02"] "The path that it has planned begins at its next node and not where it is."
        => state(|_, m| m.part("plannedPath", |path| path.part("trajectory", |t| {
            if let [first, second, ..] = t.list("controlPoints") {
                *first = second.clone();
            }
        })));
    fault "next-metres-begin-ahead" ["PATH-02"] "Its next metres begin three metres before it."
        => state(|_, m| m.part("intermediatePath", |path| {
            if let [Value::Object(first), ..] = path.list("polyline") {
                number(first, "x", |x| x + 3.0);
            }
        }));
    fault "planned-path-without-nodes" ["PATH-03"] "The nodes that its planned path goes through stand in a text, and not in a list."
        => state(|_, m| m.part("plannedPath", |path| path.set("traversedNodes", "A1, A2")));
    fault "waypoint-without-place" ["PATH-06"] "Its waypoints have a time and no place."
        => state(|_, m| m.part("intermediatePath", |path| path.each("polyline", &mut |point: &mut Object| {
            point.unset("x");
            point.unset("y");
        })));
    fault "one-waypoint" ["PATH-06"] "Its next metres are one waypoint while it drives." because "How many waypoints there are is remarked on."
        => state(|_, m| m.part("intermediatePath", |path| path.change("polyline", |points| if let Some(points) = points.as_array_mut() { points.truncate(1); })));
    fault "traverses-unknown-nodes" ["PATH-03"] "It names nodes on its path that its order does not have."
        => state(|_, m| m.part("plannedPath", |path| path.set("traversedNodes", json!(["somewhere"]))));
    fault "planned-path-without-its-last-knot" ["PATH-03"] "The knot vector of its planned path is one too short."
        => state(|_, m| m.part("plannedPath", |path| path.part("trajectory", |t| t.change("knotVector", |knots| {
            if let Value::Array(knots) = knots {
                knots.pop();
            }
        }))));
    fault "planned-path-to-the-next-node" ["PATH-04"] "The path that it has planned ends at its next node."
        => state(|_, m| m.part("plannedPath", |path| path.part("trajectory", |t| {
            if t.list("controlPoints").len() > 2 {
                t.change("controlPoints", |points| if let Value::Array(points) = points { points.truncate(2) });
                t.set("knotVector", json!([0.0, 0.0, 1.0, 1.0]));
            }
        })));
    fault "planned-path-kept" ["PATH-05", "PATH-02"] "It shares the path that it has planned first until its order is done, whatever way it takes."
        => keep::<Option<(String, Value)>>().sends(|kept, agv, out| {
            if let Some(path) = out.message.get_mut("plannedPath") {
                match kept {
                    Some((order, first)) if *order == agv.order.order_id => path.clone_from(first),
                    _ => *kept = Some((agv.order.order_id.clone(), path.clone())),
                }
            }
            true
        });
    fault "eta-runs-backwards" ["PATH-07"] "The times of its next metres fall from the first to the last."
        => state(|_, m| m.part("intermediatePath", |path| {
            let points = path.list("polyline");
            let etas: Vec<Value> = points.iter().rev().map(|point| point["eta"].clone()).collect();
            for (point, eta) in points.iter_mut().zip(etas) {
                point["eta"] = eta;
            }
        }));
    fault "eta-in-seconds" ["PATH-07"] "It gives the times of its next metres in seconds from now."
        => state(|_, m| m.part("intermediatePath", |path| for (at, point) in path.list("polyline").iter_mut().enumerate() {
            point["eta"] = json!(format!("{at}.0"));
        }));
    fault "next-metres-kept" ["PATH-08"] "It shares the same next metres as long as it drives."
        => keep::<Option<Value>>().sends(|kept, agv, out| {
            if !agv.motion.is_moving() {
                *kept = None;
            } else if let Some(path) = out.message.get_mut("intermediatePath") {
                match kept {
                    Some(kept) => path.clone_from(kept),
                    None => *kept = Some(path.clone()),
                }
            }
            true
        });
    fault "next-metres-renewed-every-five-seconds" ["PATH-08", "PATH-02"] "While it drives it plans its next metres every five seconds only, and shares the same ones in between."
        => keep::<Option<(Moment, Value)>>().sends(|kept, agv, out| {
            let (now, moves) = (agv.moment(), agv.motion.is_moving());
            kept.take_if(|(at, _)| !moves || now.since(*at) >= Duration::from_secs(5));
            if let Some(path) = out.message.get_mut("intermediatePath").filter(|_| moves) {
                path.clone_from(&kept.get_or_insert_with(|| (now, path.clone())).1);
            }
            true
        });
    fault "line-shown-as-its-own-path" ["PATH-09"] "A vehicle on virtual lines shares its way as a path that it has planned itself." because "By the ruling of PATH-09 it is a warning."
        => letting(|_, what| matches!(what, Permission::ReportPath));
    fault "trajectory-of-its-own-on-an-edge" ["STATE-MSG-21"] "It shows a trajectory in its edge states that nobody has sent."
        => edge(|agv, edge, m| {
            if agv.config.plans && edge.trajectory.is_none() {
                let pose = agv.motion.pose(agv.moment());
                let point = |x: f64| json!({ "x": x, "y": pose.y, "weight": 1.0 });
                m.set("trajectory", json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": [point(pose.x), point(pose.x + 1.0)] }));
            }
            true
        });
    fault "visualization-of-a-coming-state" ["VIS-04"] "Its visualization names a state that it has not sent yet."
        => visualization(|_, m| number(m, "referenceStateHeaderId", |id| id + 50.0));
    fault "visualization-of-the-first-state" ["VIS-04"] "Its visualization names the first state that it has ever sent."
        because "An old state that was sent is a warning, one that was never sent a failure (VIS-04)."
        => visualization(|_, m| m.set("referenceStateHeaderId", 0));

    fault "lost-without-an-error" ["STATE-MSG-19"] "It says that it is not localized and reports no error."
        => raising(|_, cause, _| !matches!(cause, Cause::Lost));
    fault "lost-as-a-warning" ["STATE-MSG-19"] "It reports a lost position as a WARNING."
        => raising(|_, cause, error| {
            if matches!(cause, Cause::Lost) {
                error.fatal = false;
                error.error_type.push_str("_SUSPECTED");
            }
            true
        });
    fault "drives-blind" ["STATE-MSG-19"] "It drives on although it cannot tell where it is."
        => drives(Hindrance::Lost, |_| true);
    tolerance "planned-path-into-the-horizon" ["PATH-01", "PATH-04"] "The path that it has planned leads beyond its base into the horizon."
        => plain().says(|(), agv, part, m| {
            if matches!(part, Part::State | Part::Visualization) {
                m.part("plannedPath", |path| into_horizon(agv, path));
            }
            true
        });
    fault "localized-by-force" ["STATE-MSG-19"] "It goes on saying that it is localized while it reports that it is not."
        => position(|_, m| m.set("positionInitialized", true));
}

/// Makes a path longer by the nodes of the horizon.
fn into_horizon(agv: &Agv, path: &mut Object) {
    for stop in agv.order.nodes.iter().filter(|stop| !stop.node.released) {
        path.add("traversedNodes", json!(stop.node.id));
        path.part("trajectory", |trajectory| {
            trajectory.add(
                "controlPoints",
                json!({ "x": stop.place.x, "y": stop.place.y, "weight": 1.0 }),
            );
            let last = u32::try_from(trajectory.list("controlPoints").len())
                .unwrap_or(2)
                .max(2)
                - 1;
            let inner = (0..=last).map(|at| f64::from(at) / f64::from(last));
            let knots: Vec<f64> = std::iter::once(0.0).chain(inner).chain([1.0]).collect();
            trajectory.set("knotVector", knots);
        });
    }
}
