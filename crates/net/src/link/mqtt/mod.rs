//! The real bench: broker, tap, map server and the harness's own MQTT connection, behind one [`Link`].
//!
//! Everything that happens comes through one inbox, stamped on arrival. The bench owns all tasks and sockets;
//! [`MqttLink::stop`] closes them.

mod delivery;
mod echo;
mod fresh;
mod lag;
mod options;
mod standing;
mod start;

use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout};

use crate::bench::client::Client;
use crate::bench::endpoint::Endpoint;
use crate::bench::inbox::Inbox;
use crate::bench::kin::Kin;
use crate::bench::own::{OwnNames, User};
use crate::bench::{LinkError, Offer};
use crate::broker::EmbeddedBroker;
use crate::link::Link;
use crate::maps::MapServer;
use crate::tap::Tap;
use delivery::{Delivery, Undelivered};
use echo::Echo;
use lag::{LAG, lag_of};
use options::ANSWER_LIMIT;
use standing::{own_client, probe_topic, user};
use tck_base::clock::{Moment, Stamp, WallClock};
use tck_base::device::Publication;
use tck_journal::event::{Event, LinkFault, Occurrence};
use tck_journal::{Spread, Vantage};

pub use crate::bench::inbox::Reporter;
pub use options::{BenchInfo, BenchOptions, BrokerChoice};
pub use start::MqttBench;

/// The real bench as the engine sees it.
pub struct MqttLink {
    clock: WallClock,
    vantage: Vantage,
    endpoint: Endpoint,
    own: OwnNames,
    /// The topics of the device.
    device_topics: Vec<String>,
    /// Whether a broker of somebody else delivers; nobody knows without a tap.
    delivery: Option<Delivery>,
    /// Whether it takes what the harness publishes, where there is no tap.
    echo: Option<Echo>,
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
    trusted: Vec<std::path::PathBuf>,
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

    /// What belongs to the program that the run has started, where connections can be traced to it.
    #[must_use]
    pub fn kin(&self) -> Option<Kin> {
        let tap = self.tap.as_ref().filter(|_| Kin::TELLS)?;
        Some(tap.kin())
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

    /// What the broker does not deliver, as an error.
    fn drops(&self, undelivered: Undelivered) -> LinkError {
        match undelivered {
            Undelivered::ToDevice(topic) => {
                let what =
                    format!("that what the harness publishes on {topic} reaches the device, which subscribes to it");
                self.forbids(what, None)
            }
            Undelivered::ToHarness {
                topic,
                client,
                delivered_before: true,
                ..
            } => self.endpoint.lost(format!(
                "it does not deliver any more what client `{client}` publishes on {topic}"
            )),
            Undelivered::ToHarness {
                topic, client, user, ..
            } => {
                let of = user
                    .as_deref()
                    .map_or(String::new(), |user| format!(" of user `{user}`"));
                let what = format!("that what client `{client}`{of} publishes on {topic} reaches the harness");
                self.forbids(what, Some(User(user)))
            }
        }
    }

    /// The broker does not allow something; the rules that allow it to the harness, and to another user.
    fn forbids(&self, what: String, other: Option<User>) -> LinkError {
        LinkError::Forbidden {
            broker: self.endpoint.url(),
            what,
            rules: self
                .own
                .access_rules(&user(&self.endpoint), other.as_ref(), &self.device_topics),
        }
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

    fn send(&mut self, message: Publication) -> Result<(), LinkError> {
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

    async fn publish(&mut self, message: Publication) -> Result<(), LinkError> {
        let now = self.clock.now().moment;
        if let Some(delivery) = &mut self.delivery {
            delivery.sent(&message.topic, now);
        }
        if let Some(echo) = &mut self.echo {
            echo.sent(&message.topic, now);
        }
        self.send(message)
    }

    async fn next(&mut self, until: Moment) -> Result<Option<Occurrence>, LinkError> {
        let next = self.take(until).await?;
        // What has come since the next occurrence is still to be read.
        let now = match &next {
            Some(occurrence) => occurrence.at.moment,
            None => self.clock.now().moment,
        };
        if let Some(delivery) = &mut self.delivery {
            if let Some(occurrence) = &next {
                delivery.observe(occurrence);
            }
            if let Some(undelivered) = delivery.overdue(now) {
                return Err(self.drops(undelivered));
            }
        }
        if let Some(echo) = &mut self.echo {
            match next.as_ref().map(|occurrence| &occurrence.event) {
                // A mock vehicle of the harness.
                Some(Event::Sent { topic, .. }) => echo.sent(topic, now),
                Some(Event::Lag { .. }) => echo.wait_again(now),
                _ => {}
            }
            if let Some(topic) = echo.overdue(now) {
                return Err(self.forbids(format!("that the harness publishes on {topic}"), None));
            }
        }
        Ok(next)
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
        self.send(Publication {
            topic: probe_topic(&self.own, &self.run),
            payload: probe.to_string().into(),
            qos: 1,
            retain: false,
        })?;
        Ok(probe)
    }

    fn time_to_pass_on(&self) -> Option<Spread> {
        self.reporter.time_to_pass_on()
    }

    async fn serve(&mut self, offer: Offer) -> Result<String, LinkError> {
        Ok(self.maps.offer(offer))
    }

    fn trusted(&self) -> Vec<std::path::PathBuf> {
        self.trusted.clone()
    }
}
