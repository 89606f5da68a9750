//! Deviations of what a visualization says (section 6.13).

use super::prelude::*;

records! {
    fault "visualization-theta-in-degrees" ["VIS-01", "MAP-02"] "It gives theta in degrees in the visualization, although in radians in the state."
        => visualization(|_, m| m.part("agvPosition", |p| number(p, "theta", f64::to_degrees)));
    fault "visualization-theta-0-to-2pi" ["VIS-01", "MAP-02"] "It gives theta between 0 and 2 pi in visualization and properly in the state."
        => visualization(|_, m| m.part("agvPosition", |p| number(p, "theta", |theta| theta.rem_euclid(std::f64::consts::TAU))));
    fault "visualization-beside" ["VIS-01"] "Shows itself two metres beside where its states say it is."
        => visualization(|_, m| m.part("agvPosition", |p| number(p, "x", |x| x + 2.0)));
    fault "visualization-millimetres" ["MAP-02", "VIS-01"] "Gives its position in the visualization in millimetres."
        => visualization(|_, m| m.part("agvPosition", millimetres));
    fault "visualization-millimetres-under-way" ["MAP-02"] "Gives its position in the visualization in millimetres while it drives."
        => visualization(|agv, m| if agv.motion.is_moving() { m.part("agvPosition", millimetres) });
    fault "visualization-without-position" ["VIS-01"] "Leaves the position out of the visualization." because "The schema requires nothing; by the ruling of VIS-01 what is merely absent is a warning."
        => visualization(|_, m| m.unset("agvPosition"));
    fault "visualization-names-its-own-header-id" ["VIS-04"] "Its visualization names its own headerId in the place of that of a state."
        => sending(|_, out| if out.name == "visualization" && out.message.contains_key("referenceStateHeaderId") {
            let own = out.message.get("headerId").cloned().unwrap_or_default();
            out.message.set("referenceStateHeaderId", own);
        });
    fault "visualization-without-map" ["VIS-01"] "The agvPosition in its visualization has no mapId."
        => visualization(|_, m| m.part("agvPosition", |p| p.unset("mapId")));
    fault "visualization-velocity-scalar" ["VIS-01"] "It sends velocity in the visualization as a single number instead of an object."
        => visualization(|_, m| m.change("velocity", |velocity| *velocity = velocity["vx"].take()));
    fault "visualization-pose-at-root" ["VIS-01"] "The visualization gives x, y, theta and mapId at its top level instead of in agvPosition."
        because "The schema demands no member of a visualization, so that VIS-01 warns of a pose that is found elsewhere."
        => visualization(|_, m| if let Some(Value::Object(pose)) = m.remove("agvPosition") { m.extend(pose) });
}

fn millimetres(position: &mut Object) {
    number(position, "x", |x| x * 1000.0);
    number(position, "y", |y| y * 1000.0);
}
