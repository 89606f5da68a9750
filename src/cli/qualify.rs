//! `qualify`: prove the harness on its own reference device.

use serde_json::json;

use super::args::{Format, Qualify};
use super::device::check_faults;
use super::exit::Exit;
use super::problem::Problem;
use tck_pack::Role;
use tck_qualify::{Depth, Qualification};
use tck_reference::Fault;
use tck_simulate::BuiltIn;

/// `qualify`.
pub fn qualify(arguments: &Qualify) -> Result<Exit, Problem> {
    let library = crate::assets::library(arguments.suites.own())?;
    let roles: Vec<Role> = match arguments.role {
        Some(role) => vec![role],
        None => vec![Role::Agv, Role::MasterControl],
    };
    // A fault or a test belongs to one side; the other one is left out without a word.
    let known = |role: Role| {
        let of_role = |name: &String| BuiltIn::faults(role).iter().any(|fault| fault.name == name);
        arguments.fault.iter().all(of_role)
    };
    let with_faults: Vec<Role> = roles.iter().copied().filter(|role| known(*role)).collect();
    if with_faults.is_empty() {
        check_faults(roles.first().copied().unwrap_or(Role::Agv), &arguments.fault)?;
    }
    let packs = match arguments.protocol.as_deref() {
        Some(wanted) => vec![super::pack_for_devices(&library.rules.packs, Some(wanted))?],
        None => library.rules.packs.of_devices().cloned().collect(),
    };
    let named = !arguments.fault.is_empty();
    let depth = if named { Depth::Everything } else { Depth::Clauses };
    // Of a part of the tests nobody asks that they find everything.
    let whole = arguments.tests.is_empty() && !named;
    let mut refused = None;
    let mut jobs = Vec::new();
    for (role, pack) in with_faults
        .iter()
        .flat_map(|role| packs.iter().map(move |pack| (*role, pack)))
    {
        let is_asked = |fault: &&Fault| !named || arguments.fault.iter().any(|name| name == fault.name);
        let faults: Vec<Fault> = BuiltIn::faults(role).iter().filter(is_asked).copied().collect();
        let all = library.tests(role, &pack.id);
        match tck_run::select(&all, &arguments.tests) {
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
            .map(|(_, pack, tests, faults)| scope.spawn(|| tck_qualify::qualify(library, pack, tests, faults, depth)))
            .collect();
        running
            .into_iter()
            .map(std::thread::ScopedJoinHandle::join)
            .collect::<Vec<_>>()
    });
    for ((role, pack, _, _), outcome) in jobs.iter().zip(outcomes) {
        let outcome = outcome.map_err(|_| Problem::Environment("a qualification has broken off".to_owned()))?;
        let outcome = outcome.map_err(|error| Problem::Environment(error.to_string()))?;
        let complaints = outcome.complaints(whole);
        let is_wrong = if whole {
            !complaints.is_empty()
        } else {
            !outcome.blemishes.is_empty()
        };
        if is_wrong {
            exit = Exit::DoesNotConform;
        }
        let version = pack.version;
        let text = match arguments.format {
            Format::Text => {
                let matrix = if arguments.matrix || !whole {
                    outcome.matrix()
                } else {
                    String::new()
                };
                let lines = complaints
                    .into_iter()
                    .fold(String::new(), |text, line| text + "wrong: " + &line + "\n");
                format!("{role}, VDA 5050 {version}\n{matrix}{lines}{}\n\n", outcome.summary())
            }
            Format::Json => format!("{}\n", data(*role, &version.to_string(), &outcome)),
        };
        super::print(&text)?;
    }
    match refused {
        Some(problem) if !any => Err(problem.into()),
        _ => Ok(exit),
    }
}

fn data(role: Role, version: &str, outcome: &Qualification) -> serde_json::Value {
    let kills = outcome.kills.iter().map(|kill| {
        let deciders = kill.deciders.keys().map(|decider| json!({ "requirement": decider.requirement, "by": decider.place }));
        json!({ "fault": kill.fault.name, "breaks": kill.fault.breaks, "named": kill.named().is_some(), "killed": deciders.collect::<Vec<_>>() })
    });
    let unproven = outcome.unproven();
    let unproven = unproven.iter().map(
        |decider| json!({ "requirement": decider.requirement, "by": decider.place, "why": outcome.excuse(decider) }),
    );
    json!({ "role": role.word(), "protocol": version, "deciders": outcome.deciders.len(), "faults": kills.collect::<Vec<_>>(), "unproven": unproven.collect::<Vec<_>>() })
}
