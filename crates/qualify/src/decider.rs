//! What decides a requirement, and what was decided in a result.

use std::fmt;

use serde::{Deserialize, Serialize};

use tck_base::verdict::Verdict;
use tck_judge::Library;
use tck_result::RunResult;
use tck_suite::Unproven;

/// A clause of a test, or a monitor, deciding one requirement.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Decider {
    /// Requirement id.
    pub requirement: String,
    /// Test id and clause, or monitor id.
    pub place: String,
}

impl fmt::Display for Decider {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} {}", self.requirement, self.place)
    }
}

impl Decider {
    /// Whether it is the one an exception is about.
    pub(super) fn is(&self, one: &Unproven) -> bool {
        one.requirement == self.requirement && one.place == self.place
    }
}

/// What was decided in a result, with its verdict.
#[must_use]
pub fn decided(result: &RunResult) -> Vec<(Decider, Verdict)> {
    let mut all = Vec::new();
    for test in &result.tests {
        for decision in &test.decisions {
            let decider = Decider {
                requirement: decision.requirement.clone(),
                place: format!("{} {}", test.id, decision.clause),
            };
            all.push((decider, decision.verdict()));
        }
    }
    for requirement in &result.requirements {
        for id in &requirement.decided_by {
            let Some(monitor) = result.monitors.iter().find(|monitor| monitor.id == *id) else {
                continue;
            };
            let findings = monitor
                .findings
                .iter()
                .filter(|finding| finding.requirement == requirement.id);
            let verdict = findings
                .map(|finding| finding.verdict)
                .fold(Verdict::Pass, Verdict::join);
            let decider = Decider {
                requirement: requirement.id.clone(),
                place: id.clone(),
            };
            all.push((decider, verdict));
        }
    }
    all
}

/// What was decided, the cases of a table that is drawn from counting as one: which of them are drawn is chance.
pub(super) fn decided_in(library: &Library, result: &RunResult) -> Vec<(Decider, Verdict)> {
    let tests = &library.rules.suites.tests;
    let fold = |mut decider: Decider| {
        let (id, clause) = decider.place.split_once(' ').unwrap_or((&decider.place, ""));
        let found = tests.binary_search_by(|test| test.id.as_str().cmp(id)).ok();
        if let Some(test) = found.map(|at| &tests[at]).filter(|test| test.drawn.is_some()) {
            decider.place = format!("{} {clause}", test.table());
        }
        decider
    };
    let all = decided(result).into_iter();
    all.map(|(decider, verdict)| (fold(decider), verdict)).collect()
}

/// What is not a pass.
pub(super) fn blemishes_of(result: &RunResult) -> Vec<(Decider, Verdict)> {
    let mut all: Vec<_> = decided(result)
        .into_iter()
        .filter(|(_, verdict)| *verdict != Verdict::Pass)
        .collect();
    let unjudged = result.tests.iter().filter(|test| test.decisions.is_empty());
    for test in unjudged.filter(|test| test.verdict.is_some_and(|verdict| verdict != Verdict::Pass)) {
        let decider = Decider {
            requirement: String::new(),
            place: test.id.clone(),
        };
        all.push((decider, Verdict::Error));
    }
    all
}
