//! `certify`: a run with nothing left to choose, and what a profile has to hold before it begins.

use super::args;
use super::exit::Exit;
use super::outputs::Outputs;
use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_pack::{Hooks, Role};
use tck_profile::{self as profile, Effective, Surroundings};
use tck_report::certificate::OWED;

/// Names a folder of suites for other commands.
const OWN_SUITES: &str = "VDA5050_TCK_SUITES";

/// `certify`.
pub fn certify(arguments: &args::Certify, outputs: &Outputs<'_>) -> Result<Exit, Problem> {
    let run = as_run(arguments, &Surroundings::of_process())?;
    super::run::run_command(&run, outputs)
}

/// The run that a certification is, if the profile has all that a certificate takes.
pub(super) fn as_run(arguments: &args::Certify, surroundings: &Surroundings) -> Result<args::Run, Problem> {
    let said = arguments.certificate.settings();
    let hooks = Hooks::load(&crate::embedded())?;
    let effective = profile::load(arguments.profile.as_deref(), &said, surroundings, &hooks)?;
    let missing = missing(&effective, surroundings);
    if !missing.is_empty() {
        return Err(Problem::Usage(missing));
    }
    Ok(args::Run {
        certifies: true,
        said,
        device: args::DeviceArgs {
            profile: arguments.profile.clone(),
            ..args::DeviceArgs::default()
        },
        output: arguments.output.clone(),
        pipeline: arguments.pipeline.clone(),
        people: arguments.people.clone(),
        selection: args::SelectionArgs {
            resume: arguments.resume.clone(),
            ..args::SelectionArgs::default()
        },
        thorough: arguments.thorough,
        budget: arguments.budget,
        certificate: true,
        shard: arguments.shard,
        ..args::Run::default()
    })
}

/// What stands in the way of a certificate, and can be seen in the profile alone.
fn missing(effective: &Effective, surroundings: &Surroundings) -> Vec<Diagnostic> {
    let mut all = Vec::new();
    if let Some(changed) = effective.profile.time.contract().first() {
        let title = format!("a certificate is given for default timings, and {changed}");
        let hint =
            "take it out of the section [time] of the profile, or wherever `run -v` says it comes from, or use `run`";
        all.push(Diagnostic::whole("certify", title).hint(hint));
    }
    if surroundings.environment.contains_key(OWN_SUITES) {
        let title = format!("a certificate is given for the suites as delivered, and {OWN_SUITES} names others");
        all.push(
            Diagnostic::whole("certify", title).hint(format!("take {OWN_SUITES} out of the environment, or use `run`")),
        );
    }
    let is_vehicle = effective.profile.device.role == Role::Agv;
    if is_vehicle && !effective.profile.motion.allowed {
        let title = "a certificate is about driving, too, and the profile does not allow motion";
        let hint =
            "set `allowed = true` in the section [motion] of the profile where the vehicle may drive, or use `run`";
        all.push(Diagnostic::whole("certify", title).hint(hint));
    }
    let says = |setting: &str| effective.settings.iter().any(|one| one.name == setting);
    for (setting, what) in OWED.iter().filter(|(setting, _)| !says(setting)) {
        let name = setting.trim_start_matches("certificate.");
        let title = format!("a certificate names {what}, and `{setting}` is missing");
        let hint = format!("set `{name}` in the section [certificate] of the profile, or give --{name}");
        all.push(Diagnostic::whole("certify", title).hint(hint));
    }
    all
}
