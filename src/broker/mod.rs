//! The embedded MQTT broker, and a self-test for whatever broker is used.
//!
//! The broker sits on loopback behind the tap, keeps everything in memory and lets anybody in. Its known
//! peculiarities are absorbed by the tap (`tap::rewrite`).

use std::net::SocketAddr;
use std::time::Duration;

use mqtt5::broker::config::{BrokerConfig, RateLimitConfig, StorageBackend, StorageConfig};
use mqtt5::broker::{BrokerShutdownHandle, MqttBroker};
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::bench::LinkError;

pub use self_test::self_test;

mod self_test;

/// Largest packet the broker takes.
const LARGEST_PACKET: usize = 256 << 20;
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
