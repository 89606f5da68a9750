//! How a clause came out.

use tck_base::pattern::Unbound;

/// How a clause came out, before the mood of its requirement is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ClauseOutcome {
    /// It holds.
    Held,
    /// It holds, later than it should.
    HeldLate,
    /// A ruling of the catalogue asks for a warning.
    Warning,
    /// It does not hold.
    Violated,
    /// It could not be observed; the text says why.
    Unobservable(String),
}

impl ClauseOutcome {
    /// How it comes out where it is only preferred by a ruling of the catalogue: broken is a warning.
    #[must_use]
    pub(crate) fn of_preference(self) -> Self {
        match self {
            Self::Violated => Self::Warning,
            other => other,
        }
    }

    /// How a precondition comes out that is itself an obligation: it is broken when what is seen contradicts it. Coming late is
    /// no matter of it, and nothing at all shows nothing.
    #[must_use]
    pub(crate) fn of_precondition(self, seen: u64) -> Self {
        match self {
            Self::HeldLate | Self::Warning => Self::Held,
            Self::Violated if seen == 0 => Self::Unobservable("nothing came that could have shown it".to_owned()),
            other => other,
        }
    }
}

/// Why a clause cannot be weighed whose variable has no value.
pub(crate) fn unbound_text(unbound: &Unbound) -> String {
    format!("the variable ${{{}}} has no value here", unbound.name)
}
