//! What a master control can do otherwise: records by topic, and a reference master control that has some of them.

#![allow(
    clippy::case_sensitive_file_extension_comparisons,
    clippy::collapsible_if,
    clippy::ignored_unit_patterns,
    clippy::manual_is_variant_and,
    clippy::needless_for_each,
    clippy::nonminimal_bool,
    clippy::redundant_closure,
    clippy::redundant_closure_for_method_calls,
    clippy::ref_option,
    clippy::semicolon_if_nothing_returned,
    clippy::trivially_copy_pass_by_ref,
    clippy::type_complexity,
    clippy::unnecessary_box_returns,
    reason = "records are short closures of a few given shapes"
)]

mod actions;
mod base;
mod cancellation;
mod curves;
mod declining;
mod dispatch;
mod form;
mod header;
mod instants;
mod later;
mod limits;
mod maps;
mod options;
mod orders;
mod prelude;
mod presence;
mod reading;
mod requests;
mod sending;
mod starts;
#[cfg(test)]
mod tests;
mod traffic;
mod transport;
mod updates;
mod zones;

use std::sync::LazyLock;

use serde_json::Value;

use super::record::Records;
use crate::master_control::hooks::Deviation;
use crate::master_control::{MasterControl, MasterControlConfig};
use crate::{Fault, Tolerance};

/// A name that is not that of a deviation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the reference master control has no {kind} `{name}`")]
pub struct Unknown {
    /// Fault or tolerance.
    pub kind: &'static str,
    /// The name.
    pub name: String,
}

/// All records.
const RECORDS: Records<dyn Deviation> = Records(&[
    transport::RECORDS,
    header::RECORDS,
    form::RECORDS,
    orders::RECORDS,
    curves::RECORDS,
    options::RECORDS,
    limits::RECORDS,
    starts::RECORDS,
    dispatch::RECORDS,
    base::RECORDS,
    updates::RECORDS,
    traffic::RECORDS,
    sending::RECORDS,
    cancellation::RECORDS,
    actions::RECORDS,
    instants::RECORDS,
    maps::RECORDS,
    presence::RECORDS,
    reading::RECORDS,
    declining::RECORDS,
    later::RECORDS,
    zones::RECORDS,
    requests::RECORDS,
]);

/// Its faults and lapses.
pub static FAULTS: LazyLock<Vec<Fault>> = LazyLock::new(|| RECORDS.faults());

/// Its tolerances.
pub static TOLERANCES: LazyLock<Vec<Tolerance>> = LazyLock::new(|| RECORDS.tolerances());

/// The reason why a fault ends in less than a failure.
#[must_use]
pub fn lapse(name: &str) -> Option<&'static str> {
    RECORDS.lapse(name)
}

/// Prepares a configuration for a tolerance, and adds its name to those that are to be switched on.
///
/// # Errors
/// When there is none of that name.
pub fn tolerate(
    config: &mut MasterControlConfig,
    tolerances: &mut Vec<&'static str>,
    name: &str,
) -> Result<(), Unknown> {
    let record = RECORDS.tolerance(name).ok_or_else(|| unknown("tolerance", name))?;
    (record.make)().configures(config);
    tolerances.push(record.name);
    Ok(())
}

fn unknown(kind: &'static str, name: &str) -> Unknown {
    let name = name.to_owned();
    Unknown { kind, name }
}

/// A reference master control with these faults and tolerances, by name; without any it keeps to the standard.
///
/// # Errors
/// When there is none of a name.
pub fn built(config: MasterControlConfig, tolerances: &[&str], faults: &[&str]) -> Result<MasterControl, Unknown> {
    let mut deviations = vec![configurable()];
    for name in faults {
        deviations.push((RECORDS.fault(name).ok_or_else(|| unknown("fault", name))?.make)());
    }
    for name in tolerances {
        deviations.push((RECORDS
            .tolerance(name)
            .ok_or_else(|| unknown("tolerance", name))?
            .make)());
    }
    Ok(MasterControl::with(config, deviations))
}

/// Switches tolerances on while it runs, when somebody asks for that: `configure` with the name of one as `what`.
fn configurable() -> Box<dyn Deviation> {
    prelude::plain().commanded(|(), site, _, command, arguments| {
        if command != "configure" {
            return true;
        }
        // What it has no setting for leaves it as it is.
        let what = arguments.get("what").and_then(Value::as_str).unwrap_or_default();
        if let Some(record) = RECORDS.tolerance(what) {
            site.switch_on((record.make)());
        }
        false
    })
}
