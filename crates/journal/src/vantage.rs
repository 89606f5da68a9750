//! From where the harness can see, and which way something goes before its eyes.

use serde::{Deserialize, Serialize};

/// From where the harness can see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
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

/// Which way something went, seen from the harness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From the device under test.
    FromDevice,
    /// To the device under test.
    ToDevice,
}
