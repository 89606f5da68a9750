//! What a faulty master control cannot bear in the messages of its vehicles: what is odd but legal, and what is wrong
//! but must not bring it down.

use serde_json::Value;

use super::Site;
use super::faults::FaultName as F;
use super::vehicle::Vehicle;

/// What it has heard of a vehicle, for some of these faults.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Manner {
    /// headerId of the last state.
    header: Option<u64>,
    /// States in a row that were paused.
    paused: u32,
}

/// Everything odd.
const ODD: [F; 12] = [
    F::EmptyLastNodeShunned,
    F::ForeignActionShunned,
    F::NamelessActionShunned,
    F::PauseShunned,
    F::NonAsciiShunned,
    F::ExponentShunned,
    F::GapShunned,
    F::EmptyPayloadShunned,
    F::MinimalFactsheetShunned,
    F::WrongTypeShunned,
    F::DiesOfNull,
    F::DiesOfEmptyLastNode,
];

impl Site {
    /// Does what its faults make of a message, before it is read.
    pub(super) fn take_odd(&mut self, vehicle: &mut Vehicle, name: &str, payload: &[u8]) {
        if !ODD.iter().any(|fault| self.faults.has(*fault)) {
            return;
        }
        let message: Value = serde_json::from_slice(payload).unwrap_or_default();
        let state = name == "state";
        let header = message.get("headerId").and_then(Value::as_u64);
        let skipped = state
            && vehicle
                .manner
                .header
                .zip(header)
                .is_some_and(|(old, new)| new > old + 1);
        let paused = state && message["paused"] == true;
        if state {
            vehicle.manner.header = header.or(vehicle.manner.header);
            vehicle.manner.paused = if paused { vehicle.manner.paused + 1 } else { 0 };
        }
        let nowhere = state && message["lastNodeId"] == "";
        let actions = || {
            message["actionStates"]
                .as_array()
                .into_iter()
                .flatten()
                .filter(|_| state)
        };
        let session = self.session.to_string();
        let foreign = |action: &Value| !action["actionId"].as_str().unwrap_or_default().contains(&session);
        let odd = |fault: F| match fault {
            F::EmptyLastNodeShunned | F::DiesOfEmptyLastNode => nowhere,
            F::ForeignActionShunned => actions().any(foreign),
            F::NamelessActionShunned => actions().any(|action| action.get("actionType").is_none()),
            F::PauseShunned => vehicle.manner.paused > 1,
            F::NonAsciiShunned => !payload.is_ascii(),
            F::ExponentShunned => has_exponent(payload),
            F::GapShunned => skipped,
            F::EmptyPayloadShunned => payload.is_empty(),
            F::MinimalFactsheetShunned => {
                name == "factsheet" && message.pointer("/protocolLimits/maxArrayLens/order.nodes").is_none()
            }
            F::WrongTypeShunned => state && message["orderUpdateId"].is_string(),
            F::DiesOfNull => {
                state
                    && message
                        .as_object()
                        .is_some_and(|members| members.values().any(Value::is_null))
            }
            _ => false,
        };
        for fault in ODD.into_iter().filter(|fault| self.faults.has(*fault) && odd(*fault)) {
            match fault {
                F::DiesOfNull | F::DiesOfEmptyLastNode => self.dead = true,
                _ => vehicle.shunned = true,
            }
        }
    }
}

/// Whether a number is written with an exponent.
fn has_exponent(payload: &[u8]) -> bool {
    let exponent = |window: &[u8]| {
        window[0].is_ascii_digit()
            && matches!(window[1], b'e' | b'E')
            && (window[2].is_ascii_digit() || matches!(window[2], b'+' | b'-'))
    };
    let mut quoted = false;
    payload.windows(3).any(|window| {
        quoted ^= window[0] == b'"';
        !quoted && exponent(window)
    })
}
