//! Journals written by hand.

use serde_json::{Value, json};
use vda5050_tck::clock::{Moment, Stamp};
use vda5050_tck::journal::event::{Occurrence, StepEnd};
use vda5050_tck::journal::{Direction, Event, Journal, Packet, Payload, Source};

pub const PREFIX: &str = "uagv/v2/Lindner/TX-0042";

/// Writes a journal by hand.
pub struct Recorder {
    pub journal: Journal,
    millis: u64,
}

impl Recorder {
    pub fn new() -> Self {
        Self {
            journal: Journal::new(),
            millis: 0,
        }
    }

    fn push(&mut self, source: Source, direction: Option<Direction>, event: Event) -> u64 {
        let start: jiff::Timestamp = "2026-03-02T08:15:00Z".parse().expect("time");
        let at = Stamp {
            moment: Moment::START,
            utc: start,
        }
        .at(Moment::from_micros(self.millis * 1000));
        self.journal
            .append(Occurrence {
                at,
                source,
                direction,
                event,
            })
            .seq()
    }

    pub fn wait(&mut self, millis: u64) -> &mut Self {
        self.millis += millis;
        self
    }

    pub fn harness(&mut self, event: Event) -> u64 {
        self.push(Source::Harness, None, event)
    }

    pub fn packet(&mut self, way: Direction, packet: Packet) -> u64 {
        self.push(Source::Tap, Some(way), Event::Packet { connection: 1, packet })
    }

    pub fn publish(&mut self, way: Direction, topic: &str, bytes: &[u8]) -> u64 {
        let payload = Payload::keep(bytes.to_vec().into());
        let topic = format!("{PREFIX}/{topic}");
        self.packet(
            way,
            Packet::Publish {
                topic,
                qos: 0,
                retain: false,
                dup: false,
                packet_id: None,
                payload,
            },
        )
    }

    /// Sent by the harness and seen on its way to the device.
    pub fn send(&mut self, topic: &str, message: &Value) -> u64 {
        let bytes = message.to_string();
        let payload = Payload::keep(bytes.clone().into());
        let full = format!("{PREFIX}/{topic}");
        let seq = self.harness(Event::Sent {
            topic: full,
            qos: 0,
            retain: false,
            payload,
        });
        self.wait(2).publish(Direction::ToDevice, topic, bytes.as_bytes());
        seq
    }

    /// Published by the device, seen at the tap, delivered to the harness.
    pub fn receive(&mut self, topic: &str, message: &Value) -> u64 {
        self.receive_bytes(topic, message.to_string().as_bytes())
    }

    pub fn receive_bytes(&mut self, topic: &str, bytes: &[u8]) -> u64 {
        self.publish(Direction::FromDevice, topic, bytes);
        self.wait(1).deliver(topic, bytes)
    }

    /// Delivered to the harness without having been seen at the tap.
    pub fn deliver(&mut self, topic: &str, bytes: &[u8]) -> u64 {
        let payload = Payload::keep(bytes.to_vec().into());
        let topic = format!("{PREFIX}/{topic}");
        self.push(
            Source::Link,
            Some(Direction::FromDevice),
            Event::Message {
                topic,
                qos: 0,
                retain: false,
                dup: false,
                payload,
            },
        )
    }

    pub fn step(&mut self, path: &str) -> u64 {
        self.harness(Event::StepBegun { path: path.to_owned() })
    }

    pub fn end(&mut self, path: &str, end: StepEnd) -> u64 {
        self.harness(Event::StepEnded {
            path: path.to_owned(),
            end,
        })
    }

    pub fn mark(&mut self, path: &str) -> u64 {
        self.harness(Event::Mark { path: path.to_owned() })
    }
}

pub fn order(update: u64, base: &[&str], horizon: &[&str]) -> Value {
    let nodes = base
        .iter()
        .map(|name| (name, true))
        .chain(horizon.iter().map(|name| (name, false)));
    let nodes: Vec<Value> = nodes
        .enumerate()
        .map(|(at, (name, released))| json!({ "nodeId": name, "sequenceId": at * 2, "released": released, "actions": [] }))
        .collect();
    json!({
        "headerId": update + 1, "timestamp": "2026-03-02T08:15:01.000Z", "version": "2.1.0",
        "manufacturer": "Lindner", "serialNumber": "TX-0042",
        "orderId": "order-7c1e", "orderUpdateId": update, "nodes": nodes, "edges": []
    })
}

pub fn state(header: u64, update: u64, node: &str, errors: &Value) -> Value {
    json!({
        "headerId": header, "timestamp": "2026-03-02T08:15:02.000Z", "version": "2.1.0",
        "manufacturer": "Lindner", "serialNumber": "TX-0042",
        "orderId": "order-7c1e", "orderUpdateId": update, "lastNodeId": node, "lastNodeSequenceId": 0,
        "nodeStates": [], "edgeStates": [], "driving": false, "actionStates": [],
        "batteryState": { "batteryCharge": 81.5, "charging": false }, "operatingMode": "AUTOMATIC",
        "errors": errors, "safetyState": { "eStop": "NONE", "fieldViolation": false }
    })
}
