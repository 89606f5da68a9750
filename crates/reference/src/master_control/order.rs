//! The order message: nodes and edges as a vehicle wants them, within its limits (sections 6.6.1, 6.6.2 and 6.15).
//!
//! An optional field is sent where the vehicle supports it and the layout knows it, and where the vehicle requires it
//! (the rulings of OPT-03 and OPT-05).

use serde_json::{Value, json};

use super::Site;
use super::hooks::{Field, Measure, Worded};
use super::layout::distance;
use super::vehicle::{Leg, Running, Stop, Vehicle};

/// Part of a way that a message holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Window {
    /// Index of the first node.
    pub(crate) first: usize,
    /// Index behind the last released node.
    pub(crate) released: usize,
    /// Index behind the last node.
    pub(crate) end: usize,
}

impl Site {
    /// The message of this window, and the window it became within the limits of the vehicle. `None` when not even
    /// the first step fits.
    pub(crate) fn order_message(
        &mut self,
        vehicle: &Vehicle,
        running: &Running,
        window: Window,
    ) -> Option<(Value, Window)> {
        let mut window = window;
        let (asked, update) = (window.end, window.first > 0);
        let mut longest = usize::MAX;
        if let Some(sheet) = &vehicle.factsheet {
            let nodes = sheet.limit(&["order.nodes", "nodes"]);
            let nodes = nodes.min(sheet.limit(&["order.edges", "edges"]).saturating_add(1));
            let listed = sheet.limit(&["state.nodeStates"]).saturating_add(1);
            let nodes = self.measures(vehicle, Measure::Nodes(update), nodes);
            let listed = self.measures(vehicle, Measure::NodeStates, listed);
            let end = window.first.saturating_add(nodes.min(listed));
            window.end = self.measures(vehicle, Measure::Shown(asked), asked.min(end));
            window.released = window.released.min(end);
            longest = sheet.message.unwrap_or(usize::MAX);
        }
        let longest = self.measures(vehicle, Measure::Message(update), longest);
        loop {
            if window.released <= window.first {
                return None;
            }
            let message = self.message(vehicle, running, window, window.end < asked);
            // The header comes on top.
            let mut own = message.clone();
            vehicle.config.spell("order", &mut own);
            if self.text("order", &own).len() + 300 <= longest {
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
    fn message(&mut self, vehicle: &Vehicle, running: &Running, window: Window, cut: bool) -> Value {
        let mut nodes = Vec::new();
        let mut edges = Vec::new();
        for index in window.first..window.end {
            let Some(stop) = running.stops.get(index) else { break };
            if index > window.first
                && let (Some(before), Some(leg)) = (running.stops.get(index - 1), running.legs.get(index - 1))
            {
                edges.push(self.edge(vehicle, leg, (before, stop), index - 1, window));
            }
            nodes.push(self.node(vehicle, stop, index, window));
        }
        let mut message = json!({ "orderId": running.id, "orderUpdateId": running.update_id });
        if let Some(zones) = &self.config.zone_set
            && vehicle
                .factsheet
                .as_ref()
                .is_none_or(|sheet| sheet.support("order.zoneSetId").is_some())
        {
            message["zoneSetId"] = json!(zones);
        }
        message["nodes"] = Value::Array(nodes);
        message["edges"] = Value::Array(edges);
        if let Value::Object(message) = &mut message {
            self.words(vehicle, &Worded { running, window, cut }, message);
        }
        message
    }

    /// A node: its sequenceId is twice its place in the whole way (ORD-UPD-11).
    fn node(&mut self, vehicle: &Vehicle, stop: &Stop, index: usize, window: Window) -> Value {
        let number = |value: Option<f64>| value.map(|value| json!(value));
        let mut node = json!({ "nodeId": stop.id, "sequenceId": 2 * index, "released": index < window.released });
        let mut position = json!({ "x": stop.x, "y": stop.y });
        let fields = [
            ("theta", number(stop.theta), json!(std::f64::consts::FRAC_PI_2)),
            ("allowedDeviationXY", number(stop.deviation_xy), json!(0.3)),
            (
                "allowedDeviationTheta",
                number(stop.deviation_theta),
                json!(std::f64::consts::PI),
            ),
            ("mapDescription", None, json!(stop.map_id)),
        ];
        for (name, layout, default) in fields {
            let full = format!("order.nodes.nodePosition.{name}");
            if let Some(value) = self.field(vehicle, &full, layout, default, (index, window)) {
                position[name] = value;
            }
        }
        position["mapId"] = json!(stop.map_id);
        let described = self.field(
            vehicle,
            "order.nodes.nodeDescription",
            None,
            json!(stop.id),
            (index, window),
        );
        if let Some(text) = described {
            node["nodeDescription"] = text;
        }
        node["nodePosition"] = position;
        node["actions"] = json!(stop.actions);
        node
    }

    /// An edge: its sequenceId lies between those of its nodes.
    fn edge(&mut self, vehicle: &Vehicle, leg: &Leg, ends: (&Stop, &Stop), index: usize, window: Window) -> Value {
        let (from, to) = ends;
        let mut edge = json!({
            "edgeId": leg.id,
            "sequenceId": 2 * index + 1,
            "released": index + 1 < window.released,
            "startNodeId": from.id,
            "endNodeId": to.id,
        });
        let number = |value: Option<f64>| value.map(|value| json!(value));
        let widths = leg.corridor.filter(|(left, right)| *left > 0.0 || *right > 0.0);
        let curve = straight(from, to);
        let guided = widths.is_some() || self.is_guided(vehicle, from, to);
        let fields = [
            ("edgeDescription", None, json!(leg.id)),
            ("maxSpeed", number(leg.max_speed), json!(1.0)),
            ("maxHeight", number(leg.max_height), json!(10.0)),
            ("minHeight", number(leg.min_height), json!(0.0)),
            ("orientation", None, json!(0.0)),
            ("orientationType", None, json!("TANGENTIAL")),
            (
                "direction",
                leg.direction.as_ref().map(|text| json!(text)),
                json!("straight"),
            ),
            ("rotationAllowed", None, json!(true)),
            ("maxRotationSpeed", None, json!(1.0)),
            ("length", None, json!(distance((from.x, from.y), (to.x, to.y)))),
            ("trajectory", guided.then(|| curve.clone()), curve),
            ("corridor", widths.map(corridor), corridor((0.5, 0.5))),
        ];
        for (name, layout, default) in fields {
            let full = format!("order.edges.{name}");
            if let Some(value) = self.field(vehicle, &full, layout, default, (index, window)) {
                edge[name] = value;
            }
        }
        // A corridor goes with a trajectory, or not at all (CORR-02).
        if edge.get("trajectory").is_none()
            && let Some(fields) = edge.as_object_mut()
        {
            fields.shift_remove("corridor");
        }
        for (name, wanted) in [("releaseRequired", json!(true)), ("releaseLossBehavior", json!("STOP"))] {
            let full = format!("order.edges.corridor.{name}");
            let value = self.field(vehicle, &full, None, wanted, (index, window));
            if let (Some(value), Some(corridor)) = (value, edge.get_mut("corridor").and_then(Value::as_object_mut)) {
                corridor.insert(name.to_owned(), value);
            }
        }
        edge["actions"] = json!(leg.actions);
        edge
    }

    /// An optional field: what the layout says where the vehicle supports it, or the default where it demands it.
    fn field(
        &mut self,
        vehicle: &Vehicle,
        name: &str,
        layout: Option<Value>,
        default: Value,
        (index, window): (usize, Window),
    ) -> Option<Value> {
        let sheet = vehicle.factsheet.as_ref();
        let support = sheet.and_then(|sheet| sheet.support(name));
        // What an unknown vehicle makes of it is unknown too.
        let harmless = sheet.is_none() && (name.starts_with("order.nodes") || name == "order.edges.maxSpeed");
        let mut value = match support {
            Some("REQUIRED") => layout.clone().or_else(|| Some(default.clone())),
            Some(_) => layout.clone(),
            None => layout.clone().filter(|_| harmless),
        };
        let field = Field {
            name,
            layout,
            default,
            support,
            harmless,
            index,
            window,
        };
        self.fills(vehicle, &field, &mut value);
        value
    }
}

/// A corridor of these widths to the left and to the right, in metres (CORR-09).
fn corridor((left, right): (f64, f64)) -> Value {
    json!({ "leftWidth": left, "rightWidth": right, "corridorRefPoint": "KINEMATICCENTER" })
}

/// The straight line between two nodes, as a curve of degree 1 (ORD-MSG-28 to ORD-MSG-30).
fn straight(from: &Stop, to: &Stop) -> Value {
    let point = |stop: &Stop| json!({ "x": stop.x, "y": stop.y, "weight": 1.0 });
    json!({ "degree": 1, "knotVector": [0.0, 0.0, 1.0, 1.0], "controlPoints": [point(from), point(to)] })
}
