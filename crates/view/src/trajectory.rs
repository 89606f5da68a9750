//! Trajectories, in orders and states alike.

use crate::{List, Member, Number};

view! {
    /// A NURBS curve.
    Trajectory as "trajectory" {
        /// Degree of the curve.
        degree: Number = "degree",
        /// Knots.
        knot_vector: List<Member<Number>> = "knotVector",
        /// Points that pull the curve.
        control_points: List<ControlPoint> = "controlPoints",
    }
}

view! {
    /// A control point of a curve.
    ControlPoint as "controlPoint" {
        /// In metres.
        x: Number = "x",
        /// In metres.
        y: Number = "y",
        /// How strongly it pulls.
        weight: Number = "weight",
    }
}
