//! What a named check is: the interface between the judge and the checks.
//!
//! A [`Check`] is a small state machine over the journal entries of a run or of a window. Tests and monitors refer to it
//! by name. It documents the requirements it can decide and never reads a clock. The checks themselves are registered
//! above; the judge finds one by its name with [`find`].
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod fleet;

use std::any::{Any, TypeId};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;
use std::time::Duration;

use serde_json::{Map, Value};

pub use fleet::{FleetSeen, device_publish, takes};

use tck_base::verdict::Verdict;
use tck_journal::Entry;
use tck_pack::{Pack, RequirementId, Role};

/// What a check may know besides the entries.
#[derive(Clone, Copy, Debug)]
pub struct CheckContext<'a> {
    /// The protocol version.
    pub pack: &'a Pack,
    /// Full topic by topic name.
    pub topics: &'a std::collections::BTreeMap<String, String>,
    /// The side under test.
    pub role: Role,
    /// Manufacturer and serial number of the device, or of the vehicle a master control commands.
    pub identity: (&'a str, &'a str),
    /// Arguments given by the test or monitor, variables filled in.
    pub with: &'a Map<String, Value>,
    /// The run's bindings: `time`, `device`, ….
    pub bindings: &'a Map<String, Value>,
    /// What all checks of the same entries work out once.
    pub shared: &'a Shared,
}

/// What several checks want to know of the same entries, worked out by the first that asks. One for each series of
/// entries: the monitors of a vehicle share one, a check in a test has its own.
#[derive(Default)]
pub struct Shared {
    trackers: RefCell<HashMap<TypeId, Rc<dyn Any>>>,
    /// What came to the other vehicles as well; nothing for a check in a test.
    pub fleet: Rc<RefCell<FleetSeen>>,
}

impl Shared {
    /// Facts for the monitors of one vehicle of a fleet.
    #[must_use]
    pub fn of_fleet(fleet: &Rc<RefCell<FleetSeen>>) -> Self {
        Self {
            fleet: Rc::clone(fleet),
            ..Self::default()
        }
    }

    /// The tracker of a type, made when it is first asked for.
    #[must_use]
    pub fn of<T: Default + 'static>(&self) -> Rc<RefCell<T>> {
        let mut trackers = self.trackers.borrow_mut();
        let known = trackers.get(&TypeId::of::<T>()).map(Rc::clone);
        if let Some(known) = known.and_then(|known| known.downcast::<RefCell<T>>().ok()) {
            return known;
        }
        let tracker = Rc::new(RefCell::new(T::default()));
        trackers.insert(TypeId::of::<T>(), tracker.clone());
        tracker
    }
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
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
    fn finish(&mut self, end: tck_base::clock::Moment, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
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

/// The check of that name among these.
#[must_use]
pub fn find(checks: &'static [Check], name: &str) -> Option<&'static Check> {
    checks.iter().find(|check| check.name == name)
}
