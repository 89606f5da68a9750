use std::collections::BTreeSet;

use super::*;
use tck_base::verdict::Verdict;
use tck_journal::Payload;
use tck_journal::event::Event;
use tck_judge::Library;
use tck_pack::{Pack, Role};
use tck_run::{VirtualRun, run_silently};

/// What a faultless device and the harness said in a run of these tests, as a subscriber hears it.
pub(super) fn traffic(library: &Library, pack: &Pack, role: Role, tests: &str, faults: &[&str]) -> Vec<Message> {
    let mut run = VirtualRun::of_role(role, library, pack);
    run.tests.retain(|test| test.id.starts_with(tests));
    run.faults = faults.iter().map(|fault| (*fault).to_owned()).collect();
    let finished = run_silently(library, pack, run).expect("a run");
    let mut all = Vec::new();
    for entry in finished.recorder.journal().entries() {
        let (Event::Message {
            topic, payload, retain, ..
        }
        | Event::Sent {
            topic, payload, retain, ..
        }) = entry.event()
        else {
            continue;
        };
        let Payload::Whole(payload) = payload else { continue };
        let sent = matches!(entry.event(), Event::Sent { .. });
        all.push(Message {
            at: Some(entry.at().utc),
            topic: topic.clone(),
            payload: payload.clone(),
            qos: Some(0),
            retain: Some(*retain && !sent),
            place: Place::default(),
            after_gap: false,
            carried: None,
        });
    }
    all
}

/// Numbers that are the same in every run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

/// The same as a bad recorder has it: begun in the middle, one in a hundred lost, one in a hundred twice, and out of
/// order within 50 milliseconds.
pub(super) fn spoiled(all: &[Message], seed: u64) -> Vec<Message> {
    let mut dice = Dice(seed);
    let begin = usize::try_from(dice.below(all.len() as u64 / 2)).expect("small");
    let mut kept = Vec::new();
    for message in &all[begin..] {
        let lost = dice.below(100) == 0;
        let times = if lost { 0 } else { 1 + u64::from(dice.below(100) == 0) };
        for _ in 0..times {
            let late = i64::try_from(dice.below(50)).expect("small");
            let mut message = message.clone();
            message.at = message
                .at
                .and_then(|at| jiff::Timestamp::from_microsecond(at.as_microsecond() + late * 1000).ok());
            kept.push(message);
        }
    }
    kept.sort_by_key(|message| message.at);
    kept
}

fn audited(library: &Library, messages: Vec<Message>) -> AuditResult {
    let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
    for message in messages {
        audit.observe(message);
    }
    audit.finish(Vec::new())
}

/// Findings of one side: requirement, monitor and text.
fn found(result: &AuditResult, role: Role) -> BTreeSet<String> {
    let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    let findings = sides
        .filter(|side| side.role == role.word())
        .flat_map(|side| &side.findings);
    findings
        .map(|finding| format!("{} {}: {}", finding.requirement, finding.monitor, finding.text))
        .collect()
}

/// Tests that send what is right, and nothing else.
const QUIET: [(Role, &str); 5] = [
    (Role::Agv, "order-acceptance/base-and-horizon"),
    (Role::Agv, "order-update/"),
    (Role::Agv, "cancel-order/"),
    (Role::MasterControl, "dispatch/"),
    (Role::MasterControl, "order-update/"),
];

#[test]
fn who_did_nothing_wrong_is_accused_of_nothing_however_bad_the_recording() {
    let library = tck_testing::library();
    let mut wrong = BTreeSet::new();
    for pack in library.rules.packs.all() {
        for (role, tests) in QUIET {
            let whole = traffic(library, pack, role, tests, &[]);
            let judged = audited(library, whole.clone());
            wrong.extend(found(&judged, role));
            let sides = judged.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
            let mut sides = sides.filter(|side| side.role == role.word());
            assert!(
                sides.any(|side| side.judged > 10),
                "{role} {tests}: hardly anything was judged"
            );
            for seed in 0..12 {
                wrong.extend(found(&audited(library, spoiled(&whole, seed)), role));
            }
        }
    }
    let shown: Vec<String> = wrong.into_iter().collect();
    assert!(shown.is_empty(), "{}", shown.join("\n"));
}

#[test]
fn what_is_wrong_is_found_with_its_place() {
    let library = tck_testing::library();
    let pack = library.rules.packs.latest();
    for (role, tests, fault, requirement) in [
        (Role::Agv, "order-acceptance/", "horizon-not-reported", "STATE-12"),
        (
            Role::Agv,
            "order-acceptance/base-and-horizon",
            "boolean-as-text",
            "JSON-07",
        ),
        (Role::MasterControl, "dispatch/", "other-serial-number", "HDR-05"),
    ] {
        let messages = traffic(library, pack, role, tests, &[fault]);
        let result = audited(library, messages);
        let found = found(&result, role);
        assert!(
            found.iter().any(|finding| finding.starts_with(requirement)),
            "{fault}: {found:?}"
        );
        assert_eq!(result.verdict, Some(Verdict::Fail), "{fault}");
    }
}

#[test]
fn a_recording_without_times_is_judged_but_for_what_needs_them() {
    let library = tck_testing::library();
    let pack = library.rules.packs.latest();
    let mut messages = traffic(library, pack, Role::MasterControl, "dispatch/", &[]);
    for message in &mut messages {
        (message.at, message.retain) = (None, None);
    }
    let result = audited(library, messages);
    assert_eq!(found(&result, Role::MasterControl), BTreeSet::new());
    let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    let mut commanded = sides.filter(|side| side.role == "master-control");
    assert!(commanded.any(|side| side.verdict == Some(Verdict::Pass)));
    let vehicle = result
        .vehicles
        .iter()
        .flat_map(|vehicle| &vehicle.sides)
        .find(|side| side.role == "agv");
    let undecided = &vehicle.expect("a vehicle").undecided;
    assert!(undecided.iter().any(|open| open.monitor == "state/period"));
}

#[test]
fn a_version_without_rules_is_named_and_not_judged() {
    let library = tck_testing::library();
    let message = |payload: &str| Message {
        at: None,
        topic: "uagv/v9/acme/7/state".to_owned(),
        payload: bytes::Bytes::copy_from_slice(payload.as_bytes()),
        qos: None,
        retain: Some(false),
        place: Place::default(),
        after_gap: false,
        carried: None,
    };
    let foreign = audited(library, vec![message(r#"{"version":"9.1.0"}"#)]);
    assert_eq!((foreign.verdict, foreign.vehicles[0].sides.len()), (None, 0));
    assert!(
        foreign.vehicles[0]
            .not_judged
            .as_deref()
            .is_some_and(|why| why.contains("9.1.0"))
    );
    let silent = audited(library, vec![message("nonsense"), message("")]);
    assert!(silent.vehicles[0].not_judged.is_some());
}

#[test]
fn a_vehicle_with_other_software_is_judged_by_each_of_its_versions() {
    let library = tck_testing::library();
    let tests = "order-acceptance/base-and-horizon";
    let mut day = Vec::new();
    let mut protocols = Vec::new();
    for pack in library.rules.packs.all() {
        let begun = day.last().and_then(|message: &Message| message.at);
        let mut part = traffic(library, pack, Role::Agv, tests, &[]);
        let first = part[0].at.expect("a time").as_microsecond();
        for message in &mut part {
            let since = message.at.expect("a time").as_microsecond() - first;
            let at = begun.map_or(first, |begun: jiff::Timestamp| begun.as_microsecond() + 60_000_000);
            message.at = jiff::Timestamp::from_microsecond(at + since).ok();
        }
        protocols.push(pack.version.to_string());
        day.extend(part);
    }
    let result = audited(library, day);
    let versions: Vec<&str> = result
        .vehicles
        .iter()
        .filter_map(|vehicle| vehicle.protocol.as_deref())
        .collect();
    assert_eq!(versions, protocols);
    assert_eq!(found(&result, Role::Agv), BTreeSet::new());
}
