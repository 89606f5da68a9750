//! Factsheets.

mod body;
mod config;
mod features;
mod limits;
mod loads;

pub use body::{
    Envelope2d, Envelope3d, Geometry, PhysicalParameters, TypeSpecification, WheelDefinition, WheelPosition,
};
pub use config::{BatteryCharging, Network, VehicleConfig, VersionEntry};
pub use features::{OfferedAction, OfferedParameter, OptionalParameter, ProtocolFeatures};
pub use limits::{ArrayLimits, ProtocolLimits, StringLimits, Timing};
pub use loads::{LoadSet, LoadSpecification};

use crate::Json;

view! {
    /// What a vehicle is and can do.
    message FactsheetView as "factsheet" {
        /// What kind of vehicle it is.
        type_specification: TypeSpecification = "typeSpecification",
        /// Size and speed.
        physical_parameters: PhysicalParameters = "physicalParameters",
        /// How long and how often messages may be.
        protocol_limits: ProtocolLimits = "protocolLimits",
        /// What it supports.
        protocol_features: ProtocolFeatures = "protocolFeatures",
        /// Its shape.
        geometry: Geometry = "agvGeometry",
        /// What it can carry.
        load_specification: LoadSpecification = "loadSpecification",
        /// How it localizes itself; 2.0 alone, and without a form of its own.
        localization_parameters: Json = "localizationParameters",
        /// Versions of its software and its network.
        vehicle_config: VehicleConfig = "vehicleConfig",
    }
}

impl FactsheetView {
    /// The actions it offers; none where the list cannot be read.
    pub fn offered_actions(&self) -> impl Iterator<Item = &OfferedAction> {
        let features = self.protocol_features.there();
        features.into_iter().flat_map(|features| features.actions.iter())
    }

    /// The optional parameters it names; none where the list cannot be read.
    pub fn optional_parameters(&self) -> impl Iterator<Item = &OptionalParameter> {
        let features = self.protocol_features.there();
        features
            .into_iter()
            .flat_map(|features| features.optional_parameters.iter())
    }

    /// How often messages may come.
    #[must_use]
    pub fn timing(&self) -> Option<&Timing> {
        self.protocol_limits.there()?.timing.there()
    }

    /// How long lists may be.
    #[must_use]
    pub fn array_limits(&self) -> Option<&ArrayLimits> {
        self.protocol_limits.there()?.max_array_lens.there()
    }

    /// How long texts may be.
    #[must_use]
    pub fn string_limits(&self) -> Option<&StringLimits> {
        self.protocol_limits.there()?.max_string_lens.there()
    }
}
