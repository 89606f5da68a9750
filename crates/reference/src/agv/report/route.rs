//! The way ahead in a state: nodes and edges that are still to be traversed (section 6.10.1).
//!
//! The first node of an order is behind the vehicle as soon as the order is taken over (the ruling of ORD-FLOW-06).

use serde_json::{Value, json};

use crate::agv::Agv;
use crate::agv::hook_points::Part;
use crate::agv::order_message::Edge;
use crate::agv::order_state::Stop;

impl Agv {
    /// nodeStates: what is still to be traversed, horizon included (STATE-12).
    pub(crate) fn node_states(&self) -> Value {
        let ahead = self.order.nodes.iter();
        ahead.filter_map(|stop| self.node_state(stop)).collect()
    }

    /// The node traversed last, as if it were still ahead.
    pub(crate) fn last_node_state(&self) -> Value {
        let left = self.order.left.0.iter();
        left.filter_map(|stop| self.node_state(stop)).collect()
    }

    pub(crate) fn node_state(&self, stop: &Stop) -> Option<Value> {
        let node = &stop.node;
        let mut picture = json!({
            "nodeId": node.id,
            "sequenceId": node.sequence_id,
            "released": node.released,
        });
        if let Some(position) = node.sent_position.as_ref().filter(|_| !self.config.line_guided()) {
            picture["nodePosition"] = position.clone();
        }
        self.said(Part::Node(stop), picture)
    }

    /// edgeStates: the same of edges.
    pub(crate) fn edge_states(&self) -> Value {
        let ahead = self.order.edges.iter();
        ahead.filter_map(|edge| self.edge_state(edge)).collect()
    }

    /// The edge left last, as if it were still ahead.
    pub(crate) fn last_edge_state(&self) -> Value {
        let left = self.order.left.1.iter();
        left.filter_map(|edge| self.edge_state(edge)).collect()
    }

    fn edge_state(&self, edge: &Edge) -> Option<Value> {
        let mut picture = json!({
            "edgeId": edge.id,
            "sequenceId": edge.sequence_id,
            "released": edge.released,
        });
        if let Some(path) = self.planned_path(edge) {
            picture["trajectory"] = path;
        }
        self.said(Part::Edge(edge), picture)
    }
}
