//! What everything stands on: time and its limits, devices as their drivers see them, verdicts, diagnostics, YAML,
//! patterns, curves and secrets.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod clock;
pub mod device;
pub mod diagnostic;
pub mod nurbs;
pub mod pattern;
pub mod secrets;
pub mod time;
pub mod verdict;
pub mod yaml;
