//! `history`: what became of every requirement over many runs.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{Format, SuiteArgs};

const HISTORY_HELP: &str = "\
Examples:
  vda5050-tck history reports                            what fails since when, and what changed between
  vda5050-tck history reports --as html=reports/history.html   a page: requirement by run
  vda5050-tck history reports --format json              for programs (schemas/history.schema.json)

Bundles of runs and of audits are taken, those of one device, role and protocol version together. What is damaged, has no
manifest, or is there twice is named, and no part of it. Exit code 4: there is no bundle that can be taken.";

/// `history`.
#[derive(Clone, Debug, Args)]
#[command(after_help = HISTORY_HELP)]
pub struct History {
    /// The folder below which the bundles lie
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Print it, or write it into a file, as html, markdown or json; may be repeated
    #[arg(long = "as", value_name = "KIND[=FILE]", value_parser = rendered_to)]
    pub renderings: Vec<HistoryTo>,
    /// How it is written to standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites, for what requirements ask.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

/// What a history is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum HistoryKind {
    /// One page of HTML, without network and scripts
    Html,
    /// Markdown, such as for the summary page of a step
    Markdown,
    /// For programs
    Json,
}

/// A rendering of a history, and the file that it goes into.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HistoryTo {
    /// What it is written as.
    pub kind: HistoryKind,
    /// The file; standard output without one.
    pub file: Option<PathBuf>,
}

/// `KIND`, or `KIND=FILE`.
pub(super) fn rendered_to(text: &str) -> Result<HistoryTo, String> {
    let (kind, file) = match text.split_once('=') {
        Some((_, "")) => return Err(format!("after `{text}` the name of a file is missing")),
        Some((kind, file)) => (kind, Some(PathBuf::from(file))),
        None => (text, None),
    };
    let kind = HistoryKind::from_str(kind, false)
        .map_err(|_| format!("there is no `{kind}`; there are html, markdown, json"))?;
    Ok(HistoryTo { kind, file })
}
