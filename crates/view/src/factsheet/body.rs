//! The vehicle as a thing: kind, size, speed and shape.

use crate::{Json, List, Member, Number, Point, Text};

view! {
    /// What kind of vehicle it is.
    TypeSpecification as "typeSpecification" {
        /// Name of the series.
        series_name: Text = "seriesName",
        /// For people.
        series_description: Text = "seriesDescription",
        /// How it moves.
        kinematic: Text = "agvKinematic",
        /// What it is for.
        class: Text = "agvClass",
        /// In kilograms.
        max_load_mass: Number = "maxLoadMass",
        /// How it finds its position.
        localization_types: List<Member<Text>> = "localizationTypes",
        /// How it finds its way.
        navigation_types: List<Member<Text>> = "navigationTypes",
        /// Kinds of zones it heeds.
        supported_zones: List<Member<Text>> = later "supportedZones",
    }
}

view! {
    /// Size and speed.
    PhysicalParameters as "physicalParameters" {
        /// In metres a second.
        speed_min: Number = "speedMin",
        /// In metres a second.
        speed_max: Number = "speedMax",
        /// In radians a second.
        angular_speed_min: Number = "angularSpeedMin",
        /// In radians a second.
        angular_speed_max: Number = "angularSpeedMax",
        /// In metres a second squared.
        acceleration_max: Number = "accelerationMax",
        /// In metres a second squared.
        deceleration_max: Number = "decelerationMax",
        /// In metres.
        height_min: Number = "heightMin",
        /// In metres.
        height_max: Number = "heightMax",
        /// In metres.
        width: Number = "width",
        /// In metres.
        length: Number = "length",
    }
}

view! {
    /// The shape of the vehicle.
    Geometry as "geometry" {
        /// Its wheels.
        wheel_definitions: List<WheelDefinition> = "wheelDefinitions",
        /// Its outlines.
        envelopes_2d: List<Envelope2d> = "envelopes2d",
        /// Its bodies.
        envelopes_3d: List<Envelope3d> = "envelopes3d",
    }
}

view! {
    /// A wheel.
    WheelDefinition as "wheelDefinition" {
        /// What kind of wheel it is.
        kind: Text = "type",
        /// Whether it is driven.
        is_active_driven: bool = "isActiveDriven",
        /// Whether it is steered.
        is_active_steered: bool = "isActiveSteered",
        /// Where it is.
        position: WheelPosition = "position",
        /// In metres.
        diameter: Number = "diameter",
        /// In metres.
        width: Number = "width",
        /// In metres.
        center_displacement: Number = "centerDisplacement",
        /// In the words of the maker.
        constraints: Text = "constraints",
    }
}

view! {
    /// Where a wheel is.
    WheelPosition as "wheelPosition" {
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
        /// In radians.
        theta: Number = "theta",
    }
}

view! {
    /// An outline.
    Envelope2d as "envelope2d" {
        /// Its name.
        set: Text = "set",
        /// Its corners.
        polygon_points: List<Point> = "polygonPoints",
        /// For people.
        description: Text = "description",
    }
}

view! {
    /// A body.
    Envelope3d as "envelope3d" {
        /// Its name.
        set: Text = "set",
        /// Format of the data.
        format: Text = "format",
        /// The data.
        data: Json = "data",
        /// Where the data are.
        url: Text = "url",
        /// For people.
        description: Text = "description",
    }
}
