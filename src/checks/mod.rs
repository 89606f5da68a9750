//! Named checks: what patterns cannot say.
//!
//! A [`Check`] is a small state machine over the journal entries of a run or of a window. Tests and monitors
//! refer to it by name. It documents the requirements it can decide and never reads a clock.

use std::time::Duration;

use serde_json::{Map, Value};

use crate::journal::Entry;
use crate::pack::{Pack, RequirementId};
use crate::verdict::Verdict;

/// What a check may know besides the entries.
#[derive(Clone, Copy, Debug)]
pub struct CheckContext<'a> {
    /// The protocol version.
    pub pack: &'a Pack,
    /// Full topic by topic name.
    pub topics: &'a std::collections::BTreeMap<String, String>,
    /// Manufacturer and serial number of the device.
    pub identity: (&'a str, &'a str),
    /// Arguments given by the test or monitor, variables filled in.
    pub with: &'a Map<String, Value>,
    /// The run's bindings: `time`, `device`, ….
    pub bindings: &'a Map<String, Value>,
}

impl CheckContext<'_> {
    /// The topic name of a full topic.
    #[must_use]
    pub fn topic_name(&self, full: &str) -> Option<&str> {
        self.topics
            .iter()
            .find(|(_, topic)| *topic == full)
            .map(|(name, _)| name.as_str())
    }

    /// A duration of `time.*`, in milliseconds in the bindings.
    #[must_use]
    pub fn time(&self, name: &str) -> Option<Duration> {
        let millis = self.bindings.get("time")?.get(name)?.as_u64()?;
        Some(Duration::from_millis(millis))
    }
}

/// Something a check found.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckFinding {
    /// The requirement that is broken; `None` means: whatever the clause is bound to.
    pub requirement: Option<RequirementId>,
    /// Softer or harder than the mood of the requirement; `None` follows the mood.
    pub verdict: Option<Verdict>,
    /// The entry that shows it.
    pub seq: u64,
    /// One line.
    pub message: String,
}

/// A running check.
pub trait Running {
    /// Sees one entry. Findings are appended; returns whether the entry was judged at all.
    fn observe(&mut self, entry: &Entry, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool;

    /// The window has ended at `end`.
    fn finish(&mut self, end: crate::clock::Moment, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
        let _ = (end, context, findings);
    }
}

/// A named check.
pub struct Check {
    /// Name, such as `order/remaining-route`.
    pub name: &'static str,
    /// Requirements it can decide.
    pub decides: &'static [&'static str],
    /// What it holds true, for `explain`.
    pub doc: &'static str,
    /// Names of arguments it takes.
    pub arguments: &'static [&'static str],
    /// Starts it.
    pub start: fn(&CheckContext<'_>) -> Box<dyn Running>,
}

/// All named checks.
#[must_use]
pub fn registry() -> &'static [Check] {
    &[]
}

/// The check of a name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Check> {
    registry().iter().find(|check| check.name == name)
}
