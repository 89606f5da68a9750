//! Recordings of other tools: what was published on a broker, told line by line.
//!
//! [`Lines`] reads one recording and yields a [`Message`] for each line that holds one; what holds none is counted.
//! [`input`] opens files and standard input, packed or not, [`merge`] makes one stream of several recordings.
//! What the messages mean is left to others.

mod clock_text;
pub mod input;
mod lines;
mod members;
pub mod merge;

use bytes::Bytes;

pub use lines::{Counted, Lines, Read};

use crate::journal::Record;

/// Where a message stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
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
    pub place: Place,
    /// Whether the recorder says that it saw nothing for a while before this message.
    pub after_gap: bool,
}

/// What a line holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// A message.
    Message(Message),
    /// A record of one of our own journals.
    Record(Box<Record>),
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
