//! Recordings of other tools: what was published on a broker, or captured on a network.
//!
//! [`Lines`] reads a recording in lines and yields a [`Message`] for each that holds one; what holds none is counted.
//! [`Packets`] reads a capture of network traffic, where connections are seen as well, and [`Mcap`] the container of that
//! name. [`Recorded`] is one of them,
//! [`input`] opens files and standard input, packed or not, [`merge`] makes one stream of several recordings.
//! What the messages mean is left to others.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod clock_text;
pub mod from_journal;
pub mod input;
mod lines;
mod mcap;
mod members;
pub mod merge;
mod names;
pub(crate) mod packets;
mod payload;
mod recorded;
mod table;
mod wide;

use bytes::Bytes;

pub use lines::{Counted, Lines, Read};
pub use mcap::Mcap;
pub use packets::Packets;
pub use recorded::Recorded;

use tck_journal::Record;
use tck_journal::event::{Close, Packet};

/// Where a message stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SourcePosition {
    /// Number of the recording, counted from 0.
    pub file: usize,
    /// Line, counted from 1.
    pub line: u64,
}

/// One message of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// When it was recorded, if the recording says so.
    pub at: Option<jiff::Timestamp>,
    /// Full topic.
    pub topic: String,
    /// The bytes.
    pub payload: Bytes,
    /// QoS of the delivery, if the recording says so.
    pub qos: Option<u8>,
    /// RETAIN of the delivery, if the recording says so.
    pub retain: Option<bool>,
    /// Where it stands.
    pub place: SourcePosition,
    /// Whether the recorder says that it saw nothing for a while before this message.
    pub after_gap: bool,
    /// The connection it came by, where packets were captured.
    pub carried: Option<Carried>,
}

/// How a message came by a captured connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Carried {
    /// Number of the connection.
    pub connection: u64,
    /// Whether the client sent it; otherwise its broker handed it on.
    pub sent: bool,
}

/// What is seen of a connection between a client and its broker.
#[derive(Clone, Debug, PartialEq)]
pub struct Wire {
    /// When.
    pub at: Option<jiff::Timestamp>,
    /// Number of the connection.
    pub connection: u64,
    /// Whether it is certain which end is the client.
    pub certain: bool,
    /// What.
    pub event: WireEvent,
}

/// What happens on a connection.
#[derive(Clone, Debug, PartialEq)]
pub enum WireEvent {
    /// A packet.
    Packet {
        /// The packet.
        packet: Packet,
        /// Whether the client sent it.
        sent: bool,
    },
    /// Something is missing in one direction.
    Gap {
        /// Whether the client sent it.
        sent: bool,
    },
    /// The end.
    Closed {
        /// How.
        how: Close,
    },
}

/// What comes next of several recordings.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// A message.
    Message(Message),
    /// Something of a connection.
    Wire(Wire),
}

impl Carried {
    /// How a subscriber beside the tap hears what somebody may have sent through the tap.
    pub const BESIDE_TAP: Self = Self {
        connection: 0,
        sent: false,
    };
}

impl Told {
    /// When.
    #[must_use]
    pub fn at(&self) -> Option<jiff::Timestamp> {
        match self {
            Self::Message(message) => message.at,
            Self::Wire(wire) => wire.at,
        }
    }
}

/// What a line holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// A message.
    Message(Message),
    /// A record of one of our own journals.
    Record(Box<Record>),
    /// Something of a connection.
    Wire(Box<Wire>),
}

/// Names of the members that hold time, topic and payload, where a recording has names of its own. A dot leads inside:
/// `message.topic`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mapping {
    /// Time: a text, or a number of seconds, milliseconds, microseconds or nanoseconds since 1970.
    pub time: Option<String>,
    /// Topic.
    pub topic: Option<String>,
    /// Payload: an object, a text, or base64.
    pub payload: Option<String>,
}

/// Why a recording could not be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read {name}: {source}")]
pub struct CaptureError {
    /// Name of the recording.
    pub name: String,
    /// What the operating system or the unpacking said.
    pub source: std::io::Error,
}
