//! What a bench is to be, and where everything is once it stands.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use crate::bench::endpoint::{Access, Endpoint};
use crate::bench::own::OwnNames;
use crate::bench::tls::TlsFiles;
use tck_base::clock::WallClock;

/// How long the broker may take to accept the harness, or to serve a fresh subscriber.
pub(super) const ANSWER_LIMIT: Duration = Duration::from_secs(30);

/// Which broker is used.
#[derive(Clone, Debug)]
pub enum BrokerChoice {
    /// The embedded one.
    Embedded,
    /// Another one.
    External {
        /// `mqtt://host:port`, or with `mqtts`, `ws` or `wss`.
        url: String,
        /// How the harness gets in. The device's own credentials pass the tap untouched.
        access: Access,
    },
}

/// What the bench is to be.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Where the tap listens for the device; port 0 lets the system choose.
    pub listen: String,
    /// The broker.
    pub broker: BrokerChoice,
    /// Other nodes of the cluster that a broker of somebody else is one of, as addresses like its own.
    pub cluster: Vec<String>,
    /// Whether there is a tap. Without one the device connects to the broker itself.
    pub tap: bool,
    /// Certificate of the tap; without one it speaks plain TCP.
    pub tls: Option<TlsFiles>,
    /// PEM file with an authority that mock vehicles trust when they fetch maps.
    pub authority: Option<PathBuf>,
    /// Where the map server listens.
    pub maps_listen: String,
    /// Host name in the links to map files, as the device knows this machine; where the map server listens unless said.
    pub maps_host: Option<String>,
    /// How the harness names itself.
    pub own: OwnNames,
    /// Topic filters of the standing subscription: the topics of the device.
    pub device_topics: Vec<String>,
    /// The topics that the harness publishes. Without a tap nobody else sees whether the broker takes them.
    pub harness_topics: Vec<String>,
    /// The clock of the run.
    pub clock: WallClock,
}

impl BenchOptions {
    /// A bench on loopback with everything embedded, on ports the system chooses.
    #[must_use]
    pub fn loopback(device_topics: Vec<String>) -> Self {
        Self {
            listen: "127.0.0.1:0".to_owned(),
            broker: BrokerChoice::Embedded,
            cluster: Vec::new(),
            tap: true,
            tls: None,
            authority: None,
            maps_listen: "127.0.0.1:0".to_owned(),
            maps_host: None,
            own: OwnNames::default(),
            device_topics,
            harness_topics: Vec::new(),
            clock: WallClock::start(),
        }
    }
}

/// Where everything is.
#[derive(Clone, Debug)]
pub struct BenchInfo {
    /// `host:port` the device connects to: the tap, or the broker when there is no tap.
    pub device_address: String,
    /// URL the device connects to, with an address that others reach.
    pub device_url: String,
    /// `host:port` of the broker.
    pub broker_address: String,
    /// The broker, for clients of the harness itself.
    pub broker: Endpoint,
    /// Where the map server listens.
    pub maps_address: SocketAddr,
    /// What the broker does not allow, and what cannot be said therefore.
    pub limits: Vec<String>,
}

/// What a device is told to connect to, where the tap listens. One that listens on every address is reached at one of them.
pub(super) fn tap_url(tap: SocketAddr, tls: bool) -> String {
    let scheme = if tls { "mqtts" } else { "mqtt" };
    let own = if tap.ip().is_unspecified() {
        own_address(tap)
    } else {
        None
    };
    let address = own.map_or(tap, |own| SocketAddr::new(own, tap.port()));
    format!("{scheme}://{address}")
}

/// The address of this machine from which others are reached. Nothing is sent.
fn own_address(like: SocketAddr) -> Option<std::net::IpAddr> {
    // Addresses that are kept for documents: nobody has them, so the usual way out is taken.
    let (from, to) = if like.is_ipv4() {
        ("0.0.0.0:0", "192.0.2.1:9")
    } else {
        ("[::]:0", "[2001:db8::1]:9")
    };
    let socket = std::net::UdpSocket::bind(from).ok()?;
    socket.connect(to).ok()?;
    let own = socket.local_addr().ok()?.ip();
    (!own.is_unspecified()).then_some(own)
}
