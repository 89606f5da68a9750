//! Behaviour of the reference AGV, told through its messages, in virtual time.

mod actions;
mod cancelling;
#[cfg(feature = "tls")]
mod certificates;
mod curves;
mod driving;
mod faulty;
mod guesses;
mod hostile;
mod later;
mod link;
mod maps;
mod orders;
mod people;
mod personas;
mod rejections;
mod release;
mod replanning;
mod requests;
mod rest;
mod scenarios;
mod zones;

use std::time::Duration;

use serde_json::{Value, json};

use crate::deviations::agv as deviations;
use crate::{ConnectOptions, Device, Download, Input, Output, Publication};
use tck_base::clock::{Moment, Stamp};

use super::{Agv, AgvConfig, ErrorNames, OnboardMap};

/// A version no pack has, since versions are data.
const VERSION: &str = "7.8.9";

/// A vehicle and the time around it.
struct Bench {
    agv: Agv,
    now: Stamp,
    outputs: Vec<(Moment, Output)>,
    header_id: u32,
}

fn config() -> AgvConfig {
    let names = [
        "order",
        "instantActions",
        "state",
        "visualization",
        "connection",
        "factsheet",
        "zoneSet",
    ];
    AgvConfig {
        version: VERSION.into(),
        topics: names
            .map(|name| (name.to_owned(), format!("uagv/v7/Reference/agv-1/{name}")))
            .into(),
        chargers: ["n1".to_owned()].into(),
        ..AgvConfig::default()
    }
}

/// A site with a second map on board that is disabled, and a third one upstairs.
fn many_maps() -> AgvConfig {
    let mut config = config();
    let map = |id: &str, version: &str, enabled| OnboardMap {
        map_id: id.into(),
        map_version: version.into(),
        enabled,
    };
    config.maps = vec![
        map("hall", "1", true),
        map("hall", "2", false),
        map("yard", "1", false),
        map("loft", "1", true),
    ];
    config.map_capacity = 5;
    config
}

impl Bench {
    fn new() -> Self {
        Self::with(config(), &[])
    }

    /// A connected vehicle.
    fn with(config: AgvConfig, faults: &[&str]) -> Self {
        let mut bench = Self::off(config, faults);
        bench.give(Input::Connected);
        bench
    }

    fn off(config: AgvConfig, faults: &[&str]) -> Self {
        let utc = "2026-03-04T05:06:07.89Z".parse().unwrap();
        let now = Stamp {
            moment: Moment::START,
            utc,
        };
        Self {
            agv: deviations::built(config, faults).unwrap(),
            now,
            outputs: Vec::new(),
            header_id: 0,
        }
    }

    fn give(&mut self, input: Input) {
        let mut out = Vec::new();
        self.agv.handle(self.now, input, &mut out);
        let wake = self.agv.wake_up();
        assert!(
            wake.is_none_or(|wake| wake > self.now.moment),
            "wants to be woken in the past: {wake:?}"
        );
        self.outputs
            .extend(out.into_iter().map(|output| (self.now.moment, output)));
    }

    fn send_raw(&mut self, topic: &str, payload: impl Into<bytes::Bytes>) {
        self.give(Input::Message {
            topic: format!("uagv/v7/Reference/agv-1/{topic}"),
            payload: payload.into(),
        });
    }

    fn send(&mut self, topic: &str, mut body: Value) {
        let header = json!({
            "headerId": self.header_id, "timestamp": "2026-03-04T05:06:07.89Z", "version": VERSION,
            "manufacturer": "Reference", "serialNumber": "agv-1",
        });
        self.header_id += 1;
        for (key, value) in header.as_object().unwrap() {
            body.as_object_mut()
                .unwrap()
                .entry(key.clone())
                .or_insert(value.clone());
        }
        self.send_raw(topic, body.to_string());
    }

    fn order(&mut self, order: Value) {
        self.send("order", order);
    }

    fn instant(&mut self, action_type: &str, id: &str, parameters: Value) {
        self.send(
            "instantActions",
            json!({ "actions": [action(action_type, id, "HARD", parameters)] }),
        );
    }

    fn command(&mut self, name: &str, arguments: Value) {
        self.give(Input::Command(name.into(), arguments));
    }

    fn download(&mut self, progress: Download) {
        let token = self.outputs.iter().rev().find_map(|(_, output)| {
            if let Output::Fetch { token, .. } = output {
                Some(*token)
            } else {
                None
            }
        });
        self.give(Input::Download {
            token: token.unwrap_or_default(),
            progress,
        });
    }

    /// Lets time pass, waking the vehicle exactly when it wants.
    fn wait(&mut self, seconds: f64) {
        let end = self.now.moment + Duration::from_secs_f64(seconds);
        for _ in 0..100_000 {
            let Some(wake) = self.agv.wake_up().filter(|wake| *wake <= end) else {
                break;
            };
            self.now = self.now.at(wake.max(self.now.moment));
            self.give(Input::Time);
        }
        self.now = self.now.at(end);
    }

    fn publications(&self, topic: &str) -> Vec<&Publication> {
        let of_topic = |output: &'_ Output| matches!(output, Output::Publish(p) if p.topic.ends_with(topic));
        let found = self.outputs.iter().filter(|(_, output)| of_topic(output));
        found
            .filter_map(|(_, output)| {
                if let Output::Publish(publication) = output {
                    Some(publication)
                } else {
                    None
                }
            })
            .collect()
    }

    fn messages(&self, topic: &str) -> Vec<Value> {
        self.publications(topic)
            .iter()
            .filter_map(|publication| serde_json::from_slice(&publication.payload).ok())
            .collect()
    }

    fn states(&self) -> Vec<Value> {
        self.messages("/state")
    }

    fn state(&self) -> Value {
        self.states().pop().unwrap()
    }

    /// Forgets what was published so far, but the last state.
    fn forget(&mut self) {
        let last = self
            .outputs
            .iter()
            .rposition(|(_, output)| matches!(output, Output::Publish(p) if p.topic.ends_with("/state")));
        self.outputs.drain(..last.unwrap_or(0));
    }

    fn status(&self, id: &str) -> String {
        status_in(&self.state(), id).unwrap_or_else(|| "absent".into())
    }

    /// The statuses an action had, without repetitions.
    fn statuses(&self, id: &str) -> Vec<String> {
        let mut statuses: Vec<String> = self.states().iter().filter_map(|state| status_in(state, id)).collect();
        statuses.dedup();
        statuses
    }

    /// The nodes the vehicle reported, without repetitions, as `id/sequenceId`.
    fn trail(&self) -> Vec<String> {
        let node = |state: &Value| {
            format!(
                "{}/{}",
                state["lastNodeId"].as_str().unwrap(),
                state["lastNodeSequenceId"]
            )
        };
        let mut trail: Vec<String> = self.states().iter().map(node).collect();
        trail.dedup();
        trail
    }

    fn error_types(&self) -> Vec<String> {
        let state = self.state();
        state["errors"]
            .as_array()
            .unwrap()
            .iter()
            .map(|error| error["errorType"].as_str().unwrap().to_owned())
            .collect()
    }

    /// The value of a reference of the only error.
    fn reference(&self, key: &str) -> Option<String> {
        let state = self.state();
        let references = state["errors"][0]["errorReferences"].as_array()?;
        let found = references.iter().find(|reference| reference["referenceKey"] == key)?;
        found["referenceValue"].as_str().map(str::to_owned)
    }

    fn options(&mut self) -> ConnectOptions {
        self.agv.connect_options(self.now)
    }
}

fn status_in(state: &Value, id: &str) -> Option<String> {
    let actions = state["actionStates"].as_array()?;
    let found = actions.iter().find(|action| action["actionId"] == id)?;
    found["actionStatus"].as_str().map(str::to_owned)
}

#[expect(clippy::needless_pass_by_value, reason = "json!() is written in place")]
fn action(action_type: &str, id: &str, blocking: &str, parameters: Value) -> Value {
    let parameters: Vec<Value> = parameters
        .as_object()
        .unwrap()
        .iter()
        .map(|(key, value)| json!({ "key": key, "value": value }))
        .collect();
    json!({ "actionType": action_type, "actionId": id, "blockingType": blocking, "actionParameters": parameters })
}

/// An order along a route such as `n1 n2 | n3`; the horizon stands behind the bar.
fn order(id: &str, update: u32, from: u32, route: &str) -> Value {
    let (base, horizon) = route.split_once('|').unwrap_or((route, ""));
    let released = base.split_whitespace().map(|node| (node, true));
    let nodes: Vec<(&str, bool)> = released
        .chain(horizon.split_whitespace().map(|node| (node, false)))
        .collect();
    let picture = |(index, (node, released)): (usize, &(&str, bool))| {
        let sequence_id = from + 2 * u32::try_from(index).unwrap();
        json!({ "nodeId": node, "sequenceId": sequence_id, "released": released, "actions": [] })
    };
    let edge = |(index, pair): (usize, &[(&str, bool)])| {
        let sequence_id = from + 2 * u32::try_from(index).unwrap() + 1;
        json!({
            "edgeId": format!("{}-{}", pair[0].0, pair[1].0), "sequenceId": sequence_id, "released": pair[1].1,
            "startNodeId": pair[0].0, "endNodeId": pair[1].0, "actions": [],
        })
    };
    json!({
        "orderId": id, "orderUpdateId": update,
        "nodes": nodes.iter().enumerate().map(picture).collect::<Vec<_>>(),
        "edges": nodes.windows(2).enumerate().map(edge).collect::<Vec<_>>(),
    })
}

/// The order with something changed at a JSON pointer; `null` removes the member.
fn with(mut order: Value, pointer: &str, value: Value) -> Value {
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    let parent = order.pointer_mut(parent).unwrap();
    match parent {
        Value::Object(fields) if value.is_null() => drop(fields.remove(key)),
        Value::Object(fields) => drop(fields.insert(key.into(), value)),
        Value::Array(elements) if key == "-" => elements.push(value),
        other => other[key.parse::<usize>().unwrap()] = value,
    }
    order
}

fn ids(states: &Value, key: &str) -> Vec<String> {
    states
        .as_array()
        .unwrap()
        .iter()
        .map(|state| state[key].as_str().unwrap().to_owned())
        .collect()
}
