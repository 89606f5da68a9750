//! What goes out: headers and publishing (sections 6.3 and 6.4).
//!
//! Orders and instant actions go out with QoS 0 and without RETAIN (the ruling of MQTT-06).

use std::time::Duration;

use serde_json::{Map, Value, json};

use crate::{Output, Publication};
use tck_base::clock::Moment;

use super::Site;
use super::hooks::{Outgoing, Span};
use super::vehicle::Vehicle;

impl Site {
    /// Publishes an order or instant actions: the header, then the body.
    pub(crate) fn publish(&mut self, vehicle: &mut Vehicle, name: &'static str, body: &Value) {
        self.send(vehicle, name, body, false);
    }

    /// Publishes a message with its header; `again` if it is an order that was lost.
    pub(crate) fn send(&mut self, vehicle: &mut Vehicle, name: &'static str, body: &Value, again: bool) {
        let Some(topic) = vehicle
            .topic(name)
            .map(str::to_owned)
            .filter(|_| self.connection.online)
        else {
            return;
        };
        let mut message = self.header(vehicle, name);
        message.extend(body.as_object().cloned().unwrap_or_default());
        let mut outgoing = Outgoing {
            name,
            topic,
            message,
            qos: 0,
            retain: false,
            again,
        };
        if !self.sends(vehicle, &mut outgoing) {
            return;
        }
        let mut message = Value::Object(outgoing.message);
        vehicle.config.spell(name, &mut message);
        let payload = self.text(name, &message);
        self.push(outgoing.topic, payload, outgoing.qos, outgoing.retain);
    }

    /// Hands a message to the driver.
    pub(crate) fn push(&mut self, topic: String, payload: Vec<u8>, qos: u8, retain: bool) {
        self.pending.push(Output::Publish(Publication {
            topic,
            payload: payload.into(),
            qos,
            retain,
        }));
    }

    /// The header of the next message on a topic (HDR-01 to HDR-05).
    pub(crate) fn header(&mut self, vehicle: &mut Vehicle, name: &'static str) -> Map<String, Value> {
        let next = vehicle.header_ids.entry(name).or_default();
        let id = *next;
        *next = next.wrapping_add(1);
        Map::from_iter([
            ("headerId".to_owned(), json!(id)),
            ("timestamp".to_owned(), json!(self.timestamp(vehicle))),
            ("version".to_owned(), json!(vehicle.config.version)),
            ("manufacturer".to_owned(), json!(vehicle.config.manufacturer)),
            ("serialNumber".to_owned(), json!(vehicle.config.serial_number)),
        ])
    }

    /// The time as the header gives it (HDR-03).
    pub(crate) fn timestamp(&self, vehicle: &Vehicle) -> String {
        format!("{:.*}", vehicle.config.timestamp_digits, self.now.utc)
    }

    /// When something sent now is taken for lost.
    pub(crate) fn lost_after(&self, vehicle: &Vehicle, sent_at: Moment) -> Moment {
        let after = self.config.resend_after.max(Duration::from_millis(1));
        sent_at + self.lasts(vehicle, Span::Lost, after)
    }
}
