//! What the catalogue and the suites of the samples say.

use vda5050_tck::pack::Role;
use vda5050_tck::report::sources::{ClauseSource, HowDecided, MonitorSource, RequirementText, Sources, TestSource};

/// Id, mood, how it is decided, text.
pub type Row = (&'static str, &'static str, &'static str, &'static str);

/// Title, section, requirements.
pub const CHAPTERS: [(&str, &str, &[Row]); 3] = [
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
                link: None,
                interpretation: (*id == "ORD-REJ-12").then(|| {
                    "The table of error types is read as binding; another type is accepted with a remark only where the text gives none.".to_owned()
                }),
                action: None,
                rests_on: Vec::new(),
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
        given: std::collections::BTreeMap::new(),
    }
}
