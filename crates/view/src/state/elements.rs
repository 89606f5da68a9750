//! What is left of an order: nodes, edges and actions.

use crate::{NodePosition, Number, Text, Trajectory};

view! {
    /// A node still ahead.
    NodeState as "nodeState" {
        /// Which node it is.
        node_id: Text = "nodeId",
        /// Its place in the order.
        sequence_id: Number = "sequenceId",
        /// For people.
        node_description: Text = "nodeDescription" apart,
        /// Whether it belongs to the base.
        released: bool = "released",
        /// Where it is.
        node_position: Box<NodePosition> = "nodePosition",
    }
}

view! {
    /// An edge still ahead.
    EdgeState as "edgeState" {
        /// Which edge it is.
        edge_id: Text = "edgeId",
        /// Its place in the order.
        sequence_id: Number = "sequenceId",
        /// For people.
        edge_description: Text = "edgeDescription" apart,
        /// Whether it belongs to the base.
        released: bool = "released",
        /// The curve that is followed.
        trajectory: Box<Trajectory> = "trajectory",
    }
}

view! {
    /// An action and how far it is.
    ActionState as "actionState" {
        /// Which action it is.
        action_id: Text = "actionId",
        /// What is done.
        action_type: Text = "actionType",
        /// For people.
        action_description: Text = "actionDescription" apart,
        /// How far it is.
        action_status: Text = "actionStatus",
        /// What came of it.
        result_description: Text = "resultDescription",
    }
}

impl ActionState {
    /// Whether it is over: finished or failed.
    #[must_use]
    pub fn is_over(&self) -> bool {
        matches!(self.action_status.text(), Some("FINISHED" | "FAILED"))
    }

    /// Whether the vehicle gives its order up for it.
    #[must_use]
    pub fn clears_order(&self) -> bool {
        crate::action::clears_order(self.action_type.text())
    }

    /// Whether it has failed.
    #[must_use]
    pub fn is_failed(&self) -> bool {
        self.action_status.is("FAILED")
    }
}
