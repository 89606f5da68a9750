//! What is broken, as lists for the pages of code hosts: GitLab's code quality and SARIF.
//!
//! Both want a place in a file. It is the clause of the test, or the monitor, that found it.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::clean::{block, line, short};
use super::sources::Sources;
use tck_base::verdict::Verdict;
use tck_journal::event::hex;
use tck_result::RunResult;

/// The version of SARIF; it has nothing to do with the protocol.
const SARIF: [u8; 3] = [2, 1, 0];

/// One requirement broken in one place.
struct Issue<'a> {
    requirement: &'a str,
    verdict: Verdict,
    message: String,
    /// File and line.
    place: (String, usize),
    /// The test or monitor.
    by: &'a str,
}

impl Issue<'_> {
    /// The same for the same mistake in every run, whatever was seen around it.
    fn fingerprint(&self) -> String {
        let what = format!("{}\n{}\n{}", self.requirement, self.by, self.place.0);
        hex(&Sha256::digest(what))
    }
}

/// Fails and warnings of tests and monitors, in the order of the result.
fn issues(result: &RunResult) -> Vec<Issue<'_>> {
    let bad = |verdict: Verdict| matches!(verdict, Verdict::Fail | Verdict::Warning);
    let mut all: Vec<Issue<'_>> = Vec::new();
    for test in &result.tests {
        for decision in test.decisions.iter().filter(|decision| bad(decision.verdict())) {
            all.push(Issue {
                requirement: &decision.requirement,
                verdict: decision.verdict(),
                message: decision.message.clone(),
                place: place(&decision.place),
                by: &test.id,
            });
        }
    }
    for monitor in &result.monitors {
        for found in monitor.findings.iter().filter(|found| bad(found.verdict)) {
            all.push(Issue {
                requirement: &found.requirement,
                verdict: found.verdict,
                message: format!("{} ({} ×)", found.message, found.count),
                place: (format!("suites/monitors/{}.yaml", monitor.id), 1),
                by: &monitor.id,
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
pub fn code_quality(result: &RunResult) -> String {
    let all = issues(result).into_iter().map(|issue| {
        json!({
            "description": short(&line(&format!("{}: {} ({})", issue.requirement, issue.message, issue.by)), 500),
            "check_name": line(issue.requirement),
            "fingerprint": issue.fingerprint(),
            "severity": if issue.verdict == Verdict::Fail { "major" } else { "minor" },
            "location": { "path": line(&issue.place.0), "lines": { "begin": issue.place.1 } },
        })
    });
    format!("{:#}\n", Value::Array(all.collect()))
}

/// SARIF 2.1.0.
#[must_use]
pub fn sarif(result: &RunResult, sources: &Sources) -> String {
    let issues = issues(result);
    let mut rules: Vec<&str> = issues.iter().map(|issue| issue.requirement).collect();
    rules.sort_unstable();
    rules.dedup();
    let rules = rules.into_iter().map(|id| {
        let text = sources.requirement(id).map_or("", |known| known.text.as_str());
        let section = sources.requirement(id).map_or("", |known| known.section.as_str());
        json!({
            "id": line(id),
            "shortDescription": { "text": if text.is_empty() { line(id) } else { line(text) } },
            "properties": { "section": line(section) },
        })
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
    let (name, version) = result.tool.rsplit_once(' ').unwrap_or((&result.tool, ""));
    let version_of_sarif = SARIF.map(|part| part.to_string()).join(".");
    let log = json!({
        "$schema": format!("https://json.schemastore.org/sarif-{version_of_sarif}.json"),
        "version": version_of_sarif,
        "runs": [{
            "tool": { "driver": { "name": line(name), "version": line(version), "rules": rules } },
            "automationDetails": { "id": format!("vda5050-tck/{}", line(&result.run)) },
            "invocations": [{
                "executionSuccessful": !result.partial,
                "startTimeUtc": line(&result.started),
            }],
            "results": found,
        }],
    });
    format!("{log:#}\n")
}
