//! Members of messages, read leniently: what is missing or of another type is as good as not there.

use serde_json::Value;
use tck_base::pattern::whole;

/// How many elements of one list are looked at.
pub const ELEMENTS: usize = 2048;

/// The elements of an array member; none if it is missing or no array.
pub fn elements<'v>(value: &'v Value, name: &str) -> impl Iterator<Item = &'v Value> {
    value.get(name).and_then(Value::as_array).into_iter().flatten()
}

/// A text member; empty when it is missing.
#[must_use]
pub fn text<'v>(value: &'v Value, name: &str) -> &'v str {
    value.get(name).and_then(Value::as_str).unwrap_or_default()
}

/// A text member cut to a length that is remembered; empty when it is missing.
#[must_use]
pub fn kept(value: &Value, name: &str) -> String {
    text(value, name).chars().take(512).collect()
}

/// A short copy of a text member; `None` when it is missing or no text.
#[must_use]
pub fn short(value: &Value, name: &str) -> Option<String> {
    Some(value.get(name)?.as_str()?.chars().take(256).collect())
}

/// A whole number member.
#[must_use]
pub fn number(message: &Value, name: &str) -> Option<u64> {
    whole(message.get(name)?)
}

/// Every action of an instantActions message, whatever else is wrong with it.
pub fn actions(message: &Value) -> impl Iterator<Item = &Value> {
    // 1.1 and careless senders call the list `instantActions`.
    elements(message, "actions").chain(elements(message, "instantActions"))
}

/// The actions of an instantActions message of a master control.
///
/// Where there is no array `actions`, the name that older versions gave it counts: what must not come does not become right by
/// a wrong name.
pub fn instant_actions(message: &Value) -> impl Iterator<Item = &Value> {
    let named = message.get("actions").is_some_and(Value::is_array);
    let list = if named { "actions" } else { "instantActions" };
    elements(message, list).take(ELEMENTS)
}

/// Whether an element of an order or of a state is released.
#[must_use]
pub fn released(element: &Value) -> Option<bool> {
    element.get("released")?.as_bool()
}

/// The elements of a list in the order of their sequenceIds, where all have one; as they stand otherwise.
#[must_use]
pub fn in_sequence<'v>(order: &'v Value, list: &str) -> Vec<&'v Value> {
    let mut all: Vec<&Value> = elements(order, list).take(ELEMENTS).collect();
    if all.iter().all(|element| number(element, "sequenceId").is_some()) {
        all.sort_by_key(|element| number(element, "sequenceId"));
    }
    all
}

/// x, y and mapId of a node of an order.
#[must_use]
pub fn place_of(node: &Value) -> Option<(f64, f64, &str)> {
    let position = node.get("nodePosition")?;
    let member = |name: &str| {
        position
            .get(name)
            .and_then(Value::as_f64)
            .filter(|value| value.is_finite())
    };
    Some((member("x")?, member("y")?, text(position, "mapId")))
}
