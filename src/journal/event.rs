//! What can be recorded.
//!
//! Every event is plain data that survives a round trip through JSON unchanged. The raw bytes of what a
//! device sent are kept verbatim.

use base64::Engine as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use crate::clock::Stamp;

/// Payloads above this many bytes are kept by hash and prefix.
pub const PAYLOAD_LIMIT: usize = 1 << 20;
/// How much of an oversized payload is kept.
pub const PAYLOAD_PREFIX: usize = 4096;

/// Who saw or caused an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The transparent tap between device and broker.
    Tap,
    /// The harness's own broker connection.
    Link,
    /// The harness itself.
    Harness,
    /// The map server.
    Maps,
    /// A person or a hook of the profile.
    Operator,
}

/// Which way something went, seen from the harness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From the device under test.
    FromDevice,
    /// To the device under test.
    ToDevice,
}

/// A payload as it went over the wire, or what is left of it when it was too big.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Payload {
    /// All bytes.
    Whole(bytes::Bytes),
    /// Hash, length and the first bytes of an oversized payload.
    Cut {
        /// SHA-256 in hexadecimal.
        sha256: String,
        /// Length of the whole payload in bytes.
        length: u64,
        /// The first bytes.
        prefix: bytes::Bytes,
    },
}

impl Payload {
    /// Keeps `bytes` whole or cut, by [`PAYLOAD_LIMIT`].
    #[must_use]
    pub fn keep(bytes: bytes::Bytes) -> Self {
        if bytes.len() <= PAYLOAD_LIMIT {
            return Self::Whole(bytes);
        }
        Self::Cut {
            sha256: hex(&Sha256::digest(&bytes)),
            length: bytes.len() as u64,
            prefix: bytes.slice(..PAYLOAD_PREFIX),
        }
    }

    /// The bytes that were kept.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Whole(bytes) | Self::Cut { prefix: bytes, .. } => bytes,
        }
    }

    /// Length on the wire in bytes.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "an empty payload is just one more length")]
    pub fn len(&self) -> u64 {
        match self {
            Self::Whole(bytes) => bytes.len() as u64,
            Self::Cut { length, .. } => *length,
        }
    }
}

/// Lower-case hexadecimal.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes
        .iter()
        .fold(String::with_capacity(bytes.len() * 2), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
}

fn bytes_to_value(bytes: &[u8]) -> Value {
    match std::str::from_utf8(bytes) {
        Ok(text) => Value::from(text),
        Err(_) => json!({ "base64": base64::engine::general_purpose::STANDARD.encode(bytes) }),
    }
}

fn value_to_bytes(value: &Value) -> Result<bytes::Bytes, String> {
    if let Some(text) = value.as_str() {
        return Ok(bytes::Bytes::copy_from_slice(text.as_bytes()));
    }
    let text = value
        .get("base64")
        .and_then(Value::as_str)
        .ok_or("a payload is a string or { base64 }")?;
    let bytes = base64::engine::general_purpose::STANDARD
        .decode(text)
        .map_err(|error| error.to_string())?;
    Ok(bytes.into())
}

impl Serialize for Payload {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Whole(bytes) => bytes_to_value(bytes).serialize(serializer),
            Self::Cut { sha256, length, prefix } => {
                json!({ "sha256": sha256, "length": length, "prefix": bytes_to_value(prefix) }).serialize(serializer)
            }
        }
    }
}

impl<'de> Deserialize<'de> for Payload {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        use serde::de::Error as _;
        let value = Value::deserialize(deserializer)?;
        if let Some(sha256) = value.get("sha256").and_then(Value::as_str) {
            return Ok(Self::Cut {
                sha256: sha256.to_owned(),
                length: value.get("length").and_then(Value::as_u64).unwrap_or_default(),
                prefix: value_to_bytes(value.get("prefix").unwrap_or(&Value::Null)).map_err(D::Error::custom)?,
            });
        }
        value_to_bytes(&value).map(Self::Whole).map_err(D::Error::custom)
    }
}

/// The last will of a CONNECT packet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Will {
    /// Topic of the will.
    pub topic: String,
    /// Payload of the will.
    pub payload: Payload,
    /// QoS of the will.
    pub qos: u8,
    /// RETAIN of the will.
    pub retain: bool,
}

/// An MQTT control packet, decoded as far as a verdict can need it. Passwords are never kept.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum Packet {
    /// CONNECT.
    Connect {
        /// Protocol level byte: 3, 4 or 5.
        level: u8,
        /// Client identifier as the device sent it.
        client_id: String,
        /// Keep-alive in seconds; 0 is off.
        keep_alive: u16,
        /// Clean session (clean start in MQTT 5).
        clean_session: bool,
        /// User name, if one was sent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        username: Option<String>,
        /// Whether a password was sent.
        has_password: bool,
        /// The last will, if one was registered.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        will: Option<Will>,
    },
    /// CONNACK.
    Connack {
        /// Return or reason code; 0 accepts.
        code: u8,
        /// Whether the broker resumed a session.
        session_present: bool,
    },
    /// PUBLISH.
    Publish {
        /// Topic name.
        topic: String,
        /// QoS.
        qos: u8,
        /// RETAIN.
        retain: bool,
        /// DUP.
        dup: bool,
        /// Packet identifier, for QoS 1 and 2.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        packet_id: Option<u16>,
        /// The application message.
        payload: Payload,
    },
    /// SUBSCRIBE.
    Subscribe {
        /// Packet identifier.
        packet_id: u16,
        /// Topic filters.
        filters: Vec<Filter>,
    },
    /// SUBACK.
    Suback {
        /// Packet identifier.
        packet_id: u16,
        /// One code per filter.
        codes: Vec<u8>,
    },
    /// UNSUBSCRIBE.
    Unsubscribe {
        /// Packet identifier.
        packet_id: u16,
        /// Topic filters.
        filters: Vec<String>,
    },
    /// DISCONNECT.
    Disconnect {
        /// Reason code; 0 in MQTT 3.1.1.
        code: u8,
    },
    /// PUBACK, PUBREC, PUBREL, PUBCOMP or UNSUBACK.
    Ack {
        /// Name of the packet in lower case.
        name: String,
        /// Packet identifier.
        packet_id: u16,
    },
    /// PINGREQ.
    Pingreq,
    /// PINGRESP.
    Pingresp,
    /// AUTH (MQTT 5).
    Auth,
}

/// One topic filter of a SUBSCRIBE packet.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filter {
    /// The filter.
    pub filter: String,
    /// The QoS asked for.
    pub qos: u8,
}

/// How a connection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Close {
    /// The device closed its side in order.
    DeviceFin,
    /// The device reset the connection.
    DeviceReset,
    /// The broker closed its side.
    Broker,
    /// The harness cut it.
    Harness,
}

/// How a step ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StepEnd {
    /// What it waited for was decided.
    Decided,
    /// The time was up.
    Deadline,
    /// The run was interrupted.
    Interrupted,
    /// The harness could not do it; the text says why.
    Broken(String),
}

/// One thing that happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum Event {
    /// The run began; `header` holds tool, device, topics, effective settings and their origins.
    RunBegun {
        /// See [`RunHeader`].
        header: Box<RunHeader>,
    },
    /// The run ended.
    RunEnded {
        /// Whether tests were left out because of an interruption or a breakdown.
        partial: bool,
        /// Why, when partial.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reason: Option<String>,
    },
    /// What the run is going to do, and why it leaves things out.
    Planned {
        /// See [`Plan`].
        plan: Box<Plan>,
    },
    /// A test began.
    TestBegun {
        /// Its id.
        test: String,
        /// The values of all variables known at its start.
        bindings: Value,
    },
    /// A test ended.
    TestEnded {
        /// Its id.
        test: String,
    },
    /// A step of the running test began.
    StepBegun {
        /// Its path, such as `steps[3]`.
        path: String,
    },
    /// A step of the running test ended.
    StepEnded {
        /// Its path.
        path: String,
        /// How.
        end: StepEnd,
    },
    /// A variable got its value while the test was running.
    Bound {
        /// Name without `${}`.
        name: String,
        /// Value.
        value: Value,
    },
    /// A stimulus was given; deadlines count from here.
    Mark {
        /// The step that gave it.
        path: String,
    },
    /// The harness published a message.
    Sent {
        /// Full topic.
        topic: String,
        /// QoS.
        qos: u8,
        /// RETAIN.
        retain: bool,
        /// Payload.
        payload: Payload,
    },
    /// A message was delivered to the harness's standing subscription.
    Message {
        /// Full topic.
        topic: String,
        /// QoS of the delivery (subscription is QoS 2, so this is the QoS it was published with).
        qos: u8,
        /// RETAIN of the delivery: set only on messages stored before the subscription.
        retain: bool,
        /// DUP of the delivery.
        dup: bool,
        /// Payload.
        payload: Payload,
    },
    /// A message was delivered to a fresh subscriber.
    Retained {
        /// Number of the request.
        request: u64,
        /// Full topic.
        topic: String,
        /// QoS of the delivery.
        qos: u8,
        /// RETAIN of the delivery.
        retain: bool,
        /// Payload.
        payload: Payload,
    },
    /// A fresh subscriber has received everything the broker had stored.
    RetainedEnd {
        /// Number of the request.
        request: u64,
    },
    /// A device opened a connection to the tap.
    Opened {
        /// Number of the connection.
        connection: u64,
        /// Address of the peer.
        peer: String,
    },
    /// A packet passed the tap.
    Packet {
        /// Number of the connection.
        connection: u64,
        /// The packet.
        packet: Packet,
    },
    /// Bytes passed the tap that are not an MQTT packet.
    Undecodable {
        /// Number of the connection.
        connection: u64,
        /// What is wrong with them.
        reason: String,
        /// The bytes.
        bytes: Payload,
    },
    /// A connection to the tap ended.
    Closed {
        /// Number of the connection.
        connection: u64,
        /// How.
        how: Close,
    },
    /// The harness changed what the link does.
    Fault {
        /// See [`LinkFault`].
        fault: LinkFault,
    },
    /// The harness sent itself a message through the broker.
    ProbeSent {
        /// Number of the probe.
        probe: u64,
    },
    /// The probe came back.
    ProbeReceived {
        /// Number of the probe.
        probe: u64,
    },
    /// A file is offered by the map server.
    Served {
        /// Name of the offer.
        name: String,
        /// Where.
        url: String,
        /// How it is served.
        behaviour: String,
    },
    /// A request reached the map server.
    Fetched {
        /// Name of the offer; empty when there is none at that path.
        name: String,
        /// Method and path.
        request: String,
        /// Status of the answer; absent when none was given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        status: Option<u16>,
        /// `begun`, `done` or `cut`.
        phase: String,
    },
    /// A hook of the profile was run.
    Hook {
        /// Name of the hook.
        hook: String,
        /// Whether it succeeded.
        ok: bool,
        /// What it said.
        detail: String,
    },
    /// A person was asked, and answered.
    Answer {
        /// What was asked.
        prompt: String,
        /// The answer.
        answer: String,
        /// Whether it counts as done.
        ok: bool,
    },
    /// Something worth knowing that decides nothing.
    Note {
        /// The text.
        text: String,
    },
    /// The harness, its broker or its host broke.
    Trouble {
        /// What happened.
        text: String,
    },
}

impl Event {
    /// The JSON picture that patterns match against. Payloads inside packets that are JSON are shown
    /// as JSON, so that a pattern can look into a last will.
    #[must_use]
    pub fn picture(&self) -> Value {
        let mut value = serde_json::to_value(self).unwrap_or(Value::Null);
        if let Some(packet) = value.get_mut("packet").map(Value::take) {
            value = packet;
        }
        unfold_payload(&mut value);
        value
    }
}

fn unfold_payload(value: &mut Value) {
    let Value::Object(members) = value else { return };
    if let Some(parsed) = members
        .get("payload")
        .and_then(Value::as_str)
        .and_then(|text| serde_json::from_str(text).ok())
    {
        members.insert("payload".to_owned(), parsed);
    }
    if let Some(will) = members.get_mut("will") {
        unfold_payload(will);
    }
}

/// What the run is about; the first record of every journal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct RunHeader {
    /// `vda5050-tck.journal/1`.
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// Identifier of the run.
    pub run: String,
    /// `agv` or `master-control`.
    pub role: String,
    /// Protocol version the device is judged by, such as `2.1.0`.
    pub protocol: String,
    /// Manufacturer of the device.
    pub manufacturer: String,
    /// Serial number of the device.
    pub serial_number: String,
    /// Full topic by topic name.
    pub topics: std::collections::BTreeMap<String, String>,
    /// `tap` or `subscriber`.
    pub vantage: String,
    /// SHA-256 over suites, schemas and requirements.
    pub suites: String,
    /// Whether suites were replaced by `--suites`.
    pub modified: bool,
    /// Values that are the same for every test: `time.*`, `device.*`.
    pub bindings: Map<String, Value>,
    /// Effective settings: name, value, origin.
    pub settings: Vec<Setting>,
    /// The command line as typed, passwords left out.
    pub command: Vec<String>,
}

<<<<<<< HEAD
/// What a run is going to do, and why it leaves things out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Plan {
    /// The selected tests, in the order they will run.
    pub tests: Vec<PlannedTest>,
    /// What the device can do, and who says so.
    pub capabilities: Vec<Capability>,
    /// What restricts the statement, one sentence each.
    pub limits: Vec<String>,
    /// Deviations the profile declares: requirement id to reason.
    pub deviations: std::collections::BTreeMap<String, String>,
    /// Series name of the factsheet.
    pub series_name: Option<String>,
    /// Whether every test of the suites was selected.
    pub complete: bool,
}

/// One test of a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PlannedTest {
    /// Id.
    pub test: String,
    /// What becomes of it.
    pub gate: Gate,
}

/// Whether a test runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gate {
    /// It runs.
    Runs,
    /// The device declares that it lacks what the test needs.
    NotApplicable(String),
    /// The bench, the profile or the device leaves open what the test needs.
    Unobservable(String),
}

/// A capability and its source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capability {
    /// Name, such as `action downloadMap INSTANT`.
    pub name: String,
    /// `yes`, `no`, or a value.
    pub value: String,
    /// `factsheet`, `profile`, or both when they contradict each other.
    pub source: String,
}

/// One effective setting and where it came from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Name, such as `time.react`.
    pub name: String,
    /// Value as text.
    pub value: String,
    /// `flag`, `environment`, a file name, or `default`.
    pub origin: String,
}
=======
pub use crate::profile::Setting;
>>>>>>> profile

/// What the harness does to the link.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "fault", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum LinkFault {
    /// End the connection and refuse new ones until `restore`.
    Cut {
        /// RST instead of FIN.
        reset: bool,
    },
    /// Forward nothing, keep the connection open.
    Silence {
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Hold every packet back for a while.
    Delay {
        /// Milliseconds.
        millis: u64,
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Swallow the next PUBLISH packets on a topic.
    Drop {
        /// Last level of the topic; any when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        topic: Option<String>,
        /// How many.
        count: u32,
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Send the next PUBLISH packets on a topic twice.
    Duplicate {
        /// Last level of the topic; any when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        topic: Option<String>,
        /// How many.
        count: u32,
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Accept no new connections, leave the present one alone.
    Refuse,
    /// End all faults.
    Restore,
}

/// An event that has not been given its number yet.
#[derive(Clone, Debug, PartialEq)]
pub struct Occurrence {
    /// When.
    pub at: Stamp,
    /// Seen or caused by whom.
    pub source: Source,
    /// Which way, where that makes sense.
    pub direction: Option<Direction>,
    /// What.
    pub event: Event,
}

impl Occurrence {
    /// Something the harness itself did.
    #[must_use]
    pub fn harness(at: Stamp, event: Event) -> Self {
        Self {
            at,
            source: Source::Harness,
            direction: None,
            event,
        }
    }

    /// Gives it its number.
    #[must_use]
    pub fn numbered(self, seq: u64) -> Record {
        Record {
            seq,
            at: self.at,
            source: self.source,
            direction: self.direction,
            event: self.event,
        }
    }
}

/// One line of the journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Number, counted from 1.
    pub seq: u64,
    /// When.
    pub at: Stamp,
    /// Seen or caused by whom.
    pub source: Source,
    /// Which way, where that makes sense.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// What.
    pub event: Event,
}
