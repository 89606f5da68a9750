//! An MQTT client over rumqttc that opens one connection and tells how it went.
//!
//! It never reconnects by itself: a link must say that the broker is gone, and a reference device decides on
//! its own when to come back. Dropping it closes the socket without DISCONNECT.

use std::time::Duration;

use bytes::Bytes;
use rumqttc::{
    AsyncClient, ConnectReturnCode, ConnectionError, Event, EventLoop, Incoming, LastWill, MqttOptions, NetworkOptions,
    QoS, StateError, SubscribeFilter, SubscribeReasonCode,
};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use super::dial::{Bridge, SILENT, dial, unreachable};
use super::endpoint::Endpoint;
use tck_base::device::Publication;

/// Largest packet taken and sent; rumqttc's own limit of 10 KiB is less than an order can have.
pub(super) const LARGEST_PACKET: usize = 256 << 20;
/// How many requests may wait for the connection.
pub(super) const REQUESTS: usize = 10_000;
/// QoS 1 and 2 messages on their way at the same time. rumqttc keeps room for all of them, a hundred bytes each.
pub(super) const IN_FLIGHT: u16 = 100;
/// How long an orderly end may take.
pub(super) const GOODBYE_LIMIT: Duration = Duration::from_secs(2);

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
    pub will: Option<Publication>,
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
        let endpoint = &options.endpoint;
        // rumqttc knows TCP only; the rest is ours, so that broker, tap and client have one way to be secured.
        let bridge = match (&endpoint.tls, &endpoint.websocket) {
            (None, None) => Ok(None),
            _ => Bridge::open().map(Some),
        };
        let at = match &bridge {
            Ok(Some(bridge)) => ("127.0.0.1".to_owned(), bridge.port()),
            _ => (endpoint.host.clone(), endpoint.port),
        };
        let (requests, event_loop) = connection(options, at);
        let run = Run {
            endpoint: endpoint.clone(),
            requests: requests.clone(),
            subscriptions: options.subscriptions.clone(),
            events,
        };
        let running = tokio::spawn(async move {
            match bridge {
                Ok(None) => run.carry_on(event_loop).await,
                Ok(Some(bridge)) => run.over(bridge, event_loop).await,
                Err(error) => run.lost(error.to_string()).await,
            }
        });
        (Self { requests, running }, receiver)
    }

    /// Puts a message on its way. `false` when there is no connection any more or too much is waiting already.
    pub fn publish(&self, message: Publication) -> bool {
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

pub(super) fn quality(qos: u8) -> QoS {
    match qos {
        0 => QoS::AtMostOnce,
        1 => QoS::AtLeastOnce,
        _ => QoS::ExactlyOnce,
    }
}

/// A last will as a CONNECT has it.
pub(super) fn last_will(will: &Publication) -> LastWill {
    LastWill::new(will.topic.clone(), will.payload.clone(), quality(will.qos), will.retain)
}

fn connection(options: &ClientOptions, (host, port): (String, u16)) -> (AsyncClient, EventLoop) {
    let mut mqtt = MqttOptions::new(options.client_id.clone(), host, port);
    mqtt.set_max_packet_size(LARGEST_PACKET, LARGEST_PACKET);
    // rumqttc panics on fractions of the first second.
    mqtt.set_keep_alive(Duration::from_secs(options.keep_alive.as_secs()));
    mqtt.set_clean_session(options.clean_session || options.client_id.is_empty());
    mqtt.set_inflight(IN_FLIGHT);
    if let Some(will) = &options.will {
        mqtt.set_last_will(last_will(will));
    }
    if let Some(credentials) = &options.endpoint.credentials {
        mqtt.set_credentials(credentials.username.clone(), credentials.password.clone());
    }
    let (client, mut event_loop) = AsyncClient::new(mqtt, REQUESTS);
    let mut network = NetworkOptions::new();
    network.set_tcp_nodelay(true);
    event_loop.set_network_options(network);
    (client, event_loop)
}

/// A connection from its beginning to its end.
struct Run {
    endpoint: Endpoint,
    requests: AsyncClient,
    subscriptions: Vec<(String, u8)>,
    events: mpsc::Sender<ClientEvent>,
}

/// Ends a task when it is dropped.
struct Ending(JoinHandle<()>);

impl Drop for Ending {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Run {
    async fn lost(&self, reason: String) {
        tracing::debug!(broker = self.endpoint.url(), reason, "a connection is lost");
        let _ = self.events.send(ClientEvent::Lost(reason)).await;
    }

    /// Over a connection that the client cannot open by itself.
    async fn over(self, bridge: Bridge, event_loop: EventLoop) {
        let stream = match dial(&self.endpoint).await {
            Ok(stream) => stream,
            Err(reason) => return self.lost(reason).await,
        };
        let mut bridge = Ending(tokio::spawn(bridge.carry(stream)));
        self.carry_on(event_loop).await;
        // What was sent last is still on its way.
        let _ = tokio::time::timeout(GOODBYE_LIMIT, &mut bridge.0).await;
    }

    async fn carry_on(self, mut event_loop: EventLoop) {
        let mut accepted = false;
        loop {
            let event = match event_loop.poll().await {
                Ok(event) => event,
                Err(error) => return self.lost(why(&error, accepted, &self.endpoint)).await,
            };
            let told = match event {
                Event::Incoming(Incoming::ConnAck(_)) => {
                    accepted = true;
                    if self.subscriptions.is_empty() {
                        ClientEvent::Connected
                    } else {
                        let filters = self.subscriptions.iter();
                        let filters = filters.map(|(filter, qos)| SubscribeFilter::new(filter.clone(), quality(*qos)));
                        if let Err(error) = self.requests.try_subscribe_many(filters) {
                            return self.lost(error.to_string()).await;
                        }
                        continue;
                    }
                }
                Event::Incoming(Incoming::SubAck(answer)) => {
                    if let Some(reason) = refused_subscriptions(&answer.return_codes, &self.subscriptions) {
                        return self.lost(reason).await;
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
            if self.events.send(told).await.is_err() {
                return;
            }
        }
    }
}

/// How a loss begins that is a refused subscription.
pub(crate) const REFUSED_SUBSCRIPTION: &str = "it refuses the subscription to ";

/// What a broker refuses of these subscriptions, as the end of a sentence about it.
pub(super) fn refused_subscriptions(codes: &[SubscribeReasonCode], subscriptions: &[(String, u8)]) -> Option<String> {
    let refused = codes.iter().zip(subscriptions);
    let refused = refused.filter(|(code, _)| **code == SubscribeReasonCode::Failure);
    let refused: Vec<&str> = refused.map(|(_, (filter, _))| filter.as_str()).collect();
    (!refused.is_empty()).then(|| format!("{REFUSED_SUBSCRIPTION}{}", refused.join(", ")))
}

/// Why a connection is lost, or was never there, as the end of a sentence about the broker.
pub(super) fn why(error: &ConnectionError, accepted: bool, endpoint: &Endpoint) -> String {
    let user = endpoint.credentials.as_ref().map(|credentials| &credentials.username);
    match error {
        ConnectionError::ConnectionRefused(
            code @ (ConnectReturnCode::NotAuthorized | ConnectReturnCode::BadUserNamePassword),
        ) => match user {
            Some(user) => format!("it refuses the login of `{user}` ({code:?}); its password may be another one"),
            None => format!(
                "it lets nobody in without a login ({code:?}); give the user name with `username` in the profile, or with `--username`"
            ),
        },
        ConnectionError::ConnectionRefused(ConnectReturnCode::BadClientId) => {
            "it does not allow the client id (BadClientId); see `client-id`".to_owned()
        }
        ConnectionError::ConnectionRefused(code) => format!("it refuses the connection ({code:?})"),
        ConnectionError::NetworkTimeout | ConnectionError::FlushTimeout => SILENT.to_owned(),
        ConnectionError::Io(error) if !accepted && is_nobody_there(error) => unreachable(error),
        ConnectionError::Io(_) | ConnectionError::MqttState(_) if !accepted => {
            let hint = match (&endpoint.tls, &endpoint.websocket) {
                (None, None) => "; where TLS is spoken it is mqtts://, and ws:// or wss:// with WebSocket",
                _ => "",
            };
            format!("it ends the connection before it accepts it ({}){hint}", short(error))
        }
        other => short(other),
    }
}

fn is_nobody_there(error: &std::io::Error) -> bool {
    use std::io::ErrorKind;
    // Neither is an answer of somebody who is there.
    !matches!(
        error.kind(),
        ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted | ErrorKind::UnexpectedEof | ErrorKind::BrokenPipe
    )
}

fn short(error: &ConnectionError) -> String {
    match error {
        ConnectionError::Io(error) | ConnectionError::MqttState(StateError::Io(error)) => error.to_string(),
        ConnectionError::MqttState(StateError::Deserialization(error)) => error.to_string(),
        ConnectionError::MqttState(error) => error.to_string(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::endpoint::{Access, Credentials};

    #[test]
    fn a_loss_is_told_with_what_can_be_done() {
        let mut endpoint = Endpoint::parse("mqtt://broker.local", &Access::default()).unwrap();
        let told = |error: ConnectionError, accepted, endpoint: &Endpoint| why(&error, accepted, endpoint);
        let refused = || ConnectionError::ConnectionRefused(ConnectReturnCode::NotAuthorized);
        let reset = || ConnectionError::MqttState(StateError::Io(std::io::ErrorKind::ConnectionReset.into()));
        let nobody = || ConnectionError::Io(std::io::ErrorKind::ConnectionRefused.into());
        assert!(told(refused(), false, &endpoint).contains("`username`"));
        assert!(told(reset(), false, &endpoint).contains("mqtts://"));
        assert_eq!(told(reset(), true, &endpoint), "connection reset");
        assert!(told(nobody(), false, &endpoint).starts_with("it is not reachable"));
        endpoint.credentials = Some(Credentials {
            username: "me".to_owned(),
            password: "secret".to_owned(),
        });
        let text = told(refused(), false, &endpoint);
        assert!(text.contains("login of `me`") && !text.contains("secret"), "{text}");
    }
}
