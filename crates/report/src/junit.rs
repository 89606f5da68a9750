//! JUnit XML for build servers.
//!
//! JUnit knows pass, failure, error and skipped, and a build server knows red and green. A fail is a
//! failure of type *requirement id*; inconclusive and error are errors, so that neither is taken for a pass;
//! a warning passes and says so in `system-out`; *not applicable* is skipped. One suite per group of tests,
//! one for the monitors, and one for the run itself: a run that ended early or decided nothing must not be
//! green only because nothing failed.
//!
//! `junit_report` writes text as it comes, so everything goes through [`xml`] first. What
//! it cannot do: more than one `<failure>` in a test case (the worst decision gives type and message, all
//! of them stand in its text), and a `skipped` count on the suite; [`properties`] writes the properties. It always
//! writes a timestamp: ours is the start of the run, and its constructors that read the clock are not used. No test case
//! has a `file`, which the schema of Jenkins' xUnit plugin forbids.

mod properties;
mod xml;

use junit_report::{Duration, OffsetDateTime, ReportBuilder, TestCase, TestResult as Outcome, TestSuite};

use super::cases::{self, Case, Elsewhere, NOT_APPLICABLE};
use super::findings::{Finding, findings};
use super::keys::Keys;
use super::sources::Sources;
use super::statement::{self, Gap};
use super::time::{millis, started};
use tck_base::verdict::Verdict;
use tck_result::{RequirementResult, RunResult};
use xml::{attribute, cdata, with_tags};

pub use super::cases::{RUN_CASE, RUN_SUITE};

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
    let quoted = Sources::default();
    let all = cases::cases(result, &quoted);
    Ok(lines(&of_cases(result, &all, flavour)?))
}

/// The result as JUnit XML with properties: what a case is about, and under which key test management knows it. A requirement
/// that is known there as a test has a case of its own.
///
/// The schema of Jenkins' xUnit plugin allows a case no properties.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn with_keys(
    result: &RunResult,
    sources: &Sources,
    keys: &Keys,
    flavour: Flavour<'_>,
) -> Result<String, JunitError> {
    let mut all = cases::cases(result, sources);
    let found = findings(result, sources);
    let own = result.requirements.iter().filter(|one| keys.is_test(&one.id));
    all.extend(own.map(|one| {
        let finding = found.iter().find(|finding| finding.requirement == one.id);
        requirement_case(one, properties::REQUIREMENTS, finding, sources)
    }));
    let xml = of_cases(result, &all, flavour)?;
    Ok(lines(&properties::of_cases(&xml, &all, keys)))
}

/// These cases as JUnit XML, a suite for all that stand together.
fn of_cases(result: &RunResult, all: &[Case<'_>], flavour: Flavour<'_>) -> Result<String, JunitError> {
    let mut report = ReportBuilder::new();
    for suite_cases in all.chunk_by(|one, next| one.suite == next.suite) {
        let name = suite_cases.first().map_or("", |case| case.suite);
        let built = suite_cases.iter().map(|case| built(case, flavour.inconclusive));
        report.add_testsuite(suite(result, name, built.collect()));
    }
    Ok(properties::of_run(&written(&report)?, result, flavour.root))
}

/// The result as JUnit XML: a case for each requirement, and a suite for each group of requirements.
///
/// # Errors
/// When the XML writer refuses; it has no reason to.
pub fn by_requirement(result: &RunResult, sources: &Sources, flavour: Flavour<'_>) -> Result<String, JunitError> {
    let found = findings(result, sources);
    let mut all = cases::of_run(result);
    let mut groups: Vec<(&str, Vec<Case<'_>>)> = Vec::new();
    for requirement in &result.requirements {
        let group = requirement.id.rsplit_once('-').map_or("other", |(group, _)| group);
        let finding = found.iter().find(|finding| finding.requirement == requirement.id);
        let case = requirement_case(requirement, group, finding, sources);
        match groups.iter_mut().find(|(name, _)| *name == group) {
            Some((_, cases)) => cases.push(case),
            None => groups.push((group, vec![case])),
        }
    }
    all.extend(groups.into_iter().flat_map(|(_, cases)| cases));
    Ok(lines(&of_cases(result, &all, flavour)?))
}

/// A case of something that is no run.
#[derive(Clone, Debug)]
pub struct Plain {
    /// The suite.
    pub suite: String,
    /// Its name: the requirement.
    pub name: String,
    /// How it ended.
    pub verdict: Verdict,
    /// Where its failure is counted, when that is not here.
    pub elsewhere: Option<Elsewhere>,
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
        let built = TestCase {
            name: attribute(&case.name),
            time: duration(0.0),
            result: match case.elsewhere {
                Some(_) => skipped(case.verdict.word(), message),
                None => outcome(case.verdict, &case.name, message, &case.text, Inconclusive::Error),
            },
            classname: Some(attribute(&case.suite)),
            filepath: None,
            system_out: (case.verdict == Verdict::Warning && case.elsewhere.is_none())
                .then(|| cdata(&format!("warning: {}", case.text))),
            system_err: None,
        };
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
    Ok(lines(&written(&report)?))
}

fn written(report: &ReportBuilder) -> Result<String, JunitError> {
    let mut xml = Vec::new();
    let done = report.build().write_xml(&mut xml);
    done.map_err(|error| JunitError(error.to_string()))?;
    let xml = String::from_utf8(xml).map_err(|error| JunitError(error.to_string()))?;
    Ok(with_times(&xml))
}

/// A line for each case: whoever compares two files sees what differs.
fn lines(xml: &str) -> String {
    let xml = xml.replace("><testcase ", ">\n<testcase ");
    xml.replace("><testsuite ", ">\n<testsuite ") + "\n"
}

/// Gives every time at most three decimals, as the schema of Jenkins' xUnit plugin has it. The writer prints sums of binary
/// fractions, such as `1.9969999999999999`.
fn with_times(xml: &str) -> String {
    with_tags(xml, |tag| {
        let (before, after) = tag.split_once(" time=\"")?;
        let (time, after) = after.split_once('"').unwrap_or((after, ""));
        let rounded = time.parse::<f64>().map_or(0.0, |time| (time * 1000.0).round() / 1000.0);
        Some(format!("{before} time=\"{rounded}\"{after}"))
    })
}

/// In whole milliseconds: what is finer is noise, and reads badly.
fn duration(seconds: f64) -> Duration {
    Duration::milliseconds(i64::try_from(millis(seconds)).unwrap_or_default())
}

/// The start of the run.
fn timestamp(result: &RunResult) -> OffsetDateTime {
    let nanos = started(result).as_nanosecond().max(0);
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

fn built(case: &Case<'_>, how: Inconclusive) -> TestCase {
    let how = if case.of_run() { Inconclusive::Error } else { how };
    TestCase {
        name: attribute(&case.name),
        time: duration(case.seconds),
        result: match case.counted() {
            Some(verdict) => outcome(verdict, case.kind, &case.message, &case.details, how),
            None => skipped(case.word(), &case.message),
        },
        classname: Some(attribute(case.suite)),
        filepath: None,
        system_out: case.remark.as_deref().map(cdata),
        system_err: None,
    }
}

/// The outcome for a verdict; `kind` is the requirement id of a fail.
fn outcome(verdict: Verdict, kind: &str, message: &str, cause: &str, how: Inconclusive) -> Outcome {
    let message = attribute(message);
    let cause = (!cause.is_empty()).then(|| cdata(cause));
    match verdict {
        Verdict::Pass | Verdict::Warning => Outcome::Success,
        Verdict::Fail => Outcome::Failure {
            type_: attribute(kind),
            message,
            cause,
        },
        Verdict::Inconclusive if how == Inconclusive::Skip => Outcome::SkippedWithCause {
            type_: Verdict::Inconclusive.word().to_owned(),
            message,
            cause,
        },
        Verdict::Inconclusive | Verdict::Error => Outcome::Error {
            type_: verdict.word().to_owned(),
            message,
            cause,
        },
    }
}

/// The outcome of what is not counted: it has no verdict, or its failure is counted elsewhere.
fn skipped(word: &str, message: &str) -> Outcome {
    Outcome::SkippedWithCause {
        type_: word.to_owned(),
        message: attribute(message),
        cause: None,
    }
}

fn requirement_case<'a>(
    requirement: &'a RequirementResult,
    suite: &'a str,
    finding: Option<&Finding<'_>>,
    sources: &'a Sources,
) -> Case<'a> {
    let known = sources.requirement(&requirement.id);
    let asks = known.map_or("", |known| known.text.as_str());
    let link = known.and_then(|known| known.link.as_deref());
    let link = link.map_or_else(String::new, |link| format!("\n{link}"));
    // What applies and was not decided is no pass, and what no test can decide is nobody's fault.
    let (verdict, absent) = match statement::gap(requirement) {
        Some(Gap::NotDecided) => (Some(Verdict::Inconclusive), NOT_APPLICABLE),
        Some(Gap::NotTestable) => (None, "not testable"),
        Some(Gap::NotApplicable) | None => (requirement.verdict, NOT_APPLICABLE),
    };
    let follows = verdict.is_some() && finding.is_some_and(|finding| finding.follows.is_some());
    let gap = requirement.not_decided.as_ref().map(ToString::to_string);
    let message = match (finding, gap) {
        (Some(finding), _) => finding.seen.clone(),
        (None, Some(why)) => why,
        (None, None) => "no test came to a decision".to_owned(),
    };
    let by = format!("{asks}{link}\ndecided by {}", requirement.decided_by.join(", "));
    Case {
        suite,
        name: format!("{} {asks}", requirement.id),
        title: asks,
        seconds: 0.0,
        verdict,
        absent,
        elsewhere: follows.then_some(Elsewhere::Cause),
        kind: &requirement.id,
        remark: (verdict == Some(Verdict::Warning) && !follows).then(|| format!("warning: {message}\n\n{by}")),
        message,
        details: by,
        requirements: vec![&requirement.id],
        test: None,
    }
}
