//! The body of the state message, part by part (sections 6.10.3 to 6.10.6).
//!
//! agvPosition is left out by a vehicle on a line, which has none (the ruling of STATE-MSG-05).

use serde_json::{Map, Value, json};

use crate::agv::action_kinds::MAX_HEIGHT;
use crate::agv::actions::{Action, Origin};
use crate::agv::errors::Life;
use crate::agv::hook_points::Part;
use crate::agv::{Agv, Load, Mode};

impl Agv {
    /// The state now, without header (STATE-MSG-01).
    pub(crate) fn state_picture(&self) -> Map<String, Value> {
        let mut state = Map::new();
        let mut set = |key: &str, value: Value| state.insert(key.to_owned(), value);
        if self.config.has("maps") {
            set("maps", self.maps.picture());
        }
        set("orderId", json!(self.order.order_id));
        set("orderUpdateId", json!(self.order.update_id));
        if let Some(zones) = &self.config.zone_set {
            set("zoneSetId", json!(zones));
        }
        if self.config.line_guided() {
            set("distanceSinceLastNode", json!(self.distance_made()));
        }
        set("lastNodeId", json!(self.order.last_node));
        set("lastNodeSequenceId", json!(self.order.last_sequence));
        set("nodeStates", self.node_states());
        set("edgeStates", self.edge_states());
        if !self.config.line_guided() {
            set("agvPosition", self.position_picture());
        }
        set("velocity", self.velocity_picture());
        set("loads", self.loads_picture());
        set("driving", json!(self.motion.is_moving()));
        let paused = self.holds.pause || self.holds.button || self.holds.emergency;
        set("paused", json!(paused));
        set("newBaseRequest", json!(self.order.base_runs_low()));
        let apart = self.config.has("instantActionStates");
        set("actionStates", self.listed(|action| !apart || action.of_order()));
        if apart {
            set(
                "instantActionStates",
                self.listed(|action| action.origin == Origin::Instant),
            );
        }
        if self.config.heeds("ACTION") {
            set("zoneActionStates", self.listed(Action::of_zone));
        }
        if self.config.heeds_zones() {
            set("zoneSets", self.zone_sets.picture());
        }
        if self.config.uses("releaseRequired") {
            set("edgeRequests", self.edge_requests());
        }
        if self.config.asks_for_zones() {
            set("zoneRequests", self.zone_requests());
        }
        set("batteryState", self.battery());
        set("operatingMode", json!(self.mode_literal()));
        set("errors", self.errors_picture());
        let flashing = json!([{ "infoType": "warningLights", "infoLevel": "INFO" }]);
        set("information", if self.is_flashing() { flashing } else { json!([]) });
        set("safetyState", self.safety());
        self.share_paths(&mut state);
        self.says(Part::State, &mut state);
        state
    }

    /// The states of these actions.
    fn listed(&self, which: impl Fn(&Action) -> bool) -> Value {
        let actions = self.actions.iter().filter(|action| which(action));
        actions.filter_map(|action| self.action_state(action)).collect()
    }

    /// All active errors (STATE-MSG-16).
    fn errors_picture(&self) -> Value {
        let errors = self.errors.active.iter();
        errors
            .filter_map(|error| {
                let rule = self.config.error_rules.get(&error.error_type);
                let usual = match (error.life, self.errors.defect_level.as_str()) {
                    (Life::WhileDefective, level @ "URGENT") => level,
                    _ => "WARNING",
                };
                let level = rule.map_or(usual, |rule| rule.level.as_str());
                self.said(Part::Error(error), error.picture(level))
            })
            .collect()
    }

    /// Metres since the last node.
    fn distance_made(&self) -> f64 {
        let pose = self.motion.pose(self.moment());
        let left = self.order.left.0.as_ref().filter(|_| self.order.entered);
        left.map_or(0.0, |stop| pose.distance(stop.place.x, stop.place.y))
    }

    fn action_state(&self, action: &Action) -> Option<Value> {
        let mut picture = json!({
            "actionId": action.request.id,
            "actionType": action.request.action_type,
            "actionStatus": action.status.literal(),
        });
        if let Some(result) = &action.result {
            picture["resultDescription"] = json!(result);
        }
        self.said(Part::Action(action), picture)
    }

    /// Whether there is nothing left but the horizon.
    pub(crate) fn waits_at_decision_point(&self) -> bool {
        self.order.nodes.front().is_some_and(|stop| !stop.node.released)
    }

    /// agvPosition, also for the visualization (STATE-MSG-05).
    pub(crate) fn position_picture(&self) -> Value {
        let pose = self.motion.pose(self.moment());
        let mut position = Map::new();
        let mut set = |key: &str, value: Value| position.insert(key.to_owned(), value);
        set("positionInitialized", json!(!self.lost));
        set("localizationScore", json!(0.98));
        set("x", json!(pose.x));
        set("y", json!(pose.y));
        set("theta", json!(pose.theta));
        set("mapId", json!(pose.map_id));
        self.says(Part::Position, &mut position);
        Value::Object(position)
    }

    /// velocity, also for the visualization.
    pub(crate) fn velocity_picture(&self) -> Value {
        let velocity = self.motion.velocity();
        let mut picture = Map::new();
        for (axis, speed) in [("vx", velocity.vx), ("vy", 0.0), ("omega", velocity.omega)] {
            picture.insert(axis.to_owned(), json!(speed));
        }
        self.says(Part::Velocity, &mut picture);
        Value::Object(picture)
    }

    fn loads_picture(&self) -> Value {
        self.loads.iter().map(Self::load_picture).collect()
    }

    /// One of loads (STATE-MSG-07).
    pub(crate) fn load_picture(load: &Load) -> Value {
        json!({
            "loadId": load.id,
            "loadType": load.kind,
            "loadPosition": load.position,
            "boundingBoxReference": { "x": 0.0, "y": 0.0, "z": 0.0 },
            "loadDimensions": { "length": 1.2, "width": 0.8, "height": MAX_HEIGHT / 2.0 },
            "weight": 100.0,
        })
    }

    fn battery(&self) -> Value {
        json!({
            "batteryCharge": if self.config.permanently_powered { 100.0 } else { 87.5 },
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
            Mode::Startup => "STARTUP",
            Mode::Intervened => "INTERVENED",
        }
    }

    fn safety(&self) -> Value {
        let emergency_stop = if self.holds.emergency {
            "MANUAL"
        } else if self.holds.field && !self.config.has("stopsByHand") {
            "AUTOACK"
        } else {
            "NONE"
        };
        json!({ "eStop": emergency_stop, "fieldViolation": self.holds.field })
    }
}
