//! What is wrong of a side, mistake by mistake: a finding that follows from no other one, with those that do.

use std::collections::BTreeSet;

use super::result::{AuditResult, CauseResult, FindingResult, SideResult};
use tck_pack::Catalogue;
use tck_report::cause::{Evidence, Sighting, Tie, causes};

/// One mistake: every requirement that it breaks.
#[derive(Clone, Debug, PartialEq)]
pub struct Mistake<'r> {
    /// The requirements.
    pub requirements: Vec<&'r str>,
    /// The worst of what was found of it.
    pub worst: &'r FindingResult,
    /// How often.
    pub count: u64,
    /// What follows from it.
    pub follows: Vec<&'r FindingResult>,
}

impl SideResult {
    /// What is wrong, mistake by mistake: what is found of one thing is one, whatever it breaks.
    #[must_use]
    pub fn mistakes(&self) -> Vec<Mistake<'_>> {
        // An audit that is not over has none, nor has one of an earlier version.
        let fresh;
        let causes: &[CauseResult] = if self.causes.is_empty() {
            fresh = causes_of(&self.findings, |_| Vec::new());
            &fresh
        } else {
            &self.causes
        };
        let all = causes.iter().filter_map(|cause| {
            let first = self.findings.get(cause.finding)?;
            let at = |numbers: &[usize]| -> Vec<&FindingResult> {
                numbers.iter().filter_map(|number| self.findings.get(*number)).collect()
            };
            let mut mistake = Mistake {
                requirements: vec![&first.requirement],
                worst: first,
                count: first.count,
                follows: at(&cause.follows),
            };
            for finding in at(&cause.same) {
                // The one that says most.
                let known = mistake.worst;
                if finding.verdict == known.verdict && finding.text.len() > known.text.len() {
                    mistake.worst = finding;
                }
                if !mistake.requirements.contains(&finding.requirement.as_str()) {
                    mistake.requirements.push(&finding.requirement);
                }
            }
            Some(mistake)
        });
        all.collect()
    }

    /// Finds out what follows from what, by what requirements rest on.
    fn trace(&mut self, catalogue: &Catalogue) {
        self.causes = causes_of(&self.findings, |id| {
            let known = catalogue.get(id).into_iter().flat_map(|known| &known.rests_on);
            known.map(ToString::to_string).collect()
        });
    }
}

impl AuditResult {
    /// Finds out of each side what follows from what.
    pub(super) fn trace(&mut self, catalogue: &Catalogue) {
        let sides = self.vehicles.iter_mut().flat_map(|vehicle| &mut vehicle.sides);
        sides.for_each(|side| side.trace(catalogue));
    }
}

/// The findings of a side that follow from no other one, with those that do.
fn causes_of(findings: &[FindingResult], rests_on: impl Fn(&str) -> Vec<String>) -> Vec<CauseResult> {
    let below: Vec<Vec<String>> = findings.iter().map(|finding| rests_on(&finding.requirement)).collect();
    let evidence: Vec<Evidence<'_>> = findings
        .iter()
        .zip(&below)
        .map(|(finding, below)| Evidence {
            requirement: &finding.requirement,
            verdict: Some(finding.verdict),
            count: finding.count,
            sightings: BTreeSet::from([Sighting {
                by: finding.monitor.clone(),
                message: Some(finding.message),
                text: finding.text.clone(),
            }]),
            first: Some(finding.message),
            rests_on: below.iter().map(String::as_str).collect(),
            ..Evidence::default()
        })
        .collect();
    let found = causes(&evidence);
    let own = found.iter().enumerate().filter(|(_, cause)| cause.is_none());
    own.map(|(at, _)| {
        let of = |tie: Tie| {
            let all = found.iter().enumerate();
            let tied = all.filter(|(_, cause)| cause.is_some_and(|cause| cause.finding == at && cause.tie == tie));
            tied.map(|(number, _)| number).collect()
        };
        CauseResult {
            finding: at,
            same: of(Tie::Same),
            follows: of(Tie::Rests),
        }
    })
    .collect()
}
