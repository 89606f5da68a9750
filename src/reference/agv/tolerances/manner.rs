//! Liberties in how a message is worded: what else it says, and how its JSON is written.

use std::io;

use serde::Serialize as _;
use serde_json::ser::{CompactFormatter, Formatter};
use serde_json::{Map, Value, json};

use super::{ToleranceName as T, Tolerances};

/// Members of a state a vehicle need not send.
const OPTIONAL: [&str; 2] = ["velocity", "distanceSinceLastNode"];

/// Words the message `name` otherwise. `even` changes with every state.
pub(in crate::reference::agv) fn reworded(
    tolerances: Tolerances,
    name: &str,
    mut message: Map<String, Value>,
    even: bool,
) -> Map<String, Value> {
    if tolerances == Tolerances::default() {
        return message;
    }
    let has = |tolerance| tolerances.has(tolerance);
    if name == "state" {
        state(tolerances, &mut message, even);
    }
    if has(T::R2PositionMinimal)
        && let Some(Value::Object(pose)) = message.get_mut("agvPosition")
    {
        pose.retain(|key, _| matches!(key.as_str(), "positionInitialized" | "x" | "y" | "theta" | "mapId"));
    }
    if has(T::R2VisualizationWithoutVelocity) && name == "visualization" {
        message.remove("velocity");
    }
    if has(T::AnglesRounded)
        && let Some(theta) = message
            .get_mut("agvPosition")
            .and_then(|position| position.get_mut("theta"))
        && let Some(angle) = theta.as_f64()
    {
        *theta = json!((angle * 10_000.0).round() / 10_000.0);
    }
    if has(T::SinglePrecision) && matches!(name, "state" | "visualization") {
        in_single_precision(&mut message);
    }
    if has(T::VendorFields) {
        with_vendor_fields(&mut message);
    }
    if has(T::FloatsForIntegers) {
        message.values_mut().for_each(with_fractions);
    }
    if has(T::KeysReordered) {
        message = message.into_iter().rev().collect();
    }
    message
}

fn state(tolerances: Tolerances, state: &mut Map<String, Value>, even: bool) {
    let has = |tolerance| tolerances.has(tolerance);
    let mut add = |list: &str, entry: Value| {
        if let Some(Value::Array(list)) = state.get_mut(list) {
            list.push(entry);
        }
    };
    if has(T::VendorInformation) {
        let references = json!([{ "referenceKey": "place", "referenceValue": "hall 3" }]);
        add(
            "information",
            json!({ "infoType": "tyrePressure", "infoLevel": "DEBUG", "infoReferences": references, "infoDescription": "2.4 bar" }),
        );
    }
    if has(T::VendorWarning) || (has(T::WarningComesAndGoes) && even) {
        let description = "the brush of the left front wheel is worn";
        add(
            "errors",
            json!({ "errorType": "maintenanceDue", "errorLevel": "WARNING", "errorDescription": description,
                "errorReferences": [{ "referenceKey": "part", "referenceValue": "brush 2" }] }),
        );
    }
    if has(T::R2InformationComesAndGoes) && even {
        let references = json!([{ "referenceKey": "cycle", "referenceValue": "12 ms" }]);
        let description = "the control was busy";
        add(
            "information",
            json!({ "infoType": "load", "infoLevel": "DEBUG", "infoReferences": references, "infoDescription": description }),
        );
    }
    if has(T::R4InformationInEveryState) {
        let count = state.get("headerId").cloned().unwrap_or_default();
        if let Some(Value::Array(entries)) = state.get_mut("information") {
            entries.push(
                json!({ "infoType": "cycleCounter", "infoLevel": "DEBUG", "infoDescription": format!("cycle {count}") }),
            );
        }
    }
    worded_otherwise(tolerances, state);
    if let Some(Value::Array(loads)) = state.get_mut("loads").filter(|_| has(T::R2LoadsMinimal)) {
        for load in loads.iter_mut().filter_map(Value::as_object_mut) {
            load.retain(|key, _| key == "loadId" || key == "loadType");
        }
    }
    if has(T::DescriptionsEverywhere)
        && let Some(Value::Array(actions)) = state.get_mut("actionStates")
    {
        for action in actions.iter_mut().filter_map(Value::as_object_mut) {
            action.insert("actionDescription".into(), json!("as the vehicle understands it"));
        }
    }
    if has(T::OptionalAdded) {
        add_optional(state);
    }
    if has(T::OptionalOmitted) {
        for key in OPTIONAL {
            state.remove(key);
        }
    }
}

/// What a vehicle may leave out, or list in another order.
fn worded_otherwise(tolerances: Tolerances, state: &mut Map<String, Value>) {
    let has = |tolerance| tolerances.has(tolerance);
    for (list, tolerance) in [
        ("actionStates", T::R1ActionStatesReversed),
        ("errors", T::R1ErrorsNewestFirst),
        ("maps", T::R1MapsReversed),
    ] {
        if let Some(Value::Array(entries)) = state.get_mut(list).filter(|_| has(tolerance)) {
            entries.reverse();
        }
    }
    if let Some(Value::Array(errors)) = state.get_mut("errors") {
        for error in errors.iter_mut().filter_map(Value::as_object_mut) {
            if has(T::R2ErrorsInOwnLanguage) {
                error.insert("errorDescription".into(), json!("Störung – bitte Gerät prüfen (故障)"));
            }
            if has(T::R2ErrorHintsGiven) {
                error.insert("errorHint".into(), json!("see the manual, section 7"));
            }
            if has(T::R2VendorReferences) {
                let own = json!({ "referenceKey": "vendorCode", "referenceValue": "E-17" });
                match error.get_mut("errorReferences") {
                    Some(Value::Array(references)) => references.insert(0, own),
                    Some(_) => {}
                    None => {
                        error.insert("errorReferences".into(), json!([own]));
                    }
                }
            }
            if has(T::R1ErrorsUndescribed) {
                error.remove("errorDescription");
            }
            if has(T::R1ReferencesReversed)
                && let Some(Value::Array(references)) = error.get_mut("errorReferences")
            {
                references.reverse();
            }
            let none = error
                .get("errorReferences")
                .and_then(Value::as_array)
                .is_some_and(Vec::is_empty);
            if none && has(T::R1EmptyReferencesOmitted) {
                error.remove("errorReferences");
            }
        }
    }
    if let Some(Value::Array(actions)) = state.get_mut("actionStates") {
        for action in actions.iter_mut().filter_map(Value::as_object_mut) {
            if has(T::R1ActionTypeOmitted) {
                action.remove("actionType");
            }
            if has(T::R3ResultsEmpty) {
                action.entry("resultDescription").or_insert_with(|| json!(""));
            }
            let finished = action.get("actionStatus").is_some_and(|status| status == "FINISHED");
            if finished && has(T::R1ResultsEverywhere) {
                action.entry("resultDescription").or_insert_with(|| json!("done"));
            }
        }
    }
    for list in ["nodeStates", "edgeStates"] {
        if let Some(Value::Array(entries)) = state.get_mut(list) {
            for entry in entries.iter_mut().filter_map(Value::as_object_mut) {
                if has(T::R1NodePositionOmitted) {
                    entry.remove("nodePosition");
                }
                if has(T::R1RouteDescribed) {
                    let key = if list == "nodeStates" {
                        "nodeDescription"
                    } else {
                        "edgeDescription"
                    };
                    entry.insert(key.into(), json!("as it is called in the vehicle"));
                }
            }
        }
    }
    if let Some(Value::Array(maps)) = state.get_mut("maps").filter(|_| has(T::R3MapsDescribed)) {
        for map in maps.iter_mut().filter_map(Value::as_object_mut) {
            map.insert("mapDescription".into(), json!("as drawn in spring"));
        }
    }
    let unwanted = state.get("newBaseRequest") == Some(&json!(false));
    if unwanted && has(T::R3NewBaseOnlyWhenWanted) {
        state.remove("newBaseRequest");
    }
    if has(T::R4OptionalStateFieldsLeftOut) {
        for key in ["velocity", "loads", "information", "newBaseRequest"] {
            state.remove(key);
        }
    }
    if has(T::R1BatteryMinimal)
        && let Some(Value::Object(battery)) = state.get_mut("batteryState")
    {
        battery.retain(|key, _| key == "batteryCharge" || key == "charging");
    }
    for (key, tolerance) in [
        ("information", T::R1InformationOmitted),
        ("newBaseRequest", T::R1NewBaseNeverRequested),
        ("loads", T::R1LoadsUndetermined),
    ] {
        if has(tolerance) {
            state.remove(key);
        }
    }
}

fn add_optional(state: &mut Map<String, Value>) {
    state.insert("distanceSinceLastNode".into(), json!(0.0));
    if let Some(Value::Object(pose)) = state.get_mut("agvPosition") {
        pose.insert("localizationScore".into(), json!(0.97));
        pose.insert("deviationRange".into(), json!(0.02));
        pose.insert("mapDescription".into(), json!("the floor"));
    }
    if let Some(Value::Object(battery)) = state.get_mut("batteryState") {
        battery.insert("batteryVoltage".into(), json!(48.2));
        battery.insert("batteryHealth".into(), json!(98));
    }
}

/// Where the vehicle is, as a 32-bit float holds it: pi is a little more than pi.
fn in_single_precision(message: &mut Map<String, Value>) {
    let Some(Value::Object(position)) = message.get_mut("agvPosition") else {
        return;
    };
    for name in ["x", "y", "theta"] {
        let Some(value) = position.get_mut(name) else { continue };
        let Some(number) = value.as_f64() else { continue };
        #[expect(clippy::cast_possible_truncation, reason = "that is what it is about")]
        let single = number as f32;
        *value = json!(f64::from(single));
    }
}

fn with_vendor_fields(object: &mut Map<String, Value>) {
    for value in object.values_mut() {
        nested(value, &mut with_vendor_fields);
    }
    object.insert(
        "x-vendor".into(),
        json!({ "firmware": "7.1", "flags": [1, true, null] }),
    );
}

/// Every object directly below, through lists.
fn nested(value: &mut Value, act: &mut impl FnMut(&mut Map<String, Value>)) {
    match value {
        Value::Object(object) => act(object),
        Value::Array(list) => list.iter_mut().for_each(|value| nested(value, act)),
        _ => {}
    }
}

fn with_fractions(value: &mut Value) {
    match value {
        Value::Object(object) => object.values_mut().for_each(with_fractions),
        Value::Array(list) => list.iter_mut().for_each(with_fractions),
        Value::Number(number) if number.is_u64() || number.is_i64() => *value = json!(number.as_f64()),
        _ => {}
    }
}

/// The bytes of a message.
pub(in crate::reference::agv) fn written(tolerances: Tolerances, message: Map<String, Value>) -> Vec<u8> {
    let message = Value::Object(message);
    if tolerances.has(T::PrettyPrinted) {
        return format!("{message:#}\n").into_bytes();
    }
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, Hand(tolerances));
    // Writing a JSON value into memory cannot fail; a message cut short would be found by every test.
    let _ = message.serialize(&mut serializer);
    bytes
}

/// How the vehicle writes texts and numbers.
struct Hand(Tolerances);

impl Formatter for Hand {
    fn write_string_fragment<W: ?Sized + io::Write>(&mut self, writer: &mut W, fragment: &str) -> io::Result<()> {
        if self.0.has(T::TextEscaped) {
            return writer.write_all(fragment.replace('e', "\\u0065").as_bytes());
        }
        writer.write_all(fragment.as_bytes())
    }

    fn write_f64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        let text = match () {
            () if self.0.has(T::Exponents) => format!("{value:e}"),
            () if self.0.has(T::ManyDigits) => format!("{value:.14}"),
            () => return CompactFormatter.write_f64(writer, value),
        };
        writer.write_all(text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::agv::config::AgvConfig;
    use crate::reference::agv::tolerances::TOLERANCES;

    fn message() -> Map<String, Value> {
        let message = json!({ "headerId": 3, "errors": [], "information": [], "velocity": { "vx": 0.5 },
            "actionStates": [{ "actionId": "1", "actionStatus": "WAITING" }],
            "agvPosition": { "x": 2.5, "y": -1e-9, "theta": 0.0 }, "driving": true });
        let Value::Object(message) = message else {
            unreachable!()
        };
        message
    }

    /// The message as a vehicle with these liberties sends it.
    fn sent(names: &[&str]) -> Vec<u8> {
        let mut config = AgvConfig::default();
        for name in names {
            config.tolerate(name).unwrap_or_default();
        }
        written(config.tolerances, reworded(config.tolerances, "state", message(), true))
    }

    #[test]
    fn whatever_the_liberties_a_message_is_json_and_says_the_same() {
        let names: Vec<&str> = TOLERANCES.iter().map(|tolerance| tolerance.name).collect();
        for name in &names {
            let read: Value = serde_json::from_slice(&sent(&[name])).unwrap_or_default();
            assert_eq!(read["driving"], true, "{name}");
            assert_eq!(read["headerId"].as_f64(), Some(3.0), "{name}");
            let y = read["agvPosition"]["y"].as_f64().unwrap_or(1.0);
            assert!(y.abs() < 1e-6, "{name}");
        }
        let read: Value = serde_json::from_slice(&sent(&names)).unwrap_or_default();
        assert_eq!(read["agvPosition"]["x"], 2.5);
    }

    #[test]
    fn numbers_and_texts_are_written_otherwise() {
        let text = |names: &[&str]| String::from_utf8(sent(names)).unwrap_or_default();
        assert!(text(&["exponents"]).contains("\"x\":2.5e0,\"y\":-1e-9"));
        assert!(text(&["many-digits"]).contains("\"x\":2.50000000000000"));
        assert!(text(&["floats-for-integers"]).contains("\"headerId\":3.0"));
        assert!(text(&["text-escaped"]).starts_with("{\"h\\u0065ad\\u0065rId\":3"));
        assert!(text(&["keys-reordered"]).starts_with("{\"driving\""));
        assert!(text(&["vendor-fields"]).contains("\"vx\":0.5,\"x-vendor\""));
        assert!(!text(&["optional-omitted"]).contains("velocity"));
    }
}
