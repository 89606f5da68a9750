//! What a device looks like from the in-memory bus.
//!
//! This mirrors the sans-IO devices of `reference`, which a link must not know; `run::device_peer` joins the two.

use std::time::Duration;

use bytes::Bytes;

use crate::bench::Outgoing;
use tck_base::clock::{Moment, Stamp};

/// How a peer opens its MQTT connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PeerConnect {
    /// MQTT protocol level: 4 is MQTT 3.1.1.
    pub level: u8,
    /// Client identifier.
    pub client_id: String,
    /// Keep-alive; zero is off.
    pub keep_alive: Duration,
    /// Clean session.
    pub clean_session: bool,
    /// The last will.
    pub will: Option<Outgoing>,
    /// Topic filters and QoS, subscribed right after the connection is accepted.
    pub subscriptions: Vec<(String, u8)>,
}

/// What happens to a peer.
#[derive(Clone, Debug, PartialEq)]
pub enum PeerInput {
    /// The connection was accepted and the subscriptions acknowledged.
    Connected,
    /// The connection is gone, or an attempt failed. Not given after the peer's own `Disconnect` or `Drop`.
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
        progress: PeerDownload,
    },
    /// A person or a test does something to the device.
    Command(String, serde_json::Value),
}

/// Progress of a download.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PeerDownload {
    /// The server answers and the first byte is here.
    Begun,
    /// All bytes are here.
    Done(Bytes),
    /// It did not work; the text says why.
    Failed(String),
}

/// What a peer wants done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PeerOutput {
    /// Publish a message; lost while there is no connection.
    Publish(Outgoing),
    /// Fetch a file over HTTP.
    Fetch {
        /// Token that comes back with the progress.
        token: u64,
        /// Address.
        url: String,
    },
    /// Open a connection with what [`Peer::connect`] then says.
    Connect,
    /// Send DISCONNECT and close.
    Disconnect,
    /// Close without DISCONNECT.
    Drop,
    /// Send these bytes on the raw connection.
    Raw(Vec<u8>),
}

/// A sans-IO device on the bus.
pub trait Peer {
    /// How to connect now. Called at every connection attempt.
    fn connect(&mut self, now: Stamp) -> PeerConnect;

    /// Takes an input; appends what is to be done to `out`, in order.
    fn handle(&mut self, now: Stamp, input: PeerInput, out: &mut Vec<PeerOutput>);

    /// When it next wants [`PeerInput::Time`]; `None` while it waits for something else.
    fn wake_up(&self) -> Option<Moment>;
}
