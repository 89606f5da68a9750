//! How a faulty vehicle reads what it should refuse: it guesses what was meant.
//!
//! A faultless vehicle reads a message as it is.

use std::borrow::Cow;

use serde_json::{Map, Value, json};

use super::faults::{FaultName as F, Faults};

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
const HEADER: [&str; 5] = ["headerId", "timestamp", "version", "manufacturer", "serialNumber"];

/// Whether any of these faults is on.
fn any(faults: Faults) -> bool {
    [
        F::ReleasedAssumed,
        F::TextReadAsNumber,
        F::NullReadAsDefault,
        F::BlockingTypeUnchecked,
        F::MissingListReadAsEmpty,
        F::NumbersWrapped,
        F::OptionalTypesUnchecked,
        F::EdgeEndsAssumed,
        F::SequenceCountedAnew,
        F::HeaderUnchecked,
    ]
    .into_iter()
    .any(|fault| faults.has(fault))
}

/// The message as the vehicle takes it.
pub(crate) fn taken(message: &Value, faults: Faults) -> Cow<'_, Value> {
    if !any(faults) || !message.is_object() {
        return Cow::Borrowed(message);
    }
    let mut guessed = message.clone();
    if let Some(order) = guessed.as_object_mut() {
        of_message(order, faults);
    }
    Cow::Owned(guessed)
}

fn of_message(order: &mut Map<String, Value>, faults: Faults) {
    if faults.has(F::HeaderUnchecked) {
        for key in HEADER {
            let sound = if key == "headerId" { json!(0) } else { json!("?") };
            order.insert(key.to_owned(), sound);
        }
    }
    of_object(order, faults);
    for list in ["nodes", "edges"] {
        if faults.has(F::MissingListReadAsEmpty) && !order.contains_key(list) {
            order.insert(list.to_owned(), json!([]));
        }
        for element in order.get_mut(list).and_then(Value::as_array_mut).into_iter().flatten() {
            let Some(element) = element.as_object_mut() else {
                continue;
            };
            if faults.has(F::ReleasedAssumed) && !element.contains_key("released") {
                element.insert("released".to_owned(), json!(true));
            }
            if faults.has(F::MissingListReadAsEmpty) && !element.contains_key("actions") {
                element.insert("actions".to_owned(), json!([]));
            }
        }
    }
    if faults.has(F::EdgeEndsAssumed) {
        assume_ends(order);
    }
    if faults.has(F::SequenceCountedAnew) {
        count_anew(order);
    }
}

/// `sequence-counted-anew`: what has a number gets the one it would have in a right order.
fn count_anew(order: &mut Map<String, Value>) {
    let Some(first) = order.get("nodes").and_then(|nodes| nodes[0]["sequenceId"].as_u64()) else {
        return;
    };
    for (list, begin) in [("nodes", 0), ("edges", 1)] {
        let elements = order.get_mut(list).and_then(Value::as_array_mut);
        for (number, element) in (first + begin..).step_by(2).zip(elements.into_iter().flatten()) {
            if let Some(sequence) = element.get_mut("sequenceId").filter(|sequence| sequence.is_u64()) {
                *sequence = json!(number);
            }
        }
    }
}

/// `edge-ends-assumed`: an edge leads from the node before it to the one behind it, whatever it says.
fn assume_ends(order: &mut Map<String, Value>) {
    let nodes = order.get("nodes").and_then(Value::as_array);
    let ids: Vec<Value> = nodes
        .into_iter()
        .flatten()
        .map(|node| node.get("nodeId").cloned().unwrap_or_default())
        .collect();
    let edges = order.get_mut("edges").and_then(Value::as_array_mut);
    for (edge, ends) in edges.into_iter().flatten().zip(ids.windows(2)) {
        if let Some(edge) = edge.as_object_mut() {
            edge.insert("startNodeId".to_owned(), ends[0].clone());
            edge.insert("endNodeId".to_owned(), ends[1].clone());
        }
    }
}

fn of_object(object: &mut Map<String, Value>, faults: Faults) {
    if faults.has(F::OptionalTypesUnchecked) {
        object.retain(|key, value| optional_fits(key, value));
    }
    for (key, value) in object.iter_mut() {
        of_member(key, value, faults);
    }
}

fn of_member(key: &str, value: &mut Value, faults: Faults) {
    let number = WHOLE.contains(&key) || REAL.contains(&key);
    if faults.has(F::NullReadAsDefault) && value.is_null() {
        *value = match key {
            _ if number => json!(0),
            _ if FLAGS.contains(&key) => json!(false),
            _ if LISTS.contains(&key) => json!([]),
            "blockingType" => json!("NONE"),
            _ => json!("?"),
        };
    }
    if faults.has(F::TextReadAsNumber)
        && (number || FLAGS.contains(&key))
        && let Some(read) = value.as_str().and_then(|text| serde_json::from_str::<Value>(text).ok())
    {
        *value = read;
    }
    if faults.has(F::NumbersWrapped)
        && WHOLE.contains(&key)
        && let Some(number) = value.as_f64()
    {
        *value = json!(wrapped(number));
    }
    let known = |word: &str| matches!(word, "NONE" | "SOFT" | "HARD");
    if faults.has(F::BlockingTypeUnchecked) && key == "blockingType" && !value.as_str().is_some_and(known) {
        *value = json!("NONE");
    }
    match value {
        Value::Object(object) => of_object(object, faults),
        Value::Array(elements) => {
            for element in elements.iter_mut().filter_map(Value::as_object_mut) {
                of_object(element, faults);
            }
        }
        _ => {}
    }
}

/// What a register of 32 bits makes of a number.
fn wrapped(number: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "cutting off is what the fault does"
    )]
    let bits = number.trunc().rem_euclid(f64::from(u32::MAX) + 1.0) as u32;
    bits
}

/// Whether an optional member could be used; others are left out as if they had not been sent.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(fault: &str, message: &Value) -> Value {
        let faults = Faults::named(&[fault]).expect("a fault");
        taken(message, faults).into_owned()
    }

    #[test]
    fn a_faultless_vehicle_guesses_nothing() {
        let message = json!({ "orderUpdateId": "5", "nodes": [{ "released": null }] });
        assert_eq!(*taken(&message, Faults::default()), message);
    }

    #[test]
    fn each_fault_guesses_its_part() {
        let message = json!({ "orderUpdateId": "5", "nodes": [{ "sequenceId": -1, "actions": null }] });
        assert_eq!(read("text-read-as-number", &message)["orderUpdateId"], json!(5));
        assert_eq!(
            read("numbers-wrapped", &message)["nodes"][0]["sequenceId"],
            json!(u32::MAX)
        );
        assert_eq!(read("null-read-as-default", &message)["nodes"][0]["actions"], json!([]));
        assert_eq!(read("released-assumed", &message)["nodes"][0]["released"], json!(true));
        assert_eq!(read("missing-list-read-as-empty", &message)["edges"], json!([]));
    }
}
