//! Parameters of actions that are sent: their form, their keys, and the ones that must not be missing.

use serde_json::Value;

use super::{Command, ELEMENTS, Found};
use crate::factsheet_actions::{How, look};
use crate::finding::{quote, show};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_view::{ActionView, Edge, Field, InstantActionsView, Json, Kind, Member, Node, OrderView, Parameter, Presence};
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
    needs: &[ActionView::action_parameters],
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
        let judged = form(command, record, &mut found);
        let sheets = context.world.factsheets().valid(record, context);
        if sheets.is_empty() {
            return judged;
        }
        for (_, action) in command.actions() {
            let kind = action.action_type.or_empty();
            for parameter in action.action_parameters.iter().take(ELEMENTS) {
                let key = parameter.key.or_empty();
                let Some(value) = parameter.value.there() else {
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
    needs: &[ActionView::action_parameters],
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
    needs: &[ActionView::action_parameters],
    start: |_| Box::new(Mandatory),
};

/// The actions of a message as they are written, in the order of [`Command::actions`].
fn written<'e>(command: Command<'_>, record: &Observation<'e>) -> Vec<&'e Value> {
    let (names, message) = (record.names(), record.json().unwrap_or(&Value::Null));
    let lists: &[(Field, Field)] = match command {
        Command::Order(_) => &[(OrderView::nodes, Node::actions), (OrderView::edges, Edge::actions)],
        Command::Instant(instant) => {
            let list = match instant.actions {
                Member::There(_) => InstantActionsView::actions,
                _ => InstantActionsView::misnamed_actions,
            };
            return names.raw_elements(message, list).iter().take(ELEMENTS).collect();
        }
    };
    let of = |(list, actions): &(Field, Field)| {
        let actions = *actions;
        let all = names.raw_elements(message, *list).iter().take(ELEMENTS);
        all.flat_map(move |element| names.raw_elements(element, actions))
    };
    lists.iter().flat_map(of).take(ELEMENTS).collect()
}

fn form(command: Command<'_>, record: &Observation<'_>, found: &mut Found<'_>) -> bool {
    let mut judged = false;
    for (at, (_, action)) in command.actions().into_iter().enumerate() {
        let kind = quote(action.action_type.or_empty());
        let list = match &action.action_parameters {
            Member::Absent => continue,
            Member::There(list) => list,
            Member::Null => {
                judged = true;
                found.broken("BP-04", format!("actionParameters of {kind} is no array: null"));
                continue;
            }
            Member::Other(other) => {
                judged = true;
                let text = format!("actionParameters of {kind} is no array: {}", show(other));
                found.broken("BP-04", text);
                continue;
            }
        };
        for (place, parameter) in list.iter().take(ELEMENTS).enumerate() {
            judged = true;
            let shown = || {
                let actions = written(command, record);
                let list = actions.get(at).map(|action| {
                    let all = record.names().raw_elements(action, ActionView::action_parameters);
                    all.get(place).map(show).unwrap_or_default()
                });
                list.unwrap_or_default()
            };
            if let Some(odd) = parameter.odd() {
                let text = format!("a parameter of {kind} is no object: {}", show(odd));
                found.broken("BP-04", text);
                continue;
            }
            let members = [
                (Parameter::key, parameter.key.presence()),
                (Parameter::value, parameter.value.presence()),
            ];
            let lacks = members.iter().find(|(_, presence)| *presence == Presence::Absent);
            if let Some((field, _)) = lacks {
                let text = format!("a parameter of {kind} has no {}: {}", field.usual_name(), shown());
                found.broken("BP-04", text.clone());
                found.broken("BP-05", text);
                continue;
            }
            match parameter.key.text() {
                None => {
                    let text = format!("the key of a parameter of {kind} is no text: {}", shown());
                    found.broken("BP-05", text);
                }
                Some(key) if parameter.value.is_null() => {
                    found.broken("BP-05", format!("parameter {} of {kind} is null", quote(key)));
                }
                Some(_) => {}
            }
        }
    }
    judged
}

/// The parameters of a predefined action.
fn predefined<'c>(action: &ActionView, context: &'c CheckContext<'_>) -> Option<&'c serde_json::Map<String, Value>> {
    let known = context
        .pack
        .vocabulary()
        .get("action")?
        .get(action.action_type.or_empty())?;
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
            let kind = action.action_type.or_empty();
            let keys: Vec<&str> = action
                .action_parameters
                .iter()
                .take(ELEMENTS)
                .map(|parameter| parameter.key.or_empty())
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
            for parameter in action.action_parameters.iter().take(ELEMENTS) {
                let key = parameter.key.or_empty();
                let inside = parameter.value.there().and_then(Json::members);
                let names = inside.into_iter().flatten().map(|(name, _)| name.as_str());
                let mut hidden = names.filter(|name| predefined.contains_key(*name));
                let hidden = hidden.next().filter(|_| further.contains(&key));
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
            let kind = action.action_type.or_empty();
            let mandatory = predefined(action, context).into_iter().flatten();
            for (key, _) in mandatory.filter(|(_, rule)| rule.get("optional") == Some(&Value::Bool(false))) {
                judged = true;
                let value = action.argument(key);
                if value.is_absent() {
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
                }
                let wanted = context.pack.word(&format!("action.{kind}.parameters.{key}.type"));
                let wanted = wanted.unwrap_or_default();
                if !is_of_type(value.there().unwrap_or(&Json::Null), wanted) {
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

fn is_of_type(value: &Json, wanted: &str) -> bool {
    let kind = value.kind();
    match wanted {
        "FLOAT" | "NUMBER" => kind == Kind::Number,
        "INTEGER" => value.number().is_some_and(|number| number.float().fract() == 0.0),
        "STRING" => kind == Kind::Text,
        "BOOL" => kind == Kind::Flag,
        "OBJECT" => kind == Kind::Object,
        "ARRAY" => kind == Kind::List,
        _ => true,
    }
}
