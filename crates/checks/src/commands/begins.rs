//! How an order begins: with a node that is released, and with orderUpdateId 0.

use std::collections::BTreeSet;

use super::{Command, Found, nodes_in_sequence, short};
use crate::finding::quote;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Node, OrderView};
use tck_world::{Listen, Observation, Topic};

/// `commands/begins`.
pub(crate) const BEGINS: Check = Check {
    name: "commands/begins",
    decides: &["ORD-14", "ORD-UPD-14"],
    doc: "The first message of an orderId has orderUpdateId 0, and its node with sequenceId 0 is released. An orderId whose \
          first message may have got lost is not judged.",
    arguments: &[],
    listens: &[Listen::Fault, Listen::Hook, Listen::Delivered(Topic::Order)],
    reads: &[],
    needs: &[OrderView::order_id, OrderView::order_update_id, Node::released],
    start: |_| Box::new(Begins::default()),
};

/// How many orderIds are remembered.
const KEPT: usize = 4096;

#[derive(Default)]
struct Begins {
    /// orderIds that have come.
    known: BTreeSet<String>,
}

impl Running for Begins {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(order) = Command::read(record).and_then(Command::order) else {
            return false;
        };
        let Some(id) = short(&order.order_id) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let first = nodes_in_sequence(order)
            .into_iter()
            .find(|node| node.sequence_id.whole() == Some(0));
        if first.is_some_and(|node| node.released.is(false)) {
            found.broken(
                "ORD-14",
                format!("the first node of order {} is not released", quote(&id)),
            );
        }
        let is_new = !self.known.contains(&id);
        if self.known.len() < KEPT {
            self.known.insert(id.clone());
        }
        if !is_new || record.link.disturbed {
            return first.is_some();
        }
        if let Some(update) = order.order_update_id.whole().filter(|update| *update > 0) {
            let text = format!("order {} begins with orderUpdateId {update}", quote(&id));
            found.broken("ORD-UPD-14", text);
        }
        true
    }
}
