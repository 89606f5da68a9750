//! What the command line, the profile and the packs say about the device, put together.

use std::sync::Arc;

use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_pack::{Pack, Role};
use tck_profile::Effective;
use tck_simulate::BuiltIn;

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

/// Refuses a fault the reference device of this role does not have.
pub(super) fn check_faults(role: Role, faults: &[String]) -> Result<(), Problem> {
    let known = BuiltIn::faults(role);
    for fault in faults {
        if !known.iter().any(|known| known.name == fault) {
            let hint = match tck_base::diagnostic::closest(fault, known.iter().map(|known| known.name)) {
                Some(close) => format!("did you mean `{close}`?"),
                None => "`vda5050-tck list faults` shows them all".to_owned(),
            };
            let device = reference_device(role);
            return Err(
                Diagnostic::whole("unknown-fault", format!("the {device} has no fault `{fault}`"))
                    .hint(hint)
                    .into(),
            );
        }
    }
    Ok(())
}

/// What the built-in device of a role is called.
fn reference_device(role: Role) -> &'static str {
    match role {
        Role::Agv => "reference AGV",
        Role::MasterControl => "reference master control",
    }
}

/// Gives the built-in device its liberties, and refuses one it does not have.
pub(super) fn tolerate(device: &mut BuiltIn, tolerances: &[String]) -> Result<(), Problem> {
    for name in tolerances {
        let role = device.role();
        device.tolerate(name).map_err(|unknown| {
            let hint =
                match tck_base::diagnostic::closest(name, BuiltIn::tolerances(role).iter().map(|known| known.name)) {
                    Some(close) => format!("did you mean `{close}`?"),
                    None => "`vda5050-tck list tolerances` shows them all".to_owned(),
                };
            Diagnostic::whole("unknown-tolerance", unknown.to_string()).hint(hint)
        })?;
    }
    Ok(())
}
