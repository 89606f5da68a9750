//! MQTT over WebSocket: the bytes of a connection in binary messages, as MQTT 3.1.1 and 5 have it in their sixth chapter.

use bytes::Bytes;
use futures_util::{SinkExt as _, StreamExt as _};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest as _;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Error, Message};

use super::endpoint::Endpoint;
use super::stream::Stream;

/// Largest message taken; a broker may put several packets into one.
const LARGEST_MESSAGE: usize = 256 << 20;
/// How many bytes are on their way between the two sides.
const ROOM: usize = 64 << 10;

/// Asks the broker for a WebSocket with MQTT in it.
///
/// # Errors
/// Why there is none, as the end of a sentence about the broker.
pub(super) async fn open(stream: Box<dyn Stream>, endpoint: &Endpoint, path: &str) -> Result<DuplexStream, String> {
    let scheme = if endpoint.tls.is_some() { "wss" } else { "ws" };
    let url = format!("{scheme}://{}{path}", endpoint.address());
    let mut request = url.into_client_request().map_err(|error| error.to_string())?;
    request
        .headers_mut()
        .insert("Sec-WebSocket-Protocol", HeaderValue::from_static("mqtt"));
    let config = WebSocketConfig::default()
        .max_message_size(Some(LARGEST_MESSAGE))
        .max_frame_size(Some(LARGEST_MESSAGE));
    let opened = tokio_tungstenite::client_async_with_config(request, stream, Some(config)).await;
    let (socket, _) = opened.map_err(|error| refused(&error, path))?;
    let (near, far) = tokio::io::duplex(ROOM);
    tokio::spawn(carry(socket, far));
    Ok(near)
}

fn refused(error: &Error, path: &str) -> String {
    // The query of the path may hold a token.
    let path = path.split('?').next().unwrap_or(path);
    match error {
        Error::Http(answer) => format!(
            "it answers {} where a WebSocket is asked for at the path {path}; the path belongs into the URL",
            answer.status()
        ),
        other => format!("it does not open a WebSocket at the path {path} ({other}); without WebSocket it is mqtt://"),
    }
}

/// Carries bytes until one side ends.
async fn carry(socket: WebSocketStream<Box<dyn Stream>>, far: DuplexStream) {
    let (mut to_broker, mut from_broker) = socket.split();
    let (mut from_client, mut to_client) = tokio::io::split(far);
    let up = async {
        let mut part = vec![0; ROOM];
        while let Ok(length @ 1..) = from_client.read(&mut part).await {
            let message = Message::binary(Bytes::copy_from_slice(&part[..length]));
            if to_broker.send(message).await.is_err() {
                return;
            }
        }
        let _ = to_broker.close().await;
    };
    let down = async {
        while let Some(Ok(message)) = from_broker.next().await {
            match message {
                Message::Binary(bytes) if to_client.write_all(&bytes).await.is_err() => return,
                Message::Close(_) | Message::Text(_) => break,
                _ => {}
            }
        }
        let _ = to_client.shutdown().await;
    };
    // The last bytes of one side may be on their way when the other ends: both are carried to their end.
    tokio::join!(up, down);
}
