//! Puts the bench up.

use tokio::task::JoinSet;

use super::MqttLink;
use super::delivery::Delivery;
use super::echo::Echo;
use super::lag::watch_lag;
use super::options::{BenchInfo, BenchOptions, BrokerChoice, tap_url};
use super::standing::{listen, probe_topic, standing, without_echo, without_own_topics};
use crate::bench::LinkError;
use crate::bench::endpoint::Endpoint;
use crate::bench::inbox::inbox;
use crate::bench::secure::TlsServer;
use crate::broker::{Difference, EmbeddedBroker, Tested, self_test};
use crate::maps::MapServer;
use crate::tap::{Tap, Upstream};
use tck_journal::Vantage;

/// Starts benches.
pub struct MqttBench;

impl MqttBench {
    /// Starts broker, tap and map server, tests the broker, and connects. When it returns, the standing
    /// subscription is acknowledged and the device may connect.
    ///
    /// # Errors
    /// [`LinkError::Listen`] when a port is taken, [`LinkError::Broker`] when an external broker is not there,
    /// [`LinkError::Setup`] when certificates do not work or the broker fails its self-test.
    pub async fn start(options: BenchOptions) -> Result<(MqttLink, BenchInfo), LinkError> {
        let (reporter, inbox) = inbox(options.clock);
        let tls = options.tls.as_ref().map(TlsServer::new).transpose()?;
        let (embedded, endpoint) = match &options.broker {
            BrokerChoice::Embedded => {
                let broker = EmbeddedBroker::start().await?;
                let endpoint = Endpoint::plain(broker.address());
                (Some(broker), endpoint)
            }
            BrokerChoice::External { url, access } => (None, Endpoint::parse(url, access)?),
        };
        let upstream = Upstream {
            broker: endpoint.clone(),
            embedded: embedded.is_some(),
        };
        let maps = MapServer::start(
            &options.maps_listen,
            options.maps_host.as_deref(),
            tls.clone(),
            reporter.clone(),
        )
        .await?;
        let nodes = nodes(&options)?;
        let (has_own_topics, mut limits) = match self_test(&endpoint, &nodes, &options.own).await? {
            Tested::Keeps(differences) => (true, borne(&differences, &endpoint, &options)?),
            Tested::Forbids(what) => (false, vec![without_own_topics(&what, &endpoint, &options)]),
        };
        let run = uuid::Uuid::new_v4().simple().to_string();
        // Known to nobody on the broker, so that nobody can take it.
        let client_id = options.own.client("");
        let probes = probe_topic(&options.own, &run);
        let own_topic = has_own_topics.then(|| probes.clone());
        let standing = standing(&endpoint, own_topic, &client_id, &options, &reporter).await?;
        let mut tasks = JoinSet::new();
        let echo = if embedded.is_some() || options.tap || options.harness_topics.is_empty() {
            None
        } else {
            let echo = Echo::open(&endpoint, &options, &mut tasks).await?;
            if echo.is_none() {
                limits.push(without_echo(&endpoint, &options));
            }
            echo
        };
        // Last, so that nothing of the device can be missed.
        let tap = if options.tap {
            Some(Tap::start(&options.listen, tls, upstream, reporter.clone()).await?)
        } else {
            None
        };
        let info = BenchInfo {
            device_address: tap
                .as_ref()
                .map_or_else(|| endpoint.address(), |tap| tap.address().to_string()),
            device_url: tap
                .as_ref()
                .map_or_else(|| endpoint.url(), |tap| tap_url(tap.address(), options.tls.is_some())),
            broker_address: endpoint.address(),
            broker: Endpoint {
                authority: options.authority.clone(),
                ..endpoint.clone()
            },
            maps_address: maps.address(),
            limits,
        };
        if let Some(broker) = &embedded {
            let (mut ended, reporter, endpoint) = (broker.ended(), reporter.clone(), endpoint.clone());
            tasks.spawn(async move {
                if let Ok(reason) = ended.wait_for(Option::is_some).await {
                    reporter.broken(endpoint.lost(reason.clone().unwrap_or_default()));
                }
            });
        }
        tasks.spawn(listen(standing.events, endpoint.clone(), probes, reporter.clone()));
        tasks.spawn(watch_lag(reporter.clone()));
        let shown = options.tls.as_ref().map(|files| files.certificate.clone());
        let link = MqttLink {
            trusted: options.authority.iter().cloned().chain(shown).collect(),
            clock: options.clock,
            vantage: if options.tap { Vantage::Tap } else { Vantage::Subscriber },
            endpoint,
            own: options.own,
            delivery: (embedded.is_none() && options.tap).then(|| Delivery::new(options.device_topics.clone())),
            echo,
            device_topics: options.device_topics,
            has_own_topics,
            run,
            client_id,
            client: standing.client,
            inbox,
            reporter,
            tap,
            maps,
            embedded,
            tasks,
            requests: 0,
            probes: 0,
            broken: None,
        };
        Ok((link, info))
    }
}

/// The other nodes of the broker's cluster.
fn nodes(options: &BenchOptions) -> Result<Vec<Endpoint>, LinkError> {
    let BrokerChoice::External { access, .. } = &options.broker else {
        return Ok(Vec::new());
    };
    options.cluster.iter().map(|url| Endpoint::parse(url, access)).collect()
}

/// What a broker does differently, as limits of the report.
fn borne(differences: &[Difference], endpoint: &Endpoint, options: &BenchOptions) -> Result<Vec<String>, LinkError> {
    for topic in options.device_topics.iter().chain(&options.harness_topics) {
        if let Some(difference) = differences.iter().find(|difference| difference.spoils(topic)) {
            let text = format!("{} One of them would be {topic}", difference.limit(&endpoint.url()));
            return Err(LinkError::Setup(text));
        }
    }
    Ok(differences.iter().map(|one| one.limit(&endpoint.url())).collect())
}
