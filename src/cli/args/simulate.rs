//! `simulate`: being a device.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Subcommand};
use serde_json::Value;

use tck_base::diagnostic;
use tck_profile::{VEHICLE_WORDS, find_vehicle_word};

use super::vehicle::VehicleKind;
use super::{AccessArgs, Format};

/// `simulate`.
#[derive(Clone, Debug, Args)]
pub struct Simulate {
    /// Which side to be.
    #[command(subcommand)]
    pub what: Simulated,
    /// How is said what is there: as a text on standard error, or as JSON lines on standard output
    #[arg(long, value_enum, default_value_t, global = true)]
    pub format: Format,
}

/// What can be simulated.
#[derive(Clone, Debug, Subcommand)]
pub enum Simulated {
    /// A reference AGV: the best-behaved vehicle there is, unless it is given faults
    Agv(SimulatedAgv),
    /// A reference master control: it commands vehicles, and does what is asked of it over HTTP
    MasterControl(SimulatedMasterControl),
    /// The recording of a fleet, for trying `audit`: written to standard output, one message a line
    #[command(hide = true)]
    Site(SimulatedSite),
}

/// `simulate site`.
#[derive(Clone, Debug, Args)]
pub struct SimulatedSite {
    /// How many messages
    #[arg(long, value_name = "NUMBER", default_value_t = 10_000)]
    pub messages: u64,
    /// How many vehicles
    #[arg(long, value_name = "NUMBER", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=9_999))]
    pub vehicles: u32,
    /// How many of the messages are faulty
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub faults: u64,
    /// Make the same recording for the same seed
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// Where it is written what is wrong where, one fault a line
    #[arg(long, value_name = "FILE")]
    pub key: Option<PathBuf>,
    /// Write no recording, but how many of the faults an audit finds, whatever a recorder made of the messages
    #[arg(long, conflicts_with = "key")]
    pub measure: bool,
}

/// How a simulated device reaches its broker.
#[derive(Clone, Debug, Args)]
pub struct ConnectionArgs {
    /// The broker, and how to get in.
    #[command(flatten)]
    pub access: AccessArgs,
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
  vda5050-tck simulate agv --count 50 --manufacturer ACME --offset 50   fifty more of them
  vda5050-tck simulate agv --fault outdated-update-taken-over
  vda5050-tck simulate agv --persona ignore-orders --persona 'set-battery={\"charge\": 10}'

Runs until you press Ctrl-C, and then disconnects in good order.";

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
    /// Serial number, as in its topics; with --count or --offset a number is added
    #[arg(long, value_name = "NUMBER", default_value = "reference")]
    pub serial: String,
    /// How many of them
    #[arg(long, value_name = "NUMBER", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub count: u32,
    /// How many of the fleet other processes have: the numbers go on behind theirs
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..=10_000_000))]
    pub offset: u32,
    /// Which kind of vehicle it is
    #[arg(long, value_name = "KIND", value_enum, default_value_t)]
    pub vehicle: VehicleKind,
    /// Give it a defect; may be repeated (see `list faults`)
    #[arg(long, value_name = "NAME")]
    pub fault: Vec<String>,
    /// Give it a liberty the standard leaves it; may be repeated (see `list tolerances`)
    #[arg(long, value_name = "NAME")]
    pub tolerance: Vec<String>,
    /// Let it behave like a known product (see `list counterparts`)
    #[arg(long, value_name = "NAME")]
    pub like: Option<String>,
    /// Start with this behaviour (see `list vehicle`), with its parameters as a JSON object behind `=`; may
    /// be repeated
    #[arg(long, value_name = "WORD")]
    pub persona: Vec<PersonaArg>,
    /// Serve what a person would do at the vehicle over HTTP here, by the names of `list hooks`; for one vehicle
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "count")]
    pub hooks: Option<String>,
    /// Seconds between two states when nothing happens
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds)]
    pub state_interval: Option<f64>,
}

const SIMULATE_MASTER_CONTROL_HELP: &str = "\
Examples:
  vda5050-tck simulate master-control --broker mqtt://127.0.0.1:1883 --hooks 127.0.0.1:8080
  vda5050-tck simulate agv --serial mock-1    a vehicle for it, in another terminal
  vda5050-tck simulate master-control --vehicle ACME/a-1 --vehicle Globex/g-7@2.0.0
  curl -d '{\"vehicle\": \"mock-1\", \"to\": \"A3\"}' http://127.0.0.1:8080/hooks/dispatch
  curl http://127.0.0.1:8080/                 what can be asked of it

Parameters are those of `list hooks`; an empty text is a parameter that is not there.
Runs until you press Ctrl-C, and then disconnects in good order.";

/// `simulate master-control`.
#[derive(Clone, Debug, Args)]
#[command(after_help = SIMULATE_MASTER_CONTROL_HELP)]
pub struct SimulatedMasterControl {
    /// The broker.
    #[command(flatten)]
    pub connection: ConnectionArgs,
    /// Where its hooks are served; this machine only unless said, and port 0 is any that is free
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:0")]
    pub hooks: String,
    /// A vehicle it commands; may be repeated [default: vda5050-tck/mock-1 and vda5050-tck/mock-2]
    #[arg(long, value_name = "MANUFACTURER/SERIAL[@VERSION]")]
    pub vehicle: Vec<VehicleArg>,
    /// How many vehicles it commands: vda5050-tck/mock-1 and so on
    #[arg(long, value_name = "NUMBER", conflicts_with = "vehicle", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub vehicles: Option<u32>,
    /// The floor, as a LIF file; the floor of the reference AGV unless said
    #[arg(long, value_name = "FILE")]
    pub layout: Option<PathBuf>,
    /// The vehicle type whose ways of the LIF file are used, when it has several
    #[arg(long, value_name = "NAME", requires = "layout")]
    pub vehicle_type: Option<String>,
    /// Give it a defect; may be repeated (see `list faults`)
    #[arg(long, value_name = "NAME")]
    pub fault: Vec<String>,
    /// Give it a liberty the standard leaves it; may be repeated (see `list tolerances`)
    #[arg(long, value_name = "NAME")]
    pub tolerance: Vec<String>,
    /// Let it behave like a known product (see `list counterparts`)
    #[arg(long, value_name = "NAME")]
    pub like: Option<String>,
}

/// A vehicle by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VehicleArg {
    /// Manufacturer, as in its topics.
    pub manufacturer: String,
    /// Serial number, as in its topics.
    pub serial: String,
    /// Protocol version it speaks; that of the master control where none is given.
    pub protocol: Option<String>,
}

impl FromStr for VehicleArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let level = |text: &str| !text.is_empty() && !text.contains(['/', '+', '#']);
        let is_version = |text: &str| text.parse::<tck_pack::Version>().is_ok();
        let (name, protocol) = match text.rsplit_once('@') {
            Some((name, version)) if is_version(version) => (name, Some(version.to_owned())),
            _ => (text, None),
        };
        match name.split_once('/') {
            Some((manufacturer, serial)) if level(manufacturer) && level(serial) => Ok(Self {
                manufacturer: manufacturer.to_owned(),
                serial: serial.to_owned(),
                protocol,
            }),
            _ => Err("a vehicle is written like ACME/0001, without further `/`, `+` and `#`".to_owned()),
        }
    }
}

/// A word for a vehicle, and its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct PersonaArg {
    /// The word.
    pub word: &'static str,
    /// An object.
    pub parameters: Value,
}

impl FromStr for PersonaArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, parameters) = text.split_once('=').unwrap_or((text, "{}"));
        let word = find_vehicle_word(name).ok_or_else(|| {
            let known = VEHICLE_WORDS.iter().map(|word| word.name);
            match diagnostic::closest(name, known) {
                Some(close) => format!("there is no word `{name}` for a vehicle; did you mean `{close}`?"),
                None => format!("there is no word `{name}` for a vehicle; `vda5050-tck list vehicle` shows them all"),
            }
        })?;
        let parameters: Value = serde_json::from_str(parameters)
            .map_err(|error| format!("the parameters of `{name}` are not JSON: {error}"))?;
        let Some(all) = parameters.as_object() else {
            return Err(format!("the parameters of `{name}` are not a JSON object"));
        };
        if let Some(unknown) = all.keys().find(|key| !word.parameters.contains(&key.as_str())) {
            return Err(match word.parameters {
                [] => format!("`{name}` has no parameters"),
                known => format!("`{name}` has no parameter `{unknown}`; it has {}", known.join(", ")),
            });
        }
        Ok(Self {
            word: word.name,
            parameters,
        })
    }
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.01..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("a number of seconds from 0.01 to 3600".to_owned()),
    }
}
