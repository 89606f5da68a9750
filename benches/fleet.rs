//! A thousand simulated vehicles without a network: what a virtual second of them costs, and how much memory they take.
//!
//! `cargo bench --bench fleet`. Every vehicle is connected and publishes a state and a visualization a second; they stand at
//! first, and then drive slowly over two edges.
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a benchmark that cannot go on has failed, and says what it measured"
)]

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use vda5050_tck::clock::{Moment, Stamp};
use vda5050_tck::reference::agv::Agv;
use vda5050_tck::reference::deviations::agv::mock;
use vda5050_tck::reference::{Device, Input, Output};
use vda5050_tck::simulate::ReferenceAgv;

const VEHICLES: usize = 1_000;
const SECONDS: u64 = 60;

fn main() {
    for drives in [false, true] {
        measure(drives);
    }
}

/// A fleet that stands, or drives.
fn measure(drives: bool) {
    let library = vda5050_tck::library(None).unwrap();
    let pack = library.rules.packs.latest();
    let before = resident();
    let like = ReferenceAgv::new(pack);
    let mut fleet: Vec<Agv> = (0..VEHICLES)
        .map(|number| {
            let mut like = like.clone();
            like.rename("bench", &format!("agv-{number}"), None, pack);
            like.config.state_interval = Duration::from_secs(1);
            mock(like.config)
        })
        .collect();
    let mut sent = Sent::default();
    for (number, agv) in fleet.iter_mut().enumerate() {
        let now = at(Moment::START);
        agv.handle(now, Input::Connected, &mut sent.out);
        if drives {
            let order = order(&pack.version.to_string(), number).to_string();
            let message = Input::Message {
                topic: format!("uagv/v2/bench/agv-{number}/order"),
                payload: order.into_bytes().into(),
            };
            agv.handle(now, message, &mut sent.out);
        }
        sent.count();
    }
    let begun = Instant::now();
    for second in 1..=SECONDS {
        let end = Moment::from_micros(second * 1_000_000);
        for agv in &mut fleet {
            while let Some(due) = agv.wake_up().filter(|due| *due <= end) {
                agv.handle(at(due), Input::Time, &mut sent.out);
            }
            sent.count();
        }
    }
    let took = begun.elapsed();
    assert!(sent.messages > VEHICLES as u64 * SECONDS, "{} messages", sent.messages);
    let how = if drives { "drive" } else { "stand" };
    println!(
        "{VEHICLES} vehicles that {how}, {SECONDS} virtual seconds, {} messages",
        sent.messages
    );
    println!("one of {SECONDS} seconds: {:.2} ms", share(took) * 1_000.0);
    println!("share of a core: {:.1} %", share(took) * 100.0);
    if let (Some(before), Some(after)) = (before, resident()) {
        println!(
            "memory: {} KB more than before, {} KB in all",
            after.saturating_sub(before),
            after
        );
    }
}

fn share(took: Duration) -> f64 {
    took.as_secs_f64() / SECONDS as f64
}

/// What the vehicles want done.
#[derive(Default)]
struct Sent {
    out: Vec<Output>,
    messages: u64,
}

impl Sent {
    fn count(&mut self) {
        let published = |output: &Output| matches!(output, Output::Publish(_));
        self.messages += self.out.drain(..).filter(published).count() as u64;
    }
}

fn at(moment: Moment) -> Stamp {
    Stamp {
        moment: Moment::START,
        utc: jiff::Timestamp::UNIX_EPOCH,
    }
    .at(moment)
}

/// An order over the first edge of the reference floor.
fn order(version: &str, number: usize) -> Value {
    let node = |id: &str, sequence: u32, y: f64| {
        json!({ "nodeId": id, "sequenceId": sequence, "released": true, "actions": [],
            "nodePosition": { "x": 0.0, "y": y, "mapId": "reference-floor" } })
    };
    json!({
        "headerId": 0, "timestamp": "1970-01-01T00:00:00.00Z", "version": version,
        "manufacturer": "bench", "serialNumber": format!("agv-{number}"),
        "orderId": "o1", "orderUpdateId": 0,
        "nodes": [node("A1", 0, 0.0), node("A2", 2, 2.0), node("A3", 4, 4.0)],
        "edges": [
            { "edgeId": "A1-A2", "sequenceId": 1, "released": true, "startNodeId": "A1", "endNodeId": "A2", "actions": [], "maxSpeed": 0.1 },
            { "edgeId": "A2-A3", "sequenceId": 3, "released": true, "startNodeId": "A2", "endNodeId": "A3", "actions": [], "maxSpeed": 0.1 },
        ],
    })
}

/// Kilobytes of this process in memory, where the system tells.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}
