//! Runs: joins devices, benches and the engine.

pub mod device_driver;
pub mod device_peer;
