//! The transparent tap between the device under test and the broker.
//!
//! It forwards bytes, decodes a copy, reports both as occurrences and injects link faults. It judges nothing.

pub mod faults;
pub mod wire;
