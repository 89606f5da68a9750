//! Parts of results.

use std::collections::BTreeMap;

use vda5050_tck::journal::Event;
use vda5050_tck::journal::event::{RunHeader, Setting};
use vda5050_tck::report::json::FORMAT;
use vda5050_tck::result::{
    Capability, Decision, DeviceIdentity, MonitorResult, NotDecided, RequirementResult, RunResult, StepResult,
    TestResult,
};
use vda5050_tck::verdict::{Accumulated, Verdict};

use super::catalogue::{CHAPTERS, TEST_FILE};

pub fn decision(
    requirement: &str,
    verdict: Verdict,
    clause: &str,
    line: usize,
    witness: Option<u64>,
    message: &str,
) -> Decision {
    let (clause, place) = (clause.to_owned(), format!("{TEST_FILE}:{line}"));
    let mut decision = Decision::new(requirement, verdict, clause, place, message.to_owned());
    decision.witness = witness;
    decision
}

pub fn step(
    path: &str,
    verb: &str,
    title: &str,
    line: usize,
    outcome: &str,
    took: Option<u64>,
    seconds: f64,
) -> StepResult {
    StepResult {
        path: path.to_owned(),
        verb: verb.to_owned(),
        title: (!title.is_empty()).then(|| title.to_owned()),
        place: format!("{TEST_FILE}:{line}"),
        outcome: outcome.to_owned(),
        journal: None,
        took,
        seconds,
    }
}

pub fn test(id: &str, title: &str, verdict: Verdict, seconds: f64, decisions: Vec<Decision>) -> TestResult {
    TestResult {
        allowances: Vec::new(),
        repetitions: Vec::new(),
        id: id.to_owned(),
        title: title.to_owned(),
        verdict: Some(verdict),
        not_applicable: None,
        seconds,
        reason: None,
        cause: None,
        maturity: "reviewed".to_owned(),
        maturity_note: Some("2026-11-22, section 6.6.4".to_owned()),
        journal: None,
        decisions,
        steps: Vec::new(),
    }
}

pub fn setting(name: &str, value: &str, origin: &str) -> Setting {
    Setting::shown(name, value, origin)
}

pub fn capability(name: &str, value: &str, source: &str) -> Capability {
    Capability {
        name: name.to_owned(),
        value: value.to_owned(),
        source: source.to_owned(),
    }
}

pub fn run(tests: Vec<TestResult>, monitors: Vec<MonitorResult>) -> RunResult {
    let mut decided: BTreeMap<&str, (Accumulated, Vec<String>)> = BTreeMap::new();
    for test in &tests {
        for decision in &test.decisions {
            let entry = decided.entry(&decision.requirement).or_default();
            entry.0.add(decision.verdict());
            entry.1.push(test.id.clone());
        }
    }
    for monitor in &monitors {
        for finding in &monitor.findings {
            let entry = decided.entry(&finding.requirement).or_default();
            entry.0.add(finding.verdict);
            entry.1.push(monitor.id.clone());
        }
    }
    let requirements = CHAPTERS
        .iter()
        .flat_map(|(_, _, rows)| rows.iter())
        .map(|(id, _, how, _)| {
            let found = decided.get(id);
            let passive = (*how == "passive" && found.is_none()).then_some(Verdict::Pass);
            RequirementResult {
                id: (*id).to_owned(),
                own: None,
                verdict: found.and_then(|(verdict, _)| verdict.get()).or(passive),
                shards: Vec::new(),
                decided_by: match (found, passive) {
                    (Some((_, by)), _) => by.clone(),
                    (None, Some(_)) => vec!["header/id-rises".to_owned()],
                    (None, None) => Vec::new(),
                },
                verdicts: Vec::new(),
                not_decided: match (found, passive, *how) {
                    (Some(_), _, _) | (_, Some(_), _) => None,
                    (_, _, "none") => Some(NotDecided::NotTestable(
                        "what a vehicle keeps secret cannot be seen from outside".to_owned(),
                    )),
                    (_, _, "operator") => Some(NotDecided::NotApplicable(String::new())),
                    _ => Some(NotDecided::NotSelected),
                },
            }
        })
        .collect();
    let verdicts = tests
        .iter()
        .map(|test| test.verdict)
        .chain(monitors.iter().map(|monitor| monitor.verdict));
    let verdict = verdicts.flatten().collect::<Accumulated>().get();
    RunResult {
        mode: None,
        format: FORMAT.to_owned(),
        tool: "vda5050-tck 0.1.0".to_owned(),
        run: "0193f2b1".to_owned(),
        started: "2026-03-02T08:15:00.000Z".to_owned(),
        seconds: 42.5,
        role: "agv".to_owned(),
        protocol: "2.1.0".to_owned(),
        partial: false,
        partial_reason: None,
        verdict,
        program: None,
        mixed: None,
        device: DeviceIdentity {
            manufacturer: "Lindner".to_owned(),
            serial_number: "TX-0042".to_owned(),
            series_name: Some("TX 1500".to_owned()),
        },
        vantage: "tap".to_owned(),
        suites_sha256: "5f0c2c1d9a7b3e4f5a6b7c8d9e0f1a2b3c4d5e6f708192a3b4c5d6e7f8091a2b".to_owned(),
        suites_modified: false,
        journal: "journal.jsonl".to_owned(),
        joined: Vec::new(),
        shard: None,
        merged: None,
        tests,
        monitors,
        requirements,
        capabilities: vec![
            capability("action downloadMap INSTANT", "yes", "factsheet"),
            capability("stops-between-nodes", "no", "profile"),
            capability(
                "action startPause INSTANT",
                "yes",
                "factsheet says yes, profile says no",
            ),
        ],
        fleet: None,
        exploration: None,
        message_coverage: None,
        harness_latency: None,
        on_word: Vec::new(),
        limits: vec!["Only tests of the group order were selected.".to_owned()],
        deviations: BTreeMap::new(),
        settings: vec![
            setting("broker", "embedded", "default"),
            setting("time.react", "31 s", "default"),
            setting("time.slow", "2 s", "device.toml"),
        ],
    }
}

pub fn header(command: &[&str]) -> Event {
    Event::RunBegun {
        header: Box::new(RunHeader {
            command: command.iter().map(|word| (*word).to_owned()).collect(),
            ..RunHeader::default()
        }),
    }
}
