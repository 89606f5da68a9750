//! What a vehicle does in zones, and about zone sets.

mod actions;
mod aside;
mod blocked;
mod contour;
mod directed;
mod line_guided;
mod listed;
mod release;
#[cfg(test)]
mod release_tests;
mod replanning;
#[cfg(test)]
mod replanning_tests;
mod requests;
mod sets;
mod speed;
#[cfg(test)]
mod tests;

pub(super) use actions::ZONE_ACTIONS;
pub(super) use aside::{AROUND, PATH_AROUND};
pub(super) use blocked::BLOCKED;
pub(super) use contour::CONTOUR;
pub(super) use directed::DIRECTED;
pub(super) use line_guided::LINE_GUIDED;
pub(super) use listed::{ACTIONS_LISTED, REQUESTS_LISTED};
pub(super) use release::{
    RELEASE_ASKED, RELEASE_CONTOUR, RELEASE_GRANTED, RELEASE_KEPT, REPLANNING_ASKED, REPLANNING_GRANTED,
};
pub(super) use replanning::{REPLANNING_PATH, REPLANNING_SENT};
pub(super) use requests::ZONE_REQUESTS;
pub(super) use sets::ZONE_SETS;
pub(super) use speed::SPEED;

use tck_view::StateView;

/// Modes in which the vehicle goes where it is ordered to.
fn drives_by_order(state: &StateView) -> bool {
    state.operating_mode.is("AUTOMATIC") || state.operating_mode.is("SEMIAUTOMATIC")
}
