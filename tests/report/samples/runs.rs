//! A run that passes and one that fails.

use std::collections::BTreeMap;

use serde_json::json;
use vda5050_tck::journal::event::StepEnd;
use vda5050_tck::journal::{Direction, Event, Journal, Packet, Payload, Will};
use vda5050_tck::result::{Decision, MonitorFinding, MonitorResult, NearestMiss, RunResult, Sent, SentMember, Waited};
use vda5050_tck::verdict::Verdict;

use super::parts::{decision, header, run, step, test};
use super::record::{PREFIX, Recorder, order, state};

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
            with(
                decision(
                    "ORD-REJ-12",
                    Verdict::Fail,
                    "steps[4].assert",
                    33,
                    Some(refusal),
                    "no new error has errorType \"orderUpdateError\"",
                ),
                |decision| {
                    decision.sent = Some(Sent {
                        seq: late,
                        topic: "order".to_owned(),
                        members: vec![SentMember {
                            path: "orderUpdateId".to_owned(),
                            value: "0 (a number)".to_owned(),
                        }],
                        more: 0,
                        raw: None,
                    });
                    decision.expected = Some(
                        "there is a new error where errorType is \"orderUpdateError\" and errorLevel is \"WARNING\""
                            .to_owned(),
                    );
                    decision.nearest = nearest("errors[0].errorType", "\"orderError\"", "\"orderUpdateError\"");
                    decision.waited = Some(Waited {
                        seconds: 31.0,
                        since: late,
                        messages: 4,
                    });
                    decision.explanation = Some(EXPLANATION.to_owned());
                    decision.interpretation = Some("The table of error types is read as binding.".to_owned());
                },
            ),
            with(
                decision(
                    "ORD-REJ-14",
                    Verdict::Warning,
                    "steps[4].assert",
                    35,
                    Some(refusal),
                    "the new error does not name the orderUpdateId",
                ),
                |decision| {
                    decision.nearest = nearest(
                        "errors[0].errorReferences",
                        "[]",
                        "an element with referenceKey \"orderUpdateId\"",
                    );
                },
            ),
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
    "watchlist".clone_into(&mut open.maturity);
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

fn with(mut decision: Decision, shows: impl FnOnce(&mut Decision)) -> Decision {
    shows(&mut decision);
    decision
}
