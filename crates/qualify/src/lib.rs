//! Proof of every check: it passes on the faultless reference device, and a named fault makes it fail.
//!
//! Qualification runs everything in virtual time without a fault. Each fault is then tried on the tests that are most
//! likely to find it, and on more of them until one does ([`find`]). What is still unproven is tried with the faults
//! that are about it, and at last with every fault ([`rest`]). What no fault fails, and which fault nothing finds, is
//! said by name, unless the exceptions of the suites give the reason ([`outcome`]). Where several processes share the faults,
//! each finds its own, and what all of them leave unproven is tried when they are joined ([`saved`], [`prove`]).
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod decider;
mod find;
mod kill;
mod matrix;
mod outcome;
mod parallel;
mod rest;
pub mod saved;

use std::collections::BTreeSet;
use std::sync::Arc;

pub use decider::{Decider, decided};
pub use kill::Kill;
pub use outcome::Qualification;
pub use parallel::on_all_cores;

use self::decider::{blemishes_of, decided_in};
use self::kill::{KillContext, Vehicle, each};
use tck_engine::EngineError;
use tck_judge::Library;
use tck_pack::{Mood, Pack, Role};
use tck_reference::Fault;
use tck_run::{Selection, VirtualRun, run_silently};
use tck_simulate::BuiltIn;
use tck_suite::model::Test;

/// What is drawn of the cases that come from a schema.
const DRAWN: Option<u64> = Some(1);

/// How far a qualification goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// Whether each fault is found.
    Faults,
    /// Also whether each clause and each monitor is failed by a fault.
    Clauses,
    /// Everything that a fault fails: each one is tried on every test.
    Everything,
}

/// Qualifies some tests, all of one role, with these faults of its reference device.
///
/// # Errors
/// When a run cannot be carried out.
pub fn qualify(
    library: &Library,
    pack: &Pack,
    tests: &[Arc<Test>],
    faults: &[Fault],
    depth: Depth,
) -> Result<Qualification, EngineError> {
    let (grounds, mut outcome) = prepared(library, pack, tests)?;
    let role = outcome.role;
    let faults = possible(library, pack, faults, depth);
    outcome.kills = match depth {
        Depth::Everything => each(&faults, |fault| grounds.kill(fault, DRAWN, &|_| true))?,
        Depth::Faults | Depth::Clauses if outcome.owes_faults => {
            each(&faults, |fault| find::find(&grounds, role, fault))?
        }
        // Where no fault has to be found, what it fails is seen when the clauses are proven.
        Depth::Faults | Depth::Clauses => faults.iter().map(Kill::nothing).collect(),
    };
    if depth == Depth::Clauses {
        rest::Rest::new(&grounds, &outcome.deciders, &outcome.exceptions).prove(&faults, &mut outcome.kills)?;
    }
    Ok(outcome)
}

/// Proves what the parts of a divided qualification have left open together, as one that is not divided does at its end.
///
/// # Errors
/// When a run cannot be carried out.
pub fn prove(
    library: &Library,
    pack: &Pack,
    tests: &[Arc<Test>],
    faults: &[Fault],
    outcome: &mut Qualification,
) -> Result<(), EngineError> {
    let (grounds, _) = prepared(library, pack, tests)?;
    let faults = possible(library, pack, faults, Depth::Clauses);
    rest::Rest::new(&grounds, &outcome.deciders, &outcome.exceptions).prove(&faults, &mut outcome.kills)
}

/// The faults that can show. What breaks only obligations that this version does not have cannot; whoever asks for it gets it
/// tried.
fn possible(library: &Library, pack: &Pack, faults: &[Fault], depth: Depth) -> Vec<Fault> {
    let in_version = |id: &str| {
        let requirement = library.rules.catalogue.get(id);
        requirement.is_none_or(|requirement| requirement.in_version(pack).is_some())
    };
    let possible = |fault: &&Fault| depth == Depth::Everything || fault.breaks.iter().any(|id| in_version(id));
    faults.iter().filter(possible).copied().collect()
}

/// What the monitors on duty decide. One that judges nothing on the faultless device passes nothing there, and has to be
/// failed by a fault all the same.
fn on_duty(library: &Library, pack: &Pack, role: Role) -> impl Iterator<Item = Decider> {
    let rules = &library.rules;
    let is_judged = move |id: &str| {
        let requirement = rules.catalogue.get(id).filter(|one| one.role.concerns(role));
        let note = requirement.and_then(|requirement| requirement.in_version(pack));
        note.is_some_and(|note| note.mood != Mood::May)
    };
    let all = rules.suites.monitors.iter();
    all.filter(move |one| one.device.is_none_or(|device| device == role) && one.spec.contains(pack.version))
        .flat_map(|monitor| monitor.checks.iter().map(move |check| (monitor, check)))
        .filter(move |(_, check)| is_judged(check.requirement.as_str()))
        .map(|(monitor, check)| Decider {
            requirement: check.requirement.to_string(),
            place: monitor.id.clone(),
        })
}

/// The requirements of the earlier versions in which each fault has to be found.
fn earlier(library: &Library, pack: &Pack, role: Role) -> BTreeSet<String> {
    let rules = &library.rules;
    let before = rules.packs.of_role(role).take_while(|other| other.id != pack.id);
    let before: Vec<_> = before.filter(|other| other.finds_every_fault()).collect();
    let all = rules.catalogue.all();
    all.filter(|one| before.iter().any(|other| one.in_version(other).is_some()))
        .map(|one| one.id.to_string())
        .collect()
}

/// What faults are tried on, and what the faultless device shows of it.
fn prepared<'l>(
    library: &'l Library,
    pack: &'l Pack,
    tests: &[Arc<Test>],
) -> Result<(KillContext<'l>, Qualification), EngineError> {
    let role = tests.first().map_or(Role::Agv, |test| test.device);
    let mut blemishes = Vec::new();
    let mut deciders = BTreeSet::new();
    let mut vehicles = Vec::new();
    for device in BuiltIn::variants(role, pack) {
        let mut request = VirtualRun {
            device,
            tests: Selection::all(tests.to_vec()),
            ..VirtualRun::of_role(role, library, pack)
        };
        let result = run_silently(library, pack, request.clone())?.result;
        blemishes.extend(blemishes_of(&result));
        let all = decided_in(library, &result).into_iter().map(|(decider, _)| decider);
        let own: BTreeSet<Decider> = all.filter(|decider| !deciders.contains(decider)).collect();
        if !vehicles.is_empty() {
            // What also runs on the usual vehicle is proven there.
            let is_own = |id: &str| own.iter().any(|decider| decider.place.split(' ').next() == Some(id));
            request.tests.retain(|test| is_own(test.table()));
        }
        vehicles.push(Vehicle {
            request,
            requirements: own.iter().map(|decider| decider.requirement.clone()).collect(),
        });
        deciders.extend(own);
    }
    deciders.extend(on_duty(library, pack, role));
    let grounds = KillContext {
        library,
        pack,
        vehicles,
    };
    let outcome = Qualification {
        role,
        owes_faults: pack.finds_every_fault(),
        earlier: earlier(library, pack, role),
        blemishes,
        deciders,
        kills: Vec::new(),
        exceptions: library.rules.suites.exceptions.of(role, pack.version),
    };
    Ok((grounds, outcome))
}
