//! A profile written down again from the settings of a run, without what may be secret.
//!
//! Each setting that somebody has made keeps how a profile writes it. [`profile`] puts those together; what cannot be
//! written, since it may hold a secret, is named in a comment instead.

use std::fmt::Write as _;
use std::time::Duration;

use toml_writer::ToTomlKey as _;

use super::hook_action::{Hook, HookAction, NATURAL_TRAFFIC, RESTART_DEVICE, START_DEVICE, STOP_DEVICE};
use super::value::Value;
use super::{LayoutList, SampleAction, Setting, VehicleGroup, time};
use tck_base::secrets::Secrets;

/// The sections with one value for each name, in the order of a profile.
const SECTIONS: [&str; 11] = [
    "device",
    "bench",
    "motion",
    "layout",
    "vehicles",
    "time",
    "maps",
    "certificate",
    "deviations",
    "known",
    "keys",
];
/// The section of what can be done to the device.
const HOOKS: &str = "hooks";

/// A text as TOML writes it.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A text that holds no secret, as TOML writes it.
fn plain(text: &str) -> Option<String> {
    (Secrets::default().out_of(text) == text).then(|| quoted(text))
}

fn list(items: impl Iterator<Item = Option<String>>) -> Option<String> {
    let items: Vec<String> = items.collect::<Option<_>>()?;
    Some(format!("[{}]", items.join(", ")))
}

/// A name as TOML writes it before `=` and in brackets.
fn key(name: &str) -> String {
    name.to_toml_key()
}

/// A line of a section; nothing where the value may hold a secret.
pub(super) fn line(name: &str, value: &Value) -> Option<String> {
    let written = match value {
        Value::Text(text) => plain(text)?,
        Value::Flag(flag) => flag.to_string(),
        Value::Duration(duration) => quoted(&time::show(*duration)),
        Value::Number(number) => toml::Value::Float(*number).to_string(),
        Value::Path(path) => plain(path.to_str()?)?,
        Value::Paths(paths) => list(paths.iter().map(|path| plain(path.to_str()?)))?,
        Value::Texts(texts) => list(texts.iter().map(|text| plain(text)))?,
        Value::Claims(claims) => list(claims.iter().map(|claim| plain(&claim.to_string())))?,
        Value::Action(action) => sample(action)?,
    };
    Some(format!("{} = {written}", key(name)))
}

fn sample(action: &SampleAction) -> Option<String> {
    let mut members = vec![format!("type = {}", plain(&action.action_type)?)];
    for (name, place) in [("node", &action.node), ("edge", &action.edge), ("shows", &action.shows)] {
        if let Some(place) = place {
            members.push(format!("{name} = {}", plain(place)?));
        }
    }
    if !action.parameters.is_empty() {
        let parameters = toml::Value::try_from(&action.parameters).ok()?.to_string();
        members.push(format!("parameters = {parameters}"));
    }
    Some(format!("{{ {} }}", members.join(", ")))
}

/// The nodes and edges of a short list.
pub(super) fn layout(layout: &LayoutList) -> String {
    let mut text = "nodes = [\n".to_owned();
    for node in &layout.nodes {
        let number = |name: &str, value: Option<f64>| {
            value.map_or_else(String::new, |value| format!(", {name} = {}", toml::Value::Float(value)))
        };
        let _ = writeln!(
            text,
            "    {{ id = {}, map = {}{}{}{}{}{} }},",
            quoted(&node.id),
            quoted(&node.map_id),
            number("x", Some(node.x)),
            number("y", Some(node.y)),
            number("theta", node.theta),
            number("deviation-xy", node.deviation_xy),
            number("deviation-theta", node.deviation_theta),
        );
    }
    text.push_str("]\nedges = [\n");
    for edge in &layout.edges {
        let direction = edge
            .direction
            .iter()
            .map(|told| format!(", direction = {}", quoted(told)));
        let _ = writeln!(
            text,
            "    {{ id = {}, from = {}, to = {}{} }},",
            quoted(&edge.id),
            quoted(&edge.start),
            quoted(&edge.end),
            direction.collect::<String>()
        );
    }
    text.push(']');
    text
}

/// The vehicles of other makers.
pub(super) fn others(groups: &[VehicleGroup]) -> String {
    let groups = groups.iter().map(|group| {
        let serials: Vec<String> = group.serial_numbers.iter().map(|serial| quoted(serial)).collect();
        let speaks = group
            .protocol
            .iter()
            .map(|version| format!("\nprotocol = {}", quoted(version)));
        format!(
            "[[vehicles.others]]\nmanufacturer = {}\nserial-numbers = [{}]{}",
            quoted(&group.manufacturer),
            serials.join(", "),
            speaks.collect::<String>()
        )
    });
    groups.collect::<Vec<_>>().join("\n")
}

/// A line of `[deviations]`.
pub(super) fn deviation(requirement: &str, reason: &str) -> String {
    format!("{} = {}", key(requirement), quoted(reason))
}

/// What test management calls a requirement, test or monitor.
pub(super) fn issue_key(id: &str, text: &str) -> String {
    format!("{} = {}", key(id), quoted(text))
}

/// A line of `[known]`.
pub(super) fn known(id: &str, reason: &str, until: &str) -> String {
    format!(
        "{} = {{ reason = {}, until = {} }}",
        key(id),
        quoted(reason),
        quoted(until)
    )
}

/// The table of a hook; nothing of a program or a request, which may hold a secret.
pub(super) fn hook(name: &str, hook: &Hook) -> Option<String> {
    let way = match &hook.action {
        HookAction::Run(_) | HookAction::Http { .. } => return None,
        HookAction::Prompt(text) => format!("prompt = {}", plain(text)?),
        HookAction::RestartDevice => format!("builtin = {}", quoted(RESTART_DEVICE)),
        HookAction::StopDevice => format!("builtin = {}", quoted(STOP_DEVICE)),
        HookAction::StartDevice => format!("builtin = {}", quoted(START_DEVICE)),
        HookAction::NaturalTraffic => format!("builtin = {}", quoted(NATURAL_TRAFFIC)),
    };
    let usual: Duration = hook.action.default_timeout();
    let timeout = (hook.timeout != usual).then(|| format!("\ntimeout = {}", quoted(&time::show(hook.timeout))));
    Some(format!("[hooks.{}]\n{way}{}", key(name), timeout.unwrap_or_default()))
}

/// The profile of a run, from its settings: every value that is no default. It is read again by `--profile`, from the folder in
/// which the run was started, since files are named from there. Nothing where no setting was made.
#[must_use]
pub fn profile(settings: &[Setting]) -> Option<String> {
    let is_made = |setting: &&Setting| section_of(setting).is_some() && !setting.is_default();
    let made: Vec<&Setting> = settings.iter().filter(is_made).collect();
    if !made.iter().any(|setting| setting.written.is_some()) {
        return None;
    }
    let mut text = "# The profile of a run: every setting that is no default, with where it came from.\n\
                    # Files are named from the folder in which the run was started.\n"
        .to_owned();
    let mut tables = String::new();
    for section in SECTIONS {
        let own = made.iter().filter(|setting| section_of(setting) == Some(section));
        let own: Vec<&&Setting> = own.collect();
        if !own.is_empty() {
            let _ = write!(text, "\n[{section}]\n");
        }
        for setting in own {
            match &setting.written {
                // Tables stand behind all that has no brackets.
                Some(written) if written.starts_with('[') => tables.push_str(&format!("\n{written}\n")),
                Some(written) => text.push_str(&format!("# {}\n{written}\n", one_line(&setting.origin))),
                None => text.push_str(&left_out(setting)),
            }
        }
    }
    text.push_str(&tables);
    for setting in made.iter().filter(|setting| section_of(setting) == Some(HOOKS)) {
        match &setting.written {
            Some(written) => text.push_str(&format!("\n{written}\n")),
            None => text.push_str(&format!("\n{}", left_out(setting))),
        }
    }
    Some(text)
}

fn left_out(setting: &Setting) -> String {
    format!(
        "# {} is not written here, since it may hold a secret: say it again.\n",
        one_line(&setting.name)
    )
}

/// The section of a profile that a setting belongs to.
fn section_of(setting: &Setting) -> Option<&'static str> {
    let (section, _) = setting.name.split_once('.')?;
    let mut all = SECTIONS.into_iter().chain([HOOKS]);
    all.find(|known| *known == section)
}

/// A text for a comment, which ends with its line.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whatever_a_name_holds_it_is_read_as_the_same_name() {
        for name in [
            "bare-name_1",
            "",
            "a b",
            "a.b",
            "a\nb",
            "a\r\nb",
            "\n",
            "tab\t",
            "bell\u{7}",
            "nul\0",
            "\u{7f}",
            "it's",
            "say \"it\"",
            "'\"\\",
            "\"\"\"",
            "ä",
            "]",
            "#",
            "=",
        ] {
            let of_line = format!("{} = 1", key(name));
            let of_table = format!("[hooks.{}]\nprompt = 1", key(name));
            let line: toml::Table = of_line.parse().expect(name);
            let table: toml::Table = of_table.parse().expect(name);
            assert_eq!(line.keys().collect::<Vec<_>>(), [name]);
            assert_eq!(
                table["hooks"].as_table().expect(name).keys().collect::<Vec<_>>(),
                [name]
            );
        }
    }
}
