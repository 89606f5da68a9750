//! Which tests are run, beside their names.

use std::path::PathBuf;

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
    /// Only tests for which this holds, such as 'chapter(6.6) and not tag(moves)'; may be repeated, and all have to hold
    #[arg(long, value_name = "EXPRESSION")]
    pub filter: Vec<String>,
    /// Leave out tests whose id matches; may be repeated
    #[arg(long, value_name = "TEST")]
    pub exclude: Vec<String>,
    /// Only tests that failed or broke in the latest run below --out
    #[arg(long)]
    pub last_failed: bool,
    /// End the run in good order after the first test that fails
    #[arg(long)]
    pub fail_fast: bool,
    /// Run each test NUMBER times; one whose verdicts differ is flaky, and its worst verdict counts
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1_000))]
    pub repeat: u32,
    /// Go on with the interrupted run in this folder: what it decided is kept, and its evidence becomes part of this run's
    #[arg(long, value_name = "DIR", conflicts_with_all = ["tests", "requirement", "chapter", "filter", "exclude", "last_failed", "shard", "thorough"])]
    pub resume: Option<PathBuf>,
    /// Show what would be run, asked of people and driven, and run nothing
    #[arg(long)]
    pub plan: bool,
    /// Draw the floor of the plan into this file, as SVG
    #[arg(long, value_name = "FILE", requires = "plan")]
    pub floor: Option<PathBuf>,
}
