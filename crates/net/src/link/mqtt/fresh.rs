//! Asks the broker, by a client of its own, what it has stored.

use std::time::Duration;

use crate::bench::client::{Client, ClientEvent, ClientOptions};
use crate::bench::inbox::Reporter;
use tck_base::device::Publication;
use tck_journal::event::{Direction, Event, Payload, Source};

/// How often a new client looks before it says that nothing is stored.
const LOOKS: u32 = 3;
/// How long it leaves the broker between two looks.
const BETWEEN_LOOKS: Duration = Duration::from_millis(100);

/// How long it waits for what is stored where the broker allows no topic that would tell the end.
const PATIENCE: Duration = Duration::from_secs(1);

/// Looks with a new client what the broker has stored, and reports it. A broker that is just replacing a stored message
/// by another one may have none for a moment, and no event tells when it is done: nothing is nothing only when it is
/// nothing again.
pub(super) async fn look(
    request: u64,
    options: &ClientOptions,
    end: Option<String>,
    reporter: &Reporter,
) -> Result<(), String> {
    for look in 1..=LOOKS {
        if look_once(request, options, end.as_deref(), reporter).await? || look == LOOKS {
            break;
        }
        tokio::time::sleep(BETWEEN_LOOKS).await;
    }
    reporter
        .report(Source::Link, None, Event::RetainedEnd { request })
        .await;
    Ok(())
}

/// Subscribes with a new client and reports what comes; says whether anything came. A message of its own, sent after
/// the subscription was granted, comes back behind everything the broker had stored. Without one it waits for a while.
async fn look_once(
    request: u64,
    options: &ClientOptions,
    end: Option<&str>,
    reporter: &Reporter,
) -> Result<bool, String> {
    let mut any = false;
    let (client, mut events) = Client::open(options);
    let mut until = None;
    loop {
        let event = match until {
            None => events.recv().await,
            Some(until) => match tokio::time::timeout_at(until, events.recv()).await {
                Ok(event) => event,
                Err(_) => break,
            },
        };
        match event {
            Some(ClientEvent::Connected) => {
                let Some(end) = end else {
                    until = Some(tokio::time::Instant::now() + PATIENCE);
                    continue;
                };
                let marker = Publication {
                    topic: end.to_owned(),
                    payload: bytes::Bytes::new(),
                    qos: 1,
                    retain: false,
                };
                if !client.publish(marker) {
                    return Err("a fresh subscriber lost its connection".to_owned());
                }
            }
            Some(ClientEvent::Message { topic, .. }) if Some(topic.as_str()) == end => break,
            Some(ClientEvent::Message {
                topic,
                payload,
                qos,
                retain,
                ..
            }) => {
                any = true;
                let payload = Payload::keep(payload);
                let event = Event::Retained {
                    request,
                    topic,
                    qos,
                    retain,
                    payload,
                };
                reporter.report(Source::Link, Some(Direction::FromDevice), event).await;
            }
            Some(ClientEvent::Lost(reason)) => return Err(reason),
            None => return Err("a fresh subscriber lost its connection".to_owned()),
        }
    }
    client.disconnect().await;
    Ok(any)
}
