//! The body of the state message, part by part.

use serde_json::{Map, Value, json};

use crate::reference::agv::action_kinds::{Deed, MAX_HEIGHT};
use crate::reference::agv::actions::{Action, Origin, Status};
use crate::reference::agv::faults::FaultName as F;
use crate::reference::agv::tolerances::ToleranceName as T;
use crate::reference::agv::{Agv, Load, Mode};

impl Agv {
    /// The state now, without header (STATE-MSG-01).
    pub(in crate::reference::agv) fn state_picture(&self) -> Map<String, Value> {
        let has = |fault: F| self.faults.has(fault);
        let complete = self.book.nodes.is_empty() && !self.actions.order_unfinished();
        let order_id = if complete && has(F::OrderIdResetWhenDone) {
            ""
        } else {
            &self.book.order_id
        };
        let last_node = if complete && has(F::LastNodeClearedWhenDone) {
            ""
        } else {
            &self.book.last_node
        };
        let mut state = Map::new();
        let mut set = |key: &str, value: Value| state.insert(key.to_owned(), value);
        if self.config.has("maps") {
            set("maps", self.maps.picture(self.faults));
        }
        if has(F::R1NoOrderNull) && !self.book.has_order() {
            set("orderId", Value::Null);
        } else {
            let prefix = if has(F::OrderIdPrefixed) && !order_id.is_empty() {
                "7-"
            } else {
                ""
            };
            let most = if has(F::R4OrderIdCutAt32) { 32 } else { usize::MAX };
            let order_id: String = order_id.chars().take(most).collect();
            set("orderId", json!(format!("{prefix}{order_id}")));
        }
        let reset = complete && has(F::UpdateIdResetWhenDone);
        let more = u32::from(has(F::UpdateIdCounted) && self.book.update_id > 0);
        set(
            "orderUpdateId",
            json!(if reset { 0 } else { self.book.update_id + more }),
        );
        if let Some(zones) = &self.config.zone_set {
            let invented = has(F::ZoneSetInvented) && self.book.zoned;
            set("zoneSetId", json!(if invented { "factory" } else { zones }));
        }
        if self.config.line_guided() {
            set("distanceSinceLastNode", json!(self.distance_made()));
        }
        if let Some((x, y)) = self.book.begun_at.filter(|_| has(F::DistanceNotReset)) {
            set(
                "distanceSinceLastNode",
                json!(self.motion.pose(self.moment()).distance(x, y)),
            );
        }
        if has(F::DistanceNegative) {
            set("distanceSinceLastNode", json!(-1.0));
        }
        let here = Origin::Node(self.book.last_sequence);
        let working = self
            .actions
            .iter()
            .any(|action| action.origin == here && !action.status.is_terminal());
        let ahead = self.book.nodes.front();
        let ahead = ahead.filter(|_| self.book.entered && has(F::R2LastNodeIsNextNode));
        let last_node = ahead.map_or(last_node, |stop| stop.node.id.as_str());
        let before = working && !self.book.previous.0.is_empty() && has(F::R1LastNodeAfterActions);
        let last_node = if before { &self.book.previous.0 } else { last_node };
        set("lastNodeId", json!(last_node));
        let last_sequence = match () {
            () if before => self.book.previous.1,
            () if complete && has(F::R1LastSequenceResetWhenDone) => 0,
            () => ahead.map_or(self.book.last_sequence, |stop| stop.node.sequence_id),
        };
        let last_sequence = match has(F::R3LastSequenceCountsNodes) {
            true => last_sequence / 2,
            false => last_sequence,
        };
        if has(F::R2LastSequenceMinusOne) && !self.book.has_order() {
            set("lastNodeSequenceId", json!(-1));
        } else {
            set("lastNodeSequenceId", json!(last_sequence));
        }
        if !(has(F::R1RouteOmittedWhenIdle) && self.book.nodes.is_empty()) {
            set("nodeStates", self.node_states(complete));
            set("edgeStates", self.edge_states(complete));
        }
        let unplaced = self.mode == Mode::Manual && has(F::R2PositionOmittedInManual);
        let idle = complete && !self.motion.is_moving();
        let unplaced = unplaced || idle && has(F::R6NoPositionAtStandstill);
        if !self.config.line_guided() && !unplaced {
            set("agvPosition", self.position_picture());
        }
        set("velocity", self.velocity_picture());
        if !(has(F::R1LoadsOmittedWhenEmpty) && self.loads.is_empty()) {
            set("loads", self.loads_picture());
        }
        set(
            "driving",
            if has(F::DrivingAsText) {
                json!(self.shows_driving().to_string())
            } else {
                json!(self.shows_driving())
            },
        );
        if !has(F::PauseFlagMissing) {
            let button = self.holds.button && !has(F::ButtonPauseUnreported);
            let idle = complete && self.faults.has(F::R1PauseUnreportedWhenIdle);
            let pause = self.holds.pause && !idle && self.pause_hidden_until.is_none();
            set("paused", json!(pause || button || self.holds.emergency));
        }
        let always = has(F::NewBaseRequestAlways) || (self.book.asked && has(F::NewBaseRequestStays));
        set(
            "newBaseRequest",
            json!(self.book.base_runs_low() || self.persona.wants_base || always),
        );
        set(
            "actionStates",
            self.actions
                .iter()
                .flat_map(|action| {
                    let twice = has(F::InstantActionListedTwice) && !action.of_order();
                    std::iter::repeat_n(self.action_state(action), if twice { 2 } else { 1 })
                })
                .flatten()
                .collect(),
        );
        if has(F::R3ActionStatesOmittedWhenEmpty) && state.get("actionStates") == Some(&json!([])) {
            state.remove("actionStates");
        }
        let mut set = |key: &str, value: Value| state.insert(key.to_owned(), value);
        set("batteryState", self.battery());
        let key = if has(F::FieldMisspelled) {
            "operating_mode"
        } else {
            "operatingMode"
        };
        if has(F::ModeNumeric) {
            set(key, json!(self.mode as u8));
        } else if !has(F::ModeMissing) {
            set(key, json!(self.mode_literal()));
        }
        if !(has(F::ErrorsOmitted) && self.errors.is_empty()) {
            set("errors", self.errors.picture(self.faults));
        }
        if has(F::InfoLevelWarning) {
            set(
                "information",
                json!([{ "infoType": "service", "infoLevel": "WARNING" }]),
            );
        } else if self.is_flashing() {
            set(
                "information",
                if has(F::R2InfoReferencesAsMap) {
                    json!([{ "infoType": "warningLights", "infoLevel": "INFO", "infoReferences": { "device": "lights" } }])
                } else if has(F::R1InfoTypeMissing) {
                    json!([{ "infoDescription": "warning lights on", "infoLevel": "INFO" }])
                } else {
                    json!([{ "infoType": "warningLights", "infoLevel": "INFO" }])
                },
            );
        } else {
            set("information", self.log_information());
        }
        if !has(F::SafetyStateMissing) {
            set("safetyState", self.safety());
        }
        if has(F::EmptyListsNull) {
            let lists = ["nodeStates", "edgeStates", "actionStates"];
            let empty = |state: &Map<String, Value>, list: &str| state.get(list) == Some(&json!([]));
            for list in lists.into_iter().filter(|list| empty(&state, list)).collect::<Vec<_>>() {
                state.insert(list.to_owned(), Value::Null);
            }
        }
        state
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

    fn shows_driving(&self) -> bool {
        let waits = self.book.nodes.front().is_some_and(|stop| !stop.node.released);
        let turning = self.motion.is_turning() && self.faults.has(F::TurnsWithoutDriving);
        let velocity = self.motion.velocity();
        let turns = velocity.vx == 0.0 && velocity.omega != 0.0 && self.faults.has(F::R1TurningNotDriving);
        let idle = self.book.nodes.is_empty() && self.book.has_order() && self.faults.has(F::DrivingWhileWaiting);
        let slow = velocity.vx != 0.0 && velocity.vx.abs() < 0.75 && self.faults.has(F::R3SlowDriveNotDriving);
        (self.motion.is_moving() && !self.faults.has(F::DrivingUnreported) && !turning && !turns && !slow)
            || idle
            || (waits && self.faults.has(F::DrivingAtDecisionPoint))
            || (self.book.has_order() && self.faults.has(F::DrivingKept))
            || (self.holds.pause && !self.book.nodes.is_empty() && self.faults.has(F::DrivingInPause))
            || (self.is_lifting() && self.faults.has(F::DrivingWhileLifting))
    }

    fn action_state(&self, action: &Action) -> Option<Value> {
        let of_horizon = match action.origin {
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => sequence_id > self.book.base_end.1,
            Origin::Instant => false,
        };
        let next = self.book.nodes.front().map_or(u32::MAX, |stop| stop.node.sequence_id);
        let far = match action.origin {
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => sequence_id > next,
            Origin::Instant => false,
        };
        let hidden = (far && self.faults.has(F::R3FarActionsUnlisted))
            || (of_horizon && self.faults.has(F::HorizonActionsMissing))
            || (!action.of_order() && self.faults.has(F::InstantActionUnlisted))
            || (!action.of_order() && action.status == Status::Failed && self.faults.has(F::R1FailedInstantUnlisted))
            || (matches!(action.origin, Origin::Edge(_))
                && action.status == Status::Waiting
                && self.faults.has(F::EdgeActionsUnlisted))
            || (action.of_order() && self.book.base_end.1 == 0 && self.faults.has(F::SingleNodeActionUnlisted));
        if hidden {
            return None;
        }
        let waits_here = action.origin == Origin::Node(self.book.last_sequence) && !self.holds.any();
        let early_pick =
            self.faults.has(F::PickPreparedAsRunning) && action.kind.is_some_and(|kind| kind.deed == Deed::Pick);
        let status = match action.masked.unwrap_or(action.status) {
            Status::Waiting if self.faults.has(F::RunningFromStart) => "RUNNING",
            Status::Waiting if self.faults.has(F::InitializingFromStart) => "INITIALIZING",
            Status::Waiting | Status::Initializing if early_pick => "RUNNING",
            Status::Waiting if waits_here && self.faults.has(F::PausedWithoutPause) => "PAUSED",
            Status::Waiting
                if action.of_order() && self.holds.pause && self.faults.has(F::R4PauseMarksWaitingActionsPaused) =>
            {
                "PAUSED"
            }
            Status::Waiting if self.is_next(action) && self.faults.has(F::R2NextNodeActionsInitializing) => {
                "INITIALIZING"
            }
            Status::Waiting
                if of_horizon && self.waits_at_decision_point() && self.faults.has(F::R2PausedAtDecisionPoint) =>
            {
                "PAUSED"
            }
            Status::Finished if self.faults.has(F::StatusDone) => "DONE",
            Status::Initializing if self.faults.has(F::R3InitializingSpelledBritish) => "INITIALISING",
            Status::Running
                if action.of_order() && self.book.cancel.is_some() && self.faults.has(F::R1CancelShowsPaused) =>
            {
                "PAUSED"
            }
            status => status.literal(),
        };
        let lower = self.faults.has(F::StatusLowerCase);
        let status = if lower {
            status.to_ascii_lowercase()
        } else {
            status.to_owned()
        };
        let id: String = if self.faults.has(F::R2ActionIdTruncated) {
            action.request.id.chars().take(32).collect()
        } else {
            action.request.id.clone()
        };
        let mut picture = json!({
            "actionId": id,
            "actionType": action.request.action_type,
            "actionStatus": status,
        });
        let told = self.fourth.results_told.contains(&action.request.id);
        if let Some(result) = action.result.as_ref().filter(|_| !told) {
            picture["resultDescription"] = json!(result);
        }
        Some(picture)
    }

    /// Whether the vehicle is on its way to the node of this action.
    fn is_next(&self, action: &Action) -> bool {
        let next = self.book.nodes.front().map(|stop| stop.node.sequence_id);
        self.book.entered && next.is_some_and(|next| action.origin == Origin::Node(next))
    }

    /// Whether there is nothing left but the horizon.
    pub(in crate::reference::agv) fn waits_at_decision_point(&self) -> bool {
        self.book.nodes.front().is_some_and(|stop| !stop.node.released)
    }

    /// agvPosition, also for the visualization (STATE-MSG-05).
    pub(super) fn position_picture(&self) -> Value {
        let mut pose = self.motion.pose(self.moment());
        if let Some(start) = self
            .config
            .node(&self.config.start_node)
            .filter(|_| self.faults.has(F::PositionFrozen))
        {
            (pose.x, pose.y) = (start.x, start.y);
        }
        let trembling = if self.takes(T::R1PositionTrembles) {
            [0.0, 0.003, -0.002, 0.001, -0.003][usize::try_from(self.states_sent % 5).unwrap_or_default()]
        } else {
            0.0
        };
        let theta = if self.faults.has(F::DegreesReported) {
            pose.theta.to_degrees() + 180.0
        } else if self.faults.has(F::R1ThetaNeverNegative) {
            pose.theta.rem_euclid(2.0 * std::f64::consts::PI)
        } else if self.takes(T::R1ThetaMinusPi) && pose.theta > std::f64::consts::PI - 1e-9 {
            -std::f64::consts::PI
        } else {
            pose.theta
        };
        let y = if self.faults.has(F::AxesMirrored) {
            -pose.y
        } else {
            pose.y
        };
        let map_id = match () {
            () if self.faults.has(F::PositionMapStale) => "factory-default".to_owned(),
            () if self.faults.has(F::IdWithSpace) => format!("{} 1", pose.map_id),
            () => self.claimed_map.clone().unwrap_or(pose.map_id),
        };
        let rounded = self.takes(T::R3PositionRounded);
        let theta = if rounded {
            (theta * 1000.0).trunc() / 1000.0
        } else {
            theta
        };
        let number = |value: f64| {
            let value = if rounded {
                (value * 100.0).round() / 100.0
            } else {
                value
            };
            if self.faults.has(F::PositionAsText) {
                json!(value.to_string())
            } else {
                json!(value)
            }
        };
        json!({
            "positionInitialized": !(self.lost || self.persona.lost),
            "localizationScore": if self.faults.has(F::R1LocalizationScorePercent) { 98.0 } else { 0.98 },
            "x": number(pose.x + trembling),
            "y": number(y),
            "theta": theta,
            "mapId": map_id,
        })
    }

    /// velocity, also for the visualization.
    pub(super) fn velocity_picture(&self) -> Value {
        let velocity = self.motion.velocity();
        if self.faults.has(F::R1VelocityInMapAxes) {
            let theta = self.motion.pose(self.moment()).theta;
            let (vx, vy) = (velocity.vx * theta.cos(), velocity.vx * theta.sin());
            return json!({ "vx": vx, "vy": vy, "omega": velocity.omega });
        }
        if self.faults.has(F::R1OmegaClockwise) {
            return json!({ "vx": velocity.vx, "vy": 0.0, "omega": -velocity.omega });
        }
        if self.takes(T::R3VelocityTrembles) {
            let noise = [0.001, -0.001, 0.0][usize::try_from(self.states_sent % 3).unwrap_or_default()];
            let vx = if self.motion.is_moving() { velocity.vx } else { noise };
            let omega = if velocity.omega == 0.0 { noise } else { velocity.omega };
            return json!({ "vx": vx, "vy": -noise, "omega": omega });
        }
        let vx = if self.faults.has(F::R3SpeedUnsigned) {
            velocity.vx.abs()
        } else if self.faults.has(F::VelocityMirrored) {
            -velocity.vx
        } else {
            velocity.vx
        };
        json!({ "vx": vx, "vy": 0.0, "omega": velocity.omega })
    }

    fn loads_picture(&self) -> Value {
        if self.faults.has(F::LoadsAlwaysEmpty) || self.hidden_load.is_some() {
            return json!([]);
        }
        let weight = if self.faults.has(F::LoadWeightNegative) {
            -1.0
        } else {
            100.0
        };
        let picture = |load: &Load| {
            json!({
                "loadId": load.id,
                "loadType": load.kind,
                "loadPosition": if self.faults.has(F::R1LoadPositionUnlisted) { "1" } else { &load.position },
                "boundingBoxReference": { "x": 0.0, "y": 0.0, "z": 0.0 },
                "loadDimensions": if self.faults.has(F::R1LoadWidthMissing) {
                    json!({ "length": 1.2, "height": MAX_HEIGHT / 2.0 })
                } else {
                    json!({ "length": 1.2, "width": 0.8, "height": MAX_HEIGHT / 2.0 })
                },
                "weight": weight,
            })
        };
        let shadow = self.shadow.iter().map(|(_, load)| load);
        self.loads.iter().chain(shadow).map(picture).collect()
    }

    fn battery(&self) -> Value {
        let mut battery = Map::new();
        if !self.faults.has(F::ChargeMissing) {
            let charge = match self.motion.is_moving() {
                moving if self.faults.has(F::ChargeGoodBad) => json!(if moving { 0.0 } else { 100.0 }),
                _ if self.takes(T::R6LibBatteryGoodOrBad) => {
                    let good = self.persona.charge.unwrap_or(87.5) > 50.0;
                    json!(if good { 80.0 } else { 20.0 })
                }
                _ if self.takes(T::R1BatteryDrains) && self.persona.charge.is_none() => {
                    let used = u32::try_from(self.states_sent % 5_000).unwrap_or_default();
                    json!(87.5 - f64::from(used) * 0.01)
                }
                _ => json!(self.persona.charge.unwrap_or(87.5)),
            };
            battery.insert("batteryCharge".into(), charge);
        }
        battery.insert("batteryVoltage".into(), json!(48.2));
        let health = if self.faults.has(F::R1BatteryHealthUnknown) {
            255
        } else {
            96
        };
        battery.insert("batteryHealth".into(), json!(health));
        let charging = if self.faults.has(F::BooleanAsText) {
            json!(self.charging.to_string())
        } else {
            json!(self.charging)
        };
        battery.insert("charging".into(), charging);
        battery.insert(
            "reach".into(),
            if self.faults.has(F::R2ReachMinusOne) {
                json!(-1)
            } else if self.faults.has(F::ReachFractional) {
                json!(8_000.5)
            } else {
                json!(8_000)
            },
        );
        Value::Object(battery)
    }

    fn mode_literal(&self) -> String {
        let next = self.faults.has(F::ModeOffByOne);
        let literal = match self.mode {
            Mode::Semiautomatic if next => "MANUAL",
            Mode::Manual if next => "SERVICE",
            Mode::Service if next => "TEACHIN",
            Mode::Teachin if next => "SEMIAUTOMATIC",
            Mode::Semiautomatic if self.faults.has(F::R1SemiautomaticUnderscore) => "SEMI_AUTOMATIC",
            Mode::Automatic => "AUTOMATIC",
            Mode::Semiautomatic => "SEMIAUTOMATIC",
            Mode::Manual => "MANUAL",
            Mode::Service => "SERVICE",
            Mode::Teachin => "TEACHIN",
        };
        if self.faults.has(F::ModeLowerCase) {
            literal.to_ascii_lowercase()
        } else {
            literal.to_owned()
        }
    }

    fn safety(&self) -> Value {
        let stopped = (self.holds.emergency || self.latched) && !self.faults.has(F::EmergencyStopUnreported);
        let emergency_stop = match () {
            () if stopped => "MANUAL",
            () if self.holds.field && self.faults.has(F::R1AutoAckMixedCase) => "AutoAck",
            () if self.holds.field => "AUTOACK",
            () if self.faults.has(F::EmergencyStopSpelled) => "Off",
            () if self.faults.has(F::EmergencyStopNull) => {
                return json!({ "eStop": null, "fieldViolation": self.holds.field });
            }
            () => "NONE",
        };
        let violation = if self.holds.field && self.faults.has(F::R1FieldViolationCounted) {
            json!(1)
        } else {
            json!(self.holds.field || self.field_latched)
        };
        let violation = match self.faults.has(F::R3FieldViolationUnreported) {
            true => json!(false),
            false => violation,
        };
        let key = match self.faults.has(F::R3EStopLowerCase) {
            true => "estop",
            false => "eStop",
        };
        json!({ key: emergency_stop, "fieldViolation": violation })
    }
}
