//! An MQTT 3.1.1 client for thousands of connections in one process: no task, no channel and no buffer of its own.
//!
//! It lives in the task of its device, which asks it for the next event, and behaves on the wire as [`super::client`] does. What
//! is read passes through a buffer on the stack; bytes stay here only while a packet has not come, or not gone, as a whole. It
//! never reconnects by itself, and dropping it closes the socket without DISCONNECT.

use std::collections::VecDeque;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use bytes::BytesMut;
use rumqttc::mqttbytes::Error;
use rumqttc::{
    Connect, ConnectReturnCode, ConnectionError, Login, Packet, Protocol, StateError, Subscribe, SubscribeFilter,
    valid_filter,
};
use tokio::io::{AsyncRead as _, AsyncWrite as _, ReadBuf};
use tokio::time::{Instant, Sleep, sleep};

use super::client::{
    ClientEvent, ClientOptions, GOODBYE_LIMIT, LARGEST_PACKET, last_will, quality, refused_subscriptions, why,
};
use super::dial::{SILENT, dial};
use super::endpoint::Endpoint;
use super::flow::Flow;
use super::stream::Stream;
use tck_base::device::Publication;

/// How long a broker may take to accept a connection, with the connection itself where it is TCP alone.
const ENTRY_LIMIT: Duration = Duration::from_secs(5);
/// How long TLS or a WebSocket may take besides.
const SECURING_LIMIT: Duration = Duration::from_secs(10);
/// How many bytes are read at once, on the stack.
const READ_SIZE: usize = 4 << 10;

/// A client with one connection.
pub struct LightClient {
    phase: Phase,
}

/// A connection that is being made, or why there is none.
type Opening = Pin<Box<dyn Future<Output = Result<Box<Session>, String>> + Send>>;

enum Phase {
    /// On its way.
    Opening(Opening),
    Open(Box<Session>),
    Gone,
}

impl LightClient {
    /// A client that connects while it is asked for events.
    #[must_use]
    pub fn open(options: ClientOptions) -> Self {
        Self {
            phase: Phase::Opening(Box::pin(enter(options))),
        }
    }

    /// What happens next; [`ClientEvent::Lost`] comes last. May be dropped and asked again.
    pub async fn next(&mut self) -> ClientEvent {
        std::future::poll_fn(|context| self.poll_next(context)).await
    }

    fn poll_next(&mut self, context: &mut Context<'_>) -> Poll<ClientEvent> {
        loop {
            match &mut self.phase {
                Phase::Opening(opening) => match std::task::ready!(opening.as_mut().poll(context)) {
                    Ok(session) => self.phase = Phase::Open(session),
                    Err(reason) => {
                        self.phase = Phase::Gone;
                        return Poll::Ready(ClientEvent::Lost(reason));
                    }
                },
                Phase::Open(session) => {
                    let reason = match std::task::ready!(session.poll_event(context)) {
                        Ok(event) => return Poll::Ready(event),
                        Err(reason) => reason,
                    };
                    tracing::debug!(broker = session.endpoint.url(), reason, "a connection is lost");
                    self.phase = Phase::Gone;
                    return Poll::Ready(ClientEvent::Lost(reason));
                }
                Phase::Gone => return Poll::Pending,
            }
        }
    }

    /// Puts a message in line. `false` when there is no connection or too much is waiting already.
    pub fn publish(&mut self, message: Publication) -> bool {
        match &mut self.phase {
            Phase::Open(session) => session.flow.publish(message, &mut session.out),
            _ => false,
        }
    }

    /// Sends what is in line, as far as the connection takes it at once; the rest goes while it is asked for events.
    pub async fn flush(&mut self) {
        if let Phase::Open(session) = &mut self.phase {
            std::future::poll_fn(|context| {
                // A broken connection is found again when it is asked for its next event.
                let _ = session.poll_flush(context);
                Poll::Ready(())
            })
            .await;
        }
    }

    /// Sends what is waiting and then DISCONNECT, and closes.
    pub async fn disconnect(self) {
        let ending = async {
            let mut session = match self.phase {
                Phase::Opening(opening) => opening.await.ok()?,
                Phase::Open(session) => session,
                Phase::Gone => return None,
            };
            std::future::poll_fn(|context| session.poll_sent(context)).await.ok()?;
            Flow::bye(&mut session.out).ok()?;
            std::future::poll_fn(|context| session.poll_flush(context)).await.ok()?;
            let shut = std::future::poll_fn(|context| Pin::new(&mut session.stream).poll_shutdown(context)).await;
            // TLS and a WebSocket have an end of their own, which the broker answers.
            if shut.is_ok() && !is_plain(&session.endpoint) {
                while std::future::poll_fn(|context| session.poll_read(context)).await.is_ok() {
                    session.read.clear();
                }
            }
            Some(())
        };
        let _ = tokio::time::timeout(GOODBYE_LIMIT, ending).await;
    }
}

/// Whether MQTT goes over TCP alone.
fn is_plain(endpoint: &Endpoint) -> bool {
    endpoint.tls.is_none() && endpoint.websocket.is_none()
}

/// Opens a connection up to what the broker says to CONNECT.
async fn enter(options: ClientOptions) -> Result<Box<Session>, String> {
    let limit = if is_plain(&options.endpoint) {
        ENTRY_LIMIT
    } else {
        ENTRY_LIMIT + SECURING_LIMIT
    };
    let entered = tokio::time::timeout(limit, async {
        let stream = dial(&options.endpoint).await?;
        let mut session = Session::new(stream, options);
        let accepted = std::future::poll_fn(|context| session.poll_accepted(context)).await;
        accepted.map_err(|error| why(&error, false, &session.endpoint))?;
        session.subscribe()?;
        Ok(Box::new(session))
    });
    entered.await.unwrap_or_else(|_| Err(SILENT.to_owned()))
}

/// A connection that is made.
struct Session {
    stream: Box<dyn Stream>,
    endpoint: Endpoint,
    subscriptions: Vec<(String, u8)>,
    keep_alive: Duration,
    /// When to send the next PINGREQ.
    ping: Option<Pin<Box<Sleep>>>,
    /// The beginning of a packet.
    read: BytesMut,
    /// What the connection has not taken yet.
    out: BytesMut,
    /// What came at once and was not asked for yet.
    events: VecDeque<ClientEvent>,
    flow: Flow,
}

impl Session {
    /// A connection on which CONNECT is to be sent.
    fn new(stream: Box<dyn Stream>, options: ClientOptions) -> Self {
        let mut out = BytesMut::new();
        // It fails for packets that are too long only, which no CONNECT is.
        let _ = Packet::Connect(connect(&options)).write(&mut out, LARGEST_PACKET);
        Self {
            stream,
            endpoint: options.endpoint,
            subscriptions: options.subscriptions,
            keep_alive: Duration::from_secs(options.keep_alive.as_secs()),
            ping: None,
            read: BytesMut::new(),
            out,
            events: VecDeque::new(),
            flow: Flow::default(),
        }
    }

    /// Waits for CONNACK.
    fn poll_accepted(&mut self, context: &mut Context<'_>) -> Poll<Result<(), ConnectionError>> {
        loop {
            match self.packet() {
                Ok(None) => {}
                Ok(Some(Packet::ConnAck(connack))) if connack.code == ConnectReturnCode::Success => {
                    if !self.keep_alive.is_zero() {
                        self.ping = Some(Box::pin(sleep(self.keep_alive)));
                    }
                    return Poll::Ready(Ok(()));
                }
                Ok(Some(Packet::ConnAck(connack))) => {
                    return Poll::Ready(Err(ConnectionError::ConnectionRefused(connack.code)));
                }
                Ok(Some(packet)) => return Poll::Ready(Err(ConnectionError::NotConnAck(packet))),
                Err(error) => return Poll::Ready(Err(error.into())),
            }
            if let Poll::Ready(Err(error)) = self.poll_flush(context) {
                return Poll::Ready(Err(error.into()));
            }
            if let Err(error) = std::task::ready!(self.poll_read(context)) {
                return Poll::Ready(Err(error.into()));
            }
        }
    }

    /// Subscribes to everything; without anything it is connected already.
    fn subscribe(&mut self) -> Result<(), String> {
        if self.subscriptions.is_empty() {
            self.events.push_back(ClientEvent::Connected);
            return Ok(());
        }
        if let Some((filter, _)) = self.subscriptions.iter().find(|(filter, _)| !valid_filter(filter)) {
            return Err(format!("{filter} is no topic filter"));
        }
        let filters = self.subscriptions.iter();
        let filters = filters.map(|(filter, qos)| SubscribeFilter::new(filter.clone(), quality(*qos)));
        let mut subscribe = Subscribe::new_many(filters);
        subscribe.pkid = self.flow.next_id();
        let written = Packet::Subscribe(subscribe).write(&mut self.out, LARGEST_PACKET);
        written.map(drop).map_err(|error| error.to_string())
    }

    /// The next event, or why there are no more.
    fn poll_event(&mut self, context: &mut Context<'_>) -> Poll<Result<ClientEvent, String>> {
        match self.poll_turn(context) {
            Poll::Pending => Poll::Pending,
            Poll::Ready(Ok(event)) => Poll::Ready(event),
            Poll::Ready(Err(error)) => Poll::Ready(Err(why(&error.into(), true, &self.endpoint))),
        }
    }

    /// Takes what comes and sends what is in line until there is an event. The inner reason is one of this client.
    fn poll_turn(&mut self, context: &mut Context<'_>) -> Poll<Result<Result<ClientEvent, String>, StateError>> {
        loop {
            while let Some(packet) = self.packet()? {
                if let Packet::SubAck(answer) = &packet {
                    let refused = refused_subscriptions(&answer.return_codes, &self.subscriptions);
                    if let Some(reason) = refused {
                        return Poll::Ready(Ok(Err(reason)));
                    }
                    self.events.push_back(ClientEvent::Connected);
                } else {
                    self.events.extend(self.flow.take(packet, &mut self.out)?);
                }
            }
            self.ping(context)?;
            if let Poll::Ready(Err(error)) = self.poll_flush(context) {
                return Poll::Ready(Err(error));
            }
            if let Some(event) = self.events.pop_front() {
                return Poll::Ready(Ok(Ok(event)));
            }
            // Room for nothing is kept.
            self.events = VecDeque::new();
            std::task::ready!(self.poll_read(context))?;
        }
    }

    /// Sends everything in line, and takes what has to come for that; what comes besides is left aside.
    fn poll_sent(&mut self, context: &mut Context<'_>) -> Poll<Result<(), StateError>> {
        loop {
            while let Some(packet) = self.packet()? {
                if !matches!(packet, Packet::SubAck(_)) {
                    self.flow.take(packet, &mut self.out)?;
                }
            }
            std::task::ready!(self.poll_flush(context))?;
            if self.flow.is_clear() {
                return Poll::Ready(Ok(()));
            }
            std::task::ready!(self.poll_read(context))?;
        }
    }

    /// PINGREQ, whenever the keep-alive has passed; the one before must have been answered.
    fn ping(&mut self, context: &mut Context<'_>) -> Result<(), StateError> {
        let Some(ping) = &mut self.ping else { return Ok(()) };
        while ping.as_mut().poll(context).is_ready() {
            self.flow.ping(&mut self.out)?;
            ping.as_mut().reset(Instant::now() + self.keep_alive);
        }
        Ok(())
    }

    /// The next whole packet among what was read.
    fn packet(&mut self) -> Result<Option<Packet>, StateError> {
        if self.read.is_empty() {
            return Ok(None);
        }
        match Packet::read(&mut self.read, LARGEST_PACKET) {
            Ok(packet) => {
                if self.read.is_empty() {
                    self.read = BytesMut::new();
                }
                Ok(Some(packet))
            }
            Err(Error::InsufficientBytes(_)) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    fn poll_read(&mut self, context: &mut Context<'_>) -> Poll<Result<(), StateError>> {
        let mut space = [0; READ_SIZE];
        let mut buffer = ReadBuf::new(&mut space);
        std::task::ready!(Pin::new(&mut self.stream).poll_read(context, &mut buffer))?;
        if buffer.filled().is_empty() {
            return Poll::Ready(Err(StateError::ConnectionAborted));
        }
        self.read.extend_from_slice(buffer.filled());
        Poll::Ready(Ok(()))
    }

    /// Sends what is in line; ready when nothing is.
    fn poll_flush(&mut self, context: &mut Context<'_>) -> Poll<Result<(), StateError>> {
        loop {
            self.flow.fill(&mut self.out);
            if self.out.is_empty() {
                break;
            }
            let written = std::task::ready!(Pin::new(&mut self.stream).poll_write(context, &self.out))?;
            if written == 0 {
                return Poll::Ready(Err(StateError::ConnectionAborted));
            }
            let _ = self.out.split_to(written);
            if self.out.is_empty() {
                self.out = BytesMut::new();
            }
        }
        std::task::ready!(Pin::new(&mut self.stream).poll_flush(context))?;
        Poll::Ready(Ok(()))
    }
}

/// CONNECT as these options ask for it.
fn connect(options: &ClientOptions) -> Connect {
    let credentials = options.endpoint.credentials.as_ref();
    Connect {
        protocol: Protocol::V4,
        keep_alive: u16::try_from(options.keep_alive.as_secs()).unwrap_or(u16::MAX),
        client_id: options.client_id.clone(),
        clean_session: options.clean_session || options.client_id.is_empty(),
        last_will: options.will.as_ref().map(last_will),
        login: credentials.map(|credentials| Login::new(&credentials.username, &credentials.password)),
    }
}

#[cfg(test)]
mod tests {
    use rumqttc::{ConnAck, PubAck, PubComp, PubRec, Publish, QoS, SubAck, SubscribeReasonCode};
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpListener;

    use super::*;
    use crate::bench::client::Client;
    use crate::bench::endpoint::Credentials;

    fn options(listener: &TcpListener) -> ClientOptions {
        let mut endpoint = Endpoint::plain(listener.local_addr().unwrap());
        endpoint.credentials = Some(Credentials {
            username: "me".to_owned(),
            password: "secret".to_owned(),
        });
        ClientOptions {
            endpoint,
            client_id: "vehicle".to_owned(),
            keep_alive: Duration::from_secs(15),
            clean_session: true,
            will: Some(message("broken", 1)),
            subscriptions: vec![("order".to_owned(), 1), ("instantActions".to_owned(), 0)],
        }
    }

    fn message(topic: &str, qos: u8) -> Publication {
        Publication {
            topic: topic.to_owned(),
            payload: vec![b'x'; 300].into(),
            qos,
            retain: qos == 1,
        }
    }

    /// What a broker answers to a packet. When all messages of a client have come it sends one of its own.
    fn answers(packet: &Packet) -> Vec<Packet> {
        let granted = SubscribeReasonCode::Success(QoS::AtLeastOnce);
        match packet {
            Packet::Connect(_) => vec![Packet::ConnAck(ConnAck::new(ConnectReturnCode::Success, false))],
            Packet::Subscribe(subscribe) => vec![Packet::SubAck(SubAck::new(subscribe.pkid, vec![granted; 2]))],
            Packet::Publish(publish) => match publish.qos {
                QoS::AtMostOnce => Vec::new(),
                QoS::AtLeastOnce => vec![Packet::PubAck(PubAck::new(publish.pkid))],
                QoS::ExactlyOnce => vec![Packet::PubRec(PubRec::new(publish.pkid))],
            },
            Packet::PubRel(release) => {
                let mut order = Publish::from_bytes("order", QoS::AtLeastOnce, vec![b'y'; 10_000].into());
                order.pkid = 77;
                vec![Packet::PubComp(PubComp::new(release.pkid)), Packet::Publish(order)]
            }
            _ => Vec::new(),
        }
    }

    /// Plays the broker for one connection, answering a few bytes at a time; everything the client has sent.
    async fn broker(listener: &TcpListener) -> Vec<u8> {
        let (mut socket, _) = listener.accept().await.unwrap();
        socket.set_nodelay(true).unwrap();
        let (mut all, mut unread) = (Vec::new(), BytesMut::new());
        let mut space = [0; 1024];
        while let Ok(length @ 1..) = socket.read(&mut space).await {
            all.extend_from_slice(&space[..length]);
            unread.extend_from_slice(&space[..length]);
            while let Ok(packet) = Packet::read(&mut unread, LARGEST_PACKET) {
                for answer in answers(&packet) {
                    let mut bytes = BytesMut::new();
                    answer.write(&mut bytes, LARGEST_PACKET).unwrap();
                    for part in bytes.chunks(3_000) {
                        let (first, rest) = part.split_at(1);
                        socket.write_all(first).await.unwrap();
                        tokio::task::yield_now().await;
                        socket.write_all(rest).await.unwrap();
                    }
                }
            }
        }
        all
    }

    fn is_the_order(event: &ClientEvent) -> bool {
        matches!(event, ClientEvent::Message { topic, payload, qos: 1, .. } if topic == "order" && payload.len() == 10_000)
    }

    #[tokio::test]
    async fn it_says_the_same_bytes_as_the_client_of_the_library() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let by_library = async {
            let (client, mut events) = Client::open(&options(&listener));
            assert_eq!(events.recv().await, Some(ClientEvent::Connected));
            for qos in 0..3 {
                assert!(client.publish(message("state", qos)));
            }
            assert!(is_the_order(&events.recv().await.unwrap()));
            client.disconnect().await;
        };
        let ((), expected) = tokio::join!(by_library, broker(&listener));
        let by_ours = async {
            let mut client = LightClient::open(options(&listener));
            assert_eq!(client.next().await, ClientEvent::Connected);
            for qos in 0..3 {
                assert!(client.publish(message("state", qos)));
            }
            client.flush().await;
            assert!(is_the_order(&client.next().await));
            client.disconnect().await;
        };
        let ((), said) = tokio::join!(by_ours, broker(&listener));
        assert_eq!(said, expected);
    }

    /// Why it is lost when a broker says this to CONNECT, and then closes.
    async fn answered(listener: &TcpListener, answer: &[u8]) -> String {
        let mut client = LightClient::open(options(listener));
        let serving = async {
            let (mut socket, _) = listener.accept().await.unwrap();
            let mut space = [0; 1024];
            assert!(socket.read(&mut space).await.unwrap() > 0);
            socket.write_all(answer).await.unwrap();
        };
        match tokio::join!(client.next(), serving).0 {
            ClientEvent::Lost(reason) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[tokio::test]
    async fn a_loss_is_told_with_the_reason() {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let login = answered(&listener, b"\x20\x02\x00\x05").await;
        assert!(login.contains("login of `me`"), "{login}");
        let closed = answered(&listener, b"").await;
        assert!(closed.starts_with("it ends the connection before"), "{closed}");
        let refused = answered(&listener, b"\x20\x02\x00\x00\x90\x04\x00\x01\x80\x00").await;
        assert_eq!(refused, "it refuses the subscription to order");
        let nobody = options(&listener);
        drop(listener);
        let event = LightClient::open(nobody).next().await;
        assert!(
            matches!(&event, ClientEvent::Lost(reason) if reason.starts_with("it is not reachable")),
            "{event:?}"
        );
    }

    #[tokio::test]
    async fn a_broker_that_answers_no_ping_is_lost() {
        let (near, _far) = tokio::io::duplex(1024);
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let mut session = Session::new(Box::new(near), options(&listener));
        session.keep_alive = Duration::from_millis(20);
        session.ping = Some(Box::pin(sleep(session.keep_alive)));
        let begun = Instant::now();
        let lost = std::future::poll_fn(|context| session.poll_event(context)).await;
        assert!(lost.is_err());
        assert!(begun.elapsed() >= Duration::from_millis(40));
    }
}
