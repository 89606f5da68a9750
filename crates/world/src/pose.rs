//! Where a state shows the vehicle.

use tck_view::{Member, Number, StateView};

/// Whether a number can be calculated with.
pub(crate) fn is_sane(number: f64) -> bool {
    number.abs() < 1e9
}

/// A number that can be calculated with.
pub(crate) fn sane(member: &Member<Number>) -> Option<f64> {
    member.float().filter(|number| is_sane(*number))
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
    pub fn read(state: &StateView) -> Option<Self> {
        let position = state
            .position
            .there()
            .filter(|position| position.initialized.is(true))?;
        Some(Self {
            map: position.map_id.or_empty().to_owned(),
            x: sane(&position.x)?,
            y: sane(&position.y)?,
            theta: sane(&position.theta).filter(|theta| theta.abs() < 3.2)?,
        })
    }
}
