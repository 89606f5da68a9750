//! Where a state shows the vehicle.

use serde_json::Value;

use crate::members::kept;

/// A number member that can be calculated with.
pub(crate) fn finite(value: &Value, name: &str) -> Option<f64> {
    value.get(name)?.as_f64().filter(|number| number.abs() < 1e9)
}

/// agvPosition, where it is initialized and complete.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// mapId.
    pub map: String,
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// Radians.
    pub theta: f64,
}

impl Pose {
    /// Of a state.
    #[must_use]
    pub fn read(state: &Value) -> Option<Self> {
        let position = state.get("agvPosition")?;
        let initialized = position.get("positionInitialized").and_then(Value::as_bool);
        (initialized == Some(true)).then_some(())?;
        Some(Self {
            map: kept(position, "mapId"),
            x: finite(position, "x")?,
            y: finite(position, "y")?,
            theta: finite(position, "theta").filter(|theta| theta.abs() < 3.2)?,
        })
    }
}
