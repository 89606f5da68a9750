//! What tests and monitors say about one requirement, put together.

use std::collections::BTreeMap;

use tck_base::verdict::{Accumulated, Verdict};
use tck_result::Given;

/// What tests and monitors say about one requirement.
#[derive(Default)]
pub(super) struct RequirementVerdict {
    /// Of those that ran.
    run: Accumulated,
    /// Of tests that were set aside before they began: for a hook that is missing, or motion that is not permitted.
    aside: Accumulated,
    pub by: Vec<String>,
    given: BTreeMap<Verdict, Vec<String>>,
}

impl RequirementVerdict {
    pub fn add(&mut self, verdict: Verdict, by: &str, ran: bool) {
        if ran {
            self.run.add(verdict);
        } else {
            self.aside.add(verdict);
        }
        let given = self.given.entry(verdict).or_default();
        for list in [&mut self.by, given] {
            if !list.iter().any(|known| known == by) {
                list.push(by.to_owned());
            }
        }
    }

    /// What could not be tried does not make undecided what was decided.
    pub fn verdict(&self) -> Option<Verdict> {
        self.run.get().or(self.aside.get())
    }

    /// All of them, the worst first; nothing where they agree.
    pub fn verdicts(&self) -> Vec<Given> {
        if self.given.len() < 2 {
            return Vec::new();
        }
        let given = self.given.iter().rev().map(|(verdict, by)| Given {
            verdict: *verdict,
            by: by.clone(),
        });
        given.collect()
    }
}
