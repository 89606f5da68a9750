use serde_json::{Value, json};

use super::*;
use tck_base::clock::Moment;
use tck_base::verdict::Verdict;
use tck_capture::SourcePosition;
use tck_judge::Library;
use tck_view::{BatteryState, SafetyState, StateView};

fn message(library: &Library, name: &str, number: u64, more: Value) -> (Stamp, Message) {
    let mut payload = json!({ "headerId": number, "version": library.rules.packs.latest().version.to_string(), "manufacturer": "acme", "serialNumber": "7",
        "timestamp": "2026-01-01T00:00:00.00Z" });
    if let (Value::Object(payload), Value::Object(more)) = (&mut payload, more) {
        payload.extend(more);
    }
    let at = Stamp {
        moment: Moment::from_micros(number * 200_000),
        utc: jiff::Timestamp::from_millisecond(1_767_225_600_000 + i64::try_from(number).expect("small") * 200)
            .expect("time"),
    };
    let message = Message {
        at: Some(at.utc),
        topic: format!("uagv/v2/acme/7/{name}"),
        payload: payload.to_string().into_bytes().into(),
        qos: Some(0),
        retain: Some(false),
        place: SourcePosition::default(),
        after_gap: false,
        carried: None,
    };
    (at, message)
}

fn watch(library: &Library) -> Watch<'_> {
    let options = Options {
        only: vec!["message/schema".to_owned()],
        ..Options::default()
    };
    Watch::new(&library.rules, options).expect("options")
}

fn shown(watch: &mut Watch<'_>, (at, message): (Stamp, Message)) -> Vec<Notice> {
    watch.take(at, message)
}

#[test]
fn a_finding_comes_with_the_message_that_shows_it() {
    let library = tck_testing::library();
    let mut watch = watch(library);
    let mut all = Vec::new();
    for number in 1..=12 {
        let state = json!({ "connectionState": if number == 1 { "ONLINE" } else { "AWAY" } });
        all.extend(shown(&mut watch, message(library, "connection", number, state)));
    }
    let fails: Vec<&Notice> = all
        .iter()
        .filter(|notice| notice.found.requirement == "CONN-10")
        .collect();
    assert_eq!(fails.len(), 11);
    let (topic, payload) = fails[0].message.as_ref().expect("the message");
    assert_eq!(topic, "uagv/v2/acme/7/connection");
    let payload: Value = serde_json::from_slice(payload).expect("JSON");
    assert_eq!(payload["headerId"], 2);
    let told: Vec<u64> = fails
        .iter()
        .filter(|notice| notice.is_told())
        .map(|notice| notice.found.count)
        .collect();
    assert_eq!(told, [1, 10]);
    let glance = watch.glances().next().expect("a vehicle");
    assert!(glance.found(Verdict::Fail) > 1);
    assert!(glance.kinds.values().all(|kind| kind.count == 11));
    assert_eq!(glance.connection.as_deref(), Some("AWAY"));
    assert_eq!(watch.finish().verdict, Some(Verdict::Fail));
}

#[test]
fn what_a_vehicle_does_and_how_fast_is_known_at_a_glance() {
    let library = tck_testing::library();
    let mut watch = watch(library);
    let order = json!({ "orderId": "o", "orderUpdateId": 1 });
    let state = |update: u64| {
        json!({ "orderId": "o", "orderUpdateId": update, "operatingMode": "AUTOMATIC", "lastNodeId": "n",
            "nodeStates": [{ "released": true }, { "released": false }], "actionStates": [
            { "actionId": "a", "actionStatus": "RUNNING" }, { "actionId": "b", "actionStatus": "FINISHED" }],
            "errors": [{ "errorLevel": "WARNING", "errorType": "x" }] })
    };
    let actions = json!({ "actions": [{ "actionId": "a" }, { "actionId": "b" }] });
    for one in [
        message(library, "order", 1, order),
        message(library, "state", 2, state(0)),
        message(library, "instantActions", 3, actions),
        message(library, "state", 4, state(1)),
    ] {
        shown(&mut watch, one);
    }
    let glance = watch.glances().next().expect("a vehicle");
    assert_eq!(glance.order, Some(("o".to_owned(), 1)));
    assert_eq!((glance.nodes, glance.actions), ((1, 1), 1));
    assert_eq!(glance.errors, [("WARNING".to_owned(), "x".to_owned())]);
    let order = &glance.reactions["order"];
    assert_eq!((order.count, order.up_to), (1, [0, 0, 0, 0, 1, 1, 1, 1, 1]));
    assert!((order.sum - 0.6).abs() < 1e-9);
    assert_eq!(glance.reactions["instantActions"].up_to, [0, 0, 1, 1, 1, 1, 1, 1, 1]);
    let page = metrics::page(&watch, metrics::Contact::default());
    insta::assert_snapshot!(page);
}

/// The time at which a message of that number comes.
fn at(library: &Library, number: u64) -> Stamp {
    message(library, "state", number, json!({})).0
}

fn watches_silence(library: &Library) -> Watch<'_> {
    let options = Options {
        only: vec![PERIOD.to_owned()],
        ..Options::default()
    };
    Watch::new(&library.rules, options).expect("options")
}

#[test]
fn a_vehicle_that_falls_silent_while_it_is_online_is_found_once() {
    let library = tck_testing::library();
    let mut watch = watches_silence(library);
    let online = json!({ "connectionState": "ONLINE" });
    shown(&mut watch, message(library, "connection", 1, online.clone()));
    shown(&mut watch, message(library, "state", 2, json!({})));
    // What is said to it is no sign of life.
    shown(&mut watch, message(library, "order", 150, json!({ "orderId": "o" })));
    assert!(watch.pass(at(library, 156)).is_empty() && watch.alarms().is_empty());
    let notices = watch.pass(at(library, 160));
    let found: Vec<(&str, &str, Verdict, u64)> = notices
        .iter()
        .map(|notice| {
            let found = &notice.found;
            (&*found.requirement, &*found.monitor, found.verdict, found.count)
        })
        .collect();
    assert_eq!(found, [("STATE-02", "watch/silence", Verdict::Warning, 1)]);
    assert!(watch.pass(at(library, 400)).is_empty(), "it is told once");
    let alarms: Vec<String> = watch.alarms().iter().map(|one| one.alarm.to_string()).collect();
    assert_eq!(alarms, ["says ONLINE, and no state came for 31 s"]);
    let glance = watch.glances().next().expect("a vehicle");
    assert!(glance.is_silent());
    assert_eq!(glance.last_state(), Some(at(library, 2)));
    assert_eq!(
        watch.finish().verdict,
        Some(Verdict::Warning),
        "and it goes on at the end"
    );
}

#[test]
fn who_is_back_has_been_silent_once() {
    let library = tck_testing::library();
    let mut watch = watches_silence(library);
    let online = json!({ "connectionState": "ONLINE" });
    shown(&mut watch, message(library, "connection", 1, online));
    let rest = |id: u64| {
        json!({ "headerId": id, "orderId": "", "orderUpdateId": 0, "lastNodeId": "n", "nodeStates": [], "edgeStates": [],
            "actionStates": [], "driving": false })
    };
    // Judging begins at a state that follows another one, at rest.
    shown(&mut watch, message(library, "state", 2, rest(1)));
    shown(&mut watch, message(library, "state", 3, rest(2)));
    assert_eq!(watch.pass(at(library, 200)).len(), 1);
    shown(&mut watch, message(library, "state", 210, rest(3)));
    shown(&mut watch, message(library, "state", 211, rest(4)));
    let words: Vec<&str> = watch.alarms().iter().map(|one| one.alarm.word()).collect();
    assert_eq!(words, ["silent", "back"]);
    let glance = watch.glances().next().expect("a vehicle");
    let kinds: Vec<(Verdict, u64)> = glance.kinds.values().map(|kind| (kind.verdict, kind.count)).collect();
    assert_eq!(kinds, [(Verdict::Fail, 1)]);
    let result = watch.finish();
    let counts: Vec<u64> = result.vehicles[0].sides[0]
        .findings
        .iter()
        .map(|one| one.count)
        .collect();
    assert_eq!(counts, [1]);
}

#[test]
fn who_is_offline_or_could_not_be_heard_is_not_silent() {
    let library = tck_testing::library();
    let mut watch = watches_silence(library);
    let connection = |state: &str| json!({ "connectionState": state });
    shown(&mut watch, message(library, "connection", 1, connection("ONLINE")));
    shown(&mut watch, message(library, "state", 2, json!({})));
    watch.unseen(at(library, 150).moment);
    assert!(watch.pass(at(library, 200)).is_empty());
    shown(&mut watch, message(library, "connection", 201, connection("OFFLINE")));
    assert!(watch.pass(at(library, 900)).is_empty() && watch.alarms().is_empty());
    // Of this one no state ever came: it may be the broker that keeps them.
    let (when, mut stored) = message(library, "connection", 901, connection("ONLINE"));
    stored.topic = "uagv/v2/acme/8/connection".to_owned();
    stored.retain = Some(true);
    watch.take(when, stored);
    assert!(watch.pass(at(library, 1100)).is_empty());
    let words: Vec<&str> = watch.alarms().iter().map(|one| one.alarm.word()).collect();
    assert_eq!(words, ["silent"]);
}

#[test]
fn a_broken_connection_a_fatal_error_and_an_emergency_stop_are_told_once() {
    let library = tck_testing::library();
    let mut watch = watch(library);
    let state = |errors: Value, stop: &str| json!({ "errors": errors, "safetyState": { "eStop": stop } });
    let fatal = json!([{ "errorType": "motor", "errorLevel": "FATAL" }, { "errorType": "x", "errorLevel": "WARNING" }]);
    let broken = json!({ "connectionState": "CONNECTIONBROKEN" });
    for one in [
        message(library, "state", 1, state(json!([]), "NONE")),
        message(library, "state", 2, state(fatal.clone(), "NONE")),
        message(library, "state", 3, state(fatal, "MANUAL")),
        message(library, "state", 4, state(json!([]), "MANUAL")),
        message(library, "connection", 5, broken.clone()),
        message(library, "connection", 6, broken),
    ] {
        shown(&mut watch, one);
    }
    let words: Vec<&str> = watch.alarms().iter().map(|one| one.alarm.word()).collect();
    assert_eq!(words, ["fatal", "emergency-stop", "connection-broken"]);
}

#[test]
fn the_worst_vehicle_comes_first() {
    let library = tck_testing::library();
    let mut watch = watch(library);
    for (number, serial) in [(1, "1"), (2, "2"), (3, "3")] {
        let word = if serial == "2" { "AWAY" } else { "ONLINE" };
        let more = json!({ "serialNumber": serial, "connectionState": word });
        let (when, mut message) = message(library, "connection", number, more);
        message.topic = format!("uagv/v2/acme/{serial}/connection");
        watch.take(when, message);
    }
    let serials: Vec<&str> = watch.worst_first().iter().map(|one| &*one.serial_number).collect();
    assert_eq!(serials, ["2", "1", "3"]);
}

#[test]
fn messages_are_kept_for_a_while() {
    let mut recent = Recent::default();
    for number in 1..=20 {
        recent.keep(number, "t".to_owned(), Bytes::from(vec![0; RECENT / 8]));
    }
    assert!(recent.bytes <= RECENT);
    assert!(recent.get(20).is_some() && recent.get(14).is_some());
    assert_eq!(recent.get(12), None);
}

#[test]
fn vehicles_of_many_versions_are_watched_side_by_side_each_by_the_version_it_names() {
    let library = tck_testing::library();
    let options = Options {
        only: vec!["message/*".to_owned()],
        ..Options::default()
    };
    let mut watch = Watch::new(&library.rules, options).expect("options");
    let mut notices = Vec::new();
    for pack in library.rules.packs.all() {
        let names = pack.names();
        let name = |field| names.name(field).expect("a name").to_owned();
        let power = json!({ name(BatteryState::battery_charge): 40.0, name(BatteryState::charging): false });
        let safety = json!({ name(SafetyState::emergency_stop): "MANUAL", name(SafetyState::field_violation): false });
        let state = json!({ "version": pack.version.to_string(), "operatingMode": "AUTOMATIC", "driving": false,
            name(StateView::battery_state): power, name(StateView::safety_state): safety });
        let (at, mut one) = message(library, "state", 1, state);
        one.topic = format!("uagv/v{}/acme/{}/state", pack.version.major, pack.id);
        notices.extend(watch.take(at, one));
    }
    let versions: Vec<String> = library
        .rules
        .packs
        .all()
        .iter()
        .map(|pack| pack.version.to_string())
        .collect();
    let seen: Vec<String> = watch.glances().filter_map(|glance| glance.version.clone()).collect();
    assert_eq!(seen, versions);
    // Read by its own names from its first message on.
    assert!(watch.glances().all(|glance| glance.charge == Some(40.0)));
    let words: Vec<&str> = watch.alarms().iter().map(|one| one.alarm.word()).collect();
    assert_eq!(words, vec!["emergency-stop"; versions.len()]);
    for pack in library.rules.packs.all() {
        let of_vehicle = notices.iter().filter(|notice| notice.found.serial_number == pack.id);
        let said: Vec<&str> = of_vehicle.map(|notice| notice.found.text.as_str()).collect();
        let lacks = pack.names().lacks(StateView::instant_action_states);
        assert!(
            said.iter().any(|text| text.contains("nodeStates")),
            "{}: {said:?}",
            pack.id
        );
        assert_eq!(
            said.iter().any(|text| text.contains("instantActionStates")),
            !lacks,
            "{}: {said:?}",
            pack.id
        );
        assert!(
            !said.iter().any(|text| text.contains("operatingMode")),
            "{}: {said:?}",
            pack.id
        );
    }
}
