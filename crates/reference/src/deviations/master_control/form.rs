//! Deviations of the form of messages: JSON, its types, its text (sections 6.1 and 7).

use super::prelude::*;

records! {
    fault "snake-case-keys" ["JSON-01"] "Writes sequence_id instead of sequenceId."
        => element(|element| element.rename("sequenceId", "sequence_id"));
    fault "lower-case-enums" ["JSON-02", "ORD-MSG-16"] "Writes blocking types in small letters."
        => action(|a| a.change("blockingType", |b| *b = json!(b.as_str().unwrap_or_default().to_ascii_lowercase())));
    fault "blocking-types-in-mixed-case" ["JSON-02", "ORD-MSG-16"] "It writes the blockingType of actions in orders as None, Soft, Single and Hard."
        => action_of("order", |a| a.change("blockingType", |b| *b = json!(capitalized(&b.as_str().unwrap_or_default().to_ascii_lowercase()))));
    fault "instant-actions-pascal-case" ["JSON-01", "ORD-MSG-15", "IACT-01"]
        "It writes the members of instant actions with a capital first letter, such as ActionType."
        => action_of("instantActions", |a| *a = std::mem::take(a).into_iter().map(|(key, value)| (capitalized(&key), value)).collect());
    fault "blocking-type-as-ordinal" ["JSON-06", "ORD-MSG-16", "ORD-MSG-15", "JSON-02"] "It writes the blockingType of actions in orders as a number: 0, 1 or 2."
        => action_of("order", |a| {
            let ordinal = ["NONE", "SOFT", "HARD"].iter().position(|known| a.says("blockingType", *known));
            a.change("blockingType", |blocking| *blocking = json!(ordinal));
        });
    fault "action-id-key-upper-case" ["JSON-01", "ORD-MSG-15", "JSON-10"] "Actions in orders carry their id under actionID."
        => action_of("order", |a| a.rename("actionId", "actionID"));
    fault "node-action-type-called-name" ["ORD-MSG-15", "JSON-01"] "It names the member actionType of actions in orders actionName."
        => action_of("order", |a| a.rename("actionType", "actionName"));
    fault "numbers-as-text" ["JSON-06", "ORD-MSG-05"] "Writes coordinates as strings."
        => position(|p| for key in ["x", "y"] { p.change(key, as_text); });
    fault "speeds-as-text" ["JSON-06", "JSON-10"] "It writes the maxSpeed of edges as a text."
        => edge(|e| e.change("maxSpeed", as_text));
    fault "rotation-allowed-as-word" ["JSON-07", "JSON-06"] "It writes rotationAllowed as the string true or false."
        => edge(|e| e.change("rotationAllowed", as_text));
    fault "booleans-as-words" ["JSON-07", "ORD-MSG-05"] "Writes released as a word."
        => element(|element| element.change("released", |released| *released = json!(if *released == true { "TRUE" } else { "FALSE" })));
    fault "released-as-number" ["JSON-07", "ORD-MSG-18", "JSON-10"] "released of edges is 1 or 0."
        => edge(|e| e.change("released", |released| *released = json!(u8::from(*released == true))));
    fault "sequence-id-fraction" ["JSON-09", "ORD-UPD-11", "ORD-MSG-18"] "Numbers edges half-way between their nodes."
        => edge(|e| e.change("sequenceId", |id| *id = json!(id.as_f64().unwrap_or_default() - 0.5)));
    fault "sequence-ids-as-text-in-updates" ["JSON-06", "ORD-MSG-05", "ORD-MSG-18"] "It writes the sequenceIds of nodes and edges as texts in order updates."
        => update(|m| for list in ["nodes", "edges"] { m.each(list, |element| element.change("sequenceId", as_text)); });
    fault "null-for-nothing" ["JSON-10", "JSON-06"] "Writes null where an edge has no actions."
        => edge(|e| e.change("actions", |actions| if *actions == json!([]) { *actions = Value::Null; }));
    fault "null-theta" ["JSON-10", "JSON-06", "OPT-03"] "Nodes without an orientation carry theta with the value null."
        => position(|p| p.supply("theta", Value::Null));
    fault "missing-values-as-null" ["JSON-06", "JSON-10"] "It writes optional fields for which it has no value as null."
        => every(with_nulls);
    fault "numerical-ids-as-numbers" ["ORD-MSG-15", "ORD-MSG-01", "IACT-01", "JSON-06", "JSON-10"]
        "For a vehicle that takes numerical ids only, actionId and orderId are JSON numbers."
        => every(|m| {
            m.change("orderId", as_number);
            each_action(m, |a| a.change("actionId", as_number));
        });
    fault "update-id-key-upper-case" ["JSON-01", "ORD-MSG-01"] "It writes the key of the update number as orderUpdateID in order updates."
        => update(|m| m.rename("orderUpdateId", "orderUpdateID"));
    fault "empty-arrays-omitted" ["ORD-MSG-06", "JSON-10"] "Leaves out arrays that have no element."
        => order(|m| {
            for list in ["nodes", "edges"] { m.each(list, |element| element.retain(|_, member| *member != json!([]))); }
            m.retain(|_, member| *member != json!([]));
        });
    fault "one-node-order-without-edges" ["ORD-MSG-06", "ORD-MSG-01"] "It leaves the edges array out of an order that consists of one node only."
        => order(|m| if m.says("edges", json!([])) { m.unset("edges"); });
    fault "edges-null-in-stay" ["ORD-MSG-06", "ORD-MSG-01"] "It sends null instead of an empty array of edges when an order message has one node."
        => order(|m| if m.says("edges", json!([])) { m.set("edges", Value::Null); });
    fault "one-action-not-in-array" ["JSON-06", "ORD-MSG-05", "JSON-10"] "Where a node has one action only, actions is that object and not an array."
        => node(|n| n.change("actions", not_in_array));
    fault "one-instant-not-in-array" ["IACT-01", "JSON-06", "JSON-10"] "When there is one instant action only, actions is that object and not an array."
        => instant(|m| m.change("actions", not_in_array));
    fault "single-parameter-not-in-array" ["BP-04"] "It sends the parameter of an action with only one as an object instead of an array of one."
        => action(|a| a.change("actionParameters", not_in_array));
    fault "cancel-without-array" ["IACT-01"] "It writes the members of cancelOrder directly into the message instead of an actions array."
        => instant(|m| {
            if m.list("actions").len() == 1 && m.list("actions")[0]["actionType"] == "cancelOrder" {
                let only = m.remove("actions").and_then(|mut actions| actions[0].as_object_mut().map(std::mem::take));
                m.extend(only.unwrap_or_default());
            }
        });
    fault "actions-renamed" ["IACT-01"] "Calls the array of instant actions instantActions."
        => instant(|m| m.rename("actions", "instantActions"));
    fault "edge-actions-singular" ["ORD-MSG-18", "ORD-MSG-06", "JSON-01", "JSON-10"] "The array of actions of an edge is named action."
        => edge(|e| e.rename("actions", "action"));
    fault "nan-coordinate" ["JSON-08", "MQTT-02"] "Writes NaN where it does not know an orientation."
        => position(|p| p.supply("theta", NAN)).writes(|_, _, _, _, text| replace(text, &quoted(NAN), b"NaN"));
    fault "horizon-speed-infinite" ["JSON-08", "JSON-09", "MQTT-02"] "maxSpeed on edges of the horizon is 1e999, which no float64 holds."
        => edge(|e| if e.says("released", false) { e.change("maxSpeed", |speed| *speed = json!(INFINITE)); })
            .writes(|_, _, _, _, text| replace(text, &quoted(INFINITE), b"1e999"));
    fault "not-utf8" ["JSON-03", "MQTT-02"] "Writes descriptions in Latin-1."
        => describing().writes(|_, _, _, _, text| replace(text, "é".as_bytes(), &[0xe9]));
    fault "nul-after-json" ["MQTT-02", "JSON-10"] "Sends the terminating zero byte of its string with every message."
        => plain().writes(|_, _, _, _, text| text.push(0));
    fault "byte-order-mark" ["JSON-03"] "It begins every order message with a byte order mark."
        because "The message is UTF-8, and the ruling of JSON-03 leaves a warning for the mark."
        => writing("order", |text| *text = [b"\xef\xbb\xbf".as_slice(), text].concat());
    fault "long-message-cut" ["MQTT-02", "JSON-10"] "It cuts every order message off after 768 bytes, the size of its send buffer."
        => writing("order", |text| text.truncate(768));
    fault "utf16-instant-actions" ["JSON-03", "MQTT-02"] "It encodes instantActions in UTF-16."
        => writing("instantActions", |text| *text = String::from_utf8_lossy(text).encode_utf16().flat_map(u16::to_le_bytes).collect());
    fault "cancel-double-encoded" ["MQTT-02", "IACT-01"] "The message with cancelOrder is a JSON string that holds the JSON text, not a JSON object."
        => plain().writes(|_, _, _, message, text| {
            let mut actions = message["actions"].as_array().into_iter().flatten();
            if actions.any(|action| action["actionType"] == "cancelOrder") { *text = json!(String::from_utf8_lossy(text)).to_string().into_bytes(); }
        });
    tolerance "vendor-fields" ["JSON-10"] "Adds members of its own to every message."
        => every(|m| m.set("vendorTrace", json!({ "thread": 4, "module": "dispatcher" })));
    tolerance "own-members-in-orders-and-nodes" ["JSON-10"] "It adds a member of its own to orders and to each of their nodes."
        => order(|m| {
            m.set("customerReference", "4711");
            m.each("nodes", |node| node.set("customerReference", "4711"));
        });
    tolerance "keys-reordered" ["HDR-01"] "Sends the members of its messages in reverse order."
        => sending(|_, _, out| out.message = std::mem::take(&mut out.message).into_iter().rev().collect());
    tolerance "members-reversed-inside" ["HDR-01"] "It writes the members of all objects in the opposite order, the header last."
        => sending(|_, _, out| {
            let message = reversed(&Value::Object(std::mem::take(&mut out.message)));
            out.message = message.as_object().cloned().unwrap_or_default();
        });
    tolerance "pretty-printed" ["MQTT-02"] "Sends its messages in many lines, indented."
        => plain().writes(|_, _, _, message, text| *text = serde_json::to_vec_pretty(message).unwrap_or_default());
    tolerance "text-escaped" ["JSON-03", "MQTT-02"] "Hyphens in JSON texts are written as escaped code points."
        => plain().writes(|_, _, _, _, text| *text = escaped(text));
    tolerance "blank-lines-around" ["MQTT-02"] "There is white space before and behind the JSON object."
        => plain().writes(|_, _, _, _, text| *text = [b"\r\n ".as_slice(), text, b"\r\n"].concat());
    tolerance "whole-numbers-without-point" ["JSON-06", "JSON-09"] "It writes whole coordinates and speeds without a decimal point."
        => sending(|_, _, out| out.message.values_mut().for_each(without_point));
    tolerance "numbers-with-exponent" ["JSON-06", "JSON-09"] "It writes coordinates with an exponent, such as 1.05e1."
        => plain().writes(|_, _, _, message, text| {
            let mut message = message.clone();
            mark_coordinates(&mut message);
            let plain = message.to_string().replace(&format!("\"{EXPONENT}"), "").replace(&format!("{EXPONENT}\""), "");
            *text = plain.into_bytes();
        });
    fault "empty-message-after-order" ["MQTT-02"] "It publishes a message without any content on the order topic, not retained, when an order has ended."
        => happening(|site, vehicle, event| if let Event::Ended(_, false) = event {
            vehicle.topic("order").into_iter().for_each(|topic| site.push(topic.to_owned(), Vec::new(), 0, false));
        });
}

/// Stands for a token no JSON writer produces.
const NAN: &str = "@NaN@";
/// Stands for a number beyond all numbers.
const INFINITE: &str = "@Infinite@";
/// Stands around a number that is written with an exponent.
const EXPONENT: &str = "@Exponent@";

fn as_text(value: &mut Value) {
    *value = json!(value.to_string());
}

fn as_number(value: &mut Value) {
    if let Some(number) = value.as_str().and_then(|id| id.parse::<u64>().ok()) {
        *value = json!(number);
    }
}

fn not_in_array(value: &mut Value) {
    if let Some([only]) = value.as_array().map(Vec::as_slice) {
        *value = only.clone();
    }
}

fn quoted(token: &str) -> Vec<u8> {
    format!("\"{token}\"").into_bytes()
}

fn replace(text: &mut Vec<u8>, from: &[u8], to: &[u8]) {
    let mut at = 0;
    while let Some(found) = text[at..].windows(from.len()).position(|window| window == from) {
        text.splice(at + found..at + found + from.len(), to.iter().copied());
        at += found + to.len();
    }
}

/// Writes every optional member that is missing as null.
fn with_nulls(message: &mut Object) {
    fn fill(value: &mut Object, names: &[&str]) {
        for name in names {
            value.entry(*name).or_insert(Value::Null);
        }
    }
    if message.contains_key("nodes") {
        fill(message, &["zoneSetId"]);
    }
    message.each("nodes", |node| {
        fill(node, &["nodeDescription", "nodePosition"]);
        node.part("nodePosition", |place| {
            fill(
                place,
                &["theta", "allowedDeviationXY", "allowedDeviationTheta", "mapDescription"],
            );
        });
    });
    let texts = ["edgeDescription", "orientationType", "direction"];
    let numbers = [
        "maxSpeed",
        "maxHeight",
        "minHeight",
        "orientation",
        "maxRotationSpeed",
        "length",
    ];
    message.each("edges", |edge| {
        fill(edge, &texts);
        fill(edge, &numbers);
        fill(edge, &["rotationAllowed", "trajectory", "corridor"]);
    });
    each_action(message, |action| {
        fill(action, &["actionDescription", "actionParameters"])
    });
}

/// The members of all objects in the opposite order.
fn reversed(value: &Value) -> Value {
    match value {
        Value::Object(members) => {
            let members = members.iter().rev();
            Value::Object(members.map(|(key, member)| (key.clone(), reversed(member))).collect())
        }
        Value::Array(elements) => elements.iter().map(reversed).collect(),
        other => other.clone(),
    }
}

/// Writes every hyphen within a text as its code point.
fn escaped(text: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(text.len() * 2);
    let (mut inside, mut after) = (false, false);
    for byte in text {
        match byte {
            b'-' if inside && !after => out.extend_from_slice(b"\\u002d"),
            _ => out.push(*byte),
        }
        inside ^= *byte == b'"' && !after;
        after = *byte == b'\\' && !after;
    }
    out
}

/// Writes 3.0 as 3.
fn without_point(value: &mut Value) {
    match value {
        Value::Object(members) => members.values_mut().for_each(without_point),
        Value::Array(elements) => elements.iter_mut().for_each(without_point),
        Value::Number(number) if number.is_f64() => {
            // A whole float is displayed without a point.
            let whole = number.as_f64().filter(|number| number.fract() == 0.0);
            if let Some(whole) = whole.and_then(|whole| (whole + 0.0).to_string().parse::<i64>().ok()) {
                *value = json!(whole);
            }
        }
        _ => {}
    }
}

/// Marks x and y, so that they are written with an exponent.
fn mark_coordinates(value: &mut Value) {
    match value {
        Value::Object(members) => {
            for (key, member) in members.iter_mut() {
                match member.as_f64().filter(|_| matches!(key.as_str(), "x" | "y")) {
                    Some(number) => *member = json!(format!("{EXPONENT}{number:e}{EXPONENT}")),
                    None => mark_coordinates(member),
                }
            }
        }
        Value::Array(elements) => elements.iter_mut().for_each(mark_coordinates),
        _ => {}
    }
}
