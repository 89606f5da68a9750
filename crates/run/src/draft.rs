//! A commented profile from what was heard of a device: what is known is written down, and what is not is shown as a line to
//! be filled in. Motion stays off.

use std::fmt::Write as _;

use super::discover::Device;
use super::sheet::Sheet;
use tck_pack::{Hooks, Packs, Role};
use tck_profile::{HookExample, KEYS, SAMPLE_ACTIONS};

/// What the person who asks for the profile says beside it.
#[derive(Clone, Debug, Default)]
pub struct Wishes {
    /// The broker the device is connected to.
    pub broker: String,
    /// The user name there.
    pub username: Option<String>,
    /// Whose certificates are trusted there, as a PEM file.
    pub tls_ca: Option<String>,
    /// What is shown to a broker that asks for a certificate, as PEM files: the certificate and its key.
    pub identity: Option<(String, String)>,
    /// A LIF file of the floor.
    pub lif: Option<String>,
    /// The vehicle type in it.
    pub vehicle_type: Option<String>,
}

/// The text of `device.toml`.
#[must_use]
pub fn draft(device: &Device, wishes: &Wishes, packs: &Packs, known: &Hooks) -> String {
    let mut text = String::new();
    let name = format!("{} {}", device.manufacturer, device.serial_number);
    let _ = writeln!(
        text,
        "# Profile of {}, from what was heard on the broker.",
        one_line(&name)
    );
    text.push_str("# Lines that begin with `# ` are proposals: take away the `# ` and fill them in. Next:\n");
    text.push_str("#   vda5050-tck validate device.toml\n#   vda5050-tck run --profile device.toml --plan\n");
    identity(device, packs, &mut text);
    bench(wishes, &mut text);
    text.push_str(
        "\n[motion]\n# No test moves the vehicle unless this is true. Look at the floor first.\nallowed = false\n",
    );
    text.push_str("# max-speed = 0.5\n");
    layout(device, wishes, &mut text);
    certificate(&mut text);
    hooks(device.sheet(packs).as_ref(), known, &mut text);
    text
}

/// The text of `device.toml` for a master control: nobody hears of one on a broker what it can be asked for.
#[must_use]
pub fn draft_master_control(manufacturer: &str, serial_number: &str, wishes: &Wishes, known: &Hooks) -> String {
    let mut text = "# Profile of a master control. Lines that begin with `# ` are proposals: take away the `# ` and fill them in. Next:\n\
                    #   vda5050-tck validate device.toml\n#   vda5050-tck run --profile device.toml --plan\n"
        .to_owned();
    let _ = write!(
        text,
        "\n[device]\nrole = \"master-control\"\nmanufacturer = {}\nserial-number = {}\n",
        quoted(manufacturer),
        quoted(serial_number)
    );
    text.push_str("# Let the run start it; without this line it is waited for.\n");
    text.push_str("# command = [\"./master-control\", \"--broker\", \"mqtt://{broker-host}:{broker-port}\"]\n");
    text.push_str("\n[bench]\n# Where the master control connects. With a broker of the site: `broker`, and `tap = false` if it stays there.\n");
    text.push_str("listen = \"127.0.0.1:1883\"\n");
    let _ = writeln!(text, "# broker = {}\n# tap = false", quoted(&wishes.broker));
    text.push_str("\n[layout]\n# The floor it plans on, with ways that lead back.\n");
    match &wishes.lif {
        Some(lif) => {
            let _ = writeln!(text, "lif = {}", quoted(lif));
        }
        None => text.push_str("# lif = \"hall.lif.json\"\n"),
    }
    match (&wishes.lif, &wishes.vehicle_type) {
        (Some(_), Some(vehicle_type)) => {
            let _ = writeln!(text, "vehicle-type = {}", quoted(vehicle_type));
        }
        _ => text.push_str("# vehicle-type = \"…\"\n"),
    }
    text.push_str("\n[vehicles]\n# The vehicles it commands, which this tool plays.\n");
    text.push_str("# manufacturer = \"mocks\"\n# serial-numbers = [\"mock-1\", \"mock-2\"]\n# start-node = \"…\"\n");
    text.push_str("\n# What the master control is asked for. Exactly one of `run`, `http` and `prompt`. A parameter that a test does not\n# give is an empty text; an answer 409, 422 or 501 says that it does not do it.\n");
    for hook in known.of(Role::MasterControl) {
        let http = HookExample::of(hook).http;
        let _ = write!(text, "\n# {}\n# [hooks.{}]\n# {http}\n", one_line(&hook.doc), hook.name);
    }
    text
}

fn certificate(text: &mut String) {
    text.push_str("\n# [certificate]\n# For `certify`: who tests what for whom.\n");
    let keys = KEYS.iter().filter_map(|key| key.path.strip_prefix("certificate."));
    for key in keys {
        let _ = writeln!(text, "# {key} = \"…\"");
    }
}

fn identity(device: &Device, packs: &Packs, text: &mut String) {
    text.push_str("\n[device]\nrole = \"agv\"\n");
    let _ = writeln!(text, "manufacturer = {}", quoted(&device.manufacturer));
    let _ = writeln!(text, "serial-number = {}", quoted(&device.serial_number));
    match device.version.as_deref() {
        Some(version) if packs.get(version).is_some() => {
            let _ = writeln!(text, "protocol = {}", quoted(version));
        }
        Some(version) => {
            let _ = writeln!(
                text,
                "# It speaks version {}, which is not known here.",
                one_line(version)
            );
            let _ = writeln!(text, "# protocol = {}", quoted(&packs.latest().id));
        }
        None => {
            let _ = writeln!(text, "# protocol = {}", quoted(&packs.latest().id));
        }
    }
    if !device.prefix.is_empty() {
        let template = format!("{}/{{manufacturer}}/{{serialNumber}}", device.prefix);
        let _ = writeln!(text, "topic-template = {}", quoted(&template));
    }
    text.push_str("# Harmless actions that tests may use; without them the tests in question are inconclusive.\n");
    let sheet = device.sheet(packs);
    let own = sheet.as_ref().map_or_else(Vec::new, |sheet| own_actions(sheet, packs));
    if !own.is_empty() {
        let _ = writeln!(text, "# Of its own the factsheet has: {}", own.join(", "));
    }
    let proposed = own.first().cloned().unwrap_or_else(|| "…".to_owned());
    for sample in ["long-action", "brief-action"] {
        let _ = writeln!(text, "# {sample} = {{ type = {} }}", quoted(&proposed));
    }
    text.push_str("# What nobody else says: whether it can stop between two nodes, or on nodes only.\n");
    text.push_str("# stops-between-nodes = true\n# node-bound = true\n");
    match &sheet {
        Some(_) => text.push_str("# What its factsheet does not say, or says wrongly:\n# claims = []\n"),
        None => text.push_str(
            "# No factsheet was heard; what one would say, word by word (`run --plan` has a row for each):\n\
             # claims = [\"action stateRequest INSTANT\", \"no action pick\"]\n",
        ),
    }
    let has = |action: &&str| sheet.as_ref().is_some_and(|sheet| has_action(sheet, action));
    for sample in SAMPLE_ACTIONS
        .iter()
        .filter(|sample| !sample.name.starts_with("failing-"))
    {
        let Some(action) = predefined(sample.name).filter(has) else {
            continue;
        };
        let place = if sample.name.starts_with("edge-") {
            "edge"
        } else {
            "node"
        };
        let _ = writeln!(text, "# {}", sample.doc);
        let _ = writeln!(text, "# {} = {{ type = \"{action}\", {place} = \"…\" }}", sample.name);
    }
}

fn bench(wishes: &Wishes, text: &mut String) {
    text.push_str("\n[bench]\n# The device stays at its broker, so packets are not seen. To judge last will, keep-alive and retain as well:\n");
    text.push_str("# let it connect to `listen`, and take the line `tap = false` out.\ntap = false\n");
    let _ = writeln!(text, "broker = {}", quoted(&wishes.broker));
    text.push_str("# listen = \"0.0.0.0:1883\"\n");
    match &wishes.username {
        Some(username) => {
            let _ = writeln!(
                text,
                "username = {}\npassword-env = \"VDA5050_TCK_PASSWORD\"",
                quoted(username)
            );
        }
        None => text.push_str("# username = \"tck\"\n# password-env = \"VDA5050_TCK_PASSWORD\"\n"),
    }
    match &wishes.tls_ca {
        Some(file) => {
            let _ = writeln!(text, "tls-ca = {}", quoted(file));
        }
        None => text.push_str("# tls-ca = \"ca.crt\"\n"),
    }
    if let Some((certificate, key)) = &wishes.identity {
        let _ = writeln!(
            text,
            "client-cert = {}\nclient-key = {}",
            quoted(certificate),
            quoted(key)
        );
    }
}

fn layout(device: &Device, wishes: &Wishes, text: &mut String) {
    text.push_str("\n[layout]\n");
    if let Some(lif) = &wishes.lif {
        let _ = writeln!(text, "lif = {}", quoted(lif));
        match &wishes.vehicle_type {
            Some(vehicle_type) => {
                let _ = writeln!(text, "vehicle-type = {}", quoted(vehicle_type));
            }
            None => text.push_str("# vehicle-type = \"…\"\n"),
        }
        return;
    }
    text.push_str(
        "# Where the vehicle may drive: a LIF file, or a list of nodes and edges.\n# lif = \"hall.lif.json\"\n",
    );
    let Some(position) = &device.position else {
        text.push_str("# nodes = [{ id = \"n1\", x = 0.0, y = 0.0, map = \"…\" }]\n# edges = []\n");
        return;
    };
    let id = device.last_node.as_deref().unwrap_or("here");
    text.push_str("# It stands on the first node now. Add at least three more, and the edges between them.\n");
    let _ = writeln!(
        text,
        "nodes = [\n  {{ id = {}, x = {:?}, y = {:?}, map = {} }},\n]\nedges = [\n  # {{ id = \"e1\", from = {}, to = \"…\" }},\n]",
        quoted(id),
        position.x,
        position.y,
        quoted(&position.map_id),
        one_line(&quoted(id)),
    );
}

/// The hooks that make sense for what the device can do.
fn hooks(sheet: Option<&Sheet>, known: &Hooks, text: &mut String) {
    text.push_str("\n# What people or machines do to the device when a test asks for it. Exactly one of `run`, `http` and `prompt`.\n");
    for hook in known.of(Role::Agv) {
        let needs = hook.for_action.as_deref();
        if needs.is_some_and(|action| sheet.is_some_and(|sheet| !has_action(sheet, action))) {
            continue;
        }
        let _ = writeln!(text, "\n# {}", one_line(&hook.doc));
        let _ = writeln!(text, "# [hooks.{}]\n# prompt = \"…\"", hook.name);
    }
}

fn has_action(sheet: &Sheet, name: &str) -> bool {
    sheet.has_action(name, None) == Some(true)
}

/// The actions of its factsheet on nodes that the standard does not have.
fn own_actions(sheet: &Sheet, packs: &Packs) -> Vec<String> {
    let predefined = packs.latest().vocabulary().get("action");
    let is_predefined = |name: &str| predefined.is_some_and(|actions| actions.get(name).is_some());
    let names = sheet.node_actions().into_iter();
    names.filter(|name| !is_predefined(name)).map(one_line).collect()
}

/// The predefined action that a sample action is about.
fn predefined(sample: &str) -> Option<&'static str> {
    Some(match sample.strip_prefix("edge-").unwrap_or(sample) {
        "pick" => "pick",
        "drop" => "drop",
        "detect-object" => "detectObject",
        "fine-positioning" => "finePositioning",
        "start-charging" => "startCharging",
        _ => return None,
    })
}

/// A TOML text: what a device writes stays a text.
fn quoted(text: &str) -> String {
    toml::Value::String(one_line(text)).to_string()
}

fn one_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .take(500)
        .collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::discover::Position;
    use tck_base::diagnostic::Source;

    #[test]
    fn a_draft_is_a_valid_profile_whatever_the_device_is_called() {
        let library = tck_testing::library();
        let packs = &library.rules.packs;
        for serial in ["0001", "a\"b\\c", "x\ny = 1"] {
            let device = Device {
                manufacturer: "ACME".to_owned(),
                serial_number: serial.to_owned(),
                prefix: "uagv/v2".to_owned(),
                version: Some(packs.latest().version.to_string()),
                position: Some(Position {
                    x: 1.0,
                    y: 2.5,
                    map_id: "hall".to_owned(),
                }),
                factsheet: Some(json!({ "protocolFeatures": { "agvActions": [{ "actionType": "pick" }] } })),
                ..Device::default()
            };
            let wishes = Wishes {
                broker: "mqtt://127.0.0.1:1883".to_owned(),
                ..Wishes::default()
            };
            let text = draft(&device, &wishes, packs, &library.rules.hooks);
            let read = tck_profile::check(
                &Source::new("device.toml", text.clone()),
                std::path::Path::new(""),
                &library.rules.hooks,
            );
            let profile = read.unwrap_or_else(|wrong| panic!("{}\n{text}", wrong[0])).profile;
            assert!(!profile.motion.allowed);
            assert_eq!(profile.device.serial_number.as_deref(), Some(one_line(serial).as_str()));
            assert!(
                text.contains("# pick = ") && !text.contains("# start-charging = "),
                "{text}"
            );
            // A vehicle that cannot charge has no charger that could be locked.
            assert!(text.contains("[hooks.place-load]") && !text.contains("[hooks.lock-charger]"));
        }
    }

    #[test]
    fn what_the_factsheet_has_of_its_own_is_proposed() {
        let library = tck_testing::library();
        let action = |name: &str, scope: &str| json!({ "actionType": name, "actionScopes": [scope] });
        let actions = json!([
            action("pick", "NODE"),
            action("beep", "INSTANT"),
            action("lift", "NODE")
        ]);
        let device = Device {
            factsheet: Some(json!({ "protocolFeatures": { "agvActions": actions } })),
            ..Device::default()
        };
        let text = draft(&device, &Wishes::default(), &library.rules.packs, &library.rules.hooks);
        assert!(text.contains("# Of its own the factsheet has: lift\n"), "{text}");
        assert!(text.contains("# long-action = { type = \"lift\" }\n"), "{text}");
        assert!(
            text.contains("# [certificate]\n") && text.contains("# firmware-version = "),
            "{text}"
        );
    }

    #[test]
    fn the_skeleton_for_a_master_control_is_a_profile_and_so_is_what_it_proposes() {
        let wishes = Wishes {
            broker: "mqtt://site:1883".to_owned(),
            ..Wishes::default()
        };
        let text = draft_master_control("ACME", "fleet-1", &wishes, &tck_testing::library().rules.hooks);
        let uncommented: Vec<&str> = text
            .lines()
            .map(|line| match line.strip_prefix("# ") {
                Some(proposed) if proposed.starts_with("[hooks.") || proposed.starts_with("http = ") => proposed,
                _ => line,
            })
            .collect();
        for text in [text.clone(), uncommented.join("\n")] {
            let read = tck_profile::check(
                &Source::new("device.toml", text.clone()),
                std::path::Path::new(""),
                &tck_testing::library().rules.hooks,
            );
            let profile = read.unwrap_or_else(|wrong| panic!("{}\n{text}", wrong[0])).profile;
            assert_eq!(profile.device.role, Role::MasterControl);
        }
        assert!(text.contains("# [hooks.dispatch]"), "{text}");
    }
}
