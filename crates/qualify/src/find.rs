//! The shortest way to see that a fault is found: the tests about its first requirement, a few at a time; then each of them
//! by itself; then all that concern it; then all cases of the tables that are drawn from; then one test of each folder,
//! in which monitors see what a device does everywhere; then everything.

use std::collections::BTreeSet;

use super::DRAWN;
use super::kill::{Kill, KillContext, concerns};
use tck_base::verdict::Verdict;
use tck_engine::EngineError;
use tck_pack::Role;
use tck_reference::Fault;
use tck_simulate::BuiltIn;
use tck_suite::model::Test;

/// How many tests are tried before it is looked whether one of them has found the fault.
const FEW: usize = 3;

/// Whether a requirement the fault names was reported, and the device failed. A lapse need only warn.
pub(super) fn is_found(role: Role, kill: &Kill) -> bool {
    let name = kill.fault.name;
    let fails = || kill.verdict == Some(Verdict::Fail) || BuiltIn::lapse(role, name).is_some();
    kill.named().is_some() && fails()
}

/// Tries a fault until it is found.
///
/// # Errors
/// When a run cannot be carried out.
pub(super) fn find(grounds: &KillContext<'_>, role: Role, fault: &Fault) -> Result<Kill, EngineError> {
    let mut kill = Kill::nothing(fault);
    let mut tried = |draw: Option<u64>, selected: &dyn Fn(&Test) -> bool| -> Result<bool, EngineError> {
        kill.join(grounds.kill(fault, draw, selected)?);
        Ok(is_found(role, &kill))
    };
    let about = |test: &Test| {
        let first = fault.breaks.first();
        test.requirements().iter().any(|id| Some(&id.as_str()) == first)
    };
    let tests = grounds.vehicles.iter().flat_map(|vehicle| &vehicle.request.tests);
    let about: BTreeSet<&str> = tests.filter(|test| about(test)).map(|test| test.table()).collect();
    let about: Vec<&str> = grounds
        .tables()
        .into_iter()
        .filter(|table| about.contains(table))
        .collect();
    for few in about.chunks(FEW) {
        if tried(DRAWN, &|test| few.contains(&test.table()))? {
            return Ok(kill);
        }
    }
    // What fails once in the life of a device may have been used up by the test before.
    for alone in about {
        if tried(DRAWN, &|test| test.table() == alone)? {
            return Ok(kill);
        }
    }
    let tour = grounds.one_of_each_folder();
    let _ = tried(DRAWN, &|test| concerns(fault, test))?
        || tried(None, &|test| test.drawn.is_some() && concerns(fault, test))?
        || tried(DRAWN, &|test| tour.contains(test.table()))?
        || tried(DRAWN, &|_| true)?;
    Ok(kill)
}
