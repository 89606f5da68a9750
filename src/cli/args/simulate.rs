//! `simulate`: being a device.

use clap::{Args, Subcommand};

/// `simulate`.
#[derive(Clone, Debug, Args)]
pub struct Simulate {
    /// Which side to be.
    #[command(subcommand)]
    pub what: Simulated,
}

/// What can be simulated.
#[derive(Clone, Debug, Subcommand)]
pub enum Simulated {
    /// A reference AGV: the best-behaved vehicle there is, unless it is given faults
    Agv(SimulatedAgv),
    /// A reference master control that dispatches transports to the vehicles it sees
    MasterControl(SimulatedMasterControl),
}

/// How a simulated device reaches its broker.
#[derive(Clone, Debug, Args)]
pub struct ConnectionArgs {
    /// The broker: mqtt://host:port or mqtts://host:port
    #[arg(long, value_name = "URL", default_value = "mqtt://127.0.0.1:1883")]
    pub broker: String,
    /// User name at the broker; its password is taken from the variable `VDA5050_TCK_PASSWORD`
    #[arg(long, value_name = "NAME")]
    pub username: Option<String>,
    /// Protocol version it speaks; the newest one unless said
    #[arg(long, value_name = "VERSION")]
    pub protocol: Option<String>,
    /// How topics begin, with {majorVersion}, {manufacturer} and {serialNumber}
    #[arg(long, value_name = "TEMPLATE")]
    pub topic_template: Option<String>,
    /// Make identifiers and the order of events repeatable
    #[arg(long, value_name = "NUMBER")]
    pub seed: Option<u64>,
    /// Say more: every message; twice, with its content
    #[arg(short, long, action = clap::ArgAction::Count)]
    pub verbose: u8,
}

const SIMULATE_AGV_HELP: &str = "\
Examples:
  vda5050-tck simulate agv --broker mqtt://127.0.0.1:1883
  vda5050-tck simulate agv --count 50 --manufacturer ACME
  vda5050-tck simulate agv --fault outdated-update-taken-over

Runs until it is interrupted (Ctrl-C), and then signs off in good order.";

/// `simulate agv`.
#[derive(Clone, Debug, Args)]
#[command(after_help = SIMULATE_AGV_HELP)]
pub struct SimulatedAgv {
    /// The broker.
    #[command(flatten)]
    pub connection: ConnectionArgs,
    /// Manufacturer, as in its topics
    #[arg(long, value_name = "NAME", default_value = "vda5050-tck")]
    pub manufacturer: String,
    /// Serial number, as in its topics; with --count a number is added
    #[arg(long, value_name = "NUMBER", default_value = "reference")]
    pub serial: String,
    /// How many of them
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub count: u32,
    /// Give it a defect; may be repeated (see `list faults`)
    #[arg(long, value_name = "NAME")]
    pub fault: Vec<String>,
    /// Let it behave in a way a master control has to cope with
    #[arg(long, value_name = "NAME")]
    pub persona: Option<String>,
}

const SIMULATE_MASTER_CONTROL_HELP: &str = "\
Examples:
  vda5050-tck simulate master-control --broker mqtt://127.0.0.1:1883
  vda5050-tck simulate master-control --manufacturer ACME --serial 0001

Runs until it is interrupted (Ctrl-C).";

/// `simulate master-control`.
#[derive(Clone, Debug, Args)]
#[command(after_help = SIMULATE_MASTER_CONTROL_HELP)]
pub struct SimulatedMasterControl {
    /// The broker.
    #[command(flatten)]
    pub connection: ConnectionArgs,
    /// Only vehicles of this manufacturer
    #[arg(long, value_name = "NAME")]
    pub manufacturer: Option<String>,
    /// Only the vehicle with this serial number
    #[arg(long, value_name = "NUMBER")]
    pub serial: Option<String>,
    /// Give it a defect; may be repeated (see `list faults`)
    #[arg(long, value_name = "NAME")]
    pub fault: Vec<String>,
}
