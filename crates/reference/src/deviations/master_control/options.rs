//! Deviations of optional fields: what a vehicle supports and requires of an order (section 6.15).

use super::prelude::*;

records! {
    fault "required-parameter-omitted" ["OPT-05"] "Does not send what a vehicle marks as required."
        => filling(|_, field, value| as_if_open(field, value));
    fault "required-node-fields-left-out" ["OPT-05"] "It heeds what the vehicle REQUIRES on edges, but not what it REQUIRES on nodes."
        => filling(|_, field, value| if field.name.starts_with("order.nodes") { as_if_open(field, value); });
    fault "required-not-in-horizon" ["OPT-05"] "Optional fields that the vehicle requires are left out on nodes and edges of the horizon when the layout has no value."
        => filling(|_, field, value| {
            let place = field.index + usize::from(field.name.starts_with("order.edges"));
            if place >= field.window.released { as_if_open(field, value); }
        });
    fault "required-only-in-first-message" ["OPT-05"] "Optional fields that the vehicle requires are given in new orders, but left out on what order updates add."
        => filling(|_, field, value| if is_added(field) { as_if_open(field, value); });
    fault "required-missing-after-reroute" ["OPT-05"]
        "It leaves the parameters a vehicle requires out of the nodes and edges of updates after the order got another destination."
        => keep::<bool>().happens(rerouted).fills(|rerouted, _, _, field, value| if *rerouted && is_added(field) { as_if_open(field, value); });
    fault "zero-required-omitted" ["OPT-05"] "Leaves out what a vehicle requires where its value is zero."
        => filling(|_, field, value| if field.support == Some("REQUIRED") && value.as_ref().and_then(Value::as_f64) == Some(0.0) { *value = None; });
    fault "empty-list-means-all" ["OPT-03"] "Takes an empty list of optionalParameters for support of everything."
        => filling(|vehicle, field, value| {
            if vehicle.factsheet.as_ref().is_some_and(|sheet| sheet.optional.is_empty()) {
                value.get_or_insert(field.layout.clone().unwrap_or(field.default.clone()));
            }
        });
    fault "options-checked-on-first-order-only" ["OPT-03"] "It leaves unsupported optional fields out of new orders but not out of updates."
        => filling(|vehicle, field, value| if vehicle.factsheet.is_some() && is_added(field) && value.is_none() { value.clone_from(&field.layout); });
    fault "no-height-as-infinity" ["JSON-08", "JSON-06"] "It sends the text Infinity as maxHeight where a vehicle requires one and the layout has no limit."
        => filling(|_, field, value| {
            if field.name == "order.edges.maxHeight" && field.support == Some("REQUIRED") && field.layout.is_none() { *value = Some(json!("Infinity")); }
        });
    fault "unsupported-description" ["OPT-03"] "Sends descriptions to vehicles that do not support them."
        because "Descriptions are harmless; the ruling of OPT-03 is a warning."
        => describing();
    tolerance "descriptions-everywhere" ["OPT-03"] "Describes nodes and edges where the vehicle supports it."
        => filling(|_, field, value| if field.support.is_some() || field.harmless { describe(field, value); });
    fault "orientation-unasked" ["OPT-03"] "All edges carry orientation and orientationType, whether the vehicle supports them or not."
        => edge(|e| {
            e.set("orientation", 0.0);
            e.set("orientationType", "TANGENTIAL");
        });
    fault "rotation-speed-and-trajectory-unasked" ["OPT-03"] "All edges carry maxRotationSpeed and a trajectory, whether the vehicle supports them or not."
        => filling(|_, field, value| if matches!(field.name, "order.edges.maxRotationSpeed" | "order.edges.trajectory") { value.get_or_insert(field.default.clone()); });
    fault "speed-unasked-in-updates" ["OPT-03"] "Order updates carry maxSpeed on every edge, also for a vehicle that does not support it."
        => update(|m| m.each("edges", |edge| edge.supply("maxSpeed", json!(1.0))));
    fault "start-deviation-unasked" ["OPT-03"]
        "It gives the first node of an order an allowedDeviationXY to cover the place of the vehicle although the vehicle does not support that parameter."
        because "At the first node the deviation says where the vehicle may stand, so that OPT-03 leaves a warning."
        => nodes(|_, _, index, stop, node| {
            if let Some(metres) = stop.deviation_xy.filter(|_| index == 0) { node.part("nodePosition", |place| place.set("allowedDeviationXY", metres)); }
        });
    fault "height-unasked-when-loaded" ["OPT-03"] "It limits maxHeight on the edges of orders for a loaded vehicle, whether or not the vehicle supports that."
        => composing(|_, vehicle, _, m| m.each("edges", |edge| if is_loaded(vehicle) { edge.set("maxHeight", 2.5); }));
    fault "orientation-type-capitalized" ["ORD-MSG-16", "JSON-02"] "It writes orientationType as Tangential."
        => edge(|e| e.change("orientationType", |word| *word = json!("Tangential")));
    tolerance "supported-speed-left-out" ["OPT-03", "OPT-05"] "It sends maxSpeed only to vehicles that REQUIRE it."
        => filling(|_, field, value| if field.name == "order.edges.maxSpeed" { *value = (field.support == Some("REQUIRED")).then(|| field.default.clone()); });
    tolerance "rotation-and-length-stated" ["OPT-03"] "It sends rotationAllowed and length of every edge where the vehicle supports them."
        => filling(|_, field, value| {
            if matches!(field.name, "order.edges.rotationAllowed" | "order.edges.length") && field.support.is_some() { value.get_or_insert(field.default.clone()); }
        });
}

/// As if the vehicle only supported it.
fn as_if_open(field: &Field<'_>, value: &mut Option<Value>) {
    if field.support == Some("REQUIRED") {
        value.clone_from(&field.layout);
    }
}

/// Whether it stands on what an update adds: the stitching node stays as it was.
fn is_added(field: &Field<'_>) -> bool {
    field.window.first > 0 && (field.index > field.window.first || field.name.starts_with("order.edges"))
}
