//! The link to the broker: last will, ONLINE and OFFLINE, reconnecting, headers and publishing (sections 6.2, 6.4 and
//! 6.14).
//!
//! ONLINE comes before the first state (the ruling of CONN-05), the base is driven on without a link (that of MQTT-04),
//! and headerIds count on over a reconnect and anew when the vehicle is switched on (that of HDR-02).

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use crate::{ConnectOptions, Output, Publication};
use tck_base::clock::{Moment, Stamp};

use super::Agv;
use super::hook_points::{Event, Head, Outgoing, Permission};

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
    /// Number of times it was online.
    pub(crate) sessions: u32,
    /// The next headerId by topic name (HDR-02).
    pub(crate) header_ids: BTreeMap<&'static str, u32>,
    /// The factsheet that is published now was asked for.
    pub(crate) factsheet_asked: bool,
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
        }
    }

    /// When the next attempt is due.
    pub(crate) fn next_attempt(&self) -> Option<Moment> {
        self.attempt_at.filter(|_| !self.online)
    }

    /// The link is gone, and to be restored at a time.
    pub(crate) fn dropped(&mut self, attempt_at: Moment) {
        self.online = false;
        self.shut_down = false;
        self.attempt_at = Some(attempt_at);
    }

    /// The link is gone, and not to be restored.
    pub(crate) fn stays_away(&mut self) {
        self.online = false;
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

    /// The headerId of the last message of a topic name; 0 where there was none.
    pub(crate) fn last_header_id(&self, name: &str) -> u32 {
        self.header_ids.get(name).map_or(0, |next| next.wrapping_sub(1))
    }

    /// Counts a message that is not sent.
    pub(crate) fn skip_header_id(&mut self, name: &str) {
        if let Some(next) = self.header_ids.get_mut(name) {
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
    /// Options of the next connection: the will says CONNECTIONBROKEN (CONN-01 to CONN-04).
    pub(crate) fn options(&mut self, now: Stamp) -> ConnectOptions {
        self.now = now.at(now.moment.max(self.now.moment));
        let will = self.config.topic("connection").map(str::to_owned).map(|topic| {
            // The will does not count: it has the headerId of the message that would be next.
            let mut message = self.header("connection", false);
            message.insert("connectionState".into(), json!("CONNECTIONBROKEN"));
            self.spell("connection", &mut message);
            Publication {
                topic,
                payload: Value::Object(message).to_string().into(),
                qos: 1,
                retain: true,
            }
        });
        let topics = super::HEARD
            .into_iter()
            .filter(|name| self.config.listens(name))
            .filter_map(|name| self.config.topic(name))
            .map(str::to_owned);
        let mut options = ConnectOptions {
            level: 4,
            client_id: format!("{}.{}", self.config.manufacturer, self.config.serial_number),
            keep_alive: self.config.keep_alive,
            clean_session: true,
            will,
            subscriptions: topics.map(|topic| (topic, 0)).collect(),
        };
        self.connects(&mut options);
        options
    }

    /// The broker accepted: ONLINE, then the factsheet, then a state (CONN-05, CONN-11).
    pub(crate) fn connected(&mut self) {
        self.connection.online = true;
        self.connection.returning = true;
        self.connection.sessions = self.connection.sessions.saturating_add(1);
        self.connection.attempt_at = None;
        self.connection.shut_down = false;
        self.sleep = self.sleep.ended();
        self.happens(Event::Connected);
        if self.allows(Permission::SayOnline, true) {
            self.publish_connection("ONLINE");
        }
        if self.allows(Permission::SayFactsheet, true) {
            self.publish_factsheet();
        }
        self.start_reporting();
    }

    /// The link broke. The order goes on (MQTT-03, MQTT-04).
    pub(crate) fn connection_lost(&mut self) {
        self.happens(Event::ConnectionLost);
        self.connection.online = false;
        if !self.connection.shut_down && self.connection.attempt_at.is_none() {
            self.connection.attempt_at = Some(self.moment() + self.config.reconnect_delay);
        }
    }

    /// Asks for a connection when it is time.
    pub(crate) fn attempt_connection(&mut self) {
        if self.connection.next_attempt().is_some_and(|at| at <= self.moment()) {
            self.connection.attempt_at = None;
            self.pending.push(Output::Connect);
        }
    }

    /// Goes offline in good order (CONN-07, CONN-08).
    pub(crate) fn shut_down(&mut self) {
        if self.connection.online {
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
                _ => false,
            },
            periodic: name == "state" && self.report.periodic,
        };
        if !self.sends(&mut outgoing) {
            return;
        }
        let mut message = std::mem::take(&mut outgoing.message);
        self.spell(name, &mut message);
        let mut payload = Value::Object(message).to_string().into_bytes();
        self.writes(&outgoing, &mut payload);
        self.pending.push(Output::Publish(Publication {
            topic: outgoing.topic,
            payload: payload.into(),
            qos: outgoing.qos,
            retain: outgoing.retain,
        }));
    }

    /// The header of the next message on a topic (HDR-01 to HDR-05).
    pub(crate) fn header(&mut self, name: &'static str, counts: bool) -> Map<String, Value> {
        let next = self.connection.header_ids.entry(name).or_insert(0);
        let id = *next;
        if counts {
            *next = next.wrapping_add(1);
        }
        let mut header = Map::new();
        header.insert("headerId".into(), json!(id));
        header.insert(
            "timestamp".into(),
            json!(format!("{:.*}", self.config.timestamp_digits, self.now.utc)),
        );
        header.insert("version".into(), json!(self.config.version));
        header.insert("manufacturer".into(), json!(self.config.manufacturer));
        header.insert("serialNumber".into(), json!(self.config.serial_number));
        self.heads(Head { name, counts }, &mut header);
        header
    }
}
