//! The connection to the broker, headers, and publishing.

use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::clock::{Moment, Stamp};
use crate::reference::{ConnectOptions, Output, Publication};

use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;
use super::vehicle::Vehicle;
use super::{MasterControl, Site, wording};

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
            .collect();
        if !silent {
            names.push("visualization");
        }
        let mut subscriptions: Vec<(String, u8)> = Vec::new();
        for vehicle in &self.fleet {
            for name in &names {
                let Some(topic) = vehicle.topic(name) else { continue };
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
            }
        }
        ConnectOptions {
            level: match () {
                () if site.faults.has(F::OldMqtt) => 3,
                () if site.takes(T::NewestMqtt) => 5,
                () => 4,
            },
            client_id: site.config.name.clone(),
            keep_alive: site.config.keep_alive,
            clean_session: !site.takes(T::SessionKept),
            will: None,
            subscriptions,
        }
    }

    /// The broker accepted. What was sent and not seen is given its time again.
    pub(super) fn connected(&mut self) {
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
        }
    }

    /// The link broke. Everything is kept, and goes on after the next connection.
    pub(super) fn connection_lost(&mut self) {
        self.connection.online = false;
        self.site.online = false;
        let ended = self.connection.shut_down || self.site.faults.has(F::NeverReconnects);
        if !ended && self.connection.attempt_at.is_none() {
            self.connection.attempt_at = Some(self.site.now.moment + self.site.config.reconnect_delay);
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

impl Vehicle {
    /// Nothing could be seen for a while, so what is awaited has its whole time again.
    pub(super) fn give_time(&mut self, now: Moment) {
        if let Some(running) = &mut self.running {
            running.sent_at = now;
        }
        for instant in &mut self.instants {
            if let Some(sent_at) = &mut instant.sent_at {
                *sent_at = now;
            }
        }
    }
}

impl Site {
    /// Publishes an order or instant actions: the header, then the body.
    pub(super) fn publish(&mut self, vehicle: &mut Vehicle, name: &'static str, body: &Value) {
        let Some(topic) = vehicle.topic(name).map(str::to_owned).filter(|_| self.online) else {
            return;
        };
        let mut message = self.header(vehicle, name);
        if self.faults.has(F::HeaderNested) {
            message = Map::from_iter([("header".to_owned(), Value::Object(message))]);
        }
        if let Value::Object(body) = body {
            message.extend(body.clone());
        }
        let mut message = Value::Object(message);
        wording::reworded(self.faults, self.config.tolerances, name, &mut message);
        let qos = match name {
            "order" if self.faults.has(F::OrderQosOne) => 1,
            "instantActions" if self.faults.has(F::InstantActionsQosTwo) => 2,
            _ => 0,
        };
        self.pending.push(Output::Publish(Publication {
            topic: self.misdirected(vehicle, name, topic),
            payload: wording::written(self.faults, self.config.tolerances, &message),
            qos,
            retain: match name {
                "order" => self.faults.has(F::OrdersRetained),
                _ => self.faults.has(F::InstantActionsRetained),
            },
        }));
    }

    fn misdirected(&self, vehicle: &Vehicle, name: &str, topic: String) -> String {
        let sends = |fault: F| self.faults.has(fault);
        match name {
            "instantActions" if sends(F::TopicUnderscore) => topic.replace("instantActions", "instant_actions"),
            "instantActions" if sends(F::InstantActionsAsOrders) => {
                vehicle.topic("order").map(str::to_owned).unwrap_or(topic)
            }
            "order" if sends(F::OtherMajorVersion) => topic.replacen("/v", "/v1", 1),
            "order" if sends(F::DollarInTopic) => topic.replacen('/', "/$", 1),
            "order" if sends(F::TopicWithoutVersion) => {
                let levels: Vec<&str> = topic.split('/').collect();
                let kept = levels.iter().enumerate().filter(|(at, _)| *at != 1);
                kept.map(|(_, level)| *level).collect::<Vec<_>>().join("/")
            }
            _ => topic,
        }
    }

    /// The header of the next message on a topic (HDR-01 to HDR-05).
    pub(super) fn header(&self, vehicle: &mut Vehicle, name: &'static str) -> Map<String, Value> {
        let sends = |fault: F| self.faults.has(fault);
        let first = if self.takes(T::HeaderIdFromThousand) { 1000 } else { 0 };
        let counter = if sends(F::HeaderIdShared) { "all" } else { name };
        let next = vehicle.header_ids.entry(counter).or_insert(first);
        let id = *next;
        if !sends(F::HeaderIdConstant) {
            *next = next.wrapping_add(1);
        }
        let mut header = Map::new();
        header.insert(
            "headerId".into(),
            if sends(F::HeaderIdNegative) {
                json!(i64::from(id) - 1_000_000)
            } else {
                json!(id)
            },
        );
        if !(name == "instantActions" && sends(F::TimestampMissing)) {
            header.insert("timestamp".into(), self.timestamp());
        }
        let version = &self.config.version;
        let version = version
            .rsplit_once('.')
            .filter(|_| sends(F::VersionShort))
            .map_or(version.as_str(), |(short, _)| short);
        if !(name == "order" && sends(F::VersionMissing)) {
            header.insert("version".into(), json!(version));
        }
        let VehicleNames { manufacturer, serial } = self.names(vehicle);
        header.insert("manufacturer".into(), json!(manufacturer));
        header.insert("serialNumber".into(), json!(serial));
        header
    }

    fn names(&self, vehicle: &Vehicle) -> VehicleNames {
        let (manufacturer, serial) = (&vehicle.config.manufacturer, &vehicle.config.serial_number);
        let names = |manufacturer: String, serial: String| VehicleNames { manufacturer, serial };
        match () {
            () if self.faults.has(F::OwnNameInHeader) => names(self.config.name.clone(), "1".into()),
            () if self.faults.has(F::OtherSerialNumber) => names(manufacturer.clone(), format!("{serial}0")),
            () if self.faults.has(F::SerialNumberWithSpace) => names(manufacturer.clone(), format!("No. {serial}")),
            () if self.faults.has(F::ManufacturerWithSlash) => names(format!("{manufacturer}/agv"), serial.clone()),
            () => names(manufacturer.clone(), serial.clone()),
        }
    }

    fn timestamp(&self) -> Value {
        let utc = self.now.utc;
        let text = format!("{utc:.2}");
        match () {
            () if self.faults.has(F::TimestampLocal) => {
                let local = utc.checked_add(jiff::SignedDuration::from_hours(1)).unwrap_or(utc);
                json!(format!("{local:.2}").replace('Z', "+01:00"))
            }
            () if self.faults.has(F::TimestampWithoutZone) => json!(text.trim_end_matches('Z')),
            () if self.faults.has(F::TimestampUnix) => json!(utc.as_second()),
            () => json!(text),
        }
    }

    /// `publishes-connection`: says for a vehicle that it is gone.
    pub(super) fn declare_offline(&mut self, vehicle: &mut Vehicle) {
        let Some(topic) = vehicle.topic("connection").map(str::to_owned) else {
            return;
        };
        let mut message = self.header(vehicle, "connection");
        message.insert("connectionState".into(), json!("OFFLINE"));
        self.pending.push(Output::Publish(Publication {
            topic,
            payload: Value::Object(message).to_string().into_bytes(),
            qos: 1,
            retain: true,
        }));
    }

    /// When something sent now is taken for lost.
    pub(super) fn lost_after(&self, sent_at: Moment) -> Moment {
        sent_at + self.config.resend_after.max(Duration::from_millis(1))
    }
}

struct VehicleNames {
    manufacturer: String,
    serial: String,
}
