//! `list`, `explain`, `validate` and `report`: what shows or checks something that is there.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::rendering::{self, RenderedTo};
use super::{Format, InconclusiveArg, SuiteArgs};
use tck_pack::Role;

const LIST_HELP: &str = "\
Examples:
  vda5050-tck list tests                   every test, what it needs, whether the vehicle drives
  vda5050-tck list tests --filter 'chapter(6.6) and not tag(moves)'
  vda5050-tck list coverage --role agv     which requirement is decided by what, or by nothing
  vda5050-tck list coverage --uncovered    what nothing decides
  vda5050-tck list requirements --changes 2.1.0..3.0.0
  vda5050-tck list hooks                   what a profile can do for a test
  vda5050-tck list language                the reference of the language of suites, as a page of Markdown
  vda5050-tck list asyncapi --protocol 2.0.0   topics and messages, for generators";

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
    /// Of the tests, only those for which this holds, such as 'hook(set-mode) or tag(link)'
    #[arg(long, value_name = "EXPRESSION")]
    pub filter: Option<String>,
    /// Of the coverage, only what nothing decides
    #[arg(long)]
    pub uncovered: bool,
    /// The requirements as a page of Markdown, with what decides them and how the catalogue reads them; the language of suites
    /// is always a page
    #[arg(long)]
    pub page: bool,
    /// Of the requirements, what became of them from one version to a later one, such as 2.0.0..2.1.0
    #[arg(long, value_name = "FROM..TO")]
    pub changes: Option<String>,
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
    /// Known products, and what each was seen to do
    Counterparts,
    /// What a profile can do to the device for a test
    Hooks,
    /// What a test can ask of the mock vehicles, when a master control is tested
    Vehicle,
    /// Everything that a suite can say: keys, operators, variables, checks
    Language,
    /// Topics and messages, as an `AsyncAPI` 3 document
    Asyncapi,
}

const EXPLAIN_HELP: &str = "\
Examples:
  vda5050-tck explain ORD-REJ-03
  vda5050-tck explain order-rejection/lower-update-id
  vda5050-tck explain power-cycle
  vda5050-tck explain device.node-bound";

/// `explain`.
#[derive(Clone, Debug, Args)]
#[command(after_help = EXPLAIN_HELP)]
pub struct Explain {
    /// Id of a requirement, test or monitor, or name of a check, hook, fault or setting of the device
    pub id: String,
    /// For this protocol version; the newest one unless said
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// How it is written: as a text, or a JSON object for each thing of that name
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

const VALIDATE_HELP: &str = "\
Examples:
  vda5050-tck validate device.toml hall.lif.json
  vda5050-tck validate state.json --topic state
  vda5050-tck validate states.jsonl messages/   one message a line, and all JSON files of a folder
  vda5050-tck validate suites/agv/order-rejection/*.yaml
  vda5050-tck validate --suites own own/agv/acme/*.yaml own/requirements/*.yaml";

/// `validate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = VALIDATE_HELP)]
pub struct Validate {
    /// Files to check, or folders with messages; `-` is standard input
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
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

const REPORT_HELP: &str = "\
Examples:
  vda5050-tck report reports/acme-0001/RUN              render it again
  vda5050-tck report --verify reports/acme-0001/RUN     are the files what they were?
  vda5050-tck report --rejudge reports/acme-0001/RUN    same journal, same verdicts?
  vda5050-tck report --verify --root sha256:HASH DIR    is it the bundle that a certificate names?
  vda5050-tck report --certificate DIR > paper.html     two to four pages of A4 for a run of `certify`
  vda5050-tck report --attestation DIR > attestation.json   for a signer, such as cosign
  vda5050-tck report --package run.zip DIR              all of it in one file, for a laboratory
  vda5050-tck report --as code-quality DIR > quality.json   for a pipeline; `run --as` writes it in every case
  vda5050-tck report --compare BEFORE AFTER             what became better or worse, or is lost
  vda5050-tck report --compare audits/monday audits/tuesday   audits, too; --verify and --as take them as well
  vda5050-tck report --compare A B C --page > runs.html a page: requirement by run
  vda5050-tck report --merge reports/parts --out DIR    the parts of a run (--shard) below a folder, as one

Exit codes of --compare: 0 nothing became worse · 1 something became worse, or is not decided any more
  3 nothing became worse, but a run is partial or undecided, or a failure cannot be seen any more";

/// `report`.
#[derive(Clone, Debug, Args)]
#[command(after_help = REPORT_HELP)]
pub struct Report {
    /// The folder of a finished run, or of an audit
    #[arg(value_name = "DIR", required_unless_present_any = ["compare", "merge"], conflicts_with_all = ["compare", "merge"])]
    pub directory: Option<PathBuf>,
    /// Check every file against the manifest; nothing is written
    #[arg(long)]
    pub verify: bool,
    /// Derive all verdicts from the journal again and compare them; nothing is written
    #[arg(long, conflicts_with = "verify")]
    pub rejudge: bool,
    /// Print one record of the journal with its message, by the number that a report gives it; nothing is written
    #[arg(long, value_name = "N", conflicts_with_all = ["verify", "rejudge", "certificate", "attestation", "renderings", "compare"])]
    pub message: Option<u64>,
    /// The root hash that the bundle must have, as a certificate names it
    #[arg(long, value_name = "sha256:HASH", requires = "verify", value_parser = parse_root)]
    pub root: Option<String>,
    /// Print the certificate of a run of `certify` as HTML for two to four pages of A4
    #[arg(long, conflicts_with_all = ["verify", "rejudge"])]
    pub certificate: bool,
    /// Print an in-toto statement about the bundle, ready to be signed
    #[arg(long, conflicts_with_all = ["verify", "rejudge", "certificate"])]
    pub attestation: bool,
    /// Print the profile of the run, for `run --profile`: every setting that is no default, and no secret
    #[arg(long, conflicts_with_all = ["verify", "rejudge", "certificate", "attestation", "message", "compare", "merge"])]
    pub profile: bool,
    /// Print it for others' tools, or write it into a file: junit, junit-requirements, junit-properties, ctrf, allure, markdown,
    /// code-quality, sarif, cyclonedx or svr; may be repeated (docs/handover.md)
    #[arg(long = "as", value_name = "KIND[=FILE]", value_parser = rendering::to_file_or_stdout,
        conflicts_with_all = ["verify", "rejudge", "certificate", "attestation", "profile", "compare"])]
    pub renderings: Vec<RenderedTo>,
    /// Take keys of test management for junit-properties from this file, too
    #[arg(long, value_name = "FILE", requires = "renderings")]
    pub keys: Option<PathBuf>,
    /// Write one zip for a customer or a laboratory, and say first what would be refused
    #[arg(long, value_name = "FILE",
        conflicts_with_all = ["verify", "rejudge", "message", "certificate", "attestation", "renderings", "compare", "merge"])]
    pub package: Option<PathBuf>,
    /// How JUnit XML shows what was not decided
    #[arg(long, value_name = "HOW", value_enum, default_value_t)]
    pub inconclusive: InconclusiveArg,
    /// Compare finished runs, each with the one before it
    #[arg(long, num_args = 2.., value_name = "DIR", conflicts_with_all = ["verify", "rejudge", "certificate", "attestation"])]
    pub compare: Option<Vec<PathBuf>>,
    /// Print the comparison as a page of HTML: requirement by run
    #[arg(long, requires = "compare")]
    pub page: bool,
    /// Join parts of something that was divided (--shard), or folders that hold them, into one bundle (docs/shards.md)
    #[arg(long, num_args = 1.., value_name = "DIR", requires = "out",
        conflicts_with_all = ["verify", "rejudge", "certificate", "attestation", "compare", "message", "renderings"])]
    pub merge: Option<Vec<PathBuf>>,
    /// The new folder for what is joined
    #[arg(long, value_name = "DIR", requires = "merge")]
    pub out: Option<PathBuf>,
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

/// A root hash as it is printed, without `sha256:`.
fn parse_root(text: &str) -> Result<String, String> {
    let hash = text.strip_prefix("sha256:").unwrap_or(text);
    if hash.len() == 64 && hash.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return Ok(hash.to_ascii_lowercase());
    }
    Err("a root hash is `sha256:` and 64 hexadecimal digits, as a run prints it at its end".to_owned())
}
