//! A campaign: many devices or versions and many suites, each pair a run of its own.
//!
//! [`Plan`] reads the file that names them. [`Place`] is the folder of one run: what it was begun with, how far it came, and how it
//! ended are read from there alone, so that a campaign that was killed goes on where it was. [`Summary`] is what came of all. Nothing here
//! starts a process or knows a clock; that is left to the command.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod place;
mod plan;
mod summary;

pub use place::{Place, PlaceError, Settled, Stand};
pub use plan::{Command, Entry, Plan};
pub use summary::{FORMAT, Line, Summary};
