//! The vehicles of all parts of a run against one master control.

use super::RunPart;
use tck_result::{CommandedVehicle, FleetResult};

/// The vehicles of all parts, each once, in the order of the parts. From the medians of parts none of the whole follows, so that
/// a vehicle of several parts has none, and neither has the fleet.
pub(super) fn fleet(own: &[&RunPart]) -> Option<FleetResult> {
    let mut each: Vec<CommandedVehicle> = Vec::new();
    for vehicle in own
        .iter()
        .filter_map(|part| part.result.fleet.as_ref())
        .flat_map(|fleet| &fleet.each)
    {
        match each
            .iter_mut()
            .find(|known| known.serial_number == vehicle.serial_number)
        {
            Some(known) => {
                known.orders += vehicle.orders;
                known.median = None;
                known.longest = [known.longest, vehicle.longest].into_iter().flatten().reduce(f64::max);
            }
            None => each.push(vehicle.clone()),
        }
    }
    (!each.is_empty()).then(|| FleetResult {
        vehicles: each.len(),
        commanded: each.iter().filter(|vehicle| vehicle.orders > 0).count(),
        reaction: None,
        each,
    })
}
