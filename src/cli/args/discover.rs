//! `discover` and `init`: who is there, and a profile from that.

use std::path::PathBuf;

use clap::Args;

use super::inspect::parse_role;
use super::{AccessArgs, Format};
use tck_pack::Role;

const DISCOVER_HELP: &str = "\
Examples:
  vda5050-tck discover --broker mqtt://127.0.0.1:1883 --seconds 35
  vda5050-tck discover --broker mqtts://site:8883 --username tck --tls-ca ca.crt --topic 'uagv/v2/ACME/#'

It only listens: nothing is published. States come at least every 30 s, and retained messages at once.";

/// Which broker is listened on.
#[derive(Clone, Debug, Args)]
pub struct BrokerArgs {
    /// The broker, and how to get in.
    #[command(flatten)]
    pub access: AccessArgs,
    /// Topic filter to subscribe to; may be repeated [default: everything]
    #[arg(long, value_name = "FILTER")]
    pub topic: Vec<String>,
}

impl BrokerArgs {
    /// What is subscribed to.
    #[must_use]
    pub fn filters(&self) -> Vec<String> {
        match self.topic.as_slice() {
            [] => vec!["#".to_owned()],
            filters => filters.to_vec(),
        }
    }
}

/// How to listen on a broker.
#[derive(Clone, Debug, Args)]
pub struct ListenArgs {
    /// Where.
    #[command(flatten)]
    pub at: BrokerArgs,
    /// How long to listen, in seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 35, value_parser = clap::value_parser!(u64).range(1..=3_600))]
    pub seconds: u64,
}

/// `discover`.
#[derive(Clone, Debug, Args)]
#[command(after_help = DISCOVER_HELP)]
pub struct Discover {
    /// Where to listen.
    #[command(flatten)]
    pub listen: ListenArgs,
    /// How it is written
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
}

const INIT_HELP: &str = "\
Examples:
  vda5050-tck init --broker mqtt://127.0.0.1:1883 --manufacturer ACME --serial 0001
  vda5050-tck init --broker mqtt://127.0.0.1:1883 --lif hall.lif.json --vehicle-type ACME.Carrier
  vda5050-tck init --role master-control --manufacturer ACME --serial fleet-1   a skeleton; nothing is listened to
  vda5050-tck init --suites own                      what tests of your own can begin with

It listens as `discover` does and writes a commented profile. Nothing is sent to the device, and motion stays off.";

/// `init`.
#[derive(Clone, Debug, Args)]
#[command(after_help = INIT_HELP)]
pub struct Init {
    /// Where to listen.
    #[command(flatten)]
    pub listen: ListenArgs,
    /// Which side the profile is for; for a master control nothing is listened to [agv, master-control]
    #[arg(long, value_name = "ROLE", value_parser = parse_role, default_value = "agv")]
    pub role: Role,
    /// Manufacturer of the device; needed when several are heard
    #[arg(long, value_name = "NAME")]
    pub manufacturer: Option<String>,
    /// Serial number of the device; needed when several are heard
    #[arg(long, value_name = "NUMBER")]
    pub serial: Option<String>,
    /// The floor, as a LIF file
    #[arg(long, value_name = "FILE")]
    pub lif: Option<String>,
    /// The vehicle type in the LIF file
    #[arg(long, value_name = "NAME", requires = "lif")]
    pub vehicle_type: Option<String>,
    /// The file to write; one that is there is kept
    #[arg(long, value_name = "FILE", default_value = "device.toml")]
    pub file: PathBuf,
    /// Write over a file that is there
    #[arg(long)]
    pub force: bool,
    /// How is said what was written
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Write the built-in suites, the schemas for editors and every setting with its default into this folder, and no profile
    #[arg(long, value_name = "DIR", conflicts_with_all = ["broker", "username", "tls_ca", "client_cert", "client_key", "client_id", "topic", "seconds", "role", "manufacturer", "serial", "lif", "file", "force"])]
    pub suites: Option<PathBuf>,
}
