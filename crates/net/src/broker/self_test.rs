//! Does this broker keep MQTT's rules where verdicts depend on them? Asked before a device is judged.

use std::collections::VecDeque;
use std::time::Duration;

use bytes::Bytes;
use tokio::sync::mpsc;
use tokio::time::timeout;

use crate::bench::LinkError;
use crate::bench::client::{Client, ClientEvent, ClientOptions, REFUSED_SUBSCRIPTION};
use crate::bench::endpoint::Endpoint;
use crate::bench::own::OwnNames;
use tck_base::device::Publication;

/// How long each message may take.
const LIMIT: Duration = Duration::from_secs(5);

/// What a self-test found out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tested {
    /// The broker keeps the rules.
    Keeps,
    /// It does not let the harness use topics of its own, so that nothing could be tested.
    Forbids(String),
}

/// Tests QoS, retained messages and wills of a broker, on topics of its own that are cleaned up afterwards.
///
/// # Errors
/// [`LinkError::Broker`] when it cannot be reached, [`LinkError::Setup`] naming the rule it breaks.
pub async fn self_test(endpoint: &Endpoint, own: &OwnNames) -> Result<Tested, LinkError> {
    let base = format!("{}/self-test/{}", own.topics, uuid::Uuid::new_v4().simple());
    let mut watcher = match Tester::connect((endpoint, own), "watcher", None, vec![(format!("{base}/#"), 2)]).await {
        Err(LinkError::Broker { reason, .. }) if reason.starts_with(REFUSED_SUBSCRIPTION) => {
            return Ok(Tested::Forbids(format!("the subscription to {base}/#")));
        }
        watcher => watcher?,
    };
    let result = check((endpoint, own), &base, &mut watcher).await;
    if !matches!(result, Ok(Tested::Forbids(_))) {
        // Whatever came out of it, nothing stays behind on the broker.
        for name in ["retained", "will"] {
            watcher.publish(message(&format!("{base}/{name}"), "", 1, true))?;
            // Who leaves while something still comes resets the connection, and what was sent last is lost.
            let _ = watcher.message("what clears a topic").await;
        }
    }
    watcher.client.disconnect().await;
    result
}

async fn check(
    (endpoint, own): (&Endpoint, &OwnNames),
    base: &str,
    watcher: &mut Tester<'_>,
) -> Result<Tested, LinkError> {
    let topic = format!("{base}/qos");
    if !watcher.is_heard(&topic).await? {
        return Ok(Tested::Forbids(format!(
            "messages of client {} on {topic}",
            watcher.client_id
        )));
    }
    for qos in 0..=2 {
        watcher.publish(message(&topic, "x", qos, false))?;
        let got = watcher.message(&format!("a message published with QoS {qos}")).await?;
        if got.qos != qos {
            return Err(broken(
                endpoint,
                &format!("a message published with QoS {qos} arrives with QoS {}", got.qos),
            ));
        }
    }
    let topic = format!("{base}/retained");
    watcher.publish(message(&topic, "old", 1, true))?;
    let live = watcher.message("a retained message").await?;
    if live.retain {
        return Err(broken(endpoint, "a live delivery of a retained message has RETAIN set"));
    }
    watcher.publish(message(&topic, "new", 1, true))?;
    watcher.message("a second retained message").await?;
    let mut fresh = Tester::connect((endpoint, own), "fresh", None, vec![(topic.clone(), 2)]).await?;
    let stored = fresh.message("the stored message for a fresh subscriber").await?;
    if !stored.retain || stored.qos != 1 || stored.payload != "new" {
        let text = format!(
            "a fresh subscriber gets `{}` with QoS {} and RETAIN {}, not the last message with QoS 1 and RETAIN set",
            stored.payload.escape_debug(),
            stored.qos,
            stored.retain
        );
        return Err(broken(endpoint, &text));
    }
    fresh.client.disconnect().await;
    let topic = format!("{base}/will");
    let orderly = Tester::connect(
        (endpoint, own),
        "orderly",
        Some(message(&topic, "orderly", 1, true)),
        vec![],
    )
    .await?;
    orderly.client.disconnect().await;
    let gone = Tester::connect((endpoint, own), "gone", Some(message(&topic, "gone", 1, true)), vec![]).await?;
    drop(gone);
    let will = watcher.message("the last will of a connection that broke off").await?;
    if will.payload != "gone" {
        return Err(broken(endpoint, "a last will is published after DISCONNECT"));
    }
    if will.qos != 1 {
        return Err(broken(
            endpoint,
            &format!("a last will with QoS 1 arrives with QoS {}", will.qos),
        ));
    }
    Ok(Tested::Keeps)
}

struct Tester<'a> {
    endpoint: &'a Endpoint,
    client_id: String,
    client: Client,
    events: mpsc::Receiver<ClientEvent>,
    early: VecDeque<Got>,
}

struct Got {
    payload: String,
    qos: u8,
    retain: bool,
}

impl Got {
    fn new(payload: &[u8], qos: u8, retain: bool) -> Self {
        Self {
            payload: String::from_utf8_lossy(payload).into_owned(),
            qos,
            retain,
        }
    }
}

impl<'a> Tester<'a> {
    async fn connect(
        (endpoint, own): (&'a Endpoint, &OwnNames),
        name: &str,
        will: Option<Publication>,
        subscriptions: Vec<(String, u8)>,
    ) -> Result<Self, LinkError> {
        let client_id = own.client(name);
        let (client, events) = Client::open(&ClientOptions {
            endpoint: endpoint.clone(),
            client_id: client_id.clone(),
            keep_alive: Duration::from_secs(30),
            clean_session: true,
            will,
            subscriptions,
        });
        let mut tester = Self {
            endpoint,
            client_id,
            client,
            events,
            early: VecDeque::new(),
        };
        loop {
            match timeout(LIMIT, tester.events.recv()).await {
                Ok(Some(ClientEvent::Connected)) => return Ok(tester),
                // A stored message may come before the acknowledgement.
                Ok(Some(ClientEvent::Message {
                    payload, qos, retain, ..
                })) => {
                    tester.early.push_back(Got::new(&payload, qos, retain));
                }
                Ok(Some(ClientEvent::Lost(reason))) => return Err(endpoint.lost(reason)),
                Ok(None) => return Err(endpoint.lost("the connection ended")),
                Err(_) => return Err(endpoint.lost("it does not answer")),
            }
        }
    }

    fn publish(&self, message: Publication) -> Result<(), LinkError> {
        if self.client.publish(message) {
            Ok(())
        } else {
            Err(self.endpoint.lost("the connection ended"))
        }
    }

    /// Whether a message comes back at all. A broker with access rules drops what it does not allow without a word.
    async fn is_heard(&mut self, topic: &str) -> Result<bool, LinkError> {
        self.publish(message(topic, "is anybody there?", 1, false))?;
        match timeout(LIMIT, self.events.recv()).await {
            Ok(Some(ClientEvent::Message { .. })) => Ok(true),
            Ok(Some(ClientEvent::Lost(reason))) => Err(self.endpoint.lost(reason)),
            Ok(Some(ClientEvent::Connected) | None) => Err(self.endpoint.lost("the connection ended")),
            Err(_) => Ok(false),
        }
    }

    async fn message(&mut self, what: &str) -> Result<Got, LinkError> {
        if let Some(early) = self.early.pop_front() {
            return Ok(early);
        }
        match timeout(LIMIT, self.events.recv()).await {
            Ok(Some(ClientEvent::Message {
                payload, qos, retain, ..
            })) => Ok(Got::new(&payload, qos, retain)),
            Ok(Some(ClientEvent::Lost(reason))) => Err(broken(
                self.endpoint,
                &format!("it ends the connection where {what} should arrive ({reason})"),
            )),
            Ok(Some(ClientEvent::Connected) | None) => Err(self.endpoint.lost("the connection ended")),
            Err(_) => Err(broken(self.endpoint, &format!("{what} never arrives"))),
        }
    }
}

fn message(topic: &str, text: &str, qos: u8, retain: bool) -> Publication {
    Publication {
        topic: topic.to_owned(),
        payload: Bytes::copy_from_slice(text.as_bytes()),
        qos,
        retain,
    }
}

fn broken(endpoint: &Endpoint, what: &str) -> LinkError {
    LinkError::Setup(format!(
        "the broker at {} cannot be used to judge a device: {what}",
        endpoint.url()
    ))
}
