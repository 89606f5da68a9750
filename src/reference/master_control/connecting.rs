//! Its connection: how it connects, what it subscribes to, its will, and what a lost link does to it.

use std::time::Duration;

use serde_json::json;

use crate::clock::{Moment, Stamp};
use crate::reference::{ConnectOptions, Output, Publication};

use super::MasterControl;
use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;

/// The link to the broker.
#[derive(Clone, Debug)]
pub(super) struct Connection {
    pub(super) online: bool,
    pub(super) attempt_at: Option<Moment>,
    pub(super) shut_down: bool,
    pub(super) returning: bool,
}

impl Connection {
    /// Not connected yet, and eager to be.
    pub(super) fn new() -> Self {
        Self {
            online: false,
            attempt_at: Some(Moment::START),
            shut_down: false,
            returning: false,
        }
    }
}

impl MasterControl {
    /// What to connect with.
    pub(super) fn options(&mut self, now: Stamp) -> ConnectOptions {
        self.advance(now);
        let site = &self.site;
        let silent = self.connection.returning && site.faults.has(F::NotSubscribedAgain);
        let topics = [
            ("state", F::StateNotSubscribed),
            ("connection", F::ConnectionNotSubscribed),
            ("factsheet", F::FactsheetNotSubscribed),
        ];
        let mut names: Vec<&str> = topics
            .into_iter()
            .filter(|(_, fault)| !site.faults.has(*fault) && !silent)
            .map(|(name, _)| name)
            .filter(|name| {
                let again = self.connection.returning && *name == "factsheet";
                !(again && site.faults.has(F::R2FactsheetUnsubscribedAfterReconnect))
            })
            .collect();
        if !silent {
            if !site.takes(T::R3VisualizationNotSubscribed) {
                names.push("visualization");
            }
            if site.takes(T::R1ListensToOwnTopics) {
                names.extend(["order", "instantActions"]);
            }
        }
        let mut subscriptions: Vec<(String, u8)> = Vec::new();
        for (index, vehicle) in self.fleet.iter().enumerate() {
            for name in &names {
                if index > 0 && *name == "factsheet" && site.faults.has(F::R3FactsheetOfFirstVehicleOnly) {
                    continue;
                }
                let Some(topic) = vehicle.topic(name) else { continue };
                let wide = with_wildcards(topic, name);
                let topic = if site.takes(T::SubscribesWithWildcards) {
                    with_wildcards(topic, name)
                } else {
                    topic.to_owned()
                };
                let reliably = *name == "connection" && !site.faults.has(F::ConnectionQosZero);
                let qos = u8::from(reliably || site.takes(T::SubscribesWithQosOne));
                if !subscriptions.iter().any(|(known, _)| *known == topic) {
                    subscriptions.push((topic, qos));
                }
                if site.takes(T::R3SubscribesTwice) && !subscriptions.iter().any(|(known, _)| *known == wide) {
                    subscriptions.push((wide, qos));
                }
            }
        }
        if site.takes(T::R2SubscribesToEverything) && !silent {
            subscriptions = vec![(self.everything(), 1)];
        }
        ConnectOptions {
            level: match () {
                () if site.faults.has(F::OldMqtt) => 3,
                () if site.takes(T::NewestMqtt) => 5,
                () => 4,
            },
            client_id: if site.takes(T::R1NewClientIdEachTime) {
                format!("{}-{}", site.config.name, now.utc.as_millisecond())
            } else {
                site.config.name.clone()
            },
            keep_alive: if site.takes(T::R2LongKeepAlive) {
                Duration::from_secs(60)
            } else {
                site.config.keep_alive
            },
            clean_session: !site.takes(T::SessionKept),
            will: self.r2_will(),
            subscriptions,
        }
    }

    /// A filter for all topics of the interface.
    fn everything(&self) -> String {
        let topic = self.fleet.first().and_then(|vehicle| vehicle.topic("state"));
        let levels: Vec<&str> = topic.unwrap_or_default().split('/').collect();
        match levels.len().checked_sub(3) {
            Some(kept) if kept > 0 => format!("{}/#", levels[..kept].join("/")),
            _ => "#".to_owned(),
        }
    }

    /// A last will: of its own, or for a vehicle (`r2-will-on-vehicle-topic`).
    fn r2_will(&self) -> Option<Publication> {
        let site = &self.site;
        if site.faults.has(F::R2WillOnVehicleTopic) {
            let vehicle = self.fleet.first()?;
            let message = json!({
                "headerId": 0,
                "timestamp": site.timestamp(),
                "version": site.config.version,
                "manufacturer": vehicle.config.manufacturer,
                "serialNumber": vehicle.config.serial_number,
                "connectionState": "CONNECTIONBROKEN",
            });
            return Some(Publication {
                topic: vehicle.topic("connection")?.to_owned(),
                payload: message.to_string().into_bytes(),
                qos: 1,
                retain: true,
            });
        }
        site.takes(T::R2WillOfItsOwn).then(|| Publication {
            topic: format!("{}/status", site.config.name),
            payload: b"offline".to_vec(),
            qos: 1,
            retain: true,
        })
    }

    /// The broker accepted. What was sent and not seen is given its time again.
    pub(super) fn connected(&mut self) {
        let returning = self.connection.returning;
        self.connection = Connection {
            online: true,
            attempt_at: None,
            shut_down: false,
            returning: true,
        };
        self.site.online = true;
        let restarts = self.site.takes(T::HeaderIdRestarts);
        let now = self.site.now.moment;
        for vehicle in &mut self.fleet {
            if restarts {
                vehicle.header_ids.clear();
            }
            vehicle.give_time(now);
            vehicle.at(now);
            if self.site.faults.has(F::R3AnnouncesItselfOnline) {
                self.site.r3_announce(vehicle);
            }
            if returning {
                self.site.r1_returned(vehicle);
            } else if self.site.takes(T::R6ClearsRetainedOrderTopics) {
                self.site.r6_clear(vehicle);
            }
        }
        if returning {
            if !self.site.faults.has(F::R5ActionIdsRestartAfterReconnect) {
                self.site.r1_actions = 0;
            }
            self.site.r4_orders = 0;
        }
    }

    /// The link broke. Everything is kept, and goes on after the next connection.
    pub(super) fn connection_lost(&mut self) {
        self.connection.online = false;
        self.site.online = false;
        if !self.connection.shut_down {
            self.site.r1_losses += 1;
        }
        let tired = self.site.r1_losses > 1 && self.site.faults.has(F::R1ReconnectsOnlyOnce);
        let ended = self.connection.shut_down || self.site.faults.has(F::NeverReconnects) || tired;
        if !ended && self.connection.attempt_at.is_none() {
            let times = if self.site.takes(T::R2ReconnectsLater) { 4 } else { 1 };
            self.connection.attempt_at = Some(self.site.now.moment + self.site.config.reconnect_delay * times);
        }
    }

    /// Asks for a connection when it is time.
    pub(super) fn attempt_connection(&mut self) {
        let due = self.connection.attempt_at.is_some_and(|at| at <= self.site.now.moment);
        if due && !self.connection.online {
            self.connection.attempt_at = None;
            self.site.pending.push(Output::Connect);
        }
    }

    /// Goes offline in good order.
    pub(super) fn shut_down(&mut self) {
        if self.connection.online {
            self.site.pending.push(Output::Disconnect);
        }
        self.connection.online = false;
        self.site.online = false;
        self.connection.shut_down = true;
        self.connection.attempt_at = None;
    }

    /// Connects again.
    pub(super) fn start(&mut self) {
        if !self.connection.online {
            self.connection.shut_down = false;
            self.connection.attempt_at = Some(self.site.now.moment);
        }
    }
}

/// The filter for a topic of every vehicle: manufacturer and serial number are left open.
fn with_wildcards(topic: &str, name: &str) -> String {
    let mut levels: Vec<&str> = topic.split('/').collect();
    let end = levels.len();
    if end >= 4 && levels[end - 1] == name {
        levels[end - 2] = "+";
        levels[end - 3] = "+";
    }
    levels.join("/")
}
