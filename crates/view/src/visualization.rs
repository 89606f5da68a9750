//! Visualization messages.

use crate::{IntermediatePath, Number, PlannedPath, Pose, Position, Velocity};

view! {
    /// Where a vehicle is, more often than its state says so.
    message VisualizationView as "visualization" {
        /// Where it is.
        position: Position = "agvPosition",
        /// How fast it is.
        velocity: Velocity = "velocity",
        /// headerId of the state it goes with.
        reference_state_header_id: Number = later "referenceStateHeaderId",
        /// The way it plans.
        planned_path: Box<PlannedPath> = later "plannedPath",
        /// The way it takes next.
        intermediate_path: Box<IntermediatePath> = later "intermediatePath",
    }
}

impl VisualizationView {
    /// The pose of a vehicle that says it knows its position, see [`Position::pose`].
    #[must_use]
    pub fn pose(&self) -> Option<Pose> {
        self.position.there().and_then(Position::pose)
    }
}
