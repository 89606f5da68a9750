//! What the vehicle can carry.

use crate::{BoundingBox, Dimensions, List, Member, Number, Text};

view! {
    /// Places for loads, and kinds of them.
    LoadSpecification as "loadSpecification" {
        /// Names of the places.
        load_positions: List<Member<Text>> = "loadPositions",
        /// Kinds of loads.
        load_sets: List<LoadSet> = "loadSets",
    }
}

view! {
    /// A kind of load.
    LoadSet as "loadSet" {
        /// Its name.
        set_name: Text = "setName",
        /// What it is.
        load_type: Text = "loadType",
        /// Where it can be carried.
        load_positions: List<Member<Text>> = "loadPositions",
        /// Where its box is.
        bounding_box_reference: BoundingBox = "boundingBoxReference",
        /// How big it is.
        load_dimensions: Dimensions = "loadDimensions",
        /// In kilograms.
        max_weight: Number = "maxWeight",
        /// In metres.
        min_loadhandling_height: Number = "minLoadhandlingHeight",
        /// In metres.
        max_loadhandling_height: Number = "maxLoadhandlingHeight",
        /// In metres.
        min_loadhandling_depth: Number = "minLoadhandlingDepth",
        /// In metres.
        max_loadhandling_depth: Number = "maxLoadhandlingDepth",
        /// In radians.
        min_loadhandling_tilt: Number = "minLoadhandlingTilt",
        /// In radians.
        max_loadhandling_tilt: Number = "maxLoadhandlingTilt",
        /// In metres a second.
        speed_limit: Number = "agvSpeedLimit",
        /// In metres a second squared.
        acceleration_limit: Number = "agvAccelerationLimit",
        /// In metres a second squared.
        deceleration_limit: Number = "agvDecelerationLimit",
        /// In seconds.
        pick_time: Number = "pickTime",
        /// In seconds.
        drop_time: Number = "dropTime",
        /// For people.
        description: Text = "description",
    }
}
