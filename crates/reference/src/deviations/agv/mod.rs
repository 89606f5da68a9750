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
mod config_variants;
mod connection;
mod driving;
mod errors;
mod factsheet;
mod format_variants;
mod header;
mod instants;
mod life;
mod maps;
mod modes;
mod motion;
mod orders;
mod paths;
mod pause;
mod poses;
mod predefined;
mod prelude;
mod reading;
mod refusals;
mod release;
mod replanning;
mod requests;
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
mod zone_sets;
mod zones;

use std::sync::LazyLock;

use super::record::Records;
use crate::Fault;
use crate::agv::hooks::Deviation;
use crate::agv::{Agv, AgvConfig};

pub use crate::Tolerance;

/// All records.
const RECORDS: Records<dyn Deviation> = Records(&[
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
    predefined::RECORDS,
    stations::RECORDS,
    maps::RECORDS,
    zone_sets::RECORDS,
    zones::RECORDS,
    visualization::RECORDS,
    factsheet::RECORDS,
    orders::RECORDS,
    checks::RECORDS,
    updates::RECORDS,
    cancellation::RECORDS,
    driving::RECORDS,
    requests::RECORDS,
    release::RECORDS,
    replanning::RECORDS,
    running::RECORDS,
    pause::RECORDS,
    instants::RECORDS,
    life::RECORDS,
    paths::RECORDS,
    poses::RECORDS,
    modes::RECORDS,
    telling::RECORDS,
    config_variants::RECORDS,
    format_variants::RECORDS,
]);

/// Its faults and lapses.
pub static FAULTS: LazyLock<Vec<Fault>> = LazyLock::new(|| RECORDS.faults());

/// Its tolerances, which break nothing: with each, and with all that go together, no test may fail.
pub static TOLERANCES: LazyLock<Vec<Tolerance>> = LazyLock::new(|| RECORDS.tolerances());

/// A name that is not in [`TOLERANCES`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference AGV has no tolerance `{0}`")]
pub struct UnknownTolerance(pub String);

impl AgvConfig {
    /// Switches a tolerance on.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownTolerance> {
        let record = RECORDS.tolerance(name);
        let record = record.ok_or_else(|| UnknownTolerance(name.to_owned()))?;
        if !self.switched_on.contains(&record.name) {
            (record.make)().configures(self);
            self.switched_on.push(record.name);
        }
        Ok(())
    }
}

/// The reason why a fault ends in less than a failure.
#[must_use]
pub fn lapse(name: &str) -> Option<&'static str> {
    RECORDS.lapse(name)
}

/// A fault that is not in [`FAULTS`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference AGV has no fault `{0}`")]
pub struct UnknownFault(pub String);

/// A reference AGV with these faults, by name, and the tolerances of its configuration; without any it keeps to the
/// standard.
///
/// # Errors
/// When there is no fault of a name.
pub fn built(config: AgvConfig, names: &[&str]) -> Result<Agv, UnknownFault> {
    if let Some(unknown) = names.iter().find(|name| RECORDS.fault(name).is_none()) {
        return Err(UnknownFault((*unknown).to_owned()));
    }
    Ok(with(config, names))
}

/// A vehicle that can be told how to behave, with the tolerances of its configuration.
#[must_use]
pub fn mock(config: AgvConfig) -> Agv {
    with(config, &[])
}

/// A reference AGV with these faults, as far as they are known.
fn with(config: AgvConfig, faults: &[&str]) -> Agv {
    let tolerances = config.switched_on.clone();
    let mut agv = Agv::new(config);
    let names = faults.iter().copied().chain(tolerances);
    for record in names.filter_map(|name| RECORDS.find(name)) {
        agv.switch_on((record.make)());
    }
    agv.switch_on(super::personas::persona());
    agv
}
