//! `commands/base-kept`: a base is given up only by cancelOrder.

use std::collections::BTreeSet;
use std::time::Duration;

use super::graph::is_counted;
use super::{Command, Found, elements, short};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{Node, OrderView, StateView};
use tck_world::{Fact, Listen, Observation, Outside, ShownState};

/// A base is given up only by cancelOrder.
pub(crate) const BASE_KEPT: Check = Check {
    name: "commands/base-kept",
    decides: &["ORD-CANCEL-01", "ORD-CANCEL-22"],
    doc: "While the states of the vehicle show released elements or a running action of an order, no other order is sent \
          to it and no update replaces them, unless cancelOrder has come before and the vehicle has reported it done or \
          shows nothing left of the order. Another order behind a cancelOrder that is not done, or beside nothing but a \
          running action, is a warning, and so is an update after cancelOrder, unless that has FAILED; where updates are strict it is more than that. A vehicle that may have given its order up by itself is not judged; where an \
          action has failed, what is left tells.",
    arguments: &[],
    listens: &[Listen::Everything],
    reads: &[Fact::Mock],
    needs: &[OrderView::order_id, Node::sequence_id, StateView::node_states],
    start: |_| Box::new(BaseKept::default()),
};

/// How many released elements and orders are remembered.
const KEPT: usize = 4096;
/// What was decided before cancelOrder may be sent behind it, within this time.
const CROSSING: Duration = Duration::from_millis(100);

#[derive(Default)]
struct BaseKept {
    /// The order sent last, its released elements by sequenceId, and whether the vehicle took it over.
    order: String,
    base: std::collections::BTreeMap<u64, String>,
    taken: bool,
    /// Orders that were sent before.
    before: BTreeSet<String>,
    /// actionIds of its released elements.
    actions: BTreeSet<String>,
    /// The highest orderUpdateId of it.
    newest: Option<u64>,
    /// The actionId of the last cancelOrder for it, and since when.
    cancel: Option<(String, Moment)>,
    /// Whether something may have ended the order without cancelOrder.
    free: bool,
}

impl BaseKept {
    /// Whether the vehicle has an order in hand that has not been called off.
    fn is_busy(&self, context: &CheckContext<'_>) -> bool {
        let Some(seen) = context.world.mock().last() else {
            return false;
        };
        if self.free || !self.taken || seen.order != self.order {
            return false;
        }
        match self.cancel.as_ref().and_then(|(id, _)| status(seen, id)) {
            Some("FINISHED" | "FAILED") => false,
            Some(_) => true,
            None => seen.base > 0 || self.is_at_work(seen),
        }
    }

    /// Whether an action of the order is listed and has not ended.
    fn is_at_work(&self, seen: &ShownState) -> bool {
        let mut open = seen.actions.iter().filter(|(_, status)| !is_over(status));
        open.any(|(id, _)| self.actions.contains(id))
    }

    /// An update of an order that was called off.
    fn continued(&self, update: u64, now: Moment, context: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
        let Some((id, since)) = &self.cancel else { return false };
        let seen = context.world.mock().last();
        let failed = context
            .world
            .mock()
            .states()
            .any(|seen| status(seen, id) == Some("FAILED"));
        // Where the vehicle never heard of cancelOrder, this is not the mistake to speak of.
        let heard = context.world.mock().states().any(|seen| status(seen, id).is_some());
        let taken = heard && self.taken && !self.free && seen.is_some_and(|seen| seen.order == self.order);
        if failed || !taken || self.newest.is_none_or(|newest| update <= newest) || now.since(*since) < CROSSING {
            return false;
        }
        let text = format!(
            "update {update} of order {} comes after cancelOrder",
            quote(&self.order)
        );
        if context.pack.has("strictUpdates") {
            found.broken("ORD-CANCEL-22", text);
        } else {
            found.remark("ORD-CANCEL-01", text);
        }
        true
    }

    fn forget(&mut self) {
        self.before.insert(std::mem::take(&mut self.order));
        self.base.clear();
        self.actions.clear();
        self.newest = None;
        self.cancel = None;
        self.taken = false;
        self.free = false;
        if self.before.len() > KEPT {
            self.before.pop_first();
        }
    }
}

impl Running for BaseKept {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        match context.world.mock().now(record) {
            Outside::No => {}
            Outside::Deviates => self.free = true,
            Outside::Moved | Outside::Lost => self.forget(),
        }
        if let Some(seen) = context.world.mock().last() {
            self.taken |= seen.order == self.order;
            self.free |= self.taken && seen.taken_out && self.cancel.is_none();
        }
        let command = Command::read(record);
        let Some(command) = command.filter(|_| !record.link.disturbed) else {
            return false;
        };
        let Command::Order(order) = command else {
            for (_, action) in command.actions() {
                if action.action_type.or_empty() == "cancelOrder" {
                    self.cancel = short(&action.action_id).map(|id| (id, record.at().moment));
                }
            }
            return false;
        };
        let Some(id) = short(&order.order_id) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let mut judged = false;
        if id != self.order {
            // An older order that comes again was not meant to replace anything.
            if self.before.contains(&id) {
                return false;
            }
            if self.is_busy(context) {
                let (new, old) = (quote(&id), quote(&self.order));
                let comes = format!("order {new} comes while order {old} is driven");
                let on_its_way = context.world.mock().last().is_some_and(|seen| seen.base > 0);
                match (self.cancel.is_some(), on_its_way) {
                    (true, _) => found.remark("ORD-CANCEL-01", format!("{comes}: cancelOrder is not done")),
                    (_, true) => found.broken("ORD-CANCEL-01", format!("{comes}: it was not called off")),
                    _ => found.remark("ORD-CANCEL-01", format!("{comes}: one of its actions has not ended")),
                }
                judged = true;
            }
            judged |= self.cancel.is_some();
            self.forget();
            self.order = id;
        } else if self.cancel.is_none() && self.is_busy(context) {
            judged = self.replaced(order, &mut found);
        } else if let Some(update) = order.order_update_id.whole() {
            judged = self.continued(update, record.at().moment, context, &mut found);
        }
        self.newest = self.newest.max(order.order_update_id.whole());
        for (_, action) in command.actions() {
            if let Some(id) = short(&action.action_id).filter(|_| self.actions.len() < KEPT) {
                self.actions.insert(id);
            }
        }
        let counted = is_counted(order);
        for (sequence, id) in released_elements(order).filter(|_| counted) {
            if self.base.len() < KEPT {
                self.base.insert(sequence, id);
            }
        }
        judged
    }
}

impl BaseKept {
    /// An update with other elements in the place of released ones.
    fn replaced(&self, order: &OrderView, found: &mut Found<'_>) -> bool {
        let other = released_elements(order).find_map(|(sequence, id)| {
            let known = self.base.get(&sequence).filter(|known| **known != id)?;
            Some((sequence, known, id))
        });
        let Some((sequence, known, id)) = other else {
            return false;
        };
        // Numbers that begin anew are another mistake.
        let first = order.nodes.iter().filter_map(|node| node.sequence_id.whole()).min();
        let restarted = first.is_some_and(|first| {
            self.base
                .keys()
                .next_back()
                .is_some_and(|last| first + 1 < *last && first == 0)
        });
        if restarted {
            return false;
        }
        let text = format!(
            "an update puts {} in the place of {}, sequenceId {sequence}",
            quote(&id),
            quote(known)
        );
        found.broken("ORD-CANCEL-01", text);
        true
    }
}

fn is_over(status: &str) -> bool {
    matches!(status, "FINISHED" | "FAILED")
}

/// How far an action is.
fn status<'s>(seen: &'s ShownState, id: &str) -> Option<&'s str> {
    let mut all = seen.actions.iter();
    all.find(|(action, _)| action == id).map(|(_, status)| status.as_str())
}

fn released_elements(order: &OrderView) -> impl Iterator<Item = (u64, String)> {
    let base = elements(order).filter(|element| element.released().is(true));
    base.filter_map(|element| Some((element.sequence_id().whole()?, short(element.id())?)))
}
