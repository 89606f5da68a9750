//! One run: admit the device, plan, drive the engine test by test, own the result bundle.
//!
//! What is sent in a test is the engine's business, what it means the judge's. This module decides which
//! tests run, in which order, from where the vehicle stands, and what happens between two tests.

mod admission;
mod between;
mod bindings;
mod built_in;
mod bundle;
pub mod capabilities;
mod claims;
pub mod device_driver;
pub mod device_peer;
mod dispatching;
mod draw;
mod estimate;
mod fits;
mod fleet;
mod header;
mod hook_server;
pub mod hooks;
mod ladder;
mod lasting;
mod library;
mod outputs;
mod over_sockets;
mod pace;
mod qualify;
mod reference_agv;
mod reference_master_control;
mod rest;
mod risk;
mod running_fleet;
mod session;
mod setup;
mod strikes;
mod virtual_run;

pub use built_in::{BuiltIn, UnknownName};
pub use bundle::{Bundle, BundleError};
pub use capabilities::Capabilities;
pub use fleet::{Fleet, USUAL_FLEET};
pub use header::{HeaderParts, Subject, tool};
pub use hook_server::HookServer;
pub use library::Library;
pub use outputs::{OutputError, sources, write_all, write_result};
pub use over_sockets::{Place, RunError, SocketRun};
pub use qualify::{Decider, Kill, Qualification, decided, qualify, qualify_tests};
pub use reference_agv::{ReferenceAgv, Vehicle};
pub use reference_master_control::ReferenceMasterControl;
pub use session::{End, Finished, Progress, Setup, run};
pub use setup::{BenchFacts, DeviceUnderTest, Request};
pub use virtual_run::{Silent, VirtualRun, run_silently, run_virtually};
