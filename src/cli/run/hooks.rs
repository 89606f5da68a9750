//! Hooks of a run: those of a profile, or commands to the built-in device.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use crate::cli::problem::Problem;
use crate::engine::{HookOutcome, Operator};
use crate::link::mqtt::BenchInfo;
use crate::profile::{self, Profile};
use crate::run::Bundle;
use crate::run::device_driver::RunningDevice;
use crate::run::hooks::{DeviceProcess, ProfileHooks};

/// The hooks of a profile; starts the device if the profile says how.
pub(super) fn of_profile(
    profile: &Profile,
    info: &BenchInfo,
    bundle: &Bundle,
    folder: &Path,
) -> Result<ProfileHooks, Problem> {
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
        DeviceProcess::new(filled, folder.to_owned(), Some(bundle.folder().join("device.log")))
    });
    if let Some(process) = &mut process {
        process
            .start()
            .map_err(|error| Problem::Environment(error.to_string()))?;
    }
    let attended = console::user_attended();
    Ok(ProfileHooks::new(
        profile.hooks.clone(),
        common,
        folder.to_owned(),
        process,
        attended,
    ))
}

/// Ports below those that an operating system gives to outgoing connections: what one of them is given is not free any
/// more when the device is started again.
const OWN_PORTS: std::ops::Range<u32> = 20_000..32_000;

/// A port of this machine that nobody uses now. Harnesses that start at the same time begin to look in different places.
fn free_port() -> Result<String, Problem> {
    let span = OWN_PORTS.end - OWN_PORTS.start;
    let first = std::process::id().wrapping_mul(97) % span;
    for step in 0..100 {
        let port = OWN_PORTS.start + (first + step) % span;
        if std::net::TcpListener::bind(format!("127.0.0.1:{port}")).is_ok() {
            return Ok(port.to_string());
        }
    }
    let listener = std::net::TcpListener::bind("127.0.0.1:0");
    let address = listener.and_then(|listener| listener.local_addr());
    let address = address.map_err(|error| Problem::Environment(format!("no port is free: {error}")))?;
    Ok(address.port().to_string())
}

/// Hooks of the built-in device: commands to its driver.
pub(super) struct Commands {
    pub device: RunningDevice,
    pub hooks: &'static [&'static str],
}

impl Operator for Commands {
    fn hooks(&self) -> Vec<String> {
        self.hooks.iter().map(|hook| (*hook).to_owned()).collect()
    }

    async fn run(&mut self, hook: &str, parameters: serde_json::Map<String, serde_json::Value>) -> HookOutcome {
        if !self.hooks.contains(&hook) {
            return HookOutcome::Missing;
        }
        if self.device.command(hook, serde_json::Value::Object(parameters)).await {
            HookOutcome::Done("done by the built-in device".to_owned())
        } else {
            HookOutcome::Failed("the built-in device is not running any more".to_owned())
        }
    }

    fn usual_time(&self) -> Duration {
        Duration::from_millis(1)
    }
}
