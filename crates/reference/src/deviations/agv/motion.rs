//! Deviations of position and velocity, in states and visualizations alike (section 6.10.6).

use super::prelude::*;

records! {
    fault "position-frozen" ["MAP-01"] "As long as nodes of an order are left, it reports the position at which it took the order."
        => keep::<Option<(f64, f64)>>()
            .happens(|taken, agv, event| if let Event::Begun = event {
                let pose = agv.motion.pose(agv.moment());
                *taken = Some((pose.x, pose.y));
            })
            .says(|taken, agv, part, p| {
                let taken = taken.filter(|_| !agv.order.nodes.is_empty());
                if let (Part::Position, Some((x, y))) = (part, taken) {
                    p.set("x", x);
                    p.set("y", y);
                }
                true
            });
    fault "degrees-reported" ["MAP-02", "STATE-MSG-05", "ORD-CANCEL-15"] "Reports its orientation in degrees."
        => position(|_, p| number(p, "theta", |theta| theta.to_degrees() + 180.0));
    fault "theta-never-negative" ["MAP-02", "STATE-MSG-05"] "It reports its orientation between 0 and two pi."
        => position(|_, p| number(p, "theta", |theta| theta.rem_euclid(std::f64::consts::TAU)));
    fault "position-map-stale" ["MAP-11", "ORD-CANCEL-15"] "Names a map in its position that is not on board."
        => position(|_, p| p.set("mapId", "factory-default"));
    fault "id-with-space" ["JSON-04", "ORD-CANCEL-15"] "Reports the id of its map with a space."
        => position(|_, p| text(p, "mapId", |id| format!("{id} 1")));
    fault "position-as-text" ["STATE-MSG-05", "JSON-06", "ORD-CANCEL-15"] "Reports its coordinates as strings."
        => position(|_, p| for key in ["x", "y"] {
            if let Some(value) = p.get(key).and_then(Value::as_f64) {
                p.set(key, value.to_string());
            }
        });
    fault "localization-score-percent" ["STATE-MSG-05"] "It reports its localizationScore in percent."
        => position(|_, p| p.set("localizationScore", 98.0));
    fault "velocity-mirrored" ["MAP-03"] "Reports a negative speed when it drives forwards."
        => velocity(|_, v| number(v, "vx", |vx| -vx));
    fault "speed-unsigned" ["MAP-03"] "It reports a positive vx also when it drives backwards."
        => velocity(|_, v| number(v, "vx", f64::abs));
    fault "omega-clockwise" ["MAP-01", "MAP-03"] "It reports omega as positive when it turns clockwise."
        => velocity(|_, v| number(v, "omega", |omega| -omega));
    fault "velocity-in-map-axes" ["MAP-03"] "It reports its velocity along the axes of the map and not along its own."
        => velocity(|agv, v| {
            let theta = agv.motion.pose(agv.moment()).theta;
            let speed = agv.motion.velocity().vx;
            v.set("vx", speed * theta.cos());
            v.set("vy", speed * theta.sin());
        });
}
