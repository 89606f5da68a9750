//! Whether a broker of somebody else takes what the harness publishes, where no tap sees it go on to the device: it comes back
//! to a second connection of the harness.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::timeout;

use super::options::{ANSWER_LIMIT, BenchOptions};
use super::standing::own_client;
use crate::bench::LinkError;
use crate::bench::client::{Client, ClientEvent, REFUSED_SUBSCRIPTION};
use crate::bench::endpoint::Endpoint;
use tck_base::clock::Moment;

/// How long a message may be on its way.
const LIMIT: Duration = Duration::from_secs(5);

/// What comes back.
pub(super) struct Echo {
    heard: mpsc::UnboundedReceiver<String>,
    /// Topics on which something came back.
    proven: BTreeSet<String>,
    /// Until when something has to come back, by topic.
    awaited: BTreeMap<String, Moment>,
}

impl Echo {
    /// Subscribes to what the harness publishes. `None` where the broker does not allow that.
    ///
    /// # Errors
    /// When the broker does not answer.
    pub(super) async fn open(
        endpoint: &Endpoint,
        options: &BenchOptions,
        tasks: &mut JoinSet<()>,
    ) -> Result<Option<Self>, LinkError> {
        let topics = options.harness_topics.iter().cloned();
        let (client, mut events) = Client::open(&own_client(endpoint, &options.own.client("echo"), topics));
        let subscribed = async {
            loop {
                match events.recv().await {
                    Some(ClientEvent::Connected) => return Ok(true),
                    // What is stored from another time.
                    Some(ClientEvent::Message { .. }) => {}
                    Some(ClientEvent::Lost(reason)) if reason.starts_with(REFUSED_SUBSCRIPTION) => return Ok(false),
                    Some(ClientEvent::Lost(reason)) => return Err(endpoint.lost(reason)),
                    None => return Err(endpoint.lost("the connection ended")),
                }
            }
        };
        let subscribed = timeout(ANSWER_LIMIT, subscribed).await;
        if !subscribed.unwrap_or_else(|_| Err(endpoint.lost("it does not answer")))? {
            return Ok(None);
        }
        let (sender, heard) = mpsc::unbounded_channel();
        tasks.spawn(listen(client, events, sender));
        Ok(Some(Self {
            heard,
            proven: BTreeSet::new(),
            awaited: BTreeMap::new(),
        }))
    }

    /// The harness has published something.
    pub(super) fn sent(&mut self, topic: &str, now: Moment) {
        if !self.proven.contains(topic) {
            self.awaited.entry(topic.to_owned()).or_insert(now + LIMIT);
        }
    }

    /// What is late by itself is not held against the broker.
    pub(super) fn wait_again(&mut self, now: Moment) {
        for until in self.awaited.values_mut() {
            *until = (*until).max(now + LIMIT);
        }
    }

    /// The topic of a message that should have come back by now.
    pub(super) fn overdue(&mut self, now: Moment) -> Option<String> {
        loop {
            match self.heard.try_recv() {
                Ok(topic) => {
                    self.awaited.remove(&topic);
                    self.proven.insert(topic);
                }
                Err(mpsc::error::TryRecvError::Empty) => break,
                // Nothing is heard any more, so nothing can be said.
                Err(mpsc::error::TryRecvError::Disconnected) => {
                    self.awaited.clear();
                    break;
                }
            }
        }
        let mut overdue = self.awaited.iter().filter(|(_, until)| now > **until);
        let topic = overdue.next().map(|(topic, _)| topic.clone())?;
        self.awaited.remove(&topic);
        Some(topic)
    }
}

/// Tells on which topics something comes; each once.
async fn listen(client: Client, mut events: mpsc::Receiver<ClientEvent>, heard: mpsc::UnboundedSender<String>) {
    let mut told = BTreeSet::new();
    while let Some(ClientEvent::Message { topic, retain, .. }) = events.recv().await {
        if !retain && told.insert(topic.clone()) && heard.send(topic).is_err() {
            break;
        }
    }
    client.disconnect().await;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echo() -> (mpsc::UnboundedSender<String>, Echo) {
        let (sender, heard) = mpsc::unbounded_channel();
        let echo = Echo {
            heard,
            proven: BTreeSet::new(),
            awaited: BTreeMap::new(),
        };
        (sender, echo)
    }

    const LATER: Moment = Moment::from_micros(6_000_000);

    #[test]
    fn what_never_comes_back_is_named_and_what_came_back_once_is_not_asked_for_again() {
        let (sender, mut echo) = echo();
        echo.sent("a/order", Moment::START);
        assert_eq!(echo.overdue(Moment::START), None);
        assert_eq!(echo.overdue(LATER).as_deref(), Some("a/order"));
        echo.sent("a/order", Moment::START);
        sender.send("a/order".to_owned()).unwrap();
        assert_eq!(echo.overdue(LATER), None);
        echo.sent("a/order", Moment::START);
        assert_eq!(echo.overdue(LATER), None);
    }

    #[test]
    fn a_harness_that_hears_nothing_or_was_late_itself_accuses_no_broker() {
        let (sender, mut deaf) = echo();
        deaf.sent("a/order", Moment::START);
        drop(sender);
        assert_eq!(deaf.overdue(LATER), None);
        let (_sender, mut late) = echo();
        late.sent("a/order", Moment::START);
        late.wait_again(LATER);
        assert_eq!(late.overdue(LATER), None);
    }
}
