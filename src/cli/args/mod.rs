//! What can be typed. Help texts are written for somebody who has never seen the tool.
//!
//! Flags that are settings of a device (`--broker`, `--serial` …) are handed to [`tck_profile::load`] as
//! they stand, so that a value means the same on the command line, in the environment and in a file.

mod audit;
mod campaign;
mod discover;
mod explore;
mod history;
mod inspect;
mod migrate;
mod rendering;
mod run;
mod selection;
mod shell;
mod simulate;
#[cfg(test)]
mod tests;
mod vehicle;
mod watch;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::assets::Own;
use tck_report::junit::Inconclusive;

pub use audit::Audit;
pub use campaign::Campaign;
pub use discover::{BrokerArgs, Discover, Init, ListenArgs};
pub use explore::Explore;
pub use history::{History, HistoryKind, HistoryTo};
pub use inspect::{Explain, List, Listing, Report, Validate};
pub use migrate::Migrate;
pub(super) use rendering::to_file;
pub use rendering::{RenderedTo, Rendering};
pub use run::{CertificateArgs, Certify, Qualify, Run};
pub use selection::SelectionArgs;
pub use shell::{Completions, Man};
pub use simulate::{
    ConnectionArgs, PersonaArg, Simulate, Simulated, SimulatedAgv, SimulatedMasterControl, SimulatedSite, VehicleArg,
};
pub use watch::Watch;

const AFTER_HELP: &str = "\
Examples:
  vda5050-tck run --reference                  test the built-in reference AGV: see how it works
  vda5050-tck run --profile device.toml        test your device, as the profile describes it
  vda5050-tck run --virtual 'maps/*' -v        only some tests, with every effective setting
  vda5050-tck explain ORD-REJ-03               what a requirement asks, and what decides it
  vda5050-tck certify --profile device.toml    everything that applies, with nothing left to choose

Exit codes:
  0 conforms · 1 does not conform · 2 usage, profile or suite wrong · 3 undecided
  4 nothing selected or applicable · 5 the harness or its environment broke · 130 interrupted";

/// Tests whether an AGV or a master control keeps to VDA 5050, and shows the evidence.
#[derive(Debug, Parser)]
#[command(name = "vda5050-tck", version, after_help = AFTER_HELP, max_term_width = 100, propagate_version = true)]
#[command(arg_required_else_help = true, disable_help_subcommand = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Log what happens inside to this file; the variable `VDA5050_TCK_LOG` says how much
    #[arg(
        long,
        global = true,
        value_name = "FILE",
        env = "VDA5050_TCK_LOG_FILE",
        hide_env_values = true,
        // Where it stands among the options of a command, however many commands there are.
        display_order = 17
    )]
    pub log_file: Option<PathBuf>,
}

/// The commands.
// There is one of them, for the life of the program.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Test the device of a profile, or the built-in reference AGV
    Run(Run),
    /// Test a device with nothing left to choose: all applicable tests, default timings, built-in suites
    Certify(Certify),
    /// Show what there is: tests, requirements, coverage, monitors, faults, tolerances, hooks, or the interface itself
    List(List),
    /// Explain a requirement, test, monitor, check, hook or fault
    Explain(Explain),
    /// Judge recorded traffic by the monitors: every vehicle and its master control
    Audit(Audit),
    /// Judge live traffic by the monitors, as a subscriber on a broker; nothing is sent
    Watch(Watch),
    /// Show what a device has to change to speak a later version, from its messages
    Migrate(Migrate),
    /// Hold long random conversations with a device, and shrink those that fail to the shortest
    Explore(Explore),
    /// Check files: messages, suites, profiles, layouts or results, told apart by their content
    Validate(Validate),
    /// Simulate a device on a broker: a reference AGV or a reference master control
    Simulate(Simulate),
    /// Render the report of a finished run again, verify it, judge it again, or compare two
    Report(Report),
    /// Test many devices or versions with many suites, each pair in a run of its own; goes on where it was
    Campaign(Campaign),
    /// Show over many runs which requirement fails since when, what is flaky or fixed, and what changed between
    History(History),
    /// Self-test: the reference devices pass everything, and every check is failed by a fault
    Qualify(Qualify),
    /// Show who speaks on a broker; nothing is sent
    Discover(Discover),
    /// Write a commented profile of a device that is heard on a broker; nothing is sent
    Init(Init),
    /// Print completions for a shell
    Completions(Completions),
    /// Print the manual page, or write a page for every command
    Man(Man),
}

impl Command {
    /// How much is to be told of what happens inside.
    #[must_use]
    pub fn verbose(&self) -> u8 {
        match self {
            Self::Run(arguments) => arguments.output.verbose,
            Self::Certify(arguments) => arguments.output.verbose,
            Self::Explore(arguments) => arguments.output.verbose,
            _ => 0,
        }
    }

    /// How the command writes, errors included.
    #[must_use]
    pub fn format(&self) -> Format {
        match self {
            Self::Run(arguments) => arguments.output.format,
            Self::Certify(arguments) => arguments.output.format,
            Self::List(arguments) => arguments.format,
            Self::Validate(arguments) => arguments.format,
            Self::Report(arguments) => arguments.format,
            Self::Campaign(arguments) => arguments.format,
            Self::History(arguments) => arguments.format,
            Self::Qualify(arguments) => arguments.format,
            Self::Discover(arguments) => arguments.format,
            Self::Audit(arguments) => arguments.format,
            Self::Migrate(arguments) => arguments.format,
            Self::Watch(arguments) => arguments.format,
            Self::Explore(arguments) => arguments.output.format,
            Self::Explain(arguments) => arguments.format,
            Self::Simulate(arguments) => arguments.format,
            Self::Init(arguments) => arguments.format,
            // What these print is meant for a shell and for `man`.
            Self::Completions(_) | Self::Man(_) => Format::Text,
        }
    }
}

/// Settings of the device and the bench; each is also a setting of the profile.
#[derive(Clone, Debug, Default, Args)]
pub struct DeviceArgs {
    /// What is known about the device and its site (device.toml)
    #[arg(long, value_name = "FILE", env = "VDA5050_TCK_PROFILE", hide_env_values = true)]
    pub profile: Option<PathBuf>,
    /// Which side is tested [agv, master-control]
    #[arg(long, value_name = "ROLE", help_heading = "Device")]
    pub role: Option<String>,
    /// Manufacturer, as in its topics
    #[arg(long, value_name = "NAME", help_heading = "Device")]
    pub manufacturer: Option<String>,
    /// Serial number, as in its topics
    #[arg(long, value_name = "NUMBER", help_heading = "Device")]
    pub serial: Option<String>,
    /// Protocol version it is judged by
    #[arg(long, value_name = "VERSION", help_heading = "Device")]
    pub protocol: Option<String>,
    /// How its topics begin, with {majorVersion}, {manufacturer} and {serialNumber}
    #[arg(long, value_name = "TEMPLATE", help_heading = "Device")]
    pub topic_template: Option<String>,
    /// Where the device connects; this machine only unless said [default: 127.0.0.1:1883]
    #[arg(long, value_name = "HOST:PORT", help_heading = "Bench")]
    pub listen: Option<String>,
    /// Use this broker instead of the built-in one: mqtt://host:port, or with mqtts, or ws://host:port/path and wss
    #[arg(long, value_name = "URL", help_heading = "Bench")]
    pub broker: Option<String>,
    /// How the client ids of the harness begin at a broker of your own [default: tck]
    #[arg(long, value_name = "TEXT", help_heading = "Bench")]
    pub client_id: Option<String>,
    /// The certificate that is shown to a broker of your own that asks for one, as a PEM file
    #[arg(
        long,
        value_name = "FILE",
        requires = "client_key",
        alias = "tls-cert",
        help_heading = "Bench"
    )]
    pub client_cert: Option<String>,
    /// Its key, as a PEM file
    #[arg(
        long,
        value_name = "FILE",
        requires = "client_cert",
        alias = "tls-key",
        help_heading = "Bench"
    )]
    pub client_key: Option<String>,
    /// Whose certificates are trusted at a broker of your own with TLS, as a PEM file
    #[arg(long, value_name = "FILE", help_heading = "Bench")]
    pub tls_ca: Option<String>,
    /// User name at a broker of your own; its password is taken from the variable `VDA5050_TCK_PASSWORD`
    #[arg(long, value_name = "NAME", help_heading = "Bench")]
    pub username: Option<String>,
    /// The device is connected to the broker directly: packets cannot be seen (needs --broker)
    #[arg(long, help_heading = "Bench")]
    pub no_tap: bool,
    /// Let the vehicle drive; somebody has to have looked at the floor first
    #[arg(long, conflicts_with = "no_motion", help_heading = "Bench")]
    pub allow_motion: bool,
    /// Leave out every test in which the vehicle drives
    #[arg(long, help_heading = "Bench")]
    pub no_motion: bool,
}

impl DeviceArgs {
    /// The flags that were given, by the names of the settings they set.
    #[must_use]
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        let texts = [
            ("device.role", &self.role),
            ("device.manufacturer", &self.manufacturer),
            ("device.serial-number", &self.serial),
            ("device.protocol", &self.protocol),
            ("device.topic-template", &self.topic_template),
            ("bench.listen", &self.listen),
            ("bench.broker", &self.broker),
            ("bench.client-id", &self.client_id),
            ("bench.client-cert", &self.client_cert),
            ("bench.client-key", &self.client_key),
            ("bench.tls-ca", &self.tls_ca),
            ("bench.username", &self.username),
        ];
        let flags = [
            ("bench.tap", self.no_tap, "false"),
            ("motion.allowed", self.allow_motion, "true"),
            ("motion.allowed", self.no_motion, "false"),
        ];
        let given = texts.into_iter().filter_map(|(name, text)| Some((name, text.clone()?)));
        let set = flags.into_iter().filter(|(_, given, _)| *given);
        given
            .chain(set.map(|(name, _, text)| (name, text.to_owned())))
            .collect()
    }
}

/// The folder of reports, unless another one is given.
pub const REPORTS: &str = "reports";

/// Where results go and how they are shown.
#[derive(Clone, Debug, Default, Args)]
pub struct OutputArgs {
    /// Write the report below this folder
    #[arg(
        long,
        value_name = "DIR",
        default_value = REPORTS,
        env = "VDA5050_TCK_OUT",
        hide_env_values = true
    )]
    pub out: PathBuf,
    /// How results are written to standard output
    #[arg(
        long,
        value_enum,
        default_value_t,
        env = "VDA5050_TCK_FORMAT",
        hide_env_values = true
    )]
    pub format: Format,
    /// Verbose: every effective setting with its origin; twice, every step, and what happens inside
    #[arg(short, long, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub verbose: u8,
    /// Say less: no line per test and no details, only the verdict and what is broken
    #[arg(short, long)]
    pub quiet: bool,
    /// Show tests that failed or broke, and no others
    #[arg(long, conflicts_with = "quiet")]
    pub failures: bool,
    /// Write what happens as JSON lines while it happens; `-` is standard output (docs/events.md)
    #[arg(long, value_name = "FILE")]
    pub events: Option<PathBuf>,
    /// Show the report in the browser when the run is over
    #[arg(long)]
    pub open: bool,
    /// How junit.xml shows what was not decided
    #[arg(long, value_name = "HOW", value_enum, default_value_t)]
    pub inconclusive: InconclusiveArg,
    /// Show the NUMBER tests that took longest
    #[arg(long, value_name = "NUMBER")]
    pub slowest: Option<usize>,
}

impl OutputArgs {
    /// Whether standard output belongs to the stream of events.
    #[must_use]
    pub fn speaks_events(&self) -> bool {
        self.events.as_deref().is_some_and(|path| path.as_os_str() == "-")
    }
}

/// How people are asked.
#[derive(Clone, Debug, Default, Args)]
pub struct PeopleArgs {
    /// Let questions be answered over HTTP as well, from this machine only; the address with its token is printed
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "127.0.0.1:0", help_heading = "People")]
    pub questions: Option<String>,
    /// The page for them.
    #[command(flatten)]
    pub page: PageArgs,
}

/// The page for the people beside the vehicle.
#[derive(Clone, Debug, Default, Args)]
pub struct PageArgs {
    /// Serve a page for the people beside the vehicle, with what is awaited and every prompt; this machine only unless said
    /// (docs/page.md)
    #[arg(
        long = "page",
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:0",
        help_heading = "People"
    )]
    pub address: Option<String>,
}

impl PageArgs {
    /// The flag, if it was given, by the name of the setting of the profile.
    #[must_use]
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        let address = self.address.iter();
        address.map(|address| ("bench.page", address.clone())).collect()
    }
}

/// What a pipeline reads.
#[derive(Clone, Debug, Default, Args)]
pub struct PipelineArgs {
    /// Write a file for a pipeline, whatever becomes of the run: junit, junit-requirements, junit-properties, ctrf, allure,
    /// markdown, code-quality, sarif, cyclonedx or svr; may be repeated (docs/ci.md)
    #[arg(long = "as", value_name = "KIND=FILE", value_parser = rendering::to_file)]
    pub renderings: Vec<RenderedTo>,
}

/// A broker, and how to get in there with one connection.
#[derive(Clone, Debug, Args)]
pub struct AccessArgs {
    /// The broker: mqtt://host:port, or with mqtts, or ws://host:port/path and wss
    #[arg(long, value_name = "URL", default_value = "mqtt://127.0.0.1:1883")]
    pub broker: String,
    /// User name at the broker; its password is taken from the variable `VDA5050_TCK_PASSWORD`
    #[arg(long, value_name = "NAME")]
    pub username: Option<String>,
    /// Whose certificates are trusted at a broker with TLS, as a PEM file
    #[arg(long, value_name = "FILE")]
    pub tls_ca: Option<PathBuf>,
    /// The certificate that is shown to a broker with TLS that asks for one, as a PEM file
    #[arg(long, value_name = "FILE", requires = "client_key", alias = "tls-cert")]
    pub client_cert: Option<PathBuf>,
    /// Its key, as a PEM file
    #[arg(long, value_name = "FILE", requires = "client_cert", alias = "tls-key")]
    pub client_key: Option<PathBuf>,
    /// MQTT client id; made up unless said
    #[arg(long, value_name = "ID")]
    pub client_id: Option<String>,
}

/// The format of standard output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people
    #[default]
    Text,
    /// For programs
    Json,
}

/// How a build server is told of what was not decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum InconclusiveArg {
    /// As an error: the build is red
    #[default]
    Error,
    /// As skipped
    Skip,
}

impl From<InconclusiveArg> for Inconclusive {
    fn from(argument: InconclusiveArg) -> Self {
        match argument {
            InconclusiveArg::Error => Self::Error,
            InconclusiveArg::Skip => Self::Skip,
        }
    }
}

/// The suites to be used.
#[derive(Clone, Debug, Default, Args)]
pub struct SuiteArgs {
    /// Use the suites of this folder beside the built-in ones; the verdict says so
    #[arg(long, value_name = "DIR", env = "VDA5050_TCK_SUITES", hide_env_values = true)]
    pub suites: Option<PathBuf>,
    /// Use the suites of --suites alone, without the built-in ones
    #[arg(long, requires = "suites")]
    pub replace_suites: bool,
}

impl SuiteArgs {
    /// The folder of suites, if one is given.
    #[must_use]
    pub fn own(&self) -> Option<Own<'_>> {
        let folder = self.suites.as_deref()?;
        Some(if self.replace_suites {
            Own::Alone(folder)
        } else {
            Own::Added(folder)
        })
    }
}
