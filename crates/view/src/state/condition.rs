//! The vehicle itself: battery, safety, loads and maps.

use crate::{Number, Text};

view! {
    /// The battery.
    BatteryState as "batteryState" {
        /// In percent.
        battery_charge: Number = "batteryCharge",
        /// In volts.
        battery_voltage: Number = "batteryVoltage",
        /// In amperes.
        battery_current: Number = later "batteryCurrent",
        /// In percent.
        battery_health: Number = "batteryHealth",
        /// Whether it is charging.
        charging: bool = "charging",
        /// How far it still drives, in metres.
        reach: Number = "reach",
    }
}

view! {
    /// Emergency stop and protective field.
    SafetyState as "safetyState" {
        /// How an emergency stop is to be ended, or `NONE`.
        emergency_stop: Text = "eStop",
        /// Whether the protective field is violated.
        field_violation: bool = "fieldViolation",
    }
}

view! {
    /// Something the vehicle carries.
    Load as "load" {
        /// Which load it is.
        load_id: Text = "loadId",
        /// What it is.
        load_type: Text = "loadType",
        /// Where on the vehicle it is.
        load_position: Text = "loadPosition",
        /// Where its box is.
        bounding_box_reference: Box<BoundingBox> = "boundingBoxReference",
        /// How big it is.
        load_dimensions: Box<Dimensions> = "loadDimensions",
        /// In kilograms.
        weight: Number = "weight",
    }
}

view! {
    /// The point a box is measured from.
    BoundingBox as "boundingBoxReference" {
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
        /// In metres.
        z: Number = "z",
        /// In radians.
        theta: Number = "theta",
    }
}

view! {
    /// The size of a load.
    Dimensions as "loadDimensions" {
        /// In metres.
        length: Number = "length",
        /// In metres.
        width: Number = "width",
        /// In metres.
        height: Number = "height",
    }
}

view! {
    /// A map on board.
    MapState as "map" {
        /// Which map it is.
        map_id: Text = "mapId",
        /// Which version of it.
        map_version: Text = "mapVersion",
        /// For people.
        map_description: Text = "mapDescription" apart,
        /// `ENABLED` or `DISABLED`.
        map_status: Text = "mapStatus",
    }
}

view! {
    /// A zone set on board.
    ZoneSetState as "zoneSetState" {
        /// Which set it is.
        zone_set_id: Text = "zoneSetId",
        /// The map it is for.
        map_id: Text = "mapId",
        /// `ENABLED` or `DISABLED`.
        zone_set_status: Text = "zoneSetStatus",
    }
}
