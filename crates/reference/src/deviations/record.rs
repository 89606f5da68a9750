//! A deviation as one record: its name, what it breaks or which tolerance it is, what it does in one sentence, and how it
//! is made.
//!
//! The behaviour is an implementation of the trait `Deviation` of a role, with a memory of its own. Roles collect their
//! records in constant lists, one file for each topic.

use crate::{Fault, Tolerance};

/// Kind of a deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A defect: a test or monitor fails because of it.
    Fault,
    /// A defect that ends in a warning, and why it is no more than that.
    Lapse(&'static str),
    /// What a good device may do: nobody may be accused because of it.
    Tolerance,
}

/// One deviation of a role, as an implementation of its trait `D`.
#[derive(Debug)]
pub struct Record<D: ?Sized + 'static> {
    /// Name, in kebab-case; it says what the device does.
    pub name: &'static str,
    /// Fault, lapse or tolerance.
    pub kind: Kind,
    /// Ids of the requirements it breaks, the first being the one it is about; of a tolerance those that leave it.
    pub requirements: &'static [&'static str],
    /// Sentence that says what the device does.
    pub does: &'static str,
    /// Names of deviations that cannot be had together with it.
    pub excludes: &'static [&'static str],
    /// Makes one with a fresh memory.
    pub make: fn() -> Box<D>,
}

impl<D: ?Sized + 'static> Record<D> {
    const fn new(
        kind: Kind,
        name: &'static str,
        requirements: &'static [&'static str],
        does: &'static str,
        make: fn() -> Box<D>,
    ) -> Self {
        Self {
            name,
            kind,
            requirements,
            does,
            excludes: &[],
            make,
        }
    }

    /// A defect.
    #[must_use]
    pub const fn fault(
        name: &'static str,
        requirements: &'static [&'static str],
        does: &'static str,
        make: fn() -> Box<D>,
    ) -> Self {
        Self::new(Kind::Fault, name, requirements, does, make)
    }

    /// A tolerance: something that a good device may do.
    #[must_use]
    pub const fn tolerance(
        name: &'static str,
        requirements: &'static [&'static str],
        does: &'static str,
        make: fn() -> Box<D>,
    ) -> Self {
        Self::new(Kind::Tolerance, name, requirements, does, make)
    }

    /// Makes it a defect that ends in a warning, and says why.
    #[must_use]
    pub const fn lapse(mut self, why: &'static str) -> Self {
        self.kind = Kind::Lapse(why);
        self
    }

    /// Names deviations that cannot be had together with it.
    #[must_use]
    pub const fn excluding(mut self, others: &'static [&'static str]) -> Self {
        self.excludes = others;
        self
    }

    /// Whether it is a defect.
    #[must_use]
    pub const fn is_fault(&self) -> bool {
        matches!(self.kind, Kind::Fault | Kind::Lapse(_))
    }

    /// Whether a good device may do it.
    #[must_use]
    pub const fn is_tolerance(&self) -> bool {
        matches!(self.kind, Kind::Tolerance)
    }
}

/// All records of a role, by topic.
pub(super) struct Records<D: ?Sized + 'static>(pub(super) &'static [&'static [Record<D>]]);

impl<D: ?Sized> Records<D> {
    /// The records in the order in which they are listed.
    pub(super) fn iter(&self) -> impl Iterator<Item = &'static Record<D>> {
        self.0.iter().copied().flatten()
    }

    /// The record of a fault, lapse or tolerance.
    pub(super) fn find(&self, name: &str) -> Option<&'static Record<D>> {
        self.iter().find(|record| record.name == name)
    }

    /// The record of a fault or lapse.
    pub(super) fn fault(&self, name: &str) -> Option<&'static Record<D>> {
        self.find(name).filter(|record| record.is_fault())
    }

    /// The record of a tolerance.
    pub(super) fn tolerance(&self, name: &str) -> Option<&'static Record<D>> {
        self.find(name).filter(|record| record.is_tolerance())
    }

    /// The faults and lapses.
    pub(super) fn faults(&self) -> Vec<Fault> {
        let faults = self.iter().filter(|record| record.is_fault());
        let faults = faults.map(|record| Fault {
            name: record.name,
            breaks: record.requirements,
            wrong: record.does,
        });
        faults.collect()
    }

    /// The tolerances.
    pub(super) fn tolerances(&self) -> Vec<Tolerance> {
        let tolerances = self.iter().filter(|record| record.is_tolerance());
        let tolerances = tolerances.map(|record| Tolerance {
            name: record.name,
            under: record.requirements,
            does: record.does,
        });
        tolerances.collect()
    }

    /// The reason why a fault ends in less than a failure.
    pub(super) fn lapse(&self, name: &str) -> Option<&'static str> {
        match self.find(name)?.kind {
            Kind::Lapse(why) => Some(why),
            _ => None,
        }
    }
}
