//! Names of members: what differs by version, and what no table may say.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that fails says where")]

use serde_json::{Value, json};
use tck_view::{
    ActionState, BatteryState, Deviation, Envelope2d, Envelope3d, Field, MessageView, Names, Presence, StateView, Topic,
};

fn names(table: &str) -> Names {
    toml::from_str(table).unwrap()
}

fn refused(table: &str) -> String {
    let error = toml::from_str::<Names>(table).unwrap_err().to_string();
    error.trim().to_owned()
}

#[test]
fn a_later_version_has_other_names() {
    let protocol = include_str!("../../../schemas/3.0/protocol.toml");
    let mut protocol: toml::Table = toml::from_str(protocol).unwrap();
    let names: Names = protocol.remove("members").unwrap().try_into().unwrap();
    let lacking = |field: Field| names.lacks(field) == Names::default().lacks(field);
    assert!(Field::all().any(|field| !lacking(field)));
    assert!(names.lacks(StateView::zone_set_id));
    assert!(!names.lacks(StateView::zone_requests));
    assert_eq!(names.name(Envelope2d::set), Some("envelope2dId"));
    assert_eq!(names.name(Envelope3d::set), Some("envelope3dId"));

    let message = json!({
        "headerId": 1,
        "mobileRobotPosition": { "x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "hall", "localized": true },
        "powerSupply": { "stateOfCharge": 50.0, "range": 300, "charging": true },
        "safetyState": { "activeEmergencyStop": "REMOTE", "fieldViolation": false },
        "actionStates": [{ "actionId": "a", "actionStatus": "FINISHED", "actionResult": "read" }],
        "instantActionStates": [{ "actionId": "b", "actionStatus": "RETRIABLE" }],
        "nodeStates": [{ "nodePosition": { "x": 0, "y": 0, "allowedDeviationXY": { "a": 1.0, "b": 0.5, "theta": 0 } } }],
        "zoneSetId": "gone",
    });
    let view = MessageView::of_value(Topic::State, &message, &names);
    let state = view.state().unwrap();
    assert_eq!(state.pose().map(|pose| (pose.x, pose.y)), Some((1.0, 2.0)));
    assert_eq!(state.charging(), Some(true));
    assert_eq!(state.battery_state.there().unwrap().reach.whole(), Some(300));
    assert_eq!(state.emergency_stop(), Some("REMOTE"));
    assert_eq!(state.action("a").unwrap().result_description.text(), Some("read"));
    assert!(state.action("b").is_some());
    assert!(state.zone_set_id.is_absent(), "what a version lacks is not read");
    let deviation = &state.node_states.elements()[0]
        .node_position
        .there()
        .unwrap()
        .allowed_deviation_xy;
    assert!(matches!(deviation.there(), Some(Deviation::Ellipse(ellipse)) if ellipse.a.float() == Some(1.0)));
}

#[test]
fn a_version_has_what_2_x_has_unless_its_table_says_otherwise() {
    let names = Names::default();
    assert_eq!(names.name(StateView::position), Some("agvPosition"));
    assert!(!names.lacks(StateView::maps));
    assert!(names.lacks(StateView::instant_action_states));
    let older = self::names("state.maps = false");
    assert_ne!(older.id(), names.id());
    assert_eq!(self::names("state.maps = true").id(), names.id());
    assert!(older.lacks(StateView::maps));
    let message = json!({ "maps": [], "instantActionStates": [] });
    let view = MessageView::of_value(Topic::State, &message, &older);
    assert!(view.state().unwrap().maps.is_absent());
    assert!(view.state().unwrap().instant_action_states.is_absent());
}

#[test]
fn a_member_can_move_into_an_object_inside() {
    let names = names(r#"batteryState = { batteryCharge = "cell/charge", reach = "cell/range" }"#);
    let message =
        json!({ "batteryState": { "cell": { "range": 7, "charge": "full", "age": [1] }, "charging": false } });
    let view = MessageView::of_value(Topic::State, &message, &names);
    let battery = view.state().unwrap().battery_state.there().unwrap();
    assert_eq!(battery.reach.whole(), Some(7));
    assert_eq!(battery.presence(BatteryState::battery_charge), Presence::Other);
    assert!(battery.charging.is(false));
    let path = [StateView::battery_state, BatteryState::reach];
    assert_eq!(names.raw(&message, &path), Some(&json!(7)));
    let odd = json!({ "batteryState": { "cell": [1, "2", null, {}, true], "charging": false } });
    assert!(
        MessageView::of_value(Topic::State, &odd, &names)
            .state()
            .unwrap()
            .charging()
            .is_some()
    );
}

#[test]
fn a_table_that_cannot_be_meant_is_refused() {
    assert!(refused("status.maps = true").contains("there is no object `status`"));
    assert!(refused("state.map = true").contains("the views know no member `state.map`"));
    assert!(refused(r#"state.paused = "driving""#).contains("two members of `state` are called `driving`"));
    assert!(refused(r#"state.paused = "a/b/c""#).contains("cannot stand for `state.paused`"));
    assert!(refused(r#"state.paused = """#).contains("cannot stand for `state.paused`"));
    let twice = r#"batteryState = { batteryCharge = "cell/charge", reach = "cell/charge" }"#;
    assert!(refused(twice).contains("two members of `batteryState` are called `charge`"));
    let both = r#"batteryState = { batteryCharge = "charging/charge" }"#;
    assert!(refused(both).contains("two members of `batteryState` are called `charging`"));
}

#[test]
fn fields_have_names_of_their_own() {
    assert_eq!(StateView::position.to_string(), "state.agvPosition");
    assert_eq!(ActionState::action_status.usual_name(), "actionStatus");
    let all: Vec<String> = Field::all().map(|field| field.to_string()).collect();
    let mut unique = all.clone();
    unique.sort();
    unique.dedup();
    assert_eq!(unique.len(), all.len());
}

/// A message with every member that a schema knows.
fn full(schema: &Value, root: &Value) -> Value {
    if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        return full(root.pointer(reference.trim_start_matches('#')).unwrap(), root);
    }
    let kind = schema.get("type");
    let kind = kind.and_then(|kind| kind.as_str().or_else(|| kind.as_array()?.last()?.as_str()));
    match kind {
        Some("object") => {
            let members = schema
                .get("properties")
                .and_then(Value::as_object)
                .into_iter()
                .flatten();
            Value::Object(
                members
                    .map(|(name, schema)| (name.clone(), full(schema, root)))
                    .collect(),
            )
        }
        Some("array") => json!([schema.get("items").map(|items| full(items, root))]),
        Some("boolean") => json!(true),
        Some("number" | "integer") => json!(3),
        _ => json!("text"),
    }
}

/// Every path to a member.
fn paths(value: &Value, here: &str, all: &mut Vec<(String, String)>) {
    match value {
        Value::Object(members) => {
            for (name, value) in members {
                all.push((here.to_owned(), name.clone()));
                paths(value, &format!("{here}/{name}"), all);
            }
        }
        Value::Array(list) => paths(&list[0], &format!("{here}/0"), all),
        _ => {}
    }
}

/// The view in words, without fingerprints.
fn shown(view: &MessageView) -> String {
    let words = format!("{view:?}");
    let parts = words
        .split("Print(")
        .map(|part| part.trim_start_matches(|c: char| c.is_ascii_digit()));
    parts.collect()
}

#[test]
fn every_member_of_the_schemas_can_be_read() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../schemas");
    let mut seen = 0;
    for version in ["2.0", "2.1", "3.0"] {
        let protocol = std::fs::read_to_string(format!("{root}/{version}/protocol.toml")).unwrap();
        let protocol: toml::Table = toml::from_str(&protocol).unwrap();
        let members = protocol
            .get("members")
            .cloned()
            .unwrap_or_else(|| toml::Value::Table(toml::Table::new()));
        let names: Names = members.try_into().unwrap();
        for topic in Topic::KNOWN {
            let Ok(schema) = std::fs::read_to_string(format!("{root}/{version}/{topic}.schema.json")) else {
                continue;
            };
            let schema: Value = serde_json::from_str(&schema).unwrap();
            let message = full(&schema, &schema);
            let whole = shown(&MessageView::of_value(topic, &message, &names));
            assert!(
                !whole.contains("Other("),
                "a member is of another type than its schema says: {whole}"
            );
            let mut all = Vec::new();
            paths(&message, "", &mut all);
            for (object, member) in all {
                let mut without = message.clone();
                let holder = without.pointer_mut(&object).unwrap().as_object_mut().unwrap();
                holder.remove(&member);
                let without = shown(&MessageView::of_value(topic, &without, &names));
                assert!(whole != without, "{version} {topic}: {object}/{member} is not read");
                seen += 1;
            }
        }
    }
    assert!(seen > 400, "{seen}");
}

/// The names of 3.0, as its pack has them.
fn of_3_0() -> Names {
    let protocol = include_str!("../../../schemas/3.0/protocol.toml");
    let mut protocol: toml::Table = toml::from_str(protocol).unwrap();
    protocol.remove("members").unwrap().try_into().unwrap()
}

#[test]
fn a_message_told_by_usual_names_is_written_as_the_version_writes_it_and_back() {
    let names = of_3_0();
    let told = json!({
        "headerId": 1, "orderId": "o",
        "agvPosition": { "x": 1.0, "positionInitialized": true },
        "batteryState": { "batteryCharge": 50.0 },
        "operatingMode": "TEACHIN",
        "actionStates": [{ "actionId": "a", "actionType": "initPosition", "resultDescription": "r" }],
        "instantActionStates": [],
        "unknown": { "agvPosition": 1 },
    });
    let mut written = told.clone();
    names.spell(Topic::State.object(), &mut written);
    assert_eq!(
        written,
        json!({
            "headerId": 1, "orderId": "o",
            "mobileRobotPosition": { "x": 1.0, "localized": true },
            "powerSupply": { "stateOfCharge": 50.0 },
            "operatingMode": "TEACH_IN",
            "actionStates": [{ "actionId": "a", "actionType": "initializePosition", "actionResult": "r" }],
            "instantActionStates": [],
            "unknown": { "agvPosition": 1 },
        })
    );
    names.unspell(Topic::State.object(), &mut written);
    assert_eq!(written, told);
    let mut order = json!({ "nodes": [
        { "nodePosition": { "x": 1, "allowedDeviationXY": { "a": 2.0, "b": 0.5, "theta": 0.1 } } },
        { "nodePosition": { "x": 1, "allowedDeviationXY": 2.0 } },
    ] });
    names.unspell(Topic::Order.object(), &mut order);
    let radius = |at: usize| order["nodes"][at]["nodePosition"]["allowedDeviationXY"].clone();
    assert_eq!(
        (radius(0), radius(1)),
        (json!(0.5), Value::Null),
        "a radius is no ellipse"
    );
    let mut of_2_x = json!({ "agvPosition": {}, "zoneSetId": "z", "orderId": "o" });
    names.unspell(Topic::State.object(), &mut of_2_x);
    assert_eq!(
        of_2_x,
        json!({ "orderId": "o" }),
        "what the version does not have is no member of it"
    );
}

#[test]
fn a_radius_is_written_as_an_ellipse_and_a_lacking_member_is_left_out() {
    let mut place = json!({ "x": 1, "allowedDeviationXY": 2 });
    of_3_0().spell_at(Topic::Order.object(), "/nodes/1/nodePosition", &mut place);
    assert_eq!(place["allowedDeviationXY"]["b"], json!(2));
    assert!(of_3_0().has_lost(Topic::Order.object(), "/edges/0/startNodeId"));
    let mut order = json!({ "zoneSetId": "z", "nodes": [{ "nodePosition": { "x": 0, "allowedDeviationXY": 0.5 } }],
        "edges": [{ "startNodeId": "a", "maxSpeed": 1.0 }] });
    of_3_0().spell(Topic::Order.object(), &mut order);
    let ellipse = json!({ "a": 0.5, "b": 0.5, "theta": 0.0 });
    assert_eq!(
        order,
        json!({ "nodes": [{ "nodePosition": { "x": 0, "allowedDeviationXY": ellipse } }], "edges": [{ "maximumSpeed": 1.0 }] })
    );
}

#[test]
fn paths_are_written_as_the_version_writes_them() {
    let (names, state, order) = (of_3_0(), Topic::State.object(), Topic::Order.object());
    assert_eq!(names.spelled_path(state, "agvPosition.x"), "mobileRobotPosition.x");
    assert_eq!(
        names.spelled_path(state, "actionStates[0].resultDescription"),
        "actionStates[0].actionResult"
    );
    assert_eq!(names.spelled_path(order, "/edges/0/maxSpeed"), "/edges/0/maximumSpeed");
    assert_eq!(names.spelled_path(order, "/edges/-"), "/edges/-");
    assert_eq!(
        names.spelled_names(state, &["batteryState", "reach"]),
        Some(vec!["powerSupply", "range"])
    );
    assert_eq!(names.spelled_names(state, &["zoneSetId"]), None);
    assert_eq!(names.spelled_names(state, &["nobody"]), Some(vec!["nobody"]));
}

#[test]
fn elements_stand_where_a_version_without_their_list_has_them() {
    let names = names(r#"state.instantActionStates = { among = "actionStates" }"#);
    assert!(names.lacks(StateView::instant_action_states) && names.differs());
    assert_eq!(
        names.spelled_path(Topic::State.object(), "instantActionStates[0].actionId"),
        "actionStates[0].actionId"
    );
    assert_eq!(names.id(), Names::default().id(), "views read the same by it");
    assert!(!Names::default().differs());
}
