//! How fast a master control answers: the time from a state of a vehicle to the next order message for it.

use tck_base::clock::Moment;
use tck_journal::Entry;
use tck_journal::event::{Event, MockVehicle};
use tck_result::{CommandedVehicle, FleetResult, ReactionTimes};

use super::timeline::TopicOwner;

/// More answers than this are not measured one by one.
const MOST: usize = 1_000_000;

/// What is measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Reactions {
    vehicles: Vec<OfVehicle>,
    measured: usize,
}

#[derive(Clone, Debug, Default)]
struct OfVehicle {
    serial_number: String,
    /// When it said its last state.
    state: Option<Moment>,
    orders: usize,
    /// Microseconds.
    times: Vec<u32>,
}

impl Reactions {
    /// For these vehicles.
    pub fn of(vehicles: &[MockVehicle]) -> Self {
        let vehicles = vehicles.iter().map(|vehicle| OfVehicle {
            serial_number: vehicle.serial_number.clone(),
            ..OfVehicle::default()
        });
        Self {
            vehicles: vehicles.collect(),
            measured: 0,
        }
    }

    /// Shows the next entry and whose topic it is about.
    pub fn observe(&mut self, entry: &Entry, place: &TopicOwner) {
        let Some(vehicle) = self.vehicles.get_mut(place.vehicle) else {
            return;
        };
        match entry.event() {
            Event::Sent { .. } if place.name == "state" => vehicle.state = Some(entry.at().moment),
            Event::Message { retain: false, .. } if place.name == "order" => {
                if let Some(said) = vehicle.state.filter(|_| self.measured < MOST) {
                    let micros = entry.at().moment.since(said).as_micros();
                    vehicle.times.push(u32::try_from(micros).unwrap_or(u32::MAX));
                    self.measured += 1;
                }
                vehicle.orders += 1;
            }
            _ => {}
        }
    }

    /// Together with what was measured in the run before.
    pub fn after(&self, before: &Self) -> Self {
        let mut all = before.clone();
        for own in &self.vehicles {
            let known = all
                .vehicles
                .iter_mut()
                .find(|known| known.serial_number == own.serial_number);
            match known {
                Some(known) => {
                    known.orders += own.orders;
                    known.times.extend(&own.times);
                }
                None => all.vehicles.push(own.clone()),
            }
        }
        all
    }

    /// What was measured; `None` when an AGV is tested.
    pub fn result(&self) -> Option<FleetResult> {
        if self.vehicles.is_empty() {
            return None;
        }
        let all: Vec<u32> = self
            .vehicles
            .iter()
            .flat_map(|vehicle| &vehicle.times)
            .copied()
            .collect();
        let each = self.vehicles.iter().map(|vehicle| {
            let times = ReactionTimes::of(&vehicle.times);
            CommandedVehicle {
                serial_number: vehicle.serial_number.clone(),
                orders: vehicle.orders,
                median: times.as_ref().map(|times| times.median),
                longest: times.map(|times| times.longest),
            }
        });
        Some(FleetResult {
            vehicles: self.vehicles.len(),
            commanded: self.vehicles.iter().filter(|vehicle| vehicle.orders > 0).count(),
            reaction: ReactionTimes::of(&all),
            each: each.collect(),
        })
    }
}
