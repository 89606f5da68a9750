//! `motion/…`: how the vehicle moves, seen in its states, against the nodes and edges it was ordered over.
//!
//! States are few and late, so a check judges only what a state really shows, with a margin for what the vehicle
//! may have done between measuring and reporting. What the tests must demand is left to them.

mod axes;
mod back_on_edge;
mod corridor;
mod corridor_release;
mod curve;
mod edge_orientation;
mod edge_rotation_speed;
mod edge_speed;
mod followed;
mod mode_speed;
mod node_theta;
mod node_tolerance;
mod rotation_place;
mod velocity_sign;

pub(super) use axes::AXES;
pub(super) use back_on_edge::BACK_ON_EDGE;
pub(super) use corridor::{CORRIDOR, CORRIDOR_POINT, NEXT_CORRIDOR};
pub(super) use corridor_release::{
    CORRIDOR_ASKED, CORRIDOR_GRANTED, CORRIDOR_KEPT, CORRIDOR_LEASE, CORRIDOR_RETURNED, CORRIDOR_SHOWN,
};
pub(super) use curve::{CURVE_ORIENTATION, TRAJECTORY};
pub(super) use edge_orientation::EDGE_ORIENTATION;
pub(super) use edge_rotation_speed::EDGE_ROTATION_SPEED;
pub(super) use edge_speed::EDGE_SPEED;
pub(super) use followed::FOLLOWED;
pub(super) use mode_speed::MODE_SPEED;
pub(super) use node_theta::NODE_THETA;
pub(super) use node_tolerance::NODE_TOLERANCE;
pub(super) use rotation_place::ROTATION_PLACE;
pub(super) use velocity_sign::VELOCITY_SIGN;

use tck_base::verdict::Verdict;
use tck_check::CheckFinding;

/// What controllers overshoot and sensors see wrong: the share of a limit that is no excess yet.
const SHARE: f64 = 1.1;

/// An orientation this far from the wanted one is another one, in radians.
const TURNED: f64 = 0.35;

/// A finding on whatever the clause or the monitor is bound to.
fn found(seq: u64, message: String) -> CheckFinding {
    CheckFinding {
        requirement: None,
        verdict: None,
        seq,
        message,
        element: None,
    }
}

/// A finding that a ruling softens to a warning.
fn softly(seq: u64, message: String) -> CheckFinding {
    CheckFinding {
        verdict: Some(Verdict::Warning),
        ..found(seq, message)
    }
}

#[cfg(test)]
mod curved;
#[cfg(test)]
mod tests;
