//! Reference devices: sans-IO state machines, with faults that prove the checks.
//!
//! A reference device is handed inputs and the time and hands back outputs; it owns no socket, no clock and
//! no randomness. Drivers that connect one to a link live in `link::memory` and `cli::simulate`.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[macro_use]
mod hooks;
pub mod agv;
pub mod deviations;
pub mod master_control;

use std::time::Duration;

use tck_base::clock::{Moment, Stamp};

/// Options with which a reference device opens its MQTT connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConnectOptions {
    /// MQTT protocol level: 4 is MQTT 3.1.1. Links over real sockets speak no other.
    pub level: u8,
    /// Client identifier.
    pub client_id: String,
    /// Keep-alive; zero is off.
    pub keep_alive: Duration,
    /// Clean session.
    pub clean_session: bool,
    /// The last will.
    pub will: Option<Publication>,
    /// Topic filters and QoS.
    pub subscriptions: Vec<(String, u8)>,
}

/// A message a reference device publishes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Publication {
    /// Full topic.
    pub topic: String,
    /// Payload.
    pub payload: Vec<u8>,
    /// QoS.
    pub qos: u8,
    /// RETAIN.
    pub retain: bool,
}

/// Event that a reference device is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// The connection was accepted and the subscriptions acknowledged.
    Connected,
    /// The connection is gone.
    ConnectionLost,
    /// A message was delivered.
    Message {
        /// Full topic.
        topic: String,
        /// Payload.
        payload: bytes::Bytes,
    },
    /// Time has passed; given at least at every wake-up asked for.
    Time,
    /// A download made progress.
    Download {
        /// The token of the request.
        token: u64,
        /// What happened.
        progress: Download,
    },
    /// A person or a test does something to the vehicle.
    Command(String, serde_json::Value),
}

/// Progress of a download.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Download {
    /// The server answers and the first byte is here.
    Begun,
    /// All bytes are here.
    Done(bytes::Bytes),
    /// It did not work; the text says why.
    Failed(String),
}

/// Request of a reference device to its driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Output {
    /// Publish a message. Dropped by the driver while there is no connection.
    Publish(Publication),
    /// Fetch a file over HTTP.
    Fetch {
        /// Token that comes back with the progress.
        token: u64,
        /// Address.
        url: String,
    },
    /// Open a connection with what [`Device::connect_options`] then says.
    Connect,
    /// Send DISCONNECT and close.
    Disconnect,
    /// Close without DISCONNECT.
    Drop,
    /// Send these bytes on the raw connection (a defect that no client library can produce).
    Raw(Vec<u8>),
}

/// A sans-IO reference device.
pub trait Device {
    /// How to connect now. Called at every connection attempt.
    fn connect_options(&mut self, now: Stamp) -> ConnectOptions;

    /// Takes an input; appends what is to be done to `out`, in order.
    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>);

    /// When it next wants [`Input::Time`]; `None` while it waits for something else.
    fn wake_up(&self) -> Option<Moment>;
}

/// One switchable defect of a reference device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fault {
    /// Name, in kebab-case, such as `outdated-update-taken-over`.
    pub name: &'static str,
    /// The requirements it breaks. The first one is the one it is about.
    pub breaks: &'static [&'static str],
    /// Sentence that says what is wrong with the device.
    pub wrong: &'static str,
}

/// One switchable tolerance of a reference device: what a good device may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tolerance {
    /// Name, in kebab-case, such as `every-state-twice`.
    pub name: &'static str,
    /// The requirements that leave it to the device.
    pub under: &'static [&'static str],
    /// Sentence that says what the device does.
    pub does: &'static str,
}
