//! What is left of a verdict when failures are taken out that a pipeline knows.
//!
//! It changes no verdict: it says whether anything failed that is not known, for the exit code.

use super::findings::PROGRAM;
use tck_base::verdict::Verdict;
use tck_profile::KnownFailure;
use tck_result::{MonitorFinding, RunResult, TestResult};

/// A run, measured by a list of known failures.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Measured {
    /// The verdict without what is known; nothing when everything was.
    pub rest: Option<Verdict>,
    /// The entries that met a failure.
    pub met: Vec<String>,
    /// The entries that met none: they can be taken out.
    pub unmet: Vec<String>,
    /// The entries whose end has passed: they bear nothing any more.
    pub expired: Vec<String>,
    /// Failures that no entry bears: requirement, and test or monitor.
    pub others: Vec<(String, String)>,
}

/// Measures a run by a list. What else could not be decided in a test whose failures are all known follows from them;
/// any other test that is inconclusive or an error stays so. A test that is known bears what monitors find of the same requirement
/// while it runs, too.
#[must_use]
pub fn measure(result: &RunResult, known: &[KnownFailure]) -> Measured {
    let today = result.started.get(..10).unwrap_or_default();
    let (valid, expired): (Vec<&KnownFailure>, Vec<&KnownFailure>) =
        known.iter().partition(|known| known.until.as_str() >= today);
    let mut measured = Measured {
        expired: expired.iter().map(|known| known.id.clone()).collect(),
        ..Measured::default()
    };
    let mut met = vec![false; valid.len()];
    let mut bears = |requirement: &str, by: &str| {
        let mut borne = false;
        for (at, known) in valid.iter().enumerate() {
            if known.id == requirement || known.id == by {
                met[at] = true;
                borne = true;
            }
        }
        borne
    };
    let join = |rest: Option<Verdict>, verdict: Verdict| Some(rest.map_or(verdict, |rest| rest.join(verdict)));
    for test in &result.tests {
        let Some(verdict) = test.verdict else { continue };
        let mut left = verdict;
        if verdict == Verdict::Fail {
            let fails = test
                .decisions
                .iter()
                .filter(|decision| decision.verdict() == Verdict::Fail);
            let (mut all, mut any) = (true, false);
            for decision in fails {
                any = true;
                if !bears(&decision.requirement, &test.id) {
                    all = false;
                    measured.others.push((decision.requirement.clone(), test.id.clone()));
                }
            }
            if any && all {
                // What was asked for and not done is not borne.
                left = if test.left_out() == 0 {
                    Verdict::Pass
                } else {
                    Verdict::Inconclusive
                };
            }
        }
        measured.rest = join(measured.rest, left);
    }
    for monitor in &result.monitors {
        let Some(verdict) = monitor.verdict else { continue };
        let mut left = Verdict::Pass;
        for finding in &monitor.findings {
            let mut borne = || bears(&finding.requirement, &monitor.id) || follows(finding, result, &valid);
            if finding.verdict == Verdict::Fail && borne() {
                continue;
            }
            if finding.verdict == Verdict::Fail {
                measured.others.push((finding.requirement.clone(), monitor.id.clone()));
            }
            left = left.join(finding.verdict);
        }
        if monitor.findings.is_empty() {
            left = verdict;
        }
        measured.rest = join(measured.rest, left);
    }
    // No list bears a program that ends by itself, or doubt about who was judged.
    if let Some(verdict) = result.aside() {
        if verdict == Verdict::Fail {
            let by = "the program that was started".to_owned();
            measured.others.push((PROGRAM.to_owned(), by));
        }
        measured.rest = join(measured.rest, verdict);
    }
    for (known, met) in valid.iter().zip(met) {
        let list = if met { &mut measured.met } else { &mut measured.unmet };
        list.push(known.id.clone());
    }
    measured
}

/// Whether a monitor has found no more than what a known test failed for: the same requirement, at messages of that test alone.
fn follows(finding: &MonitorFinding, result: &RunResult, known: &[&KnownFailure]) -> bool {
    let fails = |test: &&TestResult| {
        let decided = test.decisions.iter();
        let failed = decided.filter(|decision| decision.verdict() == Verdict::Fail);
        known.iter().any(|known| known.id == test.id)
            && failed
                .into_iter()
                .any(|decision| decision.requirement == finding.requirement)
    };
    let tests: Vec<&TestResult> = result.tests.iter().filter(fails).collect();
    let within = |number: &u64| {
        let spans = tests.iter().filter_map(|test| test.journal);
        spans.into_iter().any(|(first, last)| (first..=last).contains(number))
    };
    // Of what happened often, only the first places are kept.
    finding.count == finding.first.len() as u64 && finding.first.iter().all(within)
}

impl Measured {
    /// What there is to say about it, a line each.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        let mut say = |what: &str, ids: &[String]| {
            if !ids.is_empty() {
                let ids: Vec<&str> = ids.iter().map(String::as_str).collect();
                text.push_str(&format!("{what}: {}\n", super::clean::line(&ids.join(", "))));
            }
        };
        say("known failures, borne by [known]", &self.met);
        let others: Vec<String> = self.others.iter().map(|(id, by)| format!("{id} in {by}")).collect();
        say("failures that are not known", &others);
        say("[known] lists what did not fail, take it out", &self.unmet);
        say("[known] lists what has expired", &self.expired);
        text
    }
}
