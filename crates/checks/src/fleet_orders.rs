//! `fleet/own-orders`: an order goes on where it was begun.

use std::collections::BTreeSet;

use crate::finding::{broken, quote};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_view::OrderView;
use tck_world::{Listen, Observation, Topic};

/// An order goes on where it was begun.
pub(super) const OWN_ORDERS: Check = Check {
    name: "fleet/own-orders",
    decides: &["TOPIC-13"],
    doc: "An update that goes on behind the first node of its order comes to the vehicle that was given the order. Not \
          judged for an order both vehicles were given, and not where the order may have been lost on the way.",
    arguments: &[],
    listens: &[Listen::Begin, Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[OrderView::order_id, OrderView::order_update_id],
    start: |_| Box::new(OwnOrders::default()),
};

/// How many orders are remembered.
const ORDERS: usize = 4096;

#[derive(Default)]
struct OwnOrders {
    /// Where the vehicle stands in the fleet.
    place: Option<usize>,
    own: BTreeSet<String>,
}

impl Running for OwnOrders {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if let Event::RunBegun { header } = record.event() {
            let mut all = header.vehicles.iter();
            self.place =
                all.position(|one| (one.manufacturer.as_str(), one.serial_number.as_str()) == context.identity);
        }
        let order = record.order().filter(|_| !record.link.disturbed);
        let Some((order, place)) = order.zip(self.place) else {
            return false;
        };
        let id = order.order_id.or_empty();
        let first = order.nodes.iter().filter_map(|node| node.sequence_id.whole()).min();
        let goes_on = order.order_update_id.whole() > Some(0) && first > Some(0);
        let known = self.own.contains(id);
        let owner = context.world.fleet().borrow().owner(id);
        if goes_on && !known && owner.is_some_and(|owner| owner != place) {
            let text = format!(
                "an update of order {} comes, which another vehicle was given",
                quote(id)
            );
            findings.push(broken("TOPIC-13", record.seq(), text));
        }
        if self.own.len() < ORDERS && !goes_on {
            self.own.insert(id.to_owned());
        }
        goes_on
    }
}
