//! Conformance test harness for VDA 5050.
//!
//! # Test a device
//!
//! A test of your own `cargo test` that tests a device by the suites of this crate; [`Tck`] says what can be chosen:
//!
//! ```
//! # fn main() -> Result<(), vda5050_tck::Error> {
//! use vda5050_tck::{Role, Tck};
//!
//! let tck = Tck::built_in(Role::Agv).select("order-rejection/lower-update-id");
//! assert!(tck.clone().run()?.conforms());
//! let outcome = tck.fault("outdated-update-taken-over").run()?;
//! assert!(!outcome.conforms(), "{outcome}");
//! # Ok(())
//! # }
//! ```
//!
//! A device of your own is the device of a profile, over real sockets, with the tests of a folder of yours beside the
//! built-in ones:
//!
//! ```no_run
//! # fn main() -> Result<(), vda5050_tck::Error> {
//! let outcome = vda5050_tck::Tck::of_profile("device.toml").suites("conformance").select("acme").run()?;
//! outcome.write("target/reports")?;
//! assert!(outcome.conforms(), "{outcome}");
//! # Ok(())
//! # }
//! ```
//!
//! A build for that needs little of the program. `default-features = false` leaves out its terminal, and what these
//! features add: `broker` is the embedded broker, for a device without one of its own, `tls` is MQTT and HTTP over TLS,
//! `captures` are recordings of other tools and traffic that is judged without a test.
//!
//! [`library`] reads suites, [`RequestBuilder`] chooses what a run takes on. Everything below stands in crates of its own,
//! which are named here, too, for the program and its tests, and give no promise to stay as they are. The folder tree is the
//! architecture; dependencies point one way, from the command line down to the verdict lattice (`tests/architecture.rs`
//! holds them).
#![forbid(unsafe_code)]
#![warn(missing_docs)]

/// The allocator of the program: half of what the tests do is to make small trees.
#[cfg(test)]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

mod assets;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
mod facade;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod ui;

pub use assets::{Own, counterparts, embedded, library};
pub use facade::{Error, Outcome, Tck};
pub use tck_base::verdict::Verdict;
pub use tck_pack::Role;
pub use tck_result::RunResult;
pub use tck_run::{Criteria, Request, RequestBuilder, Selection};

#[cfg(feature = "captures")]
#[doc(hidden)]
pub use tck_audit as audit;
#[doc(hidden)]
pub use tck_base::{clock, device, diagnostic, nurbs, pattern, secrets, shard, verdict, yaml};
#[cfg(feature = "cli")]
#[doc(hidden)]
pub use tck_campaign as campaign;
#[cfg(feature = "captures")]
#[doc(hidden)]
pub use tck_capture as capture;
#[doc(hidden)]
pub use tck_check as check;
#[doc(hidden)]
pub use tck_checks as checks;
#[doc(hidden)]
pub use tck_course as course;
#[doc(hidden)]
pub use tck_engine as engine;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub use tck_explore as explore;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub use tck_history as history;
#[doc(hidden)]
pub use tck_journal as journal;
#[doc(hidden)]
pub use tck_judge as judge;
#[doc(hidden)]
pub use tck_net::{bench, broker, link, maps, tap};
#[doc(hidden)]
pub use tck_pack as pack;
#[doc(hidden)]
pub use tck_profile as profile;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub use tck_qualify as qualify;
#[doc(hidden)]
pub use tck_reference as reference;
#[doc(hidden)]
pub use tck_report as report;
#[doc(hidden)]
pub use tck_result as result;
#[doc(hidden)]
pub use tck_run as run;
#[doc(hidden)]
pub use tck_simulate as simulate;
#[doc(hidden)]
pub use tck_suite as suite;
#[doc(hidden)]
pub use tck_view as view;
#[cfg(feature = "captures")]
#[doc(hidden)]
pub use tck_watch as watch;
#[doc(hidden)]
pub use tck_wire as wire;
