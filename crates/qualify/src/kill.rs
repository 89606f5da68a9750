//! What one fault fails, and how a run with it is made.

use std::collections::{BTreeMap, BTreeSet};

use super::decider::{Decider, decided_in};
use super::parallel::on_all_cores;
use tck_base::verdict::Verdict;
use tck_engine::EngineError;
use tck_judge::Library;
use tck_pack::Pack;
use tck_reference::Fault;
use tck_run::{Selection, VirtualRun, run_silently};
use tck_suite::model::Test;

/// What one fault did.
#[derive(Clone, Debug)]
pub struct Kill {
    /// The fault.
    pub fault: Fault,
    /// What failed or warned because of it, in the tests that were tried.
    pub deciders: BTreeMap<Decider, Verdict>,
    /// The worst verdict of the runs.
    pub verdict: Option<Verdict>,
}

impl Kill {
    pub(super) fn nothing(fault: &Fault) -> Self {
        Self {
            fault: *fault,
            deciders: BTreeMap::new(),
            verdict: None,
        }
    }

    /// The worst that was reported about a requirement the fault names.
    #[must_use]
    pub fn named(&self) -> Option<Verdict> {
        let own = self.deciders.iter();
        let own = own.filter(|(decider, _)| self.fault.breaks.contains(&decider.requirement.as_str()));
        own.map(|(_, verdict)| *verdict).reduce(Verdict::join)
    }

    /// The requirements that failed or warned.
    pub(super) fn requirements(&self) -> BTreeSet<&str> {
        self.deciders
            .keys()
            .map(|decider| decider.requirement.as_str())
            .collect()
    }

    fn report(&mut self, decider: Decider, verdict: Verdict) {
        let kept = self.deciders.entry(decider).or_insert(verdict);
        *kept = kept.join(verdict);
    }

    /// Adds what more was found with the same fault.
    pub fn join(&mut self, other: Self) {
        for (decider, verdict) in other.deciders {
            self.report(decider, verdict);
        }
        self.verdict = self.verdict.max(other.verdict);
    }
}

/// A device that faults are tried on.
pub(super) struct Vehicle {
    /// Everything on the usual one; on another one only the tests that do not run on those before it.
    pub(super) request: VirtualRun,
    /// What is decided on none before it.
    pub(super) requirements: BTreeSet<String>,
}

/// What there is to try faults on.
pub(super) struct KillContext<'g> {
    pub(super) library: &'g Library,
    pub(super) pack: &'g Pack,
    pub(super) vehicles: Vec<Vehicle>,
}

impl KillContext<'_> {
    /// All tests, those of one table counting once, in their order.
    pub(super) fn tables(&self) -> Vec<&str> {
        let mut seen = BTreeSet::new();
        let tests = self.vehicles.iter().flat_map(|vehicle| &vehicle.request.tests);
        tests
            .map(|test| test.table())
            .filter(|table| seen.insert(*table))
            .collect()
    }

    /// The first test of each folder.
    pub(super) fn one_of_each_folder(&self) -> BTreeSet<&str> {
        let folder = |table: &str| table.split('/').next().map(str::to_owned);
        let mut seen = BTreeSet::new();
        let tables = self.tables().into_iter();
        tables.filter(|table| seen.insert(folder(table))).collect()
    }

    /// Runs these tests with a fault: on the usual device, and on the others where they alone decide what the fault
    /// breaks. `draw` is how much is taken of tables that are drawn from; all of it unless said.
    ///
    /// # Errors
    /// When a run cannot be carried out.
    pub(super) fn kill(
        &self,
        fault: &Fault,
        draw: Option<u64>,
        selected: &dyn Fn(&Test) -> bool,
    ) -> Result<Kill, EngineError> {
        let mut kill = Kill::nothing(fault);
        for (at, vehicle) in self.vehicles.iter().enumerate() {
            let concerned = fault.breaks.iter().any(|id| vehicle.requirements.contains(*id));
            let tests: Vec<_> = vehicle
                .request
                .tests
                .iter()
                .filter(|test| selected(test))
                .cloned()
                .collect();
            if tests.is_empty() || (at > 0 && !concerned) {
                continue;
            }
            let request = VirtualRun {
                tests: Selection::some(tests),
                draw,
                faults: vec![fault.name.to_owned()],
                ..vehicle.request.clone()
            };
            let finished = run_silently(self.library, self.pack, request)?;
            for (decider, verdict) in decided_in(self.library, &finished.result) {
                if matches!(verdict, Verdict::Fail | Verdict::Warning) {
                    kill.report(decider, verdict);
                }
            }
            kill.verdict = kill.verdict.max(finished.result.verdict);
        }
        Ok(kill)
    }
}

/// Whether a test decides something the fault breaks.
pub(super) fn concerns(fault: &Fault, test: &Test) -> bool {
    test.requirements().iter().any(|id| fault.breaks.contains(&id.as_str()))
}

/// Tries every fault, on all cores; in their order.
pub(super) fn each(
    faults: &[Fault],
    attempt: impl Fn(&Fault) -> Result<Kill, EngineError> + Sync,
) -> Result<Vec<Kill>, EngineError> {
    on_all_cores(faults, attempt).into_iter().collect()
}

/// Adds what more was found with the same faults.
pub(super) fn merge(kills: &mut [Kill], more: Vec<Kill>) {
    for other in more {
        if let Some(kill) = kills.iter_mut().find(|kill| kill.fault == other.fault) {
            kill.join(other);
        }
    }
}
