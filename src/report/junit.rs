//! JUnit XML for build servers.
//!
//! JUnit knows pass, failure, error and skipped, and a build server knows red and green. A fail is a
//! failure of type *requirement id*; inconclusive and error are errors, so that neither is taken for a pass;
//! a warning passes and says so in `system-out`; *not applicable* is skipped. One suite per group of tests,
//! one for the monitors, and one for the run itself: a run that ended early or decided nothing must not be
//! green only because nothing failed.
//!
//! `junit_report` writes text as it comes, so everything goes through [`attribute`] or [`cdata`] first. What
//! it cannot do: more than one `<failure>` in a test case (the worst decision gives type and message, all
//! of them stand in its text), properties, and a `skipped` count on the suite. It always writes a
//! timestamp: ours is the start of the run, and its constructors that read the clock are not used.

use std::fmt::Write as _;

use junit_report::{Duration, OffsetDateTime, ReportBuilder, TestCase, TestResult as Outcome, TestSuite};

use super::clean;
use super::statement;
use crate::result::{Decision, MonitorResult, RunResult, TestResult};
use crate::verdict::Verdict;

/// Why no JUnit file could be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot write JUnit XML: {0}")]
pub struct JunitError(String);

/// The result as JUnit XML.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn render(result: &RunResult) -> Result<String, JunitError> {
    let mut report = ReportBuilder::new();
    report.add_testsuite(suite(result, "run", vec![run_case(result)]));
    let mut groups: Vec<(&str, Vec<TestCase>)> = Vec::new();
    for test in &result.tests {
        let group = test.id.split_once('/').map_or("tests", |(group, _)| group);
        let case = test_case(test);
        match groups.iter_mut().find(|(name, _)| *name == group) {
            Some((_, cases)) => cases.push(case),
            None => groups.push((group, vec![case])),
        }
    }
    for (group, cases) in groups {
        report.add_testsuite(suite(result, group, cases));
    }
    if !result.monitors.is_empty() {
        let cases = result.monitors.iter().map(monitor_case).collect();
        report.add_testsuite(suite(result, "monitors", cases));
    }
    let mut xml = Vec::new();
    let written = report.build().write_xml(&mut xml);
    written.map_err(|error| JunitError(error.to_string()))?;
    xml.push(b'\n');
    String::from_utf8(xml).map_err(|error| JunitError(error.to_string()))
}

/// One line, without anything XML forbids. Escaping is done by the writer.
fn attribute(text: &str) -> String {
    // Line breaks would be folded to blanks by the next parser anyway.
    clean::line(&text.replace(['\n', '\t'], " ")).into_owned()
}

/// Many lines, without anything XML forbids and without an end of the CDATA section they will stand in.
fn cdata(text: &str) -> String {
    clean::block(text).replace("]]>", "]] >")
}

/// Sums of these are made by the writer, which must not overflow.
fn duration(seconds: f64) -> Duration {
    let seconds = if seconds.is_finite() {
        seconds.clamp(0.0, 1e9)
    } else {
        0.0
    };
    // Whole milliseconds: what is finer is noise, and reads badly.
    #[expect(clippy::cast_possible_truncation, reason = "clamped above")]
    Duration::milliseconds((seconds * 1000.0).round() as i64)
}

/// The start of the run; the epoch when it cannot be read.
fn timestamp(result: &RunResult) -> OffsetDateTime {
    let started = result.started.parse::<jiff::Timestamp>().ok();
    let nanos = started.map_or(0, |started| started.as_nanosecond().max(0));
    OffsetDateTime::from_unix_timestamp_nanos(nanos).unwrap_or(OffsetDateTime::UNIX_EPOCH)
}

fn suite(result: &RunResult, name: &str, testcases: Vec<TestCase>) -> TestSuite {
    TestSuite {
        name: attribute(name),
        package: attribute(&format!("vda5050-tck.{}", result.role)),
        timestamp: timestamp(result),
        hostname: attribute(&statement::device(result)),
        testcases,
        system_out: None,
        system_err: None,
    }
}

struct Case<'a> {
    name: &'a str,
    class: &'a str,
    file: Option<&'a str>,
    seconds: f64,
    outcome: Outcome,
    out: Option<String>,
}

impl Case<'_> {
    fn build(self) -> TestCase {
        TestCase {
            name: attribute(self.name),
            time: duration(self.seconds),
            result: self.outcome,
            classname: Some(attribute(self.class)),
            filepath: self.file.map(attribute),
            system_out: self.out.map(|text| cdata(&text)),
            system_err: None,
        }
    }
}

/// The outcome for a verdict; `kind` is the requirement id of a fail.
fn outcome(verdict: Option<Verdict>, kind: &str, message: &str, cause: &str) -> Outcome {
    let message = attribute(message);
    let cause = (!cause.is_empty()).then(|| cdata(cause));
    match verdict {
        Some(Verdict::Pass | Verdict::Warning) => Outcome::Success,
        Some(Verdict::Fail) => Outcome::Failure {
            type_: attribute(kind),
            message,
            cause,
        },
        Some(undecided @ (Verdict::Inconclusive | Verdict::Error)) => Outcome::Error {
            type_: undecided.word().to_owned(),
            message,
            cause,
        },
        None => Outcome::SkippedWithCause {
            type_: "not applicable".to_owned(),
            message,
            cause: None,
        },
    }
}

fn run_case(result: &RunResult) -> TestCase {
    let trouble = match (result.partial, result.verdict) {
        (true, _) => Some(
            result
                .partial_reason
                .as_deref()
                .unwrap_or("the run ended before its plan did"),
        ),
        (false, None) => Some("nothing was decided"),
        (false, Some(_)) => None,
    };
    let statement = statement::statement(result);
    Case {
        name: "the run is complete and decided something",
        class: "run",
        file: None,
        seconds: 0.0,
        outcome: trouble.map_or(Outcome::Success, |reason| {
            outcome(Some(Verdict::Error), "", reason, &statement)
        }),
        out: trouble.is_none().then_some(statement),
    }
    .build()
}

fn test_case(test: &TestResult) -> TestCase {
    let verdict = statement::test_verdict(test);
    let worst = test
        .decisions
        .iter()
        .filter(|decision| Some(decision.verdict()) == verdict)
        .collect::<Vec<_>>();
    let kind = worst.first().map_or("", |decision| decision.requirement.as_str());
    let message = match (&test.not_applicable, &test.reason, worst.first()) {
        (Some(why), _, _) if verdict.is_none() => why.as_str(),
        (_, Some(reason), _) => reason.as_str(),
        (_, None, Some(decision)) => decision.message.as_str(),
        (_, None, None) => "the test decided nothing",
    };
    let mut findings: Vec<&Decision> = test.decisions.iter().filter(|d| d.verdict() != Verdict::Pass).collect();
    findings.sort_by_key(|decision| std::cmp::Reverse(decision.verdict()));
    let details = findings
        .iter()
        .map(|decision| finding(decision))
        .collect::<Vec<_>>()
        .join("\n\n");
    let place = findings.first().map(|decision| decision.place.as_str());
    Case {
        name: &test.id,
        class: test.id.split_once('/').map_or("tests", |(group, _)| group),
        file: place.and_then(|place| place.rsplit_once(':')).map(|(file, _)| file),
        seconds: test.seconds,
        outcome: outcome(verdict, kind, message, &details),
        out: (verdict == Some(Verdict::Warning)).then(|| format!("warning: {message}\n\n{details}")),
    }
    .build()
}

fn finding(decision: &Decision) -> String {
    let verdict = decision.verdict();
    let Decision {
        requirement,
        clause,
        place,
        message,
        ..
    } = decision;
    let mut text = format!("{verdict}: {requirement}: {message}\n{clause} at {place}");
    if let Some(witness) = decision.witness {
        let _ = write!(text, "\ndecided by message #{witness}");
    }
    if let Some(nearest) = &decision.nearest {
        let _ = write!(
            text,
            "\nclosest: #{} {}: {} (expected {})",
            nearest.seq, nearest.path, nearest.found, nearest.expected
        );
    }
    if let Some(explanation) = &decision.explanation {
        text.push('\n');
        text.push_str(explanation);
    }
    text
}

fn monitor_case(monitor: &MonitorResult) -> TestCase {
    let mut findings: Vec<_> = monitor.findings.iter().collect();
    findings.sort_by_key(|finding| std::cmp::Reverse(finding.verdict));
    let kind = findings.first().map_or("", |finding| finding.requirement.as_str());
    let message = match (findings.first(), monitor.verdict) {
        (Some(finding), Some(_)) => finding.message.as_str(),
        (_, None) => "there was nothing to judge",
        (None, Some(_)) => monitor.title.as_str(),
    };
    let lines = findings
        .iter()
        .map(|finding| {
            let first = finding
                .first
                .iter()
                .map(|seq| format!("#{seq}"))
                .collect::<Vec<_>>()
                .join(", ");
            format!(
                "{}: {}: {} ({} times; first at {first})",
                finding.verdict, finding.requirement, finding.message, finding.count
            )
        })
        .collect::<Vec<_>>()
        .join("\n");
    Case {
        name: &monitor.id,
        class: "monitors",
        file: None,
        seconds: 0.0,
        outcome: outcome(monitor.verdict, kind, message, &lines),
        out: (monitor.verdict == Some(Verdict::Warning)).then_some(lines),
    }
    .build()
}
