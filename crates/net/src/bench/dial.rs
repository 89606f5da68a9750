//! Opens connections to a broker, over TCP, TLS and WebSocket, and says in plain words why one cannot be opened.

use std::io;
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};

use super::endpoint::Endpoint;
use super::stream::Stream;
use super::websocket;

/// Why there is no connection where nobody says anything, as the end of a sentence about the broker.
pub(crate) const SILENT: &str = "it does not answer";
/// How long opening a connection may take.
const LIMIT: Duration = Duration::from_secs(10);
/// How long the broker may take to close its side once ours is closed.
const DRAIN_LIMIT: Duration = Duration::from_secs(1);

/// Opens a connection to a broker, on which MQTT may begin.
///
/// # Errors
/// Why there is none, as the end of a sentence about the broker.
pub(crate) async fn dial(endpoint: &Endpoint) -> Result<Box<dyn Stream>, String> {
    let opened = tokio::time::timeout(LIMIT, open(endpoint)).await;
    opened.unwrap_or_else(|_| Err(SILENT.to_owned()))
}

async fn open(endpoint: &Endpoint) -> Result<Box<dyn Stream>, String> {
    let socket = TcpStream::connect((endpoint.host.as_str(), endpoint.port)).await;
    let socket = socket.map_err(|error| unreachable(&error))?;
    socket.set_nodelay(true).map_err(|error| error.to_string())?;
    let stream: Box<dyn Stream> = match &endpoint.tls {
        None => Box::new(socket),
        Some(tls) => {
            let plain = if endpoint.websocket.is_some() { "ws" } else { "mqtt" };
            tls.secure(socket, &endpoint.host, plain).await?
        }
    };
    match &endpoint.websocket {
        None => Ok(stream),
        Some(path) => Ok(Box::new(websocket::open(stream, endpoint, path).await?)),
    }
}

/// Nobody is there.
pub(crate) fn unreachable(error: &io::Error) -> String {
    format!("it is not reachable: {error}")
}

/// A port of this machine through which a client that knows TCP only reaches a broker behind TLS or WebSocket.
pub(crate) struct Bridge {
    listener: TcpListener,
    port: u16,
}

impl Bridge {
    /// Opens the port.
    pub(crate) fn open() -> io::Result<Self> {
        let listener = std::net::TcpListener::bind("127.0.0.1:0")?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        Ok(Self {
            listener: TcpListener::from_std(listener)?,
            port,
        })
    }

    /// Where the client connects to on 127.0.0.1.
    pub(crate) fn port(&self) -> u16 {
        self.port
    }

    /// Carries bytes both ways for the first client until its end. A client that goes without a word does so towards the
    /// broker, too.
    pub(crate) async fn carry(self, broker: Box<dyn Stream>) {
        let Ok((client, _)) = self.listener.accept().await else {
            return;
        };
        drop(self.listener);
        let _ = client.set_nodelay(true);
        let (mut from_client, mut to_client) = client.into_split();
        let (mut from_broker, mut to_broker) = tokio::io::split(broker);
        tokio::select! {
            _ = tokio::io::copy(&mut from_client, &mut to_broker) => {
                let _ = to_broker.shutdown().await;
                // Closing with bytes unread could make the broker lose the last packet.
                let mut rest = [0; 4096];
                let closed = async { while from_broker.read(&mut rest).await.is_ok_and(|length| length > 0) {} };
                let _ = tokio::time::timeout(DRAIN_LIMIT, closed).await;
            }
            _ = tokio::io::copy(&mut from_broker, &mut to_client) => {
                let _ = to_client.shutdown().await;
            }
        }
    }
}
