//! `discover` and `init`: who speaks on a broker, and a profile from that. Nothing is published.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde_json::{Value, json};

use super::args::{AccessArgs, Discover, Format, Init, ListenArgs};
use super::exit::Exit;
use super::problem::Problem;
use crate::ui::escaped;
use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_net::bench::endpoint::{Access, Credentials, Endpoint};
use tck_net::bench::tls::TlsFiles;
use tck_pack::{Packs, Role};
use tck_profile as profile;
use tck_result::MessageCoverage;
use tck_run::{Device, Heard, Wishes, draft, draft_master_control, listen};

/// How many members that never came are named of a topic.
const NAMED: usize = 6;

/// `discover`.
pub fn discover(arguments: &Discover) -> Result<Exit, Problem> {
    let library = crate::assets::library(None)?;
    let heard = hear(&arguments.listen, &library)?;
    let devices = heard.devices();
    match arguments.format {
        Format::Json => {
            let devices = devices.iter().map(|device| {
                let mut described = json!(device);
                described["messageCoverage"] = json!(heard.coverage(device));
                described
            });
            let devices: Vec<Value> = devices.collect();
            super::print(&format!(
                "{:#}\n",
                json!({ "format": "vda5050-tck.discovery/1", "devices": devices, "otherMessages": heard.others })
            ))?
        }
        Format::Text => {
            let packs = &library.rules.packs;
            let described = devices.iter().map(|device| {
                let covered = heard.coverage(device).as_ref().map(covered).unwrap_or_default();
                format!("{}{covered}\n", describe(device, packs))
            });
            let mut text: String = described.collect();
            if heard.others > 0 {
                let _ = writeln!(
                    text,
                    "{} {} of no device {} heard as well",
                    heard.others,
                    if heard.others == 1 { "message" } else { "messages" },
                    if heard.others == 1 { "was" } else { "were" }
                );
            }
            super::print(&text)?
        }
    };
    if devices.is_empty() {
        return Err(nobody(&arguments.listen));
    }
    Ok(Exit::Conforms)
}

/// `init`.
pub fn init(arguments: &Init) -> Result<Exit, Problem> {
    if let Some(folder) = &arguments.suites {
        return export(folder, arguments.format);
    }
    if arguments.file.exists() && !arguments.force {
        let title = format!("{} is there already", arguments.file.display());
        return Err(Diagnostic::whole("exists", title)
            .hint("give another name with --file, or write over it with --force")
            .into());
    }
    let library = crate::assets::library(None)?;
    if arguments.role == Role::MasterControl {
        return skeleton(arguments, &library);
    }
    let heard = hear(&arguments.listen, &library)?;
    let is_meant = |device: &&Device| {
        let same = |wanted: &Option<String>, own: &str| wanted.as_deref().is_none_or(|wanted| wanted == own);
        same(&arguments.manufacturer, &device.manufacturer) && same(&arguments.serial, &device.serial_number)
    };
    let all = heard.devices();
    let meant: Vec<&Device> = all.iter().copied().filter(is_meant).collect();
    let device = match meant[..] {
        [device] => device,
        [] if all.is_empty() => return Err(nobody(&arguments.listen)),
        [] => return Err(choose("no device of that name was heard", &all)),
        _ => return Err(choose("several devices were heard", &meant)),
    };
    let wishes = wishes(arguments);
    let text = draft(device, &wishes, &library.rules.packs, &library.rules.hooks);
    let shown = arguments.file.display().to_string();
    std::fs::write(&arguments.file, text)
        .map_err(|error| Problem::Environment(format!("cannot write {shown}: {error}")))?;
    if arguments.format == Format::Json {
        return super::print(&format!(
            "{:#}\n",
            json!({ "format": "vda5050-tck.init/1", "file": shown, "device": device })
        ));
    }
    super::print(&format!(
        "{}\n{shown} is written; next: vda5050-tck run --profile {shown} --plan\n",
        describe(device, &library.rules.packs)
    ))
}

/// Writes what the program was built with, so that tests of one's own can begin with it.
fn export(folder: &Path, format: Format) -> Result<Exit, Problem> {
    if folder.exists() {
        let title = format!("{} is there already", folder.display());
        return Err(Diagnostic::whole("exists", title)
            .hint("give a folder that is not there yet")
            .into());
    }
    let assets = crate::assets::embedded();
    let files = assets.under("").map(|file| {
        let inside = file.path.strip_prefix("suites/").unwrap_or(&file.path);
        (inside.to_owned(), file.text.as_str())
    });
    let settings = ("default.toml".to_owned(), profile::DEFAULT_TOML);
    for (inside, text) in files.chain([settings]) {
        let path = folder.join(inside);
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        made.and_then(|()| std::fs::write(&path, text))
            .map_err(|error| Problem::Environment(format!("cannot write {}: {error}", path.display())))?;
    }
    let shown = folder.display();
    if format == Format::Json {
        let written = json!({ "format": "vda5050-tck.init/1", "folder": shown.to_string() });
        return super::print(&format!("{written:#}\n"));
    }
    super::print(&format!(
        "{shown}/agv and {shown}/master-control hold the tests, {shown}/monitors the monitors, {shown}/requirements the \
         catalogue, {shown}/schemas the schemas, {shown}/default.toml every setting with its default; \
         `--suites` takes a folder that is laid out like this, with only your own files in it\n"
    ))
}

/// What is said on the command line about a profile.
fn wishes(arguments: &Init) -> Wishes {
    let at = &arguments.listen.at.access;
    let file = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    Wishes {
        broker: arguments.listen.at.access.broker.clone(),
        username: arguments.listen.at.access.username.clone(),
        tls_ca: file(&at.tls_ca),
        identity: file(&at.client_cert).zip(file(&at.client_key)),
        lif: arguments.lif.clone(),
        vehicle_type: arguments.vehicle_type.clone(),
    }
}

/// Writes the skeleton of a profile of a master control.
fn skeleton(arguments: &Init, library: &Library) -> Result<Exit, Problem> {
    let named = |name: &Option<String>, made_up: &str| name.clone().unwrap_or_else(|| made_up.to_owned());
    let manufacturer = named(&arguments.manufacturer, "ACME");
    let serial = named(&arguments.serial, "fleet-manager");
    let text = draft_master_control(&manufacturer, &serial, &wishes(arguments), &library.rules.hooks);
    let shown = arguments.file.display().to_string();
    std::fs::write(&arguments.file, text)
        .map_err(|error| Problem::Environment(format!("cannot write {shown}: {error}")))?;
    if arguments.format == Format::Json {
        return super::print(&format!(
            "{:#}\n",
            json!({ "format": "vda5050-tck.init/1", "file": shown })
        ));
    }
    super::print(&format!(
        "{shown} is written; next: name its hooks there, and vda5050-tck run --profile {shown} --plan\n"
    ))
}

/// Where the broker is, and how it lets in.
pub(super) fn endpoint(arguments: &AccessArgs) -> Result<Endpoint, Problem> {
    let credentials = arguments.username.clone().map(|username| Credentials {
        username,
        password: std::env::var(tck_profile::PASSWORD_VARIABLE).unwrap_or_default(),
    });
    let identity = arguments.client_cert.clone().zip(arguments.client_key.clone());
    let access = Access {
        authority: arguments.tls_ca.clone(),
        identity: identity.map(|(certificate, key)| TlsFiles { certificate, key }),
        credentials,
        client_id: arguments.client_id.clone(),
    };
    Endpoint::parse(&arguments.broker, &access).map_err(|error| {
        Problem::from(Diagnostic::whole("broker", error.to_string()).hint("give it as mqtt://host:port"))
    })
}

fn hear(arguments: &ListenArgs, library: &Library) -> Result<Heard, Problem> {
    let endpoint = endpoint(&arguments.at.access)?;
    let filters = arguments.at.filters();
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    eprintln!(
        "listening on {} for {} s; Ctrl-C ends it earlier",
        arguments.at.access.broker, arguments.seconds
    );
    let heard = runtime.block_on(async {
        let interrupt = super::ending::interrupts()?;
        let time = Duration::from_secs(arguments.seconds);
        Ok::<_, Problem>(listen(endpoint, &filters, time, &library.rules.packs, interrupt).await)
    });
    runtime.shutdown_background();
    heard?.map_err(|why| {
        Problem::Environment(format!(
            "cannot listen on {} to {}: {why}",
            arguments.at.access.broker,
            filters.join(", ")
        ))
    })
}

fn nobody(arguments: &ListenArgs) -> Problem {
    Problem::NothingToDo(format!(
        "no device was heard on {} in {} s; a broker with access rules may need --username, or --topic with what is allowed",
        arguments.at.access.broker, arguments.seconds
    ))
}

fn choose(title: &str, devices: &[&Device]) -> Problem {
    let names = devices.iter().take(10);
    let names: Vec<String> = names
        .map(|device| {
            format!(
                "--manufacturer {} --serial {}",
                device.manufacturer, device.serial_number
            )
        })
        .collect();
    Diagnostic::whole("device", title)
        .hint(format!("choose one: {}", names.join("; ")))
        .into()
}

/// What was heard of a device, for people.
fn describe(device: &Device, packs: &Packs) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{} {}   VDA 5050 {}, topics {}/{}/{}/…",
        escaped(&device.manufacturer),
        escaped(&device.serial_number),
        escaped(device.version.as_deref().unwrap_or("?")),
        escaped(&device.prefix),
        escaped(&device.manufacturer),
        escaped(&device.serial_number)
    );
    let messages: Vec<String> = device
        .messages
        .iter()
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    let _ = writeln!(text, "  heard      {}", messages.join(", "));
    if device.connection.is_some() || device.mode.is_some() {
        let known = [device.connection.as_deref(), device.mode.as_deref()];
        let known: Vec<&str> = known.into_iter().flatten().collect();
        let _ = writeln!(text, "  state      {}", escaped(&known.join(", ")));
    }
    if let Some(position) = &device.position {
        let node = device
            .last_node
            .as_deref()
            .map_or(String::new(), |node| format!(", last node {node}"));
        let place = format!(
            "x = {}, y = {} on map {}{node}",
            position.x, position.y, position.map_id
        );
        let _ = writeln!(text, "  position   {}", escaped(&place));
    }
    let sheet = device.sheet(packs);
    let series = sheet
        .as_ref()
        .map(|sheet| sheet.series().unwrap_or("without a series name"));
    let _ = writeln!(text, "  factsheet  {}", escaped(series.unwrap_or("none was heard")));
    for remark in &device.remarks {
        let _ = writeln!(text, "  remark     {}", escaped(remark));
    }
    text
}

/// How much of the standard the messages of a device had, for people: of each topic that came, with the first members that did
/// not.
fn covered(coverage: &MessageCoverage) -> String {
    let mut text = String::new();
    for topic in coverage.topics.iter().filter(|topic| topic.messages > 0) {
        let _ = write!(text, "  members    {}: {} of {}", topic.topic, topic.shown, topic.of);
        let never = topic.never();
        let named: Vec<&str> = never.iter().take(NAMED).map(|one| one.member.as_str()).collect();
        if !named.is_empty() {
            let _ = write!(text, "; never {}", named.join(", "));
        }
        if never.len() > NAMED {
            let _ = write!(text, " and {} more", never.len() - NAMED);
        }
        text.push('\n');
    }
    text
}
