//! What is known of a run besides its records.

use std::collections::BTreeMap;

use serde_json::{Map, Value};
use tck_base::time::TimeLimits;
use tck_pack::{HookInfo, Hooks, Pack, Role};

/// What does not change from record to record.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// The protocol version.
    pub pack: &'a Pack,
    /// Full topic by topic name.
    pub topics: &'a BTreeMap<String, String>,
    /// The side under test.
    pub role: Role,
    /// Manufacturer and serial number of the device, or of the vehicle a master control commands.
    pub identity: (&'a str, &'a str),
    /// The run's bindings, such as `time` and `device`.
    pub bindings: &'a Map<String, Value>,
    /// How long something may take.
    pub time: &'a TimeLimits,
    /// What can be done to the device, and what follows from it.
    pub hooks: &'a Hooks,
}

impl<'a> Setting<'a> {
    /// What is known of a hook for the side under test; nothing of one that the suites do not have.
    #[must_use]
    pub fn hook(&self, name: &str) -> Option<&'a HookInfo> {
        self.hooks.find(name, self.role)
    }
}
