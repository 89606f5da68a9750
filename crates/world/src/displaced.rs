//! Whether something else than driving may have changed the position of a vehicle.

use tck_base::clock::Moment;

use crate::observation::Observation;
use crate::orders::sets_position;
use crate::restarts::Restarts;
use tck_view::ActionView;

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
    let places = |action: &ActionView| sets_position(action.action_type.or_empty());
    let told = record
        .instant_actions_to_vehicle()
        .is_some_and(|message| message.all_actions().any(places));
    let placed = record.order_to_vehicle().is_some_and(|order| {
        let all = order.nodes.iter().flat_map(|node| node.actions.iter());
        all.take(ACTIONS).any(places)
    });
    told || placed
}

impl Displaced {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, restarts: &Restarts) {
        if restarts.connects(record) || record.outside_influence() || places(record) {
            self.last = Some((record.at().moment, record.seq()));
        }
    }
}
