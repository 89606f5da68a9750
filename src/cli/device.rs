//! What the command line, the profile and the packs say about the device, put together.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::problem::Problem;
use crate::diagnostic::Diagnostic;
use crate::pack::Pack;
use crate::profile::{self, Claim, Effective};
use crate::run::Library;

/// The protocol version the device is judged by.
pub(super) fn pack_of(library: &Library, effective: &Effective) -> Result<Arc<Pack>, Problem> {
    let packs = &library.rules.packs;
    let Some(wanted) = &effective.profile.device.protocol else {
        return Ok(Arc::clone(packs.latest()));
    };
    packs.get(wanted).cloned().ok_or_else(|| {
        let known: Vec<String> = packs.all().iter().map(|pack| pack.version.to_string()).collect();
        let title = format!("there is no protocol version {wanted}");
        let diagnostic = effective.complain("device.protocol", "unknown-version", title, "this version");
        diagnostic.hint(format!("known versions: {}", known.join(", "))).into()
    })
}

/// Refuses a fault the reference AGV does not have.
pub(super) fn check_faults(faults: &[String]) -> Result<(), Problem> {
    use crate::reference::agv::FAULTS;
    for fault in faults {
        if !FAULTS.iter().any(|known| known.name == fault) {
            let names = FAULTS.iter().map(|known| known.name);
            let hint = match crate::diagnostic::closest(fault, names) {
                Some(close) => format!("did you mean `{close}`?"),
                None => "`vda5050-tck list faults` shows them all".to_owned(),
            };
            return Err(
                Diagnostic::whole("unknown-fault", format!("the reference AGV has no fault `{fault}`"))
                    .hint(hint)
                    .into(),
            );
        }
    }
    Ok(())
}

/// What the profile states, and what follows from the actions it names.
pub(super) fn statements(device: &profile::Device) -> BTreeMap<String, bool> {
    let mut all = device.statements.clone();
    all.insert("long-action".to_owned(), device.long_action.is_some());
    all.insert("brief-action".to_owned(), device.brief_action.is_some());
    all.insert(
        "uninterruptible-action".to_owned(),
        device.uninterruptible_action.is_some(),
    );
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
        Claim::NoAction(name) => (format!("action {name}"), false),
        Claim::Optional(path) => (format!("optional {path}"), true),
        Claim::NoOptional(path) => (format!("optional {path}"), false),
        Claim::Limit { name, value } => (format!("limit {name}"), *value > 0),
        Claim::Statement(name) => (name.clone(), true),
        Claim::NoStatement(name) => (name.clone(), false),
    };
    device.claims.iter().map(one).collect()
}
