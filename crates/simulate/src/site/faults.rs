//! What can be wrong with a message.

use serde::Serialize;
use serde_json::Value;

use tck_pack::{Version, VersionRange};

/// A fault of one message.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// The topic it fits.
    pub topic: &'static str,
    /// The requirement that a message with it breaks, whatever else it breaks.
    pub breaks: &'static str,
    change: Change,
}

/// What is done to a message.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// The value at a pointer becomes this one.
    Set(&'static str, &'static str),
    /// The member at a pointer is left out.
    Remove(&'static str),
    /// A member stands there twice, which is wrong where messages have to obey the schema.
    Twice(&'static str),
    /// The bytes are changed.
    Bytes(fn(&str) -> Vec<u8>),
}

use Change::{Bytes, Remove, Set, Twice};

/// Where a fault was put.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Injected {
    /// Number of the message, counted from 1.
    pub message: u64,
    /// Its topic.
    pub topic: String,
    /// Name of the fault.
    pub kind: &'static str,
    /// The requirement it breaks.
    pub requirement: &'static str,
}

const fn kind(name: &'static str, topic: &'static str, breaks: &'static str, change: Change) -> Kind {
    Kind {
        name,
        topic,
        breaks,
        change,
    }
}

/// All of them.
pub const KINDS: &[Kind] = &[
    kind("driving-as-text", "state", "JSON-07", Set("/driving", "\"no\"")),
    kind("driving-missing", "state", "STATE-MSG-01", Remove("/driving")),
    kind("mode-shortened", "state", "MODE-01", Set("/operatingMode", "\"AUTO\"")),
    kind("mode-missing", "state", "STATE-MSG-01", Remove("/operatingMode")),
    kind("battery-missing", "state", "STATE-MSG-01", Remove("/batteryState")),
    kind(
        "charge-as-text",
        "state",
        "STATE-MSG-15",
        Set("/batteryState/batteryCharge", "\"87\""),
    ),
    kind(
        "charging-missing",
        "state",
        "STATE-MSG-15",
        Remove("/batteryState/charging"),
    ),
    kind(
        "e-stop-unknown",
        "state",
        "JSON-02",
        Set("/safetyState/eStop", "\"PRESSED\""),
    ),
    kind(
        "field-violation-missing",
        "state",
        "STATE-MSG-01",
        Remove("/safetyState/fieldViolation"),
    ),
    kind("safety-missing", "state", "STATE-MSG-01", Remove("/safetyState")),
    kind(
        "state-order-id-as-number",
        "state",
        "STATE-MSG-01",
        Set("/orderId", "7"),
    ),
    kind(
        "update-id-as-text",
        "state",
        "STATE-MSG-01",
        Set("/orderUpdateId", "\"0\""),
    ),
    kind("node-states-missing", "state", "STATE-MSG-01", Remove("/nodeStates")),
    kind("node-states-null", "state", "STATE-MSG-01", Set("/nodeStates", "null")),
    kind("edge-states-missing", "state", "STATE-MSG-01", Remove("/edgeStates")),
    kind("errors-missing", "state", "STATE-MSG-01", Remove("/errors")),
    kind(
        "error-level-unknown",
        "state",
        "ERR-02",
        Set("/errors", "[{\"errorType\":\"x\",\"errorLevel\":\"BAD\"}]"),
    ),
    kind(
        "error-type-missing",
        "state",
        "ERR-02",
        Set("/errors", "[{\"errorLevel\":\"WARNING\"}]"),
    ),
    kind(
        "action-states-missing",
        "state",
        "STATE-MSG-01",
        Remove("/actionStates"),
    ),
    kind("last-node-missing", "state", "STATE-MSG-01", Remove("/lastNodeId")),
    kind("last-node-null", "state", "STATE-MSG-01", Set("/lastNodeId", "null")),
    kind(
        "last-sequence-negative",
        "state",
        "STATE-MSG-01",
        Set("/lastNodeSequenceId", "-1"),
    ),
    kind(
        "last-sequence-as-text",
        "state",
        "STATE-MSG-01",
        Set("/lastNodeSequenceId", "\"4\""),
    ),
    kind(
        "position-as-text",
        "state",
        "STATE-MSG-05",
        Set("/agvPosition/x", "\"0\""),
    ),
    kind("theta-missing", "state", "STATE-MSG-05", Remove("/agvPosition/theta")),
    kind(
        "theta-too-large",
        "state",
        "STATE-MSG-05",
        Set("/agvPosition/theta", "9.9"),
    ),
    kind(
        "initialized-as-text",
        "state",
        "STATE-MSG-05",
        Set("/agvPosition/positionInitialized", "\"true\""),
    ),
    kind("map-missing", "state", "STATE-MSG-05", Remove("/agvPosition/mapId")),
    kind("paused-as-text", "state", "JSON-07", Set("/paused", "\"no\"")),
    kind(
        "base-request-as-number",
        "state",
        "JSON-07",
        Set("/newBaseRequest", "1"),
    ),
    kind(
        "state-time-local",
        "state",
        "HDR-03",
        Set("/timestamp", "\"2026-01-01T01:00:00.00+01:00\""),
    ),
    kind("state-time-missing", "state", "HDR-01", Remove("/timestamp")),
    kind("state-manufacturer-missing", "state", "HDR-01", Remove("/manufacturer")),
    kind(
        "state-serial-other",
        "state",
        "HDR-05",
        Set("/serialNumber", "\"other\""),
    ),
    kind("state-version-missing", "state", "HDR-01", Remove("/version")),
    kind("state-header-id-as-text", "state", "HDR-02", Set("/headerId", "\"7\"")),
    kind("state-member-twice", "state", "JSON-10", Twice("\"driving\":false")),
    kind(
        "state-not-a-number",
        "state",
        "MQTT-02",
        Bytes(|text| text.replacen("\"driving\":", "\"driving\":NaN,\"x\":", 1).into_bytes()),
    ),
    kind(
        "state-zero-byte",
        "state",
        "MQTT-02",
        Bytes(|text| [text.as_bytes(), &[0]].concat()),
    ),
    kind(
        "state-byte-order-mark",
        "state",
        "JSON-03",
        Bytes(|text| ["\u{feff}", text].concat().into_bytes()),
    ),
    kind(
        "state-cut",
        "state",
        "MQTT-02",
        Bytes(|text| text.as_bytes()[..text.len() / 2].to_vec()),
    ),
    kind(
        "state-in-array",
        "state",
        "MQTT-02",
        Bytes(|text| format!("[{text}]").into_bytes()),
    ),
    kind(
        "visualization-as-text",
        "visualization",
        "VIS-01",
        Set("/agvPosition/x", "\"0\""),
    ),
    kind(
        "visualization-map-missing",
        "visualization",
        "VIS-01",
        Remove("/agvPosition/mapId"),
    ),
    kind(
        "visualization-time-missing",
        "visualization",
        "HDR-01",
        Remove("/timestamp"),
    ),
    kind(
        "connection-state-unknown",
        "connection",
        "CONN-10",
        Set("/connectionState", "\"AWAY\""),
    ),
    kind(
        "connection-state-missing",
        "connection",
        "CONN-10",
        Remove("/connectionState"),
    ),
    kind(
        "factsheet-type-missing",
        "factsheet",
        "FACT-02",
        Remove("/typeSpecification"),
    ),
    kind(
        "factsheet-class-unknown",
        "factsheet",
        "FACT-03",
        Set("/typeSpecification/agvClass", "\"BOAT\""),
    ),
    kind(
        "factsheet-speed-as-text",
        "factsheet",
        "FACT-04",
        Set("/physicalParameters/speedMin", "\"0.01\""),
    ),
    kind(
        "factsheet-serial-other",
        "factsheet",
        "HDR-05",
        Set("/serialNumber", "\"other\""),
    ),
    kind(
        "order-update-id-missing",
        "order",
        "ORD-MSG-01",
        Remove("/orderUpdateId"),
    ),
    kind("order-id-as-number", "order", "ORD-MSG-01", Set("/orderId", "7")),
    kind("order-nodes-missing", "order", "ORD-MSG-01", Remove("/nodes")),
    kind("order-edges-missing", "order", "ORD-MSG-06", Remove("/edges")),
    kind(
        "node-released-missing",
        "order",
        "ORD-MSG-05",
        Remove("/nodes/0/released"),
    ),
    kind(
        "node-actions-missing",
        "order",
        "ORD-MSG-06",
        Remove("/nodes/0/actions"),
    ),
    kind(
        "node-sequence-odd",
        "order",
        "ORD-UPD-11",
        Set("/nodes/0/sequenceId", "1"),
    ),
    kind(
        "edge-start-other",
        "order",
        "ORD-MSG-19",
        Set("/edges/0/startNodeId", "\"nowhere\""),
    ),
    kind(
        "order-time-local",
        "order",
        "HDR-03",
        Set("/timestamp", "\"2026-01-01T01:00:00.00+01:00\""),
    ),
    kind(
        "order-serial-other",
        "order",
        "HDR-05",
        Set("/serialNumber", "\"other\""),
    ),
    kind("order-member-twice", "order", "JSON-10", Twice("\"orderUpdateId\":0")),
    kind("actions-missing", "instantActions", "IACT-01", Remove("/actions")),
    kind(
        "blocking-unknown",
        "instantActions",
        "ORD-MSG-16",
        Set("/actions/0/blockingType", "\"SOMETIMES\""),
    ),
    kind(
        "action-id-missing",
        "instantActions",
        "ORD-MSG-15",
        Remove("/actions/0/actionId"),
    ),
    kind(
        "action-type-as-number",
        "instantActions",
        "ORD-MSG-15",
        Set("/actions/0/actionType", "3"),
    ),
];

/// The versions whose messages have to obey the schema, and with it the rules of JSON.
const BY_SCHEMA: &str = ">=2.1";

/// Whether a message says that it is of such a version.
fn obeys_schema(text: &str) -> bool {
    let message: Option<Value> = serde_json::from_str(text).ok();
    let version = message.and_then(|message| message.get("version")?.as_str()?.parse::<Version>().ok());
    let range = BY_SCHEMA.parse::<VersionRange>().ok();
    version
        .zip(range)
        .is_some_and(|(version, range)| range.contains(version))
}

impl Kind {
    /// The message with this fault; `None` where the message has no such member, or has it like that already.
    pub(super) fn spoil(&self, payload: &[u8]) -> Option<Vec<u8>> {
        let text = std::str::from_utf8(payload).ok()?;
        let changed = match self.change {
            Bytes(change) => change(text),
            Twice(_) if !obeys_schema(text) => return None,
            Twice(member) => text.replacen('{', &format!("{{{member},"), 1).into_bytes(),
            Set(pointer, value) => {
                let mut message: Value = serde_json::from_str(text).ok()?;
                let value = serde_json::from_str(value).ok()?;
                let place = message.pointer_mut(pointer)?;
                *place = value;
                message.to_string().into_bytes()
            }
            Remove(pointer) => {
                let mut message: Value = serde_json::from_str(text).ok()?;
                let (holder, member) = pointer.rsplit_once('/')?;
                message.pointer_mut(holder)?.as_object_mut()?.shift_remove(member)?;
                message.to_string().into_bytes()
            }
        };
        (changed != payload).then_some(changed)
    }
}
