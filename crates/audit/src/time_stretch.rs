//! A stretch of the time of a vehicle.

use serde::{Deserialize, Serialize};

/// A stretch of the time of a vehicle, which was judged by itself.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TimeStretch {
    /// Its number, counted from 1.
    pub number: u64,
    /// When it begins, where the recording has times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
}
