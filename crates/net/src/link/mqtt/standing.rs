//! The harness's own connection: what it subscribes to, what it reports, and what a broker may not allow.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::timeout;

use super::options::{ANSWER_LIMIT, BenchOptions};
use crate::bench::LinkError;
use crate::bench::client::{Client, ClientEvent, ClientOptions, REFUSED_SUBSCRIPTION};
use crate::bench::endpoint::Endpoint;
use crate::bench::inbox::Reporter;
use crate::bench::own::{OwnNames, User};
use tck_journal::event::{Direction, Event, Payload, Source};

/// Keep-alive of the harness's own connections.
const KEEP_ALIVE: Duration = Duration::from_secs(30);

pub(super) struct Standing {
    pub(super) client: Client,
    pub(super) events: mpsc::Receiver<ClientEvent>,
}

/// Connects the harness and waits until its standing subscription is acknowledged.
pub(super) async fn standing(
    endpoint: &Endpoint,
    own_topic: Option<String>,
    client_id: &str,
    options: &BenchOptions,
    reporter: &Reporter,
) -> Result<Standing, LinkError> {
    let topics = options.device_topics.iter().cloned().chain(own_topic);
    let (client, mut events) = Client::open(&own_client(endpoint, client_id, topics));
    let connected = async {
        loop {
            match events.recv().await {
                Some(ClientEvent::Connected) => return Ok(()),
                // Stored messages may come before the acknowledgement.
                Some(message @ ClientEvent::Message { .. }) => tell(message, reporter, "").await,
                Some(ClientEvent::Lost(reason)) => return Err(refused(reason, endpoint, options)),
                None => return Err(endpoint.lost("the connection ended")),
            }
        }
    };
    match timeout(ANSWER_LIMIT, connected).await {
        Ok(result) => result?,
        Err(_) => return Err(endpoint.lost("it does not answer")),
    }
    Ok(Standing { client, events })
}

/// A refused subscription to topics of the device cannot be done without.
fn refused(reason: String, endpoint: &Endpoint, options: &BenchOptions) -> LinkError {
    match reason.strip_prefix(REFUSED_SUBSCRIPTION) {
        Some(filters) => LinkError::Forbidden {
            broker: endpoint.url(),
            what: format!("the subscription to {filters}"),
            rules: rules(endpoint, options),
        },
        None => endpoint.lost(reason),
    }
}

/// Under which name the harness logs in.
pub(super) fn user(endpoint: &Endpoint) -> User {
    let credentials = endpoint.credentials.as_ref();
    User(credentials.map(|credentials| credentials.username.clone()))
}

fn rules(endpoint: &Endpoint, options: &BenchOptions) -> String {
    options.own.access_rules(&user(endpoint), None, &options.device_topics)
}

pub(super) fn without_own_topics(what: &str, endpoint: &Endpoint, options: &BenchOptions) -> String {
    format!(
        "The broker at {} does not allow {what}, so it was not tested whether it keeps QoS, RETAIN and last wills, and \
         nothing is said about what must never come. These access rules allow it, as mosquitto has them: {}",
        endpoint.url(),
        rules(endpoint, options).replace('\n', "; ")
    )
}

pub(super) fn without_echo(endpoint: &Endpoint, options: &BenchOptions) -> String {
    format!(
        "The broker at {} does not let the harness read the topics on which it publishes, so nobody can tell whether it takes \
         what is sent to the device. These access rules allow it, as mosquitto has them: {}",
        endpoint.url(),
        rules(endpoint, options).replace('\n', "; ")
    )
}

pub(super) fn own_client(endpoint: &Endpoint, client_id: &str, topics: impl Iterator<Item = String>) -> ClientOptions {
    ClientOptions {
        endpoint: endpoint.clone(),
        client_id: client_id.to_owned(),
        keep_alive: KEEP_ALIVE,
        clean_session: true,
        will: None,
        subscriptions: topics.map(|topic| (topic, 2)).collect(),
    }
}

pub(super) fn probe_topic(own: &OwnNames, run: &str) -> String {
    format!("{}/{run}/probe", own.topics)
}

/// Reports what the standing subscription receives, until the connection is gone.
pub(super) async fn listen(
    mut events: mpsc::Receiver<ClientEvent>,
    endpoint: Endpoint,
    probes: String,
    reporter: Reporter,
) {
    let reason = loop {
        match events.recv().await {
            Some(ClientEvent::Lost(reason)) => break reason,
            Some(event) => tell(event, &reporter, &probes).await,
            None => break "the connection ended".to_owned(),
        }
    };
    reporter.broken(endpoint.lost(reason));
}

async fn tell(event: ClientEvent, reporter: &Reporter, probes: &str) {
    let ClientEvent::Message {
        topic,
        payload,
        qos,
        retain,
        dup,
    } = event
    else {
        return;
    };
    if topic == probes {
        if let Some(probe) = std::str::from_utf8(&payload).ok().and_then(|text| text.parse().ok()) {
            reporter
                .report(Source::Link, None, Event::ProbeReceived { probe })
                .await;
        }
        return;
    }
    let payload = Payload::keep(payload);
    let event = Event::Message {
        topic,
        qos,
        retain,
        dup,
        payload,
    };
    reporter.report(Source::Link, Some(Direction::FromDevice), event).await;
}
