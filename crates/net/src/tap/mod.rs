//! The transparent tap between the device under test and the broker.
//!
//! It forwards bytes, decodes a copy, reports both as occurrences and injects link faults. It judges nothing.

mod connection;
pub mod faults;
mod pump;
mod rewrite;

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::{JoinHandle, JoinSet};

use crate::bench::LinkError;
use crate::bench::endpoint::Endpoint;
use crate::bench::inbox::Reporter;
use crate::bench::kin::Kin;
use crate::bench::listen::{cannot_listen, listen_on};
use crate::bench::secure::TlsServer;
use faults::{Change, Faults};
use tck_journal::event::{Direction, Event, LinkFault, Source};

/// How long a cut may take; closing sockets takes no time, so this is only a safety net.
const CUT_LIMIT: Duration = Duration::from_secs(2);

/// The broker behind the tap.
#[derive(Clone)]
pub struct Upstream {
    /// Where it is.
    pub broker: Endpoint,
    /// Whether it is the embedded broker, whose peculiarities the tap absorbs.
    pub embedded: bool,
}

/// What open connections are told.
#[derive(Clone, Copy, Debug, Default)]
struct Control {
    cuts: u64,
    reset: bool,
    restores: u64,
}

/// What all connections share.
struct Shared {
    reporter: Reporter,
    upstream: Upstream,
    tls: Option<TlsServer>,
    /// What belongs to the program that the run has started.
    kin: Kin,
    faults: Mutex<Faults>,
    control: watch::Sender<Control>,
    /// Number of open connections.
    open: watch::Sender<usize>,
}

/// A running tap.
pub struct Tap {
    shared: Arc<Shared>,
    address: SocketAddr,
    accepting: JoinHandle<()>,
}

impl Tap {
    /// Opens the port devices connect to.
    ///
    /// # Errors
    /// [`LinkError::Listen`] when the port is taken or may not be opened.
    pub async fn start(
        listen: &str,
        tls: Option<TlsServer>,
        upstream: Upstream,
        reporter: Reporter,
    ) -> Result<Self, LinkError> {
        let listener = listen_on(listen).await?;
        let address = listener.local_addr().map_err(|error| cannot_listen(listen, &error))?;
        let shared = Arc::new(Shared {
            reporter,
            upstream,
            tls,
            kin: Kin::default(),
            faults: Mutex::default(),
            control: watch::Sender::default(),
            open: watch::Sender::default(),
        });
        let accepting = tokio::spawn(accept(listener, shared.clone()));
        Ok(Self {
            shared,
            address,
            accepting,
        })
    }

    /// Where devices connect to.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// What belongs to the program that the run has started: connections of others are told from its own.
    #[must_use]
    pub fn kin(&self) -> Kin {
        self.shared.kin.clone()
    }

    /// Changes what the tap does. In effect when this returns: after a cut all connections are closed.
    pub async fn fault(&self, fault: &LinkFault) {
        let change = self
            .shared
            .faults
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .apply(fault);
        self.shared.control.send_modify(|control| match change {
            Change::Cut { reset } => {
                control.cuts += 1;
                control.reset = reset;
            }
            Change::Keep => control.restores += u64::from(*fault == LinkFault::Restore),
        });
        if let Change::Cut { .. } = change {
            let mut open = self.shared.open.subscribe();
            let _ = tokio::time::timeout(CUT_LIMIT, open.wait_for(|open| *open == 0)).await;
        }
    }

    /// Closes the port and all connections.
    pub async fn stop(mut self) {
        self.accepting.abort();
        let _ = (&mut self.accepting).await;
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.accepting.abort();
    }
}

/// Lets devices in. Connections end with this task.
async fn accept(listener: TcpListener, shared: Arc<Shared>) {
    let mut connections = JoinSet::new();
    let mut number = 0;
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            Some(_) = connections.join_next() => continue,
        };
        let Ok((socket, peer)) = accepted else {
            // Out of file descriptors, most likely; the next attempt may work.
            tokio::time::sleep(Duration::from_millis(20)).await;
            continue;
        };
        let Some(admitted) = admit(&shared) else {
            refuse(socket, peer, &shared.reporter).await;
            continue;
        };
        number += 1;
        connections.spawn(connection::serve(socket, peer, number, shared.clone(), admitted));
    }
}

/// Counts a connection as open until it is dropped.
struct Admitted {
    shared: Arc<Shared>,
    control: watch::Receiver<Control>,
}

impl Drop for Admitted {
    fn drop(&mut self) {
        self.shared.open.send_modify(|open| *open -= 1);
    }
}

fn admit(shared: &Arc<Shared>) -> Option<Admitted> {
    // Under the lock, so that a cut either finds this connection open or keeps it out.
    let faults = shared.faults.lock().unwrap_or_else(PoisonError::into_inner);
    if !faults.admits() {
        return None;
    }
    shared.open.send_modify(|open| *open += 1);
    Some(Admitted {
        shared: shared.clone(),
        control: shared.control.subscribe(),
    })
}

/// A connection attempt that is to fail: the port stays ours, and the connection is reset at once.
async fn refuse(socket: TcpStream, peer: SocketAddr, reporter: &Reporter) {
    faults::abort(&socket);
    drop(socket);
    let text = format!("a connection attempt from {peer} was refused");
    reporter
        .report(Source::Tap, Some(Direction::FromDevice), Event::Note { text })
        .await;
}
