//! The result model and its renderings; pure functions, no clock, no network.

pub mod result;
