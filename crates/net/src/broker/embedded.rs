//! The embedded MQTT broker, of the crate `mqtt5`.

use std::net::SocketAddr;
use std::time::Duration;

use mqtt5::broker::config::{BrokerConfig, RateLimitConfig, StorageBackend, StorageConfig};
use mqtt5::broker::{BrokerShutdownHandle, MqttBroker};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::bench::LinkError;

/// Largest packet the broker takes. It announces it to clients of MQTT 5, and some of them refuse to connect when they are
/// told more than the four bytes of a remaining length can say.
const LARGEST_PACKET: usize = (256 << 20) - 1;
/// How many messages may wait for one client.
const WAITING: usize = 100_000;
/// How long the broker may take to begin.
const START_LIMIT: Duration = Duration::from_secs(10);
/// How long an orderly stop may take before the broker is stopped the hard way.
const STOP_LIMIT: Duration = Duration::from_millis(200);

/// A running embedded broker.
pub struct EmbeddedBroker {
    address: SocketAddr,
    shutdown: BrokerShutdownHandle,
    running: JoinHandle<()>,
    ended: watch::Receiver<Option<String>>,
}

impl EmbeddedBroker {
    /// Starts a broker on loopback, on a port the system chooses.
    ///
    /// # Errors
    /// [`LinkError::Listen`] when it cannot listen, [`LinkError::Setup`] when it does not begin.
    pub async fn start() -> Result<Self, LinkError> {
        let mut config = BrokerConfig::new();
        config.bind_addresses = vec![SocketAddr::from(([127, 0, 0, 1], 0))];
        config.max_packet_size = LARGEST_PACKET;
        config.client_channel_capacity = WAITING;
        config.sys_topics_enabled = false;
        config.auth_config.allow_anonymous = true;
        config.auth_config.rate_limit = RateLimitConfig {
            enabled: false,
            ..RateLimitConfig::default()
        };
        // Without storage there are no sessions, no redelivery and no delayed wills.
        config.storage_config = StorageConfig {
            backend: StorageBackend::Memory,
            enable_persistence: true,
            max_queued_messages_per_client: WAITING,
            ..StorageConfig::default()
        };
        let listen = |reason: String| LinkError::Listen {
            address: "127.0.0.1:0".to_owned(),
            reason,
        };
        let mut broker = MqttBroker::with_config(config)
            .await
            .map_err(|error| listen(error.to_string()))?;
        let address = broker
            .local_addr()
            .ok_or_else(|| listen("the embedded broker opened no port".to_owned()))?;
        let mut ready = broker.ready_receiver();
        let shutdown = broker.shutdown_handle();
        let (end, ended) = watch::channel(None);
        let running = tokio::spawn(async move {
            let reason = match broker.run().await {
                Ok(()) => "the embedded broker has ended".to_owned(),
                Err(error) => format!("the embedded broker has failed: {error}"),
            };
            let _ = end.send(Some(reason));
        });
        match tokio::time::timeout(START_LIMIT, ready.wait_for(|ready| *ready)).await {
            Ok(Ok(_)) => {}
            _ => {
                return Err(LinkError::Setup(
                    "the embedded broker does not begin to work".to_owned(),
                ));
            }
        }
        Ok(Self {
            address,
            shutdown,
            running,
            ended,
        })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Becomes the reason when the broker ends by itself.
    pub(crate) fn ended(&self) -> watch::Receiver<Option<String>> {
        self.ended.clone()
    }

    /// Stops it. A silent connection would keep an orderly stop waiting for seconds, so it is not waited for long.
    pub async fn stop(mut self) {
        self.shutdown.shutdown();
        if tokio::time::timeout(STOP_LIMIT, &mut self.running).await.is_err() {
            self.running.abort();
            let _ = (&mut self.running).await;
        }
    }
}

impl Drop for EmbeddedBroker {
    fn drop(&mut self) {
        self.shutdown.shutdown();
        self.running.abort();
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
    use tokio::net::TcpStream;

    use super::*;

    /// The properties of the CONNACK that a client of MQTT 5 gets.
    async fn announced() -> Vec<u8> {
        let broker = EmbeddedBroker::start().await.unwrap();
        let mut socket = TcpStream::connect(broker.address()).await.unwrap();
        let connect = b"\x10\x0e\x00\x04MQTT\x05\x02\x00\x3c\x00\x00\x01a";
        socket.write_all(connect).await.unwrap();
        let mut head = [0; 2];
        socket.read_exact(&mut head).await.unwrap();
        assert_eq!(head[0], 0x20, "no CONNACK");
        let mut body = vec![0; head[1].into()];
        socket.read_exact(&mut body).await.unwrap();
        assert_eq!(body[1], 0, "refused");
        body[3..].to_vec()
    }

    /// How long the value of a property is.
    fn length(property: u8, rest: &[u8]) -> usize {
        match property {
            0x11 | 0x27 => 4,
            0x13 | 0x21 | 0x22 => 2,
            0x24 | 0x25 | 0x28 | 0x29 | 0x2a => 1,
            0x12 | 0x15 | 0x1a | 0x1c | 0x1f => 2 + usize::from(u16::from_be_bytes([rest[0], rest[1]])),
            other => panic!("property {other:#x}"),
        }
    }

    #[tokio::test]
    async fn no_client_is_told_of_a_packet_that_mqtt_cannot_have() {
        let properties = announced().await;
        let mut rest = properties.as_slice();
        while let [property, value @ ..] = rest {
            let (value, after) = value.split_at(length(*property, value));
            if *property == 0x27 {
                let largest = u32::from_be_bytes(value.try_into().unwrap());
                assert!(largest <= 268_435_455, "{largest}");
            }
            rest = after;
        }
    }
}
