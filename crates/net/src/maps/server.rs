//! The HTTP side of the map server.

use std::collections::HashMap;
use std::convert::Infallible;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};

use axum::Router;
use axum::body::Body;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::StatusCode;
use axum::http::header::{CONTENT_LENGTH, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::stream;
use tokio::net::TcpSocket;
use tokio::task::JoinHandle;

use super::{SLOW_TRANSFER, path_of, wrong_bytes};
use crate::bench::inbox::Reporter;
use crate::bench::listen::listen_on;
use crate::bench::patience::{OverTls, PatientListener, SecuredListener};
use crate::bench::secure::TlsServer;
use crate::bench::{LinkError, Offer};
use tck_journal::ServeBehaviour;
use tck_journal::event::{Direction, Event, Source};

/// In how many parts a file is sent.
const PARTS: usize = 20;

/// Files by whether they are served over TLS, and by their paths.
type Offers = Arc<Mutex<HashMap<(bool, String), Offer>>>;

/// A running map server.
pub struct MapServer {
    address: SocketAddr,
    /// Host name in links; the address itself unless said.
    host: Option<String>,
    offers: Offers,
    /// A port that is taken but not listened on, so that connections to it are refused.
    closed: TcpSocket,
    serving: JoinHandle<()>,
}

#[derive(Clone)]
struct Shared {
    offers: Offers,
    reporter: Reporter,
}

impl MapServer {
    /// Opens the port and serves; over TLS as well, where there is a certificate for that. Links name `host`, where the
    /// device knows this machine by another name than the one listened on.
    ///
    /// # Errors
    /// [`LinkError::Listen`] when the port is taken.
    pub(crate) async fn start(
        listen: &str,
        host: Option<&str>,
        tls: Option<TlsServer>,
        reporter: Reporter,
    ) -> Result<Self, LinkError> {
        let cannot = |error: io::Error| LinkError::Listen {
            address: listen.to_owned(),
            reason: error.to_string(),
        };
        let listener = listen_on(listen).await?;
        let address = listener.local_addr().map_err(cannot)?;
        let closed = if address.is_ipv4() {
            TcpSocket::new_v4()
        } else {
            TcpSocket::new_v6()
        }
        .map_err(cannot)?;
        closed.bind(SocketAddr::new(address.ip(), 0)).map_err(cannot)?;
        let offers = Offers::default();
        let shared = Shared {
            offers: offers.clone(),
            reporter,
        };
        let router = Router::new().fallback(answer).with_state(shared);
        let service = router.into_make_service_with_connect_info::<OverTls>();
        let serving = tokio::spawn(async move {
            let ended = match tls {
                Some(tls) => axum::serve(SecuredListener::beside_plain(listener, tls), service).await,
                None => axum::serve(PatientListener::new(listener), service).await,
            };
            if let Err(error) = ended {
                tracing::error!(%error, "the map server has ended");
            }
        });
        Ok(Self {
            address,
            host: host.map(str::to_owned),
            offers,
            closed,
            serving,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Offers a file, in place of an older one of that name; returns its address.
    #[must_use]
    pub fn offer(&self, offer: Offer) -> String {
        let path = path_of(&offer.name);
        let address = match offer.behaviour {
            ServeBehaviour::Unreachable => self.closed.local_addr().unwrap_or(self.address),
            _ => self.address,
        };
        let scheme = if offer.secured { "https" } else { "http" };
        self.offers
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert((offer.secured, path.clone()), offer);
        let host = match &self.host {
            // An IPv6 address stands in brackets.
            Some(host) if host.contains(':') && !host.starts_with('[') => format!("[{host}]:{}", address.port()),
            Some(host) => format!("{host}:{}", address.port()),
            // Whoever asks from this machine reaches it here.
            None if address.ip().is_unspecified() && address.is_ipv4() => format!("127.0.0.1:{}", address.port()),
            None if address.ip().is_unspecified() => format!("[::1]:{}", address.port()),
            None => address.to_string(),
        };
        format!("{scheme}://{host}{path}")
    }

    /// Closes the port.
    pub async fn stop(mut self) {
        self.serving.abort();
        let _ = (&mut self.serving).await;
    }
}

impl Drop for MapServer {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

/// Reports the phases of one request; a request that is given up before its end is reported as cut.
struct Watch {
    reporter: Reporter,
    name: String,
    request: String,
    status: Option<u16>,
    ended: bool,
}

impl Watch {
    async fn phase(&mut self, phase: &str) {
        self.ended |= phase != "begun";
        let event = self.event(phase);
        self.reporter
            .report(Source::Maps, Some(Direction::FromDevice), event)
            .await;
    }

    fn event(&self, phase: &str) -> Event {
        Event::Fetched {
            name: self.name.clone(),
            request: self.request.clone(),
            status: self.status,
            phase: phase.to_owned(),
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        if self.ended {
            return;
        }
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            let (reporter, event) = (self.reporter.clone(), self.event("cut"));
            runtime.spawn(async move { reporter.report(Source::Maps, Some(Direction::FromDevice), event).await });
        }
    }
}

async fn answer(
    State(shared): State<Shared>,
    ConnectInfo(OverTls(secured)): ConnectInfo<OverTls>,
    request: Request,
) -> Result<Response, Infallible> {
    let path = request.uri().path().to_owned();
    let offer = shared
        .offers
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .get(&(secured, path.clone()))
        .cloned();
    let mut watch = Watch {
        reporter: shared.reporter,
        name: offer.as_ref().map(|offer| offer.name.clone()).unwrap_or_default(),
        request: format!("{} {path}", request.method()),
        status: None,
        ended: false,
    };
    let offer = match offer {
        Some(offer) if offer.behaviour != ServeBehaviour::NotFound => offer,
        _ => {
            watch.status = Some(404);
            watch.phase("done").await;
            return Ok(StatusCode::NOT_FOUND.into_response());
        }
    };
    if offer.behaviour == ServeBehaviour::Stall {
        watch.phase("begun").await;
        let () = std::future::pending().await;
    }
    watch.status = Some(200);
    watch.phase("begun").await;
    let body = match offer.behaviour {
        ServeBehaviour::WrongBytes => wrong_bytes(&offer.body),
        _ => offer.body,
    };
    let length = body.len();
    let transfer = Transfer {
        watch,
        body,
        sent: 0,
        behaviour: offer.behaviour,
    };
    let headers = [
        (CONTENT_TYPE, "application/octet-stream".to_owned()),
        (CONTENT_LENGTH, length.to_string()),
    ];
    Ok((headers, Body::from_stream(stream::unfold(transfer, part))).into_response())
}

struct Transfer {
    watch: Watch,
    body: Bytes,
    sent: usize,
    behaviour: ServeBehaviour,
}

/// Sends the next part of a file.
async fn part(mut transfer: Transfer) -> Option<(io::Result<Bytes>, Transfer)> {
    let length = transfer.body.len();
    if transfer.watch.ended {
        return None;
    }
    if transfer.behaviour == ServeBehaviour::Cut && transfer.sent >= length / 2 {
        // What was sent so far shall arrive before the connection breaks off.
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        transfer.watch.phase("cut").await;
        return Some((Err(io::Error::other("cut")), transfer));
    }
    let end = match transfer.behaviour {
        ServeBehaviour::Cut => length / 2,
        _ => length.min(transfer.sent + length.div_ceil(PARTS).max(1)),
    };
    if transfer.behaviour == ServeBehaviour::Slow {
        let parts = u32::try_from(PARTS.min(length.max(1))).unwrap_or(1);
        tokio::time::sleep(SLOW_TRANSFER / parts).await;
    }
    let chunk = transfer.body.slice(transfer.sent..end);
    transfer.sent = end;
    if transfer.sent == length {
        transfer.watch.phase("done").await;
    }
    Some((Ok(chunk), transfer))
}
