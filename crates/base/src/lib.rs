//! What everything stands on: time and its limits, devices as their drivers see them, verdicts, diagnostics, YAML,
//! patterns, curves and areas, secrets, and shares of work.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod clock;
pub mod device;
pub mod diagnostic;
pub mod nurbs;
pub mod pattern;
pub mod polygon;
pub mod secrets;
pub mod shard;
pub mod time;
pub mod verdict;
pub mod yaml;
