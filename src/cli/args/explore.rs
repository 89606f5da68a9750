//! `explore`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use tck_base::shard::Shard;

use super::{DeviceArgs, OutputArgs, PageArgs, SuiteArgs};

const EXPLORE_HELP: &str = "\
Examples:
  vda5050-tck explore --virtual                              conversations with the built-in AGV
  vda5050-tck explore --virtual --fault outdated-update-taken-over   see a finding shrink
  vda5050-tck explore --profile device.toml --conversations 400 --budget 1h   # not in CI: needs a device
  vda5050-tck explore --virtual --replay fixtures/conversations/outdated.yaml   carry out a conversation again

The shortest conversation of every finding is written as a test beside the report.
The same seed draws the same conversations.";

/// `explore`.
#[derive(Clone, Debug, Default, Args)]
#[command(after_help = EXPLORE_HELP)]
pub struct Explore {
    /// The device and the bench.
    #[command(flatten)]
    pub device: DeviceArgs,
    /// Where results go.
    #[command(flatten)]
    pub output: OutputArgs,
    /// The page for people.
    #[command(flatten)]
    pub page: PageArgs,
    /// Which suites, and with them which grammar.
    #[command(flatten)]
    pub suites: SuiteArgs,
    /// Begin the random choice here; 1 for the built-in device, and another one in every exploration of yours
    #[arg(long, value_name = "NUMBER")]
    pub seed: Option<u64>,
    /// Draw at most so many conversations
    #[arg(long, value_name = "NUMBER", default_value_t = 40)]
    pub conversations: usize,
    /// End after this time, such as 20m or 2h: trying stimuli, holding conversations, making what fails shorter
    #[arg(long, value_name = "TIME", value_parser = super::watch::time)]
    pub budget: Option<Duration>,
    /// Say at most so much in one of them
    #[arg(long, value_name = "NUMBER", default_value_t = 12)]
    pub length: usize,
    /// Only stimuli whose name matches one of these, and those that lead to them; may be repeated
    #[arg(long, value_name = "STIMULUS")]
    pub focus: Vec<String>,
    /// Try at most so many shorter conversations for each finding
    #[arg(long, value_name = "NUMBER", default_value_t = 60)]
    pub shrink_budget: usize,
    /// Only part I of N of the conversations and of the stimuli tried one by one; `report --merge` joins the parts (docs/shards.md)
    #[arg(long, value_name = "I/N", conflicts_with_all = ["replay", "every_fault", "stimuli"])]
    pub shard: Option<Shard>,
    /// Carry out the conversations of these files again, and no others
    #[arg(long, value_name = "FILE", conflicts_with_all = ["focus", "every_fault"])]
    pub replay: Vec<PathBuf>,
    /// Show what may be said in which situation, and end
    #[arg(long)]
    pub stimuli: bool,
    /// Explore the built-in device, and none of yours: has to be said where `CI` is set or a device.toml is beside it
    #[arg(long, help_heading = "Built-in device", conflicts_with = "profile")]
    pub reference: bool,
    /// In virtual time, against the built-in device
    #[arg(long = "virtual", help_heading = "Built-in device", conflicts_with = "profile")]
    pub in_virtual_time: bool,
    /// Give the built-in device a defect; may be repeated (see `list faults`)
    #[arg(
        long,
        value_name = "NAME",
        help_heading = "Built-in device",
        conflicts_with = "profile"
    )]
    pub fault: Vec<String>,
    /// Let the built-in device take a liberty; may be repeated (see `list tolerances`)
    #[arg(
        long,
        value_name = "NAME",
        help_heading = "Built-in device",
        conflicts_with = "profile"
    )]
    pub tolerance: Vec<String>,
    /// Which kind of reference AGV it is
    #[arg(
        long,
        value_name = "KIND",
        value_enum,
        default_value_t,
        help_heading = "Built-in device",
        conflicts_with = "profile"
    )]
    pub vehicle: super::vehicle::VehicleKind,
    /// Measure how many of its faults are found: every one, or one in NUMBER; with --fault, of those only
    #[arg(long, value_name = "NUMBER", help_heading = "Built-in device", num_args = 0..=1, default_missing_value = "1", requires = "in_virtual_time")]
    pub every_fault: Option<usize>,
}
