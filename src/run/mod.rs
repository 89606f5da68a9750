//! One run: admit the device, plan, drive the engine test by test, own the result bundle.
//!
//! What is sent in a test is the engine's business, what it means the judge's. This module decides which
//! tests run, in which order, from where the vehicle stands, and what happens between two tests.

mod admission;
mod between;
mod bindings;
mod bundle;
pub mod capabilities;
pub mod device_peer;
mod session;

pub use bundle::{Bundle, BundleError};
pub use capabilities::Capabilities;
pub use session::{End, Progress, Setup, run};
