//! A case that a schema makes.

use crate::pack::Way;

/// One of many cases that come from a schema, of which a run takes some.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drawn {
    /// The topic whose schema it is.
    pub topic: String,
    /// How a member is broken.
    pub way: Way,
    /// How many cases of the table a run takes.
    pub draw: usize,
}
