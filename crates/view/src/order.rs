//! Orders.

use crate::{ActionView, List, NodePosition, Number, Text, Trajectory};

view! {
    /// An order.
    message OrderView as "order" {
        /// Which order it is.
        order_id: Text = "orderId",
        /// Which update of it.
        order_update_id: Number = "orderUpdateId",
        /// For people.
        order_description: Text = later "orderDescription" apart,
        /// Zones the vehicle has to heed.
        zone_set_id: Text = "zoneSetId",
        /// Nodes to pass.
        nodes: List<Node> = "nodes",
        /// Edges between them.
        edges: List<Edge> = "edges",
    }
}

view! {
    /// A node of an order.
    Node as "node" {
        /// Which node it is.
        node_id: Text = "nodeId",
        /// Its place in the order, even.
        sequence_id: Number = "sequenceId",
        /// For people.
        node_description: Text = "nodeDescription" apart,
        /// Whether it belongs to the base.
        released: bool = "released",
        /// Where it is.
        node_position: Box<NodePosition> = "nodePosition",
        /// What is to be done there.
        actions: List<ActionView> = "actions",
    }
}

view! {
    /// An edge of an order.
    Edge as "edge" {
        /// Which edge it is.
        edge_id: Text = "edgeId",
        /// Its place in the order, odd.
        sequence_id: Number = "sequenceId",
        /// For people.
        edge_description: Text = "edgeDescription" apart,
        /// Whether it belongs to the base.
        released: bool = "released",
        /// Where it begins.
        start_node_id: Text = "startNodeId",
        /// Where it ends.
        end_node_id: Text = "endNodeId",
        /// In metres a second.
        max_speed: Number = "maxSpeed",
        /// Of vehicle and load, in metres.
        max_height: Number = "maxHeight",
        /// Of the load handling device, in metres.
        min_height: Number = "minHeight",
        /// Of the vehicle, in radians.
        orientation: Number = "orientation",
        /// `GLOBAL` or `TANGENTIAL`.
        orientation_type: Text = "orientationType",
        /// At junctions of guided vehicles.
        direction: Text = "direction",
        /// Whether the vehicle may turn on it.
        rotation_allowed: bool = "rotationAllowed",
        /// Whether it has to be turned before it enters.
        reach_orientation_before_entering: bool = later "reachOrientationBeforeEntering",
        /// In radians a second.
        max_rotation_speed: Number = "maxRotationSpeed",
        /// The curve to follow.
        trajectory: Box<Trajectory> = "trajectory",
        /// In metres.
        length: Number = "length",
        /// How far the vehicle may leave the curve.
        corridor: Box<Corridor> = "corridor",
        /// What is to be done on it.
        actions: List<ActionView> = "actions",
    }
}

view! {
    /// The room beside a trajectory.
    Corridor as "corridor" {
        /// To the left, in metres.
        left_width: Number = "leftWidth",
        /// To the right, in metres.
        right_width: Number = "rightWidth",
        /// Which point of the vehicle keeps inside.
        reference_point: Text = "corridorRefPoint",
        /// Whether it has to be asked for.
        release_required: bool = later "releaseRequired",
        /// What to do when the release is lost.
        release_loss_behavior: Text = later "releaseLossBehavior",
    }
}

/// Where an action is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scope {
    /// At once.
    Instant,
    /// On a node.
    Node,
    /// On an edge.
    Edge,
    /// In a zone.
    Zone,
}

impl Scope {
    /// The word of a factsheet for it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Instant => "INSTANT",
            Self::Node => "NODE",
            Self::Edge => "EDGE",
            Self::Zone => "ZONE",
        }
    }
}

impl OrderView {
    /// Every action, those of the nodes first, with its scope.
    pub fn actions(&self) -> impl Iterator<Item = (Scope, &ActionView)> {
        let nodes = self.nodes.iter().flat_map(|node| node.actions.iter());
        let edges = self.edges.iter().flat_map(|edge| edge.actions.iter());
        let of_nodes = nodes.map(|action| (Scope::Node, action));
        of_nodes.chain(edges.map(|action| (Scope::Edge, action)))
    }

    /// The nodes by sequenceId, where all have one; as they stand otherwise.
    #[must_use]
    pub fn nodes_in_sequence(&self) -> Vec<&Node> {
        in_sequence(self.nodes.elements(), |node| node.sequence_id.whole())
    }

    /// The edges by sequenceId, where all have one; as they stand otherwise.
    #[must_use]
    pub fn edges_in_sequence(&self) -> Vec<&Edge> {
        in_sequence(self.edges.elements(), |edge| edge.sequence_id.whole())
    }
}

fn in_sequence<T>(list: &[T], number: impl Fn(&T) -> Option<u64>) -> Vec<&T> {
    let mut all: Vec<&T> = list.iter().collect();
    if all.iter().all(|element| number(element).is_some()) {
        all.sort_by_key(|element| number(element));
    }
    all
}
