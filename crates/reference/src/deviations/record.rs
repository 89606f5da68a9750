//! A deviation as one record: its name, what it breaks or which liberty it takes, what it does in one sentence, and how
//! it is made.
//!
//! The behaviour is an implementation of the trait at the seam of a role, with a memory of its own. Roles collect
//! their records in constant lists, one file for each topic.

/// What a deviation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A defect: a test or monitor fails because of it.
    Fault,
    /// A defect that ends in a warning, and why it is no more than that.
    Lapse(&'static str),
    /// What a good device may do: nobody may be accused because of it.
    Liberty,
}

/// One deviation of a role whose seam is the trait `D`.
#[derive(Debug)]
pub struct Record<D: ?Sized + 'static> {
    /// Name, in kebab-case; it says what the device does.
    pub name: &'static str,
    /// Fault, lapse or liberty.
    pub kind: Kind,
    /// Ids of the requirements it breaks, the first being the one it is about; of a liberty those that leave it.
    pub requirements: &'static [&'static str],
    /// What the device does, in one sentence.
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

    /// What a good device may do.
    #[must_use]
    pub const fn liberty(
        name: &'static str,
        requirements: &'static [&'static str],
        does: &'static str,
        make: fn() -> Box<D>,
    ) -> Self {
        Self::new(Kind::Liberty, name, requirements, does, make)
    }

    /// The same, as a defect that ends in a warning because of this.
    #[must_use]
    pub const fn lapse(mut self, why: &'static str) -> Self {
        self.kind = Kind::Lapse(why);
        self
    }

    /// The same, which cannot be had together with these.
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
    pub const fn is_liberty(&self) -> bool {
        matches!(self.kind, Kind::Liberty)
    }
}
