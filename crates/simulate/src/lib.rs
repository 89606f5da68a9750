//! The built-in devices: reference devices as devices under test and as mock AGVs, over real sockets and on the bench in
//! memory, and the hooks they understand.
//!
//! How they behave is the business of `reference`; what they are like to a run stands here.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod built_in;
mod counterpart;
pub mod driver;
mod fetching;
mod fleet;
mod hook_server;
mod reference_agv;
mod reference_master_control;
mod running_fleet;
mod site;
mod unknown_name;
mod witness;

pub use built_in::BuiltIn;
pub use counterpart::{Counterpart, Counterparts, Deviation, DeviationKind, Habit, Imitation};
pub use fleet::{Fleet, Leavings, USUAL_FLEET, serial_number};
pub use hook_server::HookServer;
pub use reference_agv::{ReferenceAgv, Vehicle};
pub use reference_master_control::ReferenceMasterControl;
pub use running_fleet::WithFleet;
pub use site::{Impairment, Injected, KINDS, Kind, Messages, Recorded, Site, SiteMessage};
pub use unknown_name::UnknownName;
