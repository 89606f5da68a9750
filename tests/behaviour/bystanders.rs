//! Others on the tap: whatever they do, a healthy vehicle is not accused of it.

use std::time::Duration;

use serde_json::Value;

use crate::bench::{Bench, Profile, QUICK};
use crate::scripted::Scripted;
use crate::tool::{Ended, Running};

/// Tests without motion.
const TESTS: [&str; 2] = [QUICK, "order-rejection/unreadable*"];

/// A run against a healthy vehicle, with others who act from its first test on. The client ids that were seen are given to them.
fn run_beside(others: impl FnOnce(u16, &[String])) -> (Bench, Ended) {
    let bench = Bench::new();
    let (mut run, port) = bench.start(&Profile::default(), &TESTS);
    // Others act while the vehicle is tested, so it takes its time.
    let _agv: Running = bench.agv_with(port, &["--tolerance", "answers-slowly"]);
    run.until("the first test", |_| {
        records(&bench)
            .iter()
            .find(|record| record["event"]["kind"] == "test-begun")?;
        Some(())
    });
    let ids: Vec<String> = records(&bench)
        .iter()
        .filter_map(|record| Some(record["event"]["packet"]["clientId"].as_str()?.to_owned()))
        .collect();
    others(port, &ids);
    (bench, run.end())
}

fn records(bench: &Bench) -> Vec<Value> {
    let journal = bench.journal();
    journal
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect()
}

fn short() {
    std::thread::sleep(Duration::from_millis(100));
}

#[test]
fn onlookers_and_visitors_cost_no_verdict() {
    let (bench, ended) = run_beside(|port, _| {
        let onlooker = Scripted::stranger(port, "MQTT_Explorer");
        short();
        Scripted::stranger(port, "visitor").say_goodbye();
        drop(onlooker);
        drop(std::net::TcpStream::connect(("127.0.0.1", port)).unwrap());
        // Names like those of the harness.
        for name in ["tck-watcher", "tck-1", "tck-fresh"] {
            drop(Scripted::stranger(port, name));
        }
    });
    ended.code(0);
    let limits = bench.result()["limits"].to_string();
    assert!(!limits.contains("visitor") && !limits.contains("Explorer"), "{limits}");
    bench.is_whole();
}

#[test]
fn what_others_say_in_the_name_of_the_vehicle_is_not_held_against_it() {
    let (bench, ended) = run_beside(|port, _| {
        let mut forger = Scripted::stranger(port, "forger");
        for _ in 0..10 {
            forger.publish("state", b"{\"orderId\": \"forged\", \"headerId\": -5}", false);
            forger.publish("connection", b"no JSON", false);
            forger.publish("visualization", b"[]", false);
            short();
        }
    });
    ended.code(0);
    let limits = bench.result()["limits"].to_string();
    assert!(limits.contains("forger") && limits.contains("/state"), "{limits}");
    bench.is_whole();
}

#[test]
fn who_takes_the_client_id_of_the_vehicle_makes_it_no_failure() {
    let (bench, ended) = run_beside(|port, ids| {
        for _ in 0..3 {
            drop(Scripted::stranger(port, &ids[0]));
            short();
        }
    });
    assert!(matches!(ended.status.code(), Some(0 | 3)), "{ended:?}");
    let limits = bench.result()["limits"].to_string();
    assert!(limits.contains("took the client id"), "{limits}");
    bench.is_whole();
}

#[test]
fn who_commands_the_vehicle_is_named() {
    let (bench, ended) = run_beside(|port, _| {
        let mut other = Scripted::stranger(port, "other");
        other.publish("order", b"{\"orderId\": \"of somebody else\"}", false);
        other.publish(
            "instantActions",
            b"{\"actions\": [{\"actionType\": \"startPause\", \"actionId\": \"x\", \"blockingType\": \"HARD\"}]}",
            false,
        );
        short();
    });
    assert!(matches!(ended.status.code(), Some(0 | 3)), "{ended:?}");
    let limits = bench.result()["limits"].to_string();
    assert!(limits.contains("other") && limits.contains("/order"), "{limits}");
    bench.is_whole();
}

/// Numbers that look like chance and are the same in every run.
struct Chance(u64);

impl Chance {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        usize::try_from(self.0 >> 33).unwrap() % limit
    }
}

/// A good packet of a stranger, with bytes changed, cut off or put in.
fn mutated(chance: &mut Chance) -> Vec<u8> {
    let good: [&[u8]; 6] = [
        b"\x10\x13\x00\x04MQTT\x04\x02\x00\x3c\x00\x07mutator",
        b"\x30\x0a\x00\x05other{}x",
        b"\x32\x0b\x00\x05other\x00\x01{}",
        b"\x82\x08\x00\x01\x00\x03a/b\x00",
        b"\xc0\x00",
        b"\xe0\x00",
    ];
    let mut packet = good[chance.below(good.len())].to_vec();
    for _ in 0..=chance.below(3) {
        let at = chance.below(packet.len());
        let byte = u8::try_from(chance.below(256)).unwrap();
        match chance.below(3) {
            0 => packet[at] = byte,
            1 => packet.insert(at, byte),
            _ => packet.truncate(at.max(1)),
        }
    }
    packet
}

#[test]
fn a_flood_of_somebody_else_is_none_of_the_vehicle() {
    let (bench, ended) = run_beside(|port, _| {
        let mut other = Scripted::stranger(port, "noisy");
        // PUBLISH on a topic that nobody knows.
        let batch = b"\x30\x0a\x00\x05other{}x".repeat(1_000);
        for _ in 0..20 {
            other.raw(&batch);
        }
        std::thread::sleep(Duration::from_millis(500));
    });
    ended.code(0);
    let records = records(&bench).len();
    assert!(records < 15_000, "{records} records");
    bench.is_whole();
}

#[test]
fn mutated_packets_of_others_leave_the_verdicts_as_they_are() {
    use std::io::Write as _;
    let (bench, ended) = run_beside(|port, _| {
        let mut chance = Chance(7);
        for _ in 0..400 {
            let Ok(mut socket) = std::net::TcpStream::connect(("127.0.0.1", port)) else {
                continue;
            };
            // Half of them say who they are first.
            if chance.below(2) == 0 {
                let _ = socket.write_all(b"\x10\x13\x00\x04MQTT\x04\x02\x00\x3c\x00\x07mutator");
            }
            let packets: Vec<u8> = (0..100).flat_map(|_| mutated(&mut chance)).collect();
            let _ = socket.write_all(&packets);
        }
    });
    ended.code(0);
    bench.is_whole();
}

#[test]
fn two_thousand_connections_leave_the_verdicts_as_they_are() {
    let (bench, ended) = run_beside(|port, _| {
        for _ in 0..4 {
            let held: Vec<_> = (0..500)
                .map_while(|_| std::net::TcpStream::connect(("127.0.0.1", port)).ok())
                .collect();
            drop(held);
        }
    });
    ended.code(0);
    bench.is_whole();
}
