//! Reference devices: sans-IO state machines, with faults that prove the checks.
//!
//! A reference device is handed inputs and the time and hands back outputs; it owns no socket, no clock and
//! no randomness. What connects one to a broker is `link::memory` of `tck-net`, in virtual time, and the driver of
//! `tck-simulate`.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[macro_use]
mod hooks;
pub mod agv;
pub mod deviations;
pub mod master_control;

pub use tck_base::device::{ConnectOptions, Device, Download, Input, Output, Publication};

/// One switchable defect of a reference device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fault {
    /// Name, in kebab-case, such as `outdated-update-taken-over`.
    pub name: &'static str,
    /// The requirements it breaks. The first one is the one it is about.
    pub breaks: &'static [&'static str],
    /// Sentence that says what is wrong with the device.
    pub wrong: &'static str,
}

/// One switchable tolerance of a reference device: what a good device may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tolerance {
    /// Name, in kebab-case, such as `every-state-twice`.
    pub name: &'static str,
    /// The requirements that leave it to the device.
    pub under: &'static [&'static str],
    /// Sentence that says what the device does.
    pub does: &'static str,
}
