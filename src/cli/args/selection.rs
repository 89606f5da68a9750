//! Which tests are run, beside their names.

use clap::Args;

/// What to take of the tests, and what to leave out.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Selection")]
pub struct SelectionArgs {
    /// Only tests that decide this requirement, such as ORD-REJ-10 or `ORD-REJ`; may be repeated
    #[arg(long, value_name = "ID")]
    pub requirement: Vec<String>,
    /// Only tests that decide a requirement of a chapter whose title has this text; may be repeated
    #[arg(long, value_name = "TITLE")]
    pub chapter: Vec<String>,
    /// Leave out tests whose id matches; may be repeated
    #[arg(long, value_name = "TEST")]
    pub exclude: Vec<String>,
    /// Only tests that failed or broke in the latest run below --out
    #[arg(long)]
    pub last_failed: bool,
    /// End the run in good order after the first test that fails
    #[arg(long)]
    pub fail_fast: bool,
    /// Show what would be run, asked of people and driven, and run nothing
    #[arg(long)]
    pub plan: bool,
}
