//! The pictures of courses on the page: of failed tests in which a vehicle moved, and of what monitors found while one did.

use super::messages::Gallery;
use crate::clean;
use crate::course::{self, Finding};
use crate::statement::test_verdict;
use tck_base::verdict::Verdict;
use tck_journal::Journal;
use tck_result::{Decision, RunResult, TestResult};

/// How many pictures a page has at most.
const PICTURES: usize = 40;
/// How many of them are of monitors.
const OF_MONITORS: usize = 12;
/// Most bytes of pictures in a page.
const BYTES: usize = 800_000;
/// How long the sentence of a finding may be beside its picture, in characters.
const SENTENCE: usize = 200;

/// The pictures of a page, counted.
#[derive(Default)]
pub struct Courses {
    drawn: usize,
    bytes: usize,
}

impl Courses {
    /// The picture of a failed test; `None` where it did not fail, no vehicle moved, or the page has too many already.
    pub fn of_test(
        &mut self,
        at: usize,
        test: &TestResult,
        gallery: &Gallery<'_>,
    ) -> Result<Option<String>, askama::Error> {
        let (Some(journal), Some(window), Some(Verdict::Fail)) = (gallery.journal(), test.journal, test_verdict(test))
        else {
            return Ok(None);
        };
        let mut broken: Vec<&Decision> = test.findings().filter(|decision| told(decision.verdict())).collect();
        // A stable order: of two equal verdicts the first stays the first.
        broken.sort_by_key(|decision| std::cmp::Reverse(decision.verdict()));
        let findings = broken.into_iter().map(|decision| Finding {
            number: when(test, window, decision),
            what: sentence(&decision.requirement, decision.verdict(), &decision.message),
        });
        let title = format!("Where the vehicle was during {}", clean::line(&test.id));
        let id = format!("course{}", at + 1);
        let findings: Vec<Finding> = findings.collect();
        self.draw(journal, window, &findings, (id.as_str(), title.as_str()), gallery)
    }

    /// The pictures of what monitors found first: what was broken, by which monitor, and the picture. Of what is no failure, was
    /// during no test, or while no vehicle moved, there is none.
    pub fn of_monitors(
        &mut self,
        result: &RunResult,
        gallery: &Gallery<'_>,
    ) -> Result<Vec<(String, String, String)>, askama::Error> {
        let mut all = Vec::new();
        let Some(journal) = gallery.journal() else {
            return Ok(all);
        };
        for monitor in &result.monitors {
            for finding in monitor.findings.iter().filter(|one| one.verdict == Verdict::Fail) {
                if all.len() >= OF_MONITORS {
                    return Ok(all);
                }
                let mut windows = result.tests.iter().filter_map(|test| test.journal);
                let Some((number, window)) = finding.first.first().and_then(|number| {
                    let window = windows.find(|(first, last)| (*first..=*last).contains(number))?;
                    Some((*number, window))
                }) else {
                    continue;
                };
                let found = Finding {
                    number,
                    what: sentence(&finding.requirement, finding.verdict, &finding.message),
                };
                let title = format!("Where the vehicle was at {}", clean::line(&finding.requirement));
                let id = format!("course-of-monitor{}", all.len() + 1);
                if let Some(figure) = self.draw(journal, window, &[found], (id.as_str(), title.as_str()), gallery)? {
                    all.push((finding.requirement.clone(), monitor.id.clone(), figure));
                }
            }
        }
        Ok(all)
    }

    fn draw(
        &mut self,
        journal: &Journal,
        window: (u64, u64),
        findings: &[Finding],
        (id, title): (&str, &str),
        gallery: &Gallery<'_>,
    ) -> Result<Option<String>, askama::Error> {
        if self.drawn >= PICTURES || self.bytes >= BYTES {
            return Ok(None);
        }
        let Some(picture) = course::in_window(journal, window, findings) else {
            return Ok(None);
        };
        let figure = picture.figure(id, title, |seq| gallery.shows(seq))?;
        self.drawn += 1;
        self.bytes += figure.len();
        Ok(Some(figure))
    }
}

/// Whether the picture says where it was.
fn told(verdict: Verdict) -> bool {
    matches!(verdict, Verdict::Fail | Verdict::Warning)
}

/// The message at which it was found; where none came, the last one before the wait was over.
fn when(test: &TestResult, (_, last): (u64, u64), decision: &Decision) -> u64 {
    let of_step = |path: &str| {
        let rest = decision.clause.strip_prefix(path);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    let step = test.steps.iter().find(|step| of_step(&step.path));
    let over = step.and_then(|step| step.journal).map(|(_, end)| end);
    decision.witness.or(over).unwrap_or(last)
}

fn sentence(requirement: &str, verdict: Verdict, message: &str) -> String {
    let text = format!("{requirement} {}: {message}", verdict.word());
    clean::short(&clean::line(&text), SENTENCE).into_owned()
}
