//! Deviations of which instant actions are sent, and when (section 6.9).

use super::prelude::*;

records! {
    fault "position-during-order" ["IACT-02"] "Sets the position of a vehicle that drives an order."
        because "Whether initPosition contradicts an order is disputed, so that the ruling makes it a warning."
        => beside(|_, _| true);
    fault "charging-during-order" ["IACT-02"] "It sends startCharging and stopCharging as instant actions while the vehicle drives an order."
        => beside(|_, kind| kind.ends_with("Charging"));
    fault "position-while-paused" ["IACT-02"] "It sends initPosition during an order when the vehicle is paused."
        because "Whether initPosition contradicts an order that is paused is disputed, so that IACT-02 makes it a warning."
        => beside(|vehicle, kind| kind == "initPosition" && vehicle.is_paused());
    fault "position-set-when-lost" ["IACT-02"] "It sends initPosition on its own during a running order when the vehicle reports that its position is not initialized."
        => keep::<bool>().happens(|before, site, vehicle, event| if let Event::State(_) = event {
            let position = vehicle.state.as_ref().and_then(|state| state.agv_position.clone());
            let lost = position.filter(|position| !position.position_initialized);
            if let Some(at) = lost.as_ref().filter(|_| vehicle.running.is_some() && !*before) {
                let node = site.config.nearest(at.x, at.y, &at.map_id).map(|(node, _)| node.id.clone());
                let given = json!({ "x": at.x, "y": at.y, "theta": at.theta, "mapId": at.map_id, "lastNodeId": node.unwrap_or_default() });
                site.instant_all_the_same(vehicle, "initPosition", &given);
            }
            *before = lost.is_some();
        });
    fault "charging-on-low-battery" ["IACT-02"] "It sends startCharging as an instant action to a vehicle that drives an order when its battery runs low."
        => keep::<bool>().happens(|charged, site, vehicle, event| if let Event::Looked = event {
            let charges = vehicle.state.as_ref().is_some_and(|state| state.battery_state.charging);
            let low = has_low_battery(site, vehicle) && !charges;
            if low && !*charged && vehicle.running.is_some() {
                *charged = true;
                site.instant_all_the_same(vehicle, "startCharging", &Value::Null);
            }
            *charged &= low;
        });
    fault "pause-waits-for-standstill" ["TOPIC-13"] "It holds a requested startPause back until the vehicle stands still."
        because "TOPIC-13 says where a startPause is sent, and names no time by which it has to be."
        => forbidding(|_, vehicle, what| {
            let drives = vehicle.state.as_ref().is_some_and(|state| state.driving);
            drives && matches!(what, Permission::Tell("startPause"))
        });
    fault "instant-actions-limit-ignored" ["FACT-12"] "Sends more instant actions at once than the vehicle takes."
        => unlimited(|what| matches!(what, Measure::Instants));
    tolerance "instant-actions-one-by-one" ["IACT-01"] "Every instant action is sent in a message of its own."
        => measuring(|_, what, usual| if let Measure::Instants = what { 1 } else { usual });
    tolerance "pause-together-with-state-request" ["IACT-01", "ACT-08"] "It sends startPause and stateRequest in one instantActions message."
        => plain().asked(|(), site, vehicle, command, _| {
            if command == "pause" {
                site.instant(vehicle, "startPause", &Value::Null);
                site.instant(vehicle, "stateRequest", &Value::Null);
            }
            command != "pause"
        });
    tolerance "pause-sent-twice" ["ORD-MSG-17", "IACT-01"] "It sends startPause a second time, with its own actionId, while the first is not reported finished."
        => plain().asked(|(), site, vehicle, command, _| {
            if command == "pause" {
                site.instant(vehicle, "startPause", &Value::Null);
                site.send_instants(vehicle);
            }
            true
        });
}

/// Sends instant actions beside an order, by vehicle and type.
fn beside(when: fn(&Vehicle, &str) -> bool) -> Box<dyn Deviation> {
    holding(when).allows(|when, _, vehicle, what, usual| {
        usual || matches!(what, Permission::Beside(kind) if when(vehicle, kind))
    })
}
