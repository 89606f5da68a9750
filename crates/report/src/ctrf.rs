//! CTRF (Common Test Report Format): one JSON file that dashboards and chat plug-ins read.
//!
//! CTRF knows passed, failed and skipped, and its readers are red for what failed only. So what was not decided is failed, unless
//! it is to be skipped; `rawStatus` has the verdict itself.

use serde_json::{Map, Value, json};

use super::cases::{Case, cases};
use super::clean::{block, line};
use super::junit::Inconclusive;
use super::no_result::NoResult;
use super::sources::Sources;
use super::statement;
use super::time::{finished, millis, millis_of_start, rfc3339};
use tck_base::verdict::Verdict;
use tck_result::{RunResult, StepResult};

/// A run.
#[must_use]
pub fn render(result: &RunResult, sources: &Sources, how: Inconclusive) -> String {
    let all = cases(result, sources);
    let tests: Vec<Value> = all.iter().map(|case| test(case, how)).collect();
    let start = millis_of_start(result);
    let stop = start + millis(result.seconds);
    let mut report = report(&result.tool, tests);
    report["timestamp"] = rfc3339(finished(result)).into();
    report["runId"] = line(&result.run).into();
    let summary = &mut report["results"]["summary"];
    summary["start"] = start.into();
    summary["stop"] = stop.into();
    summary["duration"] = (stop - start).into();
    summary["flaky"] = all.iter().filter(|case| case.is_flaky()).count().into();
    summary["suites"] = all.chunk_by(|one, next| one.suite == next.suite).count().into();
    let mut environment = json!({
        "appName": statement::device(result),
        "testEnvironment": line(&format!("VDA 5050 {}", result.protocol)),
        "healthy": matches!(result.verdict, Some(Verdict::Pass | Verdict::Warning)) && statement::trouble(result).is_none(),
        "extra": {
            "run": line(&result.run),
            "role": line(&result.role),
            "verdict": result.verdict.map(Verdict::word),
            "statement": statement::statement(result),
            "suitesSha256": line(&result.suites_sha256),
        },
    });
    if let Some(version) = result.setting("certificate.firmware-version") {
        environment["appVersion"] = line(version).into();
    }
    if let Some(shard) = &result.shard {
        environment["shardId"] = format!("{}/{}", shard.index, shard.of).into();
    }
    report["results"]["environment"] = environment;
    format!("{report:#}\n")
}

/// A run that never came to be: one test, which failed.
#[must_use]
pub fn no_result(nothing: &NoResult) -> String {
    let case = nothing.case();
    format!("{:#}\n", report(&nothing.tool, vec![test(&case, Inconclusive::Error)]))
}

fn report(tool: &str, tests: Vec<Value>) -> Value {
    let (name, version) = tool.rsplit_once(' ').unwrap_or((tool, ""));
    let count = |status: &str| tests.iter().filter(|test| test["status"] == status).count();
    json!({
        "reportFormat": "CTRF",
        "specVersion": "0.0.0",
        "generatedBy": line(tool),
        "results": {
            "tool": { "name": line(name), "version": line(version) },
            "summary": {
                "tests": tests.len(), "passed": count("passed"), "failed": count("failed"), "skipped": count("skipped"),
                "pending": 0, "other": 0, "start": 0, "stop": 0,
            },
            "tests": tests,
        },
    })
}

fn status(verdict: Option<Verdict>, how: Inconclusive) -> &'static str {
    match verdict {
        Some(Verdict::Pass | Verdict::Warning) => "passed",
        Some(Verdict::Inconclusive) if how == Inconclusive::Skip => "skipped",
        Some(Verdict::Inconclusive | Verdict::Error | Verdict::Fail) => "failed",
        None => "skipped",
    }
}

fn test(case: &Case<'_>, how: Inconclusive) -> Value {
    let how = if case.of_run() { Inconclusive::Error } else { how };
    let mut test = Map::from_iter([
        ("name".to_owned(), line(&case.name).into()),
        ("status".to_owned(), status(case.counted(), how).into()),
        ("duration".to_owned(), millis(case.seconds).into()),
        ("rawStatus".to_owned(), case.word().into()),
        ("suite".to_owned(), json!([line(case.suite)])),
        (
            "testId".to_owned(),
            line(&format!("{}/{}", case.suite, case.name)).into(),
        ),
    ]);
    let mut say = |name: &str, text: &str| {
        if !text.is_empty() {
            test.insert(name.to_owned(), block(text).into());
        }
    };
    if case.verdict != Some(Verdict::Pass) {
        say("message", &case.message);
        say("trace", &case.details);
    }
    if !case.requirements.is_empty() {
        let all: Vec<_> = case.requirements.iter().map(|id| line(id)).collect();
        test.insert("labels".to_owned(), json!({ "requirement": all }));
    }
    if let Some(place) = case.elsewhere {
        test.insert("extra".to_owned(), json!({ "countedIn": place.word() }));
    }
    if case.is_flaky() {
        test.insert("flaky".to_owned(), true.into());
    }
    if let Some(done) = case.test.filter(|done| !done.steps.is_empty()) {
        let steps = done.steps.iter().map(|step| {
            let name = step.title.as_deref().unwrap_or(&step.verb);
            json!({ "name": line(name), "status": step_status(step), "extra": { "outcome": line(&step.outcome) } })
        });
        test.insert("steps".to_owned(), steps.collect());
    }
    Value::Object(test)
}

fn step_status(step: &StepResult) -> &'static str {
    match step.outcome.as_str() {
        StepResult::DONE => "passed",
        StepResult::NOT_RUN => "skipped",
        _ => "failed",
    }
}
