//! Three runs as they could have happened, built by hand.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use vda5050_tck::clock::{Moment, Stamp};
use vda5050_tck::journal::event::{Close, LinkFault, Occurrence, RunHeader, Setting, StepEnd};
use vda5050_tck::journal::{Direction, Event, Journal, Packet, Payload, Source, Will};
use vda5050_tck::pack::Role;
use vda5050_tck::report::json::FORMAT;
use vda5050_tck::report::result::{
    Capability, Decision, DeviceIdentity, MonitorFinding, MonitorResult, NearestMiss, RequirementResult, RunResult,
    StepResult, TestResult, Waited,
};
use vda5050_tck::report::sources::{ClauseSource, HowDecided, MonitorSource, RequirementText, Sources, TestSource};
use vda5050_tck::verdict::{Accumulated, Verdict};

const PREFIX: &str = "uagv/v2/Lindner/TX-0042";

/// Writes a journal by hand.
pub struct Recorder {
    pub journal: Journal,
    millis: u64,
}

impl Recorder {
    pub fn new() -> Self {
        Self {
            journal: Journal::new(),
            millis: 0,
        }
    }

    fn push(&mut self, source: Source, direction: Option<Direction>, event: Event) -> u64 {
        let start: jiff::Timestamp = "2026-03-02T08:15:00Z".parse().expect("time");
        let at = Stamp {
            moment: Moment::START,
            utc: start,
        }
        .at(Moment::from_micros(self.millis * 1000));
        self.journal
            .append(Occurrence {
                at,
                source,
                direction,
                event,
            })
            .seq()
    }

    pub fn wait(&mut self, millis: u64) -> &mut Self {
        self.millis += millis;
        self
    }

    pub fn harness(&mut self, event: Event) -> u64 {
        self.push(Source::Harness, None, event)
    }

    pub fn packet(&mut self, way: Direction, packet: Packet) -> u64 {
        self.push(Source::Tap, Some(way), Event::Packet { connection: 1, packet })
    }

    pub fn publish(&mut self, way: Direction, topic: &str, bytes: &[u8]) -> u64 {
        let payload = Payload::keep(bytes.to_vec().into());
        let topic = format!("{PREFIX}/{topic}");
        self.packet(
            way,
            Packet::Publish {
                topic,
                qos: 0,
                retain: false,
                dup: false,
                packet_id: None,
                payload,
            },
        )
    }

    /// Sent by the harness and seen on its way to the device.
    pub fn send(&mut self, topic: &str, message: &Value) -> u64 {
        let bytes = message.to_string();
        let payload = Payload::keep(bytes.clone().into());
        let full = format!("{PREFIX}/{topic}");
        let seq = self.harness(Event::Sent {
            topic: full,
            qos: 0,
            retain: false,
            payload,
        });
        self.wait(2).publish(Direction::ToDevice, topic, bytes.as_bytes());
        seq
    }

    /// Published by the device, seen at the tap, delivered to the harness.
    pub fn receive(&mut self, topic: &str, message: &Value) -> u64 {
        self.receive_bytes(topic, message.to_string().as_bytes())
    }

    pub fn receive_bytes(&mut self, topic: &str, bytes: &[u8]) -> u64 {
        self.publish(Direction::FromDevice, topic, bytes);
        self.wait(1).deliver(topic, bytes)
    }

    /// Delivered to the harness without having been seen at the tap.
    pub fn deliver(&mut self, topic: &str, bytes: &[u8]) -> u64 {
        let payload = Payload::keep(bytes.to_vec().into());
        let topic = format!("{PREFIX}/{topic}");
        self.push(
            Source::Link,
            Some(Direction::FromDevice),
            Event::Message {
                topic,
                qos: 0,
                retain: false,
                dup: false,
                payload,
            },
        )
    }

    pub fn step(&mut self, path: &str) -> u64 {
        self.harness(Event::StepBegun { path: path.to_owned() })
    }

    pub fn end(&mut self, path: &str, end: StepEnd) -> u64 {
        self.harness(Event::StepEnded {
            path: path.to_owned(),
            end,
        })
    }

    pub fn mark(&mut self, path: &str) -> u64 {
        self.harness(Event::Mark { path: path.to_owned() })
    }
}

pub fn order(update: u64, base: &[&str], horizon: &[&str]) -> Value {
    let nodes = base
        .iter()
        .map(|name| (name, true))
        .chain(horizon.iter().map(|name| (name, false)));
    let nodes: Vec<Value> = nodes
        .enumerate()
        .map(|(at, (name, released))| json!({ "nodeId": name, "sequenceId": at * 2, "released": released, "actions": [] }))
        .collect();
    json!({
        "headerId": update + 1, "timestamp": "2026-03-02T08:15:01.000Z", "version": "2.1.0",
        "manufacturer": "Lindner", "serialNumber": "TX-0042",
        "orderId": "order-7c1e", "orderUpdateId": update, "nodes": nodes, "edges": []
    })
}

pub fn state(header: u64, update: u64, node: &str, errors: &Value) -> Value {
    json!({
        "headerId": header, "timestamp": "2026-03-02T08:15:02.000Z", "version": "2.1.0",
        "manufacturer": "Lindner", "serialNumber": "TX-0042",
        "orderId": "order-7c1e", "orderUpdateId": update, "lastNodeId": node, "lastNodeSequenceId": 0,
        "nodeStates": [], "edgeStates": [], "driving": false, "actionStates": [],
        "batteryState": { "batteryCharge": 81.5, "charging": false }, "operatingMode": "AUTOMATIC",
        "errors": errors, "safetyState": { "eStop": "NONE", "fieldViolation": false }
    })
}

const CHAPTERS: [(&str, &str, &[(&str, &str, &str, &str)]); 3] = [
    (
        "Rejection of orders",
        "6.6.4.3",
        &[
            (
                "ORD-REJ-10",
                "shall",
                "active",
                "Keep the order that is running when an outdated update arrives.",
            ),
            (
                "ORD-REJ-11",
                "shall",
                "active",
                "Continue the running order after an outdated update was refused.",
            ),
            (
                "ORD-REJ-12",
                "shall",
                "active",
                "Report an outdated order update as an error of the type for it, with level WARNING.",
            ),
            (
                "ORD-REJ-14",
                "should",
                "active",
                "Name the offending orderUpdateId in the references of the error.",
            ),
            (
                "ORD-REJ-17",
                "shall",
                "active",
                "Report every refused order as an error.",
            ),
            ("ORD-REJ-18", "may", "operator", "Show the refusal on the vehicle."),
        ],
    ),
    (
        "Header",
        "6.4",
        &[
            (
                "HDR-01",
                "shall",
                "passive",
                "Count headerId up by one with each message of a topic.",
            ),
            ("HDR-02", "shall", "passive", "Give the time of creation in UTC."),
        ],
    ),
    (
        "Connection",
        "6.14",
        &[
            ("CONN-02", "shall", "active", "Register a last will when connecting."),
            ("CONN-05", "shall", "passive", "Publish connection messages retained."),
            ("CONN-09", "shall", "none", "Keep the credentials of the broker secret."),
            ("CONN-11", "should", "active", "Announce an intended disconnection."),
        ],
    ),
];

pub const TEST_FILE: &str = "suites/agv/order/update-lower-id-refused.yaml";
pub const TEST_TEXT: &str = r#"test: order/update-lower-id-refused
title: An outdated order update is refused, and the running order goes on
device: agv
why: A late message must not pull the vehicle back to a plan the master control has given up.

given:
  - use: idle-on-course

steps:
  - send: order
    title: An order that stays open, because its horizon is never released
    route: { base: [a, b], horizon: [c, d] }
    payload: { orderId: "${run.order}", orderUpdateId: 0 }
  - expect: state
    within: ${time.react}
    where: { orderId: "${run.order}", orderUpdateId: 0 }
  - send: order
    title: Update 1 releases c
    route: { base: [b, c], horizon: [d] }
    payload: { orderId: "${run.order}", orderUpdateId: 1 }
  - send: order
    title: Update 0 arrives late
    route: { base: [a, b], horizon: [c, d] }
    payload: { orderId: "${run.order}", orderUpdateId: 0 }
  - expect: state
    title: The refusal is reported
    checks: [ORD-REJ-17]
    within: ${time.react}
    where:
      errors: { $hasNew: {} }
    assert:
      ORD-REJ-12:
        errors: { $hasNew: { errorType: "${vda.error.outdatedUpdate}", errorLevel: WARNING } }
      ORD-REJ-14:
        errors: { $hasNew: { errorReferences: { $has: { referenceKey: orderUpdateId, referenceValue: "0" } } } }
  - always: state
    title: The order on the vehicle is kept
    checks: [ORD-REJ-10]
    where: { orderId: "${run.order}", orderUpdateId: 1 }
    until:
      checks: [ORD-REJ-11]
      within: ${time.drive}
      where: { lastNodeId: "${course.c}" }

finally:
  - use: cancel-order
"#;

pub fn sources() -> Sources {
    let requirements = CHAPTERS
        .iter()
        .flat_map(|(chapter, section, rows)| {
            rows.iter().map(move |(id, mood, how, text)| RequirementText {
                id: (*id).to_owned(),
                chapter: (*chapter).to_owned(),
                text: (*text).to_owned(),
                role: "agv".to_owned(),
                mood: (*mood).to_owned(),
                section: (*section).to_owned(),
                interpretation: (*id == "ORD-REJ-12").then(|| {
                    "The table of error types is read as binding; another type is accepted with a remark only where the text gives none.".to_owned()
                }),
                decided: match *how {
                    "active" => HowDecided::Active,
                    "passive" => HowDecided::Passive,
                    "operator" => HowDecided::Operator,
                    _ => HowDecided::NotTestable("what a vehicle keeps secret cannot be seen from outside".to_owned()),
                },
            })
        })
        .collect();
    let clause = |requirement: &str, path: &str, line: usize, end: usize, step: (usize, usize)| ClauseSource {
        requirement: requirement.to_owned(),
        path: path.to_owned(),
        lines: (line, end),
        step,
    };
    let test = |id: &str, title: &str, operator: bool, clauses: Vec<ClauseSource>| TestSource {
        id: id.to_owned(),
        role: Role::Agv,
        title: title.to_owned(),
        why: String::new(),
        operator,
        file: format!("suites/agv/{id}.yaml"),
        text: format!("test: {id}\n"),
        clauses,
    };
    Sources {
        requirements,
        tests: vec![
            TestSource {
                why: "A late message must not pull the vehicle back to a plan the master control has given up."
                    .to_owned(),
                file: TEST_FILE.to_owned(),
                text: TEST_TEXT.to_owned(),
                ..test(
                    "order/update-lower-id-refused",
                    "An outdated order update is refused, and the running order goes on",
                    false,
                    vec![
                        clause("ORD-REJ-17", "steps[4].checks", 27, 27, (25, 35)),
                        clause("ORD-REJ-12", "steps[4].assert", 32, 33, (25, 35)),
                        clause("ORD-REJ-14", "steps[4].assert", 34, 35, (25, 35)),
                        clause("ORD-REJ-10", "steps[5].checks", 38, 38, (36, 43)),
                        clause("ORD-REJ-11", "steps[5].until", 41, 41, (36, 43)),
                    ],
                )
            },
            test(
                "connection/last-will",
                "A last will is registered",
                false,
                vec![clause("CONN-02", "steps[0].assert", 1, 1, (1, 1))],
            ),
            test(
                "order/refusal-shown",
                "A refusal is shown on the vehicle",
                true,
                vec![clause("ORD-REJ-18", "steps[0].checks", 1, 1, (1, 1))],
            ),
        ],
        monitors: vec![MonitorSource {
            id: "header/id-rises".to_owned(),
            role: None,
            title: "headerId rises by one per topic".to_owned(),
            why: "Without it a lost message cannot be told from one that was never sent.".to_owned(),
            requirements: vec!["HDR-01".to_owned()],
        }],
    }
}

fn decision(
    requirement: &str,
    verdict: Verdict,
    clause: &str,
    line: usize,
    witness: Option<u64>,
    message: &str,
) -> Decision {
    Decision {
        requirement: requirement.to_owned(),
        verdict,
        clause: clause.to_owned(),
        place: format!("{TEST_FILE}:{line}"),
        witness,
        message: message.to_owned(),
        expected: None,
        nearest: None,
        waited: None,
        explanation: None,
        interpretation: None,
    }
}

fn step(
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

fn test(id: &str, title: &str, verdict: Verdict, seconds: f64, decisions: Vec<Decision>) -> TestResult {
    TestResult {
        id: id.to_owned(),
        title: title.to_owned(),
        verdict: Some(verdict),
        not_applicable: None,
        seconds,
        reason: None,
        maturity: "reviewed".to_owned(),
        journal: None,
        decisions,
        steps: Vec::new(),
    }
}

fn setting(name: &str, value: &str, origin: &str) -> Setting {
    Setting {
        name: name.to_owned(),
        value: value.to_owned(),
        origin: origin.to_owned(),
    }
}

fn capability(name: &str, value: &str, source: &str) -> Capability {
    Capability {
        name: name.to_owned(),
        value: value.to_owned(),
        source: source.to_owned(),
    }
}

fn run(tests: Vec<TestResult>, monitors: Vec<MonitorResult>) -> RunResult {
    let mut decided: BTreeMap<&str, (Accumulated, Vec<String>)> = BTreeMap::new();
    for test in &tests {
        for decision in &test.decisions {
            let entry = decided.entry(&decision.requirement).or_default();
            entry.0.add(decision.verdict);
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
                verdict: found.and_then(|(verdict, _)| verdict.get()).or(passive),
                decided_by: match (found, passive) {
                    (Some((_, by)), _) => by.clone(),
                    (None, Some(_)) => vec!["header/id-rises".to_owned()],
                    (None, None) => Vec::new(),
                },
                not_decided: match (found, passive, *how) {
                    (Some(_), _, _) | (_, Some(_), _) => None,
                    (_, _, "none") => {
                        Some("not testable: what a vehicle keeps secret cannot be seen from outside".to_owned())
                    }
                    (_, _, "operator") => Some("not applicable".to_owned()),
                    _ => Some("not selected".to_owned()),
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
        device: DeviceIdentity {
            manufacturer: "Lindner".to_owned(),
            serial_number: "TX-0042".to_owned(),
            series_name: Some("TX 1500".to_owned()),
        },
        vantage: "tap".to_owned(),
        suites_sha256: "5f0c2c1d9a7b3e4f5a6b7c8d9e0f1a2b3c4d5e6f708192a3b4c5d6e7f8091a2b".to_owned(),
        suites_modified: false,
        journal: "journal.jsonl".to_owned(),
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
        limits: vec!["Only tests of the group order were selected.".to_owned()],
        deviations: BTreeMap::new(),
        settings: vec![
            setting("broker", "embedded", "default"),
            setting("time.react", "31 s", "default"),
            setting("time.slow", "2 s", "device.toml"),
        ],
    }
}

fn header(command: &[&str]) -> Event {
    Event::RunBegun {
        header: Box::new(RunHeader {
            command: command.iter().map(|word| (*word).to_owned()).collect(),
            ..RunHeader::default()
        }),
    }
}

/// Everything passes.
pub fn pass() -> (RunResult, Journal) {
    let mut record = Recorder::new();
    record.harness(header(&["vda5050-tck", "run", "order"]));
    let first = record.wait(5).step("steps[0]");
    record.mark("steps[0]");
    record.send("order", &order(0, &["n1", "n2"], &[]));
    let accepted = record.wait(120).receive("state", &state(3, 0, "n1", &json!([])));
    let last = record.end("steps[0]", StepEnd::Decided);
    let mut done = test(
        "order/update-lower-id-refused",
        "An outdated order update is refused, and the running order goes on",
        Verdict::Pass,
        3.24,
        vec![
            decision(
                "ORD-REJ-17",
                Verdict::Pass,
                "steps[4].checks",
                27,
                Some(accepted),
                "a new error came",
            ),
            decision(
                "ORD-REJ-10",
                Verdict::Pass,
                "steps[5].checks",
                38,
                Some(accepted),
                "4 states, all as they should be",
            ),
        ],
    );
    done.journal = Some((first, last));
    done.steps = vec![step("steps[0]", "send order", "An order", 10, "done", None, 0.004)];
    let mut absent = test("map/download", "A map is downloaded", Verdict::Pass, 0.0, Vec::new());
    absent.verdict = None;
    absent.not_applicable = Some("the factsheet does not list action downloadMap".to_owned());
    let monitors = vec![MonitorResult {
        id: "header/id-rises".to_owned(),
        title: "headerId rises by one per topic".to_owned(),
        verdict: Some(Verdict::Pass),
        judged: 12,
        findings: Vec::new(),
    }];
    (run(vec![done, absent], monitors), record.journal)
}

pub const EXPLANATION: &str = r#"   --> suites/agv/order/update-lower-id-refused.yaml:33
    |
 26 |     title: The refusal is reported
 33 |         errors: { $hasNew: { errorType: "${vda.error.outdatedUpdate}", errorLevel: WARNING } }
    |                              ^^^^^^^^^ no new error has errorType "orderUpdateError"
    |"#;

/// One requirement is broken, another one is remarked upon, with a nearest miss.
pub fn fail() -> (RunResult, Journal) {
    let mut record = Recorder::new();
    record.harness(header(&["vda5050-tck", "run", "--profile", "device.toml"]));
    record.packet(
        Direction::FromDevice,
        Packet::Connect {
            level: 4,
            client_id: "lindner-tx-0042".to_owned(),
            keep_alive: 15,
            clean_session: true,
            username: None,
            has_password: false,
            will: Some(Will {
                topic: format!("{PREFIX}/connection"),
                payload: Payload::keep(br#"{"connectionState":"CONNECTIONBROKEN"}"#.to_vec().into()),
                qos: 1,
                retain: true,
            }),
        },
    );
    record.packet(
        Direction::ToDevice,
        Packet::Connack {
            code: 0,
            session_present: false,
        },
    );
    let first = record.wait(900).step("steps[0]");
    record.mark("steps[0]");
    record.send("order", &order(0, &["n1", "n2"], &["n3", "n4"]));
    record.end("steps[0]", StepEnd::Decided);
    record.step("steps[1]");
    let accepted = record.wait(180).receive("state", &state(3, 0, "n1", &json!([])));
    record.end("steps[1]", StepEnd::Decided);
    record.step("steps[2]");
    record.mark("steps[2]");
    record.wait(3).send("order", &order(1, &["n2", "n3"], &["n4"]));
    record.wait(150).receive("state", &state(4, 1, "n1", &json!([])));
    for at in 0..3 {
        record
            .wait(40)
            .receive("visualization", &json!({ "agvPosition": { "x": at } }));
        record.wait(900).receive("state", &state(5 + at, 1, "n1", &json!([])));
        record.packet(Direction::FromDevice, Packet::Pingreq);
    }
    record.step("steps[3]");
    record.mark("steps[3]");
    let late = record.wait(3).send("order", &order(0, &["n1", "n2"], &["n3", "n4"]));
    record.end("steps[3]", StepEnd::Decided);
    record.step("steps[4]");
    let errors = json!([{ "errorType": "orderError", "errorLevel": "WARNING", "errorReferences": [] }]);
    let refusal = record.wait(412).receive("state", &state(9, 1, "n1", &errors));
    record.end("steps[4]", StepEnd::Decided);
    record.step("steps[5]");
    record.harness(Event::ProbeSent { probe: 1 });
    record.harness(Event::ProbeReceived { probe: 1 });
    let reached = record.wait(5200).receive("state", &state(11, 1, "n3", &errors));
    let last = record.end("steps[5]", StepEnd::Decided);

    let nearest = |path: &str, found: &str, expected: &str| {
        Some(NearestMiss {
            seq: refusal,
            path: path.to_owned(),
            found: found.to_owned(),
            expected: expected.to_owned(),
        })
    };
    let mut broken = test(
        "order/update-lower-id-refused",
        "An outdated order update is refused, and the running order goes on",
        Verdict::Fail,
        8.41,
        vec![
            decision(
                "ORD-REJ-17",
                Verdict::Pass,
                "steps[4].checks",
                27,
                Some(refusal),
                "a new error came 0.413 s after the late update",
            ),
            Decision {
                expected: Some(
                    "errors: { $hasNew: { errorType: \"orderUpdateError\", errorLevel: \"WARNING\" } }".to_owned(),
                ),
                nearest: nearest("errors[0].errorType", "\"orderError\"", "\"orderUpdateError\""),
                waited: Some(Waited {
                    seconds: 31.0,
                    since: late,
                    messages: 4,
                }),
                explanation: Some(EXPLANATION.to_owned()),
                interpretation: Some("The table of error types is read as binding.".to_owned()),
                ..decision(
                    "ORD-REJ-12",
                    Verdict::Fail,
                    "steps[4].assert",
                    33,
                    Some(refusal),
                    "no new error has errorType \"orderUpdateError\"",
                )
            },
            Decision {
                nearest: nearest(
                    "errors[0].errorReferences",
                    "[]",
                    "an element with referenceKey \"orderUpdateId\"",
                ),
                ..decision(
                    "ORD-REJ-14",
                    Verdict::Warning,
                    "steps[4].assert",
                    35,
                    Some(refusal),
                    "the new error does not name the orderUpdateId",
                )
            },
            decision(
                "ORD-REJ-10",
                Verdict::Pass,
                "steps[5].checks",
                38,
                Some(reached),
                "2 states, all as they should be",
            ),
            decision(
                "ORD-REJ-11",
                Verdict::Pass,
                "steps[5].until",
                41,
                Some(reached),
                "c was reached after 5.6 s",
            ),
        ],
    );
    broken.reason = Some("no new error has errorType \"orderUpdateError\"".to_owned());
    broken.journal = Some((first, last));
    broken.steps = vec![
        step(
            "steps[0]",
            "send order",
            "An order that stays open, because its horizon is never released",
            10,
            "done",
            None,
            0.005,
        ),
        step("steps[1]", "expect state", "", 14, "done", Some(accepted), 0.181),
        step("steps[2]", "send order", "Update 1 releases c", 17, "done", None, 0.004),
        step(
            "steps[3]",
            "send order",
            "Update 0 arrives late",
            21,
            "done",
            None,
            0.004,
        ),
        step(
            "steps[4]",
            "expect state",
            "The refusal is reported",
            25,
            "failed",
            Some(refusal),
            0.413,
        ),
        step(
            "steps[5]",
            "always state",
            "The order on the vehicle is kept",
            36,
            "done",
            Some(reached),
            5.2,
        ),
    ];
    let mut open = test(
        "connection/last-will",
        "A last will is registered",
        Verdict::Inconclusive,
        31.0,
        vec![decision(
            "CONN-02",
            Verdict::Inconclusive,
            "steps[0].assert",
            1,
            None,
            "the device did not connect again in time",
        )],
    );
    open.maturity = "watchlist".to_owned();
    open.reason = Some("the device did not connect again within 30 s".to_owned());
    let mut absent = test(
        "order/refusal-shown",
        "A refusal is shown on the vehicle",
        Verdict::Pass,
        0.0,
        Vec::new(),
    );
    absent.verdict = None;
    absent.not_applicable = Some("the profile has no hook trigger".to_owned());
    let monitors = vec![MonitorResult {
        id: "header/id-rises".to_owned(),
        title: "headerId rises by one per topic".to_owned(),
        verdict: Some(Verdict::Warning),
        judged: 131,
        findings: vec![MonitorFinding {
            requirement: "HDR-01".to_owned(),
            verdict: Verdict::Warning,
            count: 3,
            first: vec![refusal, reached],
            message: "headerId went from 7 to 9".to_owned(),
            interpretation: None,
        }],
    }];
    let mut result = run(vec![broken, open, absent], monitors);
    result.deviations = BTreeMap::from([(
        "ORD-REJ-12".to_owned(),
        "Firmware 4.2 reports orderError for every refusal; fixed in 4.3.".to_owned(),
    )]);
    (result, record.journal)
}

/// What a device may choose to be called.
pub const HOSTILE: &str = "<script>alert(1)</script>\"'&]]>\u{1b}[31m\u{0}\u{202e}\u{ffff}{{ 7 }}";

/// A partial run in which every string is hostile.
pub fn hostile() -> (RunResult, Journal, Sources) {
    let evil = || HOSTILE.to_owned();
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
    let huge = format!("{{\"a\":\"{}\"}}", HOSTILE.escape_unicode()).repeat(40_000);
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

    let decide = |verdict| Decision {
        requirement: evil(),
        verdict,
        clause: evil(),
        place: format!("{HOSTILE}:3"),
        witness: Some(witness),
        message: evil(),
        expected: Some(evil()),
        nearest: Some(NearestMiss {
            seq: witness,
            path: evil(),
            found: evil(),
            expected: evil(),
        }),
        waited: Some(Waited {
            seconds: 1.0,
            since: first,
            messages: 1,
        }),
        explanation: Some(format!("{HOSTILE}\n | {HOSTILE}\n | ^^^ {HOSTILE}")),
        interpretation: Some(evil()),
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
            reason: Some(evil()),
            maturity: "watchlist".to_owned(),
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
                verdict: Some(Verdict::Fail),
                decided_by: vec![evil()],
                not_decided: None,
            },
            RequirementResult {
                id: "X Y".to_owned(),
                verdict: None,
                decided_by: Vec::new(),
                not_decided: Some(evil()),
            },
        ],
        capabilities: vec![Capability {
            name: evil(),
            value: evil(),
            source: evil(),
        }],
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
            interpretation: Some(evil()),
            decided: HowDecided::NotTestable(evil()),
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
    };
    (result, record.journal, sources)
}
