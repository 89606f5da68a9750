//! What a device of the harness has sent, as the journal has it: its messages, and the last will that the broker sends for it.

use std::time::Duration;

use tokio::sync::mpsc;

use tck_base::device::Publication;
use tck_journal::event::{Direction, Event, Payload, Source};
use tck_net::bench::client::{Client, ClientEvent, ClientOptions};
use tck_net::bench::endpoint::Endpoint;
use tck_net::link::mqtt::Reporter;

/// How long a broker may take to publish a last will.
const WILL_LIMIT: Duration = Duration::from_secs(5);

/// A client that listens for a last will.
pub(super) struct Witness {
    client: Client,
    events: mpsc::Receiver<ClientEvent>,
    will: Publication,
    reporter: Reporter,
}

impl Witness {
    /// Listens for the will of the client of that id. It is the broker that sends it, so it counts as sent when it comes.
    pub(super) async fn open(endpoint: &Endpoint, client_id: &str, will: Publication, reporter: Reporter) -> Self {
        let (client, mut events) = Client::open(&ClientOptions {
            endpoint: endpoint.clone(),
            client_id: format!("{client_id}-will"),
            keep_alive: Duration::from_secs(30),
            clean_session: true,
            will: None,
            subscriptions: vec![(will.topic.clone(), 2)],
        });
        let listens = async { while !matches!(events.recv().await, Some(ClientEvent::Connected) | None) {} };
        let _ = tokio::time::timeout(WILL_LIMIT, listens).await;
        Self {
            client,
            events,
            will,
            reporter,
        }
    }

    /// Reports the last will when it comes; what else there is on its topic was published by the device itself.
    pub(super) async fn testify(mut self) {
        let comes = async {
            while let Some(event) = self.events.recv().await {
                match event {
                    ClientEvent::Message { payload, .. } if payload == self.will.payload => return true,
                    ClientEvent::Lost(_) => return false,
                    _ => {}
                }
            }
            false
        };
        if tokio::time::timeout(WILL_LIMIT, comes).await.unwrap_or(false) {
            report(&self.reporter, &self.will).await;
        }
        self.client.disconnect().await;
    }
}

/// Reports what a device of the harness has sent.
pub(super) async fn report(reporter: &Reporter, message: &Publication) {
    let event = Event::Sent {
        topic: message.topic.clone(),
        qos: message.qos,
        retain: message.retain,
        payload: Payload::keep(message.payload.clone()),
    };
    reporter.report(Source::Harness, Some(Direction::ToDevice), event).await;
}
