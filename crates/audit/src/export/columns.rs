//! Which columns the tables have: what is known of a message beside its content, what stands in its content, and findings.

use tck_view::{
    BatteryState, ConnectionView, FactsheetView, Field, Header, InstantActionsView, OrderView, PhysicalParameters,
    Position, SafetyState, StateView, TypeSpecification, Velocity, VisualizationView,
};

use super::parquet::Kind::{self, Bool, Float, Int, Text, Time};

/// A column that is a member of the message, or how many elements a list has.
pub(super) struct Member {
    pub name: &'static str,
    pub path: &'static [Field],
    pub kind: Kind,
}

const fn member(name: &'static str, path: &'static [Field], kind: Kind) -> Member {
    Member { name, path, kind }
}

/// Of every message, beside its content.
pub(super) const AROUND: [(&str, Kind); 9] = [
    ("message", Int),
    ("recorded", Time),
    ("recording", Int),
    ("line", Int),
    ("topic", Text),
    ("vehicle_manufacturer", Text),
    ("vehicle_serial_number", Text),
    ("qos", Int),
    ("retain", Bool),
];

/// Of every message, by its header.
pub(super) const HEADER: &[Member] = &[
    member("header_id", &[Header::header_id], Int),
    member("timestamp", &[Header::timestamp], Text),
    member("version", &[Header::version], Text),
    member("manufacturer", &[Header::manufacturer], Text),
    member("serial_number", &[Header::serial_number], Text),
];

const STATE: &[Member] = &[
    member("order_id", &[StateView::order_id], Text),
    member("order_update_id", &[StateView::order_update_id], Int),
    member("last_node_id", &[StateView::last_node_id], Text),
    member("last_node_sequence_id", &[StateView::last_node_sequence_id], Int),
    member("node_states", &[StateView::node_states], Int),
    member("edge_states", &[StateView::edge_states], Int),
    member("action_states", &[StateView::action_states], Int),
    member("loads", &[StateView::loads], Int),
    member("errors", &[StateView::errors], Int),
    member("information", &[StateView::information], Int),
    member("driving", &[StateView::driving], Bool),
    member("paused", &[StateView::paused], Bool),
    member("new_base_request", &[StateView::new_base_request], Bool),
    member(
        "distance_since_last_node",
        &[StateView::distance_since_last_node],
        Float,
    ),
    member("operating_mode", &[StateView::operating_mode], Text),
    member("x", &[StateView::position, Position::x], Float),
    member("y", &[StateView::position, Position::y], Float),
    member("theta", &[StateView::position, Position::theta], Float),
    member("map_id", &[StateView::position, Position::map_id], Text),
    member(
        "position_initialized",
        &[StateView::position, Position::initialized],
        Bool,
    ),
    member("vx", &[StateView::velocity, Velocity::vx], Float),
    member("vy", &[StateView::velocity, Velocity::vy], Float),
    member("omega", &[StateView::velocity, Velocity::omega], Float),
    member(
        "battery_charge",
        &[StateView::battery_state, BatteryState::battery_charge],
        Float,
    ),
    member("charging", &[StateView::battery_state, BatteryState::charging], Bool),
    member("e_stop", &[StateView::safety_state, SafetyState::emergency_stop], Text),
    member(
        "field_violation",
        &[StateView::safety_state, SafetyState::field_violation],
        Bool,
    ),
];

const VISUALIZATION: &[Member] = &[
    member("x", &[VisualizationView::position, Position::x], Float),
    member("y", &[VisualizationView::position, Position::y], Float),
    member("theta", &[VisualizationView::position, Position::theta], Float),
    member("map_id", &[VisualizationView::position, Position::map_id], Text),
    member("vx", &[VisualizationView::velocity, Velocity::vx], Float),
    member("vy", &[VisualizationView::velocity, Velocity::vy], Float),
    member("omega", &[VisualizationView::velocity, Velocity::omega], Float),
];

const ORDER: &[Member] = &[
    member("order_id", &[OrderView::order_id], Text),
    member("order_update_id", &[OrderView::order_update_id], Int),
    member("zone_set_id", &[OrderView::zone_set_id], Text),
    member("nodes", &[OrderView::nodes], Int),
    member("edges", &[OrderView::edges], Int),
];

const FACTSHEET: &[Member] = &[
    member(
        "series_name",
        &[FactsheetView::type_specification, TypeSpecification::series_name],
        Text,
    ),
    member(
        "agv_kinematic",
        &[FactsheetView::type_specification, TypeSpecification::kinematic],
        Text,
    ),
    member(
        "agv_class",
        &[FactsheetView::type_specification, TypeSpecification::class],
        Text,
    ),
    member(
        "max_load_mass",
        &[FactsheetView::type_specification, TypeSpecification::max_load_mass],
        Float,
    ),
    member(
        "speed_max",
        &[FactsheetView::physical_parameters, PhysicalParameters::speed_max],
        Float,
    ),
];

/// Of the messages of a topic of this name.
pub(super) fn of(topic: &str) -> &'static [Member] {
    match topic {
        "state" => STATE,
        "visualization" => VISUALIZATION,
        "order" => ORDER,
        "instantActions" => const { &[member("actions", &[InstantActionsView::actions], Int)] },
        "connection" => const { &[member("connection_state", &[ConnectionView::connection_state], Text)] },
        "factsheet" => FACTSHEET,
        _ => &[],
    }
}

/// The last column of every message: its content, as it came.
pub(super) const PAYLOAD: (&str, Kind) = ("payload", Text);

/// Of findings.
pub(super) const FINDING: [(&str, Kind); 15] = [
    ("vehicle_manufacturer", Text),
    ("vehicle_serial_number", Text),
    ("protocol", Text),
    ("role", Text),
    ("verdict", Text),
    ("requirement", Text),
    ("monitor", Text),
    ("count", Int),
    ("message", Int),
    ("recording", Int),
    ("line", Int),
    ("first", Time),
    ("last", Time),
    ("text", Text),
    ("interpretation", Text),
];
