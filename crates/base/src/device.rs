//! A device seen from what connects it to a broker: what it is told, and what it wants done.
//!
//! The reference devices are such devices. The in-memory link and the driver over sockets know no more of them.

use std::time::Duration;

use bytes::Bytes;

use crate::clock::{Moment, Stamp};

/// Options with which a device opens its MQTT connection.
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
    /// Topic filters and QoS, subscribed right after the connection is accepted.
    pub subscriptions: Vec<(String, u8)>,
}

/// A message to be published.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Publication {
    /// Full topic.
    pub topic: String,
    /// Payload.
    pub payload: Bytes,
    /// QoS.
    pub qos: u8,
    /// RETAIN.
    pub retain: bool,
}

/// Event that a device is told.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// The connection was accepted and the subscriptions acknowledged.
    Connected,
    /// The connection is gone, or an attempt failed. Not given after the device's own `Disconnect` or `Drop`.
    ConnectionLost,
    /// A message was delivered.
    Message {
        /// Full topic.
        topic: String,
        /// Payload.
        payload: Bytes,
    },
    /// Time has passed. Given once at the start and at every wake-up asked for.
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
    Done(Bytes),
    /// It did not work; the text says why.
    Failed(String),
}

/// Request of a device to its driver.
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

/// What became of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Commanded {
    /// The device has it.
    Taken,
    /// The device does not do it, and says why.
    Declined(String),
    /// There is no such device, or it is not running any more.
    Nobody,
}

/// A device as a state machine without sockets and clock.
pub trait Device {
    /// Why it does not do what a command asks of it; `None` when it does. What it declines is not given to it as
    /// [`Input::Command`].
    fn declines(&self, name: &str, arguments: &serde_json::Value) -> Option<String> {
        let _ = (name, arguments);
        None
    }

    /// How to connect now. Called at every connection attempt.
    fn connect_options(&mut self, now: Stamp) -> ConnectOptions;

    /// Takes an input; appends what is to be done to `out`, in order.
    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>);

    /// When it next wants [`Input::Time`]; `None` while it waits for something else.
    fn wake_up(&self) -> Option<Moment>;
}
