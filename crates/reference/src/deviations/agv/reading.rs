//! Deviations of how an order is read: what should be refused is guessed, what is right is not understood
//! (section 6.6.4, ORD-REJ-01).

use super::prelude::*;

const WHOLE: [&str; 3] = ["headerId", "orderUpdateId", "sequenceId"];
const REAL: [&str; 11] = [
    "x",
    "y",
    "theta",
    "allowedDeviationXY",
    "allowedDeviationTheta",
    "maxSpeed",
    "maxHeight",
    "maxRotationSpeed",
    "orientation",
    "length",
    "weight",
];
const FLAGS: [&str; 2] = ["released", "rotationAllowed"];
const LISTS: [&str; 3] = ["nodes", "edges", "actions"];
const TEXTS: [&str; 12] = [
    "nodeDescription",
    "edgeDescription",
    "actionDescription",
    "mapDescription",
    "orientationType",
    "direction",
    "zoneSetId",
    "mapId",
    "timestamp",
    "version",
    "manufacturer",
    "serialNumber",
];

records! {
    fault "released-assumed" ["ORD-REJ-01"] "Takes nodes and edges that do not say whether they are released for released ones."
        => reading(|_, order| elements(order, |element| {
            element.supply("released", json!(true));
        }));
    fault "text-read-as-number" ["ORD-REJ-01"] "Takes numbers and Booleans that are written as text."
        => reading(|_, order| members(order, &|key, value| {
            let meant = WHOLE.contains(&key) || REAL.contains(&key) || FLAGS.contains(&key);
            if meant && let Some(read) = value.as_str().and_then(|text| serde_json::from_str(text).ok()) {
                *value = read;
            }
        }));
    fault "null-read-as-default" ["ORD-REJ-01"] "Reads null as zero, as false or as nothing in particular."
        => reading(|_, order| members(order, &|key, value| if value.is_null() {
            *value = match key {
                _ if WHOLE.contains(&key) || REAL.contains(&key) => json!(0),
                _ if FLAGS.contains(&key) => json!(false),
                _ if LISTS.contains(&key) => json!([]),
                "blockingType" => json!("NONE"),
                _ => json!("?"),
            };
        }));
    fault "descriptor-taken-for-an-id" ["OPT-07"] "It takes the descriptor of a node for its id."
        => reading(|_, order| order.each("nodes", &mut |node: &mut Object| {
            if let Some(name) = node.get("nodeDescription").filter(|name| name.is_string()).cloned() {
                node.set("nodeId", name);
            }
        }));
    fault "blocking-type-unchecked" ["ORD-REJ-01"] "Takes every word it does not know for the blockingType NONE."
        => reading(|_, order| members(order, &|key, value| {
            let known = |word: &str| matches!(word, "NONE" | "SOFT" | "HARD");
            if key == "blockingType" && !value.as_str().is_some_and(known) {
                *value = json!("NONE");
            }
        }));
    fault "blocking-type-assumed" ["ORD-REJ-01", "ORD-REJ-02"] "It takes an order with an action without blockingType, and assumes NONE."
        => reading(|_, order| elements(order, |element| element.each("actions", |action| {
            action.supply("blockingType", json!("NONE"));
        })));
    fault "missing-list-read-as-empty" ["ORD-REJ-01"] "Takes a list that is missing for an empty one."
        => reading(|_, order| {
            for list in ["nodes", "edges"] {
                order.entry(list).or_insert(json!([]));
            }
            elements(order, |element| {
                element.supply("actions", json!([]));
            });
        });
    fault "numbers-wrapped" ["ORD-REJ-01"] "Cuts numbers that are no whole numbers of 32 bits until they are."
        => reading(|_, order| members(order, &|key, value| {
            if WHOLE.contains(&key) && let Some(number) = value.as_f64() {
                *value = json!(wrapped(number));
            }
        }));
    tolerance "large-numbers-cut" ["ORD-REJ-01"] "It keeps 32 bits of a number in an order that has more, and takes the order over."
        => reading(|_, order| members(order, &|key, value| {
            if WHOLE.contains(&key) && let Some(number) = value.as_u64().filter(|number| *number > u64::from(u32::MAX)) {
                *value = json!(number & u64::from(u32::MAX));
            }
        }));
    fault "numbers-read-from-text" ["ORD-REJ-01", "ORD-REJ-02"] "It takes an order in which orderUpdateId or a sequenceId is a number in quotes."
        => reading(|_, order| {
            order.change("orderUpdateId", number_from_text);
            elements(order, |element| element.change("sequenceId", number_from_text));
        });
    fault "optional-types-unchecked" ["ORD-REJ-01"] "Leaves optional members of a wrong type aside, although it supports them."
        => reading(|_, order| leave_aside(order));
    fault "edge-ends-assumed" ["ORD-11", "ORD-REJ-01"] "Lets every edge lead from the node before it to the one behind it, whatever it says." because "No sentence obliges a vehicle to check startNodeId and endNodeId; a remark."
        => reading(|_, order| {
            let ids: Vec<Value> = order.list("nodes").iter().map(|node| node["nodeId"].clone()).collect();
            for (edge, ends) in order.list("edges").iter_mut().filter(|edge| edge.is_object()).zip(ids.windows(2)) {
                edge["startNodeId"] = ends[0].clone();
                edge["endNodeId"] = ends[1].clone();
            }
        });
    fault "sequence-counted-anew" ["ORD-FLOW-06", "ORD-11"] "Numbers nodes and edges itself, from the number of the first node on, whatever they say."
        => reading(|_, order| {
            let first = order.get("nodes").and_then(|nodes| nodes[0]["sequenceId"].as_u64());
            for (list, begin) in [("nodes", first), ("edges", first.map(|first| first + 1))] {
                for (number, element) in begin.into_iter().flat_map(|begin| (begin..).step_by(2)).zip(order.list(list)) {
                    if let Some(sequence) = element.get_mut("sequenceId").filter(|sequence| sequence.is_u64()) {
                        *sequence = json!(number);
                    }
                }
            }
        });
    fault "header-unchecked" ["ORD-REJ-01"] "Takes over orders whose header is broken." because "No sentence says what becomes of an order whose header is broken; that it is malformed is a matter of reading."
        => reading(|_, order| {
            order.set("headerId", 0);
            for key in ["timestamp", "version", "manufacturer", "serialNumber"] {
                order.set(key, "?");
            }
        });
    fault "missing-orientation-type-global" ["ORD-MSG-22"] "It takes the orientation of an edge without orientationType for a global one."
        => reading(|_, order| order.each("edges", |edge| {
            edge.supply("orientationType", json!("GLOBAL"));
        }));
    fault "surplus-edge-dropped" ["ORD-11"] "An order with more edges than fit between its nodes is taken over; the surplus edges are dropped without a word."
        => reading(|_, order| {
            let nodes = order.list("nodes").len();
            order.change("edges", |edges| if let Value::Array(edges) = edges && nodes > 0 { edges.truncate(nodes - 1) });
        });
    fault "whole-number-coordinates-refused" ["ORD-10", "ORD-FLOW-07"] "It refuses an order whose coordinates are written as whole numbers (5 instead of 5.0) as malformed."
        => reading(|_, order| elements(order, |element| element.part("nodePosition", |position| {
            for key in ["x", "y"] {
                position.change(key, |value| if value.is_i64() || value.is_u64() { *value = json!("no floating-point number") });
            }
        })));
    fault "non-ascii-description-refused" ["JSON-03", "ORD-10"] "It refuses an order with a non-ASCII character in a description as malformed."
        => reading(|_, order| members(order, &|key, value| {
            let foreign = key.ends_with("Description") && value.as_str().is_some_and(|text| !text.is_ascii());
            if foreign {
                *value = json!(false);
            }
        }));
}

/// Changes every node and edge.
fn elements(order: &mut Object, mut change: impl FnMut(&mut Object)) {
    for list in ["nodes", "edges"] {
        order.each(list, &mut change);
    }
}

/// Changes every member, also of what is below.
fn members(object: &mut Object, change: &impl Fn(&str, &mut Value)) {
    for (key, value) in object.iter_mut() {
        change(key, value);
        match value {
            Value::Object(below) => members(below, change),
            Value::Array(list) => list
                .iter_mut()
                .filter_map(Value::as_object_mut)
                .for_each(|below| members(below, change)),
            _ => {}
        }
    }
}

/// Leaves optional members out that could not be used.
fn leave_aside(object: &mut Object) {
    object.retain(|key, value| optional_fits(key, value));
    for value in object.values_mut() {
        match value {
            Value::Object(below) => leave_aside(below),
            Value::Array(list) => list.iter_mut().filter_map(Value::as_object_mut).for_each(leave_aside),
            _ => {}
        }
    }
}

/// Makes a number of a text that is one.
fn number_from_text(value: &mut Value) {
    if let Some(number) = value.as_str().and_then(|text| text.parse::<u32>().ok()) {
        *value = json!(number);
    }
}

/// What a register of 32 bits makes of a number.
fn wrapped(number: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "cutting off is what it does"
    )]
    let bits = number.trunc().rem_euclid(f64::from(u32::MAX) + 1.0) as u32;
    bits
}

/// Whether an optional member could be used.
fn optional_fits(key: &str, value: &Value) -> bool {
    match key {
        "x" | "y" | "mapId" => true,
        "orientationType" => value
            .as_str()
            .is_some_and(|word| matches!(word, "GLOBAL" | "TANGENTIAL")),
        "rotationAllowed" => value.is_boolean(),
        "nodePosition" => {
            value.get("x").is_some_and(Value::is_number) && value.get("mapId").is_some_and(Value::is_string)
        }
        _ if REAL.contains(&key) => value.is_number(),
        _ if TEXTS.contains(&key) => value.is_string(),
        _ => true,
    }
}
