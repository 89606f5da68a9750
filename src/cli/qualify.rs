//! `qualify`: prove the harness on its own reference device.

use std::sync::Arc;

use serde_json::json;

use super::args::{Format, Qualify};
use super::device::check_faults;
use super::exit::Exit;
use super::problem::Problem;
use super::qualified;
use tck_base::shard::{ChosenShard, Piece, divided};
use tck_journal::event::ShardRecord;
use tck_pack::{Pack, Role};
use tck_profile::Surroundings;
use tck_qualify::saved::{QualificationResult, QualifiedSide, RESULT_FORMAT};
use tck_qualify::{Depth, Qualification};
use tck_reference::Fault;
use tck_simulate::BuiltIn;
use tck_suite::model::Test;

/// A role and a version, with what is tried there.
struct Job {
    role: Role,
    pack: Arc<Pack>,
    tests: Vec<Arc<Test>>,
    faults: Vec<Fault>,
}

/// `qualify`.
pub fn qualify(arguments: &Qualify) -> Result<Exit, Problem> {
    let part = super::shard::chosen(arguments.shard, &Surroundings::of_process())?;
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
    let known = &library.rules.packs;
    // Of a version that knows one side only the other one is left out, unless it is the one that is asked for.
    let judged = |role: Role| match arguments.protocol.as_deref() {
        Some(wanted) => super::pack_for_devices(known, Some(wanted), role).map(|pack| vec![pack]),
        None => Ok(known.of_role(role).cloned().collect()),
    };
    let mut sides_of = Vec::new();
    for role in &with_faults {
        match judged(*role) {
            Ok(packs) => sides_of.extend(packs.into_iter().map(|pack| (*role, pack))),
            Err(problem)
                if with_faults.len() == 1 || known.find(arguments.protocol.as_deref().unwrap_or_default()).is_err() =>
            {
                return Err(problem);
            }
            Err(_) => {}
        }
    }
    if let (true, Some(role)) = (sides_of.is_empty(), with_faults.first()) {
        judged(*role)?;
    }
    let named = !arguments.fault.is_empty();
    let depth = match (named, &part) {
        (true, _) => Depth::Everything,
        // What a clause is proven by may be a fault of another part: that is seen when the parts are joined.
        (false, Some(_)) => Depth::Faults,
        (false, None) => Depth::Clauses,
    };
    // Of a part of the tests nobody asks that they find everything.
    let whole = arguments.tests.is_empty() && !named;
    let mut refused = None;
    let mut jobs = Vec::new();
    for (role, pack) in &sides_of {
        let role = *role;
        let is_asked = |fault: &&Fault| !named || arguments.fault.iter().any(|name| name == fault.name);
        let faults: Vec<Fault> = BuiltIn::faults(role).iter().filter(is_asked).copied().collect();
        let all = library.tests(role, &pack.id);
        match tck_run::select(&all, &arguments.tests) {
            Ok(tests) => jobs.push(Job {
                role,
                pack: Arc::clone(pack),
                tests,
                faults,
            }),
            Err(problem) => {
                refused.get_or_insert(problem);
            }
        }
    }
    let any = !jobs.is_empty();
    let shard = part.as_ref().map(|part| share(&mut jobs, part, &arguments.tests));
    if let Some(ShardRecord { index, of, filled, .. }) = shard.as_ref().filter(|_| any && jobs.is_empty()) {
        let why = format!(
            "there is no fault for part {index} of {of}: those that are tried are divided into no more than {filled}"
        );
        return Err(Problem::NothingToDo(why));
    }
    let mut exit = Exit::Conforms;
    // Side by side: while one waits for its last fault, the others go on.
    let outcomes = std::thread::scope(|scope| {
        let library = &library;
        let running: Vec<_> = jobs
            .iter()
            .map(|job| scope.spawn(|| tck_qualify::qualify(library, &job.pack, &job.tests, &job.faults, depth)))
            .collect();
        running
            .into_iter()
            .map(std::thread::ScopedJoinHandle::join)
            .collect::<Vec<_>>()
    });
    let is_part = shard.is_some();
    let mut sides = Vec::new();
    for (Job { role, pack, .. }, outcome) in jobs.iter().zip(outcomes) {
        let outcome = outcome.map_err(|_| Problem::Environment("a qualification has broken off".to_owned()))?;
        let outcome = outcome.map_err(|error| Problem::Environment(error.to_string()))?;
        let complaints = outcome.complaints(whole && !is_part);
        sides.push(QualifiedSide::of(&outcome, pack, !is_part, whole));
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
                let open = match (is_part, named) {
                    (true, false) => "; what is unproven is tried when the parts are joined",
                    _ => "",
                };
                format!(
                    "{role}, VDA 5050 {version}\n{matrix}{lines}{}{open}\n\n",
                    outcome.summary()
                )
            }
            Format::Json => format!("{}\n", data(*role, &version.to_string(), &outcome)),
        };
        super::print(&text)?;
    }
    if let Some(problem) = refused.filter(|_| !any) {
        return Err(problem.into());
    }
    if let Some(folder) = &arguments.out {
        let mut result = QualificationResult {
            format: RESULT_FORMAT.to_owned(),
            tool: tck_journal::tool(),
            suites_sha256: library.rules.sha256.clone(),
            tests: arguments.tests.clone(),
            faults: arguments.fault.clone(),
            verdict: None,
            shard,
            merged: None,
            sides,
        };
        result.conclude();
        let root = qualified::write(&result, folder)?;
        super::tell(&format!(
            "the bundle in {} has the root hash sha256:{root}",
            folder.display()
        ));
    }
    Ok(exit)
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

/// Keeps one part of the faults of all jobs, and of the jobs those that have one.
fn share(jobs: &mut Vec<Job>, part: &ChosenShard, tests: &[String]) -> ShardRecord {
    let name = |job: &Job, fault: &Fault| format!("{} {} {}", job.role, job.pack.version, fault.name);
    let names: Vec<String> = jobs
        .iter()
        .flat_map(|job| job.faults.iter().map(move |fault| name(job, fault)))
        .collect();
    // How long it takes to find a fault nobody knows beforehand.
    let pieces: Vec<Piece> = names
        .iter()
        .map(|name| Piece {
            name: name.clone(),
            millis: 1,
        })
        .collect();
    let places = divided(&pieces, part.shard.of);
    let mut own = places.into_iter().map(|place| place == part.shard.index);
    for job in jobs.iter_mut() {
        job.faults.retain(|_| own.next().unwrap_or(false));
    }
    jobs.retain(|job| !job.faults.is_empty());
    let chosen = format!("tests {}", tests.join(" "));
    let all: Vec<&str> = names.iter().map(String::as_str).chain([chosen.as_str()]).collect();
    let record = ShardRecord::of(part, part.shard.of.min(names.len()), &all);
    ShardRecord {
        whole: names.len(),
        ..record
    }
}
