//! Conformance test harness for VDA 5050.
//!
//! The folder tree is the architecture; dependencies point one way, from the command line down to the
//! verdict lattice (`tests/architecture.rs` holds them). Start reading at [`verdict`], then [`journal`],
//! [`suite::model`] and [`judge`].
//!
//! # Test a device
//!
//! The device of a profile, over real sockets; [`run::SocketRun`] says what can be chosen:
//!
//! ```no_run
//! use std::path::Path;
//! use vda5050_tck::profile::{self, Surroundings};
//! use vda5050_tck::run::{Library, Place, RunError, SocketRun};
//!
//! # fn main() -> Result<(), RunError> {
//! let library = Library::load(None)?;
//! let pack = library.rules.packs.latest();
//! let surroundings = Surroundings::of_process();
//! let profile = profile::load(Some(Path::new("device.toml")), &[], &surroundings)?;
//! let run = SocketRun::of_profile(&profile, &library, pack, &surroundings, Place::default())?;
//! let finished = run.carry_out_silently(&library, pack)?;
//! println!("{:?}", finished.result.verdict);
//! # Ok(())
//! # }
//! ```
//!
//! A built-in device in virtual time, with one of its faults:
//!
//! ```
//! use vda5050_tck::run::{Library, RunError, VirtualRun, run_silently};
//! use vda5050_tck::verdict::Verdict;
//!
//! # fn main() -> Result<(), RunError> {
//! let library = Library::load(None)?;
//! let pack = library.rules.packs.latest();
//! let mut run = VirtualRun::of(&library, pack);
//! run.tests.retain(|test| test.id == "order-rejection/lower-update-id");
//! run.faults = vec!["outdated-update-taken-over".to_owned()];
//! let finished = run_silently(&library, pack, run)?;
//! assert_eq!(finished.result.verdict, Some(Verdict::Fail));
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]
#![warn(missing_docs)]

/// The allocator of the program: half of what the tests do is to make small trees.
#[cfg(test)]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

pub mod audit;
pub mod bench;
pub mod broker;
pub mod capture;
pub mod checks;
pub mod cli;
pub mod clock;
pub mod course;
pub mod diagnostic;
pub mod engine;
pub mod explore;
pub mod journal;
pub mod judge;
pub mod link;
pub mod maps;
pub mod nurbs;
pub mod pack;
pub mod pattern;
pub mod profile;
pub mod qualify;
pub mod reference;
pub mod report;
pub mod result;
pub mod run;
pub mod simulate;
pub mod suite;
pub mod tap;
pub mod ui;
pub mod verdict;
pub mod watch;
pub mod yaml;
