//! Nothing of the harness stays on a broker of somebody else: what is retained there in its name is cleared.

use std::time::Duration;

use bytes::Bytes;
use tokio::time::{Instant, timeout_at};

use super::LinkError;
use super::client::{Client, ClientEvent, ClientOptions};
use super::endpoint::Endpoint;
use tck_base::device::Publication;

/// How long the broker may take to let the harness in; the topics of a big fleet take some brokers long.
const ANSWER_LIMIT: Duration = Duration::from_secs(30);
/// After so long without a stored message there is none left.
const PATIENCE: Duration = Duration::from_millis(500);
/// How long it looks at most.
const LIMIT: Duration = Duration::from_secs(10);

/// Clears the retained messages on topics that match `filters` and are the harness's own, and names these topics.
///
/// # Errors
/// When the broker does not let it look, or goes.
pub async fn clear(
    endpoint: &Endpoint,
    client_id: String,
    filters: Vec<String>,
    is_own: impl Fn(&str) -> bool,
) -> Result<Vec<String>, LinkError> {
    let (client, mut events) = Client::open(&ClientOptions {
        endpoint: endpoint.clone(),
        client_id,
        keep_alive: Duration::from_secs(30),
        clean_session: true,
        will: None,
        subscriptions: filters.into_iter().map(|filter| (filter, 1)).collect(),
    });
    let begun = Instant::now();
    let (mut is_in, mut until) = (false, begun + ANSWER_LIMIT);
    let mut cleared = Vec::new();
    loop {
        match timeout_at(until.min(begun + ANSWER_LIMIT + LIMIT), events.recv()).await {
            Ok(Some(ClientEvent::Connected)) => {
                is_in = true;
                until = Instant::now() + PATIENCE;
            }
            Ok(Some(ClientEvent::Message {
                topic,
                payload,
                retain: true,
                ..
            })) => {
                if is_in {
                    until = Instant::now() + PATIENCE;
                }
                if payload.is_empty() || !is_own(&topic) {
                    continue;
                }
                let nothing = Publication {
                    topic: topic.clone(),
                    payload: Bytes::new(),
                    qos: 1,
                    retain: true,
                };
                if !client.publish(nothing) {
                    return Err(endpoint.lost("the connection ended"));
                }
                cleared.push(topic);
            }
            // What is said there now.
            Ok(Some(ClientEvent::Message { .. })) => {}
            Ok(Some(ClientEvent::Lost(reason))) => return Err(endpoint.lost(reason)),
            Ok(None) => return Err(endpoint.lost("the connection ended")),
            Err(_) if is_in => break,
            Err(_) => return Err(endpoint.lost("it does not answer")),
        }
    }
    client.disconnect().await;
    cleared.sort();
    Ok(cleared)
}
