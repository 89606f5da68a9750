//! The order book: the order, what is left of it, and where the vehicle was last.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::clock::Moment;

use super::order_message::{Edge, Node};

/// Where a node is.
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
pub(crate) struct Book {
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
    /// First sequenceId by nodeId (`loop-confused` only).
    pub(crate) visits: BTreeMap<String, u32>,
    /// The order was cancelled, so it cannot be continued.
    pub(crate) cancelled: bool,
    /// The order was updated.
    pub(crate) updated: bool,
    /// The link broke since the order came (`update-refused-after-cut` only).
    pub(crate) cut: bool,
    /// sequenceId behind which everything comes from updates (`update-actions-not-performed` only).
    pub(crate) first_end: u32,
    /// actionIds of the horizon an update has just replaced.
    pub(crate) dropped: Vec<String>,
    /// It has asked for a new base (`new-base-request-stays` only).
    pub(crate) asked: bool,
    /// Where the order began (`distance-not-reset` only).
    pub(crate) begun_at: Option<(f64, f64)>,
    /// The order was complete and is continued (`continuation-not-driven` only).
    pub(crate) continued: bool,
    /// When a faulty vehicle does what it does a moment later.
    pub(crate) soon: Option<Moment>,
    /// It left the decision point by itself (`horizon-slipped-into` only).
    pub(crate) slipped: bool,
    /// The order names a zone set (`zone-set-invented` only).
    pub(crate) zoned: bool,
    /// It drives as if the horizon were released (`r1-horizon-…` only).
    pub(crate) unbound: bool,
    /// Where it ends its way (`r1-stops-at-stitch` only).
    pub(crate) stuck_at: Option<u32>,
    /// It does not drive any more (`r1-outdated-halts-driving` only).
    pub(crate) stunned: bool,
    /// It drives although it is paused (`r1-update-drives-in-pause` only).
    pub(crate) heedless: bool,
    /// It went on after a pause on this edge (`r1-max-speed-forgotten-in-pause` only).
    pub(crate) hurried: bool,
    /// lastNodeId and lastNodeSequenceId before the present ones (`r1-last-node-after-actions` only).
    pub(crate) previous: (String, u32),
    /// sequenceIds that were in the horizon once (`r2-released-not-updated` only).
    pub(crate) planned: BTreeSet<u32>,
    /// It drives whatever its actions forbid (`r2-blocking-forgotten-after-pause` only).
    pub(crate) unblocked: bool,
}

impl Book {
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
            visits: BTreeMap::new(),
            cancelled: false,
            updated: false,
            cut: false,
            first_end: u32::MAX,
            dropped: Vec::new(),
            asked: false,
            begun_at: None,
            continued: false,
            soon: None,
            slipped: false,
            zoned: false,
            unbound: false,
            stuck_at: None,
            stunned: false,
            heedless: false,
            hurried: false,
            previous: (String::new(), 0),
            planned: BTreeSet::new(),
            unblocked: false,
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
