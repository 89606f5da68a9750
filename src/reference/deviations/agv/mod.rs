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
mod connection;
mod errors;
mod factsheet;
mod header;
mod hooks;
mod maps;
mod motion;
mod reading;
mod refusals;
mod route;
mod sending;
mod state;
mod stations;
#[cfg(test)]
mod tests;
mod visualization;

use std::sync::LazyLock;

use super::record::{Kind, Record};
use crate::reference::Fault;
use crate::reference::agv::faults as switches;
use crate::reference::agv::seam::Deviation;
use crate::reference::agv::{Agv, AgvConfig, UnknownFault};

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
    ];
    topics.into_iter().flatten()
}

fn find(name: &str) -> Option<&'static Record<dyn Deviation>> {
    records().find(|record| record.name == name)
}

/// Written by somebody who has not seen the suites; they need not be found yet.
fn is_blind(name: &str) -> bool {
    name.as_bytes().first() == Some(&b'r') && name.as_bytes().get(2) == Some(&b'-')
}

fn faults(blind: bool) -> impl Iterator<Item = Fault> {
    let some = records().filter(move |record| record.is_fault() && is_blind(record.name) == blind);
    some.map(|record| Fault {
        name: record.name,
        breaks: record.requirements,
        wrong: record.does,
    })
}

/// Its faults and lapses.
pub static FAULTS: LazyLock<Vec<Fault>> =
    LazyLock::new(|| faults(false).chain(switches::FAULTS.iter().copied()).collect());

/// Its faults of blind rounds, which the suites need not find yet.
pub static BLIND_FAULTS: LazyLock<Vec<Fault>> =
    LazyLock::new(|| faults(true).chain(switches::BLIND_FAULTS.iter().copied()).collect());

/// Why a fault ends in less than a failure.
#[must_use]
pub fn lapse(name: &str) -> Option<&'static str> {
    match find(name).map(|record| record.kind) {
        Some(Kind::Lapse(why)) => Some(why),
        _ => crate::reference::agv::lapse(name),
    }
}

/// A reference AGV with these faults, by name; without any it keeps to the standard.
///
/// # Errors
/// When there is none of a name.
pub fn built(config: AgvConfig, names: &[&str]) -> Result<Agv, UnknownFault> {
    let (moved, others): (Vec<&str>, Vec<&str>) = names.iter().partition(|name| find(name).is_some());
    let mut agv = Agv::new(config, &others)?;
    for record in moved.into_iter().filter_map(find) {
        agv.switch_on((record.make)());
    }
    Ok(agv)
}
