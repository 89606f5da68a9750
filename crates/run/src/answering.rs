//! Answers to questions over HTTP, on this machine only: `GET …/question` says what is asked, `POST …/answer` answers it.
//!
//! The address holds a token that nobody can guess, and is told to whoever has started the run. Everything else is refused:
//! another address, another name of this machine, a longer body, an answer to a question that is not open.

use std::net::SocketAddr;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::extract::{Request, State};
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, HOST};
use axum::http::{Method, StatusCode};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use tokio::task::JoinHandle;

use super::person::{Answer, Place};
use super::questions::Board;
use tck_net::bench::secret::Secret;

/// Longest body of an answer, in bytes.
const LONGEST: usize = 1_024;

/// Why questions cannot be answered over HTTP.
#[derive(Debug, thiserror::Error)]
pub enum AnsweringError {
    /// The address is none.
    #[error("`{0}` is no address; write 127.0.0.1:8099, or 127.0.0.1:0 for any free port")]
    Address(String),
    /// The address is one of the network.
    #[error("`{0}` can be reached from other machines, and whoever answers moves a vehicle; write 127.0.0.1:PORT")]
    NotLocal(SocketAddr),
    /// The port cannot be had.
    #[error("cannot listen on {address}: {reason}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        reason: std::io::Error,
    },
}

/// Answers are taken as long as this lives.
#[derive(Debug)]
pub struct Answering {
    url: String,
    serving: JoinHandle<()>,
}

#[derive(Clone)]
struct Shared {
    board: Board,
    token: Secret,
    port: u16,
}

impl Answering {
    /// Listens on an address of this machine.
    ///
    /// # Errors
    /// When the address is none of this machine alone, or its port is taken.
    pub async fn start(listen: &str, board: Board) -> Result<Self, AnsweringError> {
        let address: SocketAddr = listen.parse().map_err(|_| AnsweringError::Address(listen.to_owned()))?;
        if !address.ip().is_loopback() {
            return Err(AnsweringError::NotLocal(address));
        }
        let cannot = |reason| AnsweringError::Listen { address, reason };
        let listener = tokio::net::TcpListener::bind(address).await.map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let token = Secret::draw();
        let url = format!("http://{address}/{}", token.word());
        let shared = Shared {
            board,
            token,
            port: address.port(),
        };
        let router = Router::new().fallback(respond).with_state(shared);
        let serving = tokio::spawn(async move {
            // Without it the terminal still asks.
            let _ = axum::serve(listener, router).await;
        });
        Ok(Self { url, serving })
    }

    /// What `/question` and `/answer` follow.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }
}

impl Drop for Answering {
    fn drop(&mut self) {
        self.serving.abort();
    }
}

async fn respond(State(shared): State<Shared>, request: Request) -> Response {
    if !is_for_this_machine(&request, shared.port) {
        return refusal(StatusCode::FORBIDDEN, "this is served under its own address only");
    }
    let (parts, body) = request.into_parts();
    let path = parts.uri.path().trim_start_matches('/').to_owned();
    let Some((_, what)) = path.split_once('/').filter(|(token, _)| shared.token.is(token)) else {
        return refusal(StatusCode::NOT_FOUND, "there is nothing here");
    };
    match (&parts.method, what) {
        (&Method::GET, "question") => told(StatusCode::OK, &json!({ "question": shared.board.question() })),
        (&Method::POST, "answer") => answer(&shared.board, body).await,
        (_, "question" | "answer") => refusal(StatusCode::METHOD_NOT_ALLOWED, "GET question, POST answer"),
        _ => refusal(StatusCode::NOT_FOUND, "there is `question` and `answer`"),
    }
}

async fn answer(board: &Board, body: Body) -> Response {
    let Ok(bytes) = to_bytes(body, LONGEST).await else {
        return refusal(StatusCode::PAYLOAD_TOO_LARGE, "an answer is shorter");
    };
    let Some((number, answer)) = meant(&bytes) else {
        let form = r#"an answer is {"number": 1, "answer": "done"}, or "skip", or "end""#;
        return refusal(StatusCode::BAD_REQUEST, form);
    };
    if board.answer(number, answer, Place::Http) {
        told(StatusCode::OK, &json!({ "answered": number }))
    } else {
        refusal(StatusCode::CONFLICT, "this question is not open any more")
    }
}

/// The number of a question, and the answer to it.
fn meant(bytes: &[u8]) -> Option<(u64, Answer)> {
    let said: Value = serde_json::from_slice(bytes).ok()?;
    let answer = match said.get("answer")?.as_str()? {
        "done" => Answer::Done,
        "skip" => Answer::Skip,
        "end" => Answer::End,
        _ => return None,
    };
    Some((said.get("number")?.as_u64()?, answer))
}

/// Whether the request names this machine as itself: a page of somebody else that has its own name led here does not.
fn is_for_this_machine(request: &Request, port: u16) -> bool {
    let host = request.headers().get(HOST).and_then(|host| host.to_str().ok());
    let Some((name, given)) = host.and_then(|host| host.rsplit_once(':')) else {
        return false;
    };
    let is_local = name == "localhost"
        || name
            .trim_start_matches('[')
            .trim_end_matches(']')
            .parse::<std::net::IpAddr>()
            .is_ok_and(|ip| ip.is_loopback());
    is_local && given.parse() == Ok(port)
}

fn refusal(status: StatusCode, why: &str) -> Response {
    told(status, &json!({ "error": why }))
}

fn told(status: StatusCode, what: &Value) -> Response {
    let headers = [(CONTENT_TYPE, "application/json"), (CACHE_CONTROL, "no-store")];
    (status, headers, what.to_string()).into_response()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

    use super::*;
    use crate::person::Reply;

    /// Sends bytes and gives status and body of what comes back.
    async fn said(url: &str, request: &str) -> (u16, String) {
        let (host, _) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
        let mut stream = tokio::net::TcpStream::connect(host).await.unwrap();
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = Vec::new();
        let reading = stream.read_to_end(&mut answer);
        tokio::time::timeout(Duration::from_secs(20), reading)
            .await
            .unwrap()
            .unwrap();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
        let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        (status, body.to_owned())
    }

    fn request(method: &str, url: &str, path: &str, host: Option<&str>, body: &str) -> String {
        let (own, token) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
        let path = path.replace("TOKEN", token);
        let host = host.unwrap_or(own);
        format!(
            "{method} {path} HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\ncontent-length: {}\r\n\r\n{body}",
            body.len()
        )
    }

    #[tokio::test]
    async fn a_question_is_read_and_answered() {
        let board = Board::default();
        let answering = Answering::start("127.0.0.1:0", board.clone()).await.unwrap();
        let url = answering.url();
        let ask = request("GET", url, "/TOKEN/question", None, "");
        assert_eq!(said(url, &ask).await, (200, r#"{"question":null}"#.to_owned()));
        board.put_up((Some("a/b".to_owned()), None), "Press \"it\".", Duration::from_secs(30));
        let (status, told) = said(url, &ask).await;
        let told: Value = serde_json::from_str(&told).unwrap();
        assert_eq!((status, &told["question"]["text"]), (200, &json!("Press \"it\".")));
        assert!(told["question"]["secondsLeft"].as_u64().unwrap() > 20);
        let done = request("POST", url, "/TOKEN/answer", None, r#"{"number":1,"answer":"done"}"#);
        assert_eq!(said(url, &done).await.0, 200);
        assert_eq!(board.given(), Some(Reply::from(Answer::Done, Place::Http)));
        assert_eq!(said(url, &done).await.0, 409);
    }

    #[tokio::test]
    async fn what_is_hostile_is_refused() {
        let board = Board::default();
        let answering = Answering::start("127.0.0.1:0", board.clone()).await.unwrap();
        let url = answering.url();
        board.put_up((None, None), "Press it.", Duration::from_secs(30));
        let good = r#"{"number":1,"answer":"done"}"#;
        let long = format!("{}{good}", " ".repeat(LONGEST));
        let deep = "[".repeat(LONGEST - 1);
        for (method, path, host, body, status) in [
            ("GET", "/question", None, "", 404),
            ("GET", "/00000000000000000000000000000000/question", None, "", 404),
            ("POST", "/TOKEN0/answer", None, good, 404),
            ("POST", "/TOKEN/answer/more", None, good, 404),
            ("DELETE", "/TOKEN/answer", None, good, 405),
            ("GET", "/TOKEN/answer", None, "", 405),
            ("POST", "/TOKEN/answer", Some("evil.example:80"), good, 403),
            ("POST", "/TOKEN/answer", Some("localhost"), good, 403),
            ("POST", "/TOKEN/answer", None, "", 400),
            ("POST", "/TOKEN/answer", None, "done", 400),
            ("POST", "/TOKEN/answer", None, r#"{"number":1,"answer":"reboot"}"#, 400),
            ("POST", "/TOKEN/answer", None, r#"{"number":-1,"answer":"done"}"#, 400),
            ("POST", "/TOKEN/answer", None, r#"{"number":2,"answer":"done"}"#, 409),
            ("POST", "/TOKEN/answer", None, &deep, 400),
            ("POST", "/TOKEN/answer", None, &long, 413),
        ] {
            let (got, told) = said(url, &request(method, url, path, host, body)).await;
            assert_eq!(got, status, "{method} {path} {body}: {told}");
        }
        assert_eq!(said(url, "nonsense\r\n\r\n").await.0, 400);
        assert_eq!(board.given(), None);
    }

    #[tokio::test]
    async fn only_this_machine_is_listened_to() {
        for outside in ["0.0.0.0:0", "[::]:0", "192.0.2.1:80"] {
            let refused = Answering::start(outside, Board::default()).await.unwrap_err();
            assert!(matches!(refused, AnsweringError::NotLocal(_)), "{refused}");
        }
        let none = Answering::start("localhost", Board::default()).await.unwrap_err();
        assert!(matches!(none, AnsweringError::Address(_)));
    }
}
