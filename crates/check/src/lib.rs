//! What a named check is: the interface between the judge and the checks.
//!
//! A [`Check`] is a small state machine over the records of a run or of a window. Tests and monitors refer to it by name. It
//! documents the requirements it can decide, says what it listens to and which facts it reads, and never reads a clock. The
//! checks themselves are registered above; the judge finds one by its name with [`find`].
#![forbid(unsafe_code)]
#![warn(missing_docs)]

use std::any::{Any, TypeId};
use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::Deref;
use std::rc::Rc;

use serde_json::{Map, Value};
use tck_base::verdict::Verdict;
use tck_pack::RequirementId;
use tck_view::Field;
use tck_world::{End, Fact, Listen, Observation, Setting, World};

/// What a check may know besides the records.
#[derive(Clone, Copy, Debug)]
pub struct CheckContext<'a> {
    /// What is known of the run.
    pub setting: Setting<'a>,
    /// Arguments given by the test or monitor, variables filled in.
    pub with: &'a Map<String, Value>,
    /// What is known of the vehicle, the present record included.
    pub world: &'a World,
    /// What several checks of the same records work out once.
    pub shared: &'a Shared,
}

impl<'a> Deref for CheckContext<'a> {
    type Target = Setting<'a>;

    fn deref(&self) -> &Self::Target {
        &self.setting
    }
}

/// What several checks look for in the same records, worked out by the first that asks. One for each series of records: the
/// monitors of a vehicle share one, a check in a test has its own.
#[derive(Default)]
pub struct Shared {
    machines: RefCell<HashMap<TypeId, Rc<dyn Any>>>,
}

impl Shared {
    /// The machine of a type, made when it is first asked for.
    #[must_use]
    pub fn of<T: Default + 'static>(&self) -> Rc<RefCell<T>> {
        let mut machines = self.machines.borrow_mut();
        let known = machines.get(&TypeId::of::<T>()).map(Rc::clone);
        if let Some(known) = known.and_then(|known| known.downcast::<RefCell<T>>().ok()) {
            return known;
        }
        let machine = Rc::new(RefCell::new(T::default()));
        machines.insert(TypeId::of::<T>(), machine.clone());
        machine
    }
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}

/// Something a check found.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckFinding {
    /// The requirement that is broken; `None` means: whatever the clause is bound to.
    pub requirement: Option<RequirementId>,
    /// Softer or harder than the mood of the requirement; `None` follows the mood.
    pub verdict: Option<Verdict>,
    /// The record that shows it.
    pub seq: u64,
    /// One line.
    pub message: String,
    /// The element of a list that it is about, by its id.
    pub element: Option<String>,
}

/// A running check.
pub trait Running {
    /// Sees one record it listens to. Findings are appended; returns whether the record was judged at all.
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool;

    /// The window has ended.
    fn finish(&mut self, end: &End, context: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) {
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
    /// The records it is shown, and no others.
    pub listens: &'static [Listen],
    /// The facts it reads.
    pub reads: &'static [Fact],
    /// Members of messages it cannot do without: a version that lacks one has nothing for it to look at.
    pub needs: &'static [Field],
    /// Starts it.
    pub start: fn(&CheckContext<'_>) -> Box<dyn Running>,
}

/// The check of that name among these.
#[must_use]
pub fn find(checks: &'static [Check], name: &str) -> Option<&'static Check> {
    checks.iter().find(|check| check.name == name)
}
