//! One connection of a device, from the moment it is let in to its end.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::watch;

use super::pump::{Both, Pump};
use super::{Admitted, Control, Shared, faults};
use crate::bench::dial::dial;
use crate::bench::stream::{Socket, Stream};
use tck_journal::event::{Close, Direction, Event, Source};

/// How long the TLS handshake may take.
const SETUP_LIMIT: Duration = Duration::from_secs(10);
/// How long a device may take to say who it is.
const CONNECT_LIMIT: Duration = Duration::from_secs(20);
/// How long a side that was told the end may take to close its own.
const DRAIN_LIMIT: Duration = Duration::from_secs(1);

/// How a connection came to its end.
enum End {
    Device,
    Broker,
    Cut { reset: bool },
}

pub(super) async fn serve(
    socket: TcpStream,
    peer: SocketAddr,
    number: u64,
    shared: Arc<Shared>,
    mut admitted: Admitted,
) {
    let _ = socket.set_nodelay(true);
    let opened = Event::Opened {
        connection: number,
        peer: peer.to_string(),
    };
    let report = async |direction, event| shared.reporter.report(Source::Tap, direction, event).await;
    let cuts = admitted.control.borrow().cuts;
    let own = socket.local_addr();
    let set_up = async {
        report(Some(Direction::FromDevice), opened).await;
        // Before it says anything: who it is decides whether what it says counts.
        if let Ok(own) = own
            && let Some(origin) = shared.kin.origin(peer, own).await
        {
            let traced = Event::Traced {
                connection: number,
                origin,
            };
            report(None, traced).await;
        }
        let device = device_side(socket, &shared).await?;
        Ok::<_, SetUpError>((device, broker_side(&shared).await?))
    };
    let sides = tokio::select! {
        sides = set_up => sides,
        _ = cut_after(admitted.control.clone(), cuts) => {
            drop(admitted);
            report(None, Event::Closed { connection: number, how: Close::Harness }).await;
            return;
        }
    };
    let (mut device, mut broker) = match sides {
        Ok(sides) => sides,
        Err(error) => {
            drop(admitted);
            let (event, how) = match error {
                SetUpError::Device(text) => (Event::Note { text }, Close::Harness),
                SetUpError::Broker(text) => (Event::Trouble { text }, Close::Broker),
            };
            report(None, event).await;
            report(
                None,
                Event::Closed {
                    connection: number,
                    how,
                },
            )
            .await;
            return;
        }
    };
    let (end, reported) = run(&mut *device, &mut *broker, number, &shared, &mut admitted, cuts).await;
    let closed = |how| Event::Closed {
        connection: number,
        how,
    };
    match end {
        End::Cut { reset } => {
            drop(broker);
            if reset {
                faults::abort(device.tcp());
                drop(device);
                drop(admitted);
            } else {
                let _ = device.shutdown().await;
                drop(admitted);
                tokio::spawn(drain(device));
            }
            if !reported {
                report(None, closed(Close::Harness)).await;
            }
        }
        End::Broker => {
            drop(admitted);
            if !reported {
                report(Some(Direction::ToDevice), closed(Close::Broker)).await;
            }
            let _ = device.shutdown().await;
            drain(device).await;
        }
        End::Device => {
            drop(admitted);
            // Reading on until the broker closes keeps the system from answering with RST, which could make the
            // broker lose a DISCONNECT it has not read yet.
            let _ = broker.shutdown().await;
            drain(broker).await;
        }
    }
}

/// Pumps both ways until one side has ended or the connection is cut. Also says whether the end was reported.
async fn run(
    device: &mut dyn Socket,
    broker: &mut dyn Stream,
    number: u64,
    shared: &Shared,
    admitted: &mut Admitted,
    cuts: u64,
) -> (End, bool) {
    let both = Both::default();
    let (from_device, to_device) = tokio::io::split(device);
    let (from_broker, to_broker) = tokio::io::split(broker);
    let mut up = Pump::new(shared, &both, number, Direction::FromDevice);
    let mut down = Pump::new(shared, &both, number, Direction::ToDevice);
    let end = tokio::select! {
        biased;
        reset = cut_after(admitted.control.clone(), cuts) => End::Cut { reset },
        () = nobody(&both) => End::Cut { reset: false },
        () = up.run(from_device, to_broker, shared.control.subscribe()) => End::Device,
        () = down.run(from_broker, to_device, shared.control.subscribe()) => End::Broker,
    };
    (end, both.end_reported.load(std::sync::atomic::Ordering::Relaxed))
}

/// Waits until nobody has said for so long who he is; for ever once somebody has.
async fn nobody(both: &Both) {
    tokio::time::sleep(CONNECT_LIMIT).await;
    if both.has_begun() {
        std::future::pending::<()>().await;
    }
}

/// Waits for a cut after the ones that were before this connection; says whether it is by RST.
async fn cut_after(mut control: watch::Receiver<Control>, cuts: u64) -> bool {
    let cut = control
        .wait_for(|control| control.cuts > cuts)
        .await
        .map(|control| control.reset);
    match cut {
        Ok(reset) => reset,
        Err(_) => std::future::pending().await,
    }
}

enum SetUpError {
    Device(String),
    Broker(String),
}

async fn device_side(socket: TcpStream, shared: &Shared) -> Result<Box<dyn Socket>, SetUpError> {
    let Some(tls) = &shared.tls else {
        return Ok(Box::new(socket));
    };
    match tokio::time::timeout(SETUP_LIMIT, tls.accept(socket)).await {
        Ok(Ok(stream)) => Ok(stream),
        Ok(Err(error)) => Err(SetUpError::Device(format!(
            "the TLS handshake with the device failed: {error}"
        ))),
        Err(_) => Err(SetUpError::Device(
            "the device did not finish the TLS handshake".to_owned(),
        )),
    }
}

async fn broker_side(shared: &Shared) -> Result<Box<dyn Stream>, SetUpError> {
    let broker = &shared.upstream.broker;
    let dialled = dial(broker).await;
    dialled.map_err(|reason| SetUpError::Broker(broker.lost(reason).to_string()))
}

/// Reads and forgets until the other side closes, too.
async fn drain(mut socket: impl AsyncRead + Unpin) {
    let mut rest = [0; 4096];
    let _ = tokio::time::timeout(DRAIN_LIMIT, async {
        while socket.read(&mut rest).await.is_ok_and(|length| length > 0) {}
    })
    .await;
}
