//! What a vehicle can do otherwise: records by topic, and a reference AGV that has some of them.

#![allow(
    clippy::collapsible_if,
    clippy::float_cmp,
    clippy::ignored_unit_patterns,
    clippy::match_bool,
    clippy::redundant_closure_for_method_calls,
    clippy::semicolon_if_nothing_returned,
    clippy::trivially_copy_pass_by_ref,
    clippy::type_complexity,
    clippy::unnecessary_box_returns,
    reason = "records are short closures of a few given shapes"
)]

mod actions;
mod cancellation;
mod checks;
mod connection;
mod driving;
mod errors;
mod factsheet;
mod header;
mod instants;
mod manner;
mod maps;
mod modes;
mod motion;
mod nature;
mod orders;
mod pause;
mod poses;
mod prelude;
mod reading;
mod refusals;
mod route;
mod running;
mod sending;
mod state;
mod stations;
mod telling;
#[cfg(test)]
mod tests;
mod updates;
mod visualization;

use std::sync::LazyLock;

use super::record::{Kind, Record};
use crate::Fault;
use crate::agv::hooks::Deviation;
use crate::agv::{Agv, AgvConfig};

/// All records.
fn records() -> impl Iterator<Item = &'static Record<dyn Deviation>> {
    let topics = [
        sending::RECORDS,
        connection::RECORDS,
        header::RECORDS,
        state::RECORDS,
        route::RECORDS,
        motion::RECORDS,
        actions::RECORDS,
        errors::RECORDS,
        reading::RECORDS,
        refusals::RECORDS,
        stations::RECORDS,
        maps::RECORDS,
        visualization::RECORDS,
        factsheet::RECORDS,
        orders::RECORDS,
        checks::RECORDS,
        updates::RECORDS,
        cancellation::RECORDS,
        driving::RECORDS,
        running::RECORDS,
        pause::RECORDS,
        instants::RECORDS,
        poses::RECORDS,
        modes::RECORDS,
        telling::RECORDS,
        nature::RECORDS,
        manner::RECORDS,
    ];
    topics.into_iter().flatten()
}

fn find(name: &str) -> Option<&'static Record<dyn Deviation>> {
    records().find(|record| record.name == name)
}

/// Its faults and lapses.
pub static FAULTS: LazyLock<Vec<Fault>> = LazyLock::new(|| {
    let faults = records().filter(|record| record.is_fault());
    let faults = faults.map(|record| Fault {
        name: record.name,
        breaks: record.requirements,
        wrong: record.does,
    });
    faults.collect()
});

/// One switchable liberty of a reference device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tolerance {
    /// Name, in kebab-case, such as `every-state-twice`.
    pub name: &'static str,
    /// The requirements that leave it this liberty.
    pub under: &'static [&'static str],
    /// What it does, in one sentence about the vehicle.
    pub does: &'static str,
}

/// What it may do otherwise without breaking anything: with each, and with all that go together, no test may fail.
pub static TOLERANCES: LazyLock<Vec<Tolerance>> = LazyLock::new(|| {
    let liberties = records().filter(|record| record.is_liberty());
    let liberties = liberties.map(|record| Tolerance {
        name: record.name,
        under: record.requirements,
        does: record.does,
    });
    liberties.collect()
});

/// A name that is not in [`TOLERANCES`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference AGV has no tolerance `{0}`")]
pub struct UnknownTolerance(pub String);

impl AgvConfig {
    /// Lets the vehicle take a liberty.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let record = find(name).filter(|record| record.is_liberty());
        let record = record.ok_or_else(|| UnknownTolerance(name.to_owned()))?;
        if !self.switched_on.contains(&record.name) {
            (record.make)().configures(self);
            self.switched_on.push(record.name);
        }
        Ok(())
    }
}

/// Why a fault ends in less than a failure.
#[must_use]
pub fn lapse(name: &str) -> Option<&'static str> {
    match find(name).map(|record| record.kind) {
        Some(Kind::Lapse(why)) => Some(why),
        _ => None,
    }
}

/// A fault that is not in [`FAULTS`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference AGV has no fault `{0}`")]
pub struct UnknownFault(pub String);

/// A reference AGV with these faults, by name, and the liberties of its configuration; without any it keeps to the
/// standard.
///
/// # Errors
/// When there is no fault of a name.
pub fn built(config: AgvConfig, names: &[&str]) -> Result<Agv, UnknownFault> {
    let record = |name: &str| find(name).filter(|record| record.is_fault());
    if let Some(unknown) = names.iter().find(|name| record(name).is_none()) {
        return Err(UnknownFault((*unknown).to_owned()));
    }
    let liberties = config.switched_on.clone();
    let mut agv = Agv::new(config);
    for record in names.iter().copied().chain(liberties).filter_map(find) {
        agv.switch_on((record.make)());
    }
    agv.switch_on(super::personas::persona());
    Ok(agv)
}
