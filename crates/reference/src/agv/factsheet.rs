//! The factsheet, generated from the configuration and the table of actions (section 6.15).
//!
//! It is published on every new connection, as nothing says when it first has to be (the ruling of FACT-01).

use serde_json::{Map, Value, json};

use tck_view::Topic;

use super::ability::SLOWEST;
use super::action_kinds::{self, ActionKind, Effect, MAX_HEIGHT, Scope};
use super::config::LOAD_POSITIONS;
use super::errors::MAX_ERRORS;
use super::hook_points::Part;
use super::path::{HALF_LENGTH, HALF_WIDTH};
use super::read::MAX_STRING;
use super::zone_sets::MOST_ZONES;
use super::{Agv, AgvConfig};

/// Optional parameters the vehicle acts on.
const OPTIONAL_PARAMETERS: [&str; 15] = [
    "order.nodes.nodeDescription",
    "order.nodes.nodePosition",
    "order.nodes.nodePosition.theta",
    "order.nodes.nodePosition.allowedDeviationXY",
    "order.nodes.nodePosition.allowedDeviationTheta",
    "order.nodes.nodePosition.mapDescription",
    "order.edges.edgeDescription",
    "order.edges.maxSpeed",
    "order.edges.maxHeight",
    "order.edges.orientation",
    "order.edges.orientationType",
    "order.edges.rotationAllowed",
    "order.edges.reachOrientationBeforeEntering",
    "order.edges.maxRotationSpeed",
    "order.edges.length",
];

/// Optional parameters of a vehicle that knows places by their names only.
const ON_A_LINE: [&str; 4] = [
    "order.nodes.nodeDescription",
    "order.edges.edgeDescription",
    "order.edges.maxHeight",
    "order.edges.length",
];

impl Agv {
    /// Publishes the factsheet.
    pub(crate) fn publish_factsheet(&mut self) {
        let body = self.true_factsheet();
        self.publish("factsheet", body);
    }

    /// Factsheet of the vehicle as it is.
    pub(crate) fn true_factsheet(&self) -> Map<String, Value> {
        let Value::Object(mut body) = self.factsheet() else {
            return Map::new();
        };
        if self.config.minimal_factsheet {
            strip(&mut body);
        }
        body
    }

    fn factsheet(&self) -> Value {
        let mut factsheet = json!({
            "typeSpecification": self.type_specification(),
            "physicalParameters": self.physical_parameters(),
            "protocolLimits": self.protocol_limits(),
            "protocolFeatures": self.protocol_features(),
            "agvGeometry": Self::geometry(),
            "loadSpecification": Self::load_specification(),
        });
        if self.config.has("localizationParameters") {
            // Required by the elder schema, and empty for a vehicle without further parameters.
            factsheet["localizationParameters"] = json!({});
        }
        if self.config.has("vehicleConfig") {
            let version = env!("CARGO_PKG_VERSION");
            factsheet["vehicleConfig"] = json!({ "versions": [{ "key": "softwareVersion", "value": version }] });
        }
        if let Value::Object(body) = &mut factsheet {
            self.says(Part::Factsheet, body);
        }
        factsheet
    }

    fn type_specification(&self) -> Value {
        let navigation = if self.config.line_guided() {
            "PHYSICAL_LINE_GUIDED"
        } else if self.config.plans {
            "AUTONOMOUS"
        } else {
            "VIRTUAL_LINE_GUIDED"
        };
        let mut kind = json!({
            "seriesName": "Reference AGV",
            "seriesDescription": "A simulated vehicle with two driven wheels and a lift",
            "agvKinematic": "DIFF",
            "agvClass": "CARRIER",
            "maxLoadMass": 500.0,
            "localizationTypes": [if self.config.line_guided() { "RFID" } else { "NATURAL" }],
            "navigationTypes": [navigation],
        });
        if self.config.heeds_zones() {
            kind["supportedZones"] = json!(self.config.zone_types);
        }
        kind
    }

    fn physical_parameters(&self) -> Value {
        json!({
            "speedMin": SLOWEST,
            "speedMax": self.config.speed,
            "angularSpeedMin": SLOWEST,
            "angularSpeedMax": self.config.rotation_speed,
            "accelerationMax": 2.0,
            "decelerationMax": 2.0,
            "heightMin": self.config.height.min(0.3),
            "heightMax": self.config.height,
            "width": 2.0 * HALF_WIDTH,
            "length": 2.0 * HALF_LENGTH,
        })
    }

    fn protocol_limits(&self) -> Value {
        let nodes = self.config.max_nodes;
        let mut limits = json!({
            "maxStringLens": {
                "msgLen": self.config.max_message,
                "idLen": self.config.max_id,
                "enumLen": MAX_STRING,
                "idNumericalOnly": self.config.numerical_ids,
            },
            "maxArrayLens": {
                "order.nodes": nodes,
                "order.edges": nodes.saturating_sub(1),
                "node.actions": self.config.max_actions,
                "edge.actions": self.config.max_actions,
                "instantActions": self.config.max_instant_actions,
                "state.nodeStates": nodes,
                "state.edgeStates": nodes,
                "state.loads": 1,
                "state.errors": MAX_ERRORS,
            },
            "timing": {
                "minOrderInterval": 0.0,
                "minStateInterval": self.config.min_state_interval.as_secs_f64(),
                "defaultStateInterval": self.stated_interval().as_secs_f64(),
            },
        });
        if self.config.heeds_zones() {
            limits["maxArrayLens"]["zoneSet.zones"] = json!(MOST_ZONES);
        }
        if let Some(interval) = self.config.visualization_interval {
            limits["timing"]["visualizationInterval"] = json!(interval.as_secs_f64());
        }
        limits
    }

    fn protocol_features(&self) -> Value {
        let usual = if self.config.line_guided() {
            ON_A_LINE.as_slice()
        } else {
            OPTIONAL_PARAMETERS.as_slice()
        };
        let special = [
            ("trajectory", "order.edges.trajectory"),
            ("corridor", "order.edges.corridor"),
            ("releaseRequired", "order.edges.corridor.releaseRequired"),
            ("releaseRequired", "order.edges.corridor.releaseLossBehavior"),
            ("direction", "order.edges.direction"),
        ];
        let special = special
            .iter()
            .filter(|(field, _)| self.config.uses(field))
            .map(|(_, name)| name);
        let zones = self.config.zone_set.is_some().then_some(&"order.zoneSetId");
        let parameters: Vec<Value> = usual
            .iter()
            .chain(special)
            .chain(zones)
            .filter_map(|name| self.spelled_parameter(name))
            .chain(
                self.config
                    .has("retry")
                    .then(|| "order.nodes.actions.retriable".to_owned()),
            )
            .map(|name| json!({ "parameter": name, "support": "SUPPORTED" }))
            .collect();
        let actions: Vec<Value> = action_kinds::offered(&self.config)
            .map(|kind| self.action_picture(kind))
            .collect();
        json!({ "optionalParameters": parameters, "agvActions": actions })
    }

    /// An optional parameter as the version writes it, if it has it.
    pub(crate) fn spelled_parameter(&self, name: &str) -> Option<String> {
        let (topic, path) = name.split_once('.')?;
        let names: Vec<&str> = path.split('.').collect();
        let own = self
            .config
            .names
            .spelled_names(Topic::of_name(topic).object(), &names)?;
        Some(format!("{topic}.{}", own.join(".")))
    }

    fn action_picture(&self, kind: &ActionKind) -> Value {
        let scopes = kind.scopes.iter();
        let scopes: Vec<&str> = scopes
            .filter(|scope| **scope != Scope::Zone || self.config.heeds("ACTION"))
            .map(|scope| scope.literal())
            .collect();
        let mut picture = Map::new();
        picture.insert("actionType".into(), json!(kind.name));
        picture.insert("actionDescription".into(), json!(kind.description));
        picture.insert("actionScopes".into(), json!(scopes));
        if !kind.parameters.is_empty() {
            let parameters = kind.parameters.iter().map(|parameter| {
                json!({
                    "key": parameter.key,
                    "valueDataType": parameter.data_type,
                    "isOptional": parameter.optional,
                })
            });
            picture.insert("actionParameters".into(), parameters.collect());
        }
        if let Some(result) = kind.result {
            picture.insert("resultDescription".into(), json!(result));
        }
        if self.config.has("vehicleConfig") {
            let all = ["NONE", "SOFT", "HARD", "SINGLE"];
            let known = if self.config.has("singleBlocking") { 4 } else { 3 };
            picture.insert("blockingTypes".into(), json!(all[..known]));
        }
        if self.config.has("actionFlags") {
            let cancels = self.config.interruptible && kind.effect != Effect::Calibrate;
            picture.insert("pauseAllowed".into(), json!(kind.pausable));
            picture.insert(
                "cancelAllowed".into(),
                json!(cancels || kind.effect == Effect::WaitForTrigger),
            );
        }
        Value::Object(picture)
    }

    fn geometry() -> Value {
        let wheel = |y: f64| {
            json!({
                "type": "DRIVE",
                "isActiveDriven": true,
                "isActiveSteered": false,
                "position": { "x": 0.0, "y": y },
                "diameter": 0.2,
                "width": 0.05,
            })
        };
        let point = |x: f64, y: f64| json!({ "x": x, "y": y });
        let contour = [
            point(HALF_LENGTH, HALF_WIDTH),
            point(-HALF_LENGTH, HALF_WIDTH),
            point(-HALF_LENGTH, -HALF_WIDTH),
            point(HALF_LENGTH, -HALF_WIDTH),
        ];
        json!({
            "wheelDefinitions": [wheel(0.35), wheel(-0.35)],
            "envelopes2d": [{ "set": "contour", "polygonPoints": contour }],
        })
    }

    fn load_specification() -> Value {
        let set = |name: &str, load_type: &str| {
            json!({
                "setName": name,
                "loadType": load_type,
                "loadPositions": LOAD_POSITIONS,
                "maxWeight": 500.0,
                "maxLoadhandlingHeight": MAX_HEIGHT,
            })
        };
        json!({ "loadPositions": LOAD_POSITIONS, "loadSets": [set("DEFAULT", "EPAL"), set("SMALL", "KLT")] })
    }
}

/// Takes away everything a factsheet need not have.
fn strip(body: &mut Map<String, Value>) {
    body.insert("agvGeometry".into(), json!({}));
    body.insert("loadSpecification".into(), json!({}));
    body.remove("vehicleConfig");
    if let Some(features) = body.get_mut("protocolFeatures") {
        features["optionalParameters"] = json!([]);
        for action in features["agvActions"].as_array_mut().into_iter().flatten() {
            if let Some(action) = action.as_object_mut() {
                let kept = ["actionType", "actionScopes", "pauseAllowed", "cancelAllowed"];
                action.retain(|key, _| kept.contains(&key.as_str()));
            }
        }
    }
    if let Some(limits) = body.get_mut("protocolLimits") {
        limits["maxStringLens"] = json!({});
        limits["maxArrayLens"] = json!({});
        limits["timing"] = json!({ "minOrderInterval": 0.0, "minStateInterval": 0.0 });
    }
}

impl AgvConfig {
    /// The action types a vehicle of this configuration offers, as in its factsheet.
    #[must_use]
    pub fn action_types(&self) -> Vec<&'static str> {
        action_kinds::offered(self).map(|kind| kind.name).collect()
    }
}
