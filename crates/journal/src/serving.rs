//! How a map is served, well or badly.

/// How a map file is served.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ServeBehaviour {
    /// As it should be.
    #[default]
    Well,
    /// 404.
    NotFound,
    /// The connection is accepted and nothing ever comes.
    Stall,
    /// Half the body, then the connection is cut.
    Cut,
    /// Other bytes than the ones that were hashed.
    WrongBytes,
    /// Slowly.
    Slow,
    /// The port refuses connections.
    Unreachable,
}

impl ServeBehaviour {
    /// The word used in suites and journals.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Well => "well",
            Self::NotFound => "not-found",
            Self::Stall => "stall",
            Self::Cut => "cut",
            Self::WrongBytes => "wrong-bytes",
            Self::Slow => "slow",
            Self::Unreachable => "unreachable",
        }
    }
}
