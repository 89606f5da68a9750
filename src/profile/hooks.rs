//! Hooks: what a person or a machine does to the device when a test asks for it.
//!
//! [`HOOKS`] is the one set of names; a [`Hook`] is what a profile says about one of them. Running it is
//! left to the engine. Values put into a hook may come from the device, so nothing here goes through a shell.

use std::collections::BTreeMap;
use std::time::Duration;

use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::Value;

use super::secret::{Password, PasswordError, SecretText};
use super::surroundings::Surroundings;
use crate::diagnostic::Span;
use crate::pack::Role;

/// A hook a test may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HookInfo {
    /// Name, as in `[hooks.NAME]` and `operator: NAME`.
    pub name: &'static str,
    /// Which side it is for.
    pub role: Role,
    /// Names of the parameters a test hands over.
    pub parameters: &'static [&'static str],
    /// What to do, as an order to a person.
    pub doc: &'static str,
}

const fn agv(name: &'static str, parameters: &'static [&'static str], doc: &'static str) -> HookInfo {
    HookInfo {
        name,
        role: Role::Agv,
        parameters,
        doc,
    }
}

const fn master_control(name: &'static str, parameters: &'static [&'static str], doc: &'static str) -> HookInfo {
    HookInfo {
        name,
        role: Role::MasterControl,
        parameters,
        doc,
    }
}

/// Every hook there is, by role.
pub const HOOKS: &[HookInfo] = &[
    agv(
        "after-start",
        &[],
        "Give the vehicle what it needs after every start, before anything else: a position, a login.",
    ),
    agv("power-cycle", &[], "Switch the vehicle off hard and on again."),
    agv(
        "shutdown",
        &[],
        "Shut the vehicle down, or end its communication, in good order.",
    ),
    agv("start", &[], "Start the vehicle after a shutdown."),
    agv(
        "set-mode",
        &["mode"],
        "Switch the operating mode at the vehicle; in SEMIAUTOMATIC set its speed there, too.",
    ),
    agv("drive-manually", &[], "Drive the vehicle by hand for a short way."),
    agv(
        "move-to",
        &["nodeId"],
        "Bring the vehicle to a node, and let it know where it is.",
    ),
    agv("push-out", &[], "Move the vehicle off the way it was given."),
    agv(
        "shift-position",
        &[],
        "Shift the position that the vehicle believes in aside by more than half a metre, such as with its service tool.",
    ),
    agv("emergency-stop", &[], "Press an emergency stop."),
    agv(
        "release-emergency-stop",
        &[],
        "Release the emergency stop, and acknowledge it.",
    ),
    agv(
        "enter-field",
        &[],
        "Enter the protective field, or put something into it.",
    ),
    agv("leave-field", &[], "Leave the protective field."),
    agv("place-obstacle", &["edgeId"], "Put an obstacle on an edge."),
    agv("remove-obstacle", &["edgeId"], "Take the obstacle away."),
    agv("trigger", &["actionId"], "Give the trigger that the vehicle waits for."),
    agv(
        "place-load",
        &["loadType"],
        "Put a load on the vehicle, or where it picks next.",
    ),
    agv(
        "remove-load",
        &["loadType"],
        "Take the load off the vehicle, or away from where it picks next.",
    ),
    agv("press-pause", &[], "Press the pause button at the vehicle."),
    agv("release-pause", &[], "End the pause at the vehicle."),
    agv(
        "block-pause",
        &[],
        "Make startPause and stopPause fail, e.g. by a switch.",
    ),
    agv("unblock-pause", &[], "Let startPause and stopPause succeed again."),
    agv(
        "lock-charger",
        &[],
        "Make stopCharging fail, e.g. by a mechanical latch.",
    ),
    agv("unlock-charger", &[], "Let stopCharging succeed again."),
    agv(
        "use-lift",
        &["mapId"],
        "Bring the lift with the vehicle in it to the floor of a map.",
    ),
    agv(
        "enable-map",
        &["mapId", "mapVersion"],
        "Enable a map version at the vehicle.",
    ),
    agv(
        "provoke-error",
        &["errorLevel"],
        "Bring about a real fault of the vehicle.",
    ),
    agv("clear-error", &[], "Clear the fault."),
    agv("confirm", &["question"], "Look, and answer the question with yes."),
    master_control(
        "after-start",
        &[],
        "Give the master control what it needs before anything else, such as a login.",
    ),
    master_control(
        "dispatch",
        &["vehicle", "from", "to", "loadType", "action", "parameters"],
        "Order a transport.",
    ),
    master_control(
        "reroute",
        &["vehicle", "to"],
        "Give the running transport another destination.",
    ),
    master_control("cancel", &["vehicle"], "Call off the running transport."),
    master_control("pause", &["vehicle"], "Tell the vehicle to pause."),
    master_control("resume", &["vehicle"], "Tell the vehicle to go on."),
    master_control(
        "instant-action",
        &["vehicle", "action"],
        "Send an instant action to the vehicle.",
    ),
    master_control(
        "request-factsheet",
        &["vehicle"],
        "Ask for the factsheet of the vehicle.",
    ),
    master_control("request-state", &["vehicle"], "Ask for the state of the vehicle."),
    master_control(
        "init-position",
        &["vehicle", "nodeId", "x", "y", "theta", "mapId"],
        "Tell the vehicle where it stands.",
    ),
    master_control(
        "download-map",
        &["vehicle", "mapId", "mapVersion", "mapDownloadLink"],
        "Begin the roll-out of a map version to the vehicle.",
    ),
    master_control(
        "enable-map",
        &["vehicle", "mapId", "mapVersion"],
        "Enable a map version on the vehicle.",
    ),
    master_control(
        "delete-map",
        &["vehicle", "mapId", "mapVersion"],
        "Delete a map version from the vehicle.",
    ),
    master_control(
        "block-edge",
        &["vehicle", "from", "to"],
        "Close a way for the vehicle in the layout.",
    ),
    master_control("unblock-edge", &["vehicle", "from", "to"], "Open the way again."),
    master_control(
        "configure",
        &["vehicle", "what"],
        "Set the master control up for what comes next.",
    ),
    master_control("start", &["vehicle"], "Start the master control."),
    master_control("shutdown", &["vehicle"], "Shut the master control down."),
    master_control(
        "confirm",
        &["vehicle", "question"],
        "Look, and answer the question with yes.",
    ),
];

/// The hook of that name for that side.
#[must_use]
pub fn find(name: &str, role: Role) -> Option<&'static HookInfo> {
    HOOKS.iter().find(|hook| hook.name == name && hook.role == role)
}

/// What a profile does when a test asks for a hook.
#[derive(Clone, Debug)]
pub struct Hook {
    /// Its name.
    pub name: String,
    /// How it is done.
    pub action: HookAction,
    /// How long it may take.
    pub timeout: Duration,
    /// Where it is written.
    pub span: Span,
}

/// How a hook is done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HookAction {
    /// A program and its arguments; no shell.
    Run(Vec<String>),
    /// An HTTP request; any 2xx answer is success.
    Http {
        /// Method in capitals.
        method: String,
        /// Address.
        url: String,
        /// Body, if there is one.
        body: Option<String>,
        /// Headers beside the usual ones.
        headers: Vec<(String, SecretText)>,
    },
    /// A text for a person.
    Prompt(String),
    /// The harness ends and starts again the device it has started itself (`device.command`).
    RestartDevice,
    /// The harness asks the device that it has started itself to end in good order.
    StopDevice,
    /// The harness starts it again.
    StartDevice,
    /// Nothing is done: the harness waits for the next order or instant action to come by itself.
    NaturalTraffic,
}

/// `builtin`: the harness ends and starts again the device it has started itself.
pub const RESTART_DEVICE: &str = "restart-command";

/// `builtin`: the harness asks the device it has started itself to end in good order, with SIGTERM.
pub const STOP_DEVICE: &str = "stop-command";

/// `builtin`: the harness starts that device again.
pub const START_DEVICE: &str = "start-command";

/// `builtin`: the harness waits for the next order or instant action to come by itself.
pub const NATURAL_TRAFFIC: &str = "natural-traffic";

impl HookAction {
    /// A program or request that needs nobody.
    #[must_use]
    pub fn is_unattended(&self) -> bool {
        !matches!(self, Self::Prompt(_))
    }

    /// How long it may take unless said.
    #[must_use]
    pub fn default_timeout(&self) -> Duration {
        let patient = !self.is_unattended() || *self == Self::NaturalTraffic;
        Duration::from_secs(if patient { 600 } else { 60 })
    }

    /// The action with values for its placeholders. A value stays one argument, one part of an address, one
    /// part of a JSON text, whatever stands in it.
    #[must_use]
    pub fn filled(&self, values: &BTreeMap<String, String>) -> Self {
        let verbatim = |value: &str| value.to_owned();
        match self {
            Self::Run(arguments) => Self::Run(arguments.iter().map(|text| fill(text, values, verbatim)).collect()),
            Self::Prompt(text) => Self::Prompt(fill(text, values, verbatim)),
            Self::RestartDevice | Self::StopDevice | Self::StartDevice | Self::NaturalTraffic => self.clone(),
            Self::Http {
                method,
                url,
                body,
                headers,
            } => Self::Http {
                method: method.clone(),
                headers: headers
                    .iter()
                    .map(|(name, value)| {
                        // A value of the device must not begin a header of its own.
                        let visible = |value: &str| value.replace(|c: char| c.is_control(), " ");
                        (name.clone(), value.with_texts(|text| fill(text, values, visible)))
                    })
                    .collect(),
                url: fill(url, values, |value| {
                    utf8_percent_encode(value, NON_ALPHANUMERIC).to_string()
                }),
                body: body.as_ref().map(|body| {
                    let json = body.trim_start().starts_with(['{', '[']);
                    fill(body, values, if json { inside_json } else { verbatim })
                }),
            },
        }
    }

    /// The action with the secrets of its headers.
    ///
    /// # Errors
    /// When one is not where it is said to be.
    pub fn resolved(&self, surroundings: &Surroundings) -> Result<Self, PasswordError> {
        let mut action = self.clone();
        if let Self::Http { headers, .. } = &mut action {
            for (_, value) in headers {
                *value = value.resolved(surroundings)?;
            }
        }
        Ok(action)
    }

    /// The secrets in it, once resolved.
    pub fn secrets(&self) -> Vec<Password> {
        match self {
            Self::Http { headers, .. } => headers.iter().flat_map(|(_, value)| value.secrets()).collect(),
            _ => Vec::new(),
        }
    }

    /// Every text that may hold placeholders.
    #[must_use]
    pub fn texts(&self) -> Vec<&str> {
        match self {
            Self::Run(arguments) => arguments.iter().map(String::as_str).collect(),
            Self::Prompt(text) => vec![text],
            Self::RestartDevice | Self::StopDevice | Self::StartDevice | Self::NaturalTraffic => Vec::new(),
            Self::Http { url, body, headers, .. } => {
                let texts = [Some(url), body.as_ref()].into_iter().flatten().map(String::as_str);
                let headers = headers.iter().flat_map(|(_, value)| value.texts());
                texts.chain(headers).collect()
            }
        }
    }
}

fn inside_json(value: &str) -> String {
    let quoted = Value::from(value).to_string();
    quoted.get(1..quoted.len() - 1).unwrap_or_default().to_owned()
}

/// The placeholders of a text with their byte ranges: `{name}`, but not `${name}`.
#[must_use]
pub fn placeholders(text: &str) -> Vec<(std::ops::Range<usize>, &str)> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(open) = text[at..].find('{').map(|offset| at + offset) {
        at = open + 1;
        let name_length = text[at..]
            .find(|c: char| !c.is_ascii_alphanumeric() && c != '-')
            .unwrap_or(text.len() - at);
        let close = at + name_length;
        if name_length > 0 && text[close..].starts_with('}') && !text[..open].ends_with('$') {
            found.push((open..close + 1, &text[at..close]));
            at = close + 1;
        }
    }
    found
}

/// Fills placeholders. One without a value becomes nothing: the test did not hand that parameter over, and
/// that the name exists was checked when the profile was read.
pub fn fill(text: &str, values: &BTreeMap<String, String>, write: impl Fn(&str) -> String) -> String {
    let mut filled = String::with_capacity(text.len());
    let mut done = 0;
    for (range, name) in placeholders(text) {
        filled.push_str(&text[done..range.start]);
        filled.push_str(&values.get(name).map(|value| write(value)).unwrap_or_default());
        done = range.end;
    }
    filled.push_str(&text[done..]);
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
        pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
    }

    #[test]
    fn names_are_unique_for_a_role_and_documented() {
        for (at, hook) in HOOKS.iter().enumerate() {
            assert!(
                HOOKS[at + 1..]
                    .iter()
                    .all(|other| (other.name, other.role) != (hook.name, hook.role))
            );
            assert!(hook.doc.ends_with('.'), "{}", hook.name);
        }
    }

    #[test]
    fn a_value_of_the_device_stays_one_argument() {
        let hook = HookAction::Run(vec!["./power".into(), "--serial={serial-number}".into()]);
        let filled = hook.filled(&values(&[("serial-number", "x; rm -rf $HOME {mode}")]));
        assert_eq!(
            filled,
            HookAction::Run(vec!["./power".into(), "--serial=x; rm -rf $HOME {mode}".into()])
        );
    }

    #[test]
    fn a_value_cannot_leave_its_place_in_an_address_or_in_json() {
        let hook = HookAction::Http {
            method: "POST".into(),
            url: "http://bench/mode/{mode}".into(),
            body: Some(r#"{"mode": "{mode}", "by": "${mode}"}"#.into()),
            headers: Vec::new(),
        };
        let HookAction::Http { url, body, .. } = hook.filled(&values(&[("mode", "a\"/?b")])) else {
            panic!("still a request");
        };
        assert_eq!(url, "http://bench/mode/a%22%2F%3Fb");
        assert_eq!(body.as_deref(), Some(r#"{"mode": "a\"/?b", "by": "${mode}"}"#));
    }

    #[test]
    fn braces_of_json_and_shell_are_no_placeholders() {
        let names: Vec<_> = placeholders(r#"{"a": {}} ${HOME} {x} {y z} {"#)
            .into_iter()
            .map(|(_, name)| name)
            .collect();
        assert_eq!(names, ["x"]);
    }
}
