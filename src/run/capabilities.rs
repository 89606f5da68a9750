//! What the device can do, and who says so.
//!
//! Applicability comes from the device's own factsheet, completed or contradicted by the profile. Declared
//! absent is not applicable; left open is not.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::journal::event::{Capability, Gate};
use crate::link::Vantage;
use crate::profile::{SAMPLE_ACTIONS, SampleKind};
use crate::suite::model::{Need, Test, Verb};

/// What is known about device, bench and profile.
#[derive(Clone, Debug)]
pub struct Capabilities {
    /// The factsheet, once it was received.
    pub factsheet: Option<Value>,
    /// What the profile states: `stops-between-nodes` and so on.
    pub statements: BTreeMap<String, bool>,
    /// Capabilities the profile claims beside the factsheet, by their names.
    pub claims: BTreeMap<String, bool>,
    /// From where the harness can see.
    pub vantage: Vantage,
    /// Names of the hooks that can be run.
    pub hooks: Vec<String>,
    /// Whether the device can reach the map server.
    pub maps: bool,
    /// Whether the vehicle may drive; `Err` says why not.
    pub motion: Result<(), String>,
}

impl Capabilities {
    /// Whether a test runs, and if not, why.
    #[must_use]
    pub fn gate(&self, test: &Test) -> Gate {
        let mut open = None;
        let hooks = test
            .sections()
            .into_iter()
            .flat_map(|(_, steps)| steps)
            .filter_map(|step| match &step.verb {
                Verb::Operator(operator) => Some(Need::Hook(operator.hook.clone())),
                _ => None,
            });
        let stations = test
            .course
            .stations()
            .filter_map(SampleKind::of_variable)
            .map(|sample| Need::Profile(sample.name.to_owned()));
        for need in test.needs.iter().cloned().chain(stations).chain(hooks) {
            match self.has(&need) {
                Gate::Runs => {}
                Gate::NotApplicable(why) => return Gate::NotApplicable(why),
                Gate::Unobservable(why) => {
                    open.get_or_insert(why);
                }
            }
        }
        if test.moves
            && let Err(why) = &self.motion
        {
            return Gate::NotApplicable(why.clone());
        }
        open.map_or(Gate::Runs, Gate::Unobservable)
    }

    fn has(&self, need: &Need) -> Gate {
        match need {
            Need::Tap if self.vantage == Vantage::Tap => Gate::Runs,
            Need::Tap => Gate::Unobservable("it needs the device to connect through the tap".to_owned()),
            Need::MapServer if self.maps => Gate::Runs,
            Need::MapServer => Gate::Unobservable("the device cannot reach the map server".to_owned()),
            Need::Hook(name) if self.hooks.iter().any(|hook| hook == name) => Gate::Runs,
            Need::Hook(name) => Gate::Unobservable(format!("the profile has no hook `{name}` ([hooks.{name}])")),
            Need::Profile(name) => match self.statements.get(name) {
                Some(true) => Gate::Runs,
                Some(false) => Gate::NotApplicable(format!("the profile says that the device is not `{name}`")),
                None => Gate::Unobservable(match SAMPLE_ACTIONS.iter().find(|sample| sample.name == name) {
                    Some(sample) => format!("the profile does not name `device.{name}`: {}", sample.doc),
                    None => format!("the profile does not say whether the device is `{name}`"),
                }),
            },
            Need::Action { name, scope } => self.declared(&action_name(name, scope.as_deref()), |sheet| {
                has_action(sheet, name, scope.as_deref())
            }),
            Need::NoAction(name) => reverse(
                self.declared(&action_name(name, None), |sheet| has_action(sheet, name, None)),
                name,
            ),
            Need::Optional(path) => self.declared(&format!("optional {path}"), |sheet| has_optional(sheet, path)),
            Need::NoOptional(path) => reverse(
                self.declared(&format!("optional {path}"), |sheet| has_optional(sheet, path)),
                path,
            ),
            Need::Limit(path) => self.declared(&format!("limit {path}"), |sheet| has_limit(sheet, path)),
        }
    }

    fn declared(&self, name: &str, says: impl Fn(&Value) -> bool) -> Gate {
        if let Some(claimed) = self.claims.get(name) {
            return if *claimed {
                Gate::Runs
            } else {
                Gate::NotApplicable(format!("the profile says that the device does not have: {name}"))
            };
        }
        match &self.factsheet {
            Some(sheet) if says(sheet) => Gate::Runs,
            Some(_) => Gate::NotApplicable(format!("the factsheet does not list: {name}")),
            None => Gate::Unobservable(format!("there is no factsheet that could say whether it has: {name}")),
        }
    }

    /// The capabilities for the report, with their sources.
    #[must_use]
    pub fn list(&self) -> Vec<Capability> {
        let mut all = BTreeMap::new();
        let entries = self
            .factsheet
            .iter()
            .filter_map(|sheet| sheet.pointer("/protocolFeatures/agvActions")?.as_array());
        for action in entries.flatten() {
            let name = action.get("actionType").and_then(Value::as_str).unwrap_or("?");
            for scope in action
                .get("actionScopes")
                .and_then(Value::as_array)
                .into_iter()
                .flatten()
            {
                let scope = scope.as_str().unwrap_or("?");
                all.insert(
                    action_name(name, Some(scope)),
                    ("yes".to_owned(), "factsheet".to_owned()),
                );
            }
        }
        let optional = self
            .factsheet
            .iter()
            .filter_map(|sheet| sheet.pointer("/protocolFeatures/optionalParameters")?.as_array());
        for parameter in optional.flatten() {
            let name = parameter.get("parameter").and_then(Value::as_str).unwrap_or("?");
            let support = parameter.get("support").and_then(Value::as_str).unwrap_or("?");
            all.insert(format!("optional {name}"), (support.to_owned(), "factsheet".to_owned()));
        }
        for (name, claimed) in self.statements.iter().chain(&self.claims) {
            let said = if *claimed { "yes" } else { "no" };
            all.entry(name.clone())
                .and_modify(|(_, source)| "factsheet, and the profile".clone_into(source))
                .or_insert_with(|| (said.to_owned(), "profile".to_owned()));
        }
        all.into_iter()
            .take(500)
            .map(|(name, (value, source))| Capability { name, value, source })
            .collect()
    }
}

fn action_name(name: &str, scope: Option<&str>) -> String {
    scope.map_or_else(|| format!("action {name}"), |scope| format!("action {name} {scope}"))
}

fn reverse(gate: Gate, name: &str) -> Gate {
    match gate {
        Gate::Runs => Gate::NotApplicable(format!("the device has what this test needs to be absent: {name}")),
        Gate::NotApplicable(_) => Gate::Runs,
        open @ Gate::Unobservable(_) => open,
    }
}

fn has_action(sheet: &Value, name: &str, scope: Option<&str>) -> bool {
    let all = sheet.pointer("/protocolFeatures/agvActions").and_then(Value::as_array);
    all.into_iter().flatten().any(|action| {
        let scopes = action.get("actionScopes").and_then(Value::as_array);
        action.get("actionType").and_then(Value::as_str) == Some(name)
            && scope.is_none_or(|scope| scopes.into_iter().flatten().any(|other| other.as_str() == Some(scope)))
    })
}

fn has_optional(sheet: &Value, path: &str) -> bool {
    let all = sheet
        .pointer("/protocolFeatures/optionalParameters")
        .and_then(Value::as_array);
    all.into_iter()
        .flatten()
        .any(|one| one.get("parameter").and_then(Value::as_str) == Some(path))
}

/// `maxArrayLens.order.nodes`: a group of `protocolLimits` and a member whose name has dots in it.
fn has_limit(sheet: &Value, path: &str) -> bool {
    let Some(limits) = sheet.get("protocolLimits") else {
        return false;
    };
    let (group, member) = path.split_once('.').unwrap_or((path, ""));
    let value = limits.get(group).and_then(|group| group.get(member));
    value.and_then(Value::as_f64).is_some_and(|limit| limit > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn capabilities(factsheet: Option<Value>) -> Capabilities {
        Capabilities {
            factsheet,
            statements: BTreeMap::from([("node-bound".to_owned(), false)]),
            claims: BTreeMap::new(),
            vantage: Vantage::Subscriber,
            hooks: Vec::new(),
            maps: true,
            motion: Ok(()),
        }
    }

    fn sheet() -> Value {
        json!({ "protocolFeatures": {
            "agvActions": [{ "actionType": "pick", "actionScopes": ["NODE"] }],
            "optionalParameters": [{ "parameter": "order.edges.trajectory", "support": "SUPPORTED" }],
        }, "protocolLimits": { "maxArrayLens": { "order.nodes": 10 } } })
    }

    fn action(scope: Option<&str>) -> Need {
        Need::Action {
            name: "pick".to_owned(),
            scope: scope.map(str::to_owned),
        }
    }

    #[test]
    fn the_factsheet_decides_what_applies() {
        let known = capabilities(Some(sheet()));
        assert_eq!(known.has(&action(Some("NODE"))), Gate::Runs);
        assert!(matches!(known.has(&action(Some("EDGE"))), Gate::NotApplicable(_)));
        assert_eq!(
            known.has(&Need::Optional("order.edges.trajectory".to_owned())),
            Gate::Runs
        );
        assert!(matches!(
            known.has(&Need::NoOptional("order.edges.trajectory".to_owned())),
            Gate::NotApplicable(_)
        ));
        assert_eq!(
            known.has(&Need::Limit("maxArrayLens.order.nodes".to_owned())),
            Gate::Runs
        );
        assert!(matches!(
            known.has(&Need::Limit("maxArrayLens.order.edges".to_owned())),
            Gate::NotApplicable(_)
        ));
    }

    #[test]
    fn what_nobody_says_is_open_and_not_absent() {
        let unknown = capabilities(None);
        assert!(matches!(unknown.has(&action(None)), Gate::Unobservable(_)));
        assert!(matches!(
            unknown.has(&Need::NoAction("pick".to_owned())),
            Gate::Unobservable(_)
        ));
        assert!(matches!(
            unknown.has(&Need::Profile("stops-between-nodes".to_owned())),
            Gate::Unobservable(_)
        ));
        assert!(matches!(
            unknown.has(&Need::Profile("node-bound".to_owned())),
            Gate::NotApplicable(_)
        ));
        assert!(matches!(unknown.has(&Need::Tap), Gate::Unobservable(_)));
    }
}
