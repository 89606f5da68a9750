//! A run in which every string is hostile.

use std::collections::BTreeMap;

use serde_json::json;
use vda5050_tck::journal::event::{Close, LinkFault, StepEnd};
use vda5050_tck::journal::{Direction, Event, Journal, OwnLatency, Packet, Payload, Spread};
use vda5050_tck::pack::Role;
use vda5050_tck::report::sources::{ClauseSource, HowDecided, MonitorSource, RequirementText, Sources, TestSource};
use vda5050_tck::result::{
    ActionCoverage, Answers, Capability, Decision, DeviceIdentity, ExplorationResult, MemberCoverage, MemberResult,
    MessageCoverage, MonitorFinding, MonitorResult, NearestMiss, NeverShown, NotDecided, OnWord, ProgramEnd,
    ProgramResult, RequirementResult, RunResult, SaidResult, StepResult, TestResult, TopicCoverage, Unseen, Waited,
    WordKind,
};
use vda5050_tck::verdict::Verdict;

use super::parts::{header, run, setting};
use super::record::Recorder;

/// What a device may choose to be called.
pub const HOSTILE: &str = "<script>alert(1)</script>\"'&]]>\u{1b}[31m\u{0}\u{202e}\u{ffff}{{ 7 }}";

/// A partial run in which every string is hostile.
pub fn hostile() -> (RunResult, Journal, Sources) {
    let evil = || HOSTILE.to_owned();
    let endless = Spread {
        count: u64::MAX,
        median_micros: u64::MAX,
        p99_micros: u64::MAX,
        worst_micros: u64::MAX,
    };
    let mut record = Recorder::new();
    record.harness(header(&[HOSTILE]));
    let first = record.step(HOSTILE);
    record.mark(HOSTILE);
    record.packet(
        Direction::FromDevice,
        Packet::Connect {
            level: 4,
            client_id: evil(),
            keep_alive: 0,
            clean_session: false,
            username: Some(evil()),
            has_password: true,
            will: None,
        },
    );
    record.send(HOSTILE, &json!({ HOSTILE: HOSTILE }));
    let witness = record.receive(
        "state",
        &json!({
            "orderId": HOSTILE, "lastNodeId": HOSTILE, "operatingMode": HOSTILE,
            "errors": [{ "errorType": HOSTILE }], "actionStates": [{ "actionId": HOSTILE, "actionStatus": HOSTILE }]
        }),
    );
    record.receive("order", &json!({ "orderId": HOSTILE, "nodes": 7 }));
    record.receive("instantActions", &json!({ "actions": [{ "actionType": HOSTILE }] }));
    record.receive_bytes("state", HOSTILE.as_bytes());
    record.receive_bytes("state", &[0xff, 0xfe, 0]);
    let huge = format!("{{\"a\":\"{}\"}}", HOSTILE.escape_unicode()).repeat(4_000);
    record.receive_bytes("state", huge.as_bytes());
    record.harness(Event::Fault {
        fault: LinkFault::Drop {
            topic: Some(evil()),
            count: 2,
            direction: None,
        },
    });
    record.harness(Event::Hook {
        hook: evil(),
        ok: false,
        detail: evil(),
        vehicle: None,
    });
    record.harness(Event::Answer {
        prompt: evil(),
        answer: evil(),
        ok: true,
    });
    record.harness(Event::Note { text: evil() });
    record.harness(Event::Trouble { text: evil() });
    record.harness(Event::Served {
        name: evil(),
        url: evil(),
        behaviour: evil(),
    });
    record.harness(Event::Fetched {
        name: evil(),
        request: evil(),
        status: Some(404),
        phase: evil(),
    });
    record.harness(Event::Opened {
        connection: 1,
        peer: evil(),
    });
    record.harness(Event::Undecodable {
        connection: 1,
        reason: evil(),
        bytes: Payload::keep(vec![0xff].into()),
    });
    record.harness(Event::Closed {
        connection: 1,
        how: Close::DeviceReset,
    });
    let last = record.end(HOSTILE, StepEnd::Broken(evil()));

    let decide = |verdict| {
        let mut decision = Decision::new(&evil(), verdict, evil(), format!("{HOSTILE}:3"), evil());
        decision.witness = Some(witness);
        decision.expected = Some(evil());
        decision.nearest = Some(NearestMiss {
            seq: witness,
            path: evil(),
            found: evil(),
            expected: evil(),
        });
        decision.waited = Some(Waited {
            seconds: 1.0,
            since: first,
            messages: 1,
        });
        decision.explanation = Some(format!("{HOSTILE}\n | {HOSTILE}\n | ^^^ {HOSTILE}"));
        decision.interpretation = Some(evil());
        decision
    };
    let tests = Verdict::ALL
        .into_iter()
        .map(Some)
        .chain([None])
        .map(|verdict| TestResult {
            id: format!("{HOSTILE}/{}", verdict.map_or("none", Verdict::word)),
            title: evil(),
            verdict,
            not_applicable: verdict.is_none().then(evil),
            seconds: f64::MAX,
            cause: None,
            reason: Some(evil()),
            maturity: "watchlist".to_owned(),
            maturity_note: Some(evil()),
            journal: Some((first, last)),
            decisions: verdict.map(decide).into_iter().collect(),
            steps: vec![StepResult {
                path: evil(),
                verb: evil(),
                title: Some(evil()),
                place: evil(),
                outcome: evil(),
                journal: Some((first, last)),
                took: Some(witness),
                seconds: -1.0,
            }],
            allowances: vec![evil()],
            repetitions: Vec::new(),
        })
        .collect::<Vec<_>>();
    let monitors = vec![MonitorResult {
        id: evil(),
        title: evil(),
        verdict: Some(Verdict::Fail),
        judged: u64::MAX,
        findings: vec![MonitorFinding {
            requirement: evil(),
            verdict: Verdict::Fail,
            count: u64::MAX,
            first: vec![witness, u64::MAX],
            message: evil(),
            interpretation: Some(evil()),
        }],
    }];
    let result = RunResult {
        mode: Some(HOSTILE.to_owned()),
        tool: evil(),
        run: evil(),
        started: evil(),
        role: evil(),
        protocol: evil(),
        partial: true,
        partial_reason: Some(evil()),
        device: DeviceIdentity {
            manufacturer: evil(),
            serial_number: evil(),
            series_name: Some(evil()),
        },
        vantage: evil(),
        suites_sha256: evil(),
        suites_modified: true,
        journal: evil(),
        requirements: vec![
            RequirementResult {
                id: evil(),
                own: None,
                verdict: Some(Verdict::Fail),
                decided_by: vec![evil()],
                shards: Vec::new(),
                verdicts: Vec::new(),
                not_decided: None,
            },
            RequirementResult {
                id: "X Y".to_owned(),
                own: None,
                verdict: None,
                decided_by: Vec::new(),
                shards: Vec::new(),
                verdicts: Vec::new(),
                not_decided: Some(NotDecided::Other(evil())),
            },
        ],
        capabilities: vec![Capability {
            name: evil(),
            value: evil(),
            source: evil(),
        }],
        exploration: Some(explored()),
        message_coverage: Some(shown()),
        harness_latency: OwnLatency::of(Some(endless), Some(endless)),
        on_word: vec![OnWord {
            test: evil(),
            kind: WordKind::Answer,
            what: evil(),
        }],
        program: Some(ProgramResult {
            starts: 2,
            ends: u64::MAX,
            excused: 1,
            shown: vec![ProgramEnd {
                how: evil(),
                seq: witness,
                seconds: f64::MAX,
                sent: Some(u64::MAX),
                words: evil(),
                excuse: None,
            }],
        }),
        mixed: Some(evil()),
        limits: vec![evil()],
        deviations: BTreeMap::from([(evil(), evil())]),
        settings: vec![setting(HOSTILE, HOSTILE, HOSTILE)],
        ..run(tests, monitors)
    };
    let sources = Sources {
        requirements: vec![RequirementText {
            id: evil(),
            chapter: evil(),
            text: evil(),
            role: evil(),
            mood: evil(),
            section: evil(),
            link: None,
            interpretation: Some(evil()),
            decided: HowDecided::NotTestable(evil()),
            action: Some(evil()),
            rests_on: vec![evil()],
        }],
        tests: vec![TestSource {
            id: format!("{HOSTILE}/fail"),
            role: Role::Agv,
            title: evil(),
            why: evil(),
            operator: true,
            file: evil(),
            text: format!("{HOSTILE}\n{HOSTILE}\n{HOSTILE}"),
            clauses: vec![ClauseSource {
                requirement: evil(),
                path: evil(),
                lines: (1, usize::MAX - 1),
                step: (0, usize::MAX - 1),
            }],
        }],
        monitors: vec![MonitorSource {
            id: evil(),
            role: None,
            title: evil(),
            why: evil(),
            requirements: vec![evil()],
        }],
        given: std::collections::BTreeMap::new(),
    };
    (result, record.journal, sources)
}

/// A conversation whose names are hostile, too.
fn explored() -> ExplorationResult {
    let answers = Answers {
        as_demanded: 1,
        broken: usize::MAX / 4,
        undecided: 1,
    };
    ExplorationResult {
        said: vec![SaidResult {
            situation: HOSTILE.to_owned(),
            stimulus: HOSTILE.to_owned(),
            answers,
        }],
        members: vec![MemberResult {
            stimulus: HOSTILE.to_owned(),
            member: HOSTILE.to_owned(),
            way: HOSTILE.to_owned(),
            answers,
        }],
    }
}

/// Messages whose members, words and action types are hostile.
fn shown() -> MessageCoverage {
    let evil = || HOSTILE.to_owned();
    let member = |name: String, messages: u64| MemberCoverage {
        member: name,
        mandatory: true,
        messages,
        words: BTreeMap::from([(evil(), 0)]),
    };
    MessageCoverage {
        topics: vec![TopicCoverage {
            topic: evil(),
            publisher: "agv".to_owned(),
            messages: u64::MAX,
            shown: 1,
            of: 2,
            members: vec![member(evil(), 0), member(format!("/{HOSTILE}"), 1)],
            others: vec![evil()],
        }],
        actions: vec![ActionCoverage {
            action: evil(),
            declared: u64::MAX,
            ..ActionCoverage::default()
        }],
        undecided: vec![NeverShown {
            by: evil(),
            requirements: vec![evil()],
            missing: vec![Unseen {
                topic: evil(),
                member: Some(evil()),
                word: Some(evil()),
            }],
        }],
    }
}
