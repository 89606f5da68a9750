//! New orders of a master control, and what a vehicle was told before each.

use std::collections::{BTreeMap, BTreeSet};

use tck_view::OrderView;

use crate::mock::MockVehicle;
use crate::observation::Observation;
use crate::ordered::{ELEMENTS, nodes_in_sequence, place_of, short};

/// How many ids are remembered.
const IDS: usize = 1024;

/// Which orders were begun, where their nodes are, and whether the one before was called off.
#[derive(Debug, Default)]
pub struct Starts {
    orders: BTreeSet<String>,
    /// Places of nodes, from the orders before the last one.
    places: BTreeMap<String, (f64, f64)>,
    /// Those of the last one.
    latest: Vec<(String, (f64, f64))>,
    /// Whether the order before was called off.
    cancelled: bool,
    /// The last record with an order, whether its orderId is a new one, and whether the order before it was called off.
    order: Option<(u64, bool, bool)>,
}

impl Starts {
    /// Whether this record is an order under an orderId that has not come before.
    #[must_use]
    pub fn is_new(&self, record: &Observation<'_>) -> bool {
        self.order.is_some_and(|(seq, is_new, _)| is_new && seq == record.seq())
    }

    /// Whether the order before this one was called off.
    #[must_use]
    pub fn is_behind_cancellation(&self, record: &Observation<'_>) -> bool {
        self.order
            .is_some_and(|(seq, _, cancelled)| cancelled && seq == record.seq())
    }

    /// Where the orders before the last one put a node.
    #[must_use]
    pub fn place(&self, node: &str) -> Option<(f64, f64)> {
        self.places.get(node).copied()
    }
}

impl Starts {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>, vehicle: &MockVehicle) {
        if vehicle.is_lost(record) {
            self.cancelled = false;
        }
        if let Some(message) = record.instant_actions() {
            let mut actions = message.commanded().take(ELEMENTS);
            self.cancelled |= actions.any(|action| action.action_type.is("cancelOrder"));
        }
        if let Some(order) = record.order()
            && let Some(id) = short(&order.order_id)
        {
            self.begins(id, order, record.seq());
        }
    }
}

impl Starts {
    fn begins(&mut self, id: String, order: &OrderView, seq: u64) {
        for (node, place) in self.latest.drain(..) {
            if self.places.len() < IDS || self.places.contains_key(&node) {
                self.places.insert(node, place);
            }
        }
        if self.orders.len() == IDS {
            self.orders.pop_first();
        }
        let is_new = self.orders.insert(id);
        self.order = Some((seq, is_new, self.cancelled));
        let nodes = nodes_in_sequence(order);
        let begins = order.order_update_id.whole().is_none_or(|update| update == 0);
        if is_new && begins && !nodes.is_empty() {
            self.cancelled = false;
        }
        let places = nodes.into_iter().filter_map(|node| {
            let (x, y, _) = place_of(node)?;
            Some((short(&node.node_id)?, (x, y)))
        });
        self.latest = places.collect();
    }
}
