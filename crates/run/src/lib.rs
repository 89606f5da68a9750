//! One run: admit the device, plan, drive the engine test by test, own the result bundle.
//!
//! What is sent in a test is the engine's business, what it means the judge's. This module decides which
//! tests run, in which order, from where the vehicle stands, and what happens between two tests.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod admission;
mod answering;
mod bindings;
mod bundle;
pub mod capabilities;
mod claims;
pub mod device;
mod discover;
mod dispatching;
mod draft;
mod draw;
mod estimate;
mod factsheet_limits;
mod files;
mod fitting;
mod floor;
mod header;
pub mod hooks;
mod identity;
mod idle;
mod lasting;
mod latest;
mod live_run;
mod operators;
mod outputs;
mod overheard;
mod pace;
mod person;
mod plan;
mod precondition_breaker;
mod presence;
mod program;
mod questions;
mod recovery;
mod request;
mod reset;
mod risk;
mod selection;
mod session;
mod setup;
mod share;
mod sheet;
mod site;
pub mod supervisor;
mod time_left;
mod virtual_run;
mod zones;

pub use answering::{Answering, AnsweringError};
pub use bundle::{Bundle, BundleError, JOURNAL, write_whole};
pub use capabilities::Capabilities;
pub use discover::{Device, Heard, Position, listen};
pub use draft::{Wishes, draft, draft_master_control};
pub use estimate::in_words;
pub use floor::{Floor, Wanting};
pub use header::HeaderParts;
pub use latest::{LATEST, forget_latest, newest};
pub use live_run::{Hold, LiveRun, ProfileContext, RunError};
pub use outputs::{OutputError, sources, write_all, write_joined, write_result};
pub use overheard::Overheard;
pub use person::{Answer, Person, Place, Reply, Wanted};
pub use plan::{How, PlanLine, RunPlan, Use, Waits, prompts};
pub use questions::{Board, Question};
pub use request::{Request, RequestBuilder};
pub use selection::{Criteria, Selection, SelectionError, matches, meant, select};
pub use session::{ENDS_WITHIN, End, Finished, Progress, Setup, run};
pub use setup::{BenchFacts, DeviceUnderTest, fleet_names, pack_of};
pub use sheet::Sheet;
pub use virtual_run::{Silent, VirtualRun, going_on_at, run_silently, run_virtually};
