//! A factsheet that says something else, and a vehicle that goes by it.

use std::time::Duration;

use serde_json::{Map, Value};

use super::speech::laid_over;
use crate::reference::agv::order_message::Order;
use crate::reference::agv::rejection::{Refusal, Rule};
use crate::reference::agv::{Agv, AgvConfig};

/// What ids have to look like.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ids {
    longest: Option<usize>,
    numerical: bool,
}

impl Agv {
    /// Publishes another factsheet from now on, or the true one again.
    pub(super) fn declare(&mut self, patch: Option<Value>) {
        self.declare_nothing();
        if let Some(patch) = patch {
            self.persona.factory = Some(Box::new(self.config.clone()));
            let told = laid_over(Some(&patch), self.true_factsheet());
            self.persona.ids = Ids::of(&patch);
            follow(&mut self.config, &patch, &Value::Object(told));
            self.persona.factsheet = Some(patch);
        }
        self.persona.replaced = false;
        self.publish_factsheet();
    }

    /// Is as it was before it declared anything.
    pub(super) fn declare_nothing(&mut self) {
        if let Some(factory) = self.persona.factory.take() {
            self.config = *factory;
            self.persona.replaced = true;
        }
        self.persona.ids = Ids::default();
        self.persona.factsheet = None;
    }

    /// The factsheet as it was told.
    pub(in crate::reference::agv) fn shown_factsheet(&self, body: Map<String, Value>) -> Map<String, Value> {
        laid_over(self.persona.factsheet.as_ref(), body)
    }

    /// What is wrong with the ids of an order, by the declared factsheet.
    pub(in crate::reference::agv) fn check_ids(&self, order: &Order) -> Result<(), Refusal> {
        let ids = self.persona.ids;
        let nodes = order.nodes.iter().map(|node| &node.id);
        let edges = order.edges.iter().map(|edge| &edge.id);
        let actions = order.actions().map(|action| &action.id);
        for id in std::iter::once(&order.id).chain(nodes).chain(edges).chain(actions) {
            if id.chars().count() > ids.longest.unwrap_or(self.config.max_id) {
                return Err(Refusal::at_field(Rule::Malformed, "an id is too long", id));
            }
            if ids.numerical && !id.bytes().all(|digit| digit.is_ascii_digit()) {
                return Err(Refusal::at_field(Rule::Malformed, "an id is no number", id));
            }
        }
        Ok(())
    }
}

impl Ids {
    fn of(patch: &Value) -> Self {
        let lengths = &patch["protocolLimits"]["maxStringLens"];
        Self {
            longest: size(&lengths["idLen"]),
            numerical: lengths["idNumericalOnly"].as_bool().unwrap_or(false),
        }
    }
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
    let lengths = &limits["maxArrayLens"];
    let edges = size(&lengths["order.edges"]).map(|edges| edges + 1);
    if let Some(nodes) = size(&lengths["order.nodes"]).into_iter().chain(edges).min() {
        config.max_nodes = nodes;
    }
    let actions = [&lengths["node.actions"], &lengths["edge.actions"]];
    if let Some(actions) = actions.into_iter().filter_map(size).min() {
        config.max_actions = actions;
    }
    if let Some(longest) = size(&limits["maxStringLens"]["msgLen"]) {
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
