//! Whether something else than driving may have changed the position of a vehicle.

use tck_base::clock::Moment;

use crate::members::{actions, elements, text};
use crate::observation::Observation;
use crate::orders::sets_position;
use crate::topic::Topic;

/// How many actions of an order are looked at.
const ACTIONS: usize = 1024;

/// When a person, a hook, a new connection or another localization last had a hand in the position.
#[derive(Debug, Default)]
pub struct Displaced {
    last: Option<(Moment, u64)>,
}

impl Displaced {
    /// Whether it is this record that may have changed the position.
    #[must_use]
    pub fn now(&self, record: &Observation<'_>) -> bool {
        self.last.is_some_and(|(_, seq)| seq == record.seq())
    }

    /// When that was last.
    #[must_use]
    pub fn last(&self) -> Option<Moment> {
        self.last.map(|(at, _)| at)
    }
}

fn places(record: &Observation<'_>) -> bool {
    let told = record
        .to_vehicle(Topic::InstantActions)
        .is_some_and(|message| actions(message).any(|action| sets_position(text(action, "actionType"))));
    let placed = record.to_vehicle(Topic::Order).is_some_and(|order| {
        let mut all = elements(order, "nodes")
            .flat_map(|node| elements(node, "actions"))
            .take(ACTIONS);
        all.any(|action| sets_position(text(action, "actionType")))
    });
    told || placed
}

impl Displaced {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>) {
        if record.connects() || record.outside_influence() || places(record) {
            self.last = Some((record.at().moment, record.seq()));
        }
    }
}
