//! Hooks over HTTP: what a person would do at a simulated device, for scripts and for harnesses.
//!
//! `GET /` lists them; `POST /hooks/NAME` with a JSON object of parameters does one, and answers once the device
//! has it: 204, or 409 with the reason where the device does not do it.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use axum::body::to_bytes;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::routing::{get, post};
use serde_json::{Map, Value};
use tokio::sync::Mutex;
use tokio::task::JoinHandle;

use super::driver::RunningDevice;
use tck_base::device::Commanded;
use tck_net::bench::LinkError;
use tck_net::bench::listen::listen_on;
use tck_net::bench::patience::PatientListener;

/// No parameters need more.
const LARGEST_BODY: usize = 64 << 10;

/// A device and the port its hooks are served on.
pub struct HookServer {
    address: SocketAddr,
    hooks: Hooks,
    serving: JoinHandle<()>,
}

#[derive(Clone)]
struct Hooks {
    known: &'static [&'static str],
    /// Gone once the device is being ended.
    device: Arc<Mutex<Option<RunningDevice>>>,
}

type Answer = (StatusCode, String);

impl HookServer {
    /// Opens the port and serves these hooks as commands of the device.
    ///
    /// # Errors
    /// [`LinkError::Listen`] when the port cannot be opened.
    pub async fn start(listen: &str, device: RunningDevice, known: &'static [&'static str]) -> Result<Self, LinkError> {
        let listener = listen_on(listen).await?;
        let address = listener.local_addr().map_err(|error| LinkError::Listen {
            address: listen.to_owned(),
            reason: error.to_string(),
        })?;
        let hooks = Hooks {
            known,
            device: Arc::new(Mutex::new(Some(device))),
        };
        let router = Router::new()
            .route("/", get(list))
            .route("/hooks/{name}", post(carry_out))
            .fallback(nowhere)
            .with_state(hooks.clone());
        let serving = tokio::spawn(async move {
            if let Err(error) = axum::serve(PatientListener::new(listener), router).await {
                tracing::error!(%error, "the hooks are not served any more");
            }
        });
        Ok(Self {
            address,
            hooks,
            serving,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Closes the port, and gives the device back.
    pub async fn stop(self) -> Option<RunningDevice> {
        self.serving.abort();
        self.hooks.device.lock().await.take()
    }
}

impl Hooks {
    fn list(&self) -> String {
        let lines = self.known.iter().map(|name| format!("POST /hooks/{name}\n"));
        lines.collect()
    }

    async fn carry_out(&self, name: &str, request: Request) -> Answer {
        if !self.known.contains(&name) {
            let text = format!("there is no hook `{name}`; there are these:\n{}", self.list());
            return (StatusCode::NOT_FOUND, text);
        }
        let Ok(body) = to_bytes(request.into_body(), LARGEST_BODY).await else {
            let text = format!("the body cannot be read, or has more than {LARGEST_BODY} bytes\n");
            return (StatusCode::PAYLOAD_TOO_LARGE, text);
        };
        let parameters = match parameters(&body) {
            Ok(parameters) => parameters,
            Err(why) => return (StatusCode::BAD_REQUEST, format!("{why}\n")),
        };
        let device = self.device.lock().await;
        let commanded = match device.as_ref() {
            Some(device) => device.ask(name, Value::Object(parameters)).await,
            None => Commanded::Nobody,
        };
        match commanded {
            Commanded::Taken => (StatusCode::NO_CONTENT, String::new()),
            Commanded::Declined(why) => (StatusCode::CONFLICT, format!("{why}\n")),
            Commanded::Nobody => (
                StatusCode::SERVICE_UNAVAILABLE,
                "the device is not running any more\n".to_owned(),
            ),
        }
    }
}

async fn list(State(hooks): State<Hooks>) -> String {
    hooks.list()
}

async fn carry_out(State(hooks): State<Hooks>, Path(name): Path<String>, request: Request) -> Answer {
    if is_of_a_page(request.headers()) {
        let text = "a page in a browser may not act on the device\n".to_owned();
        return (StatusCode::FORBIDDEN, text);
    }
    hooks.carry_out(&name, request).await
}

async fn nowhere(State(hooks): State<Hooks>) -> Answer {
    let text = format!("there is nothing here; there are these hooks:\n{}", hooks.list());
    (StatusCode::NOT_FOUND, text)
}

/// Whether a page in a browser asks: any page that is open somewhere could act on the device otherwise. A browser says where
/// each POST comes from, and a script does not.
fn is_of_a_page(headers: &HeaderMap) -> bool {
    headers.contains_key(header::ORIGIN) || headers.contains_key("sec-fetch-site")
}

/// The parameters in a body: an object, in which an empty text is a parameter that is not there. A template of a
/// profile names every parameter, and leaves empty what a test does not hand over.
fn parameters(body: &[u8]) -> Result<Map<String, Value>, String> {
    if body.trim_ascii().is_empty() {
        return Ok(Map::new());
    }
    match serde_json::from_slice(body) {
        Ok(Value::Object(mut all)) => {
            all.retain(|_, value| !value.is_null() && value.as_str() != Some(""));
            Ok(all)
        }
        Ok(_) => Err("the parameters are not a JSON object".to_owned()),
        Err(error) => Err(format!("the parameters are not JSON: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_text_is_a_parameter_that_is_not_there() {
        let all = parameters(br#"{"to": "n1", "from": "", "x": 0, "action": null}"#);
        assert_eq!(Value::Object(all.unwrap()), serde_json::json!({"to": "n1", "x": 0}));
        assert_eq!(parameters(b" \n"), Ok(Map::new()));
    }

    #[test]
    fn a_page_in_a_browser_is_told_from_a_script() {
        let with = |name: &'static str, value: &'static str| {
            let mut headers = HeaderMap::new();
            headers.insert(name, axum::http::HeaderValue::from_static(value));
            is_of_a_page(&headers)
        };
        assert!(with("origin", "http://elsewhere") && with("origin", "null") && with("sec-fetch-site", "cross-site"));
        assert!(!with("user-agent", "curl/8.0") && !with("content-type", "application/json"));
    }

    #[test]
    fn what_is_no_object_is_refused() {
        assert_eq!(
            parameters(b"[]"),
            Err("the parameters are not a JSON object".to_owned())
        );
        assert!(
            parameters(b"{")
                .unwrap_err()
                .starts_with("the parameters are not JSON: ")
        );
    }
}
