//! `qualify`: prove the harness on its own reference device.

use serde_json::json;

use super::args::{Format, Qualify};
use super::device::check_faults;
use super::exit::Exit;
use super::problem::Problem;
use crate::pack::Role;
use crate::reference::Fault;
use crate::run::{Library, Qualification, qualify_tests};
use crate::simulate::BuiltIn;

/// `qualify`.
pub fn qualify(arguments: &Qualify) -> Result<Exit, Problem> {
    let library = Library::load(arguments.suites.suites.as_deref())?;
    let roles: Vec<Role> = match arguments.role {
        Some(role) => vec![role],
        None => vec![Role::Agv, Role::MasterControl],
    };
    // A fault or a test belongs to one side; the other one is left out without a word.
    let known = |role: Role| {
        let of_role = |name: &String| every_fault(role).any(|fault| fault.name == name);
        arguments.fault.iter().all(of_role)
    };
    let with_faults: Vec<Role> = roles.iter().copied().filter(|role| known(*role)).collect();
    if with_faults.is_empty() {
        check_faults(roles.first().copied().unwrap_or(Role::Agv), &arguments.fault)?;
    }
    let packs = match arguments.protocol.as_deref() {
        Some(wanted) => vec![super::pack(&library, Some(wanted))?],
        None => library.rules.packs.all().to_vec(),
    };
    let whole = arguments.tests.is_empty() && arguments.fault.is_empty() && !arguments.blind;
    let mut refused = None;
    let mut jobs = Vec::new();
    for (role, pack) in with_faults
        .iter()
        .flat_map(|role| packs.iter().map(move |pack| (*role, pack)))
    {
        let faults: Vec<_> = match (arguments.blind, arguments.fault.as_slice()) {
            (true, []) => BuiltIn::blind_faults(role).to_vec(),
            // Those of blind rounds need not be found; what they fail is proven all the same.
            (false, []) => every_fault(role).copied().collect(),
            (_, named) => {
                let is_named = |fault: &&Fault| named.iter().any(|name| name == fault.name);
                every_fault(role).filter(is_named).copied().collect()
            }
        };
        let all = library.tests(role, &pack.id);
        match super::select::select(&all, &arguments.tests) {
            Ok(tests) => jobs.push((role, pack, tests, faults)),
            Err(problem) => {
                refused.get_or_insert(problem);
            }
        }
    }
    let any = !jobs.is_empty();
    let mut exit = Exit::Conforms;
    // Side by side: while one waits for its last fault, the others go on.
    let outcomes = std::thread::scope(|scope| {
        let library = &library;
        let running: Vec<_> = jobs
            .iter()
            .map(|(_, pack, tests, faults)| scope.spawn(|| qualify_tests(library, pack, tests, faults, &|_| {})))
            .collect();
        running
            .into_iter()
            .map(std::thread::ScopedJoinHandle::join)
            .collect::<Vec<_>>()
    });
    for ((role, pack, _, _), outcome) in jobs.iter().zip(outcomes) {
        let outcome = outcome.map_err(|_| Problem::Environment("a qualification has broken off".to_owned()))?;
        let outcome = outcome.map_err(|error| Problem::Environment(error.to_string()))?;
        // Faults of what a version does not have cannot show there.
        let complete = whole && pack.id == library.rules.packs.latest().id;
        let proven =
            outcome.unexcused().is_empty() && outcome.stale_excuses().is_empty() && outcome.missed().is_empty();
        if !outcome.blemishes.is_empty() || (complete && !proven) {
            exit = Exit::DoesNotConform;
        }
        let text = match arguments.format {
            Format::Text => format!("{role}, VDA 5050 {}\n\n{}\n", pack.version, page(&outcome, complete)),
            Format::Json => format!("{}\n", data(*role, &pack.version.to_string(), &outcome)),
        };
        super::print(&text)?;
    }
    match refused {
        Some(problem) if !any => Err(problem.into()),
        _ => Ok(exit),
    }
}

/// All faults of a reference device, those of blind rounds included.
fn every_fault(role: Role) -> impl Iterator<Item = &'static Fault> {
    BuiltIn::faults(role).iter().chain(BuiltIn::blind_faults(role))
}

fn page(outcome: &Qualification, complete: bool) -> String {
    use std::fmt::Write as _;
    let mut text = outcome.matrix();
    for (decider, verdict) in &outcome.blemishes {
        let _ = writeln!(
            text,
            "not a pass without a fault: {} {} ({verdict})",
            decider.requirement, decider.place
        );
    }
    for excuse in outcome.stale_excuses().into_iter().filter(|_| complete) {
        let _ = writeln!(
            text,
            "proven after all, so that no reason is needed: {} {}",
            excuse.requirement, excuse.place
        );
    }
    for kill in outcome.missed() {
        let _ = writeln!(
            text,
            "not found by a requirement it names: fault {} ({})",
            kill.fault.name,
            kill.fault.breaks.join(", ")
        );
    }
    text
}

fn data(role: Role, version: &str, outcome: &Qualification) -> serde_json::Value {
    let kills = outcome.kills.iter().map(|kill| {
        let deciders = kill.deciders.iter().map(|decider| json!({ "requirement": decider.requirement, "by": decider.place }));
        json!({ "fault": kill.fault.name, "breaks": kill.fault.breaks, "named": kill.named(), "killed": deciders.collect::<Vec<_>>() })
    });
    let unproven = outcome.unproven();
    let unproven = unproven.iter().map(
        |decider| json!({ "requirement": decider.requirement, "by": decider.place, "why": outcome.excuse(decider) }),
    );
    json!({ "role": role.word(), "protocol": version, "deciders": outcome.deciders.len(), "faults": kills.collect::<Vec<_>>(), "unproven": unproven.collect::<Vec<_>>() })
}
