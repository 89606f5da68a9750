//! Modes, times, maps, the link, the factsheet and the headers: what lies round the orders.

use serde_json::{Value, json};

use tck_journal::event::{Direction, LinkFault, Packet};

use super::{Trace, action, all, begun, merged, order, pick, sheet, under_way};

#[test]
fn nothing_is_sent_to_people() {
    let in_manual = |wait: f64, kind: &str| {
        let mut trace = begun();
        trace.shows(&json!({ "operatingMode": "MANUAL" })).wait(wait);
        trace.commands(
            "instantActions",
            &json!({ "actions": [action(kind, "i1", &json!([]))] }),
        );
        trace.judge("commands/modes").summary()
    };
    assert_eq!(in_manual(0.5, "startPause"), Vec::<String>::new());
    assert_eq!(in_manual(2.0, "startPause"), ["MODE-04"]);
    assert_eq!(in_manual(10.0, "stateRequest"), ["MODE-04 warning"]);
}

#[test]
fn orders_that_come_too_fast_are_found() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(0.95);
    trace.commands("order", &order("o1", 1, 2, 3, 4)).wait(0.5);
    trace.commands("order", &order("o1", 2, 3, 4, 5));
    assert_eq!(trace.judge("commands/order-interval").summary(), ["FACT-13"]);
}

#[test]
fn a_map_that_is_disabled_is_used_by_no_new_order() {
    let maps = |status: &str| json!({ "maps": [{ "mapId": "hall", "mapVersion": "1", "mapStatus": status }] });
    let (first, second) = (order("o1", 0, 0, 2, 4), order("o2", 0, 0, 2, 4));
    let ordered = |then: &Value| {
        let mut trace = begun();
        trace.shows(&maps("ENABLED")).wait(10.0);
        trace.commands("order", &first).wait(10.0);
        trace.shows(&maps("DISABLED")).wait(10.0);
        trace.shows(&maps("DISABLED")).wait(10.0);
        trace.commands("order", then);
        trace.judge("commands/map-enabled").summary()
    };
    assert_eq!(ordered(&second), ["MAP-09"]);
    assert_eq!(
        ordered(&first),
        Vec::<String>::new(),
        "no state has shown it: it comes again"
    );
}

#[test]
fn a_map_that_was_refused_is_deleted_first() {
    let map = json!([
        { "key": "mapId", "value": "hall" }, { "key": "mapVersion", "value": "1" },
        { "key": "mapDownloadLink", "value": "http://maps/hall" },
    ]);
    let again = |delete: bool, fails: bool| {
        let mut trace = begun();
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("downloadMap", "d1", &map)] }),
        );
        trace.wait(1.0).shows(&json!({
            "maps": [{ "mapId": "hall", "mapVersion": "1", "mapStatus": "ENABLED" }],
            "actionStates": [{ "actionId": "d1", "actionStatus": "FAILED" }],
        }));
        trace.wait(10.0);
        if delete {
            trace.commands(
                "instantActions",
                &json!({ "actions": [action("deleteMap", "d2", &map)] }),
            );
        }
        if fails {
            trace.wait(1.0).shows(&json!({
                "maps": [{ "mapId": "hall", "mapVersion": "1", "mapStatus": "ENABLED" }],
                "actionStates": [{ "actionId": "d2", "actionStatus": "FAILED" }],
            }));
            trace.wait(10.0);
        }
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("downloadMap", "d3", &map)] }),
        );
        trace.judge("commands/map-duplicate").summary()
    };
    assert_eq!(again(false, false), ["MAP-28"]);
    assert_eq!(again(true, false), Vec::<String>::new());
    assert_eq!(again(true, true), ["MAP-28"]);
    let mut trace = begun();
    trace.commands(
        "instantActions",
        &json!({ "actions": [action("downloadMap", "d1", &json!([]))] }),
    );
    assert_eq!(
        trace.judge("commands/map-download").summary(),
        ["MAP-16", "MAP-16", "MAP-16 warning"]
    );
}

#[test]
fn a_link_leads_to_a_host() {
    let link = |link: &str| {
        let map = json!([
            { "key": "mapId", "value": "hall" }, { "key": "mapVersion", "value": "1" },
            { "key": "mapDownloadLink", "value": link },
        ]);
        let mut trace = begun();
        trace.commands(
            "instantActions",
            &json!({ "actions": [action("downloadMap", "d1", &map)] }),
        );
        trace.judge("commands/map-download").summary()
    };
    for right in ["http://maps.example/hall.zip", "ftps://10.0.0.1/hall", "HTTPS://x"] {
        assert_eq!(link(right), Vec::<String>::new(), "{right}");
    }
    for wrong in [
        "/maps/hall.zip",
        "file:///home/maps/hall.zip",
        "C:\\maps\\hall.zip",
        "maps.example/hall.zip",
        "http:///hall",
    ] {
        assert_eq!(link(wrong), ["MAP-16 warning"], "{wrong}");
    }
}

#[test]
fn ids_that_are_used_twice_are_found() {
    let mut trace = begun();
    for order_id in ["o1", "o2"] {
        let mut order = order(order_id, 0, 0, 2, 4);
        order["nodes"][1]["actions"] = json!([action("pick", "a1", &pick())]);
        trace.commands("order", &order);
    }
    assert_eq!(trace.judge("commands/action-ids").summary(), ["ORD-MSG-17"]);
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 2)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(10.0);
    trace.shows(&json!({ "orderId": "o1", "lastNodeId": "n3" })).wait(10.0);
    trace.commands("order", &order("o1", 0, 0, 1, 2));
    assert_eq!(trace.judge("commands/order-ids").summary(), ["ORD-MSG-02"]);
    assert_eq!(trace.judge("commands/updates").summary(), Vec::<String>::new());
}

#[test]
fn what_was_sent_on_a_broken_link_is_forgotten() {
    let mut trace = begun();
    trace.commands("order", &order("o1", 0, 0, 2, 4)).wait(2.0);
    trace.shows(&under_way("o1", 0, 2)).wait(2.0);
    trace
        .fault(LinkFault::Cut { reset: false })
        .fault(LinkFault::Restore)
        .wait(2.0);
    trace.commands("order", &order("o1", 5, 3, 4, 5));
    assert_eq!(all(&trace), Vec::<String>::new());
}

#[test]
fn a_factsheet_that_has_just_changed_is_not_held_against_anybody() {
    let changed = |wait: f64| {
        let mut trace = begun();
        let mut strict = sheet();
        strict["protocolLimits"]["maxArrayLens"]["order.nodes"] = json!(2);
        trace.sent("factsheet", &strict).wait(wait);
        trace.commands("order", &order("o1", 0, 0, 2, 4));
        trace.judge("commands/limits").summary()
    };
    assert_eq!(changed(0.5), Vec::<String>::new());
    assert_eq!(changed(2.0), ["FACT-12"]);
}

#[test]
fn headers_topics_and_quality_of_a_master_control_are_judged() {
    let mut trace = begun();
    trace.commands(
        "order",
        &merged(order("o1", 0, 0, 2, 4), &json!({ "serialNumber": "me" })),
    );
    assert_eq!(trace.judge("header/identity").summary(), ["TOPIC-04 warning", "HDR-05"]);
    let mut trace = Trace::master_control_at_tap();
    trace.connect(1, None, 60, 3);
    trace.publish(1, "order", 1, false, &json!({}));
    trace.publish(1, "connection", 1, true, &json!({}));
    assert_eq!(trace.judge("mqtt/connect").summary(), ["MQTT-01"]);
    assert_eq!(trace.judge("mqtt/quality").summary(), ["MQTT-06 warning"]);
    assert_eq!(trace.judge("topic/own-side").summary(), ["TOPIC-15"]);
    let elsewhere = |topic: &str, check: &str| {
        let mut trace = Trace::master_control_at_tap();
        let packet = Packet::Publish {
            topic: topic.to_owned(),
            qos: 0,
            retain: false,
            dup: false,
            packet_id: None,
            payload: tck_journal::Payload::keep(bytes::Bytes::from_static(b"{}")),
        };
        trace.packet(1, Direction::FromDevice, packet);
        trace.judge(check).summary()
    };
    assert_eq!(elsewhere("uagv/v2/acme/7/instant_actions", "topic/names"), ["TOPIC-01"]);
    assert_eq!(elsewhere("erp/Order", "topic/names"), Vec::<String>::new());
    assert_eq!(elsewhere("uagv/acme/7/order", "topic/structure"), ["TOPIC-02 warning"]);
    assert_eq!(
        elsewhere("uagv/v9/acme/7/order", "topic/structure"),
        ["TOPIC-03 warning"]
    );
    assert_eq!(
        elsewhere("uagv/v2/acme/$7/order", "topic/structure"),
        ["TOPIC-07 warning"]
    );
}

#[test]
fn the_schema_names_the_requirements_of_commands() {
    let schema = |change: fn(&mut Value)| {
        let mut trace = begun();
        let mut order = order("o1", 0, 0, 2, 4);
        change(&mut order);
        trace.commands("order", &order);
        trace.judge("message/schema").summary()
    };
    assert_eq!(
        schema(|order| order["orderUpdateId"] = json!("0")),
        ["JSON-10", "JSON-06", "ORD-MSG-01"]
    );
    assert_eq!(
        schema(|order| order["nodes"][0]["released"] = json!("true")),
        ["JSON-10", "JSON-07", "ORD-MSG-05"]
    );
    assert_eq!(
        schema(|order| order["edges"][0]["edgeId"] = json!(7)),
        ["JSON-10", "JSON-06", "ORD-MSG-18"]
    );
    let blocking = |order: &mut Value| {
        order["nodes"][0]["actions"] = json!([{ "actionType": "x", "actionId": "a", "blockingType": "hard" }]);
    };
    assert_eq!(schema(blocking), ["JSON-10", "JSON-02", "ORD-MSG-16"]);
    let snake = |order: &mut Value| {
        let node = order["nodes"][0].as_object_mut().expect("a node");
        let id = node.remove("sequenceId").expect("a number");
        node.insert("sequence_id".to_owned(), id);
    };
    assert_eq!(schema(snake), ["JSON-10", "ORD-MSG-05", "JSON-01"]);
    let beside = |order: &mut Value| order["nodes"][0]["sequence_id"] = json!(0);
    assert!(schema(beside).is_empty());
}

#[test]
fn an_instant_action_that_must_not_come_is_found_under_the_older_name_of_the_array_too() {
    for list in ["actions", "instantActions"] {
        let mut trace = begun();
        trace.with.insert("types".into(), json!(["pick"]));
        let pause = json!({ list: [action("startPause", "a1", &json!([]))] });
        trace.commands("instantActions", &pause).wait(1.0);
        assert_eq!(trace.judge("commands/not-asked").summary(), [""; 0]);
        trace.commands("instantActions", &json!({ list: [action("pick", "a2", &pick())] }));
        assert_eq!(trace.judge("commands/not-asked").findings.len(), 1);
        trace.with = serde_json::Map::new();
        trace.with.insert("except".into(), json!(["pick"]));
        let found = trace.judge("commands/not-asked").findings;
        assert!(found.len() == 1 && found[0].message.contains("startPause"));
    }
}
