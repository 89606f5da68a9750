//! Scripts of messages that a vehicle has to refuse, and that a faulty one guesses the meaning of.

use super::*;

/// Orders that are broken in one place each; where they are taken over, the vehicle stays on its node or drives to n2.
pub(super) fn broken_orders(bench: &mut Bench) {
    let here = |id: &str| order(id, 0, 0, "n1");
    let on = |id: &str| order(id, 0, 0, "n1 n2");
    let mut nothing = here("null");
    nothing["nodes"][0]["actions"] = Value::Null;
    let beep = |blocking: &str, duration: Value| action("beep", "b", blocking, json!({ "duration": duration }));
    let broken = [
        with(here("released"), "/nodes/0/released", Value::Null),
        with(here("text"), "/nodes/0/sequenceId", json!("0")),
        nothing,
        with(here("word"), "/nodes/0/actions/-", beep("SOMETIMES", json!(0.1))),
        with(here("number"), "/orderUpdateId", json!(1.5)),
        with(here("optional"), "/nodes/0/nodeDescription", json!(7)),
        with(here("header"), "/version", json!(7)),
        with(here("parameter"), "/nodes/0/actions/-", beep("NONE", json!("long"))),
        with(on("sequence"), "/edges/0/sequenceId", json!(0)),
        with(on("ends"), "/edges/0/startNodeId", json!("elsewhere")),
    ];
    for order in broken {
        bench.order(order);
        bench.wait(5.0);
    }
}

/// Instant actions nobody can read, while an order is driven.
pub(super) fn broken_instant_actions(bench: &mut Bench) {
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.send("instantActions", json!({ "actions": 5 }));
    bench.instant("stateRequest", "r", json!({}));
    bench.wait(20.0);
}

/// Another version of the map that is enabled.
pub(super) fn another_version(bench: &mut Bench) {
    let map = json!({ "mapId": "hall", "mapVersion": "3", "mapDownloadLink": "http://127.0.0.1/m" });
    bench.instant("downloadMap", "d", map);
    bench.download(Download::Begun);
    bench.download(Download::Done("map".into()));
    bench.wait(1.0);
}

#[test]
fn a_faultless_vehicle_takes_none_of_them_over() {
    let mut bench = Bench::new();
    broken_orders(&mut bench);
    assert_eq!(bench.state()["orderId"], "");
}
