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
            if site.takes(T::R1ListensToOwnTopics) {
                names.extend(["order", "instantActions"]);
            }
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
            client_id: if site.takes(T::R1NewClientIdEachTime) {
                format!("{}-{}", site.config.name, now.utc.as_millisecond())
            } else {
                site.config.name.clone()
            },
            keep_alive: site.config.keep_alive,
            clean_session: !site.takes(T::SessionKept),
            will: None,
            subscriptions,
        }
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
            if returning {
                self.site.r1_returned(vehicle);
            }
        }
        if returning {
            self.site.r1_actions = 0;
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

/// Whether a message holds an instant action of one of these types.
fn holds(name: &str, body: &Value, kinds: &[&str]) -> bool {
    let actions = body["actions"].as_array().filter(|_| name == "instantActions");
    let mut types = actions
        .into_iter()
        .flatten()
        .filter_map(|action| action["actionType"].as_str());
    types.any(|kind| kinds.contains(&kind))
}

/// Whether an order message is an update.
fn updates(name: &str, body: &Value) -> bool {
    let first = body.pointer("/nodes/0/sequenceId").and_then(Value::as_u64);
    name == "order" && first.is_some_and(|sequence| sequence > 0)
}

impl Site {
    /// What a return of the connection does to the picture of a vehicle.
    fn r1_returned(&mut self, vehicle: &mut Vehicle) {
        let has = |fault: F| self.faults.has(fault);
        if has(F::R1ReconnectForgetsOrder) {
            vehicle.running = None;
            vehicle.cancel = None;
        }
        if has(F::R1BlockForgottenOnReconnect) {
            vehicle.blocked.clear();
        }
        if has(F::R1IntervalForgottenOnReconnect) {
            vehicle.last_order_at = None;
        }
        if has(F::R1UpdateIdsRestartOnReconnect)
            && let Some(running) = &mut vehicle.running
        {
            running.update_id = 0;
        }
        if self.takes(T::R1StateAskedAfterReconnect) && vehicle.state.is_some() {
            self.instant(vehicle, "stateRequest", &Value::Null);
        }
    }

    /// Publishes an order or instant actions: the header, then the body.
    pub(super) fn publish(&mut self, vehicle: &mut Vehicle, name: &'static str, body: &Value) {
        let Some(topic) = vehicle.topic(name).map(str::to_owned).filter(|_| self.online) else {
            return;
        };
        let mut message = self.header(vehicle, name);
        let cancels = holds(name, body, &["cancelOrder"]);
        if cancels && self.faults.has(F::R1HeaderIdMissingInCancel) {
            message.shift_remove("headerId");
        }
        if updates(name, body) && self.faults.has(F::R1ManufacturerMissingInUpdates) {
            message.shift_remove("manufacturer");
        }
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
            "instantActions" if cancels && self.faults.has(F::R1CancelQosOne) => 1,
            "order" if self.r1_resending && self.faults.has(F::R1ResendQosOne) => 1,
            _ => 0,
        };
        let topic = self.r1_misdirected(name, body, topic);
        let mut payload = wording::written(self.faults, self.config.tolerances, &message);
        if cancels && self.faults.has(F::R1CancelDoubleEncoded) {
            payload = json!(String::from_utf8_lossy(&payload)).to_string().into_bytes();
        }
        if name == "instantActions" && self.faults.has(F::R1Utf16InstantActions) {
            let text = String::from_utf8_lossy(&payload).into_owned();
            payload = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        }
        self.pending.push(Output::Publish(Publication {
            topic: self.misdirected(vehicle, name, topic),
            payload,
            qos,
            retain: match name {
                "order" => self.faults.has(F::OrdersRetained),
                _ => self.faults.has(F::InstantActionsRetained),
            },
        }));
        if name == "order" && self.faults.has(F::R1PathOnVisualization) {
            self.r1_show_path(vehicle, body);
        }
    }

    /// `r1-path-on-visualization`: shows on the topic of the vehicle where its order begins.
    fn r1_show_path(&mut self, vehicle: &mut Vehicle, body: &Value) {
        let Some(topic) = vehicle.topic("visualization").map(str::to_owned) else {
            return;
        };
        let Some(position) = body.pointer("/nodes/0/nodePosition") else {
            return;
        };
        let position = json!({
            "x": position["x"],
            "y": position["y"],
            "theta": 0.0,
            "mapId": position["mapId"],
            "positionInitialized": true,
        });
        let mut message = self.header(vehicle, "visualization");
        message.insert("agvPosition".into(), position);
        self.pending.push(Output::Publish(Publication {
            topic,
            payload: Value::Object(message).to_string().into_bytes(),
            qos: 0,
            retain: false,
        }));
    }

    fn r1_misdirected(&self, name: &str, body: &Value, topic: String) -> String {
        let sends = |fault: F| self.faults.has(fault);
        if updates(name, body) && sends(F::R1UpdatesOnOwnTopic) {
            return format!("{topic}Update");
        }
        if name == "instantActions" && sends(F::R1TopicLevelsSwapped) {
            let mut levels: Vec<&str> = topic.split('/').collect();
            let end = levels.len();
            if end >= 4 {
                levels.swap(end - 2, end - 3);
            }
            return levels.join("/");
        }
        if name == "instantActions" && sends(F::R1VersionLevelWithoutLetter) {
            return topic.replacen("/v", "/", 1);
        }
        if holds(name, body, &["startPause", "stopPause"]) && sends(F::R1PauseToFirstVehicle) {
            let first = self.config.vehicles.first();
            return first.and_then(|first| first.topics.get(name).cloned()).unwrap_or(topic);
        }
        topic
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
    pub(super) fn header(&mut self, vehicle: &mut Vehicle, name: &'static str) -> Map<String, Value> {
        let faults = self.faults;
        let sends = |fault: F| faults.has(fault);
        let first = match () {
            () if self.takes(T::R1HeaderIdHigh) => 4_000_000_000,
            () if self.takes(T::HeaderIdFromThousand) => 1000,
            () => 0,
        };
        let counter = if sends(F::HeaderIdShared) { "all" } else { name };
        let counters = if sends(F::R1HeaderIdCountsFleet) {
            &mut self.r1_fleet_ids
        } else {
            &mut vehicle.header_ids
        };
        let next = counters.entry(counter).or_insert(first);
        let mut id = *next;
        if self.r1_resending && sends(F::R1HeaderIdKeptOnResend) {
            id = id.wrapping_sub(1);
        } else if !sends(F::HeaderIdConstant) {
            *next = next.wrapping_add(1);
        }
        let mut header = Map::new();
        header.insert(
            "headerId".into(),
            if sends(F::HeaderIdNegative) {
                json!(i64::from(id) - 1_000_000)
            } else if sends(F::R1HeaderIdFromClock) {
                json!(self.now.utc.as_millisecond())
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
            let letter = if name == "order" && sends(F::R1VersionWithLetter) {
                "v"
            } else {
                ""
            };
            header.insert("version".into(), json!(format!("{letter}{version}")));
        }
        let VehicleNames { manufacturer, serial } = self.names(vehicle);
        header.insert("manufacturer".into(), json!(manufacturer));
        header.insert("serialNumber".into(), json!(serial));
        header
    }

    fn names(&self, vehicle: &Vehicle) -> VehicleNames {
        let (manufacturer, serial) = (&vehicle.config.manufacturer, &vehicle.config.serial_number);
        let names = |manufacturer: String, serial: String| VehicleNames { manufacturer, serial };
        let first = self.config.vehicles.first();
        if let Some(first) = first.filter(|_| self.faults.has(F::R1HeaderOfFirstVehicle)) {
            return names(first.manufacturer.clone(), first.serial_number.clone());
        }
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
            () if self.faults.has(F::R1TimestampZeroOffset) => json!(text.replace('Z', "+00:00")),
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
