//! A subscriber that comes back whenever its connection is lost.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};

use tck_net::bench::client::{Client, ClientEvent, ClientOptions};
use tck_net::bench::endpoint::Endpoint;

/// How long it waits before it comes back, at first and at most.
const PAUSE: (Duration, Duration) = (Duration::from_millis(500), Duration::from_secs(30));
const KEEP_ALIVE: Duration = Duration::from_secs(30);

/// A subscriber that comes back whenever its connection is lost.
pub(super) struct Listener {
    options: ClientOptions,
    open: Option<(Client, mpsc::Receiver<ClientEvent>)>,
    pause: Duration,
    again: Instant,
}

impl Listener {
    /// Begins to connect as soon as it is asked for what comes.
    pub fn new(endpoint: Endpoint, filters: &[String]) -> Self {
        let made_up = || format!("tck-watch-{}", &uuid::Uuid::new_v4().simple().to_string()[..8]);
        Self {
            options: ClientOptions {
                client_id: endpoint.client_id.clone().unwrap_or_else(made_up),
                endpoint,
                keep_alive: KEEP_ALIVE,
                clean_session: true,
                will: None,
                // The quality a message was published with is that of its delivery.
                subscriptions: filters.iter().map(|filter| (filter.clone(), 2)).collect(),
            },
            open: None,
            pause: PAUSE.0,
            again: Instant::now(),
        }
    }

    /// What happens next. Cancel-safe.
    pub async fn next(&mut self) -> ClientEvent {
        let events = match &mut self.open {
            Some((_, events)) => events,
            None => {
                sleep_until(self.again).await;
                &mut self.open.insert(Client::open(&self.options)).1
            }
        };
        let event = events.recv().await;
        match event {
            Some(ClientEvent::Lost(why)) => self.lost(why),
            None => self.lost("the connection ended".to_owned()),
            Some(event) => {
                if event == ClientEvent::Connected {
                    self.pause = PAUSE.0;
                }
                event
            }
        }
    }

    /// Signs off.
    pub async fn stop(self) {
        if let Some((client, _)) = self.open {
            client.disconnect().await;
        }
    }

    fn lost(&mut self, why: String) -> ClientEvent {
        self.open = None;
        self.again = Instant::now() + self.pause;
        self.pause = (self.pause * 2).min(PAUSE.1);
        ClientEvent::Lost(why)
    }
}
