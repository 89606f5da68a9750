//! Orders and their updates, one after the other: what may change and what must stay.

use std::collections::{BTreeMap, VecDeque};

use serde_json::Value;

use super::graph::is_counted;
use super::sheet::grace;
use super::vehicle::{Outside, Vehicle};
use super::{Command, ELEMENTS, Found, content, fingerprint, in_sequence, released, short};
use crate::orders::number;
use crate::traffic::{Traffic, elements, quote, text};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::Entry;
use tck_journal::event::Event;

/// `commands/updates`.
pub(crate) const UPDATES: Check = Check {
    name: "commands/updates",
    decides: &["ORD-UPD-03", "ORD-UPD-04", "ORD-UPD-05", "ORD-UPD-06", "ORD-UPD-12"],
    doc: "An update keeps the orderId, raises orderUpdateId, begins with the last released node as it was sent before \
          and repeats nothing else of the base. Steps larger than one, and a stitching node that has lost actions or \
          optional values, are warnings. A message that is sent again unchanged is no update. Where the vehicle has \
          not taken an update over, the next one may begin where the one before did; where it has refused it, another \
          beginning at the end of the refused one is a warning.",
    arguments: &[],
    start: |_| Box::new(Follow::new(Focus::Updates)),
};

/// `commands/order-ids`.
pub(crate) const ORDER_IDS: Check = Check {
    name: "commands/order-ids",
    decides: &["ORD-MSG-02"],
    doc: "An orderId is not used for another order. When it comes back ten minutes or more after it was used last, it is \
          a warning.",
    arguments: &[],
    start: |_| Box::new(Follow::new(Focus::Ids)),
};

/// `commands/resent`.
pub(crate) const RESENT: Check = Check {
    name: "commands/resent",
    decides: &["ORD-REJ-18"],
    doc: "An order that comes again under the same orderUpdateId is the same but for headerId and timestamp; if not, it \
          is a warning here and breaks ORD-UPD-04.",
    arguments: &[],
    start: |_| Box::new(Follow::new(Focus::Resent)),
};

/// How many orders and how many messages of each are remembered.
const ORDERS: usize = 128;
const MESSAGES: usize = 64;
/// An orderId that comes back after this time may have been forgotten by everybody, in seconds.
const LONG_AGO: u64 = 600;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Focus {
    Updates,
    Ids,
    Resent,
}

/// The last released node of a message.
#[derive(Clone, Debug)]
struct End {
    id: String,
    sequence: u64,
    node: Value,
}

/// One message of an order.
#[derive(Debug)]
struct Sent {
    update: u64,
    print: u64,
    end: Option<End>,
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
    /// The same, and nobody has done anything to the vehicle meanwhile.
    ended: bool,
}

struct Follow {
    focus: Focus,
    traffic: Traffic,
    vehicle: Vehicle,
    /// Oldest first; the one sent last is at the end.
    orders: VecDeque<Order>,
    /// The order the vehicle had when it went away; it counts again when a state shows it unchanged.
    parked: Option<Order>,
    /// Numbers and contents of what was sent before the link was disturbed, by orderId.
    numbers: BTreeMap<String, Vec<(u64, u64)>>,
}

/// The released elements of a message: sequenceId and id.
fn base(order: &Value) -> impl Iterator<Item = (u64, String)> {
    [("nodes", "nodeId"), ("edges", "edgeId")]
        .into_iter()
        .flat_map(move |(list, id)| {
            let all = elements(order, list).take(ELEMENTS);
            let base = all.filter(|element| released(element) == Some(true));
            base.filter_map(move |element| Some((number(element, "sequenceId")?, short(element, id)?)))
        })
}

fn end(order: &Value) -> Option<End> {
    let nodes = in_sequence(order, "nodes");
    let last = nodes.into_iter().rfind(|node| released(node) == Some(true))?;
    Some(End {
        id: short(last, "nodeId")?,
        sequence: number(last, "sequenceId")?,
        node: last.clone(),
    })
}

impl Order {
    fn begin(id: String, message: &Value, update: u64, now: Moment) -> Self {
        let mut order = Self {
            id,
            sent: VecDeque::new(),
            base: BTreeMap::new(),
            last_used: now,
            done: false,
            ended: false,
        };
        order.take(message, update, now);
        order
    }

    fn take(&mut self, message: &Value, update: u64, now: Moment) {
        if self.sent.len() == MESSAGES {
            self.sent.pop_front();
        }
        let counted = is_counted(message);
        self.sent.push_back(Sent {
            update,
            print: content(message),
            end: end(message).filter(|_| counted),
        });
        for (sequence, id) in base(message).filter(|_| counted) {
            if self.base.len() < ELEMENTS {
                self.base.insert(sequence, id);
            }
        }
        self.last_used = now;
        self.done = false;
        self.ended = false;
    }

    fn newest(&self) -> Option<u64> {
        self.sent.back().map(|sent| sent.update)
    }
}

impl Follow {
    fn new(focus: Focus) -> Self {
        Self {
            focus,
            traffic: Traffic::default(),
            vehicle: Vehicle::default(),
            orders: VecDeque::new(),
            parked: None,
            numbers: BTreeMap::new(),
        }
    }

    /// The vehicle is back, and says that it has the order it had: so where an update begins is known.
    fn taken_up_again(&mut self) {
        let Some(seen) = self.vehicle.last() else { return };
        let Some(parked) = self.parked.take_if(|_| self.orders.is_empty()) else {
            self.parked = None;
            return;
        };
        if !seen.is_idle() && seen.order == parked.id && Some(seen.update) == parked.newest() {
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
    fn falls_back(&self, message: &Value, id: &str, update: u64, found: &mut Found<'_>) -> bool {
        let Some(known) = self.numbers.get(id).filter(|_| self.focus == Focus::Updates) else {
            return false;
        };
        let print = content(message);
        let again = known.contains(&(update, print));
        let first = in_sequence(message, "nodes")
            .first()
            .and_then(|node| number(node, "sequenceId"));
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

    fn message(&mut self, message: &Value, entry: &Entry, context: &CheckContext<'_>, found: &mut Found<'_>) -> bool {
        let (Some(id), Some(update)) = (short(message, "orderId"), number(message, "orderUpdateId")) else {
            return false;
        };
        let now = entry.at().moment;
        let Some(at) = self.orders.iter().position(|order| order.id == id) else {
            let judged = self.falls_back(message, &id, update, found) || self.unknown(message, &id, found);
            if self.orders.len() == ORDERS {
                self.orders.pop_front();
            }
            self.orders.push_back(Order::begin(id, message, update, now));
            return judged;
        };
        let print = content(message);
        if self.orders[at]
            .sent
            .iter()
            .any(|sent| sent.update == update && sent.print == print)
        {
            return self.focus == Focus::Resent;
        }
        let is_newest = at + 1 == self.orders.len();
        // Taken out, and put back as the newest.
        let Some(mut order) = self.orders.remove(at) else {
            return false;
        };
        let first = in_sequence(message, "nodes")
            .first()
            .and_then(|node| number(node, "sequenceId"));
        let behind_its_end = order.ended
            && order
                .sent
                .back()
                .and_then(|sent| sent.end.as_ref())
                .is_some_and(|end| end.sequence > 0);
        let starts_anew = first == Some(0) && (update == 0 || Some(update) <= order.newest() || behind_its_end);
        let judged = if (order.done || !is_newest) && starts_anew {
            self.reused(&order, now, found);
            order = Order::begin(id, message, update, now);
            self.focus == Focus::Ids
        } else {
            // An order that is taken up again after another one is not known well enough.
            let judged = is_newest && self.update(&order, message, update, entry, context, found);
            order.take(message, update, now);
            judged
        };
        self.orders.push_back(order);
        judged
    }

    /// An orderId nobody has seen yet.
    fn unknown(&self, message: &Value, id: &str, found: &mut Found<'_>) -> bool {
        let Some(before) = self.orders.back() else { return false };
        match self.focus {
            Focus::Ids => true,
            Focus::Updates => {
                let end = before.sent.back().and_then(|sent| sent.end.as_ref());
                let first = in_sequence(message, "nodes").into_iter().next();
                let (Some(end), Some(first)) = (end, first) else {
                    return false;
                };
                let continues = end.sequence > 0
                    && number(first, "sequenceId") == Some(end.sequence)
                    && text(first, "nodeId") == end.id
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
            Focus::Resent => false,
        }
    }

    fn reused(&self, order: &Order, now: Moment, found: &mut Found<'_>) {
        if self.focus != Focus::Ids {
            return;
        }
        let text = format!("orderId {} is used for another order", quote(&order.id));
        if now.since(order.last_used).as_secs() >= LONG_AGO {
            found.remark("ORD-MSG-02", text);
        } else {
            found.broken("ORD-MSG-02", text);
        }
    }

    fn update(
        &self,
        order: &Order,
        message: &Value,
        update: u64,
        entry: &Entry,
        context: &CheckContext<'_>,
        found: &mut Found<'_>,
    ) -> bool {
        let newest = order.newest().unwrap_or_default();
        let again = order.sent.iter().any(|sent| sent.update == update);
        if self.focus == Focus::Resent {
            if again {
                found.remark(
                    "ORD-REJ-18",
                    format!("orderUpdateId {update} comes again with other content"),
                );
            }
            return again;
        }
        if self.focus == Focus::Ids {
            return true;
        }
        if again {
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
        let Some(first) = in_sequence(message, "nodes").into_iter().next() else {
            return true;
        };
        counted_back(message, first, found);
        // An update that the vehicle has not taken over may be replaced by one that begins where it began.
        let confirmed = self
            .vehicle
            .recent(entry, context)
            .filter(|seen| seen.order == order.id)
            .map(|seen| seen.update)
            .min()
            .unwrap_or_default();
        let sequence = number(first, "sequenceId");
        let is_end = |end: &&End| Some(end.sequence) == sequence && text(first, "nodeId") == end.id;
        // The end of an update that was refused is nowhere on the vehicle.
        let refused =
            |sent: &Sent| sent.update > confirmed && self.knows_refused(&order.id, sent.update, entry, context);
        let candidates = order
            .sent
            .iter()
            .rev()
            .filter(|sent| (sent.update >= confirmed || sent.update == newest) && !refused(sent));
        let stitching = candidates.filter_map(|sent| sent.end.as_ref()).find(is_end);
        if let Some(end) = stitching {
            stitched(&end.node, first, found);
            return true;
        }
        // The last one that was sent, by the letter, and unknown to the vehicle: by a ruling a warning.
        let refused_end = order.sent.iter().rev().filter(|sent| refused(sent));
        if let Some(end) = refused_end.filter_map(|sent| sent.end.as_ref()).find(is_end) {
            let end = quote(&end.id);
            found.remark(
                "ORD-UPD-05",
                format!("the update begins at {end}, the end of an update that the vehicle has refused"),
            );
            return true;
        }
        let newest = order.sent.iter().rev().find(|sent| !refused(sent));
        if let Some(end) = newest.and_then(|sent| sent.end.as_ref()) {
            elsewhere(order, end, message, first, found);
        }
        true
    }

    /// Whether the master control could have known that the vehicle has refused this update.
    fn knows_refused(&self, order: &str, update: u64, entry: &Entry, context: &CheckContext<'_>) -> bool {
        let now = entry.at().moment;
        let states = self.vehicle.states.iter();
        let mut known = states.filter(|seen| seen.order == order && now.since(seen.at) >= grace(context));
        known.any(|seen| seen.update < update && seen.refused.contains(&update))
    }
}

/// An update that does not begin with the last released node.
fn elsewhere(order: &Order, end: &End, message: &Value, first: &Value, found: &mut Found<'_>) {
    let shown = quote(text(first, "nodeId"));
    let Some(sequence) = number(first, "sequenceId") else {
        return;
    };
    let wanted = format!("{} with sequenceId {}", quote(&end.id), end.sequence);
    let text_of = |what: &str| format!("the update begins with node {shown}, sequenceId {sequence}, {what} {wanted}");
    found.broken("ORD-UPD-05", text_of("and not with"));
    if text(first, "nodeId") == end.id {
        found.broken("ORD-UPD-12", text_of("which was"));
        return;
    }
    let repeats = base(message).any(|(sequence, _)| sequence < end.sequence && order.base.contains_key(&sequence));
    let replaces = sequence == end.sequence;
    if repeats || replaces {
        found.broken("ORD-UPD-03", text_of("though the base ended with"));
    }
}

/// Edges of an update that have numbers from before its first node, which other elements had already.
fn counted_back(message: &Value, first: &Value, found: &mut Found<'_>) {
    let (nodes, edges) = (in_sequence(message, "nodes"), in_sequence(message, "edges"));
    let Some(begins) = number(first, "sequenceId").filter(|_| nodes.len() == edges.len() + 1) else {
        return;
    };
    let back = edges
        .into_iter()
        .find_map(|edge| Some((edge, number(edge, "sequenceId").filter(|sequence| *sequence < begins)?)));
    if let Some((edge, sequence)) = back {
        let id = quote(text(edge, "edgeId"));
        let text = format!("edge {id} of an update that begins with sequenceId {begins} has sequenceId {sequence}");
        found.broken("ORD-UPD-12", text);
    }
}

/// A stitching node against its first transmission.
fn stitched(before: &Value, now: &Value, found: &mut Found<'_>) {
    let id = quote(text(now, "nodeId"));
    if released(now) != Some(true) {
        found.broken("ORD-UPD-06", format!("stitching node {id} is not released any more"));
    }
    let position = |node: &Value| {
        node.get("nodePosition")
            .filter(|position| position.is_object())
            .cloned()
    };
    match (position(before), position(now)) {
        (Some(before), Some(now)) => {
            for name in [
                "x",
                "y",
                "theta",
                "allowedDeviationXY",
                "allowedDeviationTheta",
                "mapId",
            ] {
                let (old, new) = (before.get(name), now.get(name));
                let differ = match (old.and_then(Value::as_f64), new.and_then(Value::as_f64)) {
                    (Some(old), Some(new)) => (old - new).abs() > 1.0e-6,
                    _ => old != new,
                };
                if !differ {
                    continue;
                }
                let text = format!("{name} of stitching node {id} has changed");
                if old.is_some() && new.is_some() {
                    found.broken("ORD-UPD-06", text);
                } else {
                    found.remark("ORD-UPD-06", text);
                }
            }
        }
        (None, None) => {}
        _ => found.remark(
            "ORD-UPD-06",
            format!("nodePosition of stitching node {id} came or went"),
        ),
    }
    let prints = |node: &Value| -> Vec<u64> {
        elements(node, "actions")
            .take(ELEMENTS)
            .map(|action| {
                let mut bare = action.clone();
                if let Some(members) = bare.as_object_mut() {
                    members.remove("actionDescription");
                }
                fingerprint(&bare)
            })
            .collect()
    };
    let (old, new) = (prints(before), prints(now));
    if new.iter().any(|action| !old.contains(action)) {
        found.broken(
            "ORD-UPD-06",
            format!("stitching node {id} has other actions than before"),
        );
    } else if old.iter().any(|action| !new.contains(action)) {
        found.remark("ORD-UPD-06", format!("stitching node {id} has lost actions"));
    }
}

impl Running for Follow {
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        self.traffic.note(entry);
        match self.vehicle.note(entry, context) {
            // What was sent may have been lost, or the vehicle has given its order up without a word.
            outside @ (Outside::Moved | Outside::Lost) => {
                for order in &mut self.orders {
                    order.done = true;
                }
                let link = matches!(entry.event(), Event::Fault { .. });
                if outside == Outside::Moved || !link {
                    self.numbers.clear();
                }
                if self.vehicle.states.is_empty() && self.focus != Focus::Ids {
                    if link {
                        self.interrupted();
                    }
                    match entry.event() {
                        Event::Vehicle { what, .. } if matches!(what.as_str(), "break-off" | "shutdown" | "start") => {
                            self.parked = self.orders.pop_back().or(self.parked.take());
                        }
                        _ => self.parked = None,
                    }
                    self.orders.clear();
                }
            }
            Outside::Deviates | Outside::No => {}
        }
        if self.parked.is_some() && super::said("state", entry, context).is_some() {
            self.taken_up_again();
        }
        if let Some(seen) = self
            .vehicle
            .last()
            .filter(|_| super::said("state", entry, context).is_some())
            && seen.is_idle()
            && let Some(order) = self.orders.back_mut()
            && order.id == seen.order
            && order.newest() <= Some(seen.update)
        {
            order.done = true;
            order.ended = true;
        }
        if self.traffic.disturbed {
            return false;
        }
        let order = Command::read(self.traffic, entry, context).and_then(Command::order);
        let Some(order) = order else { return false };
        self.message(order, entry, context, &mut Found::new(entry, findings))
    }
}
