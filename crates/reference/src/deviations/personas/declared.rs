//! A factsheet that says something else, and a vehicle that goes by it.

use std::time::Duration;

use serde_json::Value;

use super::Persona;
use super::speech::lay_over;
use crate::agv::{Agv, AgvConfig};

impl Persona {
    /// Publishes another factsheet from now on, or the true one again.
    pub(super) fn declare(&mut self, agv: &mut Agv, patch: Option<Value>) {
        self.declare_nothing(agv);
        if let Some(patch) = patch {
            self.factory = Some(Box::new(agv.config.clone()));
            let mut told = agv.true_factsheet();
            lay_over(Some(&patch), &mut told);
            follow(&mut agv.config, &patch, &Value::Object(told));
            self.factsheet = Some(spelled(agv, patch));
        }
        self.replaced = false;
        let mut body = agv.true_factsheet();
        lay_over(self.factsheet.as_ref(), &mut body);
        agv.publish("factsheet", body);
    }

    /// The vehicle is as it was before it declared anything.
    pub(super) fn declare_nothing(&mut self, agv: &mut Agv) {
        if let Some(factory) = self.factory.take() {
            agv.config = *factory;
            self.replaced = true;
        }
        self.factsheet = None;
    }
}

/// A factsheet whose optional parameters are called as the version does; what it does not have is left out.
fn spelled(agv: &Agv, mut patch: Value) -> Value {
    let listed = patch.pointer_mut("/protocolFeatures/optionalParameters");
    if let Some(listed) = listed.and_then(Value::as_array_mut) {
        listed.retain_mut(|entry| {
            let Some(usual) = entry["parameter"].as_str().map(str::to_owned) else {
                return true;
            };
            let own = agv.spelled_parameter(&usual);
            if let Some(own) = &own {
                entry["parameter"] = Value::from(own.as_str());
            }
            own.is_some() || !usual.contains('.')
        });
    }
    patch
}

/// A limit; zero is none.
fn size(value: &Value) -> Option<usize> {
    let size = usize::try_from(value.as_u64()?).ok()?;
    Some(size).filter(|size| *size > 0)
}

fn seconds(value: &Value) -> Option<Duration> {
    let seconds = value.as_f64().filter(|seconds| *seconds >= 0.0)?;
    Some(Duration::from_secs_f64(seconds.min(super::LONGEST)))
}

/// Goes by what a patch of the factsheet says, where the vehicle has a switch for it.
fn follow(config: &mut AgvConfig, patch: &Value, told: &Value) {
    let limits = &patch["protocolLimits"];
    let strings = &limits["maxStringLens"];
    config.max_id = size(&strings["idLen"]).unwrap_or(config.max_id);
    config.numerical_ids = strings["idNumericalOnly"].as_bool().unwrap_or(config.numerical_ids);
    let lengths = &limits["maxArrayLens"];
    let edges = size(&lengths["order.edges"]).map(|edges| edges + 1);
    if let Some(nodes) = size(&lengths["order.nodes"]).into_iter().chain(edges).min() {
        config.max_nodes = nodes;
    }
    let actions = [&lengths["node.actions"], &lengths["edge.actions"]];
    if let Some(actions) = actions.into_iter().filter_map(size).min() {
        config.max_actions = actions;
    }
    if let Some(longest) = size(&strings["msgLen"]) {
        config.max_message = longest;
    }
    let timing = &limits["timing"];
    if let Some(interval) = seconds(&timing["minStateInterval"]) {
        config.min_state_interval = interval;
    }
    if let Some(interval) = seconds(&timing["defaultStateInterval"]).filter(|interval| !interval.is_zero()) {
        config.state_interval = interval;
    }
    if let Some(interval) = seconds(&timing["visualizationInterval"]).filter(|interval| !interval.is_zero()) {
        config.visualization_interval = Some(interval);
    }
    if let Some(listed) = patch["protocolFeatures"]["optionalParameters"].as_array() {
        let has = |name: &str| listed.iter().any(|one| one["parameter"] == name);
        config.trajectories |= has("order.edges.trajectory") || has("order.edges.corridor");
    }
    if let Some(positions) = patch["loadSpecification"]["loadPositions"].as_array() {
        let names = positions.iter().filter_map(Value::as_str).take(16);
        config.load_positions = names.map(str::to_owned).collect();
    }
    if let Some(zones) = patch["typeSpecification"]["supportedZones"].as_array() {
        let names = zones.iter().filter_map(Value::as_str).take(16);
        config.zone_types = names.map(str::to_owned).collect();
    }
    let body = &patch["physicalParameters"];
    let positive = |value: &Value| value.as_f64().filter(|number| *number > 0.0);
    config.speed = positive(&body["speedMax"]).unwrap_or(config.speed);
    config.rotation_speed = positive(&body["angularSpeedMax"]).unwrap_or(config.rotation_speed);
    config.height = positive(&body["heightMax"]).unwrap_or(config.height);
    if !patch["protocolFeatures"]["agvActions"].is_null()
        && let Some(listed) = told["protocolFeatures"]["agvActions"].as_array()
    {
        let listed = |name: &str| listed.iter().any(|action| action["actionType"] == name);
        let missing = config.action_types().into_iter().filter(|name| !listed(name));
        let missing: Vec<String> = missing.map(str::to_owned).collect();
        config.without_actions.extend(missing);
    }
}
