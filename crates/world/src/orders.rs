//! The orders that were sent to a vehicle.
//!
//! Whether the vehicle took one over is read from its states.

use std::collections::VecDeque;

use crate::observation::Observation;
use tck_view::{ActionView, List, Member, Number, OrderView, StateView, Text};

/// How many order messages are kept, and how many elements each may have.
const MESSAGES: usize = 64;
const ELEMENTS: usize = 4096;

/// A node or edge of an order, or its state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// nodeId or edgeId.
    pub id: String,
    /// sequenceId.
    pub sequence: u64,
    /// Whether it may be driven.
    pub released: bool,
}

impl Element {
    fn read(id: &Member<Text>, sequence: &Member<Number>, released: &Member<bool>) -> Option<Self> {
        Some(Self {
            id: id.text()?.to_owned(),
            sequence: sequence.whole()?,
            released: released.flag()?,
        })
    }
}

/// The nodes a state still lists; `None` when the list is missing, too long, or one of them cannot be read.
#[must_use]
pub fn nodes_left(state: &StateView) -> Option<Vec<Element>> {
    let all = state.node_states.complete()?.iter();
    all.map(|node| Element::read(&node.node_id, &node.sequence_id, &node.released))
        .collect()
}

/// The edges a state still lists; `None` when the list is missing, too long, or one of them cannot be read.
#[must_use]
pub fn edges_left(state: &StateView) -> Option<Vec<Element>> {
    let all = state.edge_states.complete()?.iter();
    all.map(|edge| Element::read(&edge.edge_id, &edge.sequence_id, &edge.released))
        .collect()
}

/// What an action may run beside: blockingType.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blocking {
    /// Beside everything.
    None,
    /// Beside other actions, and not beside driving.
    Soft,
    /// Beside nothing.
    Hard,
}

impl Blocking {
    fn read(action: &ActionView) -> Option<Self> {
        match action.blocking_type.or_empty() {
            "NONE" => Some(Self::None),
            "SOFT" => Some(Self::Soft),
            "HARD" => Some(Self::Hard),
            _ => None,
        }
    }
}

/// An action of an order and where it is to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Placed {
    /// actionId.
    pub action: String,
    /// actionType.
    pub kind: String,
    /// `None` for a type this version does not have.
    pub blocking: Option<Blocking>,
    /// sequenceId of its node or edge.
    pub sequence: u64,
    /// Whether that is an edge.
    pub on_edge: bool,
}

/// The actions of an element.
fn placed<'o>(
    actions: &'o Member<List<ActionView>>,
    sequence: &Member<Number>,
    on_edge: bool,
) -> impl Iterator<Item = Placed> + use<'o> {
    let sequence = sequence.whole();
    actions.iter().filter_map(move |action| {
        Some(Placed {
            action: action.action_id.text()?.to_owned(),
            kind: action.action_type.or_empty().to_owned(),
            blocking: Blocking::read(action),
            sequence: sequence?,
            on_edge,
        })
    })
}

/// Whether an action of this type gives the vehicle a pose and a last node; later versions spell it out.
pub fn sets_position(action_type: &str) -> bool {
    matches!(action_type, "initPosition" | "initializePosition")
}

/// One order message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SentOrder {
    /// orderId.
    pub order: String,
    /// orderUpdateId.
    pub update: u64,
    /// Its nodes; none where one of them cannot be read.
    pub nodes: Vec<Element>,
    /// Its edges; none where one of them cannot be read.
    pub edges: Vec<Element>,
    /// The actions of nodes and edges.
    pub actions: Vec<Placed>,
    /// Whether an action of it puts the vehicle somewhere else.
    pub places: bool,
    /// Whether its graph is one that a vehicle may accept. Tests also send others, on purpose.
    pub sound: bool,
}

impl SentOrder {
    fn read(message: &OrderView) -> Option<Self> {
        let order = message.order_id.text()?;
        let update = message.order_update_id.whole()?;
        let nodes: Option<Vec<Element>> = message.nodes.complete().and_then(|nodes| {
            let all = nodes.iter();
            all.map(|node| Element::read(&node.node_id, &node.sequence_id, &node.released))
                .collect()
        });
        let edges: Option<Vec<Element>> = message.edges.complete().and_then(|edges| {
            let all = edges.iter();
            all.map(|edge| Element::read(&edge.edge_id, &edge.sequence_id, &edge.released))
                .collect()
        });
        let of_nodes = message.nodes.iter();
        let of_nodes = of_nodes.flat_map(|node| placed(&node.actions, &node.sequence_id, false));
        let of_edges = message.edges.iter();
        let of_edges = of_edges.flat_map(|edge| placed(&edge.actions, &edge.sequence_id, true));
        let sound = nodes.is_some() && edges.is_some();
        let mut sent = Self {
            order: order.to_owned(),
            update,
            nodes: nodes.unwrap_or_default(),
            edges: edges.unwrap_or_default(),
            actions: of_nodes.take(ELEMENTS).chain(of_edges.take(ELEMENTS)).collect(),
            places: message
                .nodes
                .iter()
                .flat_map(|node| node.actions.iter())
                .take(ELEMENTS)
                .any(|action| sets_position(action.action_type.or_empty())),
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
pub struct OrdersSent {
    sent: VecDeque<SentOrder>,
    /// The record with the last of them.
    at: Option<u64>,
}

impl OrdersSent {
    /// The order that this record is, if it can be read as one.
    #[must_use]
    pub fn now(&self, record: &Observation<'_>) -> Option<&SentOrder> {
        self.sent.back().filter(|_| self.at == Some(record.seq()))
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

impl OrdersSent {
    /// Learns from the next record.
    pub(crate) fn learn(&mut self, record: &Observation<'_>) {
        let Some(sent) = record.order_to_vehicle().and_then(|order| SentOrder::read(order)) else {
            return;
        };
        self.at = Some(record.seq());
        // The harness may see its own order come back through the broker.
        if self.sent.back() == Some(&sent) {
            return;
        }
        if self.sent.len() == MESSAGES {
            self.sent.pop_front();
        }
        self.sent.push_back(sent);
    }
}
