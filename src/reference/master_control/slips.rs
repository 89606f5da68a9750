//! What a forgetful master control keeps, or does not keep, of its fleet: faults only.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use super::Site;
use super::faults::FaultName as F;
use super::order::Window;
use super::seen::State;
use super::vehicle::{Running, Vehicle};

/// What is kept of one vehicle.
#[derive(Clone, Debug, Default)]
pub(super) struct Slips {
    /// An update of its order waits for minOrderInterval (`queued-update-in-service`).
    pub(super) held: bool,
    /// version of its last state (`version-of-the-vehicle`).
    pub(super) version: Option<String>,
    /// It was given a trigger in time (`trigger-supervised-once`).
    pub(super) triggered: bool,
    /// Its battery was low (`charging-in-every-mode`).
    charged: bool,
}

/// What is kept of the fleet.
#[derive(Clone, Debug, Default)]
pub(super) struct FleetSlips {
    /// Maps and the vehicles that have enabled them (`enabled-for-fleet`).
    pub(super) enabled: BTreeSet<(String, String)>,
    /// Counts the actions of orders and the others (`instants-counted-apart`).
    counts: (u64, u64),
    /// The action made now is an instant action.
    pub(super) instant: bool,
}

/// `zero-required-omitted`: whether a value is not zero.
pub(super) fn counts(value: &Value) -> bool {
    value.as_f64() != Some(0.0)
}

impl Site {
    /// `queued-update-in-service`: whether an update that was planned goes out whatever the mode.
    pub(super) fn held_update(&self, vehicle: &Vehicle) -> bool {
        vehicle.slips.held && self.faults.has(F::QueuedUpdateInService) && self.reachable(vehicle)
    }

    /// `instants-counted-apart`: the next number of an action.
    pub(super) fn number_apart(&mut self) -> u64 {
        let (orders, instants) = &mut self.slips.counts;
        let count = if self.slips.instant { instants } else { orders };
        *count += 1;
        *count
    }

    /// `header-id-counts-actions` and `version-of-the-vehicle`.
    pub(super) fn slips_header(
        &self,
        vehicle: &mut Vehicle,
        name: &str,
        body: &Value,
        header: &mut Map<String, Value>,
    ) {
        if let Some(version) = &vehicle.slips.version
            && self.faults.has(F::VersionOfTheVehicle)
        {
            header.insert("version".into(), json!(version));
        }
        let actions = body["actions"].as_array().map_or(0, Vec::len);
        if let Some(next) = vehicle.header_ids.get_mut(name)
            && actions > 1
            && self.faults.has(F::HeaderIdCountsActions)
        {
            *next = next.wrapping_add(u32::try_from(actions - 1).unwrap_or_default());
        }
    }

    /// `lost-update-not-resent`: whether the message sent last is an update.
    pub(super) fn not_repeated(&self, running: &Running) -> bool {
        let first = running.message.pointer("/nodes/0/sequenceId").and_then(Value::as_u64);
        first.is_some_and(|first| first > 0) && self.faults.has(F::LostUpdateNotResent)
    }

    /// `trigger-forgotten-in-pause` and `trigger-supervised-once`.
    pub(super) fn left_waiting(&self, vehicle: &Vehicle, running: &mut Running, state: &State) -> bool {
        let waits = running.actions().any(|action| {
            let id = action["actionId"]
                .as_str()
                .filter(|_| action["actionType"] == "waitForTrigger");
            let seen = id.and_then(|id| state.action(id));
            seen.is_some_and(|seen| matches!(seen.action_status.as_str(), "RUNNING" | "PAUSED"))
        });
        if waits && state.is_paused() && self.faults.has(F::TriggerForgottenInPause) {
            running.r2_unsupervised = true;
        }
        vehicle.slips.triggered && self.faults.has(F::TriggerSupervisedOnce)
    }

    /// `enabled-for-fleet`: whether another vehicle has enabled a map.
    pub(super) fn enabled_elsewhere(&self, vehicle: &Vehicle, map_id: &str) -> bool {
        let serial = &vehicle.config.serial_number;
        let mut enabled = self.slips.enabled.iter();
        enabled.any(|(map, by)| map == map_id && by != serial) && self.faults.has(F::EnabledForFleet)
    }

    /// `loop-numbered-by-node`: a node passed twice has the number of the first time.
    pub(super) fn numbered_by_node(&self, running: &Running, nodes: &mut [Value]) {
        if !self.faults.has(F::LoopNumberedByNode) {
            return;
        }
        for node in nodes {
            let first = running.stops.iter().position(|stop| node["nodeId"] == json!(stop.id));
            if let Some(first) = first {
                node["sequenceId"] = json!(running.r1_number(2 * first));
            }
        }
    }

    /// `loop-stitched-at-first-pass`: the update begins where the way passes the stitching node first.
    pub(super) fn stitched_at_first_pass(&self, running: &Running, window: Window) -> Window {
        let node = running.stops.get(window.first).map(|stop| &stop.id);
        let first = running.stops.iter().position(|stop| Some(&stop.id) == node);
        match first.filter(|_| self.faults.has(F::LoopStitchedAtFirstPass)) {
            Some(first) => Window { first, ..window },
            None => window,
        }
    }

    /// `charging-in-every-mode`: sends a vehicle to charge whose battery has become low.
    pub(super) fn charge_anyway(&mut self, vehicle: &mut Vehicle) {
        let Some(state) = &vehicle.state else { return };
        let low = state
            .battery_state
            .battery_charge
            .is_some_and(|charge| charge < self.config.low_battery);
        let due = low && !vehicle.slips.charged && !state.takes_orders() && self.reachable(vehicle);
        vehicle.slips.charged = low;
        if due
            && self.faults.has(F::ChargingInEveryMode)
            && self.offers(vehicle.factsheet.as_ref(), "startCharging", "INSTANT")
        {
            let action = self.action(vehicle, "startCharging", &Value::Null);
            self.publish(vehicle, "instantActions", &json!({ "actions": [action] }));
        }
    }
}
