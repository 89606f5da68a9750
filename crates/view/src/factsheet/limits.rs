//! Limits of messages.

use crate::Number;

view! {
    /// How long and how often messages may be.
    ProtocolLimits as "protocolLimits" {
        /// Of texts.
        max_string_lens: StringLimits = "maxStringLens",
        /// Of lists.
        max_array_lens: ArrayLimits = "maxArrayLens",
        /// Of time.
        timing: Timing = "timing",
    }
}

view! {
    /// How long texts may be.
    StringLimits as "stringLimits" {
        /// A message.
        msg_len: Number = "msgLen",
        /// The serial number in a topic.
        topic_serial_len: Number = "topicSerialLen",
        /// Every other level of a topic.
        topic_elem_len: Number = "topicElemLen",
        /// An id.
        id_len: Number = "idLen",
        /// Whether ids are numbers.
        id_numerical_only: bool = "idNumericalOnly",
        /// A word of an enumeration.
        enum_len: Number = "enumLen",
        /// The id of a load.
        load_id_len: Number = "loadIdLen",
    }
}

view! {
    /// How long lists may be.
    ArrayLimits as "arrayLimits" {
        /// Nodes of an order.
        order_nodes: Number = "order.nodes",
        /// Edges of an order.
        order_edges: Number = "order.edges",
        /// Actions of a node.
        node_actions: Number = "node.actions",
        /// Actions of an edge.
        edge_actions: Number = "edge.actions",
        /// Parameters of an action.
        action_parameters: Number = "actions.actionsParameters",
        /// Instant actions of a message.
        instant_actions: Number = "instantActions",
        /// Knots of a trajectory.
        knot_vector: Number = "trajectory.knotVector",
        /// Control points of a trajectory.
        control_points: Number = "trajectory.controlPoints",
        /// Zones of a set.
        zones: Number = later "zoneSet.zones",
        /// Nodes of a state.
        node_states: Number = "state.nodeStates",
        /// Edges of a state.
        edge_states: Number = "state.edgeStates",
        /// Loads of a state.
        loads: Number = "state.loads",
        /// Actions of a state.
        action_states: Number = "state.actionStates",
        /// Instant actions of a state.
        instant_action_states: Number = later "state.instantActionStates",
        /// Actions of zones of a state.
        zone_action_states: Number = later "state.zoneActionStates",
        /// Errors of a state.
        errors: Number = "state.errors",
        /// Information of a state.
        information: Number = "state.information",
        /// References of an error.
        error_references: Number = "error.errorReferences",
        /// References of an information.
        info_references: Number = "information.infoReferences",
    }
}

view! {
    /// How often messages may come, in seconds.
    Timing as "timing" {
        /// Between two orders.
        min_order_interval: Number = "minOrderInterval",
        /// Between two states.
        min_state_interval: Number = "minStateInterval",
        /// Between two states when nothing happens.
        default_state_interval: Number = "defaultStateInterval",
        /// Between two visualization messages.
        visualization_interval: Number = "visualizationInterval",
    }
}
