//! The link to the broker: last will, ONLINE and OFFLINE, reconnecting, headers and publishing (section 6.14).

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::clock::{Moment, Stamp};
use crate::reference::{ConnectOptions, Output, Publication};

use super::Agv;
use super::faults::FaultName as F;
use super::points::{Event, Head, Outgoing, Permission};
use super::tolerances::{ToleranceName as T, manner};

/// The state of the link, and what is counted over all connections.
#[derive(Clone, Debug)]
pub(crate) struct Connection {
    pub(crate) online: bool,
    /// When to ask for a connection next.
    pub(crate) attempt_at: Option<Moment>,
    /// Switched off: a lost connection is not restored.
    pub(crate) shut_down: bool,
    /// It was online before.
    pub(crate) returning: bool,
    /// How often it was online.
    pub(crate) sessions: u32,
    /// The next headerId by topic name (HDR-02).
    pub(crate) header_ids: BTreeMap<&'static str, u32>,
    /// The factsheet that is published now was asked for.
    pub(crate) factsheet_asked: bool,
    /// When to say ONLINE (`online-late` only).
    pub(crate) online_at: Option<Moment>,
}

impl Connection {
    /// Not connected yet, and eager to be.
    pub(crate) fn new() -> Self {
        Self {
            online: false,
            attempt_at: Some(Moment::START),
            shut_down: false,
            returning: false,
            sessions: 0,
            header_ids: BTreeMap::new(),
            factsheet_asked: false,
            online_at: None,
        }
    }

    /// When the next attempt is due.
    pub(crate) fn next_attempt(&self) -> Option<Moment> {
        self.attempt_at.filter(|_| !self.online)
    }

    /// The link is gone, and to be restored at a time.
    pub(crate) fn dropped(&mut self, attempt_at: Moment) {
        self.online = false;
        self.online_at = None;
        self.shut_down = false;
        self.attempt_at = Some(attempt_at);
    }

    /// The link is gone, and not to be restored.
    pub(crate) fn stays_away(&mut self) {
        self.online = false;
        self.online_at = None;
        self.shut_down = true;
        self.attempt_at = None;
    }

    /// Nobody remembers the headerIds: it was switched off.
    pub(crate) fn count_anew(&mut self) {
        self.header_ids.clear();
    }

    /// The next message of a topic name has the headerId of the one before.
    pub(crate) fn repeat_header_id(&mut self, name: &str) {
        if let Some(next) = self.header_ids.get_mut(name) {
            *next = next.wrapping_sub(1);
        }
    }

    /// `r3-header-id-counts-orders`: counts a message that is not sent.
    pub(crate) fn skip_header_id(&mut self) {
        if let Some(next) = self.header_ids.get_mut("state") {
            *next = next.wrapping_add(1);
        }
    }

    /// Whether it was online before.
    pub(crate) fn was_online(&self) -> bool {
        self.returning
    }

    /// Somebody wants the vehicle connected.
    pub(crate) fn wanted_at(&mut self, moment: Moment) {
        if !self.online {
            self.dropped(moment);
        }
    }
}

impl Agv {
    /// Whether it takes a liberty.
    pub(crate) fn takes(&self, tolerance: T) -> bool {
        self.config.tolerances.has(tolerance)
    }

    /// How to connect: the will says CONNECTIONBROKEN (CONN-01 to CONN-04).
    pub(crate) fn options(&mut self, now: Stamp) -> ConnectOptions {
        self.now = now.at(now.moment.max(self.now.moment));
        let will = self.config.topic("connection").map(str::to_owned).map(|topic| {
            // The will does not count: it has the headerId of the message that would be next.
            let mut message = self.header("connection", false);
            if self.persona.stale_will {
                let utc = self.now.utc;
                let long_ago = utc.checked_sub(jiff::SignedDuration::from_hours(24)).unwrap_or(utc);
                message.insert("headerId".into(), json!(0));
                message.insert("timestamp".into(), json!(format!("{long_ago:.2}")));
            }
            message.insert("connectionState".into(), json!("CONNECTIONBROKEN"));
            Publication {
                topic,
                payload: Value::Object(message).to_string().into_bytes(),
                qos: 1,
                retain: true,
            }
        });
        let mut topics: Vec<String> = ["order", "instantActions"]
            .into_iter()
            .filter_map(|name| self.config.topic(name))
            .map(str::to_owned)
            .collect();
        if self.takes(T::R2SubscribesWithWildcard) {
            // Its own messages come back to it; it has no use for them.
            for topic in &mut topics {
                if let Some((above, _)) = topic.rsplit_once('/') {
                    *topic = format!("{above}/+");
                }
            }
            topics.dedup();
        }
        let qos = u8::from(self.takes(T::SubscribesWithQosOne));
        let subscriptions = topics.into_iter().map(|topic| (topic, qos));
        let mut options = ConnectOptions {
            level: if self.takes(T::NewestMqtt) { 5 } else { 4 },
            client_id: match self.takes(T::R2ClientIdChanges) {
                true => format!("{}-{}", self.config.serial_number, self.connection.sessions),
                false => format!("{}.{}", self.config.manufacturer, self.config.serial_number),
            },
            keep_alive: self.config.keep_alive,
            clean_session: !self.takes(T::SessionKept),
            will,
            subscriptions: subscriptions.collect(),
        };
        self.joining(&mut options);
        options
    }

    /// The broker accepted: ONLINE, then the factsheet, then a state (CONN-05, CONN-11).
    pub(crate) fn connected(&mut self) {
        let first = !self.connection.returning;
        if self.takes(T::HeaderIdRestarts) {
            self.connection.header_ids.clear();
        }
        self.connection.online = true;
        self.connection.returning = true;
        self.connection.sessions = self.connection.sessions.saturating_add(1);
        self.connection.attempt_at = None;
        self.connection.shut_down = false;
        self.happens(Event::Connected);
        let on_request = self.takes(T::R1FactsheetOnRequestOnly);
        if !on_request && self.takes(T::R2FactsheetBeforeOnline) {
            self.publish_factsheet();
        }
        if !first && self.faults.has(F::OnlineLate) {
            self.connection.online_at = Some(self.moment() + Duration::from_secs(25));
        } else {
            for _ in 0..if self.takes(T::OnlineTwice) { 2 } else { 1 } {
                self.publish_connection("ONLINE");
            }
        }
        let before = self.takes(T::R2FactsheetBeforeOnline);
        let after = !before && self.takes(T::R2FactsheetAfterState);
        if !on_request && !before && !after {
            self.publish_factsheet();
        }
        self.replay_buffer();
        self.relist_nodes(first);
        self.start_reporting();
        if !on_request && after {
            self.flush();
            self.publish_factsheet();
        }
    }

    /// The link broke. The order goes on (MQTT-03, MQTT-04).
    pub(crate) fn connection_lost(&mut self) {
        self.pause_outlives |= self.holds.pause && self.faults.has(F::PauseStuckAfterCut);
        self.book.cut = true;
        self.fourth.before_cut = self.book.nodes.clone();
        self.happens(Event::ConnectionLost);
        self.connection.online = false;
        self.connection.online_at = None;
        if !self.connection.shut_down && self.connection.attempt_at.is_none() {
            self.connection.attempt_at = Some(self.moment() + self.config.reconnect_delay);
        }
    }

    /// Asks for a connection when it is time.
    pub(crate) fn attempt_connection(&mut self) {
        if self.connection.online_at.is_some_and(|at| at <= self.moment()) {
            self.connection.online_at = None;
            self.publish_connection("ONLINE");
        }
        if self.connection.next_attempt().is_some_and(|at| at <= self.moment()) {
            self.connection.attempt_at = None;
            self.pending.push(Output::Connect);
        }
    }

    /// Goes offline in good order (CONN-07, CONN-08).
    pub(crate) fn shut_down(&mut self) {
        if self.connection.online {
            if self.takes(T::R1LastStateBeforeOffline) {
                self.report.requested = true;
                self.flush();
            }
            self.happens(Event::Leaving);
            self.publish_connection("OFFLINE");
            self.happens(Event::Left);
            let politely = self.allows(Permission::Disconnect, true);
            self.pending
                .push(if politely { Output::Disconnect } else { Output::Drop });
        }
        self.connection.stays_away();
    }

    pub(crate) fn publish_connection(&mut self, state: &str) {
        let mut body = Map::new();
        body.insert("connectionState".into(), json!(state));
        self.publish("connection", body);
    }

    /// `echoes-order`: tells master control what it said.
    pub(crate) fn echo_order(&mut self, message: &Value) {
        if let Some(topic) = self.config.topic("order").filter(|_| self.connection.online) {
            let publication = Publication {
                topic: topic.to_owned(),
                payload: message.to_string().into_bytes(),
                qos: 0,
                retain: false,
            };
            self.pending.push(Output::Publish(publication));
        }
    }

    /// `r2-acknowledges-on-instant-actions`: answers master control on its own topic.
    pub(crate) fn acknowledge_instant_actions(&mut self) {
        let mut message = self.header("connection", false);
        message.insert("actions".into(), json!([]));
        if let Some(topic) = self.config.topic("instantActions").filter(|_| self.connection.online) {
            let publication = Publication {
                topic: topic.to_owned(),
                payload: Value::Object(message).to_string().into_bytes(),
                qos: 0,
                retain: false,
            };
            self.pending.push(Output::Publish(publication));
        }
    }

    /// Publishes a message: the header, then the body. Nothing is published, or counted, while offline.
    pub(crate) fn publish(&mut self, name: &'static str, body: Map<String, Value>) {
        let Some(topic) = self
            .config
            .topic(name)
            .map(str::to_owned)
            .filter(|_| self.connection.online)
        else {
            return;
        };
        if !self.allows(Permission::Say(name, &body), true) {
            return;
        }
        let mut message = self.header(name, true);
        message.extend(body);
        let mut outgoing = Outgoing {
            name,
            topic,
            message,
            qos: u8::from(name == "connection"),
            retain: match name {
                "connection" => true,
                "factsheet" => self.config.has("retainedFactsheet"),
                "state" => self.takes(T::R3StatesRetained),
                _ => false,
            },
            periodic: name == "state" && self.report.periodic,
        };
        if !self.publishes(&mut outgoing) {
            return;
        }
        let states = self.connection.header_ids.get("state").copied().unwrap_or(0);
        let message = std::mem::take(&mut outgoing.message);
        let message = manner::reworded(self.config.tolerances, name, message, states % 2 == 0);
        let mut payload = manner::written(self.config.tolerances, message);
        self.writes(&outgoing, &mut payload);
        self.pending.push(Output::Publish(Publication {
            topic: outgoing.topic,
            payload,
            qos: outgoing.qos,
            retain: outgoing.retain,
        }));
    }

    /// The header of the next message on a topic (HDR-01 to HDR-05).
    pub(crate) fn header(&mut self, name: &'static str, counts: bool) -> Map<String, Value> {
        let start = match () {
            () if self.takes(T::R3HeaderIdWraps) => u32::MAX - 12,
            () if self.takes(T::R1HeaderIdStartsHigh) => 70_000,
            () => 0,
        };
        let next = self.connection.header_ids.entry(name).or_insert(start);
        let id = *next;
        if counts {
            *next = next.wrapping_add(1);
        }
        let version = self.persona.version.as_ref().unwrap_or(&self.config.version);
        let mut header = Map::new();
        header.insert("headerId".into(), json!(id));
        header.insert("timestamp".into(), json!(self.timestamp()));
        header.insert("version".into(), json!(version));
        header.insert("manufacturer".into(), json!(self.config.manufacturer));
        header.insert("serialNumber".into(), json!(self.config.serial_number));
        self.heads(Head { name, counts }, &mut header);
        header
    }

    fn timestamp(&self) -> String {
        let utc = if self.takes(T::R3ClockAhead) {
            let ahead = jiff::SignedDuration::from_millis(1_500);
            self.now.utc.checked_add(ahead).unwrap_or(self.now.utc)
        } else {
            self.now.utc
        };
        match () {
            () if self.takes(T::SecondsWhole) => format!("{utc:.0}"),
            () if self.takes(T::SecondsFine) => format!("{utc:.6}"),
            () => format!("{utc:.2}"),
        }
    }
}
