//! How fast a master control answers: the time from a state of a vehicle to the next order message for it.

use crate::clock::Moment;
use crate::journal::Entry;
use crate::journal::event::Event;
use crate::result::{FleetResult, ReactionTimes};

use super::timeline::Place;

/// More answers than this are not measured one by one.
const MOST: usize = 1_000_000;

/// What is measured.
#[derive(Debug, Default)]
pub(super) struct Reactions {
    /// By vehicle: when it said its last state.
    states: Vec<Option<Moment>>,
    commanded: Vec<bool>,
    /// Microseconds.
    times: Vec<u32>,
}

impl Reactions {
    /// For so many vehicles.
    pub fn of(vehicles: usize) -> Self {
        Self {
            states: vec![None; vehicles],
            commanded: vec![false; vehicles],
            times: Vec::new(),
        }
    }

    /// Shows the next entry and whose topic it is about.
    pub fn observe(&mut self, entry: &Entry, place: &Place) {
        let Some(state) = self.states.get_mut(place.vehicle) else {
            return;
        };
        match entry.event() {
            Event::Sent { .. } if place.name == "state" => *state = Some(entry.at().moment),
            Event::Message { retain: false, .. } if place.name == "order" => {
                if let Some(said) = state.filter(|_| self.times.len() < MOST) {
                    let micros = entry.at().moment.since(said).as_micros();
                    self.times.push(u32::try_from(micros).unwrap_or(u32::MAX));
                }
                self.commanded[place.vehicle] = true;
            }
            _ => {}
        }
    }

    /// What was measured; `None` when an AGV is tested.
    pub fn result(&self) -> Option<FleetResult> {
        if self.states.is_empty() {
            return None;
        }
        Some(FleetResult {
            vehicles: self.states.len(),
            commanded: self.commanded.iter().filter(|commanded| **commanded).count(),
            reaction: ReactionTimes::of(&self.times),
        })
    }
}
