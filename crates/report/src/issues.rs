//! What is broken, as lists for the pages of code hosts: GitLab's code quality and SARIF.
//!
//! Both want a place in a file. It is the clause of the test, or the monitor, that found it.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::clean::{block, line, short};
use super::no_result::NoResult;
use super::sources::Sources;
use super::statement;
use tck_base::verdict::Verdict;
use tck_journal::event::hex;
use tck_result::RunResult;

/// The version of SARIF; it has nothing to do with the protocol.
const SARIF: [u8; 3] = [2, 1, 0];

/// One requirement broken in one place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issue<'a> {
    /// Its id.
    pub requirement: &'a str,
    /// How badly.
    pub verdict: Verdict,
    /// What is wrong.
    pub message: String,
    /// File and line.
    pub place: (String, usize),
    /// The test or monitor.
    pub by: &'a str,
    /// Whether it is about the run itself, and not about the device.
    pub of_run: bool,
}

impl Issue<'_> {
    /// Names the mistake, alike in every run, whatever was seen around it.
    fn fingerprint(&self) -> String {
        let what = format!("{}\n{}\n{}", self.requirement, self.by, self.place.0);
        hex(&Sha256::digest(what))
    }
}

/// The name under which a run that is not complete, or decided nothing, stands in the lists: without it a list that is empty
/// would look as if all had been mended.
pub const INCOMPLETE: &str = "run-incomplete";

/// Where a run is described: the file that says what the device is.
fn profile(result: &RunResult) -> String {
    let said = result
        .settings
        .iter()
        .filter(|setting| setting.name.starts_with("device."));
    let mut files = said.map(|setting| setting.origin.as_str());
    let file = files.find(|origin| !matches!(*origin, "default" | "environment" | "flag"));
    file.unwrap_or(USUAL_PROFILE).to_owned()
}

/// How a profile is usually called.
pub const USUAL_PROFILE: &str = "device.toml";

/// What is wrong with the run itself; then fails and warnings of tests and monitors, in the order of the result.
fn issues<'r>(result: &'r RunResult, sources: &Sources) -> Vec<Issue<'r>> {
    let given = |(file, line): (String, usize)| (sources.as_given(&file).to_owned(), line);
    let bad = |verdict: Verdict| matches!(verdict, Verdict::Fail | Verdict::Warning);
    let mut all: Vec<Issue<'_>> = Vec::new();
    all.extend(statement::trouble(result).map(|message| Issue {
        requirement: INCOMPLETE,
        verdict: Verdict::Fail,
        message,
        place: (profile(result), 1),
        by: "run",
        of_run: true,
    }));
    for test in &result.tests {
        for decision in test.decisions.iter().filter(|decision| bad(decision.verdict())) {
            all.push(Issue {
                requirement: &decision.requirement,
                verdict: decision.verdict(),
                message: decision.message.clone(),
                place: given(place(&decision.place)),
                by: &test.id,
                of_run: false,
            });
        }
    }
    for monitor in &result.monitors {
        for found in monitor.findings.iter().filter(|found| bad(found.verdict)) {
            all.push(Issue {
                requirement: &found.requirement,
                verdict: found.verdict,
                message: format!("{} ({} ×)", found.message, found.count),
                place: given((format!("suites/monitors/{}.yaml", monitor.id), 1)),
                by: &monitor.id,
                of_run: false,
            });
        }
    }
    all
}

/// `file:line`, taken apart.
fn place(text: &str) -> (String, usize) {
    match text.rsplit_once(':').map(|(file, line)| (file, line.parse())) {
        Some((file, Ok(line))) => (file.to_owned(), line),
        _ => (text.to_owned(), 1),
    }
}

/// GitLab's code quality report.
#[must_use]
pub fn code_quality(result: &RunResult, sources: &Sources) -> String {
    quality_page(&issues(result, sources))
}

/// GitLab's code quality report of a run that never came to be.
#[must_use]
pub fn code_quality_of(trouble: &NoResult) -> String {
    quality_page(&trouble_issues(trouble))
}

/// GitLab's code quality report of these issues.
#[must_use]
pub fn code_quality_of_issues(issues: &[Issue<'_>]) -> String {
    quality_page(issues)
}

/// SARIF 2.1.0 of these issues, found by this tool.
#[must_use]
pub fn sarif_of_issues(tool: &str, issues: &[Issue<'_>], sources: &Sources) -> String {
    let call = Invocation {
        tool,
        run: None,
        started: None,
        successful: true,
        exit: None,
    };
    sarif_log(issues, sources, &call)
}

fn quality_page(issues: &[Issue<'_>]) -> String {
    let all = issues.iter().map(|issue| {
        json!({
            "description": short(&line(&format!("{}: {} ({})", issue.requirement, issue.message, issue.by)), 500),
            "check_name": line(issue.requirement),
            "fingerprint": issue.fingerprint(),
            "severity": match issue.verdict {
                _ if issue.of_run => "blocker",
                Verdict::Fail => "major",
                _ => "minor",
            },
            "location": { "path": line(&issue.place.0), "lines": { "begin": issue.place.1.max(1) } },
        })
    });
    format!("{:#}\n", Value::Array(all.collect()))
}

/// What stands in the way of a run, as issues.
fn trouble_issues(trouble: &NoResult) -> Vec<Issue<'_>> {
    let all = trouble.problems.iter().map(|problem| Issue {
        requirement: INCOMPLETE,
        verdict: Verdict::Fail,
        message: problem.title.clone(),
        place: match &problem.place {
            Some((file, line)) => (file.clone(), *line),
            None => (trouble.profile.clone().unwrap_or_else(|| USUAL_PROFILE.to_owned()), 1),
        },
        by: "run",
        of_run: true,
    });
    all.collect()
}

/// SARIF 2.1.0.
#[must_use]
pub fn sarif(result: &RunResult, sources: &Sources) -> String {
    sarif_log(
        &issues(result, sources),
        sources,
        &Invocation {
            tool: &result.tool,
            run: Some(&result.run),
            started: Some(&result.started),
            successful: statement::trouble(result).is_none(),
            exit: None,
        },
    )
}

/// SARIF 2.1.0 of a run that never came to be.
#[must_use]
pub fn sarif_of(trouble: &NoResult) -> String {
    sarif_log(
        &trouble_issues(trouble),
        &Sources::default(),
        &Invocation {
            tool: &trouble.tool,
            run: None,
            started: None,
            successful: false,
            exit: Some(trouble.exit),
        },
    )
}

/// What SARIF says of the call itself.
struct Invocation<'a> {
    tool: &'a str,
    run: Option<&'a str>,
    started: Option<&'a str>,
    successful: bool,
    exit: Option<u8>,
}

fn sarif_log(issues: &[Issue<'_>], sources: &Sources, call: &Invocation<'_>) -> String {
    let mut rules: Vec<&str> = issues.iter().map(|issue| issue.requirement).collect();
    rules.sort_unstable();
    rules.dedup();
    let rules = rules.into_iter().map(|id| {
        let known = sources.requirement(id);
        let text = match known {
            Some(known) => line(&known.text),
            None if id == INCOMPLETE => "The run is complete, and decided something of what was selected.".into(),
            None => line(id),
        };
        let section = known.map_or("", |known| known.section.as_str());
        let mut rule = json!({
            "id": line(id),
            "shortDescription": { "text": text },
            "properties": { "section": line(section) },
        });
        if let Some(link) = known.and_then(|known| known.link.as_deref()) {
            rule["helpUri"] = line(link).into();
        }
        rule
    });
    let rules: Vec<Value> = rules.collect();
    let found = issues.iter().map(|issue| {
        json!({
            "ruleId": line(issue.requirement),
            "level": if issue.verdict == Verdict::Fail { "error" } else { "warning" },
            "message": { "text": block(&format!("{} (found by {})", issue.message, issue.by)) },
            "locations": [{
                "physicalLocation": {
                    "artifactLocation": { "uri": line(&issue.place.0) },
                    "region": { "startLine": issue.place.1.max(1) },
                },
            }],
            "partialFingerprints": { "requirement/v1": issue.fingerprint() },
        })
    });
    let found: Vec<Value> = found.collect();
    let (name, version) = call.tool.rsplit_once(' ').unwrap_or((call.tool, ""));
    let version_of_sarif = SARIF.map(|part| part.to_string()).join(".");
    let mut invocation = json!({ "executionSuccessful": call.successful });
    if let Some(started) = call.started {
        invocation["startTimeUtc"] = line(started).into();
    }
    if let Some(exit) = call.exit {
        invocation["exitCode"] = exit.into();
    }
    let run = call
        .run
        .map_or_else(|| "vda5050-tck".to_owned(), |run| format!("vda5050-tck/{}", line(run)));
    let log = json!({
        "$schema": format!("https://json.schemastore.org/sarif-{version_of_sarif}.json"),
        "version": version_of_sarif,
        "runs": [{
            "tool": { "driver": { "name": line(name), "version": line(version), "rules": rules } },
            "automationDetails": { "id": run },
            "invocations": [invocation],
            "results": found,
        }],
    });
    format!("{log:#}\n")
}
