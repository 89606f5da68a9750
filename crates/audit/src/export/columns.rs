//! Which columns the tables have: what is known of a message beside its content, what stands in its content, and findings.

use super::parquet::Kind::{self, Bool, Float, Int, Text, Time};

/// A column that is a member of the message, or how many elements a list has.
pub(super) struct Member {
    pub name: &'static str,
    pub pointer: &'static str,
    pub kind: Kind,
}

const fn member(name: &'static str, pointer: &'static str, kind: Kind) -> Member {
    Member { name, pointer, kind }
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
    member("header_id", "/headerId", Int),
    member("timestamp", "/timestamp", Text),
    member("version", "/version", Text),
    member("manufacturer", "/manufacturer", Text),
    member("serial_number", "/serialNumber", Text),
];

const STATE: &[Member] = &[
    member("order_id", "/orderId", Text),
    member("order_update_id", "/orderUpdateId", Int),
    member("last_node_id", "/lastNodeId", Text),
    member("last_node_sequence_id", "/lastNodeSequenceId", Int),
    member("node_states", "/nodeStates", Int),
    member("edge_states", "/edgeStates", Int),
    member("action_states", "/actionStates", Int),
    member("loads", "/loads", Int),
    member("errors", "/errors", Int),
    member("information", "/information", Int),
    member("driving", "/driving", Bool),
    member("paused", "/paused", Bool),
    member("new_base_request", "/newBaseRequest", Bool),
    member("distance_since_last_node", "/distanceSinceLastNode", Float),
    member("operating_mode", "/operatingMode", Text),
    member("x", "/agvPosition/x", Float),
    member("y", "/agvPosition/y", Float),
    member("theta", "/agvPosition/theta", Float),
    member("map_id", "/agvPosition/mapId", Text),
    member("position_initialized", "/agvPosition/positionInitialized", Bool),
    member("vx", "/velocity/vx", Float),
    member("vy", "/velocity/vy", Float),
    member("omega", "/velocity/omega", Float),
    member("battery_charge", "/batteryState/batteryCharge", Float),
    member("charging", "/batteryState/charging", Bool),
    member("e_stop", "/safetyState/eStop", Text),
    member("field_violation", "/safetyState/fieldViolation", Bool),
];

const VISUALIZATION: &[Member] = &[
    member("x", "/agvPosition/x", Float),
    member("y", "/agvPosition/y", Float),
    member("theta", "/agvPosition/theta", Float),
    member("map_id", "/agvPosition/mapId", Text),
    member("vx", "/velocity/vx", Float),
    member("vy", "/velocity/vy", Float),
    member("omega", "/velocity/omega", Float),
];

const ORDER: &[Member] = &[
    member("order_id", "/orderId", Text),
    member("order_update_id", "/orderUpdateId", Int),
    member("zone_set_id", "/zoneSetId", Text),
    member("nodes", "/nodes", Int),
    member("edges", "/edges", Int),
];

const FACTSHEET: &[Member] = &[
    member("series_name", "/typeSpecification/seriesName", Text),
    member("agv_kinematic", "/typeSpecification/agvKinematic", Text),
    member("agv_class", "/typeSpecification/agvClass", Text),
    member("max_load_mass", "/typeSpecification/maxLoadMass", Float),
    member("speed_max", "/physicalParameters/speedMax", Float),
];

/// Of the messages of a topic of this name.
pub(super) fn of(topic: &str) -> &'static [Member] {
    match topic {
        "state" => STATE,
        "visualization" => VISUALIZATION,
        "order" => ORDER,
        "instantActions" => const { &[member("actions", "/actions", Int)] },
        "connection" => const { &[member("connection_state", "/connectionState", Text)] },
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
