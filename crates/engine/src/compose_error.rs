//! Why a message cannot be made.

use tck_base::pattern::Unbound;

/// Why a message cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ComposeError {
    /// A variable has no value.
    #[error("{0}")]
    Unbound(String),
    /// The course has no such node or edge.
    #[error("the course has no {0}")]
    Course(String),
    /// The patch does not fit the message.
    #[error("the patch does not fit: {0}")]
    Patch(String),
    /// There is no such topic.
    #[error("there is no topic {0}")]
    Topic(String),
}

impl From<Unbound> for ComposeError {
    fn from(unbound: Unbound) -> Self {
        Self::Unbound(unbound.to_string())
    }
}
