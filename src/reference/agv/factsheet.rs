//! The factsheet, generated from the configuration and the table of actions (section 6.15).

use serde_json::{Map, Value, json};

use super::ability::SLOWEST;
use super::action_kinds::{self, ActionKind, Deed, LOAD_POSITIONS, MAX_HEIGHT};
use super::errors::MAX_ERRORS;
use super::faults::FaultName as F;
use super::instant::MAX_INSTANT_ACTIONS;
use super::path::{HALF_LENGTH, HALF_WIDTH};
use super::read::MAX_STRING;
use super::tolerances::ToleranceName as T;
use super::{Agv, AgvConfig};

/// Optional parameters the vehicle acts on.
const OPTIONAL_PARAMETERS: [&str; 14] = [
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
    "order.edges.maxRotationSpeed",
    "order.edges.length",
];

/// The same for a vehicle that knows places by their names only.
const ON_A_LINE: [&str; 4] = [
    "order.nodes.nodeDescription",
    "order.edges.edgeDescription",
    "order.edges.maxHeight",
    "order.edges.length",
];

impl Agv {
    /// Publishes the factsheet.
    pub(super) fn publish_factsheet(&mut self) {
        if self.faults.has(F::NoFactsheet) {
            return;
        }
        let mut body = self.shown_factsheet(self.true_factsheet());
        if self.faults.has(F::R2FactsheetWithoutGeometry) {
            body.remove("agvGeometry");
        }
        if self.faults.has(F::FactsheetWithoutLimits) {
            body.remove("protocolLimits");
        }
        self.publish("factsheet", body, &[]);
    }

    /// What it says about itself.
    pub(super) fn true_factsheet(&self) -> Map<String, Value> {
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
            "agvGeometry": self.geometry(),
            "loadSpecification": self.load_specification(),
        });
        if self.config.has("localizationParameters") {
            // Required by the elder schema, and empty for a vehicle without further parameters.
            factsheet["localizationParameters"] = json!({});
        }
        if self.config.has("vehicleConfig") {
            let version = if self.faults.has(F::VersionsNumeric) {
                json!(1.0)
            } else {
                json!(env!("CARGO_PKG_VERSION"))
            };
            factsheet["vehicleConfig"] = if self.faults.has(F::R1VersionsAsMap) {
                json!({ "versions": { "softwareVersion": version } })
            } else {
                json!({ "versions": [{ "key": "softwareVersion", "value": version }] })
            };
            let leased = self.faults.has(F::R3AddressChanges);
            if leased || self.takes(T::R3NetworkTold) {
                let host = if leased { 20 + self.states_sent % 200 } else { 20 };
                factsheet["vehicleConfig"]["network"] = json!({
                    "dnsServers": ["10.1.0.1"],
                    "ntpServers": ["10.1.0.2"],
                    "localIpAddress": format!("10.1.0.{host}"),
                    "netmask": "255.255.255.0",
                    "defaultGateway": "10.1.0.1",
                });
            }
        }
        factsheet
    }

    fn type_specification(&self) -> Value {
        let navigation = match () {
            () if self.config.line_guided() => "PHYSICAL_LINE_GUIDED",
            () if self.config.plans => "AUTONOMOUS",
            () => "VIRTUAL_LINE_GUIDED",
        };
        json!({
            "seriesName": "Reference AGV",
            "seriesDescription": "A simulated vehicle with two driven wheels and a lift",
            "agvKinematic": if self.faults.has(F::FactsheetKinematicsUnknown) { "DIFFERENTIAL" } else { "DIFF" },
            "agvClass": if self.faults.has(F::R1ClassUnknown) { "AMR" } else { "CARRIER" },
            "maxLoadMass": 500.0,
            "localizationTypes": if self.faults.has(F::R3LocalizationTypesAsText) {
                json!("NATURAL")
            } else {
                json!([if self.config.line_guided() { "RFID" } else { "NATURAL" }])
            },
            "navigationTypes": [navigation],
        })
    }

    fn physical_parameters(&self) -> Value {
        let mut parameters = json!({
            "speedMin": SLOWEST,
            "speedMax": self.config.speed,
            "angularSpeedMin": SLOWEST,
            "angularSpeedMax": self.config.rotation_speed,
            "accelerationMax": 2.0,
            "decelerationMax": 2.0,
            "heightMin": self.config.height.min(0.3),
            "heightMax": self.config.height,
        });
        if !self.faults.has(F::FactsheetWithoutSize) {
            parameters["width"] = json!(2.0 * HALF_WIDTH);
            parameters["length"] = json!(2.0 * HALF_LENGTH);
        }
        if self.faults.has(F::SpeedMinAboveMax) {
            parameters["speedMin"] = json!(self.config.speed + 1.0);
        }
        parameters
    }

    fn protocol_limits(&self) -> Value {
        let nodes = self.config.max_nodes;
        let min_state_interval = match self.config.min_state_interval.as_secs_f64() {
            _ if self.faults.has(F::MinStateIntervalIgnored) => 5.0,
            // In milliseconds, and never 0: that would promise nothing.
            seconds if self.faults.has(F::R6FactsheetTimesInMilliseconds) => seconds.max(0.1) * 1000.0,
            seconds => seconds,
        };
        let min_order_interval = match self.takes(T::OrdersSpaced) {
            true if self.faults.has(F::R6FactsheetTimesInMilliseconds) => 250.0,
            true => 0.25,
            false => 0.0,
        };
        let mut limits = json!({
            "maxStringLens": {
                "msgLen": self.config.max_message,
                "idLen": self.config.max_id,
                "enumLen": MAX_STRING,
                "idNumericalOnly": false,
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
                "minOrderInterval": min_order_interval,
                "minStateInterval": min_state_interval,
                "defaultStateInterval": self.stated_interval().as_secs_f64(),
            },
        });
        // What else it takes in little would not be true then.
        if self.takes(T::R4LimitsOfZeroInFactsheet) && !self.takes(T::LittleFits) {
            for list in ["maxStringLens", "maxArrayLens"] {
                let members = limits[list].as_object_mut().into_iter().flat_map(Map::values_mut);
                members
                    .filter(|limit| limit.is_number())
                    .for_each(|limit| *limit = json!(0));
            }
        }
        if self.faults.has(F::OwnLimitExceeded) || self.faults.has(F::R1ActionStatesLimitExceeded) {
            limits["maxArrayLens"]["state.actionStates"] = json!(1);
        }
        if self.faults.has(F::R1ArrayLimitsNested) {
            limits["maxArrayLens"] = json!({
                "order": { "nodes": nodes, "edges": nodes.saturating_sub(1) },
                "instantActions": MAX_INSTANT_ACTIONS,
            });
        }
        if let Some(interval) = self.config.visualization_interval {
            limits["timing"]["visualizationInterval"] = json!(interval.as_secs_f64());
        }
        if self.faults.has(F::FactsheetWithoutTiming)
            && let Some(fields) = limits.as_object_mut()
        {
            fields.remove("timing");
        }
        limits
    }

    fn protocol_features(&self) -> Value {
        let support = if self.faults.has(F::FactsheetSupportYes) {
            "YES"
        } else {
            "SUPPORTED"
        };
        let usual = if self.config.line_guided() {
            ON_A_LINE.as_slice()
        } else {
            OPTIONAL_PARAMETERS.as_slice()
        };
        let special = [
            ("trajectory", "order.edges.trajectory"),
            ("corridor", "order.edges.corridor"),
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
            .map(|name| match self.faults.has(F::R2OptionalParametersAsNames) {
                true => json!(name),
                false => json!({ "parameter": name, "support": support }),
            })
            .collect();
        let missing = self.faults.has(F::FactsheetActionMissing);
        let unlisted = self.faults.has(F::StateRequestUnlisted);
        let actions: Vec<Value> = action_kinds::offered(&self.config)
            .filter(|kind| !(missing && kind.deed == Deed::CancelOrder))
            .filter(|kind| !(unlisted && kind.deed == Deed::StateRequest))
            .map(|kind| self.action_picture(kind))
            .collect();
        let reversed = self.takes(super::tolerances::ToleranceName::R1FactsheetListsReversed);
        let (parameters, actions): (Vec<Value>, Vec<Value>) = if reversed {
            (
                parameters.into_iter().rev().collect(),
                actions.into_iter().rev().collect(),
            )
        } else {
            (parameters, actions)
        };
        let mut features = json!({ "optionalParameters": parameters, "agvActions": actions });
        if self.faults.has(F::OptionalParametersMissing)
            && let Some(fields) = features.as_object_mut()
        {
            fields.remove("optionalParameters");
        }
        features
    }

    fn action_picture(&self, kind: &ActionKind) -> Value {
        let mut scopes: Vec<&str> = match self.faults.has(F::R6FactsheetAllScopesForAll) {
            true => vec!["INSTANT", "NODE", "EDGE"],
            false => kind.scopes.iter().map(|scope| scope.literal()).collect(),
        };
        for (deed, scope, fault) in [
            (Deed::StartPause, "NODE", F::StartPauseOnNodes),
            (Deed::Pick, "INSTANT", F::PickAsInstantAction),
            (Deed::Pick, "INSTANT", F::R1PickListedInstant),
            (Deed::FinePositioning, "INSTANT", F::PositioningAsInstantAction),
            (Deed::StartCharging, "EDGE", F::ChargingOnEdges),
        ] {
            if kind.deed == deed && self.faults.has(fault) {
                scopes.push(scope);
            }
        }
        let lower = self.faults.has(F::FactsheetScopeLowerCase);
        let scopes: Vec<String> = scopes
            .into_iter()
            .map(|scope| {
                if lower {
                    scope.to_ascii_lowercase()
                } else {
                    scope.to_owned()
                }
            })
            .collect();
        let renamed = kind.deed == Deed::Pick && self.faults.has(F::PickParameterRenamed);
        let unknown = self.faults.has(F::ParameterTypeUnknown);
        let sized = self.faults.has(F::R6FactsheetParameterTypeFloat);
        let mut picture = Map::new();
        let capital = matches!(kind.deed, Deed::StartPause | Deed::StopPause) && self.faults.has(F::VendorPauseListed);
        let name = if capital {
            kind.name.replacen('s', "S", 1)
        } else {
            kind.name.to_owned()
        };
        picture.insert("actionType".into(), json!(name));
        picture.insert("actionDescription".into(), json!(kind.description));
        if self.faults.has(F::R1ScopesInOneText) {
            picture.insert("actionScopes".into(), json!(scopes.join(",")));
        } else {
            picture.insert("actionScopes".into(), json!(scopes));
        }
        if !kind.parameters.is_empty() {
            let parameters = kind.parameters.iter().map(|parameter| {
                let mut picture = json!({
                    "key": match parameter.key {
                        "stationType" if renamed => "station_type",
                        key => key,
                    },
                    "valueDataType": match parameter.data_type {
                        _ if unknown => "DOUBLE",
                        "FLOAT" | "NUMBER" if sized => "FLOAT64",
                        data_type => data_type,
                    },
                    "isOptional": parameter.optional,
                });
                if let Some(fields) = picture
                    .as_object_mut()
                    .filter(|_| !parameter.optional && self.takes(T::R3OptionalFlagOmitted))
                {
                    fields.remove("isOptional");
                }
                picture
            });
            picture.insert("actionParameters".into(), parameters.collect());
        }
        let told = kind.deed == Deed::LogReport && self.tells_logs();
        if let Some(result) = kind.result.filter(|_| !told) {
            picture.insert("resultDescription".into(), json!(result));
        }
        if self.config.has("vehicleConfig") {
            let types = match self.faults.has(F::R2BlockingTypesLowerCase) {
                true => json!(["none", "soft", "hard"]),
                false => json!(["NONE", "SOFT", "HARD"]),
            };
            picture.insert("blockingTypes".into(), types);
        }
        Value::Object(picture)
    }

    fn geometry(&self) -> Value {
        let typeless = self.faults.has(F::WheelWithoutType);
        let wheel = |y: f64| {
            let mut wheel = json!({
                "type": "DRIVE",
                "isActiveDriven": true,
                "isActiveSteered": false,
                "position": { "x": 0.0, "y": y },
                "diameter": 0.2,
                "width": 0.05,
            });
            if let Some(fields) = wheel.as_object_mut().filter(|_| typeless) {
                fields.remove("type");
            }
            wheel
        };
        let point = |x: f64, y: f64| json!({ "x": x, "y": y });
        let mut contour = vec![
            point(HALF_LENGTH, HALF_WIDTH),
            point(-HALF_LENGTH, HALF_WIDTH),
            point(-HALF_LENGTH, -HALF_WIDTH),
            point(HALF_LENGTH, -HALF_WIDTH),
        ];
        if self.faults.has(F::PolygonCrossed) {
            contour.swap(1, 2);
        }
        json!({
            "wheelDefinitions": [wheel(0.35), wheel(-0.35)],
            "envelopes2d": if self.faults.has(F::R1EnvelopeUnnamed) {
                json!([{ "polygonPoints": contour }])
            } else {
                json!([{ "set": "contour", "polygonPoints": contour }])
            },
        })
    }

    fn load_specification(&self) -> Value {
        let typeless = self.faults.has(F::LoadSetWithoutType);
        let set = |name: &str, load_type: &str| {
            let mut set = json!({
                "setName": name,
                "loadType": load_type,
                "loadPositions": LOAD_POSITIONS,
                "maxWeight": 500.0,
                "maxLoadhandlingHeight": MAX_HEIGHT,
            });
            if let Some(fields) = set.as_object_mut().filter(|_| typeless) {
                fields.remove("loadType");
            }
            set
        };
        let second = if self.faults.has(F::LoadSetTwice) {
            "DEFAULT"
        } else {
            "SMALL"
        };
        json!({ "loadPositions": LOAD_POSITIONS, "loadSets": [set("DEFAULT", "EPAL"), set(second, "KLT")] })
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
                action.retain(|key, _| matches!(key.as_str(), "actionType" | "actionScopes"));
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
