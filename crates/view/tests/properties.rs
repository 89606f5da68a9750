//! Views of messages nobody thought of.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test that fails says where")]

use std::collections::BTreeMap;

use proptest::prelude::*;
use serde_json::{Map, Value, json};
use tck_view::{Field, MessageView, Names, Topic};

fn names_renamed() -> Names {
    let mut table: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    for field in Field::all() {
        let name = field.usual_name().to_owned();
        let renamed = new_name(&name);
        table
            .entry(field.object().to_string())
            .or_default()
            .insert(name, renamed);
    }
    serde_json::from_value(json!(table)).unwrap()
}

/// The usual names, with all that later versions have.
fn names_full() -> Names {
    let mut table: BTreeMap<String, BTreeMap<String, bool>> = BTreeMap::new();
    for field in Field::all() {
        let of_object = table.entry(field.object().to_string()).or_default();
        of_object.insert(field.usual_name().to_owned(), true);
    }
    serde_json::from_value(json!(table)).unwrap()
}

fn new_name(name: &str) -> String {
    format!("{}ö{}", name.len(), name.chars().rev().collect::<String>())
}

fn renamed(value: &Value) -> Value {
    match value {
        Value::Object(members) => Value::Object(
            members
                .iter()
                .map(|(name, value)| (new_name(name), renamed(value)))
                .collect(),
        ),
        Value::Array(list) => Value::Array(list.iter().map(renamed).collect()),
        other => other.clone(),
    }
}

fn scalar() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        (-1e12..1e12).prop_map(Value::from),
        "[a-zA-Z]{0,8}".prop_map(Value::from),
        ".{0,20}".prop_map(Value::from),
    ]
}

fn name() -> impl Strategy<Value = String> {
    let all: Vec<String> = Field::all().map(|field| field.usual_name().to_owned()).collect();
    prop_oneof![9 => proptest::sample::select(all), 1 => ".{0,12}"]
}

/// Any JSON, with many of the names that messages have.
fn anything() -> impl Strategy<Value = Value> {
    scalar().prop_recursive(5, 200, 12, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..6).prop_map(Value::from),
            prop::collection::vec((name(), inner), 0..12)
                .prop_map(|members| Value::Object(members.into_iter().collect::<Map<_, _>>())),
        ]
    })
}

/// Messages of known members only, each as it should be, of another type, or left out.
fn known() -> impl Strategy<Value = (Topic, Value)> {
    let position = || {
        object(vec![
            ("x", scalar().boxed()),
            ("theta", (-3.0..3.0).prop_map(Value::from).boxed()),
            ("positionInitialized", any::<bool>().prop_map(Value::from).boxed()),
            ("mapId", scalar().boxed()),
        ])
    };
    let action = || {
        object(vec![
            ("actionId", "[a-c]".prop_map(Value::from).boxed()),
            ("actionType", scalar().boxed()),
            (
                "actionParameters",
                list(object(vec![("key", scalar().boxed()), ("value", scalar().boxed())])),
            ),
        ])
    };
    let reference = || {
        object(vec![
            ("referenceKey", scalar().boxed()),
            ("referenceValue", scalar().boxed()),
        ])
    };
    let state = object(vec![
        ("headerId", scalar().boxed()),
        ("orderId", scalar().boxed()),
        ("agvPosition", position()),
        ("driving", scalar().boxed()),
        (
            "errors",
            list(object(vec![
                ("errorType", scalar().boxed()),
                ("errorReferences", list(reference())),
            ])),
        ),
        (
            "nodeStates",
            list(object(vec![
                ("nodeId", scalar().boxed()),
                ("nodePosition", position_of_node()),
            ])),
        ),
        (
            "instantActionStates",
            list(object(vec![("actionId", scalar().boxed())])),
        ),
    ]);
    let order = object(vec![
        ("timestamp", scalar().boxed()),
        ("orderUpdateId", scalar().boxed()),
        (
            "nodes",
            list(object(vec![("nodeId", scalar().boxed()), ("actions", list(action()))])),
        ),
        (
            "edges",
            list(object(vec![
                ("released", scalar().boxed()),
                ("actions", list(action())),
            ])),
        ),
    ]);
    let factsheet = object(vec![(
        "protocolLimits",
        object(vec![(
            "maxArrayLens",
            object(vec![
                ("order.nodes", scalar().boxed()),
                ("state.nodeStates", scalar().boxed()),
            ]),
        )]),
    )]);
    prop_oneof![
        state.prop_map(|message| (Topic::State, message)),
        order.prop_map(|message| (Topic::Order, message)),
        factsheet.prop_map(|message| (Topic::Factsheet, message)),
    ]
}

fn position_of_node() -> BoxedStrategy<Value> {
    let ellipse = object(vec![("a", scalar().boxed()), ("b", scalar().boxed())]);
    object(vec![
        ("x", scalar().boxed()),
        ("allowedDeviationXY", prop_oneof![scalar(), ellipse].boxed()),
    ])
}

fn object(members: Vec<(&'static str, BoxedStrategy<Value>)>) -> BoxedStrategy<Value> {
    let members: Vec<_> = members
        .into_iter()
        .map(|(name, value)| {
            prop::option::weighted(0.8, value).prop_map(move |value| value.map(|value| (name.to_owned(), value)))
        })
        .collect();
    members
        .prop_map(|members| Value::Object(members.into_iter().flatten().collect::<Map<_, _>>()))
        .boxed()
}

fn list(element: BoxedStrategy<Value>) -> BoxedStrategy<Value> {
    prop_oneof![9 => prop::collection::vec(element, 0..4).prop_map(Value::from), 1 => scalar()].boxed()
}

fn shuffled(value: &Value) -> Value {
    match value {
        Value::Object(members) => Value::Object(
            members
                .iter()
                .rev()
                .map(|(name, value)| (name.clone(), shuffled(value)))
                .collect(),
        ),
        Value::Array(list) => Value::Array(list.iter().map(shuffled).collect()),
        other => other.clone(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn any_json_can_be_read(value in anything()) {
        let names = names_full();
        for topic in Topic::KNOWN.into_iter().chain([Topic::Other]) {
            let view = MessageView::of_value(topic, &value, &names);
            prop_assert_eq!(view.is_object(), value.is_object());
            let _ = format!("{view:?}");
        }
    }

    #[test]
    fn the_bytes_say_what_the_tree_says(value in anything()) {
        let (names, text) = (names_full(), value.to_string());
        let tree: Value = serde_json::from_str(&text).unwrap();
        for topic in Topic::KNOWN {
            let of_bytes = MessageView::of_slice(topic, text.as_bytes(), &names).unwrap();
            prop_assert_eq!(of_bytes, MessageView::of_value(topic, &tree, &names));
        }
    }

    #[test]
    fn other_names_for_members_change_nothing((topic, value) in known()) {
        let usual = MessageView::of_value(topic, &value, &names_full());
        let other = MessageView::of_value(topic, &renamed(&value), &names_renamed());
        prop_assert_eq!(usual, other);
    }

    #[test]
    fn the_order_of_members_changes_no_fingerprint(value in anything()) {
        let names = names_full();
        let (one, other) = (value.clone(), shuffled(&value));
        let read = |value| MessageView::of_value(Topic::State, value, &names);
        prop_assert_eq!(read(&one).print(), read(&other).print());
        prop_assert_eq!(read(&one).content(), read(&other).content());
    }
}
