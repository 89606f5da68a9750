//! `simulate`: be a reference device on a broker.

use std::io::Write as _;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};

use super::args::{ConnectionArgs, Format, Simulate, Simulated, SimulatedAgv, SimulatedMasterControl, SimulatedSite};
use super::device::{check_faults, tolerate};
use super::exit::Exit;
use super::like::{joined, named};
use super::problem::Problem;
use super::signals::Signals;
use tck_base::clock::WallClock;
use tck_base::diagnostic::{Diagnostic, Source};
use tck_course::Layout;
use tck_net::bench::endpoint::Endpoint;
use tck_pack::{Pack, Packs, Role};
use tck_simulate::driver::RunningDevice;
use tck_simulate::{BuiltIn, Counterpart, Fleet, HookServer, ReferenceAgv, ReferenceMasterControl, Site};

/// `simulate`.
pub fn simulate(arguments: &Simulate) -> Result<Exit, Problem> {
    let (connection, like) = match &arguments.what {
        Simulated::Agv(device) => (&device.connection, named(device.like.as_deref(), Role::Agv)?),
        Simulated::MasterControl(device) => (&device.connection, named(device.like.as_deref(), Role::MasterControl)?),
        Simulated::Site(recording) => return site(recording),
    };
    if matches!(arguments.what, Simulated::Agv(_)) {
        use_small_pages();
    }
    let spoken = like.as_ref().and_then(|like| like.protocol.as_deref());
    let packs =
        Packs::load(&crate::assets::embedded_versions()).map_err(|error| Problem::Environment(error.to_string()))?;
    let role = match &arguments.what {
        Simulated::MasterControl(_) => Role::MasterControl,
        Simulated::Agv(_) | Simulated::Site(_) => Role::Agv,
    };
    let pack = super::pack_for_devices(&packs, connection.protocol.as_deref().or(spoken), role)?;
    let endpoint = super::discover::endpoint(&connection.access)?;
    let mut builder = match &arguments.what {
        Simulated::MasterControl(_) => tokio::runtime::Builder::new_multi_thread(),
        // Vehicles do little each, and ten thousand of them fit on one core: a second one would only be told of the first.
        _ => tokio::runtime::Builder::new_current_thread(),
    };
    let runtime = builder.worker_threads(2).enable_all().build();
    let runtime = runtime.map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    runtime.block_on(async {
        match &arguments.what {
            Simulated::Agv(device) => {
                // The vehicles take the room of the versions they do not speak.
                drop(packs);
                agvs(device, like.as_ref(), &pack, &endpoint, arguments.format).await
            }
            Simulated::MasterControl(device) => {
                master_control(device, like.as_ref(), (&packs, &pack), &endpoint, arguments.format).await
            }
            Simulated::Site(recording) => site(recording),
        }
    })
}

/// Takes memory in small pages: of a huge one all is taken when a little is used, and vehicles use a little each.
fn use_small_pages() {
    // It is as good without, but larger.
    #[cfg(target_os = "linux")]
    let _ = rustix::thread::disable_transparent_huge_pages(true);
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
    if arguments.measure {
        super::print(&super::impaired::table(site)?)?;
        return Ok(Exit::Conforms);
    }
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

/// Says when the broker does not let the device in; later losses are the device's own business.
async fn enter(device: &mut RunningDevice, endpoint: &Endpoint) -> Result<(), Problem> {
    let entered = device.is_let_in().await;
    entered.map_err(|reason| Problem::Environment(endpoint.lost(reason).to_string()))
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

/// The faults and tolerances that were asked for, and those of a counterpart.
fn habits(faults: &[String], tolerances: &[String], like: Option<&Counterpart>) -> (Vec<String>, Vec<String>) {
    (
        joined(faults, like, |like| like.faults().collect()),
        joined(tolerances, like, |like| like.tolerances().collect()),
    )
}

/// How topics begin: as it was asked for, or as those of a counterpart do.
fn template<'a>(connection: &'a ConnectionArgs, like: Option<&'a Counterpart>) -> Option<&'a str> {
    let own = like.and_then(|like| like.topic_template.as_deref());
    connection.topic_template.as_deref().or(own)
}

/// Signs a device off.
async fn end(device: RunningDevice) {
    device.command("shutdown", Value::Null).await;
    device.stop().await;
}

/// Says what is there: a text for people, a line for programs.
fn say(format: Format, text: &str, event: &Value) -> Result<(), Problem> {
    match format {
        Format::Json => super::print(&format!("{event}\n")).map(drop),
        Format::Text => {
            eprintln!("{text}");
            Ok(())
        }
    }
}

async fn agvs(
    device: &SimulatedAgv,
    like: Option<&Counterpart>,
    pack: &Arc<Pack>,
    endpoint: &Endpoint,
    format: Format,
) -> Result<Exit, Problem> {
    check_faults(Role::Agv, &device.fault)?;
    let (faults, tolerances) = habits(&device.fault, &device.tolerance, like);
    super::open_files::allow(device.count);
    let mut signals = Signals::listen()?;
    let clock = WallClock::start();
    let mut running = Vec::new();
    let is_fleet = device.count > 1 || device.offset > 0;
    // They share what they know of their site.
    let plain = ReferenceAgv::of(device.vehicle.0, pack);
    for number in device.offset + 1..=device.offset + device.count {
        let serial = if is_fleet {
            format!("{}-{number}", device.serial)
        } else {
            device.serial.clone()
        };
        let mut reference = plain.clone();
        let template = template(&device.connection, like);
        reference.rename(&device.manufacturer, &serial, template, pack);
        if let Some(seconds) = device.state_interval {
            reference.config.state_interval = Duration::from_secs_f64(seconds);
        }
        let mut reference = BuiltIn::from(reference);
        tolerate(&mut reference, &tolerances)?;
        let mut endpoint = endpoint.clone();
        if let Some(client_id) = endpoint.client_id.as_mut().filter(|_| is_fleet) {
            *client_id = format!("{client_id}-{number}");
        }
        let mut agv = start(&reference, &faults, &endpoint, clock)?;
        if running.is_empty() {
            enter(&mut agv, &endpoint).await?;
        }
        for persona in &device.persona {
            agv.command(persona.word, persona.parameters.clone()).await;
        }
        running.push(agv);
        // Those that run already get on meanwhile.
        tokio::task::yield_now().await;
    }
    let server = match (&device.hooks, running.len()) {
        (Some(listen), 1) => {
            let known = BuiltIn::from(ReferenceAgv::of(device.vehicle.0, pack)).hooks();
            let server = HookServer::start(listen, running.remove(0), known).await;
            Some(server.map_err(|error| Problem::Environment(error.to_string()))?)
        }
        _ => None,
    };
    if let Some(server) = &server {
        let hooks = format!("http://{}", server.address());
        say(
            format,
            &format!("hooks are served at {hooks}"),
            &json!({ "event": "hooks", "address": hooks }),
        )?;
    }
    let broker = &device.connection.access.broker;
    let count = device.count;
    say(
        format,
        &format!("{count} simulated AGV(s) on {broker}; press Ctrl-C to disconnect"),
        &json!({ "event": "simulating", "role": Role::Agv.word(), "count": count, "broker": broker }),
    )?;
    signals.next().await;
    if let Some(server) = server
        && let Some(device) = server.stop().await
    {
        end(device).await;
    }
    for device in running {
        end(device).await;
    }
    if format == Format::Json {
        super::print(&format!("{}\n", json!({ "event": "disconnected" })))?;
    }
    Ok(Exit::Conforms)
}

async fn master_control(
    device: &SimulatedMasterControl,
    like: Option<&Counterpart>,
    (packs, pack): (&Packs, &Arc<Pack>),
    endpoint: &Endpoint,
    format: Format,
) -> Result<Exit, Problem> {
    check_faults(Role::MasterControl, &device.fault)?;
    let (faults, tolerances) = habits(&device.fault, &device.tolerance, like);
    let mut signals = Signals::listen()?;
    let mut reference = BuiltIn::from(configured(device, template(&device.connection, like), packs, pack)?);
    tolerate(&mut reference, &tolerances)?;
    // Two of them may live at one broker, and whoever comes under the client id of another one throws it out.
    let made_up = || {
        let random = uuid::Uuid::new_v4().simple().to_string();
        format!("reference-master-control-{}", &random[..8])
    };
    let mut endpoint = endpoint.clone();
    endpoint.client_id.get_or_insert_with(made_up);
    let mut running = start(&reference, &faults, &endpoint, WallClock::start())?;
    enter(&mut running, &endpoint).await?;
    let server = HookServer::start(&device.hooks, running, reference.hooks()).await;
    let server = server.map_err(|error| Problem::Environment(error.to_string()))?;
    let hooks = format!("http://{}", server.address());
    let vehicles = reference.fleet().map_or(0, |fleet| fleet.vehicles.len());
    let broker = &device.connection.access.broker;
    say(
        format,
        &format!(
            "hooks are served at {hooks}\na reference master control of {vehicles} vehicle(s) on {broker}; press Ctrl-C to \
             disconnect"
        ),
        &json!({ "event": "simulating", "role": Role::MasterControl.word(), "count": vehicles, "broker": broker,
            "hooks": hooks }),
    )?;
    signals.next().await;
    if let Some(running) = server.stop().await {
        end(running).await;
    }
    Ok(Exit::Conforms)
}

/// The master control as the command line wants it.
fn configured(
    device: &SimulatedMasterControl,
    template: Option<&str>,
    packs: &Packs,
    pack: &Arc<Pack>,
) -> Result<ReferenceMasterControl, Problem> {
    let mut layout = None;
    if let Some(file) = &device.layout {
        let name = file.display().to_string();
        let text = std::fs::read_to_string(file)
            .map_err(|error| Diagnostic::whole("unreadable", format!("the layout {name} cannot be read: {error}")))?;
        let whole = Layout::from_lif(&Source::new(name, text), device.vehicle_type.as_deref())?;
        layout = Some(whole.commanded_by_another());
    }
    let like = |pack: &Pack| {
        let mut like = ReferenceAgv::new(pack);
        if let Some(layout) = &layout {
            like.live_on(layout.clone());
        }
        like.subject.topic_template = template.map(str::to_owned);
        like
    };
    let mut fleet = Fleet::default();
    for vehicle in &device.vehicle {
        let own = match &vehicle.protocol {
            Some(version) => super::pack_for_devices(packs, Some(version), Role::MasterControl)?,
            None => Arc::clone(pack),
        };
        fleet.join(&like(&own), &vehicle.manufacturer, &vehicle.serial, &own);
    }
    let like = like(pack);
    if fleet.vehicles.is_empty() {
        let count = device
            .vehicles
            .map_or(tck_simulate::USUAL_FLEET, |count| count as usize);
        fleet = Fleet::new(&like, "vda5050-tck", &[], count, pack);
    }
    Ok(ReferenceMasterControl::commanding(fleet, like.layout))
}
