//! Whether `run` or `explore` is about the built-in device. Nobody may take its verdict for that of a device of his own: it is said in the
//! first line, and has to be asked for where a pipeline runs or a profile lies beside it.

use crate::cli::args;
use crate::cli::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_pack::Role;
use tck_profile::{Effective, Setting, Surroundings};
use tck_report::issues::USUAL_PROFILE;
use tck_simulate::Vehicle;

/// Set by build servers.
const CI: &str = "CI";

/// What of a command line is about the device.
pub(super) struct Asked<'a> {
    /// Flags for any device.
    pub(super) device: &'a args::DeviceArgs,
    /// The built-in one is asked for.
    pub(super) reference: bool,
    /// Virtual time, which only the built-in one knows.
    pub(super) in_virtual_time: bool,
    /// Its defects.
    pub(super) faults: &'a [String],
    /// Its liberties.
    pub(super) tolerances: &'a [String],
    /// Its kind.
    pub(super) vehicle: Vehicle,
}

impl<'a> Asked<'a> {
    /// Of `run`.
    pub(super) fn of_run(run: &'a args::Run) -> Self {
        Self {
            device: &run.device,
            reference: run.reference,
            in_virtual_time: run.in_virtual_time,
            faults: &run.fault,
            tolerances: &run.tolerance,
            vehicle: run.vehicle.0,
        }
    }

    /// Of `explore`.
    pub(super) fn of_explore(explore: &'a args::Explore) -> Self {
        Self {
            device: &explore.device,
            reference: explore.reference,
            in_virtual_time: explore.in_virtual_time,
            faults: &explore.fault,
            tolerances: &explore.tolerance,
            vehicle: explore.vehicle.0,
        }
    }

    /// Whether it is made another one than the faultless, usual one.
    fn is_altered(&self) -> bool {
        !self.faults.is_empty() || !self.tolerances.is_empty() || self.vehicle != Vehicle::default()
    }
}

/// Whether the built-in device is tested; if so, it is said to `tell`.
///
/// # Errors
/// When it has to be asked for, or what was asked for is for it and another device is tested.
pub(super) fn is_tested(
    asked: &Asked<'_>,
    effective: &Effective,
    surroundings: &Surroundings,
    tell: &dyn Fn(&str),
) -> Result<bool, Problem> {
    let device = &effective.profile.device;
    let is_foreign = asked.device.profile.is_some() || device.manufacturer.is_some() || device.serial_number.is_some();
    // In virtual time there is no other device than the built-in one.
    if is_foreign && !asked.in_virtual_time {
        if asked.is_altered() || asked.reference {
            let title = "`--reference`, `--fault`, `--tolerance` and `--vehicle` are for the built-in device, and another \
                         device is tested here";
            return Err(Diagnostic::whole("usage", title).into());
        }
        return Ok(false);
    }
    // What only the built-in device has, names it.
    let is_named = asked.reference || asked.in_virtual_time || asked.is_altered();
    if let Some(why) = doubt(surroundings).filter(|_| !is_named) {
        let title = format!("no profile is named, so that the built-in reference device would be tested, and {why}");
        let hint = "name your device with `--profile device.toml`, or the built-in one with `--reference`";
        return Err(Diagnostic::whole("no-device", title).hint(hint).into());
    }
    let device = match device.role {
        Role::Agv => "AGV",
        Role::MasterControl => "master control",
    };
    tell(&format!(
        "testing the built-in reference {device}, and no device of yours (--profile names one)"
    ));
    Ok(true)
}

/// Why somebody may have meant another device.
fn doubt(surroundings: &Surroundings) -> Option<String> {
    let value = surroundings
        .environment
        .get(CI)
        .map(|value| value.trim().to_lowercase());
    if value.is_some_and(|value| !matches!(value.as_str(), "" | "0" | "false" | "no")) {
        return Some("this is a pipeline (`CI` is set)".to_owned());
    }
    let profile = surroundings.directory.join(USUAL_PROFILE);
    profile.is_file().then(|| format!("a {USUAL_PROFILE} is beside it"))
}

/// What makes the built-in device another one, for the record.
pub(super) fn settings(asked: &Asked<'_>) -> Vec<Setting> {
    let kind = asked.vehicle.named().0;
    let vehicle = (asked.vehicle != Vehicle::default()).then(|| kind.to_owned());
    let all = [
        ("built-in.fault", asked.faults.join(", ")),
        ("built-in.tolerance", asked.tolerances.join(", ")),
        ("built-in.vehicle", vehicle.unwrap_or_default()),
    ];
    let all = all.into_iter().filter(|(_, value)| !value.is_empty());
    all.map(|(name, value)| Setting::shown(name, value, "flag")).collect()
}
