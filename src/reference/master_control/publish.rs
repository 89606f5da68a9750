//! The connection to the broker, headers, and publishing.

use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::clock::Moment;
use crate::reference::{Output, Publication};

use super::faults::FaultName as F;
use super::tolerances::ToleranceName as T;
use super::vehicle::Vehicle;
use super::{Site, wording};

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
    pub(super) fn r1_returned(&mut self, vehicle: &mut Vehicle) {
        let has = |fault: F| self.faults.has(fault);
        if has(F::R1ReconnectForgetsOrder) {
            vehicle.running = None;
            vehicle.cancel = None;
        }
        if has(F::R2InstantsForgottenOnReconnect) {
            vehicle.instants.clear();
        }
        if has(F::R2TriggerForgottenOnReconnect)
            && let Some(running) = &mut vehicle.running
        {
            running.r2_unsupervised = true;
        }
        if has(F::R2NewOrderOnReconnect)
            && vehicle.cancel.is_none()
            && let Some(running) = vehicle.running.take()
        {
            vehicle
                .queue
                .push_front(super::driving::again(&running, vehicle.state.as_ref()));
            vehicle.last_order = Some(running);
            vehicle.r1_hasty = true;
        }
        if has(F::R3BaseHeldAfterReconnect)
            && let Some(running) = &mut vehicle.running
        {
            running.r3_held = true;
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
        let fresh = name == "order" && !updates(name, body) && !self.r1_resending;
        if fresh && self.faults.has(F::R2HeaderIdRestartsPerOrder) {
            vehicle.header_ids.remove("order");
        }
        if updates(name, body)
            && self.faults.has(F::R2HeaderIdSkipsInUpdates)
            && let Some(next) = vehicle.header_ids.get_mut("order")
        {
            *next = next.wrapping_add(1);
        }
        let mut message = self.header(vehicle, name);
        let other = self.r4_addressed.replace(vehicle.config.serial_number.clone());
        if updates(name, body)
            && self.faults.has(F::R4HeaderOfTheOtherVehicleInUpdates)
            && let Some(other) = other
        {
            message.insert("serialNumber".into(), json!(other));
        }
        if name == "order" {
            self.r5_ordered = Some(vehicle.config.serial_number.clone());
        } else if let Some(ordered) = &self.r5_ordered
            && self.faults.has(F::R5HeaderOfOtherVehicle)
        {
            message.insert("serialNumber".into(), json!(ordered));
        }
        if name == "order" && self.faults.has(F::R3HeaderIdIsUpdateId) {
            message.insert("headerId".into(), body["orderUpdateId"].clone());
        }
        if name == "order" && self.r1_resending && self.faults.has(F::R2SerialNumberMissingInResend) {
            message.shift_remove("serialNumber");
        }
        self.slips_header(vehicle, name, body, &mut message);
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
            "order" if updates(name, body) && self.faults.has(F::R3UpdatesQosOne) => 1,
            _ if self.r1_losses > 0 && self.faults.has(F::R2QosOneAfterReconnect) => 1,
            _ => 0,
        };
        if fresh && name == "order" {
            self.r3_last_topic = Some(topic.clone());
        }
        let last = self.r3_last_topic.clone();
        let last = last.filter(|_| updates(name, body) && self.faults.has(F::R3UpdateToVehicleServedLast));
        let topic = self.r1_misdirected(name, body, last.unwrap_or(topic));
        let mut payload = wording::written(self.faults, self.config.tolerances, &message);
        if cancels && self.faults.has(F::R1CancelDoubleEncoded) {
            payload = json!(String::from_utf8_lossy(&payload)).to_string().into_bytes();
        }
        if name == "instantActions" && self.faults.has(F::R1Utf16InstantActions) {
            let text = String::from_utf8_lossy(&payload).into_owned();
            payload = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        }
        if name == "order" && self.faults.has(F::R3LongMessageCut) {
            payload.truncate(768);
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
        let maps = holds(name, body, &["downloadMap", "enableMap", "deleteMap"]);
        if maps && sends(F::R2MapActionsOnMapTopic) {
            return topic.replace("instantActions", "mapActions");
        }
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
            "instantActions" if sends(F::R3InstantTopicLowerCase) => topic.replace("instantActions", "instantactions"),
            "order" if sends(F::R3FullVersionInOrderTopic) => {
                let version = &self.config.version;
                let major = format!("v{}", version.split('.').next().unwrap_or_default());
                let full = |level: &str| {
                    if level == major {
                        format!("v{version}")
                    } else {
                        level.to_owned()
                    }
                };
                topic.split('/').map(full).collect::<Vec<_>>().join("/")
            }
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
            } else if name == "instantActions" && sends(F::R3HeaderIdBeyond32Bits) {
                json!(u64::from(id) + (1 << 32))
            } else {
                json!(id)
            },
        );
        if !(name == "instantActions" && sends(F::TimestampMissing)) {
            let mut time = self.timestamp();
            if name == "instantActions"
                && sends(F::R4InstantActionTimeWithoutZ)
                && let Some(text) = time.as_str()
            {
                time = json!(text.trim_end_matches('Z'));
            }
            if name == "instantActions"
                && sends(F::R6InstantTimestampWithOffset)
                && let Some(text) = time.as_str()
            {
                time = json!(text.replace('Z', "+00:00"));
            }
            header.insert("timestamp".into(), time);
        }
        let version = &self.config.version;
        let version = version
            .rsplit_once('.')
            .filter(|_| {
                let instant = name == "instantActions" && sends(F::R4InstantActionVersionTwoNumbers);
                sends(F::VersionShort) || instant
            })
            .map_or(version.as_str(), |(short, _)| short);
        if !(name == "order" && sends(F::VersionMissing)) {
            let letter = if name == "order" && sends(F::R1VersionWithLetter) {
                "v"
            } else {
                ""
            };
            let build = if sends(F::R3VersionOfFourParts) { ".0" } else { "" };
            header.insert("version".into(), json!(format!("{letter}{version}{build}")));
        }
        let VehicleNames { manufacturer, serial } = self.names(vehicle);
        let (manufacturer, serial) = if name == "instantActions" && sends(F::R2HeaderNamesSwapped) {
            (serial, manufacturer)
        } else {
            (manufacturer, serial)
        };
        let serial = if name == "order" && sends(F::R3VehiclePathInSerialNumber) {
            format!("{manufacturer}/{serial}")
        } else {
            serial
        };
        let manufacturer = match () {
            () if !sends(F::R3ManufacturerInOtherCase) => manufacturer,
            () if manufacturer.chars().any(char::is_lowercase) => manufacturer.to_uppercase(),
            () => manufacturer.to_lowercase(),
        };
        let manufacturer = if name == "instantActions" && sends(F::R4FleetNameInInstantActionHeader) {
            self.config.name.clone()
        } else {
            manufacturer
        };
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

    pub(super) fn timestamp(&self) -> Value {
        let utc = self.now.utc;
        let text = format!("{utc:.2}");
        let seconds = jiff::Timestamp::from_second(utc.as_second()).unwrap_or(utc);
        match () {
            () if self.takes(T::R3WholeSecondTimestamps) => json!(format!("{seconds:.2}")),
            () if self.faults.has(F::R6LocalTimeMarkedAsUtc) => {
                let local = utc.checked_add(jiff::SignedDuration::from_hours(1)).unwrap_or(utc);
                json!(format!("{local:.2}"))
            }
            () if self.faults.has(F::R3TimestampWithComma) => json!(text.replace('.', ",")),
            () if self.faults.has(F::TimestampLocal) => {
                let local = utc.checked_add(jiff::SignedDuration::from_hours(1)).unwrap_or(utc);
                json!(format!("{local:.2}").replace('Z', "+01:00"))
            }
            () if self.faults.has(F::TimestampWithoutZone) => json!(text.trim_end_matches('Z')),
            () if self.faults.has(F::R1TimestampZeroOffset) => json!(text.replace('Z', "+00:00")),
            () if self.faults.has(F::R2TimestampWithBlank) => json!(text.replace('T', " ")),
            () if self.faults.has(F::TimestampUnix) => json!(utc.as_second()),
            () => json!(text),
        }
    }

    /// `r2-connection-topic-cleared` and `r4-clears-the-will`: removes the retained message of a vehicle that is gone.
    pub(super) fn r2_clear_connection(&mut self, vehicle: &Vehicle) {
        if let Some(topic) = vehicle.topic("connection").map(str::to_owned) {
            self.pending.push(Output::Publish(Publication {
                topic,
                payload: Vec::new(),
                qos: 1,
                retain: true,
            }));
        }
    }

    /// `r3-announces-itself-online`: says on the topic of a vehicle that the master control is there.
    pub(super) fn r3_announce(&mut self, vehicle: &mut Vehicle) {
        let Some(topic) = vehicle.topic("connection").map(str::to_owned) else {
            return;
        };
        let mut message = self.header(vehicle, "connection");
        message.insert("connectionState".into(), json!("ONLINE"));
        self.pending.push(Output::Publish(Publication {
            topic,
            payload: Value::Object(message).to_string().into_bytes(),
            qos: 1,
            retain: true,
        }));
    }

    /// `r2-empty-message-after-order`: an order message with nothing in it.
    pub(super) fn r2_empty_order(&mut self, vehicle: &Vehicle) {
        if let Some(topic) = vehicle.topic("order").map(str::to_owned) {
            self.pending.push(Output::Publish(Publication {
                topic,
                payload: Vec::new(),
                qos: 0,
                retain: false,
            }));
        }
    }

    /// `r4-heartbeat-outside-the-protocol`: says every ten seconds that it is there, on a topic of its own.
    pub(super) fn r4_beat(&mut self, vehicle: &mut Vehicle) {
        if !self.takes(T::R4HeartbeatOutsideTheProtocol) {
            return;
        }
        let now = self.now.moment;
        let due = *self.r4_beat_at.get_or_insert(now);
        if due > now {
            vehicle.at(due);
            return;
        }
        let next = now + Duration::from_secs(10);
        self.r4_beat_at = Some(next);
        vehicle.at(next);
        self.pending.push(Output::Publish(Publication {
            topic: format!("{}/alive", self.config.name),
            payload: json!({ "alive": true, "at": self.timestamp() })
                .to_string()
                .into_bytes(),
            qos: 0,
            retain: false,
        }));
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
        let times = if self.takes(T::R2ResendsLate) { 3 } else { 1 };
        sent_at + self.config.resend_after.max(Duration::from_millis(1)) * times
    }
}

struct VehicleNames {
    manufacturer: String,
    serial: String,
}
