//! The page for the people beside the device: what a run does and waits for, and the answers that a person may give there.
//!
//! A run tells a [`Page`] what happens, a [`PageServer`] shows it in browsers, and what a person presses there goes to a
//! [`Desk`]. The page decides nothing: it is one more reader of what is told, and a run is the same without it.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod address;
mod assets;
mod desk;
mod floor;
mod model;
mod parts;
mod server;
mod shown;
mod told;
mod visitors;

pub use address::{qr_code, reachable};
pub use desk::{Choice, Desk, Nobody};
pub use floor::{FleetVehicle, Floor, FloorEdge, FloorNode, RoutePart, VehicleOnFloor};
pub use model::Page;
pub use server::{PageError, PageServer};
pub use told::{Facts, Finding, Outcome, Planned, Prompt, StepFacts, TestFacts, Way};

#[cfg(test)]
mod tests;
