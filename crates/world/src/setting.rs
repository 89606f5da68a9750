//! What is known of a run besides its records.

use std::collections::BTreeMap;

use serde_json::{Map, Value};
use tck_base::time::TimeLimits;
use tck_pack::{Pack, Role};

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
}

impl Setting<'_> {
    /// The topic name of a full topic that stands somewhere else than on the record: in a last will.
    #[must_use]
    pub fn topic_name(&self, full: &str) -> Option<&str> {
        let mut all = self.topics.iter();
        all.find(|(_, topic)| *topic == full).map(|(name, _)| name.as_str())
    }
}
