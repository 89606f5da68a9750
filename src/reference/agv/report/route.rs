//! The way ahead in a state: nodes and edges that are still to be traversed.

use serde_json::{Value, json};

use crate::reference::agv::Agv;
use crate::reference::agv::book::Stop;
use crate::reference::agv::faults::FaultName as F;
use crate::reference::agv::order_message::Edge;
use crate::reference::agv::points::Part;
use crate::reference::agv::tolerances::ToleranceName as T;

impl Agv {
    /// `manual-drives-unseen`: drives a way it does not show.
    pub(crate) fn hides_route(&self) -> bool {
        !self.mode.takes_orders() && self.faults.has(F::ManualDrivesUnseen)
    }

    pub(crate) fn node_states(&self) -> Value {
        if self.hides_route() {
            return json!([]);
        }
        let ahead = self.book.nodes.iter();
        let shown = ahead.filter(|stop| !self.sixth.is_hidden(stop.node.sequence_id));
        let relisted = self.fourth.relisted.iter().filter(|_| !self.book.cancelled);
        let mut listed: Vec<&Stop> = relisted.chain(shown).collect();
        if let Some((_, joint)) = self
            .fourth
            .joints
            .filter(|_| self.faults.has(F::R4UpdatePutsNewNodesInFront))
        {
            // A stable sort: both parts keep their sequence.
            listed.sort_by_key(|stop| stop.node.sequence_id <= joint);
        }
        listed.into_iter().filter_map(|stop| self.node_state(stop)).collect()
    }

    /// The node traversed last, as if it were still ahead.
    pub(crate) fn last_node_state(&self) -> Value {
        let left = self.book.left.0.iter();
        left.filter_map(|stop| self.node_state(stop)).collect()
    }

    fn node_state(&self, stop: &Stop) -> Option<Value> {
        let node = &stop.node;
        let mut picture = json!({
            "nodeId": node.id,
            "sequenceId": node.sequence_id,
            "released": node.released,
        });
        if let Some(position) = node.sent_position.as_ref().filter(|_| !self.config.line_guided()) {
            picture["nodePosition"] = position.clone();
        } else if self.takes(T::R2NodePositionsFromLayout) && !self.config.line_guided() {
            picture["nodePosition"] = json!({ "x": stop.place.x, "y": stop.place.y, "mapId": stop.place.map_id });
        }
        self.said(Part::Node(stop), picture)
    }

    pub(crate) fn edge_states(&self) -> Value {
        if self.hides_route() {
            return json!([]);
        }
        let ahead = self.book.edges.iter();
        ahead.filter_map(|edge| self.edge_state(edge)).collect()
    }

    /// The edge left last, as if it were still ahead.
    pub(crate) fn last_edge_state(&self) -> Value {
        let left = self.book.left.1.iter();
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
