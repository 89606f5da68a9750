//! Ways of vehicles that find their own, and what they ask for; from 3.0 on.

use crate::{List, Member, Number, Text, Trajectory};

view! {
    /// The way a vehicle plans.
    PlannedPath as "plannedPath" {
        /// The curve.
        trajectory: Trajectory = "trajectory",
        /// Nodes of the order it passes.
        traversed_nodes: List<Member<Text>> = "traversedNodes",
    }
}

view! {
    /// The way a vehicle takes next.
    IntermediatePath as "intermediatePath" {
        /// Its points.
        polyline: List<Waypoint> = "polyline",
    }
}

view! {
    /// A point of a way.
    Waypoint as "waypoint" {
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
        /// In radians.
        theta: Number = "theta",
        /// When it is reached.
        eta: Text = "eta",
    }
}

view! {
    /// What a vehicle asks for in a zone.
    ZoneRequest as "zoneRequest" {
        /// Which request it is.
        request_id: Text = "requestId",
        /// `ACCESS` or `REPLANNING`.
        request_type: Text = "requestType",
        /// How far it is.
        request_status: Text = "requestStatus",
        /// The zone.
        zone_id: Text = "zoneId",
        /// The set of the zone.
        zone_set_id: Text = "zoneSetId",
        /// The new way.
        trajectory: Box<Trajectory> = "trajectory",
    }
}

view! {
    /// What a vehicle asks for on an edge.
    EdgeRequest as "edgeRequest" {
        /// Which request it is.
        request_id: Text = "requestId",
        /// `CORRIDOR`.
        request_type: Text = "requestType",
        /// How far it is.
        request_status: Text = "requestStatus",
        /// The edge.
        edge_id: Text = "edgeId",
        /// Its place in the order.
        sequence_id: Number = "sequenceId",
    }
}
