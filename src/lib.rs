//! Conformance test harness for VDA 5050.
//!
//! The folder tree is the architecture; dependencies point one way, from the command line down to the
//! verdict lattice (`tests/architecture.rs` holds them). Start reading at [`verdict`], then [`journal`],
//! [`suite::model`] and [`judge`].
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod broker;
pub mod checks;
pub mod cli;
pub mod clock;
pub mod course;
pub mod diagnostic;
pub mod engine;
pub mod journal;
pub mod judge;
pub mod link;
pub mod maps;
pub mod nurbs;
pub mod pack;
pub mod pattern;
pub mod profile;
pub mod reference;
pub mod report;
pub mod result;
pub mod run;
pub mod suite;
pub mod tap;
pub mod ui;
pub mod verdict;
pub mod yaml;
