//! `simulate`: being a device.

use clap::{Args, Subcommand};

use super::vehicle::VehicleKind;

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
    /// Which kind of vehicle it is
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub vehicle: VehicleKind,
    /// Give it a defect; may be repeated (see `list faults`)
    #[arg(long, value_name = "NAME")]
    pub fault: Vec<String>,
    /// Give it a liberty the standard leaves it; may be repeated (see `list tolerances`)
    #[arg(long, value_name = "NAME")]
    pub tolerance: Vec<String>,
}
