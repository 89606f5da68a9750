//! `run`, `certify` and `qualify`: what runs tests.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::{DeviceArgs, Format, OutputArgs, PeopleArgs, PipelineArgs, SelectionArgs, SuiteArgs};
use tck_base::shard::Shard;

const RUN_HELP: &str = "\
Examples:
  vda5050-tck run --reference                        the built-in reference AGV
  vda5050-tck run --virtual                          the same in virtual time, in seconds
  vda5050-tck run --virtual --fault outdated-update-taken-over   see a test fail
  vda5050-tck run --profile device.toml --no-motion  nothing drives
  vda5050-tck run 'order-rejection/*' --manufacturer ACME --serial 0001 --listen 0.0.0.0:1883
  vda5050-tck run --profile device.toml --plan       what would be run, asked and driven
  vda5050-tck run --profile device.toml --last-failed --fail-fast   what failed, up to the first failure
  vda5050-tck run --virtual --filter 'chapter(6.6) and not tag(moves)'   see docs/selection.md
  vda5050-tck run --profile device.toml --repeat 5 order-update   is it the same five times?
  vda5050-tck run --profile device.toml --resume reports/latest   go on after an interruption
  vda5050-tck run --profile device.toml --budget 20m   what does not fit is left out by name
  vda5050-tck run --profile device.toml --shard 2/4  the second quarter of the tests
  vda5050-tck run --profile device.toml --as junit=junit.xml   for a pipeline, whatever becomes of the run

A test is named by its id, and `*` stands for anything: `order-rejection/*`, `*map*`. See `list tests`.
Results go to standard output, progress to standard error; the report to --out.";

/// `run`.
#[derive(Clone, Debug, Default, Args)]
#[command(after_help = RUN_HELP)]
pub struct Run {
    /// Only tests whose id matches one of these; all that apply unless said
    #[arg(value_name = "TEST")]
    pub tests: Vec<String>,
    /// Which of them.
    #[command(flatten)]
    pub selection: SelectionArgs,
    /// The device and the bench.
    #[command(flatten)]
    pub device: DeviceArgs,
    /// Where results go.
    #[command(flatten)]
    pub output: OutputArgs,
    /// What a pipeline reads.
    #[command(flatten)]
    pub pipeline: PipelineArgs,
    /// How people are asked.
    #[command(flatten)]
    pub people: PeopleArgs,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
    /// Test the built-in device, and none of yours: has to be said where `CI` is set or a device.toml is beside it
    #[arg(long, help_heading = "Built-in device", conflicts_with = "profile")]
    pub reference: bool,
    /// Give the built-in device a defect, to see a test fail; may be repeated (see `list faults`)
    #[arg(
        long,
        value_name = "NAME",
        help_heading = "Built-in device",
        conflicts_with = "profile"
    )]
    pub fault: Vec<String>,
    /// Whether it is for a certificate.
    #[arg(skip)]
    pub certifies: bool,
    /// What the certificate says, by the names of settings.
    #[arg(skip)]
    pub said: Vec<(&'static str, String)>,
    /// Give the built-in device a liberty the standard leaves it; may be repeated (see `list tolerances`)
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
    /// How many mock AGVs a master control is tested with [default: 2]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = "Master control")]
    pub vehicles: Option<u32>,
    /// Let the harness behave like a known product, as far as permitted (`list counterparts`)
    #[arg(long, value_name = "NAME")]
    pub like: Option<String>,
    /// Run against the built-in device in memory and in virtual time, without a network
    #[arg(long = "virtual", help_heading = "Built-in device", conflicts_with_all = ["profile", "listen", "broker", "no_tap"])]
    pub in_virtual_time: bool,
    /// Try every case from schemas and matrices, and not a few of them
    #[arg(long)]
    pub thorough: bool,
    /// Make identifiers, the order of events and what is drawn from schemas and matrices repeatable
    #[arg(long, value_name = "NUMBER")]
    pub seed: Option<u64>,
    /// How long the run may take, such as 20m or 2h; tests that do not fit any more are left out by name, and are no pass
    #[arg(long, value_name = "TIME", value_parser = super::watch::time)]
    pub budget: Option<Duration>,
    /// Whether it is a run for a certificate, which is alike for everybody: set by `certify`.
    #[arg(skip)]
    pub certificate: bool,
    /// Only part I of N of the tests, or of the vehicles of a master control, for several benches at once; 1/1 is all of them, whatever a scheduler says (docs/shards.md)
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
}

const CERTIFY_HELP: &str = "\
A certificate has to mean the same for everybody. So there is no filter, no modified suite, and no \
changed timing: a profile that sets `[time]` is refused, and so is a run without a profile, a vehicle that may not \
drive, and a profile that leaves out what tests need of bench or device. What a certificate says of laboratory, tester, \
place and device comes from the section [certificate] of the profile, or from flags.

Examples:
  vda5050-tck certify --profile device.toml --tester \"A. Person\"
  vda5050-tck certify --profile device.toml --resume reports/latest   go on after an interruption
  vda5050-tck report --certificate reports/latest > certificate.html   two to four pages of A4";

/// What a certificate says about who tested what; each is also a setting of the profile.
#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = "Certificate")]
pub struct CertificateArgs {
    /// Name of the laboratory or company that tests
    #[arg(long, value_name = "NAME")]
    pub laboratory: Option<String>,
    /// Number of the report, unique in the laboratory
    #[arg(long, value_name = "NUMBER")]
    pub number: Option<String>,
    /// Who has ordered the test
    #[arg(long, value_name = "NAME")]
    pub customer: Option<String>,
    /// The person who tests
    #[arg(long, value_name = "NAME")]
    pub tester: Option<String>,
    /// The person who authorises the report
    #[arg(long, value_name = "NAME")]
    pub authorised_by: Option<String>,
    /// Where the test takes place
    #[arg(long, value_name = "PLACE")]
    pub place: Option<String>,
    /// Which piece is tested, and in which state
    #[arg(long, value_name = "TEXT")]
    pub sample: Option<String>,
    /// Version of the hardware of the device
    #[arg(long, value_name = "VERSION")]
    pub hardware_version: Option<String>,
    /// Version of the software of the device
    #[arg(long, value_name = "VERSION")]
    pub firmware_version: Option<String>,
}

impl CertificateArgs {
    /// The flags that were given, by the names of the settings they set.
    #[must_use]
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        let texts = [
            ("certificate.laboratory", &self.laboratory),
            ("certificate.number", &self.number),
            ("certificate.customer", &self.customer),
            ("certificate.tester", &self.tester),
            ("certificate.authorised-by", &self.authorised_by),
            ("certificate.place", &self.place),
            ("certificate.sample", &self.sample),
            ("certificate.hardware-version", &self.hardware_version),
            ("certificate.firmware-version", &self.firmware_version),
        ];
        let given = texts.into_iter();
        given.filter_map(|(name, text)| Some((name, text.clone()?))).collect()
    }
}

/// `certify`.
#[derive(Clone, Debug, Default, Args)]
#[command(after_help = CERTIFY_HELP)]
pub struct Certify {
    /// What is known about the device and its site (device.toml)
    #[arg(
        long,
        value_name = "FILE",
        env = "VDA5050_TCK_PROFILE",
        hide_env_values = true,
        required = true
    )]
    pub profile: Option<PathBuf>,
    /// Try every case from schemas and matrices, and not a few of them
    #[arg(long)]
    pub thorough: bool,
    /// How long it may take, such as 20m or 2h; what does not fit any more is left for --resume, and there is no paper before
    #[arg(long, value_name = "TIME", value_parser = super::watch::time)]
    pub budget: Option<Duration>,
    /// Go on with the certification in this folder, which was interrupted or had too little time: what it decided is kept
    #[arg(long, value_name = "DIR", conflicts_with = "thorough")]
    pub resume: Option<PathBuf>,
    /// Only part I of N of the tests, for several benches at once; `report --merge` joins the parts (docs/shards.md)
    #[arg(long, value_name = "I/N", conflicts_with = "resume")]
    pub shard: Option<Shard>,
    /// Who tests what.
    #[command(flatten)]
    pub certificate: CertificateArgs,
    /// Where results go.
    #[command(flatten)]
    pub output: OutputArgs,
    /// What a pipeline reads.
    #[command(flatten)]
    pub pipeline: PipelineArgs,
    /// How people are asked.
    #[command(flatten)]
    pub people: PeopleArgs,
}

const QUALIFY_HELP: &str = "\
Runs all tests against the reference AGV in virtual time: once without a fault, where everything has \
to pass without a warning, and once with each fault, where the requirement it breaks has to fail. \
Decisions that no fault can fail are listed by name: they are unproven.

Example:
  vda5050-tck qualify 'order-rejection/*'";

/// `qualify`.
#[derive(Clone, Debug, Args)]
#[command(after_help = QUALIFY_HELP)]
pub struct Qualify {
    /// Only tests whose id matches one of these
    #[arg(value_name = "TEST")]
    pub tests: Vec<String>,
    /// Only this side's [agv, master-control]; both unless said
    #[arg(long, value_name = "ROLE", value_parser = super::inspect::parse_role)]
    pub role: Option<tck_pack::Role>,
    /// Print which fault fails which clause, too
    #[arg(long)]
    pub matrix: bool,

    /// Only these faults; may be repeated
    #[arg(long, value_name = "NAME")]
    pub fault: Vec<String>,
    /// For this protocol version; every one known unless said
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// Only part I of N of the faults, for several processes at once; `report --merge` joins the parts (docs/shards.md)
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Write result.json, junit.xml and manifest.json into this folder
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// How the outcome is written
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}
