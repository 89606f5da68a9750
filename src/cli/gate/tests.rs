//! Every combination of what can come of a run, against one sentence: the gate lets through only when every selected test that
//! applies was carried out on the device that was started, and was decided.
//!
//! A new way in which a run can come out is one line in [`ENDS`], [`TESTS`] or [`AROUND`].

use std::collections::BTreeMap;

use super::*;
use tck_base::diagnostic::{Source, Span};
use tck_journal::Reason;
use tck_net::bench::LinkError;
use tck_report::junit::{self, Flavour, Inconclusive};
use tck_result::{
    Decision, DeviceIdentity, MonitorFinding, MonitorResult, ProgramResult, Repetition, RequirementResult, TestResult,
};

/// A run that is being put together.
struct Case {
    end: End,
    result: RunResult,
    known: Vec<KnownFailure>,
    written: bool,
}

/// A way in which something can come out, and whether the sentence allows it to be let through.
type Way<T> = (&'static str, bool, fn() -> T);

/// Something that can be around the tests, and whether the sentence allows the run to be let through.
type Beside = (&'static str, bool, fn(&mut Case));

/// How a run can end.
const ENDS: [Way<End>; 8] = [
    ("to its end", true, || End::Completed),
    ("no device came", false, || End::NoDevice("nobody".to_owned())),
    ("another device spoke", false, || End::Stranger("another".to_owned())),
    ("the device is not what it was before the interruption", false, || {
        End::Changed("other".to_owned())
    }),
    ("the device went away", false, || End::Lost("gone".to_owned())),
    ("interrupted", false, || End::Interrupted),
    ("too much came", false, || End::Flooded("flood".to_owned())),
    ("the harness broke", false, || {
        End::Broken(LinkError::Setup("no".to_owned()).into())
    }),
];

/// What can come of a test that was selected.
const TESTS: [Way<TestResult>; 13] = [
    ("passed", true, || of(Some(Verdict::Pass), "ORD-01")),
    ("passed with a remark", true, || of(Some(Verdict::Warning), "ORD-01")),
    ("failed by something known", true, || of(Some(Verdict::Fail), KNOWN)),
    ("failed", false, || of(Some(Verdict::Fail), "ORD-01")),
    ("could not be decided", false, || {
        of(Some(Verdict::Inconclusive), "ORD-01")
    }),
    ("broke", false, || of(Some(Verdict::Error), "ORD-01")),
    ("decided nothing", false, || of(None, "ORD-01")),
    ("was not carried out", false, || TestResult {
        journal: None,
        ..of(Some(Verdict::Inconclusive), "ORD-01")
    }),
    ("had no time", false, || TestResult {
        journal: None,
        cause: Some(Reason::OverBudget { budget: 60 }),
        decisions: Vec::new(),
        ..of(Some(Verdict::Inconclusive), "ORD-01")
    }),
    ("was repeated as often as asked", true, || {
        repeated(Verdict::Pass, "ORD-01", 3)
    }),
    ("was repeated less often than asked", false, || {
        repeated(Verdict::Inconclusive, "ORD-01", 1)
    }),
    ("failed by something known, and was repeated less often", false, || {
        repeated(Verdict::Fail, KNOWN, 1)
    }),
    ("does not apply", true, || TestResult {
        not_applicable: Some("the factsheet says no".to_owned()),
        journal: None,
        decisions: Vec::new(),
        ..of(None, "ORD-01")
    }),
];

/// What can be around the tests.
const AROUND: [Beside; 11] = [
    ("nothing", true, |_| {}),
    ("monitors passed", true, |case| {
        case.result.monitors.push(monitor(Verdict::Pass, "HDR-01"));
    }),
    ("a monitor failed by something known", true, |case| {
        case.result.monitors.push(monitor(Verdict::Fail, KNOWN));
    }),
    ("a monitor failed", false, |case| {
        case.result.monitors.push(monitor(Verdict::Fail, "HDR-01"));
    }),
    ("the report could not be written", false, |case| case.written = false),
    ("the run ended early", false, |case| case.result.partial = true),
    ("somebody else may have been judged", false, |case| {
        case.result.mixed = Some("another".to_owned());
    }),
    ("the program ran until it was ended", true, |case| {
        case.result.program = Some(program(0, 0));
    }),
    ("the program ended by itself", false, |case| {
        case.result.program = Some(program(1, 0));
    }),
    ("the program ended, perhaps by somebody else", false, |case| {
        case.result.program = Some(program(1, 1));
    }),
    ("what is known has expired", true, |case| {
        "2000-01-01".clone_into(&mut case.known[0].until);
    }),
];

/// The requirement whose failure is known.
const KNOWN: &str = "ORD-02";

/// The program of `device.command`: how often it ended by itself, and how often somebody else may have ended it.
fn program(ends: u64, excused: u64) -> ProgramResult {
    ProgramResult {
        starts: 1 + ends,
        ends,
        excused,
        shown: Vec::new(),
    }
}

fn of(verdict: Option<Verdict>, requirement: &str) -> TestResult {
    let decisions = verdict.map(|verdict| {
        let (clause, place) = ("steps[0].assert".to_owned(), "file.yaml:1".to_owned());
        Decision::new(requirement, verdict, clause, place, "message".to_owned())
    });
    TestResult {
        id: "group/test".to_owned(),
        title: "Title".to_owned(),
        verdict,
        not_applicable: None,
        seconds: 1.0,
        reason: None,
        cause: None,
        maturity: "reviewed".to_owned(),
        maturity_note: None,
        journal: Some((1, 2)),
        decisions: decisions.into_iter().collect(),
        steps: Vec::new(),
        allowances: Vec::new(),
        repetitions: Vec::new(),
    }
}

/// A test that was to be run three times.
fn repeated(verdict: Verdict, requirement: &str, done: u32) -> TestResult {
    let repetitions = (1..=3).map(|number| Repetition {
        number,
        verdict: Some(verdict),
        seconds: 1.0,
        reason: None,
        journal: (number <= done).then_some((1, 2)),
    });
    TestResult {
        repetitions: repetitions.collect(),
        ..of(Some(verdict), requirement)
    }
}

fn monitor(verdict: Verdict, requirement: &str) -> MonitorResult {
    let finding = (verdict == Verdict::Fail).then(|| MonitorFinding {
        requirement: requirement.to_owned(),
        verdict,
        count: 1,
        first: vec![1],
        message: "message".to_owned(),
        interpretation: None,
    });
    MonitorResult {
        id: "group/monitor".to_owned(),
        title: "Title".to_owned(),
        verdict: Some(verdict),
        judged: 1,
        findings: finding.into_iter().collect(),
    }
}

/// A run as the judge puts it together: the verdict is the join over tests and monitors.
fn case(end: fn() -> End, tests: Vec<TestResult>, around: fn(&mut Case)) -> Case {
    let mut case = Case {
        end: end(),
        result: RunResult {
            format: "vda5050-tck.result/1".to_owned(),
            tool: "vda5050-tck 0".to_owned(),
            run: "run".to_owned(),
            mode: None,
            started: "2026-03-02T08:15:00.000Z".to_owned(),
            seconds: 1.0,
            role: "agv".to_owned(),
            protocol: "9.0.0".to_owned(),
            partial: false,
            partial_reason: None,
            verdict: None,
            program: None,
            mixed: None,
            device: DeviceIdentity::default(),
            vantage: "tap".to_owned(),
            suites_sha256: String::new(),
            suites_modified: false,
            journal: "journal.jsonl".to_owned(),
            joined: Vec::new(),
            shard: None,
            merged: None,
            tests,
            monitors: Vec::new(),
            requirements: Vec::new(),
            capabilities: Vec::new(),
            fleet: None,
            exploration: None,
            message_coverage: None,
            harness_latency: None,
            on_word: Vec::new(),
            limits: Vec::new(),
            deviations: BTreeMap::new(),
            settings: Vec::new(),
        },
        known: vec![KnownFailure {
            id: KNOWN.to_owned(),
            reason: "ticket".to_owned(),
            until: "2999-12-31".to_owned(),
            span: Span::new(&Source::new("device.toml", ""), 0, 0),
        }],
        written: true,
    };
    case.result.partial = !matches!(case.end, End::Completed);
    around(&mut case);
    let result = &mut case.result;
    let tests = result.tests.iter().map(|test| test.verdict);
    let monitors = result.monitors.iter().map(|monitor| monitor.verdict);
    result.verdict = tests
        .chain(monitors)
        .flatten()
        .chain(result.aside())
        .reduce(Verdict::join);
    for test in &result.tests {
        result
            .requirements
            .extend(test.decisions.iter().map(|decision| RequirementResult {
                id: decision.requirement.clone(),
                own: None,
                verdict: Some(decision.verdict()),
                decided_by: vec![test.id.clone()],
                shards: Vec::new(),
                verdicts: Vec::new(),
                not_decided: None,
            }));
    }
    result
        .requirements
        .extend(result.monitors.iter().map(|monitor| RequirementResult {
            id: "HDR-01".to_owned(),
            own: None,
            verdict: monitor.verdict,
            decided_by: vec![monitor.id.clone()],
            shards: Vec::new(),
            verdicts: Vec::new(),
            not_decided: None,
        }));
    case
}

/// Every combination of an end, up to two tests, and what is around them: what it is called, whether the sentence allows it to
/// be let through, and the run.
fn every_combination(mut holds: impl FnMut(&str, bool, &Case)) {
    let none: Vec<&Way<TestResult>> = Vec::new();
    let alone = TESTS.iter().map(|one| vec![one]);
    let pairs = TESTS
        .iter()
        .flat_map(|one| TESTS.iter().map(move |other| vec![one, other]));
    let selections: Vec<Vec<&Way<TestResult>>> = std::iter::once(none).chain(alone).chain(pairs).collect();
    for (ended, end_allows, end) in ENDS {
        for selection in &selections {
            for (beside, around_allows, around) in AROUND {
                let tests: Vec<TestResult> = selection.iter().map(|(_, _, test)| test()).collect();
                let case = case(end, tests, around);
                let any_applies = case.result.tests.iter().any(|test| test.not_applicable.is_none());
                let all_allow = selection.iter().all(|(_, allows, _)| *allows);
                let expired = case.known[0].until.starts_with("2000");
                // A list that has expired bears nothing.
                let is_borne = !expired || case.result.verdict != Some(Verdict::Fail);
                let allowed = end_allows && around_allows && all_allow && any_applies && is_borne;
                let names: Vec<&str> = selection.iter().map(|(name, ..)| *name).collect();
                holds(&format!("{ended}; tests: {names:?}; {beside}"), allowed, &case);
            }
        }
    }
}

#[test]
fn the_gate_lets_through_only_what_was_carried_out_and_decided() {
    let (mut green, mut all) = (0, 0);
    every_combination(|name, allowed, case| {
        let gate = Gate {
            end: &case.end,
            result: &case.result,
            known: &case.known,
            written: case.written,
        };
        let exit = gate.exit();
        assert!(allowed || exit != Exit::Conforms, "{name}: let through");
        // And it is no wall either.
        assert!(!allowed || exit == Exit::Conforms, "{name}: {exit:?}");
        let strict = Gate { known: &[], ..gate };
        let fails = case.result.verdict == Some(Verdict::Fail);
        assert!(
            !fails || strict.exit() != Exit::Conforms,
            "{name}: a failure was borne without a list"
        );
        green += usize::from(exit == Exit::Conforms);
        all += 1;
    });
    assert!(green > 50 && all > 5_000, "{green} of {all}");
}

#[test]
fn junit_is_green_only_where_tests_were_decided_however_the_undecided_are_shown() {
    every_combination(|name, allowed, case| {
        if !case.written {
            return;
        }
        for inconclusive in [Inconclusive::Error, Inconclusive::Skip] {
            let flavour = Flavour {
                inconclusive,
                root: None,
            };
            let xml = junit::render(&case.result, flavour).expect("junit");
            let red = xml.contains("<failure") || xml.contains("<error");
            let tests = &case.result.tests;
            let decided = tests.iter().filter_map(|test| test.verdict);
            let decided = decided
                .filter(|verdict| matches!(verdict, Verdict::Pass | Verdict::Warning))
                .count();
            assert!(
                red || decided > 0 && !case.result.partial,
                "{name}, {inconclusive:?}: {xml}"
            );
            if inconclusive == Inconclusive::Error {
                assert!(red || allowed, "{name}: {xml}");
            }
        }
    });
}
