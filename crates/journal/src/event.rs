//! What can be recorded.
//!
//! Every event is plain data that survives a round trip through JSON unchanged. The raw bytes of what a
//! device sent are kept verbatim.

use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use super::fault::LinkFault;
pub use super::latency::OwnLatency;
pub use super::packet::{Close, Filter, Packet, Will};
pub use super::payload::{PAYLOAD_LIMIT, PAYLOAD_PREFIX, Payload, hex};
pub use super::plan::{
    Capability, DIVIDED_TESTS, DIVIDED_VEHICLES, Gate, MockVehicle, NAMED_VEHICLES, Plan, PlannedTest, RunHeader,
    Setting, ShardRecord,
};
pub use super::program::{Ending, Origin, Program};
pub use super::vantage::Direction;
pub use super::waiver::{Reading, Waiver};
use tck_base::clock::Stamp;

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
    /// The device does not do what a hook asks of it, or cannot be asked any more; the text says why.
    Refused(String),
    /// The device says in answer to a hook that it does not do what it is asked for; the text says so.
    Declined(String),
    /// The operator leaves the test out; the text says so.
    Skipped(String),
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
        /// Whether another device spoke than the one that was to be judged.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        stranger: bool,
        /// How long the harness itself took with messages, where that was measured.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        latency: Option<OwnLatency>,
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
        /// Which time it is run, counted from 1, where tests are repeated.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        repetition: Option<u32>,
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
    /// Whose the other end of a connection to the tap is, where a run has started a program.
    Traced {
        /// Number of the connection.
        connection: u64,
        /// See [`Origin`].
        origin: Origin,
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
    /// The harness set one of its mock AGVs.
    Vehicle {
        /// Its number, counted from 0.
        vehicle: usize,
        /// What it was told.
        what: String,
        /// With which parameters.
        with: Value,
    },
    /// A hook of the profile was run.
    Hook {
        /// Name of the hook.
        hook: String,
        /// Whether it succeeded.
        ok: bool,
        /// What it said.
        detail: String,
        /// The serial number of the mock AGV it was run for, where it was run for every one of them.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        vehicle: Option<String>,
    },
    /// A person is asked to do something; what comes of it is the record of the hook.
    Question {
        /// Name of the hook.
        hook: String,
        /// What the person is to do.
        text: String,
        /// How many seconds there are for the answer.
        seconds: u64,
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
    /// Something has become of the program that the run has started.
    Program {
        /// See [`Program`].
        program: Program,
    },
    /// Somebody wants the run to end; nothing that happens from now on is held against the device.
    Interrupted,
    /// A lasting mistake of the vehicle does not stand in the way of further tests.
    Waived {
        /// See [`Waiver`].
        waiver: Waiver,
    },
    /// The harness was late itself: what came in this time may have come earlier.
    Lag {
        /// By how many microseconds.
        micros: u64,
        /// What was late: `timer` or `tap`.
        of: String,
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
