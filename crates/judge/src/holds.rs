//! How a clause came out.

use tck_base::pattern::Unbound;

/// How a clause came out, before the mood of its requirement is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Holds {
    /// It holds.
    Yes,
    /// It holds, later than it should.
    Late,
    /// A ruling of the catalogue asks for a warning.
    Softly,
    /// It does not hold.
    No,
    /// It could not be observed; the text says why.
    Unseen(String),
}

/// Why a clause cannot be weighed whose variable has no value.
pub(crate) fn unbound_text(unbound: &Unbound) -> String {
    format!("the variable ${{{}}} has no value here", unbound.name)
}
