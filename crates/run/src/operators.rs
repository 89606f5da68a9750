//! Who carries out what a test asks to be done to the device: the hooks of a profile, or the built-in device itself.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};

use super::device::{DeviceProcess, Surroundings};
use super::hooks::{Means, ProfileHooks};
use super::person::Person;
use tck_base::device::Commanded;
use tck_engine::{HookOutcome, Operator};
use tck_net::link::mqtt::BenchInfo;
use tck_profile::{self as profile, Profile};
use tck_simulate::driver::RunningDevice;

/// The hooks of a profile; starts the device if the profile says how.
pub(super) async fn hooks_of(
    profile: &Profile,
    info: &BenchInfo,
    (device_log, surroundings): (Option<PathBuf>, Surroundings),
    folder: PathBuf,
    (person, means): (Option<Arc<dyn Person>>, Means),
) -> std::io::Result<ProfileHooks> {
    let (host, port) = info
        .device_address
        .rsplit_once(':')
        .unwrap_or((&info.device_address, "1883"));
    let device = &profile.device;
    let common: BTreeMap<String, String> = [
        ("broker-host", host.to_owned()),
        ("broker-port", port.to_owned()),
        ("manufacturer", device.manufacturer.clone().unwrap_or_default()),
        ("serial-number", device.serial_number.clone().unwrap_or_default()),
        (
            "vehicle",
            profile.vehicles.serial_numbers.first().cloned().unwrap_or_default(),
        ),
        ("free-port", free_port()?),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_owned(), value))
    .collect();
    let mut process = device.command.as_ref().map(|command| {
        let filled = command
            .iter()
            .map(|word| profile::fill(word, &common, str::to_owned))
            .collect();
        DeviceProcess::new(filled, folder.clone(), device_log, surroundings)
    });
    if let Some(process) = &mut process {
        process.start().await?;
    }
    Ok(ProfileHooks::new(
        profile.hooks.clone(),
        common,
        folder,
        process,
        person,
        means,
    ))
}

/// Ports below those that an operating system gives to outgoing connections: what one of them is given is not free any
/// more when the device is started again.
const OWN_PORTS: std::ops::Range<u32> = 20_000..32_000;

/// A port of this machine that nobody uses now. Harnesses that start at the same time begin to look in different places.
fn free_port() -> std::io::Result<String> {
    let span = OWN_PORTS.end - OWN_PORTS.start;
    let first = std::process::id().wrapping_mul(97) % span;
    for step in 0..100 {
        let port = OWN_PORTS.start + (first + step) % span;
        if std::net::TcpListener::bind(format!("127.0.0.1:{port}")).is_ok() {
            return Ok(port.to_string());
        }
    }
    let address = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?;
    Ok(address.port().to_string())
}

/// Hooks of the built-in device: commands to its driver.
pub(super) struct Commands {
    pub(super) device: RunningDevice,
    pub(super) hooks: &'static [&'static str],
}

impl Operator for Commands {
    fn hooks(&self) -> Vec<String> {
        self.hooks.iter().map(|hook| (*hook).to_owned()).collect()
    }

    async fn run(&mut self, hook: &str, parameters: Map<String, Value>) -> HookOutcome {
        if !self.hooks.contains(&hook) {
            return HookOutcome::Missing;
        }
        match self.device.ask(hook, Value::Object(parameters)).await {
            Commanded::Taken => HookOutcome::Done("done by the built-in device".to_owned()),
            Commanded::Declined(why) => HookOutcome::Refused(why),
            Commanded::Nobody => HookOutcome::Failed("the built-in device is not running any more".to_owned()),
        }
    }

    fn usual_time(&self) -> Duration {
        Duration::from_millis(1)
    }
}
