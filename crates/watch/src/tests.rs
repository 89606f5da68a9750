use serde_json::{Value, json};

use super::*;
use tck_base::clock::Moment;
use tck_base::verdict::Verdict;
use tck_capture::Place;
use tck_judge::Library;

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
        place: Place::default(),
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
