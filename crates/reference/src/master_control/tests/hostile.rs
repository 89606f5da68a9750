//! Whatever vehicles send, the master control goes on.

use proptest::prelude::*;
use serde_json::json;

use super::*;

fn any_json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        Just(json!(4_294_967_295_u32)),
        "[a-z0-9]{0,4}".prop_map(Value::from),
        Just(json!("n3")),
        Just(json!("FAILED")),
    ];
    leaf.prop_recursive(3, 16, 4, |inner| {
        let key = prop_oneof![
            Just("sequenceId".to_owned()),
            Just("actionId".to_owned()),
            Just("actionStatus".to_owned()),
            Just("errorReferences".to_owned()),
            "[a-z]{1,3}"
        ];
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
            prop::collection::btree_map(key, inner, 0..4).prop_map(Value::from_iter),
        ]
    })
}

const KEYS: [&str; 14] = [
    "orderId",
    "orderUpdateId",
    "lastNodeId",
    "lastNodeSequenceId",
    "nodeStates",
    "edgeStates",
    "agvPosition",
    "actionStates",
    "errors",
    "maps",
    "operatingMode",
    "loads",
    "protocolLimits",
    "protocolFeatures",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn no_message_makes_it_panic(
        changes in prop::collection::vec((0..KEYS.len(), any_json(), 0..3_usize), 1..12),
        sequence in any::<u32>(),
    ) {
        let mut bench = Bench::alone(MasterControl::new(config()));
        bench.say("connection", &connection("ONLINE"));
        bench.say("state", &state(&json!({})));
        bench.command("dispatch", json!({ "from": "n2", "to": "n4", "loadType": "EPAL" }));
        bench.wait(5.0);
        for (key, value, topic) in changes {
            let id = bench.orders().first().map_or(json!(""), |order| order["orderId"].clone());
            let changed = state(&json!({ "orderId": id, "lastNodeSequenceId": sequence, KEYS[key]: value }));
            bench.say(["state", "factsheet", "connection"][topic], &changed);
            bench.command("reroute", json!({ "to": "n5" }));
            bench.wait(1.0);
        }
        prop_assert!(bench.passed.len() < 500);
    }

    #[test]
    fn no_bytes_and_no_command_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..40), arguments in any_json()) {
        let mut bench = Bench::alone(MasterControl::new(config()));
        for topic in ["state", "connection", "factsheet", "visualization"] {
            let topic = format!("uagv/v7/Reference/agv-1/{topic}");
            bench.master_gets(Input::Message { topic, payload: bytes.clone().into() });
        }
        for name in crate::master_control::COMMANDS {
            bench.command(name, arguments.clone());
        }
        bench.wait(10.0);
    }
}

#[test]
fn a_message_of_another_vehicle_is_ignored() {
    let mut bench = Bench::alone(MasterControl::new(config()));
    let mut online = connection("ONLINE");
    online["serialNumber"] = json!("agv-2");
    bench.say("connection", &online);
    bench.say("state", &state(&json!({})));
    bench.command("dispatch", json!({ "to": "n4" }));
    bench.wait(10.0);
    assert!(bench.orders().is_empty());
}
