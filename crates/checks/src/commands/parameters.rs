//! Parameters of actions that are sent: their form, their keys, and the ones that must not be missing.

use serde_json::Value;

use super::{Command, ELEMENTS, Found, parameter};
use crate::factsheet_actions::{How, look};
use crate::finding::{quote, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_world::members::{elements, text};
use tck_world::{Fact, Factsheet, Listen, Observation, Topic};

/// `commands/parameter-form`.
pub(crate) const VALUES: Check = Check {
    name: "commands/parameter-form",
    decides: &["BP-04", "BP-05"],
    doc: "Parameters of actions are an array of objects, each with a text as key and a value that is not null, and of the \
          valueDataType that the factsheet of the vehicle names. Another word in the place of key or value breaks both \
          rules.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Values),
};

struct Values;

impl Running for Values {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let mut found = Found::new(record, findings);
        let judged = form(command, &mut found);
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() {
            return judged;
        }
        for (_, action) in command.actions() {
            let kind = text(action, "actionType");
            for parameter in elements(action, "actionParameters").take(ELEMENTS) {
                let key = text(parameter, "key");
                let Some(value) = parameter.get("value").filter(|value| !value.is_null()) else {
                    continue;
                };
                // Wrong is what no factsheet that counts allows.
                let wanted = |sheet: &Factsheet| {
                    let offered = sheet.actions.as_ref()?.get(kind)?;
                    let wanted = offered.types.get(key)?;
                    (!is_of_type(value, wanted)).then(|| wanted.clone())
                };
                let all: Option<Vec<String>> = sheets.iter().map(|sheet| wanted(sheet)).collect();
                if let Some(wanted) = all.and_then(|all| all.into_iter().next()) {
                    let shown = show(value);
                    let text = format!(
                        "parameter {} of {} is {shown}, not of type {wanted}",
                        quote(key),
                        quote(kind)
                    );
                    found.broken("BP-05", text);
                }
            }
        }
        judged
    }
}

/// `commands/parameter-keys`.
pub(crate) const KEYS: Check = Check {
    name: "commands/parameter-keys",
    decides: &["ACT-06"],
    doc: "No parameter of a predefined action is a predefined one in another spelling, or hides one in an object of \
          its own. One that only has all its words, \
          and is not listed in the factsheet of the vehicle, is a warning.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Keys),
};

/// `commands/mandatory-parameters`.
pub(crate) const MANDATORY: Check = Check {
    name: "commands/mandatory-parameters",
    decides: &["ACT-31"],
    doc: "Predefined actions come with all their mandatory parameters, of the right types. One that the factsheet of \
          the vehicle lists as optional is a warning when it is missing.",
    arguments: &[],
    listens: &[
        Listen::Delivered(Topic::Order),
        Listen::Delivered(Topic::InstantActions),
    ],
    reads: &[Fact::Factsheets],
    start: |_| Box::new(Mandatory),
};

fn form(command: Command<'_>, found: &mut Found<'_>) -> bool {
    let mut judged = false;
    for (_, action) in command.actions() {
        let Some(parameters) = action.get("actionParameters") else {
            continue;
        };
        let kind = quote(text(action, "actionType"));
        let Some(list) = parameters.as_array() else {
            judged = true;
            found.broken(
                "BP-04",
                format!("actionParameters of {kind} is no array: {}", show(parameters)),
            );
            continue;
        };
        for parameter in list.iter().take(ELEMENTS) {
            judged = true;
            let Some(members) = parameter.as_object() else {
                found.broken(
                    "BP-04",
                    format!("a parameter of {kind} is no object: {}", show(parameter)),
                );
                continue;
            };
            let lacks = ["key", "value"].into_iter().find(|name| !members.contains_key(*name));
            if let Some(name) = lacks {
                let text = format!("a parameter of {kind} has no {name}: {}", show(parameter));
                found.broken("BP-04", text.clone());
                found.broken("BP-05", text);
            } else if !parameter.get("key").is_some_and(Value::is_string) {
                found.broken(
                    "BP-05",
                    format!("the key of a parameter of {kind} is no text: {}", show(parameter)),
                );
            } else if parameter.get("value").is_some_and(Value::is_null) {
                found.broken(
                    "BP-05",
                    format!("parameter {} of {kind} is null", quote(text(parameter, "key"))),
                );
            }
        }
    }
    judged
}

/// The parameters of a predefined action.
fn predefined<'c>(action: &Value, context: &'c CheckContext<'_>) -> Option<&'c serde_json::Map<String, Value>> {
    let known = context
        .pack
        .vocabulary()
        .get("action")?
        .get(text(action, "actionType"))?;
    known.get("parameters")?.as_object()
}

struct Keys;

impl Running for Keys {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (_, action) in command.actions() {
            let Some(predefined) = predefined(action, context).filter(|known| !known.is_empty()) else {
                continue;
            };
            let kind = text(action, "actionType");
            let keys: Vec<&str> = elements(action, "actionParameters")
                .take(ELEMENTS)
                .map(|parameter| text(parameter, "key"))
                .collect();
            judged |= !keys.is_empty();
            let lists = |sheet: &Factsheet, key: &str| {
                let offered = sheet.actions.as_ref().and_then(|actions| actions.get(kind));
                offered
                    .and_then(|offered| offered.parameters.as_ref())
                    .is_some_and(|listed| listed.contains_key(key))
            };
            let further: Vec<&str> = keys
                .iter()
                .copied()
                .filter(|key| !predefined.contains_key(*key))
                .filter(|key| !sheets.iter().any(|sheet| lists(sheet, key)))
                .collect();
            for parameter in elements(action, "actionParameters").take(ELEMENTS) {
                let (key, inside) = (
                    text(parameter, "key"),
                    parameter.get("value").and_then(Value::as_object),
                );
                let inside = inside.filter(|_| further.contains(&key));
                let hidden = inside.and_then(|inside| inside.keys().find(|name| predefined.contains_key(*name)));
                if let Some(hidden) = hidden {
                    let name = quote(key);
                    found.broken("ACT-06", format!("{hidden} of {kind} is hidden in a parameter {name}"));
                }
            }
            let open: Vec<&str> = predefined
                .keys()
                .map(String::as_str)
                .filter(|known| !keys.contains(known))
                .collect();
            for odd in look(&further, &open) {
                let name = quote(odd.name);
                match odd.how {
                    How::Respelled => {
                        let text = format!("parameter {name} of {kind} is {} in another spelling", odd.like);
                        found.broken("ACT-06", text);
                    }
                    How::Alike => {
                        found.remark("ACT-06", format!("parameter {name} of {kind} looks like {}", odd.like));
                    }
                }
            }
        }
        judged
    }
}

struct Mandatory;

impl Running for Mandatory {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(command) = Command::read(record) else {
            return false;
        };
        let sheets = context.world.factsheets().valid(record, context);
        let mut found = Found::new(record, findings);
        let mut judged = false;
        for (_, action) in command.actions() {
            let kind = text(action, "actionType");
            let mandatory = predefined(action, context).into_iter().flatten();
            for (key, rule) in mandatory.filter(|(_, rule)| rule.get("optional") == Some(&Value::Bool(false))) {
                judged = true;
                let Some(value) = parameter(action, key) else {
                    let message = format!("{kind} has no parameter {key}");
                    // The table and the prose disagree about it; the ruling of MAP-16 is a warning.
                    let disputed = kind == "downloadMap" && key == "mapVersion";
                    // Nobody knows what a vehicle wants that has not been described yet.
                    if disputed || sheets.is_empty() || sheets.iter().any(|sheet| is_optional(sheet, kind, key)) {
                        found.remark("ACT-31", message);
                    } else {
                        found.broken("ACT-31", message);
                    }
                    continue;
                };
                if !is_of_type(value, text(rule, "type")) {
                    found.broken("ACT-31", format!("parameter {key} of {kind} is {}", show(value)));
                }
            }
        }
        judged
    }
}

fn is_optional(sheet: &Factsheet, kind: &str, key: &str) -> bool {
    let offered = sheet.actions.as_ref().and_then(|actions| actions.get(kind));
    let listed = offered.and_then(|offered| offered.parameters.as_ref());
    listed.is_some_and(|listed| listed.get(key) == Some(&true))
}

fn is_of_type(value: &Value, wanted: &str) -> bool {
    match wanted {
        "FLOAT" | "NUMBER" => value.is_number(),
        "INTEGER" => value.is_i64() || value.is_u64() || value.as_f64().is_some_and(|value| value.fract() == 0.0),
        "STRING" => value.is_string(),
        "BOOL" => value.is_boolean(),
        "OBJECT" => value.is_object(),
        "ARRAY" => value.is_array(),
        _ => true,
    }
}
