//! How long a run will still take, and whether there is time for a test.

use std::time::Duration;

use super::estimate::{self, Estimate, Outlook};
use super::session::Session;
use tck_base::clock::Moment;
use tck_engine::Operator;
use tck_journal::Reason;
use tck_journal::event::{Gate, Plan};
use tck_net::link::Link;

impl<L: Link, O: Operator> Session<'_, L, O> {
    /// Estimates how long the run will take, and says so; in virtual time it is over before that is read.
    pub(super) fn estimate(&mut self, plan: &Plan) {
        let is_virtual = self.engine.operator.runs_on_the_link();
        if is_virtual && self.setup.budget.is_none() {
            return;
        }
        let times = self.engine.recorder.judge().ground().bindings.get("time");
        let estimate = Estimate::of(
            times,
            self.setup.capabilities.factsheet.as_deref(),
            self.setup.layout.as_ref(),
            self.engine.operator.usual_time(),
        );
        let planned = self.setup.tests.iter().zip(&plan.tests);
        let each = planned.map(|(test, planned)| match planned.gate {
            Gate::Runs => Some(estimate.of_tests(std::iter::once(&**test))),
            _ => None,
        });
        let each: Vec<Option<Duration>> = each.collect();
        let runs = u32::try_from(each.iter().flatten().count()).unwrap_or(u32::MAX);
        let planned = each.iter().flatten().sum::<Duration>() * self.setup.repeat;
        self.outlook = Outlook::of(planned, runs * self.setup.repeat);
        self.estimates = each.into_iter().map(Option::unwrap_or_default).collect();
        if is_virtual {
            return;
        }
        self.progress.note(&format!(
            "estimated time: {} (more if the device is slow)",
            estimate::in_words(self.outlook.left())
        ));
    }

    /// Why there is no time any more for the test at this place of the plan.
    pub(super) fn over_budget(&self, at: usize, run_begun: Moment) -> Option<Reason> {
        let budget = self.setup.budget?;
        let spent = self.engine.link.now().moment.since(run_begun);
        let planned = self.estimates.get(at).copied().unwrap_or_default();
        (spent + self.outlook.of_one(planned) > budget).then_some(Reason::OverBudget {
            budget: budget.as_secs(),
        })
    }

    /// Says how much of the run is left, once a test is over that was begun then.
    pub(super) fn tell_left(&mut self, at: usize, begun: Moment) {
        if let Some(planned) = self.estimates.get(at) {
            let took = self.engine.link.now().moment.since(begun);
            self.outlook.is_over(*planned, took);
            self.progress.left(self.outlook.left());
        }
    }
}
