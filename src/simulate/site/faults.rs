//! What can be wrong with a message.

use serde::Serialize;
use serde_json::Value;

use crate::pack::{Version, VersionRange};

/// A fault of one message.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name.
    pub name: &'static str,
    /// The topic it fits.
    pub topic: &'static str,
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
}

const fn kind(name: &'static str, topic: &'static str, change: Change) -> Kind {
    Kind { name, topic, change }
}

/// All of them.
pub const KINDS: &[Kind] = &[
    kind("driving-as-text", "state", Set("/driving", "\"no\"")),
    kind("driving-missing", "state", Remove("/driving")),
    kind("mode-shortened", "state", Set("/operatingMode", "\"AUTO\"")),
    kind("mode-missing", "state", Remove("/operatingMode")),
    kind("battery-missing", "state", Remove("/batteryState")),
    kind("charge-as-text", "state", Set("/batteryState/batteryCharge", "\"87\"")),
    kind("charging-missing", "state", Remove("/batteryState/charging")),
    kind("e-stop-unknown", "state", Set("/safetyState/eStop", "\"PRESSED\"")),
    kind(
        "field-violation-missing",
        "state",
        Remove("/safetyState/fieldViolation"),
    ),
    kind("safety-missing", "state", Remove("/safetyState")),
    kind("order-id-as-number", "state", Set("/orderId", "7")),
    kind("update-id-as-text", "state", Set("/orderUpdateId", "\"0\"")),
    kind("node-states-missing", "state", Remove("/nodeStates")),
    kind("node-states-null", "state", Set("/nodeStates", "null")),
    kind("edge-states-missing", "state", Remove("/edgeStates")),
    kind("errors-missing", "state", Remove("/errors")),
    kind(
        "error-level-unknown",
        "state",
        Set("/errors", "[{\"errorType\":\"x\",\"errorLevel\":\"BAD\"}]"),
    ),
    kind(
        "error-type-missing",
        "state",
        Set("/errors", "[{\"errorLevel\":\"WARNING\"}]"),
    ),
    kind("action-states-missing", "state", Remove("/actionStates")),
    kind("last-node-missing", "state", Remove("/lastNodeId")),
    kind("last-node-null", "state", Set("/lastNodeId", "null")),
    kind("last-sequence-negative", "state", Set("/lastNodeSequenceId", "-1")),
    kind("last-sequence-as-text", "state", Set("/lastNodeSequenceId", "\"4\"")),
    kind("position-as-text", "state", Set("/agvPosition/x", "\"0\"")),
    kind("theta-missing", "state", Remove("/agvPosition/theta")),
    kind("theta-too-large", "state", Set("/agvPosition/theta", "9.9")),
    kind(
        "initialized-as-text",
        "state",
        Set("/agvPosition/positionInitialized", "\"true\""),
    ),
    kind("map-missing", "state", Remove("/agvPosition/mapId")),
    kind("paused-as-text", "state", Set("/paused", "\"no\"")),
    kind("base-request-as-number", "state", Set("/newBaseRequest", "1")),
    kind(
        "state-time-local",
        "state",
        Set("/timestamp", "\"2026-01-01T01:00:00.00+01:00\""),
    ),
    kind("state-time-missing", "state", Remove("/timestamp")),
    kind("state-manufacturer-missing", "state", Remove("/manufacturer")),
    kind("state-serial-other", "state", Set("/serialNumber", "\"other\"")),
    kind("state-version-missing", "state", Remove("/version")),
    kind("state-header-id-as-text", "state", Set("/headerId", "\"7\"")),
    kind("state-member-twice", "state", Twice("\"driving\":false")),
    kind(
        "state-not-a-number",
        "state",
        Bytes(|text| text.replacen("\"driving\":", "\"driving\":NaN,\"x\":", 1).into_bytes()),
    ),
    kind(
        "state-zero-byte",
        "state",
        Bytes(|text| [text.as_bytes(), &[0]].concat()),
    ),
    kind(
        "state-byte-order-mark",
        "state",
        Bytes(|text| ["\u{feff}", text].concat().into_bytes()),
    ),
    kind(
        "state-cut",
        "state",
        Bytes(|text| text.as_bytes()[..text.len() / 2].to_vec()),
    ),
    kind(
        "state-in-array",
        "state",
        Bytes(|text| format!("[{text}]").into_bytes()),
    ),
    kind("visualization-as-text", "visualization", Set("/agvPosition/x", "\"0\"")),
    kind(
        "visualization-map-missing",
        "visualization",
        Remove("/agvPosition/mapId"),
    ),
    kind("visualization-time-missing", "visualization", Remove("/timestamp")),
    kind(
        "connection-state-unknown",
        "connection",
        Set("/connectionState", "\"AWAY\""),
    ),
    kind("connection-state-missing", "connection", Remove("/connectionState")),
    kind("factsheet-type-missing", "factsheet", Remove("/typeSpecification")),
    kind(
        "factsheet-class-unknown",
        "factsheet",
        Set("/typeSpecification/agvClass", "\"BOAT\""),
    ),
    kind(
        "factsheet-speed-as-text",
        "factsheet",
        Set("/physicalParameters/speedMin", "\"0.01\""),
    ),
    kind("factsheet-serial-other", "factsheet", Set("/serialNumber", "\"other\"")),
    kind("order-update-id-missing", "order", Remove("/orderUpdateId")),
    kind("order-id-as-number", "order", Set("/orderId", "7")),
    kind("order-nodes-missing", "order", Remove("/nodes")),
    kind("order-edges-missing", "order", Remove("/edges")),
    kind("node-released-missing", "order", Remove("/nodes/0/released")),
    kind("node-actions-missing", "order", Remove("/nodes/0/actions")),
    kind("node-sequence-odd", "order", Set("/nodes/0/sequenceId", "1")),
    kind("edge-start-other", "order", Set("/edges/0/startNodeId", "\"nowhere\"")),
    kind(
        "order-time-local",
        "order",
        Set("/timestamp", "\"2026-01-01T01:00:00.00+01:00\""),
    ),
    kind("order-serial-other", "order", Set("/serialNumber", "\"other\"")),
    kind("order-member-twice", "order", Twice("\"orderUpdateId\":0")),
    kind("actions-missing", "instantActions", Remove("/actions")),
    kind(
        "blocking-unknown",
        "instantActions",
        Set("/actions/0/blockingType", "\"SOMETIMES\""),
    ),
    kind("action-id-missing", "instantActions", Remove("/actions/0/actionId")),
    kind(
        "action-type-as-number",
        "instantActions",
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
