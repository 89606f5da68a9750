//! `completions` and `man`: what a package installs beside the program.

use std::path::PathBuf;

use clap::Args;

const COMPLETIONS_HELP: &str = "\
Examples:
  vda5050-tck completions bash > vda5050-tck.bash
  vda5050-tck completions fish > vda5050-tck.fish";

/// `completions`.
#[derive(Clone, Debug, Args)]
#[command(after_help = COMPLETIONS_HELP)]
pub struct Completions {
    /// Which shell
    #[arg(value_enum)]
    pub shell: clap_complete::Shell,
}

const MAN_HELP: &str = "\
Examples:
  vda5050-tck man > vda5050-tck.1
  vda5050-tck man --dir man    a page for every command";

/// `man`.
#[derive(Clone, Debug, Args)]
#[command(after_help = MAN_HELP)]
pub struct Man {
    /// Write a page for every command into this folder
    #[arg(long, value_name = "DIR")]
    pub dir: Option<PathBuf>,
}
