//! What it takes to read a state of about a kilobyte, from its tree and from its bytes: `cargo bench -p tck-view`.

#![allow(missing_docs, reason = "a program")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tck_view::{MessageView, Names, Topic};

fn state() -> Value {
    json!({
        "headerId": 4711, "timestamp": "2026-11-26T12:00:00.123Z", "version": "2.1.0",
        "manufacturer": "acme", "serialNumber": "agv-0042",
        "orderId": "b7e23ec2-9af1-4c2e-8f0a-1d2b3c4d5e6f", "orderUpdateId": 3,
        "lastNodeId": "node-17", "lastNodeSequenceId": 4,
        "nodeStates": [
            { "nodeId": "node-18", "sequenceId": 6, "released": true },
            { "nodeId": "node-19", "sequenceId": 8, "released": true },
            { "nodeId": "node-20", "sequenceId": 10, "released": false },
        ],
        "edgeStates": [
            { "edgeId": "edge-17-18", "sequenceId": 5, "released": true },
            { "edgeId": "edge-18-19", "sequenceId": 7, "released": true },
            { "edgeId": "edge-19-20", "sequenceId": 9, "released": false },
        ],
        "agvPosition": { "x": 12.345, "y": -3.25, "theta": 1.57, "mapId": "hall-1", "positionInitialized": true,
                         "localizationScore": 0.97 },
        "velocity": { "vx": 0.8, "vy": 0.0, "omega": 0.01 },
        "driving": true, "paused": false, "newBaseRequest": false, "distanceSinceLastNode": 1.25,
        "actionStates": [
            { "actionId": "3c0f8a52-pick", "actionType": "pick", "actionStatus": "FINISHED" },
            { "actionId": "3c0f8a52-drop", "actionType": "drop", "actionStatus": "WAITING" },
        ],
        "batteryState": { "batteryCharge": 78.5, "batteryVoltage": 48.2, "charging": false },
        "operatingMode": "AUTOMATIC", "loads": [], "errors": [], "information": [],
        "safetyState": { "eStop": "NONE", "fieldViolation": false },
    })
}

/// The shortest of some rounds, for one reading.
fn measured(mut read: impl FnMut()) -> Duration {
    const READINGS: u32 = 2_000;
    let round = || {
        let begun = Instant::now();
        for _ in 0..READINGS {
            read();
        }
        begun.elapsed() / READINGS
    };
    std::iter::repeat_with(round).take(50).min().unwrap_or_default()
}

fn main() {
    let (names, value) = (Names::default(), state());
    let text = value.to_string();
    let figures = [
        (
            "view of its tree",
            measured(|| drop(black_box(MessageView::of_value(Topic::State, &value, &names)))),
        ),
        (
            "view of its bytes",
            measured(|| drop(black_box(MessageView::of_slice(Topic::State, text.as_bytes(), &names)))),
        ),
        (
            "tree of its bytes",
            measured(|| drop(black_box(serde_json::from_str::<Value>(&text)))),
        ),
    ];
    println!("a state of {} bytes, view and release of it:", text.len());
    for (what, took) in figures {
        println!("{what}: {:.2} µs", took.as_secs_f64() * 1e6);
    }
}
