//! Results of vehicles whose time was cut: several of one vehicle, and what is lost by that.

use std::collections::BTreeSet;

use super::result::{AuditResult, VehicleResult};
use super::time_stretch::TimeStretch;

impl VehicleResult {
    /// Its serial number, with the stretch of time where time was cut.
    #[must_use]
    pub fn called(&self) -> String {
        let serial = &self.serial_number;
        match &self.stretch {
            None => serial.clone(),
            Some(TimeStretch { number, from: None }) => format!("{serial} (stretch {number})"),
            Some(TimeStretch {
                number,
                from: Some(from),
            }) => format!("{serial} (stretch {number}, from {from})"),
        }
    }

    /// Where it comes among results: by its topics, and then by time.
    pub(super) fn in_order(&self) -> (&str, u64) {
        (&self.topics, self.stretch.as_ref().map_or(0, |stretch| stretch.number))
    }
}

impl AuditResult {
    /// How often the time of a vehicle was cut before what was judged here; `None` where no time was cut.
    #[must_use]
    pub fn cuts(&self) -> Option<usize> {
        let stretches = || self.vehicles.iter().filter_map(|vehicle| vehicle.stretch.as_ref());
        stretches().next()?;
        Some(stretches().filter(|stretch| stretch.number > 1).count())
    }

    /// How many vehicles there are, each once however often its time was cut; one that changed its version counts as it always did.
    #[must_use]
    pub fn count_vehicles(&self) -> usize {
        let (cut, whole): (Vec<&VehicleResult>, Vec<&VehicleResult>) =
            self.vehicles.iter().partition(|vehicle| vehicle.stretch.is_some());
        let cut: BTreeSet<&str> = cut.into_iter().map(|vehicle| vehicle.topics.as_str()).collect();
        whole.len() + cut.len()
    }
}

/// What is not known because time was cut so often.
pub(super) fn lost(cuts: usize) -> String {
    format!(
        "Time was cut {cuts} times where a vehicle was at rest (--cut), and each stretch was judged by itself: what goes on over a \
         cut, such as counts, the time between two states and errors that last, was not judged there, and neither were messages on \
         misspelled topics."
    )
}
