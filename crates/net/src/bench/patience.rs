//! HTTP for few and quick clients: whoever does not say what he wants is sent away, and the others wait their turn.

use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc};
use tokio::task::JoinHandle;
use tokio::time::Sleep;

use super::secure::TlsServer;
use super::stream::Stream;

/// How long the head of the first request of a connection may take.
const HEAD_LIMIT: Duration = Duration::from_secs(10);
/// How many connections are open at a time.
const CONNECTIONS: usize = 64;
/// What a connection begins with that is to be secured: the type of a handshake record of TLS.
const HANDSHAKE: u8 = 0x16;
/// How long to wait when the system has no file handle left.
const NO_HANDLE: Duration = Duration::from_millis(100);

/// A port that serves HTTP to few clients at a time, and waits for none of them for long.
pub struct PatientListener {
    listener: TcpListener,
    limit: Duration,
    places: Arc<Semaphore>,
}

impl PatientListener {
    /// Serves on a port that is open already.
    #[must_use]
    pub fn new(listener: TcpListener) -> Self {
        Self {
            listener,
            limit: HEAD_LIMIT,
            places: Arc::new(Semaphore::new(CONNECTIONS)),
        }
    }
}

impl Listener for PatientListener {
    type Io = HttpConnection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            let Ok(place) = Arc::clone(&self.places).acquire_owned().await else {
                return std::future::pending().await;
            };
            match self.listener.accept().await {
                Ok((stream, peer)) => {
                    return (HttpConnection::begin(Box::new(stream), false, self.limit, place), peer);
                }
                Err(_) => tokio::time::sleep(NO_HANDLE).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.listener.local_addr()
    }
}

/// A port that serves HTTP over TLS to few clients at a time, or with and without TLS. One that is slow to shake hands keeps
/// nobody else waiting.
pub struct SecuredListener {
    address: io::Result<SocketAddr>,
    secured: mpsc::Receiver<(HttpConnection, SocketAddr)>,
    accepting: JoinHandle<()>,
}

impl SecuredListener {
    /// Serves on a port that is open already, and shows a certificate there.
    #[must_use]
    pub fn new(listener: TcpListener, tls: TlsServer) -> Self {
        Self::begin(listener, tls, false)
    }

    /// Serves on a port that is open already, and shows a certificate to those who begin with TLS.
    #[must_use]
    pub fn beside_plain(listener: TcpListener, tls: TlsServer) -> Self {
        Self::begin(listener, tls, true)
    }

    #[cfg_attr(
        not(feature = "tls"),
        allow(
            unused_variables,
            unused_assignments,
            reason = "without TLS nobody has a certificate"
        )
    )]
    fn begin(listener: TcpListener, tls: TlsServer, takes_plain: bool) -> Self {
        let address = listener.local_addr();
        let (sender, secured) = mpsc::channel(1);
        let places = Arc::new(Semaphore::new(CONNECTIONS));
        let accepting = tokio::spawn(async move {
            while let Ok(place) = Arc::clone(&places).acquire_owned().await {
                let Ok((stream, peer)) = listener.accept().await else {
                    tokio::time::sleep(NO_HANDLE).await;
                    continue;
                };
                let (tls, sender) = (tls.clone(), sender.clone());
                tokio::spawn(async move {
                    let opened = tokio::time::timeout(HEAD_LIMIT, opened(stream, &tls, takes_plain)).await;
                    if let Ok(Ok((stream, over_tls))) = opened {
                        let connection = HttpConnection::begin(stream, over_tls, HEAD_LIMIT, place);
                        let _ = sender.send((connection, peer)).await;
                    }
                });
            }
        });
        Self {
            address,
            secured,
            accepting,
        }
    }
}

/// A connection that is secured, unless plain ones are taken and it begins as one; and whether it is.
async fn opened(stream: TcpStream, tls: &TlsServer, takes_plain: bool) -> io::Result<(Box<dyn Stream>, bool)> {
    if takes_plain {
        let mut first = [0];
        if stream.peek(&mut first).await? == 0 || first != [HANDSHAKE] {
            return Ok((Box::new(stream), false));
        }
    }
    let secured = tls.accept(stream).await?;
    Ok((Box::new(secured), true))
}

/// Whether a request came over TLS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OverTls(pub bool);

impl Connected<IncomingStream<'_, PatientListener>> for OverTls {
    fn connect_info(stream: IncomingStream<'_, PatientListener>) -> Self {
        Self(stream.io().over_tls)
    }
}

impl Connected<IncomingStream<'_, SecuredListener>> for OverTls {
    fn connect_info(stream: IncomingStream<'_, SecuredListener>) -> Self {
        Self(stream.io().over_tls)
    }
}

impl Drop for SecuredListener {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

impl Listener for SecuredListener {
    type Io = HttpConnection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        match self.secured.recv().await {
            Some(secured) => secured,
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.address.as_ref().copied().map_err(|error| error.kind().into())
    }
}

/// A connection of a client, which ends when the head of its first request does not come.
pub struct HttpConnection {
    stream: Box<dyn Stream>,
    over_tls: bool,
    head: Head,
    limit: Pin<Box<Sleep>>,
    /// The place it takes until it is dropped.
    _place: OwnedSemaphorePermit,
}

impl HttpConnection {
    fn begin(stream: Box<dyn Stream>, over_tls: bool, limit: Duration, place: OwnedSemaphorePermit) -> Self {
        Self {
            stream,
            over_tls,
            head: Head::default(),
            limit: Box::pin(tokio::time::sleep(limit)),
            _place: place,
        }
    }
}

/// How much of the end of a head was seen.
#[derive(Debug, Default)]
struct Head {
    is_whole: bool,
    /// Line ends one after the other.
    ends: u8,
}

impl Head {
    fn see(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match byte {
                b'\n' => self.ends += 1,
                b'\r' => {}
                _ => self.ends = 0,
            }
            self.is_whole |= self.ends == 2;
            if self.is_whole {
                return;
            }
        }
    }
}

impl AsyncRead for HttpConnection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if !self.head.is_whole && self.limit.as_mut().poll(context).is_ready() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        let before = buffer.filled().len();
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if !self.head.is_whole {
            self.head.see(&buffer.filled()[before..]);
        }
        read
    }
}

impl AsyncWrite for HttpConnection {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use axum::Router;
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpStream;

    use super::*;

    #[tokio::test]
    async fn who_does_not_say_what_he_wants_is_sent_away_and_the_others_are_served() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let patient = PatientListener {
            limit: Duration::from_millis(300),
            ..PatientListener::new(listener)
        };
        let router = Router::new().route("/", get(|| async { "here" }));
        let serving = tokio::spawn(async move { axum::serve(patient, router).await });
        let mut half = Vec::new();
        for _ in 0..CONNECTIONS + 8 {
            let mut stream = TcpStream::connect(address).await.expect("a connection");
            stream
                .write_all(b"GET / HTTP/1.1\r\nHost: x\r\n")
                .await
                .expect("written");
            half.push(stream);
        }
        let mut whole = TcpStream::connect(address).await.expect("a connection");
        whole
            .write_all(b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
            .await
            .expect("written");
        let mut answer = String::new();
        let read = tokio::time::timeout(Duration::from_secs(5), whole.read_to_string(&mut answer)).await;
        assert!(read.is_ok() && answer.ends_with("here"), "{answer:?}");
        let mut rest = Vec::new();
        let gone = tokio::time::timeout(Duration::from_secs(5), half[0].read_to_end(&mut rest)).await;
        assert!(gone.is_ok(), "a half request is open for ever");
        serving.abort();
    }

    #[test]
    fn the_end_of_a_head_is_seen_however_it_comes() {
        let whole = |parts: &[&str]| {
            let mut head = Head::default();
            for part in parts {
                head.see(part.as_bytes());
            }
            head.is_whole
        };
        assert!(whole(&["GET / HTTP/1.1\r\nA: b\r", "\n", "\r\n"]) && whole(&["GET /\n\nbody"]));
        assert!(!whole(&["GET / HTTP/1.1\r\n", "A: b\r\n"]) && !whole(&[]));
    }
}
