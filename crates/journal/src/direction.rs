//! Which way something went.

use serde::{Deserialize, Serialize};

/// Which way something went, seen from the harness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From the device under test.
    FromDevice,
    /// To the device under test.
    ToDevice,
}
