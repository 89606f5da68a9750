//! How messages are worded: where defects and liberties of the text of a message stand.

use serde_json::{Map, Value, json};

use super::faults::{FaultName as F, Faults};
use super::tolerances::{ToleranceName as T, Tolerances};
use super::wording_of_actions;

/// Stands for a token no JSON writer produces.
const NAN: &str = "@NaN@";

/// Stands for a number beyond all numbers.
const INFINITE: &str = "@Infinite@";

/// Stands around a number that is written with an exponent.
const EXPONENT: &str = "@Exponent@";

/// Applies what changes the content of a message.
pub(super) fn reworded(faults: Faults, tolerances: Tolerances, name: &str, message: &mut Value) {
    if name == "order" {
        order(faults, message);
    }
    for pointer in ["nodes", "edges"] {
        for element in elements(message, pointer) {
            for action in elements(element, "actions") {
                wording_of_actions::action(faults, name, action);
            }
        }
    }
    for action in elements(message, "actions") {
        wording_of_actions::action(faults, name, action);
    }
    if name == "instantActions"
        && faults.has(F::ActionsRenamed)
        && let Some(actions) = message.as_object_mut().and_then(|message| message.remove("actions"))
    {
        message["instantActions"] = actions;
    }
    if name == "instantActions"
        && faults.has(F::R1OneInstantNotInArray)
        && let Some([only]) = message["actions"].as_array().map(Vec::as_slice)
    {
        message["actions"] = only.clone();
    }
    if name == "instantActions"
        && faults.has(F::R2CancelWithoutArray)
        && let Some([only]) = message["actions"].as_array().map(Vec::as_slice)
        && only["actionType"] == "cancelOrder"
    {
        let only = only.clone();
        remove(message, "actions");
        for (key, value) in only.as_object().into_iter().flatten() {
            message[key.as_str()] = value.clone();
        }
    }
    if faults.has(F::R5MissingValuesAsNull) {
        super::habits::with_nulls(name, message);
    }
    if tolerances.has(T::VendorFields)
        && let Some(message) = message.as_object_mut()
    {
        message.insert("vendorTrace".into(), json!({ "thread": 4, "module": "dispatcher" }));
    }
}

/// The text of a message.
pub(super) fn written(faults: Faults, tolerances: Tolerances, message: &Value) -> Vec<u8> {
    let mut message = message.clone();
    if tolerances.has(T::R2MembersReversedInside) {
        message = reversed(&message);
    }
    if tolerances.has(T::KeysReordered)
        && let Value::Object(members) = &message
    {
        message = Value::Object(members.iter().rev().map(|(k, v)| (k.clone(), v.clone())).collect());
    }
    if tolerances.has(T::R5WholeNumbersWithoutPoint) {
        super::habits::without_point(&mut message);
    }
    if tolerances.has(T::R4NumbersWithExponent) {
        mark_coordinates(&mut message);
    }
    let mut text = if tolerances.has(T::PrettyPrinted) {
        serde_json::to_vec_pretty(&message).unwrap_or_default()
    } else {
        message.to_string().into_bytes()
    };
    if tolerances.has(T::R1TextEscaped) {
        text = escaped(&text);
    }
    if tolerances.has(T::R1BlankLinesAround) {
        text = [b"\r\n ".as_slice(), &text, b"\r\n"].concat();
    }
    if tolerances.has(T::R4NumbersWithExponent) {
        let plain = String::from_utf8_lossy(&text);
        text = plain
            .replace(&format!("\"{EXPONENT}"), "")
            .replace(&format!("{EXPONENT}\""), "")
            .into_bytes();
    }
    if faults.has(F::R1HorizonSpeedInfinite) {
        let token = format!("\"{INFINITE}\"");
        text = replaced(&text, token.as_bytes(), b"1e999");
    }
    if faults.has(F::NanCoordinate) {
        text = String::from_utf8_lossy(&text)
            .replace(&format!("\"{NAN}\""), "NaN")
            .into_bytes();
    }
    if faults.has(F::NotUtf8) {
        // é in Latin-1
        text = replaced(&text, "é".as_bytes(), &[0xe9]);
    }
    if faults.has(F::NulAfterJson) {
        text.push(0);
    }
    if faults.has(F::R3ByteOrderMark) && message.get("nodes").is_some() {
        text = [b"\xef\xbb\xbf".as_slice(), &text].concat();
    }
    text
}

/// `r4-numbers-with-exponent`: marks x and y, so that they are written with an exponent.
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

/// The members of all objects in the opposite order.
fn reversed(value: &Value) -> Value {
    match value {
        Value::Object(members) => {
            let members = members.iter().rev();
            Value::Object(members.map(|(key, member)| (key.clone(), reversed(member))).collect())
        }
        Value::Array(elements) => Value::Array(elements.iter().map(reversed).collect()),
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
        if *byte == b'"' && !after {
            inside = !inside;
        }
        after = *byte == b'\\' && !after;
    }
    out
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let Some(at) = bytes.windows(from.len().max(1)).position(|window| window == from) else {
        return bytes.to_vec();
    };
    [&bytes[..at], to, &replaced(&bytes[at + from.len()..], from, to)].concat()
}

fn elements<'a>(value: &'a mut Value, key: &str) -> impl Iterator<Item = &'a mut Value> {
    value.get_mut(key).and_then(Value::as_array_mut).into_iter().flatten()
}

pub(super) fn remove(value: &mut Value, key: &str) -> Option<Value> {
    value.as_object_mut().and_then(|object| object.shift_remove(key))
}

fn order(faults: Faults, message: &mut Value) {
    let first = message.pointer("/nodes/0/sequenceId").and_then(Value::as_u64);
    let update = first.is_some_and(|sequence| sequence > 0);
    identity(faults, update, message);
    if update {
        stitching(faults, message);
    }
    numbering(faults, first.unwrap_or(0), message);
    graph(faults, message);
    for node in elements(message, "nodes") {
        self::node(faults, node);
    }
    for edge in elements(message, "edges") {
        self::edge(faults, edge);
    }
    let alone = message["edges"].as_array().is_some_and(Vec::is_empty);
    if alone && faults.has(F::R4OneNodeOrderWithoutEdges) {
        remove(message, "edges");
    }
    if update && faults.has(F::R4NoLhdInUpdates) {
        without_devices(message);
    }
    if alone && faults.has(F::R2EdgesNullInStay) {
        message["edges"] = Value::Null;
    }
    if update && faults.has(F::R2PositionsOnlyInFirstMessage) {
        for node in elements(message, "nodes").skip(1) {
            remove(node, "nodePosition");
        }
    }
    if update
        && faults.has(F::R2UpdateIdKeyUpperCase)
        && let Some(number) = remove(message, "orderUpdateId")
    {
        message["orderUpdateID"] = number;
    }
    if faults.has(F::EmptyArraysOmitted) {
        for pointer in ["nodes", "edges"] {
            for element in elements(message, pointer) {
                without_empty(element);
            }
        }
        without_empty(message);
    }
}

/// `r4-no-lhd-in-updates`: no device for what is picked behind the stitching node.
fn without_devices(message: &mut Value) {
    for key in ["nodes", "edges"] {
        for element in elements(message, key).skip(usize::from(key == "nodes")) {
            let picks = elements(element, "actions").filter(|action| action["actionType"] == "pick");
            for pick in picks {
                if let Some(parameters) = pick.get_mut("actionParameters").and_then(Value::as_array_mut) {
                    parameters.retain(|parameter| parameter["key"] != "lhd");
                }
            }
        }
    }
}

fn without_empty(value: &mut Value) {
    if let Some(object) = value.as_object_mut() {
        object.retain(|_, member| member.as_array().is_none_or(|array| !array.is_empty()));
    }
}

fn identity(faults: Faults, update: bool, message: &mut Value) {
    let id = message["orderId"].as_str().unwrap_or_default().to_owned();
    let number = message["orderUpdateId"].as_u64().unwrap_or_default();
    if faults.has(F::OrderIdReused) {
        message["orderId"] = json!("transport");
    }
    if faults.has(F::OrderIdPerUpdate) && update {
        message["orderId"] = json!(format!("{id}-{number}"));
    }
    if faults.has(F::UpdateIdKept) {
        message["orderUpdateId"] = json!(0);
    }
    if faults.has(F::UpdateIdFalls) {
        message["orderUpdateId"] = json!(1000_u64.saturating_sub(number));
    }
    if faults.has(F::UpdateIdMissing) && !update {
        remove(message, "orderUpdateId");
    }
    if faults.has(F::R1NumericalIdsAsNumbers)
        && let Ok(number) = id.parse::<u64>()
    {
        message["orderId"] = json!(number);
    }
    if faults.has(F::R1ZoneSetNullInUpdates) && update {
        message["zoneSetId"] = Value::Null;
    }
    if faults.has(F::R3OrderIdMissingInUpdates) && update {
        remove(message, "orderId");
    }
    if faults.has(F::R3ZoneSetNamedNone) && message.get("zoneSetId").is_none() {
        message["zoneSetId"] = json!("none");
    }
    if faults.has(F::ZoneSetEmpty) || (update && faults.has(F::R4EmptyZoneSet)) {
        message["zoneSetId"] = json!("");
    }
}

/// Defects of the first node of an update.
fn stitching(faults: Faults, message: &mut Value) {
    let id = format!("added-{}", message["orderUpdateId"]);
    if let Some(node) = elements(message, "nodes").next() {
        if faults.has(F::R2StitchingNodeUnreleased) {
            node["released"] = json!(false);
        }
        if faults.has(F::R1StitchingDeviationWidened)
            && let Some(position) = node.get_mut("nodePosition").and_then(Value::as_object_mut)
        {
            position.insert("allowedDeviationXY".into(), json!(1.0));
        }
        if faults.has(F::R6StitchingThetaDropped)
            && let Some(position) = node.get_mut("nodePosition")
        {
            remove(position, "theta");
        }
        if faults.has(F::R5StitchingNodeDeviationReset)
            && let Some(deviation) = node.pointer_mut("/nodePosition/allowedDeviationXY")
        {
            *deviation = json!(0.0);
        }
        if faults.has(F::R1StitchingActionsRenamed) {
            for action in elements(node, "actions") {
                action["actionId"] = json!(format!("{}-{id}", action["actionId"].as_str().unwrap_or_default()));
            }
        }
        if faults.has(F::StitchingMoved)
            && let Some(x) = node.pointer_mut("/nodePosition/x")
        {
            *x = json!(x.as_f64().unwrap_or_default() + 0.3);
        }
        if faults.has(F::StitchingActionAdded)
            && let Some(actions) = node["actions"].as_array_mut()
        {
            actions.push(json!({ "actionType": "beep", "actionId": id, "blockingType": "NONE" }));
        }
    }
    if faults.has(F::StitchingMissing) {
        for key in ["nodes", "edges"] {
            if let Some(list) = message[key]
                .as_array_mut()
                .filter(|list| list.len() > 1 || key == "edges")
                && !list.is_empty()
            {
                list.remove(0);
            }
        }
    }
}

fn numbering(faults: Faults, first: u64, message: &mut Value) {
    let changed = |sequence: u64| match () {
        () if faults.has(F::SequenceFromOne) => sequence + 1,
        () if first > 0 && faults.has(F::R1StitchingNumberedAgain) => sequence + 2,
        () if faults.has(F::SequencePerKind) => sequence / 2,
        () if faults.has(F::SequenceRestarts) => sequence.saturating_sub(first),
        () => sequence,
    };
    for key in ["nodes", "edges"] {
        for element in elements(message, key) {
            let Some(sequence) = element["sequenceId"].as_u64() else {
                continue;
            };
            element["sequenceId"] = json!(changed(sequence));
            if first > 0 && faults.has(F::R2SequenceIdsAsTextInUpdates) {
                element["sequenceId"] = json!(sequence.to_string());
            }
            if key == "edges" && faults.has(F::SequenceIdFraction) {
                element["sequenceId"] = json!(sequence);
                if let Ok(number) = sequence.to_string().parse::<f64>() {
                    element["sequenceId"] = json!(number - 0.5);
                }
            }
        }
    }
}

fn graph(faults: Faults, message: &mut Value) {
    let text = |value: Option<&Value>| value.and_then(Value::as_str).unwrap_or_default().to_owned();
    let nodes = message["nodes"].as_array().cloned().unwrap_or_default();
    let start = text(nodes.first().map(|node| &node["nodeId"]));
    let end = text(nodes.last().map(|node| &node["nodeId"]));
    for edge in elements(message, "edges") {
        if faults.has(F::EdgeEndsSwapped) {
            let (from, to) = (edge["startNodeId"].clone(), edge["endNodeId"].clone());
            edge["startNodeId"] = to;
            edge["endNodeId"] = from;
        }
        if faults.has(F::EdgeEndsOfOrder) {
            edge["startNodeId"] = json!(start);
            edge["endNodeId"] = json!(end);
        }
    }
    if faults.has(F::EdgeMissing)
        && let Some(edges) = message["edges"].as_array_mut()
    {
        edges.pop();
    }
    if faults.has(F::EdgeReleasedAlone)
        && let Some(edge) = elements(message, "edges").find(|edge| edge["released"] == json!(false))
    {
        edge["released"] = json!(true);
    }
    if faults.has(F::ReleasedBehindHorizon)
        && let Some(node) = message["nodes"].as_array_mut().and_then(|nodes| nodes.last_mut())
    {
        node["released"] = json!(true);
    }
}

fn node(faults: Faults, node: &mut Value) {
    if let Some(position) = node.get_mut("nodePosition").and_then(Value::as_object_mut) {
        self::position(faults, position);
    }
    let mut kinds = node["actions"].as_array().into_iter().flatten();
    if kinds.any(|action| action["actionType"] == "drop")
        && faults.has(F::R3StationMovedWhenLoaded)
        && let Some(x) = node.pointer_mut("/nodePosition/x")
    {
        *x = json!(x.as_f64().unwrap_or_default() + 0.4);
    }
    if faults.has(F::PositionMissing) {
        remove(node, "nodePosition");
    }
    if faults.has(F::ReleasedMissing) && node["released"] == json!(false) {
        remove(node, "released");
    }
    let planned = node["released"] == json!(false);
    let stops = !node["actions"].as_array().is_none_or(Vec::is_empty);
    if planned && stops && faults.has(F::R1StationsAlwaysReleased) {
        node["released"] = json!(true);
    }
    if planned && !stops && faults.has(F::R4NoActionListInTheHorizon) {
        remove(node, "actions");
    }
    if planned && faults.has(F::R1HorizonWithoutPosition) {
        remove(node, "nodePosition");
    }
    if faults.has(F::R1OneActionNotInArray)
        && let Some([only]) = node["actions"].as_array().map(Vec::as_slice)
    {
        node["actions"] = only.clone();
    }
    element(faults, node);
}

/// Defects nodes and edges share.
fn element(faults: Faults, element: &mut Value) {
    if faults.has(F::BooleansAsWords)
        && let Some(released) = element.get("released").and_then(Value::as_bool)
    {
        element["released"] = json!(if released { "TRUE" } else { "FALSE" });
    }
    let planned = element["released"] == json!(false);
    if planned && faults.has(F::R1HorizonWithoutActions) {
        remove(element, "actions");
    }
    if faults.has(F::SnakeCaseKeys)
        && let Some(sequence) = remove(element, "sequenceId")
    {
        element["sequence_id"] = sequence;
    }
}

fn position(faults: Faults, position: &mut Map<String, Value>) {
    let number = |position: &Map<String, Value>, key: &str| position.get(key).and_then(Value::as_f64);
    let scaled = |position: &mut Map<String, Value>, key: &str, factor: f64| {
        if let Some(number) = number(position, key) {
            position.insert(key.to_owned(), json!(number * factor));
        }
    };
    if faults.has(F::R1NullTheta) && !position.contains_key("theta") {
        position.insert("theta".into(), Value::Null);
    }
    if faults.has(F::R1ZeroCoordinatesOmitted) {
        position.retain(|key, value| !matches!(key.as_str(), "x" | "y") || value.as_f64() != Some(0.0));
    }
    if faults.has(F::MirroredMap) {
        scaled(position, "y", -1.0);
    }
    if faults.has(F::Millimetres) {
        scaled(position, "x", 1000.0);
        scaled(position, "y", 1000.0);
    }
    if faults.has(F::ThetaInDegrees) {
        let theta = number(position, "theta").unwrap_or(std::f64::consts::FRAC_PI_2);
        position.insert("theta".into(), json!(theta.to_degrees()));
    }
    if faults.has(F::DeviationNegative) && !position.contains_key("allowedDeviationXY") {
        position.insert("allowedDeviationXY".into(), json!(-1.0));
    }
    if faults.has(F::NumbersAsText) {
        for key in ["x", "y"] {
            if let Some(number) = number(position, key) {
                position.insert(key.to_owned(), json!(number.to_string()));
            }
        }
    }
    if faults.has(F::NanCoordinate) && !position.contains_key("theta") {
        position.insert("theta".into(), json!(NAN));
    }
    if faults.has(F::R3AxesSwapped)
        && let (Some(x), Some(y)) = (number(position, "x"), number(position, "y"))
    {
        position.insert("x".into(), json!(y));
        position.insert("y".into(), json!(x));
    }
    if faults.has(F::MapIdMissing) {
        position.shift_remove("mapId");
    }
}

fn edge(faults: Faults, edge: &mut Value) {
    if faults.has(F::EdgeWithoutEnds) {
        remove(edge, "startNodeId");
        remove(edge, "endNodeId");
    }
    if edge["released"] == json!(false) && faults.has(F::R2EndNodeMissingInHorizon) {
        remove(edge, "endNodeId");
    }
    if edge.get("orientationType").is_some() && faults.has(F::R2OrientationTypeCapitalized) {
        edge["orientationType"] = json!("Tangential");
    }
    if faults.has(F::R1EdgeIdWithArrow)
        && let Some(id) = edge["edgeId"].as_str()
    {
        edge["edgeId"] = json!(id.replacen('-', "->", 1));
    }
    let back = edge["startNodeId"].as_str() > edge["endNodeId"].as_str();
    let planned = edge["released"] == json!(false);
    if planned && edge.get("maxSpeed").is_some() && faults.has(F::R1HorizonSpeedInfinite) {
        edge["maxSpeed"] = json!(INFINITE);
    }
    if back && faults.has(F::R1ReverseEdgesMisdirected) {
        let (from, to) = (edge["startNodeId"].clone(), edge["endNodeId"].clone());
        edge["startNodeId"] = to;
        edge["endNodeId"] = from;
    }
    if faults.has(F::R1ReleasedAsNumber)
        && let Some(released) = edge["released"].as_bool()
    {
        edge["released"] = json!(u8::from(released));
    }
    if faults.has(F::R1EdgeActionsSingular)
        && let Some(actions) = remove(edge, "actions")
    {
        edge["action"] = actions;
    }
    if faults.has(F::R5RotationAllowedAsWord)
        && let Some(allowed) = edge.get("rotationAllowed").and_then(Value::as_bool)
    {
        edge["rotationAllowed"] = json!(allowed.to_string());
    }
    if faults.has(F::R3SpeedsAsText)
        && let Some(speed) = edge.get("maxSpeed").and_then(Value::as_f64)
    {
        edge["maxSpeed"] = json!(speed.to_string());
    }
    if faults.has(F::EdgeIdMissing) {
        remove(edge, "edgeId");
    }
    if faults.has(F::NullForNothing) && edge["actions"].as_array().is_some_and(Vec::is_empty) {
        edge["actions"] = Value::Null;
    }
    element(faults, edge);
}
