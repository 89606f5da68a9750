//! Everything a reference device can do otherwise than a conformant one: faults, lapses, tolerances and personas.
//!
//! A deviation is one record in one place ([`record`]), in the file of its topic below the folder of its role. It takes
//! hold at the hook points of its role only, and is called what it does. What most deviations change is what a message
//! says; [`json_edit`] makes that short.

#[macro_use]
mod records;
pub mod agv;
pub mod json_edit;
pub mod master_control;
pub mod personas;
pub mod record;

pub use record::{Kind, Record};
