//! The body of the state message, part by part.

use serde_json::{Map, Value, json};

use crate::reference::agv::action_kinds::MAX_HEIGHT;
use crate::reference::agv::actions::Action;
use crate::reference::agv::faults::FaultName as F;
use crate::reference::agv::points::Part;
use crate::reference::agv::tolerances::ToleranceName as T;
use crate::reference::agv::{Agv, Load, Mode};

impl Agv {
    /// The state now, without header (STATE-MSG-01).
    pub(crate) fn state_picture(&self) -> Map<String, Value> {
        let mut state = Map::new();
        let mut set = |key: &str, value: Value| state.insert(key.to_owned(), value);
        if self.config.has("maps") {
            set("maps", self.maps.picture());
        }
        set("orderId", json!(self.book.order_id));
        set("orderUpdateId", json!(self.book.update_id));
        if let Some(zones) = &self.config.zone_set {
            set("zoneSetId", json!(zones));
        }
        if self.config.line_guided() {
            set("distanceSinceLastNode", json!(self.distance_made()));
        }
        set("lastNodeId", json!(self.book.last_node));
        set("lastNodeSequenceId", json!(self.book.last_sequence));
        set("nodeStates", self.node_states());
        set("edgeStates", self.edge_states());
        if !self.config.line_guided() {
            set("agvPosition", self.position_picture());
        }
        set("velocity", self.velocity_picture());
        set("loads", self.loads_picture());
        set("driving", json!(self.motion.is_moving()));
        let pause = self.holds.pause && self.pause_hidden_until.is_none();
        set("paused", json!(pause || self.holds.button || self.holds.emergency));
        set(
            "newBaseRequest",
            json!(self.book.base_runs_low() || self.persona.wants_base),
        );
        let actions = self.actions.iter();
        set(
            "actionStates",
            actions.filter_map(|action| self.action_state(action)).collect(),
        );
        set("batteryState", self.battery());
        set("operatingMode", json!(self.mode_literal()));
        set("errors", self.errors_picture());
        set(
            "information",
            if self.is_flashing() {
                json!([{ "infoType": "warningLights", "infoLevel": "INFO" }])
            } else {
                self.log_information()
            },
        );
        set("safetyState", self.safety());
        self.says(Part::State, &mut state);
        state
    }

    /// All active errors (STATE-MSG-16).
    fn errors_picture(&self) -> Value {
        let errors = self.errors.active.iter();
        errors
            .filter_map(|error| self.said(Part::Error(error), error.picture()))
            .collect()
    }

    /// What it tells about its last log.
    fn log_information(&self) -> Value {
        let entry = |(action_id, name): &(String, String)| {
            json!({
                "infoType": "logReport",
                "infoLevel": "INFO",
                "infoDescription": name,
                "infoReferences": [{ "referenceKey": "actionId", "referenceValue": action_id }],
            })
        };
        let again = self.third.repeated.iter().map(|order_id| {
            json!({
                "infoType": "orderReceivedAgain",
                "infoLevel": "DEBUG",
                "infoReferences": [{ "referenceKey": "orderId", "referenceValue": order_id }],
            })
        });
        self.last_log.iter().map(entry).chain(again).collect()
    }

    /// Metres since the last node.
    fn distance_made(&self) -> f64 {
        let pose = self.motion.pose(self.moment());
        let left = self.book.left.0.as_ref().filter(|_| self.book.entered);
        left.map_or(0.0, |stop| pose.distance(stop.place.x, stop.place.y))
    }

    fn action_state(&self, action: &Action) -> Option<Value> {
        let status = action.masked.unwrap_or(action.status);
        let mut picture = json!({
            "actionId": action.request.id,
            "actionType": action.request.action_type,
            "actionStatus": status.literal(),
        });
        let told = self.fourth.results_told.contains(&action.request.id);
        if let Some(result) = action.result.as_ref().filter(|_| !told) {
            picture["resultDescription"] = json!(result);
        }
        self.said(Part::Action(action), picture)
    }

    /// Whether there is nothing left but the horizon.
    pub(crate) fn waits_at_decision_point(&self) -> bool {
        self.book.nodes.front().is_some_and(|stop| !stop.node.released)
    }

    /// agvPosition, also for the visualization (STATE-MSG-05).
    pub(crate) fn position_picture(&self) -> Value {
        let pose = self.motion.pose(self.moment());
        let trembling = if self.takes(T::R1PositionTrembles) {
            [0.0, 0.003, -0.002, 0.001, -0.003][usize::try_from(self.states_sent % 5).unwrap_or_default()]
        } else {
            0.0
        };
        let theta = if self.takes(T::R1ThetaMinusPi) && pose.theta > std::f64::consts::PI - 1e-9 {
            -std::f64::consts::PI
        } else {
            pose.theta
        };
        let y = if self.faults.has(F::AxesMirrored) {
            -pose.y
        } else {
            pose.y
        };
        let rounded = self.takes(T::R3PositionRounded);
        let theta = if rounded {
            (theta * 1000.0).trunc() / 1000.0
        } else {
            theta
        };
        let number = |value: f64| {
            if rounded {
                (value * 100.0).round() / 100.0
            } else {
                value
            }
        };
        let mut position = Map::new();
        let mut set = |key: &str, value: Value| position.insert(key.to_owned(), value);
        set("positionInitialized", json!(!(self.lost || self.persona.lost)));
        set("localizationScore", json!(0.98));
        set("x", json!(number(pose.x + trembling)));
        set("y", json!(number(y)));
        set("theta", json!(theta));
        set("mapId", json!(self.claimed_map.as_ref().unwrap_or(&pose.map_id)));
        self.says(Part::Position, &mut position);
        Value::Object(position)
    }

    /// velocity, also for the visualization.
    pub(crate) fn velocity_picture(&self) -> Value {
        let velocity = self.motion.velocity();
        let (mut vx, mut vy, mut omega) = (velocity.vx, 0.0, velocity.omega);
        if self.takes(T::R3VelocityTrembles) {
            let noise = [0.001, -0.001, 0.0][usize::try_from(self.states_sent % 3).unwrap_or_default()];
            vx = if self.motion.is_moving() { vx } else { noise };
            vy = -noise;
            omega = if omega == 0.0 { noise } else { omega };
        }
        let mut picture = Map::new();
        for (axis, speed) in [("vx", vx), ("vy", vy), ("omega", omega)] {
            picture.insert(axis.to_owned(), json!(speed));
        }
        self.says(Part::Velocity, &mut picture);
        Value::Object(picture)
    }

    fn loads_picture(&self) -> Value {
        if self.hidden_load.is_some() {
            return json!([]);
        }
        let picture = |load: &Load| {
            json!({
                "loadId": load.id,
                "loadType": load.kind,
                "loadPosition": load.position,
                "boundingBoxReference": { "x": 0.0, "y": 0.0, "z": 0.0 },
                "loadDimensions": { "length": 1.2, "width": 0.8, "height": MAX_HEIGHT / 2.0 },
                "weight": 100.0,
            })
        };
        let shadow = self.shadow.iter().map(|(_, load)| load);
        self.loads.iter().chain(shadow).map(picture).collect()
    }

    fn battery(&self) -> Value {
        let charge = match self.persona.charge {
            charge if self.takes(T::R6LibBatteryGoodOrBad) => {
                let good = charge.unwrap_or(87.5) > 50.0;
                if good { 80.0 } else { 20.0 }
            }
            None if self.takes(T::R1BatteryDrains) => {
                let used = u32::try_from(self.states_sent % 5_000).unwrap_or_default();
                87.5 - f64::from(used) * 0.01
            }
            charge => charge.unwrap_or(87.5),
        };
        json!({
            "batteryCharge": charge,
            "batteryVoltage": 48.2,
            "batteryHealth": 96,
            "charging": self.charging,
            "reach": 8_000,
        })
    }

    fn mode_literal(&self) -> &'static str {
        match self.mode {
            Mode::Automatic => "AUTOMATIC",
            Mode::Semiautomatic => "SEMIAUTOMATIC",
            Mode::Manual => "MANUAL",
            Mode::Service => "SERVICE",
            Mode::Teachin => "TEACHIN",
        }
    }

    fn safety(&self) -> Value {
        let emergency_stop = match () {
            () if self.holds.emergency || self.latched => "MANUAL",
            () if self.holds.field => "AUTOACK",
            () => "NONE",
        };
        json!({ "eStop": emergency_stop, "fieldViolation": self.holds.field || self.field_latched })
    }
}
