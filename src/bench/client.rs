//! An MQTT client over rumqttc that opens one connection and tells how it went.
//!
//! It never reconnects by itself: a link must say that the broker is gone, and a reference device decides on
//! its own when to come back. Dropping it closes the socket without DISCONNECT.

use std::time::Duration;

use bytes::Bytes;
use rumqttc::{
    AsyncClient, Event, EventLoop, Incoming, LastWill, MqttOptions, NetworkOptions, QoS, SubscribeFilter,
    SubscribeReasonCode, TlsConfiguration, Transport,
};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::endpoint::Endpoint;
use crate::bench::Outgoing;

/// Largest packet taken and sent; rumqttc's own limit of 10 KiB is less than an order can have.
const LARGEST_PACKET: usize = 256 << 20;
/// How many requests may wait for the connection.
const REQUESTS: usize = 10_000;
/// QoS 1 and 2 messages on their way at the same time.
const IN_FLIGHT: u16 = 1000;
/// How long an orderly end may take.
const GOODBYE_LIMIT: Duration = Duration::from_secs(2);

/// How a client connects.
#[derive(Clone, Debug)]
pub struct ClientOptions {
    /// The broker, or the tap in front of it.
    pub endpoint: Endpoint,
    /// Client identifier.
    pub client_id: String,
    /// Keep-alive in whole seconds; zero is off.
    pub keep_alive: Duration,
    /// Clean session.
    pub clean_session: bool,
    /// The last will.
    pub will: Option<Outgoing>,
    /// Topic filters and QoS.
    pub subscriptions: Vec<(String, u8)>,
}

/// What a client has to say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ClientEvent {
    /// The connection was accepted and every subscription granted.
    Connected,
    /// A message was delivered.
    Message {
        /// Full topic.
        topic: String,
        /// Payload.
        payload: Bytes,
        /// QoS of the delivery.
        qos: u8,
        /// RETAIN of the delivery.
        retain: bool,
        /// DUP of the delivery.
        dup: bool,
    },
    /// The connection is gone or was never made; the text says why. The last event.
    Lost(String),
}

/// A client with one connection.
pub struct Client {
    requests: AsyncClient,
    running: JoinHandle<()>,
}

impl Client {
    /// Begins to connect; what happens comes through the receiver, at the pace it is read.
    #[must_use]
    pub fn open(options: &ClientOptions) -> (Self, mpsc::Receiver<ClientEvent>) {
        let (events, receiver) = mpsc::channel(256);
        let (requests, event_loop) = connection(options);
        let subscriptions = options.subscriptions.clone();
        let running = tokio::spawn(run(event_loop, requests.clone(), subscriptions, events));
        (Self { requests, running }, receiver)
    }

    /// Puts a message on its way. `false` when there is no connection any more or too much is waiting already.
    pub fn publish(&self, message: Outgoing) -> bool {
        let qos = quality(message.qos);
        !self.running.is_finished()
            && self
                .requests
                .try_publish(message.topic, qos, message.retain, message.payload)
                .is_ok()
    }

    /// Sends what is waiting and then DISCONNECT, and closes.
    pub async fn disconnect(mut self) {
        if self.requests.try_disconnect().is_ok() {
            let _ = tokio::time::timeout(GOODBYE_LIMIT, &mut self.running).await;
        }
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        self.running.abort();
    }
}

fn quality(qos: u8) -> QoS {
    match qos {
        0 => QoS::AtMostOnce,
        1 => QoS::AtLeastOnce,
        _ => QoS::ExactlyOnce,
    }
}

fn connection(options: &ClientOptions) -> (AsyncClient, EventLoop) {
    let mut mqtt = MqttOptions::new(
        options.client_id.clone(),
        options.endpoint.host.clone(),
        options.endpoint.port,
    );
    mqtt.set_max_packet_size(LARGEST_PACKET, LARGEST_PACKET);
    // rumqttc panics on fractions of the first second.
    mqtt.set_keep_alive(Duration::from_secs(options.keep_alive.as_secs()));
    mqtt.set_clean_session(options.clean_session || options.client_id.is_empty());
    mqtt.set_inflight(IN_FLIGHT);
    if let Some(will) = &options.will {
        mqtt.set_last_will(LastWill::new(
            will.topic.clone(),
            will.payload.clone(),
            quality(will.qos),
            will.retain,
        ));
    }
    if let Some(credentials) = &options.endpoint.credentials {
        mqtt.set_credentials(credentials.username.clone(), credentials.password.clone());
    }
    if let Some(tls) = &options.endpoint.tls {
        mqtt.set_transport(Transport::Tls(TlsConfiguration::Rustls(tls.clone())));
    }
    let (client, mut event_loop) = AsyncClient::new(mqtt, REQUESTS);
    let mut network = NetworkOptions::new();
    network.set_tcp_nodelay(true);
    event_loop.set_network_options(network);
    (client, event_loop)
}

async fn run(
    mut event_loop: EventLoop,
    requests: AsyncClient,
    subscriptions: Vec<(String, u8)>,
    events: mpsc::Sender<ClientEvent>,
) {
    let lost = async |reason: String| {
        let _ = events.send(ClientEvent::Lost(reason)).await;
    };
    loop {
        let event = match event_loop.poll().await {
            Ok(event) => event,
            Err(error) => return lost(error.to_string()).await,
        };
        let told = match event {
            Event::Incoming(Incoming::ConnAck(_)) if subscriptions.is_empty() => ClientEvent::Connected,
            Event::Incoming(Incoming::ConnAck(_)) => {
                let filters = subscriptions
                    .iter()
                    .map(|(filter, qos)| SubscribeFilter::new(filter.clone(), quality(*qos)));
                if let Err(error) = requests.try_subscribe_many(filters) {
                    return lost(error.to_string()).await;
                }
                continue;
            }
            Event::Incoming(Incoming::SubAck(answer)) => {
                if answer.return_codes.contains(&SubscribeReasonCode::Failure) {
                    return lost("the broker refused a subscription".to_owned()).await;
                }
                ClientEvent::Connected
            }
            Event::Incoming(Incoming::Publish(message)) => ClientEvent::Message {
                topic: message.topic,
                payload: message.payload,
                qos: message.qos as u8,
                retain: message.retain,
                dup: message.dup,
            },
            Event::Outgoing(rumqttc::Outgoing::Disconnect) => return,
            _ => continue,
        };
        if events.send(told).await.is_err() {
            return;
        }
    }
}
