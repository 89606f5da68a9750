//! What was just found, for those who watch.

use serde::Serialize;

use tck_base::verdict::Verdict;

/// One finding at the moment it is made.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Found {
    /// Manufacturer of the vehicle.
    pub manufacturer: String,
    /// Its serial number.
    pub serial_number: String,
    /// Which side is meant: `agv`, or `master-control` for what is said to the vehicle.
    pub role: String,
    /// Id of the monitor.
    pub monitor: String,
    /// The requirement.
    pub requirement: String,
    /// The verdict.
    pub verdict: Verdict,
    /// How often this was found by now.
    pub count: u64,
    /// How often it was found before.
    pub before: u64,
    /// Number of the message that shows it, counted from 1.
    pub message: u64,
    /// When.
    pub at: String,
    /// What is wrong.
    pub text: String,
    /// The ruling it rests on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpretation: Option<String>,
}

/// Whose topic it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Key that all topics of one vehicle share, and no other.
    pub vehicle: String,
    /// Manufacturer; empty where the topic does not say it.
    pub manufacturer: String,
    /// Serial number.
    pub serial_number: String,
    /// Name of the topic, such as `state`.
    pub name: String,
}
