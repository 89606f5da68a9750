//! A bench to test with, a device that behaves, and what to look for in what happens.

use std::time::Duration;

use bytes::Bytes;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::mpsc;

use vda5050_tck::bench::client::{Client, ClientEvent, ClientOptions};
use vda5050_tck::bench::endpoint::{Access, Endpoint};
use vda5050_tck::device::Publication;
use vda5050_tck::journal::event::{Close, Event, LinkFault, Occurrence, Packet};
use vda5050_tck::link::Link;
use vda5050_tck::link::mqtt::{BenchInfo, BenchOptions, MqttBench, MqttLink};

pub struct Rig {
    pub link: MqttLink,
    pub info: BenchInfo,
}

pub fn topics() -> Vec<String> {
    vec!["d/state".to_owned(), "d/connection".to_owned()]
}

pub async fn rig() -> Rig {
    rig_with(BenchOptions::loopback(topics())).await
}

pub async fn rig_with(options: BenchOptions) -> Rig {
    let (link, info) = MqttBench::start(options).await.unwrap();
    Rig { link, info }
}

impl Rig {
    /// Collects what happens until `wanted` has come, and that too. Panics when it does not come.
    pub async fn until(&mut self, what: &str, mut wanted: impl FnMut(&Occurrence) -> bool) -> Vec<Occurrence> {
        let deadline = self.link.now().after(Duration::from_secs(10)).moment;
        let mut seen = Vec::new();
        while let Some(occurrence) = self.link.next(deadline).await.unwrap() {
            let found = wanted(&occurrence);
            seen.push(occurrence);
            if found {
                return seen;
            }
        }
        panic!("{what} never came; seen: {seen:#?}");
    }

    /// Everything that happens within `millis`.
    pub async fn during(&mut self, millis: u64) -> Vec<Occurrence> {
        let deadline = self.link.now().after(Duration::from_millis(millis)).moment;
        let mut seen = Vec::new();
        while let Some(occurrence) = self.link.next(deadline).await.unwrap() {
            seen.push(occurrence);
        }
        seen
    }

    pub async fn device(&mut self) -> TestDevice {
        let mut device = TestDevice::open(&self.info, "device", 20);
        self.until("the device's subscription", |o| {
            is_packet(o, |p| matches!(p, Packet::Suback { .. }))
        })
        .await;
        // What is not read when a socket is closed turns the end into a reset.
        assert_eq!(device.event().await, ClientEvent::Connected);
        device
    }

    pub async fn fault(&mut self, fault: LinkFault) {
        self.link.fault(fault).await.unwrap();
    }

    pub async fn order(&mut self, text: &str, qos: u8) {
        self.link.publish(message("d/order", text, qos, false)).await.unwrap();
    }
}

pub struct TestDevice {
    pub client: Client,
    pub events: mpsc::Receiver<ClientEvent>,
}

impl TestDevice {
    pub fn open(info: &BenchInfo, client_id: &str, keep_alive: u64) -> Self {
        let (client, events) = Client::open(&ClientOptions {
            endpoint: Endpoint::parse(&info.device_address, &Access::default()).unwrap(),
            client_id: client_id.to_owned(),
            keep_alive: Duration::from_secs(keep_alive),
            clean_session: true,
            will: Some(message("d/connection", "broken", 1, true)),
            subscriptions: vec![("d/order".to_owned(), 2)],
        });
        Self { client, events }
    }

    pub fn send(&self, topic: &str, text: &str, qos: u8, retain: bool) {
        assert!(self.client.publish(message(topic, text, qos, retain)));
    }

    pub async fn event(&mut self) -> ClientEvent {
        tokio::time::timeout(Duration::from_secs(10), self.events.recv())
            .await
            .unwrap()
            .unwrap()
    }

    pub async fn lost(&mut self) {
        while !matches!(self.event().await, ClientEvent::Lost(_)) {}
    }

    pub async fn order(&mut self) -> String {
        loop {
            if let ClientEvent::Message { payload, .. } = self.event().await {
                return String::from_utf8(payload.to_vec()).unwrap();
            }
        }
    }
}

pub fn message(topic: &str, text: &str, qos: u8, retain: bool) -> Publication {
    Publication {
        topic: topic.to_owned(),
        payload: Bytes::copy_from_slice(text.as_bytes()),
        qos,
        retain,
    }
}

pub fn is_packet(occurrence: &Occurrence, wanted: impl FnOnce(&Packet) -> bool) -> bool {
    matches!(&occurrence.event, Event::Packet { packet, .. } if wanted(packet))
}

pub fn is_message(occurrence: &Occurrence, wanted: &str) -> bool {
    matches!(&occurrence.event, Event::Message { payload, .. } if payload.bytes() == wanted.as_bytes())
}

pub fn is_closed(occurrence: &Occurrence, wanted: Close) -> bool {
    matches!(&occurrence.event, Event::Closed { how, .. } if *how == wanted)
}

pub fn texts(seen: &[Occurrence]) -> Vec<String> {
    (seen.iter())
        .filter_map(|o| match &o.event {
            Event::Message { payload, .. } => Some(String::from_utf8_lossy(payload.bytes()).into_owned()),
            _ => None,
        })
        .collect()
}

/// A CONNECT of MQTT 3.1.1 with client id `raw`, clean session and no keep-alive.
pub const CONNECT: &[u8] = b"\x10\x0f\x00\x04MQTT\x04\x02\x00\x00\x00\x03raw";

pub async fn raw_device(rig: &mut Rig) -> TcpStream {
    let mut socket = TcpStream::connect(&rig.info.device_address).await.unwrap();
    socket.write_all(CONNECT).await.unwrap();
    let mut connack = [0; 4];
    socket.read_exact(&mut connack).await.unwrap();
    assert_eq!(connack, [0x20, 2, 0, 0]);
    rig.until("CONNACK", |o| {
        is_packet(o, |p| matches!(p, Packet::Connack { code: 0, .. }))
    })
    .await;
    socket
}

/// A tool the test needs is not there: in CI that is a failure, elsewhere the test says so and passes.
pub fn missing(tool: &str) {
    assert!(
        std::env::var_os("CI").is_none(),
        "{tool} is not installed, and CI must have it"
    );
    eprintln!("skipped: {tool} is not installed");
}
