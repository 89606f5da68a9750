//! The order message: nodes and edges as a vehicle wants them, within its limits.

use serde_json::{Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::layout::distance;
use super::seen::Factsheet;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Leg, Running, Stop, Vehicle};

/// Which part of a way a message holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Window {
    /// Index of the first node.
    pub(super) first: usize,
    /// Index behind the last released node.
    pub(super) released: usize,
    /// Index behind the last node.
    pub(super) end: usize,
}

impl Site {
    /// The message of this window, and the window it became within the limits of the vehicle. `None` when not even
    /// the first step fits.
    pub(super) fn order_message(
        &self,
        vehicle: &Vehicle,
        running: &Running,
        window: Window,
    ) -> Option<(Value, Window)> {
        let sheet = vehicle.factsheet.as_ref();
        let mut window = window;
        let asked = window.end;
        let later = window.first > 0 && self.faults.has(F::R1ArrayLimitIgnoredInUpdates);
        if let Some(sheet) = sheet.filter(|_| !self.faults.has(F::ArrayLimitIgnored) && !later) {
            let nodes = sheet.limit(&["order.nodes", "nodes"]);
            let nodes = nodes.min(sheet.limit(&["order.edges", "edges"]).saturating_add(1));
            let listed = sheet.limit(&["state.nodeStates"]);
            let listed = if self.faults.has(F::NodeStatesIgnored) {
                usize::MAX
            } else {
                listed.saturating_add(1)
            };
            let end = window.first.saturating_add(nodes.min(listed));
            let whole = self.faults.has(F::R2HorizonBeyondArrayLimit);
            window.end = if whole { window.end } else { window.end.min(end) };
            window.released = window.released.min(end);
        }
        let longest = sheet
            .and_then(|sheet| sheet.message)
            .filter(|_| !self.faults.has(F::MessageLimitIgnored))
            .filter(|_| window.first == 0 || !self.faults.has(F::R3MessageLimitIgnoredInUpdates))
            .unwrap_or(usize::MAX);
        loop {
            let message = self.message(vehicle, running, window, window.end < asked);
            // The header comes on top.
            let length = super::wording::written(self.faults, self.config.tolerances, &message).len() + 300;
            if window.released <= window.first {
                return None;
            }
            if length <= longest {
                return Some((message, window));
            }
            if window.end <= window.first + 1 {
                return None;
            }
            window.end -= 1;
            window.released = window.released.min(window.end);
        }
    }

    /// `cut` tells whether the way is longer than the vehicle takes in one message.
    fn message(&self, vehicle: &Vehicle, running: &Running, window: Window, cut: bool) -> Value {
        let sheet = vehicle.factsheet.as_ref();
        let lax = sheet.map(lax);
        let hurried = self.faults.has(F::R1RequiredNotInHorizon);
        let forgetful = self.faults.has(F::R1RequiredOnlyInFirstMessage) && window.first > 0;
        let led = running.r1_rerouted && self.faults.has(F::R2RequiredMissingAfterReroute);
        let forgetful = forgetful || (led && window.first > 0);
        let open = sheet.filter(|_| window.first > 0 && self.faults.has(F::R6OptionsCheckedOnFirstOrderOnly));
        let open = open.map(super::sixth::open);
        let mut nodes: Vec<Value> = (window.first..window.end)
            .filter_map(|index| {
                let stop = running.stops.get(index)?;
                let without = hurried && index >= window.released || forgetful && index > window.first;
                let sheet = if without { lax.as_ref() } else { sheet };
                // The stitching node stays as it was.
                let sheet = open.as_ref().filter(|_| index > window.first).or(sheet);
                let goal = index + 1 == running.stops.len();
                let passed = index > 0 && !goal && stop.actions.is_empty();
                let unlimited = (passed && self.faults.has(F::R4NegativeDeviationForNoLimit)).then(|| Stop {
                    deviation_xy: Some(-1.0),
                    ..stop.clone()
                });
                let reserved = goal && self.faults.has(F::R4ReleasesTheReservedStation);
                let released = index < window.released || reserved;
                let taken_back = window.first > 0
                    && index == window.first
                    && running.changed
                    && running.r1_rerouted
                    && self.faults.has(F::R5BaseTakenBackOnDestinationChange);
                let released = released && !taken_back;
                let mut node = self.node(sheet, unlimited.as_ref().unwrap_or(stop), index, released);
                node["sequenceId"] = json!(running.r1_number(2 * index));
                if index == 0
                    && let Some(deviation) = stop.deviation_xy
                    && node.get("nodePosition").is_some()
                    && self.faults.has(F::R2StartDeviationUnasked)
                {
                    node["nodePosition"]["allowedDeviationXY"] = json!(deviation);
                }
                Some(node)
            })
            .collect();
        self.r3_nodes(running, window, &mut nodes);
        self.numbered_by_node(running, &mut nodes);
        self.r6_nodes(running, window, &mut nodes);
        if self.faults.has(F::R2LoopReleasedById) {
            released_by_id(&mut nodes);
        }
        let dangling = self.faults.has(F::R2DanglingEdge) || (cut && self.faults.has(F::R4CutLeavesADanglingEdge));
        let dangling = window.end < running.stops.len() && dangling;
        let last = window.end.saturating_sub(usize::from(!dangling));
        let incoming = window.first > 0 && self.faults.has(F::R3UpdateKeepsIncomingEdge);
        let mut edges: Vec<Value> = (window.first.saturating_sub(usize::from(incoming))..last)
            .filter_map(|index| {
                let ends = (running.stops.get(index)?, running.stops.get(index + 1)?);
                let leg = running.legs.get(index)?;
                let without = hurried && index + 1 >= window.released || forgetful;
                let sheet = if without { lax.as_ref() } else { sheet };
                let sheet = open.as_ref().or(sheet);
                let mut edge = self.edge(sheet, leg, ends, index, index + 1 < window.released);
                edge["sequenceId"] = json!(running.r1_number(2 * index + 1));
                self.r1_edge(running, leg, window, index, &mut edge);
                self.r2_edge(vehicle, window, index, &mut edge);
                self.r3_edge(vehicle, running, window, index, &mut edge);
                self.r6_edge(vehicle, running, window, index, &mut edge);
                Some(edge)
            })
            .collect();
        if self.faults.has(F::R5CorridorNarrowerThanNode) {
            super::habits::narrow(&nodes, &mut edges);
        }
        if self.faults.has(F::R3DeviationWiderThanCorridor) {
            for (node, edge) in nodes.iter_mut().zip(&edges) {
                let width = |key: &str| edge["corridor"][key].as_f64().unwrap_or_default();
                if edge.get("corridor").is_some() && node.get("nodePosition").is_some() {
                    node["nodePosition"]["allowedDeviationXY"] = json!(width("leftWidth") + width("rightWidth") + 0.5);
                }
            }
        }
        let mut message = json!({ "orderId": running.id, "orderUpdateId": running.update_id });
        if let Some(zones) = &self.config.zone_set
            && sheet.is_none_or(|sheet| wants(sheet, "order.zoneSetId"))
        {
            message["zoneSetId"] = json!(zones);
        }
        message["nodes"] = Value::Array(nodes);
        message["edges"] = Value::Array(edges);
        if self.faults.has(F::R1SelfEdge) && window.first == 0 && running.stops.len() == 1 {
            let id = &running.stops[0].id;
            message["edges"] = json!([{
                "edgeId": format!("{id}-{id}"),
                "sequenceId": 1,
                "released": true,
                "startNodeId": id,
                "endNodeId": id,
                "actions": [],
            }]);
        }
        message
    }

    /// Defects and liberties of nodes that depend on where in the order they are.
    fn r3_nodes(&self, running: &Running, window: Window, nodes: &mut [Value]) {
        let has = |fault: F| self.faults.has(fault);
        let start = running.stops.first();
        if window.first == 0
            && window.end > 1
            && start.is_some_and(|start| self.config.node(&start.id).is_some())
            && has(F::R3PositionMissingAtStart)
            && let Some(fields) = nodes.first_mut().and_then(Value::as_object_mut)
        {
            fields.shift_remove("nodePosition");
        }
        if window.first > 0
            && let (Some(here), Some(next)) = (running.stops.get(window.first), running.stops.get(window.first + 1))
            && has(F::R3StitchingThetaTowardsNext)
            && let Some(position) = nodes.first_mut().and_then(|node| node.get_mut("nodePosition"))
        {
            position["theta"] = json!((next.y - here.y).atan2(next.x - here.x));
        }
        for (index, node) in nodes.iter_mut().enumerate() {
            if window.first + index >= window.released && self.takes(T::R3HorizonActionsOpen) {
                node["actions"] = json!([]);
            }
        }
    }

    /// Defects and liberties of edges that depend on where in the order they are.
    fn r3_edge(&self, vehicle: &Vehicle, running: &Running, window: Window, index: usize, edge: &mut Value) {
        let has = |fault: F| self.faults.has(fault);
        let sheet = vehicle.factsheet.as_ref();
        let planned = index + 1 >= window.released;
        if index + 1 == window.released && running.r3_asked && has(F::R3EdgeAheadReleasedWhenAsked) {
            edge["released"] = json!(true);
        }
        if has(F::R3EdgesShareNumberOfStartNode) {
            edge["sequenceId"] = json!(running.r1_number(2 * index));
        }
        if has(F::R3UpdateEdgesNumberedFromOne) && window.first > 0 {
            edge["sequenceId"] = json!(2 * index.saturating_sub(window.first) + 1);
        }
        if has(F::R3EdgeEndsAsSequenceIds) {
            edge["startNodeId"] = json!(running.r1_number(2 * index));
            edge["endNodeId"] = json!(running.r1_number(2 * index + 2));
        }
        let start = running.stops.first().filter(|_| index == 0);
        if start.is_some_and(|start| self.config.node(&start.id).is_none())
            && has(F::R3TemporaryEdgeFromLastNode)
            && let Some(state) = vehicle.state.as_ref().filter(|state| !state.last_node_id.is_empty())
        {
            edge["startNodeId"] = json!(state.last_node_id);
        }
        let loads = vehicle.state.as_ref().and_then(|state| state.loads.as_ref());
        if loads.is_some_and(|loads| !loads.is_empty()) && has(F::R3HeightUnaskedWhenLoaded) {
            edge["maxHeight"] = json!(2.5);
        }
        if planned && self.takes(T::R3HorizonActionsOpen) {
            edge["actions"] = json!([]);
        }
        if let Some(speed) = edge.get("maxSpeed").and_then(Value::as_f64) {
            if planned && self.takes(T::R3HorizonSlower) {
                edge["maxSpeed"] = json!(speed / 2.0);
            } else if index + 2 == running.stops.len() && self.takes(T::R3SlowLastEdge) {
                edge["maxSpeed"] = json!(speed.min(0.4));
            }
        }
        let known = self
            .config
            .edges
            .iter()
            .find(|known| Some(known.id.as_str()) == edge["edgeId"].as_str());
        let free = sheet.is_none_or(|sheet| sheet.id_length.is_none() && !sheet.ids_numerical);
        if let Some(known) = known.filter(|_| free && self.takes(T::R3EdgeIdsNamedOtherwise)) {
            edge["edgeId"] = json!(format!("way:{}:{}", known.from, known.to));
        }
    }

    /// Defects of an edge that depend on where in the order it is.
    fn r1_edge(&self, running: &Running, leg: &Leg, window: Window, index: usize, edge: &mut Value) {
        let has = |fault: F| self.faults.has(fault);
        let update = window.first > 0;
        if update && has(F::R1SpeedUnaskedInUpdates) {
            edge["maxSpeed"] = json!(leg.max_speed.unwrap_or(1.0));
        }
        if has(F::R1OrientationUnasked) {
            edge["orientation"] = json!(0.0);
            edge["orientationType"] = json!("TANGENTIAL");
        }
        if running.r1_rerouted && has(F::R1EdgesReleasedAfterReroute) {
            edge["released"] = json!(true);
        }
        if index + 2 == running.stops.len() && edge.get("corridor").is_some() && has(F::R1CorridorZeroAtGoal) {
            edge["corridor"]["leftWidth"] = json!(0.0);
            edge["corridor"]["rightWidth"] = json!(0.0);
        }
        if update
            && edge.get("corridor").is_some()
            && has(F::R1CorridorAloneInUpdates)
            && let Some(fields) = edge.as_object_mut()
        {
            fields.shift_remove("trajectory");
        }
    }

    fn node(&self, sheet: Option<&Factsheet>, stop: &Stop, index: usize, released: bool) -> Value {
        let field = |name: &str, value: Option<Value>, default: Value| {
            self.field(sheet, &format!("order.nodes.{name}"), value, default)
        };
        let mut node = json!({ "nodeId": stop.id, "sequenceId": 2 * index, "released": released });
        if let Some(text) = field("nodeDescription", self.described("node", &stop.id), json!(stop.id)) {
            node["nodeDescription"] = text;
        }
        let mut position = json!({ "x": stop.x, "y": stop.y });
        let theta = match stop.theta {
            _ if self.takes(T::R4NoThetaOnNodes) => None,
            _ if self.takes(T::R1ThetaAtTheBound) => Some(json!(-std::f64::consts::PI)),
            theta if self.faults.has(F::R1ThetaUpToTwoPi) => {
                let theta = theta.unwrap_or(-std::f64::consts::FRAC_PI_2);
                Some(json!(theta.rem_euclid(std::f64::consts::TAU)))
            }
            theta => theta.map(|theta| json!(theta)),
        };
        if let Some(theta) = field("nodePosition.theta", theta, json!(std::f64::consts::FRAC_PI_2)) {
            position["theta"] = theta;
        }
        let deviation = stop.deviation_xy.map(|metres| json!(metres));
        let exact = index > 0 && self.takes(T::R2ZeroDeviations);
        let deviation = deviation.or_else(|| exact.then(|| json!(0.0)));
        if let Some(deviation) = field("nodePosition.allowedDeviationXY", deviation, json!(0.3)) {
            position["allowedDeviationXY"] = deviation;
        }
        let turn = stop.deviation_theta.map(|radians| json!(radians));
        let turn = if self.faults.has(F::R1DeviationThetaFullCircle) {
            Some(json!(std::f64::consts::TAU))
        } else {
            turn
        };
        let free = self.takes(T::R2EveryDirectionAllowed);
        let turn = turn.or_else(|| free.then(|| json!(std::f64::consts::PI)));
        if let Some(mut turn) = field("nodePosition.allowedDeviationTheta", turn, json!(std::f64::consts::PI)) {
            if self.faults.has(F::R2DeviationThetaInDegrees) {
                turn = json!(turn.as_f64().unwrap_or_default().to_degrees());
            }
            position["allowedDeviationTheta"] = turn;
        }
        position["mapId"] = json!(stop.map_id);
        if let Some(text) = field("nodePosition.mapDescription", None, json!(stop.map_id)) {
            position["mapDescription"] = text;
        }
        let listed = sheet.is_none_or(Factsheet::knows_positions);
        if listed || !self.takes(T::PositionWhereListed) {
            node["nodePosition"] = position;
        }
        node["actions"] = json!(stop.actions);
        node
    }

    fn edge(&self, sheet: Option<&Factsheet>, leg: &Leg, ends: (&Stop, &Stop), index: usize, released: bool) -> Value {
        let (from, to) = ends;
        let mut edge = json!({
            "edgeId": leg.id,
            "sequenceId": 2 * index + 1,
            "released": released,
            "startNodeId": from.id,
            "endNodeId": to.id,
        });
        let length = distance((from.x, from.y), (to.x, to.y));
        let number = |value: Option<f64>| value.map(|value| json!(value));
        let corridor = leg.corridor.filter(|(left, right)| *left > 0.0 || *right > 0.0);
        // To the left of one edge, and to the right of the next.
        let shifted = |(left, right): (f64, f64)| match index % 2 {
            _ if !self.faults.has(F::R4CorridorShiftsAtTheNode) => (left, right),
            0 => (left + right, 0.0),
            _ => (0.0, left + right),
        };
        let curved = corridor.is_some() || self.faults.has(F::TrajectoryUnasked);
        let speed = leg.max_speed.filter(|_| !self.takes(T::R3SupportedSpeedLeftOut));
        let stated = self.takes(T::R3RotationAndLengthStated);
        let fields = [
            ("edgeDescription", self.described("edge", &leg.id), json!(leg.id)),
            ("maxSpeed", number(speed), json!(1.0)),
            (
                "maxHeight",
                number(leg.max_height),
                if self.faults.has(F::R2NoHeightAsInfinity) {
                    json!("Infinity")
                } else {
                    json!(10.0)
                },
            ),
            ("minHeight", number(leg.min_height), json!(0.0)),
            ("orientation", None, json!(0.0)),
            ("orientationType", None, json!("TANGENTIAL")),
            (
                "direction",
                leg.direction.as_ref().map(|text| json!(text)),
                json!("straight"),
            ),
            ("rotationAllowed", stated.then(|| json!(true)), json!(true)),
            ("maxRotationSpeed", None, json!(1.0)),
            ("length", stated.then(|| json!(length)), json!(length)),
            (
                "trajectory",
                curved.then(|| self.straight(sheet, from, to)),
                self.straight(sheet, from, to),
            ),
            (
                "corridor",
                corridor.map(|widths| self.corridor(shifted(widths))),
                self.corridor(shifted((0.5, 0.5))),
            ),
        ];
        for (name, value, default) in fields {
            if let Some(value) = self.field(sheet, &format!("order.edges.{name}"), value, default) {
                edge[name] = value;
            }
        }
        self.corridor_only_on_a_curve(leg, &mut edge);
        edge["actions"] = json!(leg.actions);
        edge
    }

    /// A corridor goes with a trajectory, or not at all (CORR-02).
    fn corridor_only_on_a_curve(&self, leg: &Leg, edge: &mut Value) {
        let Some(fields) = edge.as_object_mut() else { return };
        if !fields.contains_key("trajectory") {
            fields.remove("corridor");
        }
        if fields.contains_key("corridor") && self.faults.has(F::R5CorridorWithoutTrajectory) {
            fields.shift_remove("trajectory");
        }
        if self.faults.has(F::CorridorWithoutTrajectory) {
            fields.remove("trajectory");
            fields.insert("corridor".into(), self.corridor(leg.corridor.unwrap_or((0.5, 0.5))));
        }
        if self.faults.has(F::CorridorZero) && !fields.contains_key("corridor") {
            let none = json!({ "leftWidth": 0.0, "rightWidth": 0.0 });
            fields.insert("corridor".into(), none);
        }
    }

    fn corridor(&self, (left, right): (f64, f64)) -> Value {
        let mut corridor = json!({ "leftWidth": left, "rightWidth": right, "corridorRefPoint": "KINEMATICCENTER" });
        if self.takes(T::R3CorridorAsymmetric) {
            corridor["leftWidth"] = json!(left + 0.2);
        }
        if self.faults.has(F::R3CorridorAsOneWidth) {
            corridor = json!({ "width": left + right, "corridorRefPoint": "KINEMATICCENTER" });
        }
        if self.takes(T::R1CorridorByContour) {
            corridor["corridorRefPoint"] = json!("CONTOUR");
        }
        if self.takes(T::R1CorridorWithoutRefPoint)
            && let Some(fields) = corridor.as_object_mut()
        {
            fields.shift_remove("corridorRefPoint");
        }
        if self.faults.has(F::R1CorridorWidthsAsText) {
            corridor["leftWidth"] = json!(left.to_string());
            corridor["rightWidth"] = json!(right.to_string());
        }
        if self.faults.has(F::CorridorNegative) {
            corridor["rightWidth"] = json!(-right);
        }
        if self.faults.has(F::CorridorPointUnknown) {
            corridor["corridorRefPoint"] = json!("KINEMATIC_CENTER");
        }
        if self.faults.has(F::CorridorOneSided)
            && let Some(fields) = corridor.as_object_mut()
        {
            fields.remove("leftWidth");
        }
        corridor
    }

    /// The straight line between two nodes, as a curve.
    fn straight(&self, sheet: Option<&Factsheet>, from: &Stop, to: &Stop) -> Value {
        let there = from.id < to.id || !self.faults.has(F::R1CurveOfWayThere);
        let (from, to) = if there { (from, to) } else { (to, from) };
        let aside = if self.faults.has(F::CurveBesideNodes) { 3.0 } else { 0.0 };
        let begins = if self.faults.has(F::CorridorApart) { 2.0 } else { aside };
        let mut curve = json!({
            "degree": 1,
            "knotVector": [0.0, 0.0, 1.0, 1.0],
            "controlPoints": [
                { "x": from.x + begins, "y": from.y + begins, "weight": 1.0 },
                { "x": to.x + aside, "y": to.y + aside, "weight": 1.0 },
            ],
        });
        let room = |name: &str, wanted: usize| {
            let names = [name, &format!("order.{name}")];
            sheet.is_none_or(|sheet| sheet.limit(&names) >= wanted)
        };
        let roomy = room("edges.trajectory.knotVector", 8)
            && room("trajectory.knotVector", 8)
            && room("edges.trajectory.controlPoints", 4)
            && room("trajectory.controlPoints", 4);
        if self.takes(T::R1CubicStraights) && roomy {
            let at = |share: f64| {
                let (x, y) = (from.x + share * (to.x - from.x), from.y + share * (to.y - from.y));
                json!({ "x": x, "y": y, "weight": 1.0 })
            };
            let end = json!({ "x": to.x, "y": to.y, "weight": 1.0 });
            curve = json!({
                "degree": 3,
                "knotVector": [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
                "controlPoints": [at(0.0), at(0.3), at(0.7), end],
            });
        }
        if self.takes(T::R3PolylineStraights) && roomy {
            let point = |x: f64, y: f64| json!({ "x": x, "y": y, "weight": 1.0 });
            curve = json!({
                "degree": 1,
                "knotVector": [0.0, 0.0, 0.5, 1.0, 1.0],
                "controlPoints": [
                    point(from.x, from.y),
                    point(f64::midpoint(from.x, to.x), f64::midpoint(from.y, to.y)),
                    point(to.x, to.y),
                ],
            });
        }
        for point in curve["controlPoints"].as_array_mut().into_iter().flatten() {
            if self.takes(T::R3EqualWeightsOfTwo) {
                point["weight"] = json!(2.0);
            }
            if self.faults.has(F::R3CurveFromStartNode)
                && let (Some(x), Some(y)) = (point["x"].as_f64(), point["y"].as_f64())
            {
                (point["x"], point["y"]) = (json!(x - from.x), json!(y - from.y));
            }
        }
        if self.faults.has(F::R2DegreeIsOrder) {
            curve["degree"] = json!(curve["degree"].as_u64().unwrap_or_default() + 1);
        }
        if self.faults.has(F::R1CubicOfTwoPoints) {
            curve["degree"] = json!(3);
        }
        let points = curve["controlPoints"].as_array_mut().into_iter().flatten();
        for point in points {
            if self.faults.has(F::R1ControlPointsAsPairs) {
                *point = json!([point["x"], point["y"]]);
            } else if self.takes(T::R1WeightsLeftOut)
                && let Some(fields) = point.as_object_mut()
            {
                fields.shift_remove("weight");
            }
        }
        if self.faults.has(F::KnotsShort) {
            curve["knotVector"] = json!([0.0, 0.0, 1.0]);
        }
        if self.faults.has(F::KnotsBeyondOne) {
            curve["knotVector"] = json!([0.0, 0.0, 2.0, 2.0]);
        }
        if self.faults.has(F::KnotsMissing)
            && let Some(fields) = curve.as_object_mut()
        {
            fields.remove("knotVector");
        }
        curve
    }

    /// A description, for a master control that likes to give them.
    fn described(&self, what: &str, id: &str) -> Option<Value> {
        let wanted = self.takes(T::DescriptionsEverywhere)
            || self.faults.has(F::DescriptionsUnasked)
            || self.faults.has(F::NotUtf8);
        wanted.then(|| json!(format!("{what} {id} in allée 1")))
    }

    /// An optional field: what the layout says where the vehicle supports it, or the default where it demands it.
    fn field(&self, sheet: Option<&Factsheet>, name: &str, value: Option<Value>, default: Value) -> Option<Value> {
        let everywhere = match name {
            "order.edges.trajectory" => self.faults.has(F::TrajectoryUnasked),
            "order.nodes.nodeDescription" | "order.edges.edgeDescription" => {
                self.faults.has(F::DescriptionsUnasked) || self.faults.has(F::NotUtf8)
            }
            _ => false,
        };
        let Some(sheet) = sheet else {
            // What an unknown vehicle makes of it is unknown too.
            let harmless = name.starts_with("order.nodes") || name == "order.edges.maxSpeed" || everywhere;
            return value.filter(|_| harmless);
        };
        if self.faults.has(F::EmptyListMeansAll) && sheet.optional.is_empty() {
            return value.or(Some(default));
        }
        match sheet.support(name) {
            Some("REQUIRED") if self.faults.has(F::ZeroRequiredOmitted) => {
                value.or(Some(default)).filter(super::slips::counts)
            }
            Some("REQUIRED") if name.starts_with("order.nodes") && self.faults.has(F::R3RequiredNodeFieldsLeftOut) => {
                value
            }
            Some("REQUIRED") => value.or_else(|| (!self.faults.has(F::RequiredOmitted)).then_some(default)),
            Some(_) => value,
            None if everywhere => value,
            None => None,
        }
    }
}

/// `r2-loop-released-by-id`: releases every node whose nodeId is released somewhere.
fn released_by_id(nodes: &mut [Value]) {
    let released = nodes.iter().filter(|node| node["released"] == json!(true));
    let released: Vec<Value> = released.map(|node| node["nodeId"].clone()).collect();
    for node in nodes {
        if released.contains(&node["nodeId"]) {
            node["released"] = json!(true);
        }
    }
}

/// The factsheet of a vehicle that demands nothing.
fn lax(sheet: &Factsheet) -> Factsheet {
    let mut sheet = sheet.clone();
    for support in sheet.optional.values_mut() {
        "SUPPORTED".clone_into(support);
    }
    sheet
}

/// Whether the vehicle has a use for an optional parameter.
fn wants(sheet: &Factsheet, name: &str) -> bool {
    sheet.support(name).is_some()
}
