use std::collections::BTreeMap;
use std::sync::Arc;

use bytes::Bytes;

use super::members::compared;
use super::*;
use crate::tests::traffic;
use tck_base::verdict::Verdict;
use tck_capture::{Message, SourcePosition};
use tck_judge::MessageTally;
use tck_pack::{ChangeKind, FindingKind, Pack, Role};

/// The version that the reference devices speak, and the newest one.
fn versions() -> (Arc<Pack>, Arc<Pack>) {
    let packs = &tck_testing::library().rules.packs;
    let newest = packs.all().last().expect("a pack");
    (Arc::clone(packs.latest()), Arc::clone(newest))
}

fn migrated(role: Role, messages: Vec<Message>) -> Result<Migration, MigrateError> {
    let (_, to) = versions();
    let options = MigrateOptions {
        to: to.id.clone(),
        protocol: None,
        role,
        vehicles: Vec::new(),
        topic_template: None,
    };
    let mut migrating = Migrating::new(tck_testing::library(), options).expect("options");
    for message in messages {
        migrating.take(message);
    }
    migrating.finish(Vec::new())
}

fn said(topic: &str, payload: &str) -> Message {
    Message {
        at: "2026-01-01T12:00:00Z".parse().ok(),
        topic: topic.to_owned(),
        payload: Bytes::from(payload.to_owned()),
        qos: Some(0),
        retain: Some(false),
        place: SourcePosition { file: 0, line: 7 },
        after_gap: false,
        carried: None,
    }
}

fn of_reference(role: Role, tests: &str) -> Migration {
    let (from, _) = versions();
    let messages = traffic(tck_testing::library(), &from, role, tests, &[]);
    migrated(role, messages).expect("a migration")
}

fn member<'m>(migration: &'m Migration, topic: &str, before: &str) -> &'m MemberChange {
    let mut members = migration.members.iter();
    let found = members.find(|member| member.topic == topic && member.before == before);
    found.unwrap_or_else(|| panic!("{topic} {before}: {:#?}", migration.members))
}

#[test]
fn members_have_their_new_names_and_the_count_of_messages_with_them() {
    let migration = of_reference(Role::Agv, "order-acceptance/base-and-horizon");
    let position = member(&migration, "state", "agvPosition");
    assert_eq!(position.after.as_deref(), Some("mobileRobotPosition"));
    assert!(position.messages > 0 && position.kind == MemberChangeKind::Renamed);
    let initialized = member(&migration, "state", "agvPosition/positionInitialized");
    assert_eq!(initialized.after.as_deref(), Some("mobileRobotPosition/localized"));
    assert_eq!(initialized.messages, position.messages);
    // Below a member with another name, what keeps its own is not named.
    assert!(!migration.members.iter().any(|member| member.before == "agvPosition/x"));
    let gone = member(&migration, "state", "zoneSetId");
    assert_eq!((gone.kind, &gone.after), (MemberChangeKind::Gone, &None));
    let apart = member(&migration, "state", "actionStates");
    assert_eq!(apart.kind, MemberChangeKind::Apart);
    assert_eq!(apart.after.as_deref(), Some("instantActionStates"));
    let missing = migration
        .breaches
        .iter()
        .find(|breach| breach.member == "instantActionStates")
        .expect("a list that the later version demands");
    assert_eq!(missing.kind, FindingKind::Missing);
    assert!(missing.messages >= position.messages);
    // What has only got another name is wrong no more.
    let renamed = |breach: &Breach| breach.member.starts_with("powerSupply");
    assert!(!migration.breaches.iter().any(renamed), "{:#?}", migration.breaches);
}

#[test]
fn every_member_of_the_earlier_version_leads_somewhere_or_is_gone() {
    let packs = &tck_testing::library().rules.packs;
    for pair in packs.all().windows(2) {
        let (from, to) = (&pair[0], &pair[1]);
        let seen = MessageTally::new(from).result();
        for role in [Role::Agv, Role::MasterControl] {
            let compared = compared(from, to, role, &seen, &BTreeMap::new());
            for change in &compared.members {
                let places = |pack: &Pack, place: &str| {
                    let tree = pack.schema(&change.topic).expect("a schema").tree();
                    tree.nodes().iter().any(|node| node.pointer == format!("/{place}"))
                };
                assert!(places(from, &change.before), "{change:?}");
                match &change.after {
                    Some(after) => assert!(places(to, after), "{change:?}"),
                    None => assert_eq!(change.kind, MemberChangeKind::Gone),
                }
                if change.kind == MemberChangeKind::Gone {
                    assert!(!places(to, &change.before), "{change:?}");
                }
            }
        }
    }
}

#[test]
fn words_types_and_members_of_a_master_control_are_compared() {
    let (from, to) = versions();
    let seen = MessageTally::new(&from).result();
    let of = |role| compared(&from, &to, role, &seen, &BTreeMap::new());
    let (vehicle, fleet) = (of(Role::Agv), of(Role::MasterControl));
    let word = |all: &members::Compared, member: &str, before: &str| {
        let mut words = all.words.iter();
        let found = words.find(|word| word.member == member && word.before == before);
        found
            .unwrap_or_else(|| panic!("{before}: {:#?}", all.words))
            .after
            .clone()
    };
    let written = |text: &str| Some(text.to_owned());
    assert_eq!(word(&vehicle, "state/operatingMode", "TEACHIN"), written("TEACH_IN"));
    assert_eq!(word(&vehicle, "state/safetyState/eStop", "AUTOACK"), None);
    assert_eq!(word(&vehicle, "action", "initPosition"), written("initializePosition"));
    assert_eq!(
        word(&vehicle, "state/errors/*/errorType", "orderUpdateError"),
        written("OUTDATED_ORDER_UPDATE")
    );
    let change = |before: &str| {
        let mut members = fleet.members.iter();
        let found = members.find(|member| member.topic == "order" && member.before == before);
        found
            .unwrap_or_else(|| panic!("{before}: {:#?}", fleet.members))
            .clone()
    };
    assert_eq!(
        change("edges/*/maxSpeed").after.as_deref(),
        Some("edges/*/maximumSpeed")
    );
    assert_eq!(change("edges/*/startNodeId").kind, MemberChangeKind::Gone);
    let radius = change("nodes/*/nodePosition/allowedDeviationXY");
    assert_eq!(radius.kind, MemberChangeKind::Retyped);
    assert_eq!(radius.types, Some(["number".to_owned(), "object".to_owned()]));
}

#[test]
fn every_change_of_a_requirement_is_told_with_both_sentences_and_what_decides_it() {
    let migration = of_reference(Role::Agv, "order-acceptance/base-and-horizon");
    let library = tck_testing::library();
    let (from, to) = versions();
    let changes = library.rules.catalogue.changes(&library.rules.packs, &from, &to);
    for kind in [
        ChangeKind::Gone,
        ChangeKind::Changed,
        ChangeKind::Reworded,
        ChangeKind::New,
    ] {
        let wanted = changes.iter().filter(|change| {
            let requirement = change.requirement().expect("one of the two");
            change.kind == kind && requirement.role.concerns(Role::Agv)
        });
        assert_eq!(migration.of(kind).count(), wanted.count(), "{kind:?}");
        for row in migration.of(kind) {
            assert_eq!(row.before.is_some(), kind != ChangeKind::New, "{}", row.id);
            assert_eq!(row.after.is_some(), kind != ChangeKind::Gone, "{}", row.id);
            assert_eq!(row.why.is_some(), kind != ChangeKind::New, "{}", row.id);
        }
        let broken: Vec<bool> = migration.of(kind).map(RequirementRow::is_broken).collect();
        assert!(
            broken.windows(2).all(|pair| pair[0] || !pair[1]),
            "the broken first: {broken:?}"
        );
    }
    assert!(migration.of(ChangeKind::New).any(|row| !row.monitors.is_empty()));
    let lists = migration.requirements.iter().find(|row| row.id == "IACT-STATE-08");
    let lists = lists.expect("a list of its own for instant actions");
    assert_eq!((lists.now, lists.then), (None, Some(Verdict::Fail)), "{lists:?}");
    assert!(
        lists.count > 0
            && lists
                .found
                .as_ref()
                .is_some_and(|text| text.contains("instantActionStates"))
    );
    for rendered in [
        text::text(&migration),
        markdown::markdown(&migration),
        page::html(&migration).expect("a page"),
    ] {
        for part in ["mobileRobotPosition", "IACT-STATE-08", "TEACH", "CONN-04"] {
            assert!(rendered.contains(part), "{part} is missing");
        }
    }
}

#[test]
fn who_speaks_the_later_version_or_nothing_is_told_so() {
    let (from, to) = versions();
    let none = migrated(Role::Agv, vec![said("uagv/v2/acme/7/state", "{}"), said("other", "x")]);
    assert_eq!(none.map(|_| ()), Err(MigrateError::Nothing(Role::Agv)));
    let of = |version: &str, serial: &str| {
        said(
            &format!("uagv/v2/acme/{serial}/state"),
            &format!("{{\"version\":\"{version}\"}}"),
        )
    };
    let spoken = to.version.to_string();
    let later = migrated(Role::Agv, vec![of(&spoken, "7")]).map(|_| ());
    let wanted = MigrateError::NotEarlier {
        spoken: spoken.clone(),
        to: spoken.clone(),
    };
    assert_eq!(later, Err(wanted));
    let own = from.version.to_string();
    let two = migrated(Role::Agv, vec![of(&own, "7"), of(&own, "8")]).expect_err("two vehicles");
    assert!(two.to_string().contains("acme/7, acme/8"), "{two}");
    let mixed = migrated(Role::Agv, vec![of(&own, "7"), of(&spoken, "7"), of(&own, "7")]).expect("one of them");
    assert_eq!((mixed.messages, mixed.left_out), (2, 1));
    // A master control is one, however many vehicles it commands.
    let order = |serial: &str| {
        said(
            &format!("uagv/v2/acme/{serial}/order"),
            &format!("{{\"version\":\"{own}\",\"nodes\":[],\"edges\":[]}}"),
        )
    };
    let fleet = migrated(Role::MasterControl, vec![order("7"), order("8")]).expect("a master control");
    assert_eq!(fleet.messages, 2);
}

#[test]
fn what_a_hostile_device_says_is_bounded_and_never_live() {
    let (from, _) = versions();
    let hostile = "<script>alert(1)</script>\\u001b[2J|`";
    let state = format!(
        "{{\"version\":\"{}\",\"operatingMode\":\"{hostile}\",\"errors\":[{{\"errorLevel\":\"{hostile}\"}},{{\"errorLevel\":7}}]}}",
        from.version
    );
    let topic = "uagv/v2/<b>/\u{1b}7/state";
    let messages = vec![said(topic, &state), said(topic, "[[[["), said(topic, "{\"a\":NaN}")];
    let migration = migrated(Role::Agv, messages).expect("a migration");
    assert_eq!((migration.messages, migration.left_out), (1, 2));
    let level = migration
        .breaches
        .iter()
        .filter(|breach| breach.member == "errors/*/errorLevel");
    assert!(level.clone().count() > 0 && level.clone().all(|breach| breach.messages == 1));
    let html = page::html(&migration).expect("a page");
    assert!(!html.contains("<script") && !html.contains("<b>") && !html.contains('\u{1b}'));
    let markdown = markdown::markdown(&migration);
    assert!(!markdown.contains("<script") && !markdown.contains('\u{1b}'));
    assert!(!text::text(&migration).contains('\u{1b}'));
}
