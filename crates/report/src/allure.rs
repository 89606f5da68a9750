//! Results of Allure: a folder with a file for each case, from which Allure makes its own report.
//!
//! Allure tells broken from failed, so that what was not decided is *broken*. A result has no time at which a test began, only how
//! long it took: the tests stand one after another from the start of the run.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::cases::{Case, cases};
use super::clean::{block, line};
use super::junit::Inconclusive;
use super::no_result::NoResult;
use super::sources::Sources;
use super::time::{millis, millis_of_start};
use tck_base::verdict::Verdict;
use tck_journal::event::hex;
use tck_result::{RunResult, StepResult};

/// How the names of the files begin, so that those of an earlier run are known among others.
pub const BEGINS: &str = "vda5050-tck-";
/// How they end: Allure takes no others.
pub const ENDS: &str = "-result.json";

/// The files of a run: name and content.
#[must_use]
pub fn render(result: &RunResult, sources: &Sources, how: Inconclusive) -> Vec<(String, String)> {
    let mut at = millis_of_start(result);
    let all = cases(result, sources);
    let files = all.iter().map(|case| {
        let begun = at;
        at += millis(case.seconds);
        file(case, &result.run, &result.tool, begun, sources, how)
    });
    files.collect()
}

/// The file of a run that never came to be: one broken test.
#[must_use]
pub fn no_result(nothing: &NoResult) -> Vec<(String, String)> {
    let case = nothing.case();
    vec![file(
        &case,
        "",
        &nothing.tool,
        0,
        &Sources::default(),
        Inconclusive::Error,
    )]
}

fn file(case: &Case<'_>, run: &str, tool: &str, start: u64, sources: &Sources, how: Inconclusive) -> (String, String) {
    let how = if case.of_run() { Inconclusive::Error } else { how };
    // Alike in every run: Allure knows a test again by it.
    let history = digest(&[case.suite, &case.name]);
    let id = uuid(&digest(&[run, case.suite, &case.name]));
    let label = |name: &str, value: &str| json!({ "name": name, "value": line(value) });
    let mut labels = vec![
        label("framework", tool.split(' ').next().unwrap_or(tool)),
        label("suite", case.suite),
        label("verdict", case.word()),
    ];
    labels.extend(case.elsewhere.map(|place| label("counted-in", place.word())));
    labels.extend(case.requirements.iter().map(|id| label("requirement", id)));
    let links = case.requirements.iter().filter_map(|id| {
        let url = sources.requirement(id)?.link.as_deref()?;
        Some(json!({ "name": line(id), "url": line(url), "type": "requirement" }))
    });
    let links: Vec<Value> = links.collect();
    let mut details = json!({ "flaky": case.is_flaky() });
    if case.verdict != Some(Verdict::Pass) {
        details["message"] = block(&case.message).into();
        details["trace"] = block(&case.details).into();
    }
    let mut content = json!({
        "uuid": id,
        "historyId": &history[..32],
        "testCaseId": &history[..32],
        "fullName": line(&format!("{}: {}", case.suite, case.name)),
        "name": line(&case.name),
        "status": status(case.counted(), how),
        "statusDetails": details,
        "stage": "finished",
        "start": start,
        "stop": start + millis(case.seconds),
        "labels": labels,
        "links": links,
        "steps": case.test.map_or_else(Vec::new, |test| steps(&test.steps, start)),
        "parameters": [],
        "attachments": [],
    });
    if !case.title.is_empty() {
        content["description"] = line(case.title).into();
    }
    (format!("{BEGINS}{id}{ENDS}"), format!("{content:#}\n"))
}

fn status(verdict: Option<Verdict>, how: Inconclusive) -> &'static str {
    match verdict {
        Some(Verdict::Pass | Verdict::Warning) => "passed",
        Some(Verdict::Fail) => "failed",
        Some(Verdict::Inconclusive) if how == Inconclusive::Skip => "skipped",
        Some(Verdict::Inconclusive | Verdict::Error) => "broken",
        None => "skipped",
    }
}

fn steps(all: &[StepResult], start: u64) -> Vec<Value> {
    let mut at = start;
    let steps = all.iter().map(|step| {
        let begun = at;
        at += millis(step.seconds);
        json!({
            "name": line(step.title.as_deref().unwrap_or(&step.verb)),
            "status": match step.outcome.as_str() {
                StepResult::DONE => "passed",
                StepResult::NOT_RUN => "skipped",
                "failed" => "failed",
                _ => "broken",
            },
            "stage": "finished",
            "start": begun,
            "stop": at,
            "steps": [],
        })
    });
    steps.collect()
}

/// A hash over texts, in hexadecimal.
fn digest(texts: &[&str]) -> String {
    hex(&Sha256::digest(texts.join("\n")))
}

/// A hash in the form of a UUID of version 8, which anybody may fill.
pub(super) fn uuid(digest: &str) -> String {
    let part = |from: usize, to: usize| digest.get(from..to).unwrap_or("0000");
    format!(
        "{}-{}-8{}-8{}-{}",
        part(0, 8),
        part(8, 12),
        part(13, 16),
        part(17, 20),
        part(20, 32)
    )
}
