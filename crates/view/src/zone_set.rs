//! Zone sets, from 3.0 on.

use crate::{List, Number, Parameter, Text};

view! {
    /// A set of zones for a map.
    message ZoneSetView as "zoneSetMessage" {
        /// The set.
        zone_set: ZoneSet = "zoneSet",
    }
}

view! {
    /// A set of zones.
    ZoneSet as "zoneSet" {
        /// Which set it is.
        zone_set_id: Text = "zoneSetId",
        /// The map it is for.
        map_id: Text = "mapId",
        /// For people.
        zone_set_descriptor: Text = "zoneSetDescriptor" apart,
        /// Its zones.
        zones: List<Zone> = "zones",
    }
}

view! {
    /// A zone.
    Zone as "zone" {
        /// Which zone it is.
        zone_id: Text = "zoneId",
        /// What it is for.
        zone_type: Text = "zoneType",
        /// For people.
        zone_descriptor: Text = "zoneDescriptor" apart,
        /// Its corners.
        vertices: List<Point> = "vertices",
        /// In metres a second, of a speed limit.
        maximum_speed: Number = "maximumSpeed",
        /// Actions at its entry.
        entry_actions: List<ZoneAction> = "entryActions",
        /// Actions inside.
        during_actions: List<ZoneAction> = "duringActions",
        /// Actions when it is left.
        exit_actions: List<ZoneAction> = "exitActions",
        /// What to do when a release is lost.
        release_loss_behavior: Text = "releaseLossBehavior",
        /// How much it is preferred, from 0 to 1.
        priority_factor: Number = "priorityFactor",
        /// How much it is avoided, from 0 to 1.
        penalty_factor: Number = "penaltyFactor",
        /// Direction of travel, in radians.
        direction: Number = "direction",
        /// How strictly a direction holds.
        directed_limitation: Text = "directedLimitation",
        /// How strictly two directions hold.
        bidirected_limitation: Text = "bidirectedLimitation",
    }
}

view! {
    /// An action of a zone; it has no actionId.
    ZoneAction as "zoneAction" {
        /// What is to be done.
        action_type: Text = "actionType",
        /// For people.
        action_descriptor: Text = "actionDescriptor" apart,
        /// What may go on beside it.
        blocking_type: Text = "blockingType",
        /// What it needs to know.
        action_parameters: List<Parameter> = "actionParameters",
        /// Whether a vehicle may wait for a retry after it has failed.
        retriable: bool = "retriable",
    }
}

view! {
    /// A corner of a polygon.
    Point as "point" {
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
    }
}
