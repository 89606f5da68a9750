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
//! use vda5050_tck::run::{Place, RunError, SocketRun};
//!
//! # fn main() -> Result<(), RunError> {
//! let library = vda5050_tck::library(None)?;
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
//! use vda5050_tck::run::{RunError, VirtualRun, run_silently};
//! use vda5050_tck::verdict::Verdict;
//!
//! # fn main() -> Result<(), RunError> {
//! let library = vda5050_tck::library(None)?;
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

mod assets;
pub mod cli;
pub mod ui;

pub use assets::{Own, embedded, library};
pub use tck_audit as audit;
pub use tck_base::{clock, diagnostic, nurbs, pattern, secrets, verdict, yaml};
pub use tck_capture as capture;
pub use tck_check as check;
pub use tck_checks as checks;
pub use tck_course as course;
pub use tck_engine as engine;
pub use tck_explore as explore;
pub use tck_journal as journal;
pub use tck_judge as judge;
pub use tck_net::{bench, broker, link, maps, tap};
pub use tck_pack as pack;
pub use tck_profile as profile;
pub use tck_qualify as qualify;
pub use tck_reference as reference;
pub use tck_report as report;
pub use tck_result as result;
pub use tck_run as run;
pub use tck_simulate as simulate;
pub use tck_suite as suite;
pub use tck_view as view;
pub use tck_watch as watch;
pub use tck_wire as wire;
