//! What an evaluator may look at.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::{Map, Value};

use super::timeline::Timeline;
use tck_base::pattern::Bindings;
use tck_base::time::TimeLimits;
use tck_check::Check;
use tck_journal::Entry;
use tck_journal::event::Waiver;
use tck_pack::{Hooks, Pack, Role};
use tck_world::Setting;

/// Everything around a step.
#[derive(Clone, Copy)]
pub struct EvalContext<'a> {
    /// The named checks.
    pub checks: &'static [Check],
    /// The protocol version.
    pub pack: &'a Pack,
    /// Full topic by topic name.
    pub topics: &'a BTreeMap<String, String>,
    /// The side under test.
    pub role: Role,
    /// Manufacturer and serial number.
    pub identity: (&'a str, &'a str),
    /// The run's own bindings: `time`, `device`.
    pub run_bindings: &'a Map<String, Value>,
    /// How long something may take.
    pub time: &'a TimeLimits,
    /// What can be done to the device, and what follows from it.
    pub hooks: &'a Hooks,
    /// All variables of the test.
    pub bindings: &'a Bindings,
    /// By subject.
    pub timeline: &'a Timeline,
    /// All entries of the test so far.
    pub entries: &'a [Arc<Entry>],
    /// Lasting mistakes of the vehicle that do not stand in the way any more.
    pub waivers: &'a [Waiver],
}

impl<'a> EvalContext<'a> {
    /// What a check and the facts it reads may know besides the records.
    pub(super) fn setting(&self) -> Setting<'a> {
        Setting {
            pack: self.pack,
            topics: self.topics,
            role: self.role,
            identity: self.identity,
            bindings: self.run_bindings,
            time: self.time,
            hooks: self.hooks,
        }
    }
}
