//! Named checks: what patterns cannot say.
//!
//! A [`Check`] is a small state machine over the journal entries of a run or of a window. Tests and monitors
//! refer to it by name. It documents the requirements it can decide and never reads a clock.
//!
//! One file per topic group; [`REGISTRY`] lists them all. A check is told everything that happened and must
//! not accuse anybody falsely: states coalesce, links break, wills are old by nature, retained messages are
//! stale, and tests send broken messages on purpose. Memory is bounded whatever a device sends.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod blocking;
mod cancel_course;
mod commands;
mod connection;
mod connection_crash;
mod connection_offline;
mod errors;
mod errors_blame;
mod errors_event;
mod errors_explained;
mod errors_lingering;
mod errors_predefined;
mod errors_ready;
mod factsheet;
mod factsheet_actions;
mod factsheet_network;
mod finding;
mod fleet;
mod fleet_heard;
mod fleet_orders;
mod header;
mod header_id;
mod instant_answers;
mod instant_queued;
mod instant_requests;
#[cfg(test)]
mod known_members;
mod linked_state;
mod message;
mod message_encoding;
mod message_spelling;
mod motion;
mod motion_signs;
mod mqtt;
#[cfg(test)]
mod names;
mod paths;
mod rhythm;
mod state;
mod topic;
mod topic_heard;
#[cfg(test)]
mod trace;
mod trajectory;
mod visualization;
mod visualization_pose;
mod visualization_state;
mod zones;

use tck_check::Check;

/// Every named check, in the order they are listed and run.
pub static REGISTRY: &[Check] = &[
    message::SCHEMA,
    message_encoding::ENCODING,
    fleet::COMMANDED,
    fleet_orders::OWN_ORDERS,
    fleet_heard::EACH_HEARD,
    header_id::ID_RISES,
    header::TIMESTAMP,
    header::IDENTITY,
    header::VERSION,
    topic::NAMES,
    topic::STRUCTURE,
    topic::OWN_SIDE,
    topic_heard::HEARD,
    mqtt::QUALITY,
    mqtt::CONNECT,
    connection::ONLINE_AFTER_CONNECT,
    connection::VALUES,
    connection_crash::STAYS,
    connection_offline::SAYS_OFFLINE,
    state::period::PERIOD,
    state::period::OWN_LIMITS,
    state::bursts::BURSTS,
    state::action_ids::ACTION_IDS,
    state::actions::TRANSITIONS,
    state::actions::KEPT,
    state::order::ORDER_KEPT,
    state::order_cleared::ORDER_CLEARED,
    state::known::ORDER_KNOWN,
    state::known::UPDATE_ID_RISES,
    state::known::NOT_REPLACED,
    state::predefined::STATUSES,
    state::predefined::RESULTS,
    linked_state::LINKED_STATE,
    cancel_course::COURSE,
    instant_answers::ANSWERED,
    instant_answers::TOGETHER,
    instant_answers::BEGINS,
    instant_answers::SCOPE,
    instant_queued::NOT_QUEUED,
    instant_requests::REQUESTS_MET,
    state::route::REMAINING_ROUTE,
    state::route::LAST_NODE,
    state::node_positions::NODE_POSITIONS,
    state::node_positions::JOINT_POSITION,
    state::triggers::TRIGGERS,
    blocking::BLOCKING,
    state::paused::PAUSED,
    state::pause_stands::PAUSE_STANDS,
    state::pause_allowed::PAUSE_ALLOWED,
    state::place::LAST_NODE_PLACE,
    state::values::IDLE_EMPTY,
    state::maps::MAPS,
    state::maps::MAPS_STAY,
    state::map_changes::MAP_CHANGES,
    state::values::POSITION_RANGE,
    state::values::IDENTIFIERS,
    state::driving::DRIVING,
    state::driving::POSITION_MOVES,
    trajectory::TRAJECTORY,
    trajectory::TRAJECTORY_ENDS,
    trajectory::PLANNED_PATH,
    paths::SHARED,
    paths::PATHS,
    paths::OWN,
    paths::ON_EDGES,
    state::battery::LEVELS,
    state::battery::PERCENT,
    state::loads::LOADS,
    state::joint_loads::JOINT_LOADS,
    visualization::RATE,
    visualization::PUBLISHED,
    visualization_pose::POSITION,
    visualization_state::NAMES_ITS_STATE,
    errors::PERSIST,
    errors_lingering::GONE,
    errors_ready::READY,
    errors_event::ON_EVENT,
    errors_blame::BLAME,
    errors_explained::EXPLAINS,
    errors_predefined::PREDEFINED,
    errors_predefined::STAY,
    factsheet::CONSISTENCY,
    factsheet::LIMITS,
    factsheet_actions::PREDEFINED,
    factsheet_network::NETWORK,
    motion::EDGE_SPEED,
    motion::EDGE_ROTATION_SPEED,
    motion::EDGE_ORIENTATION,
    motion::ROTATION_PLACE,
    motion::TRAJECTORY,
    motion::FOLLOWED,
    motion::BACK_ON_EDGE,
    motion::CURVE_ORIENTATION,
    motion::CORRIDOR,
    motion::CORRIDOR_POINT,
    motion::NEXT_CORRIDOR,
    motion::CORRIDOR_ASKED,
    motion::CORRIDOR_GRANTED,
    motion::CORRIDOR_SHOWN,
    motion::CORRIDOR_KEPT,
    motion::CORRIDOR_LEASE,
    motion::CORRIDOR_RETURNED,
    state::requests::REQUEST_IDS,
    state::requests::REQUEST_STATUS,
    state::requests::EDGE_REQUESTS,
    motion::NODE_TOLERANCE,
    motion::NODE_THETA,
    motion::AXES,
    motion::VELOCITY_SIGN,
    motion_signs::VELOCITY_AXES,
    zones::BLOCKED,
    zones::CONTOUR,
    zones::AROUND,
    zones::PATH_AROUND,
    zones::SPEED,
    zones::LINE_GUIDED,
    zones::DIRECTED,
    zones::ZONE_SETS,
    zones::ZONE_ACTIONS,
    zones::ZONE_REQUESTS,
    zones::RELEASE_ASKED,
    zones::RELEASE_GRANTED,
    zones::RELEASE_KEPT,
    zones::REPLANNING_ASKED,
    zones::REPLANNING_GRANTED,
    zones::REPLANNING_PATH,
    zones::REPLANNING_SENT,
    zones::RELEASE_CONTOUR,
    zones::ACTIONS_LISTED,
    zones::REQUESTS_LISTED,
    motion_signs::TURN_SIGN,
    motion::MODE_SPEED,
    commands::NODES_AND_EDGES,
    commands::RELEASED,
    commands::EDGE_ENDS,
    commands::SEQUENCE,
    commands::BEGINS,
    commands::RETRIES,
    commands::OMNI_ONLY,
    commands::ARRAYS,
    commands::POSITION,
    commands::POSITION_RANGE,
    commands::ZONE_SET,
    commands::IDENTIFIERS,
    commands::TOPICS,
    commands::NODE_IDS,
    commands::ACTION_IDS,
    commands::SCOPES,
    commands::IN_FACTSHEET,
    commands::LOAD_DEVICE,
    commands::VALUES,
    commands::KEYS,
    commands::MANDATORY,
    commands::SIZES,
    commands::ORDER_INTERVAL,
    commands::OPTIONAL,
    commands::REQUIRED,
    commands::TRAJECTORY,
    commands::ENDS,
    commands::CORRIDORS,
    commands::UPDATES,
    commands::ORDER_IDS,
    commands::RESENT,
    commands::BASE_KEPT,
    commands::START,
    commands::CANCELLED_ON_NODE,
    commands::CANCELLED_BETWEEN,
    commands::AXES,
    commands::ENABLED,
    commands::DOWNLOADS,
    commands::DUPLICATES,
    commands::ON_BOARD,
    commands::MODES,
    commands::NOT_ASKED,
    commands::ON_INFORMATION,
    commands::FIRST_PLACE,
    commands::HEALTH,
    commands::ALIVE,
    commands::LISTENS,
    commands::AWAY,
    commands::CONTRADICTS,
    commands::ZONES,
    commands::ZONE_SET_IDS,
    commands::ZONE_SET_LIMITS,
    commands::ZONE_SET_ENABLED,
    commands::LINE_GUIDED,
    commands::RESPONSES,
    commands::CORRIDOR_GRANTS,
    commands::UNREACHABLE,
];

#[cfg(test)]
mod tests {
    use super::*;
    use tck_check::find;

    #[test]
    fn names_are_unique_and_every_check_documents_what_it_decides() {
        for (at, check) in REGISTRY.iter().enumerate() {
            assert!(REGISTRY[at + 1..].iter().all(|other| other.name != check.name));
            assert!(!check.decides.is_empty() && !check.doc.is_empty(), "{}", check.name);
            assert!(find(REGISTRY, check.name).is_some());
        }
        assert!(find(REGISTRY, "no/such-check").is_none());
    }
}
