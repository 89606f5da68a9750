//! The body of the state message, part by part.

use serde_json::{Map, Value, json};

use crate::reference::agv::action_kinds::{Deed, MAX_HEIGHT};
use crate::reference::agv::actions::{Action, Origin, Status};
use crate::reference::agv::book::Stop;
use crate::reference::agv::faults::FaultName as F;
use crate::reference::agv::order_message::Edge;
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
            set("orderId", json!(order_id));
        }
        let reset = complete && has(F::UpdateIdResetWhenDone);
        set("orderUpdateId", json!(if reset { 0 } else { self.book.update_id }));
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
        let before = working && !self.book.previous.0.is_empty() && has(F::R1LastNodeAfterActions);
        let last_node = if before { &self.book.previous.0 } else { last_node };
        set("lastNodeId", json!(last_node));
        let last_sequence = match () {
            () if before => self.book.previous.1,
            () if complete && has(F::R1LastSequenceResetWhenDone) => 0,
            () => self.book.last_sequence,
        };
        set("lastNodeSequenceId", json!(last_sequence));
        if !(has(F::R1RouteOmittedWhenIdle) && self.book.nodes.is_empty()) {
            set("nodeStates", self.node_states(complete));
            set("edgeStates", self.edge_states(complete));
        }
        if !self.config.line_guided() {
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
            let pause = self.holds.pause && !idle;
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
                if has(F::R1InfoTypeMissing) {
                    json!([{ "infoDescription": "warning lights on", "infoLevel": "INFO" }])
                } else {
                    json!([{ "infoType": "warningLights", "infoLevel": "INFO" }])
                },
            );
        } else {
            set("information", json!([]));
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
        (self.motion.is_moving() && !self.faults.has(F::DrivingUnreported) && !turning && !turns)
            || idle
            || (waits && self.faults.has(F::DrivingAtDecisionPoint))
            || (self.book.has_order() && self.faults.has(F::DrivingKept))
            || (self.is_lifting() && self.faults.has(F::DrivingWhileLifting))
    }

    /// `manual-drives-unseen`: drives a way it does not show.
    fn hides_route(&self) -> bool {
        !self.mode.takes_orders() && self.faults.has(F::ManualDrivesUnseen)
    }

    fn node_states(&self, complete: bool) -> Value {
        let ends_on_next = self.book.cancel.as_ref().is_some_and(|cancel| cancel.to_node);
        if self.hides_route() || (ends_on_next && self.faults.has(F::R1CancelHidesNextNode)) {
            return json!([]);
        }
        let left = self.book.left.0.as_ref().filter(|_| {
            (!complete && self.faults.has(F::TraversedNodesListed))
                || (complete && self.book.has_order() && self.keeps_last_node())
        });
        let shown = self
            .book
            .nodes
            .iter()
            .filter(|stop| stop.node.released || !self.faults.has(F::HorizonNotReported));
        let mut planned = 0;
        let mut listed: Vec<&str> = Vec::new();
        let shown = shown.filter(|stop| {
            planned += u32::from(!stop.node.released);
            let again = listed.contains(&stop.node.id.as_str());
            listed.push(&stop.node.id);
            !((planned > 1 && self.faults.has(F::R1HorizonCutToOne))
                || (again && self.faults.has(F::R1LoopNodesMerged)))
        });
        left.into_iter()
            .chain(shown)
            .map(|stop| self.node_state(stop))
            .collect()
    }

    fn keeps_last_node(&self) -> bool {
        self.faults.has(F::FinishedOrderListed) || self.faults.has(F::LastRouteListed)
    }

    /// The node traversed last, as if it were still ahead (`route-repeated-on-request`).
    pub(super) fn last_node_state(&self) -> Value {
        let left = self.book.left.0.iter();
        left.map(|stop| self.node_state(stop)).collect()
    }

    fn node_state(&self, stop: &Stop) -> Value {
        let node = &stop.node;
        let mut picture = json!({
            "nodeId": node.id,
            "sequenceId": node.sequence_id,
            "released": node.released || self.faults.has(F::HorizonReportedReleased),
        });
        if let Some(position) = node.sent_position.as_ref().filter(|_| !self.config.line_guided()) {
            picture["nodePosition"] = position.clone();
        }
        if self.faults.has(F::NodeStatesWithoutSequence)
            && let Some(fields) = picture.as_object_mut()
        {
            fields.remove("sequenceId");
        }
        picture
    }

    fn edge_states(&self, complete: bool) -> Value {
        if self.hides_route() {
            return json!([]);
        }
        let kept = self.faults.has(F::LastEdgeListed) || self.faults.has(F::LastRouteListed);
        let stays = (self.faults.has(F::EdgeStatesStay) && !complete) || (kept && complete && self.book.has_order());
        let left = self.book.left.1.as_ref().filter(|_| stays);
        let shown = self
            .book
            .edges
            .iter()
            .filter(|edge| edge.released || !self.faults.has(F::HorizonNotReported));
        let entered = self
            .book
            .edge_ahead()
            .filter(|_| self.book.entered)
            .map(|edge| edge.sequence_id);
        let hidden = entered.filter(|_| self.faults.has(F::R1EnteredEdgeUnlisted));
        let shown = shown.filter(|edge| Some(edge.sequence_id) != hidden);
        let next = self.book.edges.front().map(|edge| edge.sequence_id);
        let picture = |edge: &Edge| {
            let far = Some(edge.sequence_id) != next && self.faults.has(F::R1FarEdgesUnreleased);
            let mut picture = json!({
                "edgeId": edge.id,
                "sequenceId": edge.sequence_id,
                "released": edge.released && !far || self.faults.has(F::HorizonReportedReleased),
            });
            if let Some(path) = self.planned_path(edge) {
                picture["trajectory"] = path;
            }
            picture
        };
        left.into_iter().chain(shown).map(picture).collect()
    }

    fn action_state(&self, action: &Action) -> Option<Value> {
        let of_horizon = match action.origin {
            Origin::Node(sequence_id) | Origin::Edge(sequence_id) => sequence_id > self.book.base_end.1,
            Origin::Instant => false,
        };
        let hidden = (of_horizon && self.faults.has(F::HorizonActionsMissing))
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
            Status::Finished if self.faults.has(F::StatusDone) => "DONE",
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
        let mut picture = json!({
            "actionId": action.request.id,
            "actionType": action.request.action_type,
            "actionStatus": status,
        });
        if let Some(result) = &action.result {
            picture["resultDescription"] = json!(result);
        }
        Some(picture)
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
        let number = |value: f64| {
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
        let vx = if self.faults.has(F::VelocityMirrored) {
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
            if self.faults.has(F::ReachFractional) {
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
            json!(self.holds.field)
        };
        json!({ "eStop": emergency_stop, "fieldViolation": violation })
    }
}
