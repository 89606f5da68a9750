//! Behaviour of the reference master control with reference vehicles, in virtual time.

mod driving;
mod hostile;
mod later;
mod talking;
mod zones;

use std::time::Duration;

use serde_json::{Value, json};

use crate::agv::{Agv, AgvConfig};
use crate::{Device, Input, Output};
use tck_base::clock::{Moment, Stamp};

use super::{MasterControl, MasterControlConfig, VehicleConfig};

/// A version no pack has, since versions are data.
const VERSION: &str = "7.8.9";

pub(crate) fn topics(serial: &str) -> std::collections::BTreeMap<String, String> {
    let names = [
        "order",
        "instantActions",
        "state",
        "visualization",
        "connection",
        "factsheet",
    ];
    names
        .map(|name| (name.to_owned(), format!("uagv/v7/Reference/{serial}/{name}")))
        .into()
}

pub(crate) fn agv_config(serial: &str) -> AgvConfig {
    AgvConfig {
        version: VERSION.into(),
        serial_number: serial.into(),
        topics: topics(serial),
        stations: [("n2", true), ("n3", true), ("n4", false), ("n5", false)]
            .map(|(node, full)| (node.to_owned(), full))
            .into(),
        ..AgvConfig::default()
    }
}

pub(crate) fn config() -> MasterControlConfig {
    let vehicle = |serial: &str| VehicleConfig {
        manufacturer: "Reference".into(),
        serial_number: serial.into(),
        version: VERSION.into(),
        features: ["mapActions", "factsheetRequest"].map(String::from).into(),
        timestamp_digits: 2,
        topics: topics(serial),
        ..VehicleConfig::default()
    };
    MasterControlConfig {
        vehicles: vec![vehicle("agv-1"), vehicle("agv-2")],
        ..MasterControlConfig::default()
    }
}

/// A message that passed, with its time.
#[derive(Clone, Debug)]
pub(crate) struct Passed {
    pub(crate) at: Moment,
    pub(crate) topic: String,
    pub(crate) body: Value,
}

/// A master control, vehicles, and the time around them.
pub(crate) struct Bench {
    pub(crate) master: MasterControl,
    pub(crate) agvs: Vec<Agv>,
    pub(crate) now: Stamp,
    pub(crate) passed: Vec<Passed>,
    pub(crate) outputs: Vec<Output>,
    /// Messages to vehicles get lost.
    pub(crate) deaf: bool,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::with(MasterControl::new(config()), agv_config("agv-1"))
    }

    pub(crate) fn with(master: MasterControl, agv: AgvConfig) -> Self {
        let mut bench = Self::alone(master);
        bench.agvs.push(Agv::new(agv));
        bench.agv_gets(0, Input::Connected);
        bench.wait(0.1);
        bench
    }

    /// A connected master control without vehicles.
    pub(crate) fn alone(master: MasterControl) -> Self {
        let utc = "2026-03-04T05:06:07.89Z".parse().unwrap();
        let moment = Moment::START;
        let mut bench = Self {
            master,
            agvs: Vec::new(),
            now: Stamp { moment, utc },
            passed: Vec::new(),
            outputs: Vec::new(),
            deaf: false,
        };
        bench.master_gets(Input::Connected);
        bench
    }

    pub(crate) fn master_gets(&mut self, input: Input) {
        let mut out = Vec::new();
        self.master.handle(self.now, input, &mut out);
        let wake = self.master.wake_up();
        assert!(
            wake.is_none_or(|wake| wake > self.now.moment),
            "wants to be woken in the past: {wake:?}"
        );
        for output in out {
            if let Output::Publish(publication) = &output {
                self.pass(&publication.topic, &publication.payload);
                if !self.deaf {
                    for index in 0..self.agvs.len() {
                        let topic = publication.topic.clone();
                        let payload = publication.payload.clone();
                        self.agv_gets(index, Input::Message { topic, payload });
                    }
                }
            }
            self.outputs.push(output);
        }
    }

    pub(crate) fn agv_gets(&mut self, index: usize, input: Input) {
        let mut out = Vec::new();
        self.agvs[index].handle(self.now, input, &mut out);
        for output in out {
            if let Output::Publish(publication) = output {
                self.pass(&publication.topic, &publication.payload);
                self.master_gets(Input::Message {
                    topic: publication.topic,
                    payload: publication.payload,
                });
            }
        }
    }

    pub(crate) fn pass(&mut self, topic: &str, payload: &[u8]) {
        self.passed.push(Passed {
            at: self.now.moment,
            topic: topic.to_owned(),
            body: serde_json::from_slice(payload).unwrap_or(Value::Null),
        });
    }

    pub(crate) fn command(&mut self, name: &str, arguments: Value) {
        self.master_gets(Input::Command(name.into(), arguments));
    }

    /// A person at the vehicle.
    pub(crate) fn at_agv(&mut self, name: &str, arguments: Value) {
        self.agv_gets(0, Input::Command(name.into(), arguments));
    }

    /// Something is said for a vehicle.
    pub(crate) fn say(&mut self, topic: &str, body: &Value) {
        self.master_gets(Input::Message {
            topic: format!("uagv/v7/Reference/agv-1/{topic}"),
            payload: body.to_string().into(),
        });
    }

    /// Lets time pass, waking everybody exactly when they want.
    pub(crate) fn wait(&mut self, seconds: f64) {
        let end = self.now.moment + Duration::from_secs_f64(seconds);
        for _ in 0..100_000 {
            let agvs = self.agvs.iter().filter_map(Device::wake_up);
            let next = agvs.chain(self.master.wake_up()).min();
            let Some(next) = next.filter(|next| *next <= end) else {
                break;
            };
            self.now = self.now.at(next.max(self.now.moment));
            for index in 0..self.agvs.len() {
                if self.agvs[index].wake_up().is_some_and(|wake| wake <= self.now.moment) {
                    self.agv_gets(index, Input::Time);
                }
            }
            if self.master.wake_up().is_some_and(|wake| wake <= self.now.moment) {
                self.master_gets(Input::Time);
            }
        }
        self.now = self.now.at(end);
    }

    /// Messages that passed on a topic.
    pub(crate) fn seen(&self, name: &str) -> Vec<&Value> {
        let suffix = format!("/{name}");
        let passed = self.passed.iter().filter(|passed| passed.topic.ends_with(&suffix));
        passed.map(|passed| &passed.body).collect()
    }

    pub(crate) fn orders(&self) -> Vec<&Value> {
        self.seen("order")
    }

    /// actionTypes of all instant actions.
    pub(crate) fn actions(&self) -> Vec<&str> {
        let messages = self.seen("instantActions").into_iter();
        messages
            .flat_map(|message| message["actions"].as_array().unwrap())
            .map(|action| action["actionType"].as_str().unwrap())
            .collect()
    }

    pub(crate) fn state(&self) -> &Value {
        self.seen("state").last().unwrap()
    }
}

pub(crate) fn ids(order: &Value) -> Vec<&str> {
    let nodes = order["nodes"].as_array().unwrap();
    nodes.iter().map(|node| node["nodeId"].as_str().unwrap()).collect()
}

/// A state of a vehicle no device here makes.
pub(crate) fn state(changes: &Value) -> Value {
    let mut state = json!({
        "headerId": 1, "timestamp": "2026-03-04T05:06:07.89Z", "version": VERSION,
        "manufacturer": "Reference", "serialNumber": "agv-1",
        "orderId": "", "orderUpdateId": 0, "lastNodeId": "n1", "lastNodeSequenceId": 0,
        "nodeStates": [], "edgeStates": [], "driving": false, "actionStates": [],
        "agvPosition": { "x": 0.0, "y": 0.0, "theta": 0.0, "mapId": "hall", "positionInitialized": true },
        "batteryState": { "batteryCharge": 80.0, "charging": false },
        "operatingMode": "AUTOMATIC", "errors": [], "safetyState": { "eStop": "NONE", "fieldViolation": false },
    });
    for (key, value) in changes.as_object().unwrap() {
        state[key] = value.clone();
    }
    state
}

pub(crate) fn connection(literal: &str) -> Value {
    json!({
        "headerId": 0, "timestamp": "2020-03-04T05:06:07.89Z", "version": VERSION,
        "manufacturer": "Reference", "serialNumber": "agv-1", "connectionState": literal,
    })
}
