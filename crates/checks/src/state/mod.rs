//! Checks of what a vehicle says in its states: route, actions, maps, loads, battery, and when it says it.

pub(super) mod action_ids;
pub(super) mod actions;
pub(super) mod battery;
pub(super) mod bursts;
pub(super) mod driving;
pub(super) mod joint_loads;
pub(super) mod known;
pub(super) mod loads;
pub(super) mod map_changes;
pub(super) mod maps;
pub(super) mod node_positions;
pub(super) mod order;
pub(super) mod order_cleared;
pub(super) mod pause_allowed;
pub(super) mod pause_stands;
pub(super) mod paused;
pub(super) mod period;
pub(super) mod place;
pub(super) mod predefined;
pub(super) mod requests;
pub(super) mod route;
pub(super) mod triggers;
pub(super) mod values;
