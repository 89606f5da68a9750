//! From where the harness can see.

/// From where the harness can see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Vantage {
    /// Every packet of the device.
    Tap,
    /// Only what the broker delivers.
    Subscriber,
}

impl Vantage {
    /// The word used in records and results.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Tap => "tap",
            Self::Subscriber => "subscriber",
        }
    }
}
