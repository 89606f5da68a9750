//! What a profile says a device is like and can do, by the names that capabilities have.

use std::collections::BTreeMap;

use tck_pack::Role;
use tck_profile::{self as profile, Claim, Place, SAMPLE_ACTIONS};

/// What the profile states, and what follows from the actions it names.
pub(super) fn statements(device: &profile::Device) -> BTreeMap<String, bool> {
    let mut all = device.statements.clone();
    if device.role == Role::MasterControl {
        // As most of them do; what is not seen then is inconclusive.
        all.entry("extends-base".to_owned()).or_insert(true);
    }
    // A sample action that is not named is not one that the device does not have.
    for kind in SAMPLE_ACTIONS
        .iter()
        .filter(|kind| matches!(kind.place, Place::Anywhere | Place::Zone))
    {
        if device.sample_actions.0.contains_key(kind.name) {
            all.insert(kind.name.to_owned(), true);
        }
    }
    all
}

/// What the profile claims beside the factsheet, by the names of capabilities.
pub(super) fn claims(device: &profile::Device) -> BTreeMap<String, bool> {
    let one = |claim: &Claim| match claim {
        Claim::Action { name, scope: None } => (format!("action {name}"), true),
        Claim::Action {
            name,
            scope: Some(scope),
        } => (format!("action {name} {scope}"), true),
        Claim::NoAction { name, scope: None } => (format!("action {name}"), false),
        Claim::NoAction {
            name,
            scope: Some(scope),
        } => (format!("action {name} {scope}"), false),
        Claim::Optional(path) => (format!("optional {path}"), true),
        Claim::NoOptional(path) => (format!("optional {path}"), false),
        Claim::Limit { name, value } => (format!("limit {name}"), *value > 0),
        Claim::Statement(name) => (name.clone(), true),
        Claim::NoStatement(name) => (name.clone(), false),
        Claim::NoHook(name) => (format!("hook {name}"), false),
    };
    device.claims.iter().map(one).collect()
}
