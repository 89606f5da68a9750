//! Sets aside, as one group, the tests behind a precondition that several tests did not reach.

use std::collections::BTreeMap;

use tck_journal::Reason;
use tck_suite::model::{Section, Test};

/// How many tests in a row may fail at the same place.
const STRIKES: usize = 3;

/// Preconditions that were not reached, by the place in the suites where they are written.
#[derive(Debug, Default)]
pub(super) struct PreconditionBreaker(BTreeMap<String, Vec<String>>);

impl PreconditionBreaker {
    /// A test has reached its preconditions: so have those with the same.
    pub(super) fn reached(&mut self, test: &Test) {
        for place in places(test) {
            self.0.remove(&place);
        }
    }

    /// A test has not reached this one.
    pub(super) fn missed(&mut self, test: &Test, place: &str) {
        self.0.entry(place.to_owned()).or_default().push(test.id.clone());
    }

    /// Whether a restart may still help: it has not helped here twice.
    pub(super) fn is_worth_a_restart(&self, place: &str) -> bool {
        self.0.get(place).is_none_or(|missed| missed.len() < STRIKES - 1)
    }

    /// Why a test is set aside, if it is.
    pub(super) fn against(&self, test: &Test) -> Option<Reason> {
        let mut own = places(test).filter_map(|place| self.0.get(&place).map(|missed| (place, missed)));
        let (place, missed) = own.find(|(_, missed)| missed.len() >= STRIKES)?;
        Some(Reason::SetAside {
            place,
            tests: missed.clone(),
        })
    }
}

fn places(test: &Test) -> impl Iterator<Item = String> {
    let sections = test
        .sections()
        .into_iter()
        .filter(|(section, _)| *section == Section::Given);
    let steps: Vec<String> = sections
        .flat_map(|(_, steps)| steps)
        .map(|step| step.span.place())
        .collect();
    steps.into_iter()
}
