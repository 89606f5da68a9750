//! The HTTP side of the page: its files, what changes as server-sent events, records, and what a person presses.
//!
//! The address holds a secret. Whoever does not know it is shown nothing, not even that there is a page. The answers forbid the
//! browser to ask anybody else for anything.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes, to_bytes};
use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONNECTION, CONTENT_SECURITY_POLICY, CONTENT_TYPE, LOCATION, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use super::address::reachable;
use super::assets::asset;
use super::desk::{Choice, Desk};
use super::model::Page;
use super::visitors::{Visit, Visitors};
use tck_net::bench::LinkError;
use tck_net::bench::listen::listen_on;
use tck_net::bench::patience::{PatientListener, SecuredListener};
use tck_net::bench::secret::Secret;
use tck_net::bench::secure::TlsServer;
use tck_net::bench::tls::TlsFiles;

/// Longest body of what a person presses, in bytes.
const LONGEST: usize = 1_024;
/// How often a browser is told of changes at most.
const PACE: Duration = Duration::from_millis(150);
/// How long nothing is said at most, so that a browser knows that it still hears.
const HEARTBEAT: Duration = Duration::from_secs(5);
/// How long is waited at the end for browsers that are slow to hear of it.
const GOODBYE: Duration = Duration::from_secs(2);

/// The header that holds the secret where something is done.
const PAGE_SECRET: &str = "x-page-secret";
/// What a browser may do for the page: load its own files, and ask where it came from.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; \
                      form-action 'none'; frame-ancestors 'none'; base-uri 'none'";

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// The port cannot be had.
    #[error(transparent)]
    Listen(LinkError),
    /// The certificate cannot be shown.
    #[error(transparent)]
    Certificate(LinkError),
}

/// The page is served as long as this lives.
pub struct PageServer {
    url: String,
    address: SocketAddr,
    is_secured: bool,
    visitors: Visitors,
    serving: JoinHandle<()>,
}

#[derive(Clone)]
struct Shared {
    page: Page,
    desk: Arc<dyn Desk>,
    visitors: Visitors,
    secret: Secret,
}

impl PageServer {
    /// Listens on an address and serves the page there, over TLS where certificate and key are given.
    ///
    /// # Errors
    /// When the port cannot be had, or the certificate cannot be shown.
    pub async fn start(
        listen: &str,
        certificate: Option<(&Path, &Path)>,
        page: Page,
        desk: Arc<dyn Desk>,
    ) -> Result<Self, PageError> {
        let tls = certificate.map(|(certificate, key)| {
            TlsServer::new(&TlsFiles {
                certificate: certificate.to_owned(),
                key: key.to_owned(),
            })
        });
        let tls = tls.transpose().map_err(PageError::Certificate)?;
        let listener = listen_on(listen).await.map_err(PageError::Listen)?;
        let address = listener.local_addr().map_err(|error| {
            PageError::Listen(LinkError::Listen {
                address: listen.to_owned(),
                reason: error.to_string(),
            })
        })?;
        let secret = Secret::draw();
        let is_secured = tls.is_some();
        let scheme = if is_secured { "https" } else { "http" };
        let url = format!("{scheme}://{}/{}/", reachable(address), secret.word());
        let visitors = Visitors::default();
        let shared = Shared {
            page,
            desk,
            visitors: visitors.clone(),
            secret,
        };
        let router = Router::new().fallback(respond).with_state(shared);
        let serving = tokio::spawn(async move {
            let served = match tls {
                Some(tls) => axum::serve(SecuredListener::new(listener, tls), router).await,
                None => axum::serve(PatientListener::new(listener), router).await,
            };
            if let Err(error) = served {
                tracing::error!(%error, "the page is not served any more");
            }
        });
        Ok(Self {
            url,
            address,
            is_secured,
            visitors,
            serving,
        })
    }

    /// Where the page is, with its secret.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Whether other machines can reach it.
    #[must_use]
    pub fn is_reached_by_others(&self) -> bool {
        !self.address.ip().is_loopback()
    }

    /// Whether it is served over TLS.
    #[must_use]
    pub fn is_secured(&self) -> bool {
        self.is_secured
    }

    /// Waits until every browser has heard how the run ended, and no longer than a moment; then nothing is served any more.
    pub async fn finish(self) {
        let heard = async {
            while self.visitors.count() > 0 {
                tokio::time::sleep(Duration::from_millis(20)).await;
            }
        };
        let _ = tokio::time::timeout(GOODBYE, heard).await;
    }
}

impl Drop for PageServer {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

async fn respond(State(shared): State<Shared>, request: Request) -> Response {
    let mut response = answer(shared, request).await;
    let headers = response.headers_mut();
    for (name, value) in [
        (CONTENT_SECURITY_POLICY, POLICY),
        (REFERRER_POLICY, "no-referrer"),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    headers.insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    response
}

async fn answer(shared: Shared, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let path = parts.uri.path().trim_start_matches('/');
    let (said, what) = match path.split_once('/') {
        Some((said, what)) => (said, Some(what)),
        None => (path, None),
    };
    if !shared.secret.is(said) {
        // Whoever asks in vain keeps no connection.
        let mut refused = refusal(StatusCode::NOT_FOUND, "there is nothing here");
        refused
            .headers_mut()
            .insert(CONNECTION, HeaderValue::from_static("close"));
        return refused;
    }
    let Some(what) = what else {
        let to = format!("/{}/", shared.secret.word());
        return (StatusCode::PERMANENT_REDIRECT, [(LOCATION, to)]).into_response();
    };
    match (&parts.method, what) {
        (&Method::GET, "events") => events(&shared, parts.uri.query().unwrap_or_default()),
        (&Method::POST, "answer" | "stop") if !is_of_the_page(&parts.headers, &shared.secret) => {
            refusal(StatusCode::FORBIDDEN, "only the page itself does that")
        }
        (&Method::POST, "answer") => press(&*shared.desk, body).await,
        (&Method::POST, "stop") => {
            if shared.desk.stop() {
                shared.page.stops();
                told(StatusCode::OK, &json!({ "stops": true }))
            } else {
                refusal(StatusCode::CONFLICT, "there is nothing to stop")
            }
        }
        (&Method::GET, name) => match (asset(name), name.strip_prefix("record/")) {
            (Some(asset), _) => ([(CONTENT_TYPE, asset.kind)], asset.text).into_response(),
            (None, Some(number)) => record(&shared.page, number),
            (None, None) => refusal(StatusCode::NOT_FOUND, "there is nothing here"),
        },
        _ => refusal(
            StatusCode::METHOD_NOT_ALLOWED,
            "GET the page, POST what is pressed on it",
        ),
    }
}

/// Whether a request comes from the page: no page of somebody else can add this header, or say that it is of the same origin.
fn is_of_the_page(headers: &HeaderMap, secret: &Secret) -> bool {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok());
    let knows = text(PAGE_SECRET).is_some_and(|said| secret.is(said));
    let is_same_site = text("sec-fetch-site").is_none_or(|site| site == "same-origin");
    let is_same_origin = text("origin").is_none_or(|origin| {
        let (_, host) = origin.split_once("://").unwrap_or_default();
        text("host") == Some(host)
    });
    knows && is_same_site && is_same_origin
}

async fn press(desk: &dyn Desk, body: Body) -> Response {
    let Ok(bytes) = to_bytes(body, LONGEST).await else {
        return refusal(StatusCode::PAYLOAD_TOO_LARGE, "an answer is shorter");
    };
    let said: Option<Value> = serde_json::from_slice(&bytes).ok();
    let meant = said.and_then(|said| {
        let choice = Choice::of_word(said.get("answer")?.as_str()?)?;
        Some((said.get("number")?.as_u64()?, choice))
    });
    let Some((number, choice)) = meant else {
        let form = r#"an answer is {"number": 1, "answer": "done"}, or "skip", or "end""#;
        return refusal(StatusCode::BAD_REQUEST, form);
    };
    if desk.answer(number, choice) {
        told(StatusCode::OK, &json!({ "answered": number }))
    } else {
        refusal(StatusCode::CONFLICT, "this question is not open any more")
    }
}

fn record(page: &Page, number: &str) -> Response {
    let record = number.parse().ok().and_then(|number| page.record(number));
    match record {
        Some(record) => ([(CONTENT_TYPE, "application/json")], record).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "there is no such record"),
    }
}

/// What a browser has heard.
struct Listening {
    page: Page,
    changes: watch::Receiver<u64>,
    visit: Visit,
    seen: u64,
    is_over: bool,
}

/// Everything at once, and then what changes. A browser that comes again is told everything again: nothing has to be known of
/// what it has heard.
fn events(shared: &Shared, query: &str) -> Response {
    let name = query.strip_prefix("page=").unwrap_or_default();
    let Some(visit) = shared.visitors.enter(name) else {
        return refusal(StatusCode::SERVICE_UNAVAILABLE, "too many pages are open");
    };
    let listening = Listening {
        page: shared.page.clone(),
        changes: shared.page.changes(),
        visit,
        seen: 0,
        is_over: false,
    };
    let all = stream::unfold(listening, |mut listening| async move {
        let text = listening.next().await?;
        Some((Ok::<_, std::convert::Infallible>(Bytes::from(text)), listening))
    });
    let headers = [(CONTENT_TYPE, "text/event-stream"), (CONNECTION, "close")];
    (headers, Body::from_stream(all)).into_response()
}

impl Listening {
    /// The next event, or a sign that there is none; `None` when there will be none any more.
    async fn next(&mut self) -> Option<String> {
        if self.is_over {
            return None;
        }
        if self.seen > 0 {
            tokio::select! {
                () = self.visit.is_replaced() => return None,
                changed = self.changes.wait_for(|change| *change > self.seen) => { changed.ok()?; }
                () = tokio::time::sleep(HEARTBEAT) => return Some("event: alive\ndata: {}\n\n".to_owned()),
            }
            tokio::time::sleep(PACE).await;
        }
        let (change, what, is_over) = self.page.since(self.seen);
        self.seen = change;
        self.is_over = is_over;
        Some(format!("id: {change}\ndata: {what}\n\n"))
    }
}

fn refusal(status: StatusCode, why: &str) -> Response {
    told(status, &json!({ "error": why }))
}

fn told(status: StatusCode, what: &Value) -> Response {
    (status, [(CONTENT_TYPE, "application/json")], what.to_string()).into_response()
}
