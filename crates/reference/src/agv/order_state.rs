//! The state of the order: the order itself, what is left of it, and where the vehicle was last (sections 6.6.1, 6.10.1 and 6.10.2).
//!
//! The orderId stays when the order is done or called off (the ruling of MODE-05).

use std::collections::VecDeque;

use super::order_message::{Edge, Node};
use super::planner::Bow;

/// Place of a node.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) map_id: String,
}

/// A node still to be traversed.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stop {
    pub(crate) node: Node,
    pub(crate) place: Place,
}

/// A cancellation under way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Cancel {
    /// actionId of the cancelOrder action.
    pub(crate) action_id: String,
    /// The vehicle drives to its next node first.
    pub(crate) to_node: bool,
}

/// The order and its progress.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OrderState {
    pub(crate) order_id: String,
    pub(crate) update_id: u32,
    pub(crate) last_node: String,
    pub(crate) last_sequence: u32,
    /// Still to be traversed, horizon included (STATE-12).
    pub(crate) nodes: VecDeque<Stop>,
    /// Still to be traversed, horizon included.
    pub(crate) edges: VecDeque<Edge>,
    /// The last released node: the decision point.
    pub(crate) base_end: (String, u32),
    /// The first of `edges` has been entered.
    pub(crate) entered: bool,
    pub(crate) cancel: Option<Cancel>,
    /// The node traversed last, and the edge left last.
    pub(crate) left: (Option<Stop>, Option<Edge>),
    /// The order was cancelled, so it cannot be continued.
    pub(crate) cancelled: bool,
    /// The order names a zone set.
    pub(crate) zoned: bool,
    /// Its next node turned out to be out of reach.
    pub(crate) unreachable: bool,
    /// How it drives the edge ahead, where it plans its way itself and zones weigh on it.
    pub(crate) bow: Option<Bow>,
    /// What the last message of it said.
    pub(crate) content: (Vec<Node>, Vec<Edge>),
    /// lastNodeId and lastNodeSequenceId before the present ones.
    pub(crate) previous: (String, u32),
}

impl OrderState {
    /// No order yet.
    pub(crate) fn empty(last_node: String) -> Self {
        Self {
            order_id: String::new(),
            update_id: 0,
            last_node,
            last_sequence: 0,
            nodes: VecDeque::new(),
            edges: VecDeque::new(),
            base_end: (String::new(), 0),
            entered: false,
            cancel: None,
            left: (None, None),
            cancelled: false,
            zoned: false,
            unreachable: false,
            bow: None,
            content: (Vec::new(), Vec::new()),
            previous: (String::new(), 0),
        }
    }

    /// Whether there was an order since the vehicle was switched on.
    pub(crate) fn has_order(&self) -> bool {
        !self.order_id.is_empty()
    }

    /// The edge that leads to the next node; `None` if the vehicle needs none.
    pub(crate) fn edge_ahead(&self) -> Option<&Edge> {
        let next = self.nodes.front()?;
        self.edges
            .front()
            .filter(|edge| edge.sequence_id < next.node.sequence_id)
    }

    /// Removes the horizon; the sequenceIds that went.
    pub(crate) fn drop_horizon(&mut self) -> Vec<u32> {
        let nodes = self
            .nodes
            .iter()
            .filter(|stop| !stop.node.released)
            .map(|stop| stop.node.sequence_id);
        let edges = self
            .edges
            .iter()
            .filter(|edge| !edge.released)
            .map(|edge| edge.sequence_id);
        let gone = nodes.chain(edges).collect();
        self.nodes.retain(|stop| stop.node.released);
        self.edges.retain(|edge| edge.released);
        gone
    }

    /// Removes all nodes and edges.
    pub(crate) fn drop_route(&mut self) {
        self.nodes.clear();
        self.edges.clear();
        self.entered = false;
    }

    /// Whether the base runs low while there is more to come (STATE-16).
    pub(crate) fn base_runs_low(&self) -> bool {
        let horizon = self.nodes.iter().any(|stop| !stop.node.released);
        horizon && self.edges.iter().filter(|edge| edge.released).count() <= 1
    }
}
