//! A fault or liberty that a built-in device does not have.

/// A name that the built-in device does not know.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct UnknownName(pub String);
