//! `campaign`: many devices or versions and many suites.

use std::path::PathBuf;

use clap::Args;

use super::Format;

const CAMPAIGN_HELP: &str = "\
A file such as (schemas/campaign.schema.json, docs/campaign.md):
  [campaign]
  parallel = 2                        # 1 unless said: real devices, one after the other
  [devices.acme-41]
  profile = \"acme-41.toml\"
  listen = \"192.168.0.10:1884\"
  [suites.refusals]
  tests = [\"order-rejection\"]
  arguments = [\"--seed\", \"1\"]

Each device meets each suite in a run of its own. A campaign that was interrupted or killed goes on where it was when it is
called again. The exit code is the worst of all runs; 130 when it was interrupted.";

/// `campaign`.
#[derive(Clone, Debug, Args)]
#[command(after_help = CAMPAIGN_HELP)]
pub struct Campaign {
    /// The devices and suites
    #[arg(value_name = "FILE.toml")]
    pub file: PathBuf,
    /// The folder of its results; beside the file, under its name, unless the file or this says another one
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Carry out again, from the beginning, what was refused, had nothing to do, or broke (exit codes 2, 4 and 5)
    #[arg(long)]
    pub retry: bool,
    /// How the summary is written to standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}
