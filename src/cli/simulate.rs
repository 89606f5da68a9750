//! `simulate`: be a reference device on a broker.

use super::args::{Simulate, Simulated};
use super::device::{check_faults, tolerate};
use super::exit::Exit;
use super::problem::Problem;
use crate::clock::WallClock;
use crate::diagnostic::Diagnostic;
use crate::link::mqtt::endpoint::{Credentials, Endpoint};
use crate::reference::agv::Agv;
use crate::run::device_driver::RunningDevice;
use crate::run::{Library, ReferenceAgv};

/// `simulate`.
pub fn simulate(arguments: &Simulate) -> Result<Exit, Problem> {
    let Simulated::Agv(device) = &arguments.what;
    check_faults(&device.fault)?;
    let library = Library::load(None)?;
    let pack = super::pack(&library, device.connection.protocol.as_deref())?;
    let credentials = device.connection.username.clone().map(|username| Credentials {
        username,
        password: std::env::var(crate::profile::PASSWORD_VARIABLE).unwrap_or_default(),
    });
    let endpoint = Endpoint::parse(&device.connection.broker, None, credentials).map_err(|error| {
        Problem::from(Diagnostic::whole("broker", error.to_string()).hint("give it as mqtt://host:port"))
    })?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    let faults: Vec<&str> = device.fault.iter().map(String::as_str).collect();
    runtime.block_on(async {
        // Said at once when nobody is there; later losses are the device's own business.
        tokio::net::TcpStream::connect((endpoint.host.as_str(), endpoint.port))
            .await
            .map_err(|error| {
                Problem::Environment(format!(
                    "the broker at {} is not reachable: {error}",
                    device.connection.broker
                ))
            })?;
        let clock = WallClock::start();
        let mut running = Vec::new();
        for number in 1..=device.count {
            let mut reference = ReferenceAgv::of(device.vehicle.0, &pack);
            tolerate(&mut reference, &device.tolerance)?;
            let serial = if device.count == 1 {
                device.serial.clone()
            } else {
                format!("{}-{number}", device.serial)
            };
            reference.rename(
                &device.manufacturer,
                &serial,
                device.connection.topic_template.as_deref(),
                &pack,
            );
            let agv = Agv::new(reference.config, &faults)
                .map_err(|error| Problem::from(Diagnostic::whole("fault", error.to_string())))?;
            running.push(RunningDevice::start(agv, endpoint.clone(), clock, None));
        }
        eprintln!(
            "{} reference AGV(s) on {}; Ctrl-C signs off",
            device.count, device.connection.broker
        );
        let _ = tokio::signal::ctrl_c().await;
        for device in running {
            device.command("shutdown", serde_json::Value::Null).await;
            device.stop().await;
        }
        Ok(Exit::Conforms)
    })
}
