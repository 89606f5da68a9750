//! What a run is about, and what it is going to do.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest as _, Sha256};

use super::Reason;
use super::payload::hex;
use tck_base::shard::ChosenShard;

/// One effective setting and where it came from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setting {
    /// Name, such as `time.react`.
    pub name: String,
    /// Value as text.
    pub value: String,
    /// `flag`, `environment`, a file name, or `default`.
    pub origin: String,
    /// How a profile writes it; absent of a default, and of what may hold a secret.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub written: Option<String>,
}

impl Setting {
    /// The origin of a value that nobody has set.
    pub const DEFAULT: &str = "default";

    /// A value of which nothing more is known than how it is shown.
    #[must_use]
    pub fn shown(name: impl Into<String>, value: impl Into<String>, origin: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            value: value.into(),
            origin: origin.into(),
            written: None,
        }
    }

    /// Whether nobody has set it.
    #[must_use]
    pub fn is_default(&self) -> bool {
        self.origin == Self::DEFAULT
    }
}

/// Name and version of this program.
#[must_use]
pub fn tool() -> String {
    concat!("vda5050-tck ", env!("CARGO_PKG_VERSION")).to_owned()
}

/// How many mock AGVs tests talk about. What further ones say is left to the monitors.
pub const NAMED_VEHICLES: usize = 2;

/// What the run is about; the first record of every journal.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct RunHeader {
    /// `vda5050-tck.journal/1`.
    pub format: String,
    /// Name and version of the tool.
    pub tool: String,
    /// Identifier of the run.
    pub run: String,
    /// `certify` when nothing was left to choose; absent otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// `agv` or `master-control`.
    pub role: String,
    /// Protocol version the device is judged by, such as `2.1.0`.
    pub protocol: String,
    /// Manufacturer of the device.
    pub manufacturer: String,
    /// Serial number of the device.
    pub serial_number: String,
    /// Full topic by topic name; of the first vehicle when a master control is tested.
    pub topics: std::collections::BTreeMap<String, String>,
    /// The mock AGVs of the harness, first the one that tests talk about. Empty when an AGV is tested.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub vehicles: Vec<MockVehicle>,
    /// `tap` or `subscriber`.
    pub vantage: String,
    /// SHA-256 over suites, schemas and requirements.
    pub suites: String,
    /// Whether suites were replaced by `--suites`.
    pub modified: bool,
    /// Values that are the same for every test: `time.*`, `device.*`.
    pub bindings: Map<String, Value>,
    /// Effective settings: name, value, origin.
    pub settings: Vec<Setting>,
    /// The command line as typed, passwords left out.
    pub command: Vec<String>,
    /// SHA-256 of the files that make the device what it is: its profile, its program, and what both of them name.
    #[serde(skip_serializing_if = "std::collections::BTreeMap::is_empty")]
    pub files: std::collections::BTreeMap<String, String>,
    /// Which part of a run it is; absent when it is all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shard: Option<ShardRecord>,
}

impl RunHeader {
    /// Whether there are more mock AGVs than tests talk about.
    #[must_use]
    pub fn has_crowd(&self) -> bool {
        self.vehicles.len() > NAMED_VEHICLES
    }
}

/// What a part of a run restricts where its tests are divided.
pub const DIVIDED_TESTS: &str = "tests was run";
/// What a part of a run restricts where the vehicles of a master control are divided.
pub const DIVIDED_VEHICLES: &str = "vehicles was there";

/// Which part of something it is that several processes share, and what all of them share.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct ShardRecord {
    /// Which part, counted from 1.
    pub index: usize,
    /// Of how many.
    pub of: usize,
    /// Who says so: `--shard`, or a scheduler with the variables that were read.
    pub origin: String,
    /// How many parts have something to do: where there is less to do than there are parts, the last ones have nothing.
    pub filled: usize,
    /// How many tests, vehicles of a master control, or faults of a qualification the parts have together; 0 where that is not
    /// known beforehand.
    pub whole: usize,
    /// SHA-256 over the names of all of them: parts with another one are parts of something else.
    pub selection: String,
}

impl ShardRecord {
    /// The part that a process does of things of these names.
    #[must_use]
    pub fn of(chosen: &ChosenShard, filled: usize, names: &[&str]) -> Self {
        let mut sorted = names.to_vec();
        sorted.sort_unstable();
        let mut hash = Sha256::new();
        for name in sorted {
            hash.update(name);
            hash.update("\n");
        }
        Self {
            index: chosen.shard.index,
            of: chosen.shard.of,
            origin: chosen.origin.clone(),
            filled,
            whole: names.len(),
            selection: hex(&hash.finalize()),
        }
    }

    /// What the part restricts, in one sentence; `what` is what was divided.
    #[must_use]
    pub fn limit(&self, what: &str) -> String {
        let Self { index, of, origin, .. } = self;
        format!("Only part {index} of {of} of the {what} ({origin}): what the other parts found is not in here.")
    }
}

/// A mock AGV that a master control is tested with.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct MockVehicle {
    /// Manufacturer, as in its topics and headers.
    pub manufacturer: String,
    /// Serial number, as in its topics and headers.
    pub serial_number: String,
    /// Protocol version it speaks, where it is another one than that of the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<String>,
    /// Full topic by topic name.
    pub topics: std::collections::BTreeMap<String, String>,
}

/// What a run is going to do, and why it leaves things out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Plan {
    /// The selected tests, in the order they will run.
    pub tests: Vec<PlannedTest>,
    /// What the device can do, and who says so.
    pub capabilities: Vec<Capability>,
    /// What restricts the statement, one sentence each.
    pub limits: Vec<String>,
    /// Deviations the profile declares: requirement id to reason.
    pub deviations: std::collections::BTreeMap<String, String>,
    /// Series name of the factsheet.
    pub series_name: Option<String>,
    /// Whether every test of the suites was selected.
    pub complete: bool,
    /// How often each test is to be run; absent when that is once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeat: Option<u32>,
}

/// One test of a plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PlannedTest {
    /// Id.
    pub test: String,
    /// What becomes of it.
    pub gate: Gate,
}

/// Whether a test runs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gate {
    /// It runs.
    Runs,
    /// The device declares that it lacks what the test needs.
    NotApplicable(#[serde(deserialize_with = "Reason::or_sentence")] Reason),
    /// The bench, the profile or the device leaves open what the test needs.
    Unobservable(#[serde(deserialize_with = "Reason::or_sentence")] Reason),
}

/// A capability and its source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capability {
    /// Name, such as `action downloadMap INSTANT`.
    pub name: String,
    /// `yes`, `no`, or a value.
    pub value: String,
    /// `factsheet`, `profile`, or both when they contradict each other.
    pub source: String,
}
