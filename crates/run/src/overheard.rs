//! What a vehicle has left at its broker before a run: its factsheet, which says what it can do. Nothing is published.

use std::time::Duration;

use super::sheet::Sheet;
use tck_net::bench::client::{Client, ClientEvent, ClientOptions};
use tck_net::bench::endpoint::Endpoint;
use tck_view::Names;

/// How long the broker may take to let the harness in.
const ENTRY_LIMIT: Duration = Duration::from_secs(3);
/// How long a stored message may take.
const PATIENCE: Duration = Duration::from_millis(500);

/// What there is at the broker.
#[derive(Clone, Debug)]
pub enum Overheard {
    /// This factsheet.
    Factsheet(Sheet),
    /// The broker keeps none.
    Nothing,
    /// Nobody can say; why, as the end of a sentence.
    Unknown(String),
}

impl Overheard {
    /// One sentence about it.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Factsheet(sheet) => {
                let series = sheet.series().unwrap_or("a series without a name");
                format!("the factsheet that the broker keeps, of {series}")
            }
            Self::Nothing => "the broker keeps no factsheet of the vehicle".to_owned(),
            Self::Unknown(why) => format!("nobody has looked whether the broker keeps a factsheet: {why}"),
        }
    }
}

/// Looks whether the broker keeps a factsheet on this topic.
pub(super) async fn overhear(endpoint: Endpoint, client_id: String, topic: &str, names: &Names) -> Overheard {
    let (client, mut events) = Client::open(&ClientOptions {
        endpoint: endpoint.clone(),
        client_id,
        keep_alive: Duration::from_secs(30),
        clean_session: true,
        will: None,
        subscriptions: vec![(topic.to_owned(), 1)],
    });
    let heard = async {
        let mut until = tokio::time::Instant::now() + ENTRY_LIMIT;
        let mut is_in = false;
        loop {
            match tokio::time::timeout_at(until, events.recv()).await {
                Ok(Some(ClientEvent::Connected)) => {
                    is_in = true;
                    until = tokio::time::Instant::now() + PATIENCE;
                }
                Ok(Some(ClientEvent::Message { payload, .. })) => {
                    return match serde_json::from_slice(&payload) {
                        Ok(message) => Overheard::Factsheet(Sheet::read(&message, names)),
                        Err(_) => Overheard::Unknown("what it keeps is no JSON".to_owned()),
                    };
                }
                Ok(Some(ClientEvent::Lost(why))) => return Overheard::Unknown(endpoint.lost(why).to_string()),
                Ok(None) => return Overheard::Unknown(endpoint.lost("the connection ended").to_string()),
                Err(_) if is_in => return Overheard::Nothing,
                Err(_) => return Overheard::Unknown(endpoint.lost("it does not answer").to_string()),
            }
        }
    };
    let heard = heard.await;
    client.disconnect().await;
    heard
}
