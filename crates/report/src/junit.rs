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
//! of them stand in its text), and a `skipped` count on the suite; [`with_properties`] adds the properties. It always
//! writes a timestamp: ours is the start of the run, and its constructors that read the clock are not used. No test case
//! has a `file`, which the schema of Jenkins' xUnit plugin forbids.

use std::fmt::Write as _;

use junit_report::{Duration, OffsetDateTime, ReportBuilder, TestCase, TestResult as Outcome, TestSuite};

use askama::filters::Escaper as _;

use super::clean;
use super::findings::{Finding, PROGRAM, findings};
use super::html::Escape;
use super::repeated;
use super::sources::Sources;
use super::statement::{self, Gap};
use tck_base::verdict::Verdict;
use tck_result::{Decision, MonitorResult, RequirementResult, RunResult, TestResult};

/// The suite that is about the run itself.
pub const RUN_SUITE: &str = "run";
/// The case of that suite.
pub const RUN_CASE: &str = "the run is complete and decided something";

/// Why no JUnit file could be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot write JUnit XML: {0}")]
pub struct JunitError(String);

/// How what was not decided is shown to a build server.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Inconclusive {
    /// As an error: the build is red.
    #[default]
    Error,
    /// As skipped.
    Skip,
}

/// What a build server is told beside the result.
#[derive(Clone, Copy, Debug, Default)]
pub struct Flavour<'a> {
    /// How what was not decided is shown.
    pub inconclusive: Inconclusive,
    /// The root hash of the bundle. A file of the bundle cannot hold it.
    pub root: Option<&'a str>,
}

/// The result as JUnit XML: a case for each test and each monitor.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn render(result: &RunResult, flavour: Flavour<'_>) -> Result<String, JunitError> {
    let how = flavour.inconclusive;
    let mut report = ReportBuilder::new();
    report.add_testsuite(suite(result, RUN_SUITE, run_cases(result)));
    let mut groups: Vec<(&str, Vec<TestCase>)> = Vec::new();
    for test in &result.tests {
        let group = test.id.split_once('/').map_or("tests", |(group, _)| group);
        let case = test_case(test, how);
        match groups.iter_mut().find(|(name, _)| *name == group) {
            Some((_, cases)) => cases.push(case),
            None => groups.push((group, vec![case])),
        }
    }
    for (group, cases) in groups {
        report.add_testsuite(suite(result, group, cases));
    }
    if !result.monitors.is_empty() {
        let cases = result
            .monitors
            .iter()
            .map(|monitor| monitor_case(monitor, how))
            .collect();
        report.add_testsuite(suite(result, "monitors", cases));
    }
    written(&report, result, flavour)
}

/// What is about the run itself: whether it came to its end, whether its program did so by itself, and who was judged.
fn run_cases(result: &RunResult) -> Vec<TestCase> {
    let mut all = vec![run_case(result)];
    if let Some(program) = &result.program {
        let story = program.story().unwrap_or_default();
        let verdict = program.verdict().or(Some(Verdict::Pass));
        let words = program.first().map_or("", |end| end.words.as_str());
        all.push(
            Case {
                name: "the program that was started ran until it was ended",
                class: "run",
                seconds: 0.0,
                outcome: outcome(verdict, PROGRAM, &story, words, Inconclusive::Error),
                out: None,
            }
            .build(),
        );
    }
    if let Some(why) = &result.mixed {
        all.push(
            Case {
                name: "nobody else was taken for the device",
                class: "run",
                seconds: 0.0,
                outcome: outcome(Some(Verdict::Inconclusive), "", why, "", Inconclusive::Error),
                out: None,
            }
            .build(),
        );
    }
    all
}

/// The result as JUnit XML: a case for each requirement, and a suite for each group of requirements.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn by_requirement(result: &RunResult, sources: &Sources, flavour: Flavour<'_>) -> Result<String, JunitError> {
    let found = findings(result, sources);
    let mut report = ReportBuilder::new();
    report.add_testsuite(suite(result, RUN_SUITE, run_cases(result)));
    let mut groups: Vec<(&str, Vec<TestCase>)> = Vec::new();
    for requirement in &result.requirements {
        let group = requirement.id.rsplit_once('-').map_or("other", |(group, _)| group);
        let finding = found.iter().find(|finding| finding.requirement == requirement.id);
        let case = requirement_case(requirement, group, finding, sources, flavour.inconclusive);
        match groups.iter_mut().find(|(name, _)| *name == group) {
            Some((_, cases)) => cases.push(case),
            None => groups.push((group, vec![case])),
        }
    }
    for (group, cases) in groups {
        report.add_testsuite(suite(result, group, cases));
    }
    written(&report, result, flavour)
}

/// A case of something that is no run.
#[derive(Clone, Debug)]
pub struct Plain {
    /// The suite.
    pub suite: String,
    /// Its name: the requirement.
    pub name: String,
    /// How it ended.
    pub verdict: Option<Verdict>,
    /// What was found.
    pub text: String,
}

/// Cases as JUnit XML, each in its suite. A warning passes and says so.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn plain(cases: &[Plain]) -> Result<String, JunitError> {
    let mut groups: Vec<(&str, Vec<TestCase>)> = Vec::new();
    for case in cases {
        let message = case.text.lines().next().unwrap_or_default();
        let built = Case {
            name: &case.name,
            class: &case.suite,
            seconds: 0.0,
            outcome: outcome(case.verdict, &case.name, message, &case.text, Inconclusive::Error),
            out: (case.verdict == Some(Verdict::Warning)).then(|| format!("warning: {}", case.text)),
        }
        .build();
        match groups.last_mut().filter(|(name, _)| *name == case.suite) {
            Some((_, cases)) => cases.push(built),
            None => groups.push((&case.suite, vec![built])),
        }
    }
    let mut report = ReportBuilder::new();
    for (name, testcases) in groups {
        report.add_testsuite(TestSuite {
            name: attribute(name),
            package: "vda5050-tck".to_owned(),
            timestamp: OffsetDateTime::UNIX_EPOCH,
            hostname: "localhost".to_owned(),
            testcases,
            system_out: None,
            system_err: None,
        });
    }
    Ok(lines(&xml(&report)?))
}

fn written(report: &ReportBuilder, result: &RunResult, flavour: Flavour<'_>) -> Result<String, JunitError> {
    Ok(lines(&with_properties(&xml(report)?, result, flavour)))
}

fn xml(report: &ReportBuilder) -> Result<String, JunitError> {
    let mut xml = Vec::new();
    let written = report.build().write_xml(&mut xml);
    written.map_err(|error| JunitError(error.to_string()))?;
    let xml = String::from_utf8(xml).map_err(|error| JunitError(error.to_string()))?;
    Ok(with_times(&xml))
}

/// A line for each case: whoever compares two files sees what differs.
fn lines(xml: &str) -> String {
    let xml = xml.replace("><testcase ", ">\n<testcase ");
    xml.replace("><testsuite ", ">\n<testsuite ") + "\n"
}

/// Gives every time at most three decimals, as the schema of Jenkins' xUnit plugin has it. The writer prints sums of binary
/// fractions, such as `1.9969999999999999`. Only tags are touched: the writer escapes `>` and `"` in their attributes, and
/// what stands in CDATA sections is not ours.
fn with_times(xml: &str) -> String {
    const CDATA: &str = "<![CDATA[";
    let mut text = String::with_capacity(xml.len());
    let mut rest = xml;
    while let Some(begin) = rest.find('<') {
        let is_data = rest[begin..].starts_with(CDATA);
        let close = if is_data { "]]>" } else { ">" };
        let Some(length) = rest[begin..].find(close) else { break };
        let end = begin + length + close.len();
        text.push_str(&rest[..begin]);
        let tag = &rest[begin..end];
        match tag.split_once(" time=\"").filter(|_| !is_data) {
            Some((before, after)) => {
                let (time, after) = after.split_once('"').unwrap_or((after, ""));
                let rounded = time.parse::<f64>().map_or(0.0, |time| (time * 1000.0).round() / 1000.0);
                // Writing to a text does not fail.
                let _ = write!(text, "{before} time=\"{rounded}\"{after}");
            }
            None => text.push_str(tag),
        }
        rest = &rest[end..];
    }
    text + rest
}

/// Puts what is known of the run into the first suite, which is about the run. The writer escapes `>` in attributes, so
/// that the first one ends the tag.
fn with_properties(xml: &str, result: &RunResult, flavour: Flavour<'_>) -> String {
    let Some(begin) = xml.find("<testsuite ") else {
        return xml.to_owned();
    };
    let Some(end) = xml[begin..].find('>').map(|at| begin + at + 1) else {
        return xml.to_owned();
    };
    let device = &result.device;
    let root = flavour.root.map(|root| format!("sha256:{root}"));
    let shard = result.shard.as_ref();
    let origin = shard.map(|shard| shard.origin.as_str());
    let shard = shard.map(|shard| format!("{}/{}", shard.index, shard.of));
    let parts = result.merged.as_ref().map(|merged| {
        let own = merged.parts.iter().filter(|part| part.counts).count();
        format!("{own} of {}", merged.of)
    });
    let all = [
        ("tool", Some(result.tool.as_str())),
        ("run", Some(&result.run)),
        ("mode", result.mode.as_deref()),
        ("verdict", result.verdict.map(Verdict::word)),
        ("role", Some(&result.role)),
        ("protocol", Some(&result.protocol)),
        ("manufacturer", Some(&device.manufacturer)),
        ("serialNumber", Some(&device.serial_number)),
        ("firmwareVersion", result.setting("certificate.firmware-version")),
        ("counterpart", result.setting("counterpart")),
        ("suites", Some(&result.suites_sha256)),
        ("shard", shard.as_deref()),
        ("shardOrigin", origin),
        ("parts", parts.as_deref()),
        ("root", root.as_deref()),
    ];
    let mut properties = String::from("<properties>");
    for (name, value) in all.iter().filter_map(|(name, value)| Some((name, (*value)?))) {
        let mut escaped = String::new();
        // Writing to a text does not fail.
        let _ = Escape.write_escaped_str(&mut escaped, &attribute(value));
        let _ = write!(properties, "<property name=\"{name}\" value=\"{escaped}\"/>");
    }
    properties += "</properties>";
    format!("{}{properties}{}", &xml[..end], &xml[end..])
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
        package: "vda5050-tck".to_owned(),
        timestamp: timestamp(result),
        // The machine is not known, and no part of the evidence. The device stands among the properties.
        hostname: "localhost".to_owned(),
        testcases,
        system_out: None,
        system_err: None,
    }
}

struct Case<'a> {
    name: &'a str,
    class: &'a str,
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
            filepath: None,
            system_out: self.out.map(|text| cdata(&text)),
            system_err: None,
        }
    }
}

/// The outcome for a verdict; `kind` is the requirement id of a fail.
fn outcome(verdict: Option<Verdict>, kind: &str, message: &str, cause: &str, how: Inconclusive) -> Outcome {
    let message = attribute(message);
    let cause = (!cause.is_empty()).then(|| cdata(cause));
    match verdict {
        Some(Verdict::Pass | Verdict::Warning) => Outcome::Success,
        Some(Verdict::Fail) => Outcome::Failure {
            type_: attribute(kind),
            message,
            cause,
        },
        Some(Verdict::Inconclusive) if how == Inconclusive::Skip => Outcome::SkippedWithCause {
            type_: Verdict::Inconclusive.word().to_owned(),
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
    let trouble = statement::trouble(result);
    let statement = statement::statement(result);
    Case {
        name: RUN_CASE,
        class: RUN_SUITE,
        seconds: 0.0,
        outcome: trouble.as_deref().map_or(Outcome::Success, |reason| {
            outcome(Some(Verdict::Error), "", reason, &statement, Inconclusive::Error)
        }),
        out: trouble.is_none().then_some(statement),
    }
    .build()
}

fn test_case(test: &TestResult, how: Inconclusive) -> TestCase {
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
    let repeated = repeated::summary(test);
    let message = match &repeated {
        Some(repeated) if test.is_flaky() => &format!("{repeated}: {message}"),
        _ => message,
    };
    let mut findings: Vec<&Decision> = test.decisions.iter().filter(|d| d.verdict() != Verdict::Pass).collect();
    findings.sort_by_key(|decision| std::cmp::Reverse(decision.verdict()));
    let details = findings
        .iter()
        .map(|decision| finding(decision))
        .collect::<Vec<_>>()
        .join("\n\n");
    Case {
        name: &test.id,
        class: test.id.split_once('/').map_or("tests", |(group, _)| group),
        seconds: test.seconds,
        outcome: outcome(verdict, kind, message, &details, how),
        out: match verdict {
            Some(Verdict::Warning) => Some(format!("warning: {message}\n\n{details}")),
            _ => repeated,
        },
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
    if let Some(sent) = &decision.sent {
        let _ = write!(text, "\nsent: {sent}");
    }
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

fn monitor_case(monitor: &MonitorResult, how: Inconclusive) -> TestCase {
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
        seconds: 0.0,
        outcome: outcome(monitor.verdict, kind, message, &lines, how),
        out: (monitor.verdict == Some(Verdict::Warning)).then_some(lines),
    }
    .build()
}

fn requirement_case(
    requirement: &RequirementResult,
    group: &str,
    finding: Option<&Finding<'_>>,
    sources: &Sources,
    how: Inconclusive,
) -> TestCase {
    let known = sources.requirement(&requirement.id);
    let asks = known.map_or("", |known| known.text.as_str());
    // The schema of Jenkins' xUnit plugin allows a case no properties.
    let link = known.and_then(|known| known.link.as_deref());
    let link = link.map_or_else(String::new, |link| format!("\n{link}"));
    // What applies and was not decided is no pass, and what no test can decide is nobody's fault.
    let verdict = match statement::gap(requirement) {
        Some(Gap::NotDecided) => Some(Verdict::Inconclusive),
        _ => requirement.verdict,
    };
    let gap = requirement.not_decided.as_ref().map(ToString::to_string);
    let message = match (finding, &gap) {
        (Some(finding), _) => finding.seen.as_str(),
        (None, Some(why)) => why.as_str(),
        (None, None) => "no test came to a decision",
    };
    let by = format!("{asks}{link}\ndecided by {}", requirement.decided_by.join(", "));
    Case {
        name: &format!("{} {asks}", requirement.id),
        class: group,
        seconds: 0.0,
        outcome: outcome(verdict, &requirement.id, message, &by, how),
        out: (verdict == Some(Verdict::Warning)).then(|| format!("warning: {message}\n\n{by}")),
    }
    .build()
}
