//! What the command line says about a built-in device.

use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_pack::Role;
use tck_simulate::BuiltIn;

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
