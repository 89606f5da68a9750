//! `list`, `explain`, `validate` and `report`: what shows or checks something that is there.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{Format, SuiteArgs};
use crate::pack::Role;

const LIST_HELP: &str = "\
Examples:
  vda5050-tck list tests                   every test, what it needs, whether the vehicle drives
  vda5050-tck list coverage --role agv     which requirement is decided by what, or by nothing
  vda5050-tck list coverage --uncovered    what nothing decides
  vda5050-tck list hooks                   what a profile can do for a test";

/// `list`.
#[derive(Clone, Debug, Args)]
#[command(after_help = LIST_HELP)]
pub struct List {
    /// What to list
    #[arg(value_enum)]
    pub what: Listing,
    /// For this side only [agv, master-control]
    #[arg(long, value_name = "ROLE", value_parser = parse_role)]
    pub role: Option<Role>,
    /// For this protocol version; the newest one unless said
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// Of the coverage, only what nothing decides
    #[arg(long)]
    pub uncovered: bool,
    /// How it is written
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

/// What can be listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Listing {
    /// Scripted exchanges
    Tests,
    /// Obligations of the standard
    Requirements,
    /// Which requirement is decided by what
    Coverage,
    /// Checks that are always on
    Monitors,
    /// Defects the reference AGV can be given
    Faults,
    /// Liberties the reference AGV can be given
    Tolerances,
    /// What a profile can do to the device for a test
    Hooks,
    /// What a test can ask of the mock vehicles, when a master control is tested
    Vehicle,
}

const EXPLAIN_HELP: &str = "\
Examples:
  vda5050-tck explain ORD-REJ-03
  vda5050-tck explain order-rejection/lower-update-id
  vda5050-tck explain power-cycle";

/// `explain`.
#[derive(Clone, Debug, Args)]
#[command(after_help = EXPLAIN_HELP)]
pub struct Explain {
    /// Id of a requirement, test or monitor, or name of a check, hook or fault
    pub id: String,
    /// For this protocol version; the newest one unless said
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

const VALIDATE_HELP: &str = "\
Examples:
  vda5050-tck validate device.toml hall.lif.json
  vda5050-tck validate state.json --topic state --protocol 1.2
  vda5050-tck validate suites/agv/order/*.yaml";

/// `validate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = VALIDATE_HELP)]
pub struct Validate {
    /// Files to check; `-` is standard input
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    /// Take messages for this protocol version; their own header says it unless given
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// Take messages for this topic, such as `state`; told by their members unless given
    #[arg(long, value_name = "TOPIC")]
    pub topic: Option<String>,
    /// How findings are written
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

const REPORT_HELP: &str = "\
Examples:
  vda5050-tck report reports/acme-0001/RUN              render it again
  vda5050-tck report --verify reports/acme-0001/RUN     are the files what they were?
  vda5050-tck report --rejudge reports/acme-0001/RUN    same journal, same verdicts?
  vda5050-tck report --compare BEFORE AFTER             what became better or worse";

/// `report`.
#[derive(Clone, Debug, Args)]
#[command(after_help = REPORT_HELP)]
pub struct Report {
    /// The folder of a finished run
    #[arg(value_name = "DIR", required_unless_present = "compare", conflicts_with = "compare")]
    pub directory: Option<PathBuf>,
    /// Check every file against the manifest; nothing is written
    #[arg(long)]
    pub verify: bool,
    /// Derive all verdicts from the journal again and compare them; nothing is written
    #[arg(long, conflicts_with = "verify")]
    pub rejudge: bool,
    /// Compare two finished runs
    #[arg(long, num_args = 2, value_names = ["BEFORE", "AFTER"], conflicts_with_all = ["verify", "rejudge"])]
    pub compare: Option<Vec<PathBuf>>,
    /// How it is written to standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

pub(super) fn parse_role(text: &str) -> Result<Role, String> {
    [Role::Agv, Role::MasterControl]
        .into_iter()
        .find(|role| role.word() == text)
        .ok_or_else(|| format!("a role is `{}` or `{}`", Role::Agv, Role::MasterControl))
}
