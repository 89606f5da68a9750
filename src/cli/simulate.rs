//! `simulate`: be a reference device on a broker.

use std::io::Write as _;
use std::sync::Arc;
use std::time::Duration;

use serde_json::Value;

use super::args::{ConnectionArgs, Simulate, Simulated, SimulatedAgv, SimulatedMasterControl, SimulatedSite};
use super::device::{check_faults, tolerate};
use super::exit::Exit;
use super::problem::Problem;
use super::signals::Signals;
use crate::bench::endpoint::{Credentials, Endpoint};
use crate::clock::WallClock;
use crate::course::Layout;
use crate::diagnostic::{Diagnostic, Source};
use crate::pack::{Pack, Role};
use crate::run::Library;
use crate::simulate::driver::RunningDevice;
use crate::simulate::{BuiltIn, Fleet, HookServer, ReferenceAgv, ReferenceMasterControl, Site};

/// `simulate`.
pub fn simulate(arguments: &Simulate) -> Result<Exit, Problem> {
    let connection = match &arguments.what {
        Simulated::Agv(device) => &device.connection,
        Simulated::MasterControl(device) => &device.connection,
        Simulated::Site(recording) => return site(recording),
    };
    let library = Library::load(None)?;
    let pack = super::pack(&library, connection.protocol.as_deref())?;
    // Suites and catalogue are not needed by a device.
    drop(library);
    let endpoint = endpoint(connection)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    runtime.block_on(async {
        match &arguments.what {
            Simulated::Agv(device) => agvs(device, &pack, &endpoint).await,
            Simulated::MasterControl(device) => master_control(device, &pack, &endpoint).await,
            Simulated::Site(recording) => site(recording),
        }
    })
}

/// Writes the recording of a fleet.
fn site(arguments: &SimulatedSite) -> Result<Exit, Problem> {
    let broken = |error: std::io::Error| Problem::Environment(format!("cannot write the recording: {error}"));
    let site = Site {
        seed: arguments.seed,
        vehicles: usize::try_from(arguments.vehicles).unwrap_or(usize::MAX),
        messages: arguments.messages,
        faults: arguments.faults,
    };
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut key = match &arguments.key {
        Some(path) => Some(std::io::BufWriter::new(std::fs::File::create(path).map_err(broken)?)),
        None => None,
    };
    for message in site.messages() {
        match writeln!(out, "{}", message.line()) {
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => return Ok(Exit::Conforms),
            written => written.map_err(broken)?,
        }
        if let (Some(key), Some(injected)) = (&mut key, &message.injected) {
            let line = serde_json::to_string(injected).map_err(|error| Problem::Environment(error.to_string()))?;
            writeln!(key, "{line}").map_err(broken)?;
        }
    }
    out.flush().map_err(broken)?;
    if let Some(key) = &mut key {
        key.flush().map_err(broken)?;
    }
    Ok(Exit::Conforms)
}

/// Where the broker is, and how it lets in.
fn endpoint(connection: &ConnectionArgs) -> Result<Endpoint, Problem> {
    let credentials = connection.username.clone().map(|username| Credentials {
        username,
        password: std::env::var(crate::profile::PASSWORD_VARIABLE).unwrap_or_default(),
    });
    Endpoint::parse(&connection.broker, None, credentials).map_err(|error| {
        Problem::from(Diagnostic::whole("broker", error.to_string()).hint("give it as mqtt://host:port"))
    })
}

/// Says at once when nobody is there; later losses are the device's own business.
async fn reach(endpoint: &Endpoint, connection: &ConnectionArgs) -> Result<(), Problem> {
    let reached = tokio::net::TcpStream::connect((endpoint.host.as_str(), endpoint.port)).await;
    reached.map(drop).map_err(|error| {
        let broker = &connection.broker;
        Problem::Environment(format!("the broker at {broker} is not reachable: {error}"))
    })
}

fn start(
    reference: &BuiltIn,
    faults: &[String],
    endpoint: &Endpoint,
    clock: WallClock,
) -> Result<RunningDevice, Problem> {
    let faults: Vec<&str> = faults.iter().map(String::as_str).collect();
    let started = reference.start(&faults, endpoint.clone(), clock);
    started.map_err(|error| Diagnostic::whole("fault", error.to_string()).into())
}

/// Signs a device off.
async fn end(device: RunningDevice) {
    device.command("shutdown", Value::Null).await;
    device.stop().await;
}

async fn agvs(device: &SimulatedAgv, pack: &Arc<Pack>, endpoint: &Endpoint) -> Result<Exit, Problem> {
    check_faults(Role::Agv, &device.fault)?;
    let mut signals = Signals::listen()?;
    reach(endpoint, &device.connection).await?;
    let clock = WallClock::start();
    let mut running = Vec::new();
    for number in 1..=device.count {
        let serial = if device.count == 1 {
            device.serial.clone()
        } else {
            format!("{}-{number}", device.serial)
        };
        let mut reference = ReferenceAgv::of(device.vehicle.0, pack);
        let template = device.connection.topic_template.as_deref();
        reference.rename(&device.manufacturer, &serial, template, pack);
        if let Some(seconds) = device.state_interval {
            reference.config.state_interval = Duration::from_secs_f64(seconds);
        }
        let mut reference = BuiltIn::from(reference);
        tolerate(&mut reference, &device.tolerance)?;
        let agv = start(&reference, &device.fault, endpoint, clock)?;
        for persona in &device.persona {
            agv.command(persona.word, persona.parameters.clone()).await;
        }
        running.push(agv);
    }
    eprintln!(
        "{} simulated AGV(s) on {}; press Ctrl-C to disconnect",
        device.count, device.connection.broker
    );
    signals.next().await;
    for device in running {
        end(device).await;
    }
    Ok(Exit::Conforms)
}

async fn master_control(
    device: &SimulatedMasterControl,
    pack: &Arc<Pack>,
    endpoint: &Endpoint,
) -> Result<Exit, Problem> {
    check_faults(Role::MasterControl, &device.fault)?;
    let mut signals = Signals::listen()?;
    let mut reference = BuiltIn::from(configured(device, pack)?);
    tolerate(&mut reference, &device.tolerance)?;
    reach(endpoint, &device.connection).await?;
    let running = start(&reference, &device.fault, endpoint, WallClock::start())?;
    let server = HookServer::start(&device.hooks, running, reference.hooks()).await;
    let server = server.map_err(|error| Problem::Environment(error.to_string()))?;
    eprintln!("hooks are served at http://{}", server.address());
    let vehicles = reference.fleet().map_or(0, |fleet| fleet.vehicles.len());
    eprintln!(
        "a reference master control of {vehicles} vehicle(s) on {}; press Ctrl-C to disconnect",
        device.connection.broker
    );
    signals.next().await;
    if let Some(running) = server.stop().await {
        end(running).await;
    }
    Ok(Exit::Conforms)
}

/// The master control as the command line wants it.
fn configured(device: &SimulatedMasterControl, pack: &Pack) -> Result<ReferenceMasterControl, Problem> {
    let mut like = ReferenceAgv::new(pack);
    like.subject
        .topic_template
        .clone_from(&device.connection.topic_template);
    if let Some(file) = &device.layout {
        let name = file.display().to_string();
        let text = std::fs::read_to_string(file)
            .map_err(|error| Diagnostic::whole("unreadable", format!("the layout {name} cannot be read: {error}")))?;
        like.live_on(Layout::from_lif(
            &Source::new(name, text),
            device.vehicle_type.as_deref(),
        )?);
    }
    let named = device.vehicle.iter();
    let names: Vec<(String, String)> = named
        .map(|vehicle| (vehicle.manufacturer.clone(), vehicle.serial.clone()))
        .collect();
    if names.is_empty() && device.layout.is_none() && device.connection.topic_template.is_none() {
        return Ok(ReferenceMasterControl::new(pack));
    }
    let fleet = if names.is_empty() {
        Fleet::new(&like, "vda5050-tck", &[], crate::simulate::USUAL_FLEET, pack)
    } else {
        Fleet::named(&like, &names, pack)
    };
    Ok(ReferenceMasterControl::commanding(fleet, like.layout, pack))
}
