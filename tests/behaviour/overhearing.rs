//! `audit` of network traffic that `tcpdump` has captured beside a run: what the run's own tap has seen, and what the run has
//! found.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;
use vda5050_tck::capture::{Item, Mapping, Recorded, WireEvent};
use vda5050_tck::journal;
use vda5050_tck::journal::event::{Direction, Event, Packet};

use crate::bench::{Bench, Profile, QUICK};
use crate::tool::Running;

const CAPTURE: &str = "talk.pcap";
const DRIVES: &str = "order-acceptance/base-and-horizon";

/// `tcpdump` on the loopback of this machine.
struct Tcpdump(Running);

impl Tcpdump {
    /// Captures what is said at a port. Without tcpdump on this machine, or the right to capture: nothing, which in CI is a
    /// failure.
    fn start(folder: &Path, port: u16) -> Option<Self> {
        // Its own output is the capture: it gives up its rights, and may not write into this folder then.
        let line =
            format!("exec tcpdump -i lo -n -U --immediate-mode -s 0 -B 16384 -w - 'tcp port {port}' > {CAPTURE}");
        let mut command = Command::new("sh");
        command.args(["-c", &line]);
        command.current_dir(folder).stdin(Stdio::null());
        let mut running = Running::start(&mut command);
        let begun = running.until("tcpdump", |running| {
            let said = running.stderr();
            let refused = said.contains("not found") || said.contains("ermi");
            (refused || said.contains("listening on")).then_some(!refused)
        });
        if !begun {
            let said = running.stderr();
            assert!(
                std::env::var_os("CI").is_none(),
                "tcpdump cannot capture, and CI must have it: {said}"
            );
            eprintln!("skipped: {said}");
            return None;
        }
        Some(Self(running))
    }

    /// Ends once nothing more is written; the capture is whole then. What the kernel still holds would be lost.
    fn end(self, folder: &Path) {
        let size = || std::fs::metadata(folder.join(CAPTURE)).unwrap().len();
        // A vehicle that tries to connect again goes on being captured.
        for _ in 0..5 {
            let before = size();
            std::thread::sleep(Duration::from_secs(1));
            if size() == before {
                break;
            }
        }
        self.0.interrupt();
        let ended = self.0.end();
        assert!(ended.stderr.contains("0 packets dropped by kernel"), "{}", ended.stderr);
    }
}

/// The packets of both directions, those of the device first.
type Heard = [Vec<Packet>; 2];

fn seen_by_tap(journal: &Path) -> Heard {
    let mut heard = Heard::default();
    for entry in journal::file::read(journal).unwrap().journal.entries() {
        if let (Event::Packet { packet, .. }, Some(direction)) = (entry.event(), entry.record.direction) {
            heard[usize::from(direction != Direction::FromDevice)].push(packet.clone());
        }
    }
    heard
}

fn seen_by_tcpdump(capture: &Path) -> Heard {
    let mut heard = Heard::default();
    let mut recorded = Recorded::open(capture, 0, Mapping::default()).unwrap();
    while let Some(item) = recorded.read().unwrap() {
        if let Item::Wire(wire) = item {
            match wire.event {
                WireEvent::Packet { packet, sent } => heard[usize::from(!sent)].push(packet),
                WireEvent::Gap { .. } => panic!("a gap in front of frame {}", recorded.place().line),
                WireEvent::Closed { .. } => {}
            }
        }
    }
    heard
}

/// Monitor and requirement of all that is found.
fn findings<'a>(lists: impl Iterator<Item = (&'a Value, &'a Value)>) -> BTreeSet<(String, String)> {
    let all = lists.flat_map(|(monitor, list)| list.as_array().into_iter().flatten().map(move |one| (monitor, one)));
    let broken = all.filter(|(_, finding)| matches!(finding["verdict"].as_str(), Some("fail" | "warning")));
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    broken
        .map(|(monitor, finding)| {
            let monitor = if monitor.is_null() {
                &finding["monitor"]
            } else {
                monitor
            };
            (text(monitor), text(&finding["requirement"]))
        })
        .collect()
}

#[test]
fn what_tcpdump_captures_of_a_run_gives_what_the_tap_of_the_run_gave() {
    let bench = Bench::new();
    let profile = Profile {
        motion: true,
        ..Profile::default()
    };
    let (run, port) = bench.start(&profile, &[QUICK, DRIVES, "connection/after-cut-listens-again"]);
    let Some(tcpdump) = Tcpdump::start(bench.path(), port) else {
        return;
    };
    let _agv = bench.agv(port, &["horizon-not-reported", "will-qos-0", "connection-not-retained"]);
    run.end().code(1);
    tcpdump.end(bench.path());
    let journal = bench.path().join("journal.jsonl");
    std::fs::write(&journal, bench.journal()).unwrap();
    let (tap, overheard) = (seen_by_tap(&journal), seen_by_tcpdump(&bench.path().join(CAPTURE)));
    for (direction, (tap, overheard)) in ["from", "to"].into_iter().zip(tap.iter().zip(&overheard)) {
        assert!(tap.len() >= 8, "only {} packets {direction} the device", tap.len());
        for (number, (tap, overheard)) in tap.iter().zip(overheard).enumerate() {
            assert_eq!(overheard, tap, "packet {number} {direction} the device");
        }
        assert_eq!(overheard.len(), tap.len(), "packets {direction} the device");
    }

    let audited = bench.run(&["audit", CAPTURE, "--format", "json"]).code(1);
    let audited: Value = serde_json::from_str(&audited.stdout).unwrap();
    let vehicle = &audited["vehicles"][0];
    assert_eq!(vehicle["vantage"], "tap");
    let sides = vehicle["sides"].as_array().unwrap();
    let side = sides.iter().find(|side| side["role"] == "agv").unwrap();
    let none = Value::Null;
    let of_audit = findings([(&none, &side["findings"])].into_iter());
    let result = bench.result();
    let monitors = result["monitors"].as_array().unwrap().iter();
    let of_run = findings(monitors.map(|monitor| (&monitor["id"], &monitor["findings"])));
    let undecided = side["undecided"].as_array().unwrap().iter();
    let undecided: BTreeSet<&str> = undecided.map(|one| one["monitor"].as_str().unwrap()).collect();
    let judged = |found: BTreeSet<(String, String)>| -> BTreeSet<(String, String)> {
        found
            .into_iter()
            .filter(|(monitor, _)| !undecided.contains(monitor.as_str()))
            .collect()
    };
    assert_eq!(judged(of_audit), judged(of_run));
    for requirement in ["STATE-12", "CONN-03", "CONN-06"] {
        let found = &side["findings"].as_array().unwrap();
        assert!(
            found.iter().any(|finding| finding["requirement"] == requirement),
            "{requirement} is not among {found:#?}"
        );
    }
}
