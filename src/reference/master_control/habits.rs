//! Habits of some master controls: faults and liberties that need more than a word where they are decided.

use std::time::Duration;

use serde_json::{Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::order::Window;
use super::seen::State;
use super::tolerances::ToleranceName as T;
use super::vehicle::{Presence, Running, Vehicle};
use crate::reference::{Output, Publication};

/// A vehicle that says nothing for so long is thought to be gone (`r5-publishes-connection-for-silent-vehicle`).
const SILENCE: Duration = Duration::from_secs(10);

impl Site {
    /// What the return of a vehicle leads to.
    pub(super) fn r5_returned(&mut self, vehicle: &mut Vehicle) {
        vehicle.r5_back = true;
        vehicle.r5_repeat = vehicle.running.is_some() && self.takes(T::R5RepeatsOrderAfterOnline);
        if let Some(running) = &mut vehicle.running
            && self.faults.has(F::R5WholeOrderAgainAfterReconnect)
        {
            running.changed = true;
            vehicle.r5_whole = true;
        }
        if self.faults.has(F::R5ActionIdsRestartAfterReconnect) {
            self.r1_actions = 0;
        }
    }

    /// `r5-repeats-order-after-online`: the last message once more, with the same content.
    pub(super) fn r5_repeat(&mut self, vehicle: &mut Vehicle) {
        if !vehicle.r5_repeat || !self.commandable(vehicle) {
            return;
        }
        if let Some(due) = self.next_order_at(vehicle) {
            vehicle.at(due);
            return;
        }
        vehicle.r5_repeat = false;
        let now = self.now.moment;
        let Some(running) = vehicle.running.as_mut().filter(|running| !running.cleared) else {
            return;
        };
        if vehicle.cancel.is_some() {
            return;
        }
        running.sent_at = now;
        let message = running.message.clone();
        vehicle.last_order_at = Some(now);
        self.r1_resending = true;
        self.publish(vehicle, "order", &message);
        self.r1_resending = false;
    }

    /// `r5-stops-pause-after-reconnect-only-by-operator`: whether the vehicle is left alone until it is resumed.
    pub(super) fn r5_left_paused(&self, vehicle: &Vehicle) -> bool {
        let paused = vehicle.state.as_ref().is_some_and(State::is_paused);
        paused && vehicle.r5_back && self.takes(T::R5StopsPauseAfterReconnectOnlyByOperator)
    }

    /// `r5-publishes-connection-for-silent-vehicle`: says for a vehicle that its connection is broken.
    pub(super) fn r5_declare_silent(&mut self, vehicle: &mut Vehicle) {
        let here = vehicle.presence == Presence::Online && vehicle.state.is_some();
        if !here || vehicle.r5_declared || !self.faults.has(F::R5PublishesConnectionForSilentVehicle) {
            return;
        }
        let due = vehicle.state_at + SILENCE;
        if due > self.now.moment {
            vehicle.at(due);
            return;
        }
        vehicle.r5_declared = true;
        let Some(topic) = vehicle.topic("connection").map(str::to_owned) else {
            return;
        };
        let mut message = self.header(vehicle, "connection");
        message.insert("connectionState".into(), json!("CONNECTIONBROKEN"));
        self.pending.push(Output::Publish(Publication {
            topic,
            payload: Value::Object(message).to_string().into_bytes(),
            qos: 1,
            retain: true,
        }));
    }

    /// `r5-cancel-on-entering-manual`: calls the order off that a vehicle has when it is taken over by hand.
    pub(super) fn r5_cancel_in_manual(&mut self, vehicle: &mut Vehicle) {
        let driven = vehicle.running.as_ref().is_some_and(|running| running.accepted);
        if driven && self.reachable(vehicle) && self.faults.has(F::R5CancelOnEnteringManual) {
            let action = self.action(vehicle, "cancelOrder", &Value::Null);
            self.publish(vehicle, "instantActions", &json!({ "actions": [action] }));
        }
    }

    /// `r5-cancel-repeated-with-new-id`: a cancelOrder that was lost and waits to be sent again gets another id.
    pub(super) fn r5_rename_cancel(&mut self, vehicle: &mut Vehicle) {
        let lost = vehicle.instants.iter().position(|instant| {
            instant.kind() == "cancelOrder"
                && instant.sent_at.is_none()
                && instant.resends > 0
                && instant.resends < u32::MAX
        });
        let Some(lost) = lost else { return };
        let fresh = self.next_id(vehicle, "action");
        let Some(instant) = vehicle.instants.get_mut(lost) else {
            return;
        };
        if let Some(cancel) = &mut vehicle.cancel
            && cancel.action_id == instant.id()
        {
            cancel.action_id.clone_from(&fresh);
        }
        instant.action["actionId"] = json!(fresh);
    }

    /// `r5-horizon-actions-get-new-ids`: new ids for everything that is not released yet.
    pub(super) fn r5_rename_horizon(&mut self, vehicle: &Vehicle, running: &mut Running) {
        for action in unreleased(running, running.released) {
            action["actionId"] = json!(self.next_id(vehicle, "action"));
        }
    }

    /// Defects and liberties of an edge that depend on the vehicle.
    pub(super) fn r2_edge(&self, vehicle: &Vehicle, window: Window, index: usize, edge: &mut Value) {
        let has = |fault: F| self.faults.has(fault);
        let Some(state) = &vehicle.state else { return };
        let loaded = state.loads.as_ref().is_some_and(|loads| !loads.is_empty());
        let score = state
            .agv_position
            .as_ref()
            .and_then(|position| position.localization_score);
        if let Some(speed) = edge.get("maxSpeed").and_then(Value::as_f64) {
            if score.is_some_and(|score| score < 0.5) && has(F::R2LowScoreSlowsDown) {
                edge["maxSpeed"] = json!(speed / 3.0);
            } else if loaded && self.takes(T::R2SlowerWhenLoaded) {
                edge["maxSpeed"] = json!(speed / 2.0);
            }
        }
        if loaded && edge.get("corridor").is_some() && has(F::R2CorridorClosedWhenLoaded) {
            edge["corridor"]["leftWidth"] = json!(0.0);
            edge["corridor"]["rightWidth"] = json!(0.0);
        }
        let first = index == window.first && window.first > 0;
        if first && !state.last_node_id.is_empty() && has(F::R2UpdateEdgeStartsAtVehicle) {
            edge["startNodeId"] = json!(state.last_node_id);
        }
    }
}

/// The actions of the nodes from this one on, and of the edges that lead to them.
fn unreleased(running: &mut Running, first: usize) -> impl Iterator<Item = &mut Value> {
    let nodes = running.stops.iter_mut().skip(first);
    let edges = running.legs.iter_mut().skip(first.saturating_sub(1));
    let on_nodes = nodes.flat_map(|stop| &mut stop.actions);
    on_nodes.chain(edges.flat_map(|leg| &mut leg.actions))
}

/// `r5-action-ids-counted-per-message`: numbers what is new in a message, from the node `first` on, from 1.
pub(super) fn number_actions(vehicle: &Vehicle, running: &mut Running, first: usize) {
    let sheet = vehicle.factsheet.as_ref();
    let numerical = sheet.is_some_and(|sheet| sheet.ids_numerical);
    let longest = sheet.and_then(|sheet| sheet.id_length).unwrap_or(usize::MAX);
    let order = running.id.clone();
    for (index, action) in unreleased(running, first).enumerate() {
        let number = index + 1;
        let full = if numerical {
            format!("{order}{number:03}")
        } else {
            format!("{order}-action-{number}")
        };
        action["actionId"] = json!(if full.len() <= longest {
            full
        } else {
            number.to_string()
        });
    }
}

/// `r5-corridor-narrower-than-node`: half of what the vehicle may be away from the node where the edge begins.
pub(super) fn narrow(nodes: &[Value], edges: &mut [Value]) {
    for (node, edge) in nodes.iter().zip(edges) {
        let allowed = node.pointer("/nodePosition/allowedDeviationXY").and_then(Value::as_f64);
        if let Some(corridor) = edge.get_mut("corridor")
            && let Some(allowed) = allowed.filter(|allowed| *allowed > 0.0)
        {
            corridor["leftWidth"] = json!(allowed / 2.0);
            corridor["rightWidth"] = json!(allowed / 2.0);
        }
    }
}

/// `r5-missing-values-as-null`: writes every optional member that is missing as null.
pub(super) fn with_nulls(name: &str, message: &mut Value) {
    if name == "order" {
        fill(message, &["zoneSetId"]);
    }
    for node in message
        .get_mut("nodes")
        .and_then(Value::as_array_mut)
        .into_iter()
        .flatten()
    {
        fill(node, &["nodeDescription", "nodePosition"]);
        let optional = ["theta", "allowedDeviationXY", "allowedDeviationTheta", "mapDescription"];
        if let Some(position) = node.get_mut("nodePosition") {
            fill(position, &optional);
        }
        fill_actions(node);
    }
    for edge in message
        .get_mut("edges")
        .and_then(Value::as_array_mut)
        .into_iter()
        .flatten()
    {
        fill(
            edge,
            &[
                "edgeDescription",
                "maxSpeed",
                "maxHeight",
                "minHeight",
                "orientation",
                "orientationType",
                "direction",
                "rotationAllowed",
                "maxRotationSpeed",
                "trajectory",
                "length",
                "corridor",
            ],
        );
        fill_actions(edge);
    }
    fill_actions(message);
}

fn fill_actions(element: &mut Value) {
    let actions = element.get_mut("actions").and_then(Value::as_array_mut);
    for action in actions.into_iter().flatten() {
        fill(action, &["actionDescription", "actionParameters"]);
    }
}

fn fill(value: &mut Value, names: &[&str]) {
    if let Some(members) = value.as_object_mut() {
        for name in names {
            members.entry(*name).or_insert(Value::Null);
        }
    }
}

/// `r5-whole-numbers-without-point`: writes 3.0 as 3.
pub(super) fn without_point(value: &mut Value) {
    match value {
        Value::Object(members) => members.values_mut().for_each(without_point),
        Value::Array(elements) => elements.iter_mut().for_each(without_point),
        Value::Number(number) if number.is_f64() => {
            // A whole float is displayed without a point.
            let whole = number.as_f64().filter(|number| number.fract() == 0.0);
            if let Some(whole) = whole.and_then(|whole| (whole + 0.0).to_string().parse::<i64>().ok()) {
                *value = json!(whole);
            }
        }
        _ => {}
    }
}
