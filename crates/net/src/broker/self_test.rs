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

use super::difference::Difference;

/// How long a client may wait to be let in: a broker may be busy with the thousands of a fleet that begins.
const ENTRY: Duration = Duration::from_secs(30);
/// How long each message may take.
const LIMIT: Duration = Duration::from_secs(5);
/// How long what is stored may come after what was published behind the subscription.
const BEHIND: Duration = Duration::from_millis(500);
/// How often another node is asked: it may learn of a stored message a little later, and may end a connection while the nodes wait
/// for each other.
const LOOKS: u32 = 3;

/// What a self-test found out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Tested {
    /// The broker keeps the rules that verdicts depend on; in this it differs from what others do.
    Keeps(Vec<Difference>),
    /// It does not let the harness use topics of its own, so that nothing could be tested.
    Forbids(String),
}

/// Tests QoS, retained messages and wills of a broker, and what other nodes of its cluster know of them, on topics of its own
/// that are cleaned up afterwards.
///
/// # Errors
/// [`LinkError::Broker`] when it cannot be reached, [`LinkError::Setup`] naming the rule it breaks.
pub async fn self_test(endpoint: &Endpoint, nodes: &[Endpoint], own: &OwnNames) -> Result<Tested, LinkError> {
    let base = format!("{}/self-test/{}", own.topics, uuid::Uuid::new_v4().simple());
    let mut watcher = match Tester::connect((endpoint, own), "watcher", None, vec![(format!("{base}/#"), 2)]).await {
        Err(LinkError::Broker { reason, .. }) if reason.starts_with(REFUSED_SUBSCRIPTION) => {
            return Ok(Tested::Forbids(format!("the subscription to {base}/#")));
        }
        watcher => watcher?,
    };
    let result = check((endpoint, own), nodes, &base, &mut watcher).await;
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
    nodes: &[Endpoint],
    base: &str,
    watcher: &mut Tester<'_>,
) -> Result<Tested, LinkError> {
    let mut differences = Vec::new();
    let topic = format!("{base}/qos");
    if !watcher.is_heard(&topic).await? {
        return Ok(Tested::Forbids(format!(
            "messages of client {} on {topic}",
            watcher.client_id
        )));
    }
    for qos in 0..=1 {
        watcher.publish(message(&topic, "x", qos, false))?;
        let got = watcher.message(&format!("a message published with QoS {qos}")).await?;
        if got.qos != qos {
            return Err(broken(
                endpoint,
                &format!("a message published with QoS {qos} arrives with QoS {}", got.qos),
            ));
        }
    }
    // Neither is needed by the devices that are judged, so that a broker may do without.
    let (to, sent) = (format!("{base}/twice"), 2);
    match passed_on((endpoint, own), watcher, message(&to, "x", sent, false)).await? {
        None => differences.push(Difference::RefusesQos2),
        Some(got) if got.qos == sent => {}
        Some(got) => differences.push(Difference::LowersQos2(got.qos)),
    }
    let to = format!("{base}/with.dot");
    match passed_on((endpoint, own), watcher, message(&to, "x", 1, false)).await? {
        None => differences.push(Difference::RefusesDots),
        Some(got) if got.topic == to => {}
        Some(_) => differences.push(Difference::ChangesDots),
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
    let got = fresh.message("the stored message for a fresh subscriber").await?;
    if !got.retain || got.qos != 1 || got.payload != "new" {
        let text = format!(
            "a fresh subscriber gets `{}` with QoS {} and RETAIN {}, not the last message with QoS 1 and RETAIN set",
            got.payload.escape_debug(),
            got.qos,
            got.retain
        );
        return Err(broken(endpoint, &text));
    }
    fresh.client.disconnect().await;
    if stored((endpoint, own), watcher, base, "+").await?.is_none() {
        differences.push(Difference::KeepsFromWildcards);
    }
    for node in nodes {
        differences.extend(elsewhere((node, own), watcher, base).await?);
    }
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
    let will = watcher
        .message_on(&topic, "the last will of a connection that broke off")
        .await?;
    if will.payload != "gone" {
        return Err(broken(endpoint, "a last will is published after DISCONNECT"));
    }
    if will.qos != 1 {
        return Err(broken(
            endpoint,
            &format!("a last will with QoS 1 arrives with QoS {}", will.qos),
        ));
    }
    Ok(Tested::Keeps(differences))
}

/// How a message of another client arrives; `None` when its connection is ended for it.
async fn passed_on(
    at: (&Endpoint, &OwnNames),
    watcher: &mut Tester<'_>,
    message: Publication,
) -> Result<Option<Got>, LinkError> {
    let mut sender = Tester::connect(at, "sender", None, vec![]).await?;
    let what = format!("a message published with QoS {} on {}", message.qos, message.topic);
    sender.publish(message)?;
    let got = tokio::select! {
        got = watcher.message(&what) => got?,
        () = sender.ended() => return Ok(None),
    };
    sender.client.disconnect().await;
    Ok(Some(got))
}

/// What a fresh subscriber gets of what was retained before.
async fn stored(
    at: (&Endpoint, &OwnNames),
    watcher: &mut Tester<'_>,
    base: &str,
    filter: &str,
) -> Result<Option<Got>, LinkError> {
    let end = format!("{base}/end");
    let subscriptions = vec![(format!("{base}/{filter}"), 2), (end.clone(), 2)];
    let mut fresh = Tester::connect(at, "fresh", None, subscriptions).await?;
    watcher.publish(message(&end, "x", 1, false))?;
    watcher.message_on(&end, "a message of its own").await?;
    let mut limit = LIMIT;
    let found = loop {
        match fresh.within(limit).await? {
            Some(got) if got.retain => break Some(got),
            Some(got) if got.topic == end => limit = BEHIND,
            Some(_) => {}
            None => break None,
        }
    };
    fresh.client.disconnect().await;
    Ok(found)
}

/// What another node of the cluster does not do for the clients of this one.
async fn elsewhere(
    (node, own): (&Endpoint, &OwnNames),
    watcher: &mut Tester<'_>,
    base: &str,
) -> Result<Option<Difference>, LinkError> {
    let mut left = LOOKS;
    loop {
        left -= 1;
        match look((node, own), watcher, base).await {
            Ok(true) => return Ok(None),
            Ok(false) if left == 0 => return Ok(Some(Difference::KeepsFromNode(node.url()))),
            Err(error) if left == 0 => return Err(error),
            Ok(false) | Err(_) => {}
        }
    }
}

/// Whether what is published at another node arrives, and what is stored is known there.
async fn look((node, own): (&Endpoint, &OwnNames), watcher: &mut Tester<'_>, base: &str) -> Result<bool, LinkError> {
    let topic = format!("{base}/elsewhere");
    let sender = Tester::connect((node, own), "sender", None, vec![]).await?;
    sender.publish(message(&topic, "x", 1, false))?;
    let what = format!("a message published at {}", node.url());
    watcher.message_on(&topic, &what).await?;
    sender.client.disconnect().await;
    let found = stored((node, own), watcher, base, "retained").await?;
    Ok(found.is_some_and(|got| got.payload == "new"))
}

struct Tester<'a> {
    endpoint: &'a Endpoint,
    client_id: String,
    client: Client,
    events: mpsc::Receiver<ClientEvent>,
    early: VecDeque<Got>,
}

struct Got {
    topic: String,
    payload: String,
    qos: u8,
    retain: bool,
}

impl Got {
    fn new(topic: String, payload: &[u8], qos: u8, retain: bool) -> Self {
        Self {
            topic,
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
            match timeout(ENTRY, tester.events.recv()).await {
                Ok(Some(ClientEvent::Connected)) => return Ok(tester),
                // A stored message may come before the acknowledgement.
                Ok(Some(ClientEvent::Message {
                    topic,
                    payload,
                    qos,
                    retain,
                    ..
                })) => {
                    tester.early.push_back(Got::new(topic, &payload, qos, retain));
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
        match self.next(LIMIT).await {
            Ok(Some(got)) => Ok(got),
            Ok(None) => Err(broken(self.endpoint, &format!("{what} never arrives"))),
            Err(reason) => Err(broken(
                self.endpoint,
                &format!("it ends the connection where {what} should arrive ({reason})"),
            )),
        }
    }

    /// The next message on a topic; what is late of others is passed over.
    async fn message_on(&mut self, topic: &str, what: &str) -> Result<Got, LinkError> {
        loop {
            let got = self.message(what).await?;
            if got.topic == topic {
                return Ok(got);
            }
        }
    }

    /// The next message, if one comes in time.
    async fn within(&mut self, limit: Duration) -> Result<Option<Got>, LinkError> {
        self.next(limit).await.map_err(|reason| self.endpoint.lost(reason))
    }

    async fn next(&mut self, limit: Duration) -> Result<Option<Got>, String> {
        if let Some(early) = self.early.pop_front() {
            return Ok(Some(early));
        }
        match timeout(limit, self.events.recv()).await {
            Ok(Some(ClientEvent::Message {
                topic,
                payload,
                qos,
                retain,
                ..
            })) => Ok(Some(Got::new(topic, &payload, qos, retain))),
            Ok(Some(ClientEvent::Lost(reason))) => Err(reason),
            Ok(Some(ClientEvent::Connected) | None) => Err("the connection ended".to_owned()),
            Err(_) => Ok(None),
        }
    }

    /// Waits until the broker ends the connection.
    async fn ended(&mut self) {
        while !matches!(self.events.recv().await, Some(ClientEvent::Lost(_)) | None) {}
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
