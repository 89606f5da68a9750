//! Tests that were run several times.

use tck_base::verdict::Verdict;
use tck_result::{RunResult, TestResult};

use super::clean::line;
use super::statement::many;

/// How often a test was run and what came out, such as `run 3 times: 2 pass, 1 fail (flaky)`, or `run 1 of 3 times: 1 pass`
/// when the others were not done; nothing of one that was to be run once.
#[must_use]
pub fn summary(test: &TestResult) -> Option<String> {
    let count = test.repetitions.len();
    if count == 0 {
        return None;
    }
    let counted = Verdict::ALL.map(|verdict| {
        let done = test.repetitions.iter().filter(|one| one.was_done());
        (done.filter(|one| one.verdict == Some(verdict)).count(), verdict)
    });
    let counted = counted.into_iter().filter(|(count, _)| *count > 0);
    let counted: Vec<String> = counted
        .map(|(count, verdict)| format!("{count} {}", verdict.word()))
        .collect();
    let flaky = if test.is_flaky() { " (flaky)" } else { "" };
    let times = match test.left_out() {
        0 => many(count, "time"),
        left_out => format!("{} of {}", count - left_out, many(count, "time")),
    };
    Some(format!("run {times}: {}{flaky}", counted.join(", ")))
}

/// The flaky tests of a run, a line each.
#[must_use]
pub fn flaky(result: &RunResult) -> Vec<String> {
    let flaky = result.tests.iter().filter(|test| test.is_flaky());
    let lines = flaky.filter_map(|test| Some(format!("{}  {}", line(&test.id), summary(test)?)));
    lines.collect()
}
