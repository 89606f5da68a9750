//! The run as a strip (SVG): a field for each test, as long as the test took, in the order they ran.

use askama::Template;

use super::Anchors;
use super::view::Badge;
use crate::clean;
use crate::statement::{many, seconds, test_verdict};
use tck_base::verdict::Verdict;
use tck_journal::Journal;
use tck_result::{RunResult, TestResult};

const WIDTH: f64 = 1_000.0;
/// Room for the labels of the first and the last mark.
const MARGIN: f64 = 24.0;

#[derive(Template)]
#[template(path = "report/timeline.svg", escape = "html")]
struct Strip {
    description: String,
    fields: Vec<Field>,
    marks: Vec<(String, String)>,
}

struct Field {
    link: String,
    label: String,
    class: &'static str,
    /// Findings stand out of the strip.
    tall: bool,
    x: String,
    width: String,
}

/// The strip of a run; nothing when no test ran.
///
/// # Errors
/// When the template cannot be written; it has no reason to.
pub fn strip(result: &RunResult, anchors: &Anchors, journal: Option<&Journal>) -> Result<String, askama::Error> {
    let ran = result.tests.iter().filter(|test| test.journal.is_some());
    let mut clock = 0.0;
    let spans: Vec<(f64, &TestResult)> = ran
        .map(|test| {
            let begun = begun(test, journal).unwrap_or(clock);
            clock = begun + test.seconds.clamp(0.0, 1e6);
            (begun, test)
        })
        .collect();
    let last = spans.iter().map(|(begun, test)| begun + test.seconds.clamp(0.0, 1e6));
    let last = last.fold(result.seconds.clamp(0.0, 1e7), f64::max);
    if spans.is_empty() || last <= 0.0 {
        return Ok(String::new());
    }
    let scale = (WIDTH - 2.0 * MARGIN) / last;
    let place = |time: f64| format!("{:.1}", MARGIN + time * scale);
    let fields = spans.iter().filter_map(|(begun, test)| {
        let verdict = test_verdict(test);
        let badge = Badge::of(verdict);
        Some(Field {
            link: anchors.decider(&test.id)?,
            label: format!("{}: {}, {}", clean::line(&test.id), badge.word, seconds(test.seconds)),
            class: badge.class,
            tall: matches!(verdict, Some(Verdict::Fail | Verdict::Warning | Verdict::Error)),
            x: place(*begun),
            width: format!("{:.1}", (test.seconds.clamp(0.0, 1e6) * scale).max(1.2)),
        })
    });
    let fields: Vec<Field> = fields.collect();
    let marks = (0..=4).map(|quarter| {
        let time = last * f64::from(quarter) / 4.0;
        (place(time), seconds(time))
    });
    Strip {
        description: format!("{} in {}", many(fields.len(), "test"), seconds(last)),
        fields,
        marks: marks.collect(),
    }
    .render()
}

/// When a test began, in seconds since the run did.
fn begun(test: &TestResult, journal: Option<&Journal>) -> Option<f64> {
    let (first, _) = test.journal?;
    Some(journal?.get(first)?.at().moment.seconds())
}
