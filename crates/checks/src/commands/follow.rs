//! Orders and their updates, one after the other: what may change and what must stay.

use std::collections::{BTreeMap, VecDeque};

use super::graph::is_counted;
use super::stitching::{base, counted_back, elsewhere, stitched};
use super::{Command, Found, nodes_in_sequence, short};
use crate::finding::quote;
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::event::Event;
use tck_profile::{VehicleEffect, find_vehicle_word};
use tck_view::{Node, OrderView, Print};
use tck_world::ordered::ELEMENTS;
use tck_world::{Fact, Listen, Observation, Outside, ShownState, Topic};

/// `commands/updates`.
pub(crate) const UPDATES: Check = Check {
    name: "commands/updates",
    decides: &[
        "ORD-UPD-03",
        "ORD-UPD-04",
        "ORD-UPD-05",
        "ORD-UPD-06",
        "ORD-UPD-12",
        "ORD-UPD-15",
    ],
    doc: "An update keeps the orderId, raises orderUpdateId, begins with the last released node as it was sent before \
          and repeats nothing else of the base. Steps larger than one, and a stitching node that has lost actions or \
          optional values, are warnings. A message that is sent again unchanged is no update. Where the vehicle has \
          not taken an update over, the next one may begin where the one before did; where it has refused it, another \
          beginning at the end of the refused one is a warning.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
    ],
    reads: &[Fact::Mock],
    needs: &[OrderView::order_id, OrderView::order_update_id],
    start: |_| Box::new(Part { focus: Focus::Updates }),
};

/// `commands/order-ids`.
pub(crate) const ORDER_IDS: Check = Check {
    name: "commands/order-ids",
    decides: &["ORD-MSG-02"],
    doc: "An orderId is not used for another order. When it comes back ten minutes or more after it was used last, it is \
          a warning.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
    ],
    reads: &[Fact::Mock],
    needs: &[OrderView::order_id, OrderView::order_update_id],
    start: |_| Box::new(Part { focus: Focus::Ids }),
};

/// `commands/resent`.
pub(crate) const RESENT: Check = Check {
    name: "commands/resent",
    decides: &["ORD-REJ-18"],
    doc: "An order that comes again under the same orderUpdateId is the same but for headerId and timestamp; if not, it \
          is a warning here and breaks ORD-UPD-04.",
    arguments: &[],
    listens: &[
        Listen::Vehicle,
        Listen::Fault,
        Listen::Hook,
        Listen::Sent(Topic::State),
        Listen::Delivered(Topic::Order),
    ],
    reads: &[Fact::Mock],
    needs: &[OrderView::order_id, OrderView::order_update_id],
    start: |_| Box::new(Part { focus: Focus::Resent }),
};

/// How many orders and how many messages of each are remembered.
const ORDERS: usize = 128;
const MESSAGES: usize = 64;
/// An orderId that comes back after this time may have been forgotten by everybody, in seconds.
const LONG_AGO: u64 = 600;

/// Which of the three checks looks.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Focus {
    Updates,
    Ids,
    Resent,
}

/// What a message shows one of the checks: whether there was something to judge, and what was found.
#[derive(Debug, Default)]
struct Shown {
    judged: bool,
    findings: Vec<CheckFinding>,
}

/// What a message shows each of them.
#[derive(Debug, Default)]
struct Told {
    updates: Shown,
    ids: Shown,
    resent: Shown,
}

/// Orders are followed once for all checks of the same records: where they go on, and which ids were used.
#[derive(Debug, Default)]
struct Followed {
    /// The newest record that was followed, and what it shows.
    newest: Option<u64>,
    told: Told,
    orders: Follow,
}

/// An orderId stays used when the link is disturbed: these orders are kept over that.
#[derive(Debug, Default)]
struct Used {
    newest: Option<u64>,
    told: Told,
    orders: Follow,
}

/// One of the checks.
struct Part {
    focus: Focus,
}

impl Running for Part {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let follow = |newest: &mut Option<u64>, told: &mut Told, orders: &mut Follow, keeps: bool| {
            if newest.replace(record.seq()) != Some(record.seq()) {
                *told = orders.follow(record, context, keeps);
            }
        };
        let mut take = |shown: &Shown| {
            findings.extend(shown.findings.iter().cloned());
            shown.judged
        };
        if self.focus == Focus::Ids {
            let used = context.shared.of::<Used>();
            let Used { newest, told, orders } = &mut *used.borrow_mut();
            follow(newest, told, orders, true);
            return take(&told.ids);
        }
        let followed = context.shared.of::<Followed>();
        let Followed { newest, told, orders } = &mut *followed.borrow_mut();
        follow(newest, told, orders, false);
        match self.focus {
            Focus::Updates => take(&told.updates),
            _ => take(&told.resent),
        }
    }
}

/// The last released node of a message.
#[derive(Clone, Debug)]
struct BaseEnd {
    id: String,
    sequence: u64,
    node: Node,
}

/// One message of an order.
#[derive(Debug)]
struct Sent {
    update: u64,
    print: Option<Print>,
    end: Option<BaseEnd>,
}

#[derive(Debug)]
struct Order {
    id: String,
    sent: VecDeque<Sent>,
    /// Ids of all released elements by sequenceId; bounded.
    base: BTreeMap<u64, String>,
    last_used: Moment,
    /// Whether a state has shown that nothing is left of it.
    done: bool,
    /// Whether a state has shown that nothing is left of it, and nobody has done anything to the vehicle meanwhile.
    ended: bool,
}

/// The orders of a master control and their updates, one after the other.
#[derive(Debug, Default)]
struct Follow {
    /// Oldest first; the one sent last is at the end.
    orders: VecDeque<Order>,
    /// The order the vehicle had when it went away; it counts again when a state shows it unchanged.
    parked: Option<Order>,
    /// Numbers and contents of what was sent before the link was disturbed, by orderId.
    numbers: BTreeMap<String, Vec<(u64, Option<Print>)>>,
}

fn end(order: &OrderView) -> Option<BaseEnd> {
    let nodes = nodes_in_sequence(order);
    let last = nodes.into_iter().rfind(|node| node.released.is(true))?;
    Some(BaseEnd {
        id: short(&last.node_id)?,
        sequence: last.sequence_id.whole()?,
        node: last.clone(),
    })
}

impl Order {
    fn begin(id: String, message: &OrderView, update: u64, record: &Observation<'_>) -> Self {
        let mut order = Self {
            id,
            sent: VecDeque::new(),
            base: BTreeMap::new(),
            last_used: record.at().moment,
            done: false,
            ended: false,
        };
        order.take(message, update, record);
        order
    }

    fn take(&mut self, message: &OrderView, update: u64, record: &Observation<'_>) {
        if self.sent.len() == MESSAGES {
            self.sent.pop_front();
        }
        let counted = is_counted(message);
        self.sent.push_back(Sent {
            update,
            print: record.content(),
            end: end(message).filter(|_| counted),
        });
        for (sequence, id) in base(message).filter(|_| counted) {
            if self.base.len() < ELEMENTS {
                self.base.insert(sequence, id);
            }
        }
        self.last_used = record.at().moment;
        self.done = false;
        self.ended = false;
    }

    fn newest(&self) -> Option<u64> {
        self.sent.back().map(|sent| sent.update)
    }

    /// Whether a message with this orderUpdateId was sent.
    fn has(&self, update: u64) -> bool {
        self.sent.iter().any(|sent| sent.update == update)
    }
}

impl Follow {
    /// The vehicle is back, and says that it has the order it had: so where an update begins is known.
    fn taken_up_again(&mut self, shown: Option<&ShownState>) {
        let Some(shown) = shown else { return };
        let Some(parked) = self.parked.take_if(|_| self.orders.is_empty()) else {
            self.parked = None;
            return;
        };
        if !shown.is_idle() && shown.order == parked.id && Some(shown.update) == parked.newest() {
            self.orders.push_back(Order { done: false, ..parked });
        }
    }

    /// The link is disturbed: where orders go on is not known any more, but numbers that were given are.
    fn interrupted(&mut self) {
        for order in self.orders.drain(..) {
            if self.numbers.len() == ORDERS {
                self.numbers.pop_first();
            }
            let known = self.numbers.entry(order.id).or_default();
            known.extend(order.sent.iter().map(|sent| (sent.update, sent.print)));
            known.truncate(MESSAGES);
        }
    }

    /// An order that goes on behind a disturbance with a number that was given before.
    fn falls_back(
        &self,
        message: &OrderView,
        id: &str,
        update: u64,
        record: &Observation<'_>,
        found: &mut Found<'_>,
    ) -> bool {
        let Some(known) = self.numbers.get(id) else {
            return false;
        };
        let again = known.contains(&(update, record.content()));
        let first = nodes_in_sequence(message)
            .first()
            .and_then(|node| node.sequence_id.whole());
        let newest = known.iter().map(|(update, _)| *update).max().unwrap_or_default();
        if again || first.is_none_or(|first| first == 0) {
            return false;
        }
        if update <= newest {
            let text = format!("orderUpdateId {update} comes behind the lost link, and was at {newest} before");
            found.broken("ORD-UPD-04", text);
        }
        true
    }

    fn message(&mut self, message: &OrderView, record: &Observation<'_>, context: &CheckContext<'_>) -> Told {
        let mut told = Told::default();
        let (Some(id), Some(update)) = (short(&message.order_id), message.order_update_id.whole()) else {
            return told;
        };
        let Some(at) = self.orders.iter().position(|order| order.id == id) else {
            let mut found = Found::new(record, &mut told.updates.findings);
            told.updates.judged =
                self.falls_back(message, &id, update, record, &mut found) || self.continues(message, &id, &mut found);
            told.ids.judged = !self.orders.is_empty();
            if self.orders.len() == ORDERS {
                self.orders.pop_front();
            }
            self.orders.push_back(Order::begin(id, message, update, record));
            return told;
        };
        let print = record.content();
        if self.orders[at]
            .sent
            .iter()
            .any(|sent| sent.update == update && sent.print == print)
        {
            told.resent.judged = true;
            return told;
        }
        let is_newest = at + 1 == self.orders.len();
        // Taken out, and put back as the newest.
        let Some(mut order) = self.orders.remove(at) else {
            return told;
        };
        let first = nodes_in_sequence(message)
            .first()
            .and_then(|node| node.sequence_id.whole());
        let behind_its_end = order.ended
            && order
                .sent
                .back()
                .and_then(|sent| sent.end.as_ref())
                .is_some_and(|end| end.sequence > 0);
        let starts_anew = first == Some(0) && (update == 0 || Some(update) <= order.newest() || behind_its_end);
        if (order.done || !is_newest) && starts_anew {
            reused(&order, record, &mut Found::new(record, &mut told.ids.findings));
            order = Order::begin(id, message, update, record);
            told.ids.judged = true;
        } else {
            // An order that is taken up again after another one is not known well enough.
            if is_newest {
                told.ids.judged = true;
                told.resent.judged = resent(&order, update, &mut Found::new(record, &mut told.resent.findings));
                told.updates.judged = true;
                let mut found = Found::new(record, &mut told.updates.findings);
                updated(&order, message, update, record, context, &mut found);
            }
            order.take(message, update, record);
        }
        self.orders.push_back(order);
        told
    }

    /// An orderId nobody has seen yet, with which the order before goes on.
    fn continues(&self, message: &OrderView, id: &str, found: &mut Found<'_>) -> bool {
        let Some(before) = self.orders.back() else { return false };
        let end = before.sent.back().and_then(|sent| sent.end.as_ref());
        let first = nodes_in_sequence(message).into_iter().next();
        let (Some(end), Some(first)) = (end, first) else {
            return false;
        };
        let continues = end.sequence > 0
            && first.sequence_id.whole() == Some(end.sequence)
            && first.node_id.or_empty() == end.id
            && !before.done;
        if continues {
            let (old, new) = (quote(&before.id), quote(id));
            found.broken(
                "ORD-UPD-04",
                format!("order {new} continues order {old} under another orderId"),
            );
        }
        continues
    }

    /// Learns from a record; gives back what it shows.
    fn follow(&mut self, record: &Observation<'_>, context: &CheckContext<'_>, keeps: bool) -> Told {
        let vehicle = context.world.mock();
        let is_state = record.said_state().is_some();
        if vehicle.is_lost(record) {
            self.lost(vehicle.now(record), record, keeps);
        }
        if self.parked.is_some() && is_state {
            self.taken_up_again(vehicle.last());
        }
        if let Some(shown) = vehicle.last().filter(|shown| is_state && shown.is_idle())
            && let Some(order) = self.orders.back_mut()
            && order.id == shown.order
            && order.newest() <= Some(shown.update)
        {
            order.done = true;
            order.ended = true;
        }
        if record.link.disturbed {
            return Told::default();
        }
        match Command::read(record).and_then(Command::order) {
            Some(order) => self.message(order, record, context),
            None => Told::default(),
        }
    }

    /// What was sent may have been lost, or the vehicle has given its order up without a word.
    fn lost(&mut self, outside: Outside, record: &Observation<'_>, keeps: bool) {
        for order in &mut self.orders {
            order.done = true;
        }
        let link = matches!(record.event(), Event::Fault { .. });
        if outside == Outside::Moved || !link {
            self.numbers.clear();
        }
        if keeps {
            return;
        }
        if link {
            self.interrupted();
        }
        match record.event() {
            Event::Vehicle { what, .. }
                if find_vehicle_word(what).is_some_and(|word| word.has(VehicleEffect::ComesOrGoes)) =>
            {
                self.parked = self.orders.pop_back().or(self.parked.take());
            }
            _ => self.parked = None,
        }
        self.orders.clear();
    }
}

/// An update of the order that was sent last.
fn updated(
    order: &Order,
    message: &OrderView,
    update: u64,
    record: &Observation<'_>,
    context: &CheckContext<'_>,
    found: &mut Found<'_>,
) {
    let newest = order.newest().unwrap_or_default();
    if order.has(update) {
        found.broken(
            "ORD-UPD-04",
            format!("orderUpdateId {update} comes again with other content"),
        );
    } else if update < newest {
        found.broken("ORD-UPD-04", format!("orderUpdateId {update} comes after {newest}"));
    } else if update > newest + 1 {
        found.remark(
            "ORD-UPD-04",
            format!("orderUpdateId {update} comes directly after {newest}"),
        );
    }
    let Some(first) = nodes_in_sequence(message).into_iter().next() else {
        return;
    };
    counted_back(message, first, found);
    // An update that the vehicle has not taken over may be replaced by one that begins where it began.
    let vehicle = context.world.mock();
    let confirmed = vehicle
        .recent(record, context)
        .filter(|shown| shown.order == order.id)
        .map(|shown| shown.update)
        .min()
        .unwrap_or_default();
    let sequence = first.sequence_id.whole();
    let is_end = |end: &&BaseEnd| Some(end.sequence) == sequence && first.node_id.or_empty() == end.id;
    // The end of an update that was refused is nowhere on the vehicle.
    let refused = |sent: &Sent| sent.update > confirmed && knows_refused(&order.id, sent.update, record, context);
    let candidates = order
        .sent
        .iter()
        .rev()
        .filter(|sent| (sent.update >= confirmed || sent.update == newest) && !refused(sent));
    let stitching = candidates.filter_map(|sent| sent.end.as_ref()).find(is_end);
    if let Some(end) = stitching {
        stitched(&end.node, first, context.pack.has("strictUpdates"), found);
        return;
    }
    // The last one that was sent, by the letter, and unknown to the vehicle: by a ruling a warning.
    let refused_end = order.sent.iter().rev().filter(|sent| refused(sent));
    if let Some(end) = refused_end.filter_map(|sent| sent.end.as_ref()).find(is_end) {
        let end = quote(&end.id);
        found.remark(
            "ORD-UPD-05",
            format!("the update begins at {end}, the end of an update that the vehicle has refused"),
        );
        return;
    }
    let newest = order.sent.iter().rev().find(|sent| !refused(sent));
    if let Some(end) = newest.and_then(|sent| sent.end.as_ref()) {
        elsewhere(&order.base, (&end.id, end.sequence), message, first, found);
    }
}

/// An order that comes again under a number it has had.
fn resent(order: &Order, update: u64, found: &mut Found<'_>) -> bool {
    let again = order.has(update);
    if again {
        found.remark(
            "ORD-REJ-18",
            format!("orderUpdateId {update} comes again with other content"),
        );
    }
    again
}

/// An orderId that stands for another order.
fn reused(order: &Order, record: &Observation<'_>, found: &mut Found<'_>) {
    let text = format!("orderId {} is used for another order", quote(&order.id));
    if record.at().moment.since(order.last_used).as_secs() >= LONG_AGO {
        found.remark("ORD-MSG-02", text);
    } else {
        found.broken("ORD-MSG-02", text);
    }
}

/// Whether the master control could have known that the vehicle has refused this update.
fn knows_refused(order: &str, update: u64, record: &Observation<'_>, context: &CheckContext<'_>) -> bool {
    let now = record.at().moment;
    let states = context.world.mock().states();
    let mut known = states.filter(|shown| shown.order == order && now.since(shown.at) >= context.time.notice);
    known.any(|shown| shown.update < update && shown.refused.contains(&update))
}
