//! What views make of messages that are right, odd or too long.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that fails says where")]

use std::fmt::Write;

use serde_json::{Value, json};
use tck_view::{
    CHARACTERS, ELEMENTS, Json, Kind, MessageView, Names, NodeState, Number, Presence, Print, Scope, StateView, TOTAL,
    Topic,
};

fn read(topic: Topic, message: &Value) -> MessageView {
    MessageView::of_value(topic, message, &Names::default())
}

fn state(message: &Value) -> StateView {
    let view = read(Topic::State, message);
    StateView::clone(view.state().unwrap())
}

#[test]
fn a_member_is_there_absent_null_or_of_another_type() {
    let state = state(&json!({ "orderId": "", "driving": null, "paused": 1, "errors": {} }));
    assert_eq!(state.order_id.text(), Some(""));
    assert!(state.driving.is_null());
    assert_eq!(state.paused.other_kind(), Some(Kind::Number));
    assert_eq!(state.paused.flag(), None);
    assert!(state.errors.is_other() && state.errors.is_empty());
    assert!(state.maps.is_absent());
    assert_eq!(state.presence(StateView::paused), Presence::Other);
    assert_eq!(state.presence(StateView::maps), Presence::Absent);
    assert_eq!(
        state.presence(NodeState::node_id),
        Presence::Absent,
        "a field of another object"
    );
}

#[test]
fn nothing_is_repaired() {
    let state = state(&json!({ "orderUpdateId": "3", "driving": "true", "orderId": 7, "lastNodeSequenceId": 2.0 }));
    assert_eq!(state.order_update_id.whole(), None);
    assert_eq!(state.order_update_id.other().and_then(Json::text), Some("3"));
    assert_eq!(state.driving.flag(), None);
    assert_eq!(state.order_id.text(), None);
    assert_eq!(state.last_node_sequence_id.whole(), Some(2), "2.0 is a whole number");
    assert!(!state.last_node_sequence_id.number().unwrap().is_written_whole());
}

#[test]
fn numbers_keep_what_they_are() {
    let number = |value: Value| state(&json!({ "headerId": value })).header.header_id.number();
    assert_eq!(number(json!(u64::MAX)), Some(Number::Whole(u64::MAX)));
    assert_eq!(number(json!(-1)), Some(Number::Negative(-1)));
    assert_eq!(number(json!(1.5)).and_then(Number::whole), None);
    assert_eq!(number(json!(1e300)).and_then(Number::whole), None);
    assert_eq!(number(json!(-1)).and_then(Number::whole), None);
    assert_eq!(
        number(json!(1.5)).map(|number| number.to_string()).as_deref(),
        Some("1.5")
    );
}

#[test]
fn what_is_no_object_has_no_members() {
    for message in [
        json!(null),
        json!(true),
        json!(3),
        json!("text"),
        json!([{ "orderId": "a" }]),
    ] {
        for topic in Topic::KNOWN.into_iter().chain([Topic::Other]) {
            let view = read(topic, &message);
            assert_eq!(view.topic(), topic);
            assert!(!view.is_object());
            assert!(view.header().header_id.is_absent());
        }
    }
    let state = state(&json!({ "nodeStates": [{ "nodeId": "a" }, "b", null] }));
    let nodes = state.node_states.elements();
    assert!(nodes[0].is_object() && !nodes[1].is_object());
    assert_eq!(nodes[1].odd().map(ToString::to_string).as_deref(), Some("\"b\""));
    assert_eq!(nodes[2].odd(), Some(&Json::Null));
}

#[test]
fn what_is_too_long_is_cut_and_says_so() {
    let long = "ä".repeat(CHARACTERS + 1);
    let many: Vec<Value> = (0..=ELEMENTS).map(|at| json!({ "nodeId": at.to_string() })).collect();
    let state = state(&json!({ "orderId": long, "lastNodeId": "ä".repeat(CHARACTERS), "nodeStates": many }));
    let text = state.order_id.there().unwrap();
    assert!(text.is_cut() && text.chars().count() == CHARACTERS);
    assert!(!state.last_node_id.there().unwrap().is_cut());
    assert_eq!(state.node_states.elements().len(), ELEMENTS);
    assert_eq!(state.node_states.total(), ELEMENTS + 1);
    assert_eq!(state.node_states.complete(), None);
    assert!(state.errors.complete().is_none() && state.errors.is_empty());
}

#[test]
fn a_message_of_many_lists_is_cut_in_all() {
    let actions: Vec<Value> = vec![json!({}); 100];
    let nodes: Vec<Value> = vec![json!({ "actions": actions }); 1000];
    let view = read(Topic::Order, &json!({ "nodes": nodes }));
    let order = view.order().unwrap();
    let kept: usize = order.nodes.iter().map(|node| 1 + node.actions.elements().len()).sum();
    assert!(kept <= TOTAL && kept > TOTAL - 2000, "{kept}");
    assert!(order.nodes.iter().any(|node| node.actions.complete().is_none()));
}

#[test]
fn fingerprints_are_of_content_and_not_of_form() {
    let error = |text: &str| -> Value { serde_json::from_str(text).unwrap() };
    let prints = |errors: &[Value]| -> Vec<_> {
        let state = state(&json!({ "errors": errors }));
        state.errors.iter().map(|error| (error.print, error.essence)).collect()
    };
    let all = prints(&[
        error(r#"{ "errorType": "a", "errorLevel": "FATAL", "more": [1, {"x": 2.0}] }"#),
        error(r#"{ "more": [1.0, {"x": 2}], "errorLevel": "FATAL", "errorType": "a" }"#),
        error(r#"{ "errorType": "FATAL", "errorLevel": "a", "more": [1, {"x": 2.0}] }"#),
        error(r#"{ "errorType": "a", "errorLevel": "FATAL", "more": [{"x": 2.0}, 1] }"#),
        error(r#"{ "errorType": "a", "errorLevel": "FATAL", "more": [1, {"x": 2.0}], "errorDescription": "b" }"#),
    ]);
    assert_eq!(all[0], all[1]);
    assert_ne!(all[0].0, all[2].0);
    assert_ne!(all[0].0, all[3].0);
    assert_ne!(all[0].0, all[4].0);
    assert_eq!(all[0].1, all[4].1, "a description is not of the essence");
}

#[test]
fn a_message_that_is_sent_again_has_the_same_content() {
    let message = |header: u64, version: &str, battery: f64| {
        let message = json!({
            "headerId": header, "timestamp": format!("{header}"), "version": version, "orderId": "a",
            "batteryState": { "batteryCharge": battery },
        });
        read(Topic::State, &message)
    };
    let first = message(1, "2.1.0", 50.0);
    assert_ne!(first.print(), message(2, "2.1.0", 50.0).print());
    assert_eq!(first.content(), message(2, "2.1.0", 50.0).content());
    assert_ne!(first.content(), message(2, "2.0.0", 50.0).content());
    assert_ne!(first.content(), message(2, "2.1.0", 49.0).content());
    assert_eq!(first.essence(), message(2, "2.0.0", 49.0).essence());
}

#[test]
fn a_pose_is_one_that_the_vehicle_vouches_for() {
    let pose = |initialized: Value| {
        let mut message = json!({ "agvPosition": { "x": 1, "y": 2, "theta": 0.5, "mapId": "hall" } });
        if !initialized.is_null() {
            message["agvPosition"]["positionInitialized"] = initialized;
        }
        let state = state(&message);
        assert!(state.spot().is_some(), "where it is written to be");
        state.pose().is_some()
    };
    assert!(pose(json!(true)));
    assert!(!pose(json!(false)));
    assert!(!pose(json!("true")));
    assert!(!pose(Value::Null));
    let unsaid = state(&json!({ "agvPosition": { "x": 1, "y": 2, "theta": 3 } }));
    assert!(unsaid.position.there().unwrap().pose_unless_denied().is_some());
    assert!(state(&json!({ "agvPosition": { "x": 1e10, "y": 2 } })).spot().is_none());
}

#[test]
fn what_has_no_view_has_a_fingerprint_too() {
    let message = json!({ "errors": [{ "errorType": "a", "errorReferences": [{ "referenceKey": "b", "x": 1 }] }, 7] });
    let names = Names::default();
    let raw = names.raw_elements(&message, StateView::errors);
    let state = state(&message);
    let prints: Vec<_> = state.errors.iter().map(|error| error.print).collect();
    assert_eq!(prints, raw.iter().map(Print::of_value).collect::<Vec<_>>());
    assert_eq!(state.print, Print::of_value(&message));
    assert_eq!(names.raw_elements(&message, StateView::maps), [] as [Value; 0]);
}

#[test]
fn actions_are_found_wherever_they_stand() {
    let pick = json!({
        "actionId": "a", "actionType": "pick",
        "actionParameters": [7, { "key": "lhd", "value": null }, { "key": "stationType", "value": { "side": ["left"] } }],
    });
    let order = json!({ "nodes": [{ "sequenceId": 2 }, { "sequenceId": 0, "actions": [pick] }],
                        "edges": [{ "actions": [{ "actionId": "b" }] }] });
    let view = read(Topic::Order, &order);
    let order = view.order().unwrap();
    let all: Vec<_> = order
        .actions()
        .map(|(scope, action)| (scope, action.action_id.or_empty()))
        .collect();
    assert_eq!(all, [(Scope::Node, "a"), (Scope::Edge, "b")]);
    let (_, pick) = order.actions().next().unwrap();
    assert_eq!(pick.parameter("lhd"), None);
    assert_eq!(pick.parameter("height"), None);
    let station = pick.parameter("stationType").unwrap();
    assert_eq!(station.member("side").and_then(Json::list).map(<[Json]>::len), Some(1));
    assert_eq!(station.to_string(), r#"{"side":["left"]}"#);
    let in_sequence: Vec<_> = order
        .nodes_in_sequence()
        .iter()
        .map(|node| node.sequence_id.whole())
        .collect();
    assert_eq!(in_sequence, [Some(0), Some(2)]);

    let both = read(
        Topic::InstantActions,
        &json!({ "actions": 1, "instantActions": [{ "actionId": "c" }] }),
    );
    let instant = both.instant_actions().unwrap();
    assert_eq!(instant.all_actions().count(), 1);
    assert_eq!(instant.commanded().count(), 1);
    let named = read(Topic::InstantActions, &json!({ "actions": [], "instantActions": [{}] }));
    assert_eq!(named.instant_actions().unwrap().commanded().count(), 0);
}

#[test]
fn a_broken_connection_is_spelled_in_two_ways() {
    let broken = |word: &str| {
        let view = read(Topic::Connection, &json!({ "connectionState": word }));
        view.connection().unwrap().is_broken()
    };
    assert!(broken("CONNECTIONBROKEN") && broken("CONNECTION_BROKEN"));
    assert!(!broken("OFFLINE") && !broken(""));
}

#[test]
fn a_view_of_bytes_is_that_of_the_tree() {
    let text = r#"{ "headerId": 3, "errors": [{ "errorType": "a\u00e4" }], "velocity": { "vx": -0.0 } }"#;
    let names = Names::default();
    let of_bytes = MessageView::of_slice(Topic::State, text.as_bytes(), &names).unwrap();
    assert_eq!(of_bytes, read(Topic::State, &serde_json::from_str(text).unwrap()));
    for wrong in ["", "{", "{} {}", "{\"a\":}", "nan"] {
        assert!(
            MessageView::of_slice(Topic::State, wrong.as_bytes(), &names).is_err(),
            "{wrong}"
        );
    }
}

#[test]
fn what_is_shown_is_json() {
    let value = json!({ "a": [1, 2.5, -3, "\"", null, true], "b": {} });
    let view = read(Topic::State, &json!({ "orderId": value.clone() }));
    assert_eq!(
        view.state().unwrap().order_id.other().unwrap().to_string(),
        value.to_string()
    );
    let mut long = String::new();
    write!(long, "{}", "x".repeat(CHARACTERS + 5)).unwrap();
    let view = read(Topic::State, &json!({ "driving": long }));
    assert!(
        view.state()
            .unwrap()
            .driving
            .other()
            .unwrap()
            .to_string()
            .ends_with("x…\"")
    );
}

#[test]
fn views_go_from_thread_to_thread_and_parts_are_shared() {
    fn shared<T: Send + Sync + 'static>(_: &T) {}
    let view = read(Topic::State, &json!({ "orderId": "a" }));
    shared(&view);
    let text = view.state().unwrap().order_id.there().unwrap();
    assert!(std::ptr::eq(text.as_str(), text.clone().as_str()));
}
