//! States of a vehicle.

mod condition;
mod elements;
mod events;
mod paths;

pub use condition::{BatteryState, BoundingBox, Dimensions, Load, MapState, SafetyState, ZoneSetState};
pub use elements::{ActionState, EdgeState, NodeState};
pub use events::{ErrorView, Information, Reference, Translation};
pub use paths::{EdgeRequest, IntermediatePath, PlannedPath, Waypoint, ZoneRequest};

use crate::{List, Number, Pose, Position, Spot, Text, Velocity};

view! {
    /// What a vehicle says about itself.
    message StateView as "state" {
        /// The order it has, or had last.
        order_id: Text = "orderId",
        /// Which update of it.
        order_update_id: Number = "orderUpdateId",
        /// The zones it heeds.
        zone_set_id: Text = "zoneSetId",
        /// The node it was on last.
        last_node_id: Text = "lastNodeId",
        /// Place of that node in the order.
        last_node_sequence_id: Number = "lastNodeSequenceId",
        /// Nodes still ahead.
        node_states: List<NodeState> = "nodeStates",
        /// Edges still ahead.
        edge_states: List<EdgeState> = "edgeStates",
        /// Where it is.
        position: Position = "agvPosition" apart,
        /// How fast it is.
        velocity: Velocity = "velocity" apart,
        /// What it carries.
        loads: List<Load> = "loads",
        /// Whether it moves.
        driving: bool = "driving",
        /// Whether it is paused.
        paused: bool = "paused",
        /// Whether it wants more base.
        new_base_request: bool = "newBaseRequest",
        /// In metres.
        distance_since_last_node: Number = "distanceSinceLastNode" apart,
        /// Actions and how far they are; in 3.0 those of the order only.
        action_states: List<ActionState> = "actionStates",
        /// Instant actions and how far they are.
        instant_action_states: List<ActionState> = later "instantActionStates",
        /// Actions of zones and how far they are.
        zone_action_states: List<ActionState> = later "zoneActionStates",
        /// Its battery.
        battery_state: BatteryState = "batteryState" apart,
        /// Who is in control.
        operating_mode: Text = "operatingMode",
        /// What is wrong.
        errors: List<ErrorView> = "errors",
        /// What else there is to say.
        information: List<Information> = "information",
        /// Emergency stop and protective field.
        safety_state: SafetyState = "safetyState",
        /// Maps on board.
        maps: List<MapState> = "maps",
        /// Zone sets on board.
        zone_sets: List<ZoneSetState> = later "zoneSets",
        /// The way it plans.
        planned_path: Box<PlannedPath> = later "plannedPath",
        /// The way it takes next.
        intermediate_path: Box<IntermediatePath> = later "intermediatePath",
        /// What it asks for in zones.
        zone_requests: List<ZoneRequest> = later "zoneRequests",
        /// What it asks for on edges.
        edge_requests: List<EdgeRequest> = later "edgeRequests",
    }
}

impl StateView {
    /// The pose of a vehicle that says it knows its position, see [`Position::pose`].
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.position.there().and_then(Position::pose)
    }

    /// Where it is by what is written, whether it knows its position or not, see [`Position::spot`].
    #[must_use]
    pub fn spot(&self) -> Option<Spot> {
        self.position.there().and_then(Position::spot)
    }

    /// Every state of an action: of the order, of instant actions and of zones.
    pub fn all_action_states(&self) -> impl Iterator<Item = &ActionState> {
        let further = self.instant_action_states.iter().chain(self.zone_action_states.iter());
        self.action_states.iter().chain(further)
    }

    /// The state of the action with this id, wherever it stands.
    #[must_use]
    pub fn action(&self, id: &str) -> Option<&ActionState> {
        self.all_action_states().find(|action| action.action_id.is(id))
    }

    /// The word for the emergency stop.
    #[must_use]
    pub fn emergency_stop(&self) -> Option<&str> {
        self.safety_state.there()?.emergency_stop.text()
    }

    /// Whether the protective field is violated.
    #[must_use]
    pub fn field_violation(&self) -> Option<bool> {
        self.safety_state.there()?.field_violation.flag()
    }

    /// Whether the battery is charging.
    #[must_use]
    pub fn charging(&self) -> Option<bool> {
        self.battery_state.there()?.charging.flag()
    }

    /// The node it was on last and its place in the order, where both are said.
    #[must_use]
    pub fn last_node(&self) -> Option<(&Text, u64)> {
        Some((self.last_node_id.there()?, self.last_node_sequence_id.whole()?))
    }
}
