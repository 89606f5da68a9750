//! Whatever a master control sends, no check panics.

use proptest::prelude::*;
use serde_json::Value;

use super::{begun, commands};

/// Values as they may come: names the checks look for, with anything in them.
fn anything() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop::sample::select(vec![
            "",
            "pick",
            "downloadMap",
            "cancelOrder",
            "n1",
            "hall",
            "HARD",
            "ü"
        ])
        .prop_map(Value::from),
    ];
    let names = vec![
        "orderId",
        "orderUpdateId",
        "nodes",
        "edges",
        "nodeId",
        "edgeId",
        "sequenceId",
        "released",
        "actions",
        "nodePosition",
        "x",
        "y",
        "mapId",
        "actionId",
        "actionType",
        "blockingType",
        "actionParameters",
        "key",
        "value",
        "corridor",
        "leftWidth",
        "rightWidth",
        "trajectory",
        "knotVector",
        "controlPoints",
        "degree",
        "zoneSetId",
        "maps",
        "actionStates",
        "protocolFeatures",
        "agvActions",
        "optionalParameters",
        "protocolLimits",
        "maxArrayLens",
        "typeSpecification",
    ];
    leaf.prop_recursive(6, 96, 6, move |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::btree_map(prop::sample::select(names.clone()), inner, 0..8).prop_map(|members| {
                Value::Object(
                    members
                        .into_iter()
                        .map(|(name, value)| (name.to_owned(), value))
                        .collect(),
                )
            }),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_message_makes_a_check_panic(messages in prop::collection::vec((0_usize..4, anything()), 1..8)) {
        let mut trace = begun();
        for (kind, message) in &messages {
            match kind {
                0 => trace.message("order", message),
                1 => trace.message("instantActions", message),
                2 => trace.sent("state", message),
                _ => trace.sent("factsheet", message),
            };
            trace.wait(6.0);
        }
        for name in commands() {
            let _ = trace.judge(name);
        }
    }
}
