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
            place: SourcePosition::default(),
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

/// A recording as a bad recorder has it: begun in the middle, one in a hundred lost, one in a hundred twice, and out of
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
    for (role, tests) in QUIET {
        for pack in library.rules.packs.of_role(role) {
            let whole = traffic(library, pack, role, tests, &[]);
            let judged = audited(library, whole.clone());
            let mut accuses = |of: &str, result: &AuditResult| {
                let found = found(result, role).into_iter();
                wrong.extend(found.map(|text| format!("{role} {} {tests}, {of}: {text}", pack.version)));
            };
            accuses("whole", &judged);
            let sides = judged.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
            let mut sides = sides.filter(|side| side.role == role.word());
            assert!(
                sides.any(|side| side.judged > 10),
                "{role} {tests}: hardly anything was judged"
            );
            for seed in 0..12 {
                accuses(&format!("seed {seed}"), &audited(library, spoiled(&whole, seed)));
            }
            // Whatever was under way when the recording began.
            for begin in (0..whole.len()).step_by(whole.len() / 12 + 1) {
                accuses(&format!("from {begin}"), &audited(library, whole[begin..].to_vec()));
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

/// A vehicle that never takes a node off, in a recording that begins with one idle state.
fn one_idle_state(change: impl Fn(String) -> String) -> AuditResult {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../fixtures/captures/one-idle-state.jsonl"
    );
    let text = change(std::fs::read_to_string(path).expect("fixture"));
    let reader = Box::new(std::io::Cursor::new(text));
    let mut lines = tck_capture::Lines::new(reader, 0, tck_capture::Mapping::default());
    let mut messages = Vec::new();
    while let Some(item) = lines.read().expect("readable") {
        match item {
            tck_capture::Item::Message(message) => messages.push(message),
            other => panic!("no message: {other:?}"),
        }
    }
    audited(tck_testing::library(), messages)
}

fn side(result: &AuditResult, role: Role) -> &result::SideResult {
    let mut sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    sides.find(|side| side.role == role.word()).expect("a side")
}

#[test]
fn one_idle_state_is_enough_to_begin_with() {
    let result = one_idle_state(|text| text);
    let broken = &side(&result, Role::Agv).findings;
    let broken: BTreeSet<&str> = broken.iter().map(|finding| finding.requirement.as_str()).collect();
    assert!(broken.contains("STATE-12") && broken.contains("NODE-03"), "{broken:?}");
    assert_eq!(result.verdict, Some(Verdict::Fail));
}

#[test]
fn a_version_that_is_none_is_a_mistake_of_one_vehicle_and_the_rest_is_judged() {
    let packs = &tck_testing::library().rules.packs;
    let (oldest, latest) = (packs.all()[0].version, packs.latest().version);
    let spoken = format!("\"{latest}\"");
    let short = format!("{}.{}", latest.major, latest.minor);
    for (written, judged_by) in [
        (format!("v{oldest}"), oldest),
        (format!("{}.99.2", latest.major - 1), latest),
        (String::new(), latest),
        (short.clone(), latest),
    ] {
        let result = one_idle_state(|text| text.replace(&spoken, &format!("\"{written}\"")));
        assert_eq!(result.vehicles.len(), 1, "{written}");
        let vehicle = &result.vehicles[0];
        assert_eq!(vehicle.protocol, Some(judged_by.to_string()), "{written}");
        assert_eq!(vehicle.not_judged, None, "{written}");
        let found = found(&result, Role::Agv);
        for wanted in ["HDR-04", "STATE-12"] {
            assert!(
                found.iter().any(|finding| finding.starts_with(wanted)),
                "{written}: {found:?}"
            );
        }
    }
    // In some messages only.
    let result = one_idle_state(|text| text.replacen(&spoken, &format!("\"{short}\""), 3));
    assert_eq!(result.vehicles.len(), 1);
    let found = found(&result, Role::Agv);
    assert!(found.iter().any(|finding| finding.starts_with("HDR-04")));
    let newest = packs.all().last().expect("a pack").version;
    let later = format!("{}.0.0", newest.major + 1);
    let result = one_idle_state(|text| text.replace(&spoken, &format!("\"{later}\"")));
    let why = result.vehicles[0].not_judged.as_deref().expect("a reason");
    assert!(
        why.starts_with(&format!("version {later} is not known to this program")),
        "{why}"
    );
}

#[test]
fn the_version_may_be_told() {
    let library = tck_testing::library();
    let told = |version: &str| {
        let options = Options {
            protocol: Some(version.to_owned()),
            ..Options::default()
        };
        Audit::new(&library.rules, options).map(|_| ())
    };
    let oldest = library.rules.packs.all()[0].version;
    assert!(told(&format!("{}.{}", oldest.major, oldest.minor)).is_ok());
    let refused = told("9.1.0").expect_err("no rules").to_string();
    assert!(refused.contains("9.1.0 is not known to this program"), "{refused}");
}

#[test]
fn what_was_under_way_before_the_first_state_is_held_against_nobody_and_it_is_said() {
    let update = |text: String| text.replace("\"orderUpdateId\": 0, \"nodes\"", "\"orderUpdateId\": 1, \"nodes\"");
    let shown = |text: String| {
        text.replace(
            "\"orderId\": \"o1\", \"orderUpdateId\": 0, \"last",
            "\"orderId\": \"o1\", \"orderUpdateId\": 1, \"last",
        )
    };
    let result = one_idle_state(|text| shown(update(text)));
    assert_eq!(found(&result, Role::Agv), BTreeSet::new());
    assert_eq!(found(&result, Role::MasterControl), BTreeSet::new());
    let vehicle = side(&result, Role::Agv);
    assert!(vehicle.not_compared > vehicle.compared, "{vehicle:#?}");
    let page = page::page(&result);
    assert!(page.contains("were not compared"), "{page}");
    assert!(page.contains("messages are missing"), "{page}");
}

#[test]
fn a_side_of_which_nothing_relevant_was_seen_does_not_pass() {
    let first = |text: String| text.lines().take(1).collect::<String>();
    let result = one_idle_state(first);
    assert_eq!(result.verdict, None);
    let vehicle = side(&result, Role::Agv);
    assert_eq!((vehicle.verdict, vehicle.requirements.len()), (None, 0));
    let page = page::page(&result);
    assert!(
        page.contains("n/a   the vehicle, 1 message: no state of it was recorded"),
        "{page}"
    );
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
        place: SourcePosition::default(),
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
    for pack in library.rules.packs.of_devices() {
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

/// States and a zone set of the newest version, of which there is no reference device; the first state comes at this time.
fn newest(from: jiff::Timestamp) -> Vec<Message> {
    let packs = &tck_testing::library().rules.packs;
    let pack = packs.all().last().expect("a pack");
    let good = |name: &str| -> serde_json::Value {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let text = std::fs::read_to_string(format!("{root}/fixtures/messages/{}/good/{name}.json", pack.id));
        serde_json::from_str(&text.expect("fixture")).expect("JSON")
    };
    let message = |second: i64, name: &str, mut payload: serde_json::Value| {
        let at = jiff::Timestamp::from_second(from.as_second() + second).expect("a time");
        payload["headerId"] = second.into();
        payload["timestamp"] = format!("{at:.3}").into();
        Message {
            at: Some(at),
            topic: format!("vda5050/v{}/RobotCompany/KIT-0001/{name}", pack.version.major),
            payload: payload.to_string().into(),
            qos: Some(0),
            retain: None,
            place: SourcePosition::default(),
            after_gap: false,
            carried: None,
        }
    };
    let mut all = vec![message(2, "zoneSet", good("zoneSet-full"))];
    all.extend((1..6).map(|second| message(second, "state", good("state-driving"))));
    all
}

/// Traffic of another vehicle that speaks as the one of before.
fn renamed(mut messages: Vec<Message>, serial: &str) -> Vec<Message> {
    for message in &mut messages {
        let mut levels: Vec<&str> = message.topic.split('/').collect();
        let at = levels.len() - 2;
        levels[at] = serial;
        message.topic = levels.join("/");
        if let Ok(mut payload) = serde_json::from_slice::<serde_json::Value>(&message.payload) {
            payload["serialNumber"] = serial.into();
            message.payload = payload.to_string().into();
        }
    }
    messages
}

#[test]
fn on_a_site_of_many_versions_each_vehicle_is_judged_by_its_own() {
    let library = tck_testing::library();
    let mut site = Vec::new();
    let mut versions = BTreeSet::new();
    for pack in library.rules.packs.of_devices() {
        let one = traffic(library, pack, Role::Agv, "order-acceptance/base-and-horizon", &[]);
        site.extend(renamed(one, &format!("robot-{}", pack.version.minor)));
        versions.insert(pack.version.to_string());
    }
    let begun = site.iter().find_map(|message| message.at).expect("a time");
    site.extend(newest(begun));
    versions.insert(library.rules.packs.all().last().expect("a pack").version.to_string());
    site.sort_by_key(|message| message.at);
    let result = audited(library, site);
    let judged: BTreeSet<String> = result
        .vehicles
        .iter()
        .filter_map(|vehicle| vehicle.protocol.clone())
        .collect();
    assert_eq!((result.vehicles.len(), judged), (versions.len(), versions));
    assert_eq!(found(&result, Role::Agv), BTreeSet::new());
    assert_eq!(found(&result, Role::MasterControl), BTreeSet::new());
    // What only the newest version has is no stored message of an unknown kind.
    assert!(result.vehicles.iter().all(|vehicle| vehicle.not_judged.is_none()));
    let newest = result
        .vehicles
        .iter()
        .find(|vehicle| vehicle.messages.contains_key("zoneSet"));
    assert_eq!(newest.map(|vehicle| vehicle.retained), Some(0));
}

#[test]
fn who_speaks_another_major_version_than_was_asked_for_is_told_so_in_one_sentence() {
    let library = tck_testing::library();
    let packs = &library.rules.packs;
    let (latest, last) = (packs.latest(), packs.all().last().expect("a pack"));
    let judged_by = |protocol: &Pack, messages: Vec<Message>| {
        let options = Options {
            protocol: Some(protocol.id.clone()),
            ..Options::default()
        };
        let mut audit = Audit::new(&library.rules, options).expect("options");
        for message in messages {
            audit.observe(message);
        }
        audit.finish(Vec::new())
    };
    let result = judged_by(latest, newest(jiff::Timestamp::UNIX_EPOCH));
    assert_eq!((result.verdict, result.vehicles.len()), (None, 1));
    let why = result.vehicles[0].not_judged.as_deref().expect("a sentence");
    assert!(
        why.contains(&format!("speaks version {}", last.version)) && why.contains("migrate"),
        "{why}"
    );
    assert!(result.vehicles[0].sides.is_empty(), "{:#?}", result.vehicles[0].sides);
    assert!(page::page(&result).contains(why));
    let tests = "order-acceptance/base-and-horizon";
    let own = traffic(library, latest, Role::Agv, tests, &[]);
    let result = judged_by(last, own.clone());
    assert!(result.vehicles[0].not_judged.is_some() && result.verdict.is_none());
    // Topics of the version that was asked for, and another one in the headers: the headers are wrong.
    let spoken = format!("\"{}\"", latest.version);
    let wrong = own.into_iter().map(|message| Message {
        payload: String::from_utf8_lossy(&message.payload)
            .replace(&spoken, &format!("\"{}\"", last.version))
            .into(),
        ..message
    });
    let result = judged_by(latest, wrong.collect());
    assert_eq!(result.vehicles[0].not_judged, None);
    let found = found(&result, Role::Agv);
    assert!(found.iter().any(|finding| finding.starts_with("HDR-04")), "{found:?}");
}
