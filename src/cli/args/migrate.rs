//! `migrate`: what one device has to change to speak a later version.

use std::path::PathBuf;

use clap::Args;

use super::history::rendered_to;
use super::inspect::parse_role;
use super::{Format, HistoryTo, SuiteArgs};
use tck_pack::Role;

const MIGRATE_HELP: &str = "\
Examples:
  vda5050-tck migrate reports/acme-0001/RUN --to 3.0.0         the device of a run
  vda5050-tck migrate site.jsonl --to 3.0.0 --vehicle 0001     one vehicle of a recording
  vda5050-tck migrate site.jsonl --to 3.0.0 --role master-control --as html=migration.html

Exit code 0 says that the list was made, whatever is in it; 4 that no message of the device was found (docs/migrate.md).";

/// `migrate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = MIGRATE_HELP)]
pub struct Migrate {
    /// Bundles of runs, or recordings as `audit` reads them; `-` is standard input
    #[arg(value_name = "BUNDLE|CAPTURE", required = true)]
    pub recordings: Vec<PathBuf>,
    /// The later version
    #[arg(long, value_name = "VERSION")]
    pub to: String,
    /// Protocol version the device speaks; otherwise that which its messages name
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// Which side the device is [agv, master-control]; that of the run, or agv, unless said
    #[arg(long, value_name = "ROLE", value_parser = parse_role)]
    pub role: Option<Role>,
    /// Only this vehicle: its serial number, or manufacturer/number; may be repeated for a master control
    #[arg(long, value_name = "VEHICLE")]
    pub vehicle: Vec<String>,
    /// How topics are built, as for `audit`
    #[arg(long, value_name = "TEMPLATE")]
    pub topic_template: Option<String>,
    /// The member that holds the time; a dot leads inside
    #[arg(long, value_name = "MEMBER", help_heading = "Lines of another form")]
    pub time: Option<String>,
    /// The member that holds the topic
    #[arg(long, value_name = "MEMBER", help_heading = "Lines of another form")]
    pub topic: Option<String>,
    /// The member that holds the payload: an object, a text, or base64
    #[arg(long, value_name = "MEMBER", help_heading = "Lines of another form")]
    pub payload: Option<String>,
    /// Print it, or write it into a file, as html, markdown or json; may be repeated
    #[arg(long = "as", value_name = "KIND[=FILE]", value_parser = rendered_to)]
    pub renderings: Vec<HistoryTo>,
    /// How it is written to standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}
