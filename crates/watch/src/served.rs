//! The metrics over HTTP: whoever asks gets what is known at that moment.

use std::net::SocketAddr;

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;

use super::metrics::CONTENT_TYPE;
use tck_net::bench::LinkError;
use tck_net::bench::listen::listen_on;
use tck_net::bench::patience::PatientListener;

/// Somebody who wants the page.
pub(super) type Asked = oneshot::Sender<String>;

/// The port that metrics are served on.
pub(super) struct MetricsServer {
    pub address: SocketAddr,
    pub asked: mpsc::Receiver<Asked>,
    serving: JoinHandle<()>,
}

impl MetricsServer {
    /// Opens the port.
    pub async fn start(listen: &str) -> Result<Self, LinkError> {
        let listener = listen_on(listen).await?;
        let address = listener.local_addr().map_err(|error| LinkError::Listen {
            address: listen.to_owned(),
            reason: error.to_string(),
        })?;
        let (sender, asked) = mpsc::channel(16);
        let router = Router::new().route("/metrics", get(metrics)).with_state(sender);
        let serving = tokio::spawn(async move {
            if let Err(error) = axum::serve(PatientListener::new(listener), router).await {
                tracing::error!(%error, "the metrics are not served any more");
            }
        });
        Ok(Self {
            address,
            asked,
            serving,
        })
    }
}

impl Drop for MetricsServer {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

async fn metrics(State(sender): State<mpsc::Sender<Asked>>) -> Response {
    let (answer, page) = oneshot::channel();
    let asked = sender.send(answer).await;
    match page.await {
        Ok(page) if asked.is_ok() => ([(header::CONTENT_TYPE, CONTENT_TYPE)], page).into_response(),
        _ => StatusCode::SERVICE_UNAVAILABLE.into_response(),
    }
}
