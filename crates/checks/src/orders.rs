//! The orders that were sent to the vehicle, as far as checks of the state need them.
//!
//! Whether the vehicle took one over is read from its states by the checks.

use std::collections::VecDeque;

use serde_json::Value;

use super::traffic::{elements, is_to_vehicle, text, to_vehicle};
use tck_base::pattern::whole;
use tck_check::CheckContext;
use tck_journal::Entry;

/// How many order messages are kept, and how many elements each may have.
const MESSAGES: usize = 64;
const ELEMENTS: usize = 4096;

/// A node or edge of an order, or its state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub id: String,
    pub sequence: u64,
    pub released: bool,
}

impl Element {
    fn read(value: &Value, id: &str) -> Option<Self> {
        let id = value.get(id)?.as_str()?;
        let number = value.get("sequenceId")?;
        Some(Self {
            id: id.chars().take(512).collect(),
            sequence: whole(number)?,
            released: value.get("released")?.as_bool()?,
        })
    }
}

/// The elements of `list`; `None` when it is missing, too long, or one of them cannot be read.
pub(super) fn read_elements(message: &Value, list: &str, id: &str) -> Option<Vec<Element>> {
    let all = message.get(list)?.as_array()?;
    if all.len() > ELEMENTS {
        return None;
    }
    all.iter().map(|value| Element::read(value, id)).collect()
}

/// A whole number member of a message.
pub(super) fn number(message: &Value, name: &str) -> Option<u64> {
    whole(message.get(name)?)
}

/// blockingType.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Blocking {
    None,
    Soft,
    Hard,
}

impl Blocking {
    fn read(action: &Value) -> Option<Self> {
        match text(action, "blockingType") {
            "NONE" => Some(Self::None),
            "SOFT" => Some(Self::Soft),
            "HARD" => Some(Self::Hard),
            _ => None,
        }
    }
}

/// An action of an order and where it is to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Placed {
    pub action: String,
    /// actionType.
    pub kind: String,
    /// `None` for a type this version does not have.
    pub blocking: Option<Blocking>,
    /// sequenceId of its node or edge.
    pub sequence: u64,
    pub on_edge: bool,
}

/// The actions of all elements of `list`, bounded.
fn placed(message: &Value, list: &str, on_edge: bool) -> Vec<Placed> {
    let of_element = |element| {
        let sequence = number(element, "sequenceId");
        elements(element, "actions").filter_map(move |action| {
            Some(Placed {
                action: action.get("actionId")?.as_str()?.chars().take(512).collect(),
                kind: text(action, "actionType").chars().take(512).collect(),
                blocking: Blocking::read(action),
                sequence: sequence?,
                on_edge,
            })
        })
    };
    elements(message, list).flat_map(of_element).take(ELEMENTS).collect()
}

/// Whether an action of this type gives the vehicle a pose and a last node; later versions spell it out.
pub(super) fn sets_position(action_type: &str) -> bool {
    matches!(action_type, "initPosition" | "initializePosition")
}

/// One order message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct SentOrder {
    pub order: String,
    pub update: u64,
    pub nodes: Vec<Element>,
    pub edges: Vec<Element>,
    pub actions: Vec<Placed>,
    /// Whether an action of it puts the vehicle somewhere else.
    pub places: bool,
    /// Whether its graph is one that a vehicle may accept. Tests also send others, on purpose.
    pub sound: bool,
}

impl SentOrder {
    fn read(message: &Value) -> Option<Self> {
        let order = message.get("orderId")?.as_str()?;
        let update = number(message, "orderUpdateId")?;
        let nodes = read_elements(message, "nodes", "nodeId");
        let edges = read_elements(message, "edges", "edgeId");
        let sound = nodes.is_some() && edges.is_some();
        let mut sent = Self {
            order: order.chars().take(512).collect(),
            update,
            nodes: nodes.unwrap_or_default(),
            edges: edges.unwrap_or_default(),
            actions: [placed(message, "nodes", false), placed(message, "edges", true)].concat(),
            places: elements(message, "nodes")
                .flat_map(|node| elements(node, "actions"))
                .take(ELEMENTS)
                .any(|action| sets_position(text(action, "actionType"))),
            sound,
        };
        sent.sound &= sent.is_chain();
        Some(sent)
    }

    /// Whether nodes and edges alternate without gap, and nothing is released behind the horizon's start.
    fn is_chain(&self) -> bool {
        if self.nodes.is_empty() || self.edges.len() + 1 != self.nodes.len() {
            return false;
        }
        let mut chain: Vec<&Element> = self.nodes.iter().chain(&self.edges).collect();
        chain.sort_by_key(|element| element.sequence);
        let ordered = |list: &[Element]| list.windows(2).all(|pair| pair[0].sequence + 2 == pair[1].sequence);
        ordered(&self.nodes)
            && ordered(&self.edges)
            && chain.windows(2).all(|pair| pair[0].sequence + 1 == pair[1].sequence)
            && chain.windows(2).all(|pair| pair[0].released || !pair[1].released)
            && chain.first().is_some_and(|first| first.released)
    }

    /// The sequenceId of its first node.
    pub fn first(&self) -> u64 {
        self.nodes.first().map_or(0, |node| node.sequence)
    }
}

/// All orders sent of late, oldest first.
#[derive(Debug, Default)]
pub(super) struct Orders {
    sent: VecDeque<SentOrder>,
}

impl Orders {
    /// Learns from an entry; returns whether it was an order.
    pub fn note(&mut self, entry: &Entry, context: &CheckContext<'_>) -> bool {
        let Some(sent) = to_vehicle("order", entry, context).and_then(SentOrder::read) else {
            return false;
        };
        // The harness may see its own order come back through the broker.
        if self.sent.back() == Some(&sent) {
            return true;
        }
        if self.sent.len() == MESSAGES {
            self.sent.pop_front();
        }
        self.sent.push_back(sent);
        true
    }

    /// The messages with this orderId and orderUpdateId.
    pub fn candidates(&self, order: &str, update: u64) -> impl Iterator<Item = &SentOrder> {
        self.of(order).filter(move |sent| sent.update == update)
    }

    /// The messages with this orderId.
    pub fn of(&self, order: &str) -> impl Iterator<Item = &SentOrder> {
        self.sent.iter().filter(move |sent| sent.order == order)
    }
}

/// The malformed orders of the harness, which no vehicle should take over.
///
/// One that does so breaks the refusal alone: what its states show from then on is what we told it.
#[derive(Debug, Default)]
pub(super) struct Malformed {
    /// orderId, empty where it cannot be read, and orderUpdateId, where it can be.
    broken_ones: VecDeque<(String, Option<u64>)>,
    /// The same of the other orders.
    good: VecDeque<(String, u64)>,
    /// No good order has been shown since one that does not even have a name.
    nameless: bool,
}

impl Malformed {
    /// Learns from an entry.
    pub fn note(&mut self, entry: &Entry, context: &CheckContext<'_>) {
        let Some(message) = to_vehicle("order", entry, context) else {
            return;
        };
        let good = !Self::is_malformed(entry, context);
        match SentOrder::read(message).filter(|_| good) {
            Some(sent) => {
                self.good.push_back((sent.order, sent.update));
                let excess = self.good.len().saturating_sub(MESSAGES);
                self.good.drain(..excess);
            }
            None => {
                let name: String = text(message, "orderId").chars().take(512).collect();
                self.nameless |= name.is_empty();
                self.broken_ones.push_back((name, number(message, "orderUpdateId")));
                let excess = self.broken_ones.len().saturating_sub(MESSAGES);
                self.broken_ones.drain(..excess);
            }
        }
    }

    /// Whether a message on its way to the vehicle is an order that no vehicle should take over.
    pub fn is_malformed(entry: &Entry, context: &CheckContext<'_>) -> bool {
        let Some(message) = to_vehicle("order", entry, context) else {
            return is_to_vehicle("order", entry, context);
        };
        let schema = context.pack.schema("order");
        let obeys = schema.is_none_or(|schema| schema.findings(message).is_empty());
        !obeys || SentOrder::read(message).is_none_or(|sent| !sent.sound || sent.order.is_empty())
    }

    /// Whether a state shows a malformed order, taken over as if it were none.
    pub fn is_shown_in(&mut self, state: &Value) -> bool {
        if self.broken_ones.is_empty() {
            return false;
        }
        let (order, update) = (text(state, "orderId"), number(state, "orderUpdateId"));
        let good = self.good.iter();
        if !order.is_empty() && good.clone().any(|(id, number)| id == order && Some(*number) == update) {
            // The one that came last is what the vehicle holds, unless it goes by no name at all.
            self.nameless &= self
                .good
                .back()
                .is_none_or(|(id, number)| id != order || Some(*number) != update);
            return false;
        }
        let same = |(id, number): &(String, Option<u64>)| id == order && (number.is_none() || *number == update);
        self.nameless && order.is_empty() || self.broken_ones.iter().any(same)
    }
}

/// Where a state says the vehicle was last: node and sequenceId.
pub(super) fn last_node(state: &Value) -> Option<(String, u64)> {
    let node = state.get("lastNodeId")?.as_str()?;
    Some((node.chars().take(512).collect(), number(state, "lastNodeSequenceId")?))
}

/// Whether a state reports something that may end an order without a word: another operating mode than the
/// automatic ones, an emergency stop (a word that is none of the standard is neither, and a finding of its own), a fatal error, or a failed action.
pub(super) fn may_abandon(state: &Value) -> bool {
    may_abandon_beside(state, &[])
}

/// The same where these errors are known not to hold the vehicle.
pub(super) fn may_abandon_beside(state: &Value, borne: &[Value]) -> bool {
    let failed = elements(state, "actionStates").any(|action| text(action, "actionStatus") == "FAILED");
    failed || is_taken_out_beside(state, borne)
}

/// The errors of a state that ask for a person.
pub(super) fn fatal_errors(state: &Value) -> impl Iterator<Item = &Value> {
    elements(state, "errors").filter(|error| !matches!(text(error, "errorLevel"), "WARNING" | "URGENT"))
}

/// The same without failed actions: whatever is left of the order is still to be seen then.
pub(super) fn is_taken_out(state: &Value) -> bool {
    is_taken_out_beside(state, &[])
}

fn is_taken_out_beside(state: &Value, borne: &[Value]) -> bool {
    let manual = matches!(text(state, "operatingMode"), "MANUAL" | "SERVICE" | "TEACHIN");
    let stopped = state
        .pointer("/safetyState/eStop")
        .is_some_and(|stop| matches!(stop.as_str(), Some("AUTOACK" | "MANUAL" | "REMOTE")));
    let fatal = fatal_errors(state).any(|error| !borne.contains(error));
    manual || stopped || fatal
}
