//! Tolerances in how a message is worded: what else it says, and how its JSON is written (sections 6.2 to 6.4 and 6.10).

use std::io;

use serde::Serialize as _;
use serde_json::ser::{CompactFormatter, Formatter};

use super::prelude::*;

records! {
    tolerance "vendor-information" ["INFO-01"] "Reports information nobody asked for."
        => saying(|_, m| {
            let references = json!([{ "referenceKey": "place", "referenceValue": "hall 3" }]);
            m.add("information", json!({ "infoType": "tyrePressure", "infoLevel": "DEBUG", "infoReferences": references, "infoDescription": "2.4 bar" }));
        });
    tolerance "vendor-warning" ["ERR-01", "ERR-03"] "Reports a warning of its own all the time."
        => saying(|_, m| m.add("errors", worn_brush()));
    tolerance "warning-comes-and-goes" ["ERR-01", "STATE-05"] "Reports a warning of its own in every other state."
        => saying(|agv, m| if is_even(agv) { m.add("errors", worn_brush()) });
    tolerance "information-comes-and-goes" ["INFO-01"] "An information entry of level DEBUG is in every other state."
        => saying(|agv, m| if is_even(agv) {
            let references = json!([{ "referenceKey": "cycle", "referenceValue": "12 ms" }]);
            m.add("information", json!({ "infoType": "load", "infoLevel": "DEBUG", "infoReferences": references, "infoDescription": "the control was busy" }));
        });
    tolerance "information-in-every-state" ["STATE-11", "INFO-01"] "It puts an information entry with changing values into every state."
        => saying(|_, m| {
            let count = m.get("headerId").cloned().unwrap_or_default();
            m.add("information", json!({ "infoType": "cycleCounter", "infoLevel": "DEBUG", "infoDescription": format!("cycle {count}") }));
        });
    tolerance "action-states-reversed" ["STATE-MSG-09"] "It lists its action states with the newest first."
        => saying(|_, m| m.list("actionStates").reverse());
    tolerance "errors-newest-first" ["ERR-01"] "It lists its errors with the newest first."
        => saying(|_, m| m.list("errors").reverse());
    tolerance "maps-reversed" ["MAP-12"] "It lists its maps with the newest first."
        => saying(|_, m| m.list("maps").reverse());
    tolerance "errors-in-own-language" ["JSON-03", "ERR-02"] "The errorDescription of every error is in another language, with letters and signs beyond ASCII."
        => saying(|_, m| m.each("errors", |error| error.set("errorDescription", "Störung – bitte Gerät prüfen (故障)")));
    tolerance "error-hints-given" ["ERR-02"] "Every error has an errorHint."
        => saying(|_, m| m.each("errors", |error| error.set("errorHint", "see the manual, section 7")));
    tolerance "vendor-references" ["BP-02", "ERR-05"] "Every error begins its errorReferences with a key of the vendor."
        => saying(|_, m| m.each("errors", |error| {
            let own = json!({ "referenceKey": "vendorCode", "referenceValue": "E-17" });
            match error.get_mut("errorReferences") {
                Some(Value::Array(references)) => references.insert(0, own),
                Some(_) => {}
                None => error.set("errorReferences", json!([own])),
            }
        }));
    tolerance "errors-undescribed" ["ERR-02"] "Its errors have no errorDescription."
        => saying(|_, m| m.each("errors", |error| error.unset("errorDescription")));
    tolerance "references-reversed" ["ERR-05", "BP-02"] "It lists what is wrong before the message in its error references."
        => saying(|_, m| m.each("errors", |error| error.list("errorReferences").reverse()));
    tolerance "empty-references-omitted" ["ERR-05", "ERR-02"] "Errors without references have no errorReferences."
        => saying(|_, m| m.each("errors", |error| if error.says("errorReferences", json!([])) {
            error.unset("errorReferences");
        }));
    tolerance "action-type-omitted" ["STATE-MSG-14"] "Its action states have no actionType."
        => saying(|_, m| m.each("actionStates", |action| action.unset("actionType")));
    tolerance "results-empty" ["STATE-MSG-12"] "It gives every action state without a result an empty resultDescription."
        => saying(|_, m| m.each("actionStates", |action| {
            action.entry("resultDescription").or_insert_with(|| json!(""));
        }));
    tolerance "results-everywhere" ["STATE-MSG-12"] "Every finished action has a resultDescription."
        => saying(|_, m| m.each("actionStates", |action| if action.says("actionStatus", "FINISHED") {
            action.entry("resultDescription").or_insert_with(|| json!("done"));
        }));
    tolerance "node-position-omitted" ["STATE-MSG-13"] "It does not repeat the nodePosition of the order in its node states."
        => saying(|_, m| m.each("nodeStates", |node| node.unset("nodePosition")));
    tolerance "route-described" ["STATE-MSG-13"] "Its node and edge states have descriptions."
        => saying(|_, m| {
            m.each("nodeStates", |node| node.set("nodeDescription", "as it is called in the vehicle"));
            m.each("edgeStates", |edge| edge.set("edgeDescription", "as it is called in the vehicle"));
        });
    tolerance "maps-described" ["MAP-12"] "It gives every entry of maps a mapDescription."
        => saying(|_, m| m.each("maps", |map| map.set("mapDescription", "as drawn in spring")));
    tolerance "new-base-only-when-wanted" ["STATE-16"] "It sends newBaseRequest only when it is true."
        => saying(|_, m| if m.says("newBaseRequest", false) {
            m.unset("newBaseRequest");
        });
    tolerance "optional-state-fields-left-out" ["STATE-MSG-01", "STATE-MSG-06"] "It leaves out the optional fields velocity, loads, information and newBaseRequest in all states."
        => saying(|_, m| ["velocity", "loads", "information", "newBaseRequest"].into_iter().for_each(|key| m.unset(key)));
    tolerance "battery-minimal" ["STATE-MSG-15"] "Its batteryState consists of batteryCharge and charging."
        => saying(|_, m| m.part("batteryState", |battery| battery.retain(|key, _| key == "batteryCharge" || key == "charging")));
    tolerance "information-omitted" ["INFO-01", "STATE-MSG-01"] "It sends no information at all."
        => saying(|_, m| m.unset("information"));
    tolerance "new-base-never-requested" ["STATE-16"] "It does not send newBaseRequest."
        => saying(|_, m| m.unset("newBaseRequest"));
    tolerance "loads-undetermined" ["STATE-MSG-06"] "It cannot determine its load and never sends loads."
        => saying(|_, m| m.unset("loads"));
    tolerance "loads-minimal" ["STATE-MSG-07"] "The loads name only loadId and loadType; the only load position, the dimensions and the weight are left out."
        => saying(|_, m| m.each("loads", |load| load.retain(|key, _| key == "loadId" || key == "loadType")));
    tolerance "descriptions-everywhere" ["STATE-MSG-14"] "Describes every action in its states."
        => saying(|_, m| m.each("actionStates", |action| action.set("actionDescription", "as the vehicle understands it")));
    tolerance "optional-added" ["OPT-03"] "Fills optional members of its states others leave out."
        => saying(|_, m| {
            m.set("distanceSinceLastNode", 0.0);
            m.part("agvPosition", |pose| {
                pose.set("localizationScore", 0.97);
                pose.set("deviationRange", 0.02);
                pose.set("mapDescription", "the floor");
            });
            m.part("batteryState", |battery| {
                battery.set("batteryVoltage", 48.2);
                battery.set("batteryHealth", 98);
            });
        });
    tolerance "optional-omitted" ["OPT-03"] "Leaves what it need not say out of its states."
        => saying(|_, m| ["velocity", "distanceSinceLastNode"].into_iter().for_each(|key| m.unset(key)));
    tolerance "position-minimal" ["STATE-MSG-05"] "agvPosition holds only what it must hold, no localizationScore."
        => wording(|_, m| m.part("agvPosition", |pose| {
            pose.retain(|key, _| matches!(key.as_str(), "positionInitialized" | "x" | "y" | "theta" | "mapId"));
        }));
    tolerance "visualization-without-velocity" ["VIS-01"] "The visualization tells the position but no velocity."
        => wording(|name, m| if name == "visualization" { m.unset("velocity") });
    tolerance "angles-rounded" ["JSON-06", "MAP-02"] "Writes its angles with four digits behind the point."
        => wording(|_, m| m.part("agvPosition", |pose| number(pose, "theta", |angle| (angle * 10_000.0).round() / 10_000.0)));
    // As a 32-bit float holds it: pi is a little more than pi.
    tolerance "single-precision" ["JSON-06", "MAP-02"] "Computes where it is with 32-bit floats."
        => wording(|name, m| if matches!(name, "state" | "visualization") {
            m.part("agvPosition", |pose| for axis in ["x", "y", "theta"] {
                number(pose, axis, in_single_precision);
            });
        });
    tolerance "vendor-fields" ["JSON-04"] "Adds members of its own to every object it sends."
        => wording(|_, m| with_vendor_fields(m));
    tolerance "floats-for-integers" ["JSON-09"] "Writes whole numbers with a fraction of zero."
        => wording(|_, m| m.values_mut().for_each(with_fractions));
    tolerance "keys-reordered" ["JSON-01"] "Sends the members of its messages in reverse order."
        => wording(|_, m| *m = std::mem::take(m).into_iter().rev().collect());
    tolerance "pretty-printed" ["MQTT-02"] "Sends its messages in many lines, indented."
        => plain().writes(|_, _, _, text| if let Ok(message) = serde_json::from_slice::<Value>(text) {
            *text = format!("{message:#}\n").into_bytes();
        });
    tolerance "text-escaped" ["JSON-03"] "Escapes letters in its texts that need it not."
        => plain().writes(|_, _, _, text| written(text, Hand::Escaped));
    tolerance "exponents" ["JSON-06"] "Writes its coordinates with an exponent."
        => plain().writes(|_, _, _, text| written(text, Hand::Exponents));
    tolerance "many-digits" ["JSON-06"] "Writes its coordinates with all the digits it computes."
        => plain().writes(|_, _, _, text| written(text, Hand::ManyDigits));
    tolerance "states-retained" ["MQTT-07", "STATE-01"] "It publishes its states with the retain flag."
        => sending(|_, outgoing| outgoing.retain |= outgoing.name == "state");
    tolerance "header-id-wraps" ["HDR-02"] "It starts its headerIds a little below 4294967295 and goes on with 0 behind it."
        => counting_from::<{ u32::MAX - 12 }>();
    tolerance "header-id-starts-high" ["HDR-02"] "Its headerIds begin at 70000 on every topic."
        => counting_from::<70_000>();
    tolerance "clock-ahead" ["HDR-03"] "Its clock is one and a half seconds ahead."
        => header(|agv, _, m| {
            let ahead = agv.now.utc.checked_add(jiff::SignedDuration::from_millis(1_500));
            m.set("timestamp", format!("{:.2}", ahead.unwrap_or(agv.now.utc)));
        });
    tolerance "seconds-whole" ["HDR-03"] "Gives its timestamps in whole seconds."
        => header(|agv, _, m| m.set("timestamp", format!("{:.0}", agv.now.utc)));
    tolerance "seconds-fine" ["HDR-03"] "Gives its timestamps with six digits."
        => header(|agv, _, m| m.set("timestamp", format!("{:.6}", agv.now.utc)));
}

type Saying = fn(&Agv, &mut Object);

/// Words its states otherwise when they go out. What they say is an event or not as before.
fn saying(change: Saying) -> Box<Hooks<Saying>> {
    holding(change).sends(|change, agv, outgoing| {
        if outgoing.name == "state" {
            change(agv, &mut outgoing.message);
        }
        true
    })
}

type Wording = fn(&str, &mut Object);

/// Words messages otherwise, by their topic name.
fn wording(change: Wording) -> Box<Hooks<Wording>> {
    holding(change).sends(|change, _, outgoing| {
        change(outgoing.name, &mut outgoing.message);
        true
    })
}

/// Changes with every state.
fn is_even(agv: &Agv) -> bool {
    let states = agv.connection.header_ids.get("state");
    states.copied().unwrap_or(0) % 2 == 0
}

fn worn_brush() -> Value {
    json!({ "errorType": "maintenanceDue", "errorLevel": "WARNING", "errorDescription": "the brush of the left front wheel is worn",
        "errorReferences": [{ "referenceKey": "part", "referenceValue": "brush 2" }] })
}

/// Counts its messages from there, and names them so.
fn counting_from<const FIRST: u32>() -> Box<dyn Deviation> {
    plain()
        .heads(|(), _, _, m| begin_at(m, "headerId", FIRST))
        .says(|(), _, part, m| {
            if matches!(part, Part::Visualization) {
                begin_at(m, "referenceStateHeaderId", FIRST);
            }
            true
        })
}

/// Moves a count.
fn begin_at(words: &mut Object, key: &str, first: u32) {
    let id = words.get(key).and_then(Value::as_u64);
    if let Some(id) = id.and_then(|id| u32::try_from(id).ok()) {
        words.set(key, id.wrapping_add(first));
    }
}

#[expect(clippy::cast_possible_truncation, reason = "that is what it is about")]
fn in_single_precision(number: f64) -> f64 {
    f64::from(number as f32)
}

fn with_vendor_fields(object: &mut Object) {
    object
        .values_mut()
        .for_each(|value| nested(value, &mut with_vendor_fields));
    object.set("x-vendor", json!({ "firmware": "7.1", "flags": [1, true, null] }));
}

/// Every object directly below, through lists.
fn nested(value: &mut Value, act: &mut impl FnMut(&mut Object)) {
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

/// Writes a message anew. What is no JSON stays as it is.
fn written(text: &mut Vec<u8>, hand: Hand) {
    let Ok(message) = serde_json::from_slice::<Value>(text) else {
        return;
    };
    let mut bytes = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut bytes, hand);
    if message.serialize(&mut serializer).is_ok() {
        *text = bytes;
    }
}

/// How the vehicle writes texts and numbers.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hand {
    Escaped,
    Exponents,
    ManyDigits,
}

impl Formatter for Hand {
    fn write_string_fragment<W: ?Sized + io::Write>(&mut self, writer: &mut W, fragment: &str) -> io::Result<()> {
        match self {
            Self::Escaped => writer.write_all(fragment.replace('e', "\\u0065").as_bytes()),
            _ => writer.write_all(fragment.as_bytes()),
        }
    }

    fn write_f64<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        match self {
            Self::Exponents => writer.write_all(format!("{value:e}").as_bytes()),
            Self::ManyDigits => writer.write_all(format!("{value:.14}").as_bytes()),
            Self::Escaped => CompactFormatter.write_f64(writer, value),
        }
    }
}
