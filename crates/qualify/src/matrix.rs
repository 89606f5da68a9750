//! The kill matrix as text: per fault what it fails, then what is unproven.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::outcome::Qualification;
use tck_base::verdict::Verdict;

impl Qualification {
    /// The matrix as text. A star marks the requirements that the fault names.
    #[must_use]
    pub fn matrix(&self) -> String {
        let mut text = String::new();
        for kill in &self.kills {
            let verdict = kill.verdict.map_or("nothing", Verdict::word);
            let _ = writeln!(text, "{} ({verdict})", kill.fault.name);
            let mut by_requirement: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
            for decider in kill.deciders.keys() {
                let places = by_requirement.entry(&decider.requirement).or_default();
                places.push(&decider.place);
            }
            for (requirement, places) in by_requirement {
                let mark = if kill.fault.breaks.contains(&requirement) {
                    '*'
                } else {
                    ' '
                };
                let _ = writeln!(text, "  {mark} {requirement:<14} {}", places.join(", "));
            }
        }
        for decider in self.unproven() {
            let why = self.excuse(decider).unwrap_or("No reason is given.");
            let _ = writeln!(text, "unproven: {decider}\n  {why}");
        }
        for one in &self.exceptions.unfound {
            let _ = writeln!(text, "not found: {}\n  {}", one.fault, one.why);
        }
        text
    }
}
