//! What a capture of the network gives is what the tap of a run gave.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;

use super::*;
use tck_base::clock::Moment;
use tck_capture::{Item, Packets};
use tck_journal::event::{Close, Direction, Event, Packet, Record};
use tck_judge::Library;
use tck_pack::Role;
use tck_run::{VirtualRun, run_silently};
use tck_suite::model::Recordings;
use tck_testing_captures::{Link, Stream, mqtt, pcap};

const SEGMENT: usize = 1_400;

/// The records of a run with this fault, and what the monitors of connections found in it.
fn run(library: &Library, role: Role, tests: &[&str], fault: Option<&str>) -> (Vec<Record>, BTreeSet<String>) {
    let pack = library.rules.packs.latest();
    let mut run = VirtualRun::of_role(role, library, pack);
    run.tests
        .retain(|test| tests.iter().any(|begin| test.id.starts_with(begin)));
    assert!(!run.tests.is_empty());
    run.faults = fault.iter().map(|fault| (*fault).to_owned()).collect();
    let finished = run_silently(library, pack, run).expect("a run");
    let monitors = finished.result.monitors.iter();
    let monitors = monitors.filter(|monitor| is_of_packets(library, &monitor.id));
    let found = monitors.flat_map(|monitor| {
        let findings = monitor.findings.iter();
        findings.map(|finding| format!("{} {} {:?}", monitor.id, finding.requirement, finding.verdict))
    });
    let found = found.collect();
    let journal = finished.recorder.journal();
    (
        journal.entries().iter().map(|entry| entry.record.clone()).collect(),
        found,
    )
}

fn is_of_packets(library: &Library, id: &str) -> bool {
    let mut monitors = library.rules.suites.monitors.iter();
    monitors.any(|monitor| monitor.id == id && monitor.recordings == Recordings::Packets)
}

/// The packets of the device as TCP segments, each connection on a port of its own.
fn frames(records: &[Record]) -> Vec<(u64, Vec<u8>)> {
    let mut streams: BTreeMap<u64, (Stream, Stream)> = BTreeMap::new();
    let mut all = Vec::new();
    for record in records {
        let at = record.at.moment.since(Moment::START).as_micros();
        let at = u64::try_from(at).expect("short");
        match &record.event {
            Event::Packet { connection, packet } if record.direction == Some(Direction::FromDevice) => {
                let port = 40_000 + u16::try_from(*connection).expect("few");
                if matches!(packet, Packet::Connect { .. }) {
                    let mut pair = Stream::pair(Link::Ethernet, false, port);
                    all.push((at, pair.0.flagged("S")));
                    streams.insert(*connection, pair);
                }
                let Some(bytes) = mqtt(packet) else { continue };
                let Some((up, _)) = streams.get_mut(connection) else {
                    continue;
                };
                all.extend(bytes.chunks(SEGMENT).map(|part| (at, up.segment(part))));
            }
            Event::Closed { connection, how } => {
                let Some((mut up, mut down)) = streams.remove(connection) else {
                    continue;
                };
                match how {
                    Close::DeviceFin => all.extend([(at, up.flagged("F")), (at, down.flagged("F"))]),
                    _ => all.push((at, up.flagged("R"))),
                }
            }
            _ => {}
        }
    }
    all
}

fn audited(library: &Library, file: Vec<u8>) -> AuditResult {
    let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
    let mut packets = Packets::new(Box::new(Cursor::new(file)), 0).expect("a capture");
    while let Some(item) = packets.read().expect("readable") {
        match item {
            Item::Message(message) => audit.observe(message),
            Item::Wire(wire) => audit.wire(*wire),
            Item::Record(_) => {}
        }
    }
    audit.finish(Vec::new())
}

/// What the monitors of connections found.
fn found(library: &Library, result: &AuditResult, role: Role) -> BTreeSet<String> {
    let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    let findings = sides
        .filter(|side| side.role == role.word())
        .flat_map(|side| &side.findings);
    findings
        .filter(|finding| is_of_packets(library, &finding.monitor))
        .map(|finding| format!("{} {} {:?}", finding.monitor, finding.requirement, finding.verdict))
        .collect()
}

const FAULTS: [(Role, Option<&str>); 16] = [
    (Role::Agv, None),
    (Role::Agv, Some("old-mqtt")),
    (Role::Agv, Some("no-will")),
    (Role::Agv, Some("will-on-state-topic")),
    (Role::Agv, Some("will-qos-0")),
    (Role::Agv, Some("will-not-retained")),
    (Role::Agv, Some("will-offline")),
    (Role::Agv, Some("will-without-header")),
    (Role::Agv, Some("connection-qos-0")),
    (Role::Agv, Some("connection-not-retained")),
    (Role::Agv, Some("state-qos-1")),
    (Role::Agv, Some("factsheet-not-retained")),
    (Role::Agv, Some("keep-alive-long")),
    (Role::Agv, Some("no-offline")),
    (Role::MasterControl, None),
    (Role::MasterControl, Some("order-qos-1")),
];

fn tests(role: Role) -> &'static [&'static str] {
    match role {
        Role::Agv => &["connection/", "order-acceptance/base-and-horizon"],
        Role::MasterControl => &["dispatch/"],
    }
}

#[test]
fn a_capture_of_a_run_gives_what_its_tap_gave() {
    let library = tck_testing::library();
    for (role, fault) in FAULTS {
        let (records, wanted) = run(library, role, tests(role), fault);
        assert_eq!(wanted.is_empty(), fault.is_none(), "{fault:?}: {wanted:?}");
        let frames = frames(&records);
        let result = audited(library, pcap(Link::Ethernet, &frames, 65_535));
        assert_eq!(found(library, &result, role), wanted, "{role} {fault:?}");
        assert!(result.vehicles.iter().any(|vehicle| vehicle.vantage == "tap"));
        // From the middle on, and with losses, nobody is accused of anything else.
        let mut worse = frames[frames.len() / 3..].to_vec();
        let mut number = 0;
        worse.retain(|_| {
            number += 1;
            number % 50 != 0
        });
        let found = found(library, &audited(library, pcap(Link::Ethernet, &worse, 65_535)), role);
        assert!(found.is_subset(&wanted), "{role} {fault:?}: {found:?}");
    }
}

#[test]
fn a_bridge_is_not_held_against_the_vehicles_behind_it() {
    let library = tck_testing::library();
    let (records, _) = run(library, Role::Agv, tests(Role::Agv), Some("no-will"));
    // The bridge speaks for another vehicle as well.
    let mut both = Vec::new();
    for record in records {
        let mut other = record.clone();
        if let Event::Packet {
            packet: Packet::Publish { topic, .. },
            ..
        } = &mut other.event
        {
            let mut parts: Vec<&str> = topic.split('/').collect();
            let at = parts.len() - 2;
            parts[at] = "another";
            *topic = parts.join("/");
            both.push(other);
        }
        both.push(record);
    }
    let result = audited(library, pcap(Link::Ethernet, &frames(&both), 65_535));
    assert_eq!(result.vehicles.len(), 2);
    assert_eq!(found(library, &result, Role::Agv), BTreeSet::new());
}
