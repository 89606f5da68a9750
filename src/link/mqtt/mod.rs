//! The real bench: broker, tap, map server and the harness's own MQTT connection, behind one [`Link`].
//!
//! Everything that happens comes through one inbox, stamped on arrival. The bench owns all tasks and sockets;
//! [`MqttLink::stop`] closes them.

mod delivery;
mod fresh;
mod standing;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout};

use crate::bench::client::Client;
use crate::bench::endpoint::{Credentials, Endpoint};
use crate::bench::inbox::{Inbox, inbox};
use crate::bench::own::OwnNames;
use crate::bench::tls::{self, TlsFiles};
use crate::bench::{LinkError, Offer, Outgoing, Vantage};
use crate::broker::{EmbeddedBroker, Tested, self_test};
use crate::clock::{Moment, Stamp, WallClock};
use crate::journal::event::{Event, LinkFault, Occurrence, Source};
use crate::link::Link;
use crate::maps::MapServer;
use crate::tap::{Tap, Upstream};
use delivery::Delivery;
use standing::{listen, own_client, probe_topic, rules, standing, without_own_topics};

pub use crate::bench::inbox::Reporter;

/// How long the broker may take to accept the harness, or to serve a fresh subscriber.
const ANSWER_LIMIT: Duration = Duration::from_secs(10);

/// A harness that is late by less is in time.
const LAG: Duration = Duration::from_millis(100);
/// How often it looks whether it is late.
const LOOK: Duration = Duration::from_millis(20);

fn lag_of(late: Duration) -> Event {
    Event::Lag {
        micros: u64::try_from(late.as_micros()).unwrap_or(u64::MAX),
        of: "timer".to_owned(),
    }
}

/// Measures by how much timers of the harness are late, for want of a processor or for whatever reason.
async fn watch_lag(reporter: Reporter) {
    loop {
        let due = Instant::now() + LOOK;
        sleep_until(due).await;
        let late = due.elapsed();
        if late >= LAG {
            reporter.report(Source::Harness, None, lag_of(late)).await;
        }
    }
}

/// Which broker is used.
#[derive(Clone, Debug)]
pub enum BrokerChoice {
    /// The embedded one.
    Embedded,
    /// Another one.
    External {
        /// `mqtt://host:port`, or with `mqtts`, `ws` or `wss`.
        url: String,
        /// PEM file to check its certificate against.
        authority: Option<PathBuf>,
        /// How the harness logs in. The device's own credentials pass the tap untouched.
        credentials: Option<Credentials>,
    },
}

/// What the bench is to be.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// Where the tap listens for the device; port 0 lets the system choose.
    pub listen: String,
    /// The broker.
    pub broker: BrokerChoice,
    /// Whether there is a tap. Without one the device connects to the broker itself.
    pub tap: bool,
    /// Certificate of the tap; without one it speaks plain TCP.
    pub tls: Option<TlsFiles>,
    /// PEM file with an authority that mock vehicles trust when they fetch maps.
    pub authority: Option<PathBuf>,
    /// Where the map server listens.
    pub maps_listen: String,
    /// Host name in the links to map files, as the device knows this machine; where the map server listens unless said.
    pub maps_host: Option<String>,
    /// How the harness names itself.
    pub own: OwnNames,
    /// Topic filters of the standing subscription: the topics of the device.
    pub device_topics: Vec<String>,
    /// The clock of the run.
    pub clock: WallClock,
}

impl BenchOptions {
    /// A bench on loopback with everything embedded, on ports the system chooses.
    #[must_use]
    pub fn loopback(device_topics: Vec<String>) -> Self {
        Self {
            listen: "127.0.0.1:0".to_owned(),
            broker: BrokerChoice::Embedded,
            tap: true,
            tls: None,
            authority: None,
            maps_listen: "127.0.0.1:0".to_owned(),
            maps_host: None,
            own: OwnNames::default(),
            device_topics,
            clock: WallClock::start(),
        }
    }
}

/// Where everything is.
#[derive(Clone, Debug)]
pub struct BenchInfo {
    /// `host:port` the device connects to: the tap, or the broker when there is no tap.
    pub device_address: String,
    /// Whether it has to speak TLS there.
    pub device_tls: bool,
    /// `host:port` of the broker.
    pub broker_address: String,
    /// The broker, for clients of the harness itself.
    pub broker: Endpoint,
    /// Where the map server listens.
    pub maps_address: SocketAddr,
    /// What the broker does not allow, and what cannot be said therefore.
    pub limits: Vec<String>,
}

impl BenchInfo {
    /// What a device is told to connect to. A bench that listens on every address is reached at one of them.
    #[must_use]
    pub fn device_url(&self) -> String {
        let scheme = if self.device_tls { "mqtts" } else { "mqtt" };
        let address = self.device_address.parse::<SocketAddr>().ok();
        let address = address.filter(|address| address.ip().is_unspecified()).and_then(|any| {
            let own = own_address(any)?;
            Some(SocketAddr::new(own, any.port()).to_string())
        });
        format!("{scheme}://{}", address.as_deref().unwrap_or(&self.device_address))
    }
}

/// The address of this machine from which others are reached. Nothing is sent.
fn own_address(like: SocketAddr) -> Option<std::net::IpAddr> {
    // Addresses that are kept for documents: nobody has them, so the usual way out is taken.
    let (from, to) = if like.is_ipv4() {
        ("0.0.0.0:0", "192.0.2.1:9")
    } else {
        ("[::]:0", "[2001:db8::1]:9")
    };
    let socket = std::net::UdpSocket::bind(from).ok()?;
    socket.connect(to).ok()?;
    let own = socket.local_addr().ok()?.ip();
    (!own.is_unspecified()).then_some(own)
}

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
        let tls = options.tls.as_ref().map(tls::server).transpose()?;
        let (embedded, endpoint) = match &options.broker {
            BrokerChoice::Embedded => {
                let broker = EmbeddedBroker::start().await?;
                let endpoint = Endpoint::plain(broker.address());
                (Some(broker), endpoint)
            }
            BrokerChoice::External {
                url,
                authority,
                credentials,
            } => (None, Endpoint::parse(url, authority.as_deref(), credentials.clone())?),
        };
        let upstream = Upstream {
            broker: endpoint.clone(),
            embedded: embedded.is_some(),
        };
        let maps = MapServer::start(&options.maps_listen, options.maps_host.as_deref(), reporter.clone()).await?;
        let limits = match self_test(&endpoint, &options.own).await? {
            Tested::Keeps => Vec::new(),
            Tested::Forbids(what) => vec![without_own_topics(&what, &endpoint, &options)],
        };
        let has_own_topics = limits.is_empty();
        let run = uuid::Uuid::new_v4().simple().to_string();
        // Known to nobody on the broker, so that nobody can take it.
        let client_id = options.own.client("");
        let probes = probe_topic(&options.own, &run);
        let own_topic = has_own_topics.then(|| probes.clone());
        let standing = standing(&endpoint, own_topic, &client_id, &options, &reporter).await?;
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
            device_tls: if options.tap {
                options.tls.is_some()
            } else {
                endpoint.tls.is_some()
            },
            broker_address: endpoint.address(),
            broker: Endpoint {
                authority: options.authority.clone(),
                ..endpoint.clone()
            },
            maps_address: maps.address(),
            limits,
        };
        let access_rules = rules(&endpoint, &options);
        let mut tasks = JoinSet::new();
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
        let link = MqttLink {
            clock: options.clock,
            vantage: if options.tap { Vantage::Tap } else { Vantage::Subscriber },
            endpoint,
            own: options.own,
            rules: access_rules,
            delivery: (embedded.is_none() && options.tap).then(Delivery::default),
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

/// The real bench as the engine sees it.
pub struct MqttLink {
    clock: WallClock,
    vantage: Vantage,
    endpoint: Endpoint,
    own: OwnNames,
    /// The access rules that allow all this.
    rules: String,
    /// Whether a broker of somebody else delivers; nobody knows without a tap.
    delivery: Option<Delivery>,
    /// Whether the broker allows topics of the harness.
    has_own_topics: bool,
    run: String,
    client_id: String,
    client: Client,
    inbox: Inbox,
    reporter: Reporter,
    tap: Option<Tap>,
    maps: MapServer,
    embedded: Option<EmbeddedBroker>,
    tasks: JoinSet<()>,
    requests: u64,
    probes: u64,
    /// Why the broker is gone, once it is.
    broken: Option<String>,
}

impl MqttLink {
    /// For other sources of the harness, such as a mock AGV that reports what it sends.
    #[must_use]
    pub fn reporter(&self) -> Reporter {
        self.reporter.clone()
    }

    /// Takes the bench down: connections, ports, broker.
    pub async fn stop(mut self) {
        self.tasks.abort_all();
        if let Some(tap) = self.tap {
            tap.stop().await;
        }
        self.client.disconnect().await;
        self.maps.stop().await;
        if let Some(broker) = self.embedded {
            broker.stop().await;
        }
    }

    fn check(&self) -> Result<(), LinkError> {
        match &self.broken {
            Some(reason) => Err(self.endpoint.lost(reason.clone())),
            None => Ok(()),
        }
    }

    fn note<T>(&mut self, result: Result<T, LinkError>) -> Result<T, LinkError> {
        if let Err(LinkError::Broker { reason, .. }) = &result {
            self.broken = Some(reason.clone());
        }
        result
    }

    /// The next thing that happens.
    async fn take(&mut self, until: Moment) -> Result<Option<Occurrence>, LinkError> {
        let ready = self.inbox.ready();
        if let Some(occurrence) = self.note(ready)? {
            return Ok(Some(occurrence));
        }
        self.check()?;
        let begun = self.clock.now().moment;
        let deadline = Instant::from_std(self.clock.instant(until));
        let next = tokio::select! {
            biased;
            next = self.inbox.next() => next.map(Some),
            () = sleep_until(deadline) => Ok(None),
        };
        let next = self.note(next)?;
        // The machine did not let the harness go on in time: what came meanwhile has not been read either.
        let late = self.clock.now().moment.since(until.max(begun));
        if next.is_none() && late >= LAG {
            return Ok(Some(Occurrence::harness(self.clock.now(), lag_of(late))));
        }
        Ok(next)
    }

    fn send(&mut self, message: Outgoing) -> Result<(), LinkError> {
        self.check()?;
        if self.client.publish(message) {
            return Ok(());
        }
        let result = Err(self.endpoint.lost("the harness's own connection is gone"));
        self.note(result)
    }
}

impl Link for MqttLink {
    fn now(&self) -> Stamp {
        self.clock.now()
    }

    fn vantage(&self) -> Vantage {
        self.vantage
    }

    async fn publish(&mut self, message: Outgoing) -> Result<(), LinkError> {
        let now = self.clock.now().moment;
        if let Some(delivery) = &mut self.delivery {
            delivery.sent(&message.topic, now);
        }
        self.send(message)
    }

    async fn next(&mut self, until: Moment) -> Result<Option<Occurrence>, LinkError> {
        let next = self.take(until).await?;
        let Some(delivery) = &mut self.delivery else {
            return Ok(next);
        };
        let now = match &next {
            Some(occurrence) => {
                delivery.observe(occurrence);
                // What has come since is still to be read.
                occurrence.at.moment
            }
            None => self.clock.now().moment,
        };
        match delivery.overdue(now) {
            None => Ok(next),
            Some(topic) => Err(LinkError::Forbidden {
                address: self.endpoint.address(),
                what: format!("that what the harness publishes on {topic} reaches the device, which subscribes to it"),
                rules: self.rules.clone(),
            }),
        }
    }

    async fn fault(&mut self, fault: LinkFault) -> Result<(), LinkError> {
        let Some(tap) = &self.tap else {
            return Err(LinkError::NeedsTap {
                what: "a link fault".to_owned(),
            });
        };
        tap.fault(&fault).await;
        if let Some(delivery) = &mut self.delivery {
            delivery.fault(&fault);
        }
        Ok(())
    }

    async fn fresh_subscriber(&mut self, topic: &str) -> Result<u64, LinkError> {
        self.check()?;
        self.requests += 1;
        let request = self.requests;
        let end = self
            .has_own_topics
            .then(|| format!("{}/{}/end/{request}", self.own.topics, self.run));
        let id = format!("{}-{request}", self.client_id);
        let topics = [topic.to_owned()].into_iter().chain(end.clone());
        let options = own_client(&self.endpoint, &id, topics);
        let (endpoint, reporter) = (self.endpoint.clone(), self.reporter.clone());
        while self.tasks.try_join_next().is_some() {}
        self.tasks.spawn(async move {
            let served = timeout(ANSWER_LIMIT, fresh::look(request, &options, end, &reporter)).await;
            if let Err(reason) = served.unwrap_or_else(|_| Err("it does not serve a fresh subscriber".to_owned())) {
                reporter.broken(endpoint.lost(reason));
            }
        });
        Ok(request)
    }

    async fn probe(&mut self) -> Result<u64, LinkError> {
        self.probes += 1;
        let probe = self.probes;
        if !self.has_own_topics {
            // It would never come back; what waits for it says that nothing is known.
            return self.check().map(|()| probe);
        }
        self.send(Outgoing {
            topic: probe_topic(&self.own, &self.run),
            payload: probe.to_string().into(),
            qos: 1,
            retain: false,
        })?;
        Ok(probe)
    }

    async fn serve(&mut self, offer: Offer) -> Result<String, LinkError> {
        Ok(self.maps.offer(offer))
    }
}
