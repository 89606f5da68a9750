//! What link, broker, tap and map server share: files on their way, the inbox of everything that happens,
//! connections to a broker, certificates and ports.

pub mod client;
pub mod dial;
pub mod endpoint;
mod flow;
mod heard;
pub mod inbox;
pub mod kin;
pub mod leavings;
pub mod light;
pub mod listen;
pub mod own;
pub mod patience;
pub mod secret;
pub mod secure;
pub mod stream;
pub mod tls;
pub mod web;
mod websocket;

use tck_journal::ServeBehaviour;

/// A file for the map server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Offer {
    /// Name of the offer.
    pub name: String,
    /// The file.
    pub body: bytes::Bytes,
    /// How it is served.
    pub behaviour: ServeBehaviour,
    /// Whether it is served over TLS, and not without.
    pub secured: bool,
}

/// Why a link could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The broker is gone, was never there, or lets nobody in.
    #[error("the broker at {broker} cannot be used: {reason}")]
    Broker {
        /// Its URL.
        broker: String,
        /// Why, as the end of a sentence about the broker.
        reason: String,
    },
    /// A port could not be opened.
    #[error("cannot listen on {address}: {reason}")]
    Listen {
        /// Which.
        address: String,
        /// What the system said.
        reason: String,
    },
    /// The broker does not allow what the harness has to do.
    #[error(
        "the broker at {broker} does not allow {what}; these are the access rules it needs, as mosquitto has them:\n{rules}"
    )]
    Forbidden {
        /// Its URL.
        broker: String,
        /// What it refuses.
        what: String,
        /// What would allow it.
        rules: String,
    },
    /// The link cannot do that from its vantage.
    #[error("{what} needs the tap, and this run only has vantage `subscriber`")]
    NeedsTap {
        /// What was asked.
        what: String,
    },
    /// Credentials, certificates or addresses are wrong.
    #[error("{0}")]
    Setup(String),
}
