//! How a mock vehicle behaves when a test of a master control tells it to.

use std::collections::BTreeSet;

use super::*;
use crate::agv::COMMANDS;
use crate::deviations::personas::WORDS;
use tck_profile::VEHICLE_WORDS;

/// A version the vehicle was not made for.
const OTHER_VERSION: &str = "7.7.7";

#[test]
fn the_vehicle_knows_exactly_the_words_of_the_suites() {
    let words: BTreeSet<&str> = VEHICLE_WORDS.iter().map(|word| word.name).collect();
    let commands: BTreeSet<&str> = COMMANDS.iter().chain(WORDS).copied().collect();
    assert_eq!(words, commands);
    assert_eq!(commands.len(), COMMANDS.len() + WORDS.len());
}

#[test]
fn a_reset_vehicle_is_as_new_where_it_is_wanted_and_stays_connected() {
    let mut bench = Bench::new();
    bench.command("set-mode", json!({ "mode": "MANUAL" }));
    bench.command("provoke-error", json!({ "errorLevel": "FATAL", "errorType": "broken" }));
    assert_eq!(bench.error_types(), ["broken"]);
    bench.command(
        "declare",
        json!({ "factsheet": { "protocolLimits": { "maxArrayLens": { "order.nodes": 1 } } } }),
    );
    bench.command("place-load", json!({ "loadId": "l", "loadType": "KLT" }));
    bench.outputs.clear();
    bench.command("reset", json!({ "nodeId": "n3" }));
    let state = bench.state();
    assert_eq!(
        (&state["lastNodeId"], &state["operatingMode"]),
        (&json!("n3"), &json!("AUTOMATIC"))
    );
    assert_eq!((&state["errors"], &state["loads"]), (&json!([]), &json!([])));
    assert_eq!(state["agvPosition"]["x"], 6.0);
    assert!(
        !bench
            .outputs
            .iter()
            .any(|(_, output)| matches!(output, Output::Connect | Output::Drop))
    );
    let factsheet = bench.messages("/factsheet").pop().unwrap();
    assert_eq!(factsheet["protocolLimits"]["maxArrayLens"]["order.nodes"], 200);
    bench.order(order("o1", 0, 0, "n3 n4"));
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n4");
    bench.command("reset", json!({}));
    assert_eq!(
        (bench.state()["lastNodeId"].clone(), bench.state()["orderId"].clone()),
        (json!("n1"), json!(""))
    );
}

#[test]
fn late_messages_keep_their_order_and_words_overtake_them() {
    let mut bench = Bench::new();
    bench.command("answer-after", json!({ "seconds": 5 }));
    bench.order(order("o1", 0, 0, "n1 n2 | n3"));
    bench.wait(1.0);
    bench.command("answer-after", json!({ "seconds": 0.5 }));
    bench.order(order("o1", 1, 2, "n2 n3"));
    bench.command("press-pause", json!({}));
    assert_eq!(
        (bench.state()["paused"].clone(), bench.state()["orderId"].clone()),
        (json!(true), json!(""))
    );
    bench.command("release-pause", json!({}));
    bench.wait(3.9);
    assert_eq!(bench.state()["orderId"], "");
    bench.wait(0.2);
    assert_eq!(
        (bench.state()["orderId"].clone(), bench.state()["orderUpdateId"].clone()),
        (json!("o1"), json!(1))
    );
    assert!(bench.error_types().is_empty());
    bench.command("answer-after", json!({ "seconds": 60 }));
    bench.order(order("o2", 0, 0, "n3"));
    bench.command("reset", json!({}));
    bench.wait(90.0);
    assert_eq!(bench.state()["orderId"], "");
}

#[test]
fn states_are_lost_kept_back_or_coalesced() {
    let mut bench = Bench::new();
    let sent = bench.states().len();
    bench.command("lose-states", json!({ "count": 2 }));
    for _ in 0..2 {
        bench.command("press-pause", json!({}));
        bench.command("release-pause", json!({}));
    }
    assert_eq!(bench.states().len(), sent + 2);
    let ids: Vec<u64> = bench
        .states()
        .iter()
        .map(|state| state["headerId"].as_u64().unwrap())
        .collect();
    assert_eq!(ids[sent], ids[sent - 1] + 3);
    bench.command("stay-silent", json!({}));
    bench.command("press-pause", json!({}));
    bench.wait(60.0);
    assert_eq!(bench.states().len(), sent + 2);
    bench.command("well-behaved", json!({}));
    assert_eq!(bench.states().len(), sent + 3);
    bench.command("state-interval", json!({ "seconds": 3 }));
    bench.wait(3.0);
    let sent = bench.states().len();
    for _ in 0..3 {
        bench.command("press-pause", json!({}));
        bench.command("release-pause", json!({}));
        bench.wait(1.0);
    }
    assert!(bench.states().len() <= sent + 1, "{}", bench.states().len() - sent);
}

#[test]
fn orders_are_ignored_and_rejected_as_told() {
    let mut bench = Bench::new();
    bench.command("ignore-orders", json!({ "count": 1 }));
    let sent = bench.states().len();
    bench.order(order("o1", 0, 0, "n1"));
    assert_eq!(bench.states().len(), sent);
    bench.command("reject-orders", json!({ "errorType": "noRouteError", "count": 1 }));
    bench.order(order("o2", 0, 0, "n1 n2"));
    assert_eq!(
        (bench.error_types(), bench.reference("orderId")),
        (vec!["noRouteError".into()], Some("o2".into()))
    );
    assert_eq!(bench.state()["orderId"], "");
    bench.order(order("o3", 0, 0, "n1 n2 | n3"));
    assert!(bench.error_types().is_empty());
    bench.command(
        "reject-updates",
        json!({ "errorType": "orderUpdateError", "references": false }),
    );
    bench.order(order("o3", 1, 2, "n2 n3"));
    let state = bench.state();
    assert_eq!(
        (
            &state["errors"][0]["errorLevel"],
            &state["errors"][0]["errorReferences"]
        ),
        (&json!("WARNING"), &json!([]))
    );
    assert_eq!(state["orderUpdateId"], 0);
    bench.command("well-behaved", json!({}));
    bench.order(order("o3", 1, 2, "n2 n3"));
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn a_cancellation_is_held() {
    for (told, seconds) in [(json!({ "seconds": 4 }), 4.1), (json!({}), 30.0)] {
        let mut bench = Bench::new();
        let forever = told == json!({});
        bench.command("hold-cancel", told);
        bench.order(order("o1", 0, 0, "n1 n2"));
        bench.wait(0.5);
        bench.instant("cancelOrder", "c", json!({}));
        bench.wait(3.5);
        assert_eq!(
            (bench.status("c"), bench.state()["driving"].clone()),
            ("RUNNING".into(), json!(false))
        );
        bench.wait(seconds - 3.5);
        assert_eq!(bench.status("c") == "RUNNING", forever);
        bench.command("well-behaved", json!({}));
        assert_eq!(bench.status("c"), "FINISHED");
    }
}

#[test]
fn actions_and_downloads_fail_as_told() {
    let mut bench = Bench::new();
    bench.command(
        "fail-actions",
        json!({ "actionType": "beep", "errorType": "hornBroken" }),
    );
    let beep = action("beep", "a", "NONE", json!({}));
    let other = action("finePositioning", "b", "NONE", json!({}));
    let wanted = with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", beep);
    bench.order(with(wanted, "/nodes/0/actions/-", other));
    bench.wait(1.8);
    assert_eq!(
        (bench.status("a"), bench.status("b")),
        ("FAILED".into(), "FINISHED".into())
    );
    assert!(
        bench
            .states()
            .iter()
            .any(|state| state["errors"][0]["errorType"] == "hornBroken")
    );
    bench.command("refuse-map", json!({ "errorType": "duplicateMap" }));
    let map = json!({ "mapId": "hall", "mapVersion": "9", "mapDownloadLink": "http://bench/map" });
    bench.instant("downloadMap", "m", map);
    assert_eq!(bench.status("m"), "FAILED");
    assert!(bench.error_types().contains(&"duplicateMap".to_owned()));
    assert!(
        !bench
            .outputs
            .iter()
            .any(|(_, output)| matches!(output, Output::Fetch { .. }))
    );
}

#[test]
fn a_broken_off_vehicle_drives_on_and_returns_when_started() {
    let mut bench = Bench::new();
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.5);
    bench.command("break-off", json!({}));
    assert!(bench.outputs.iter().any(|(_, output)| matches!(output, Output::Drop)));
    bench.give(Input::ConnectionLost);
    let sent = bench.outputs.len();
    bench.wait(60.0);
    assert_eq!(bench.outputs.len(), sent);
    bench.command("stale-will", json!({}));
    bench.command("start", json!({}));
    assert!(matches!(bench.outputs.last(), Some((_, Output::Connect))));
    let will: Value = serde_json::from_slice(&bench.options().will.unwrap().payload).unwrap();
    assert_eq!(
        (&will["headerId"], &will["timestamp"]),
        (&json!(0), &json!("2026-03-03T05:07:08.39Z"))
    );
    bench.give(Input::Connected);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn it_stops_before_a_node_and_goes_on() {
    let mut bench = Bench::new();
    bench.command("stop-before", json!({ "nodeId": "n3" }));
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(20.0);
    let state = bench.state();
    assert_eq!((&state["lastNodeId"], &state["driving"]), (&json!("n2"), &json!(false)));
    assert_eq!(state["agvPosition"]["x"], 4.5);
    bench.command("go-on", json!({}));
    bench.wait(0.1);
    bench.command("halt", json!({}));
    bench.wait(10.0);
    assert_eq!(
        (bench.state()["lastNodeId"].clone(), bench.state()["driving"].clone()),
        (json!("n2"), json!(false))
    );
    bench.command("well-behaved", json!({}));
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn states_show_what_they_are_told() {
    let mut bench = Bench::new();
    bench.command("set-battery", json!({ "charge": 12.5, "charging": true }));
    bench.command("request-new-base", json!({ "on": true }));
    bench.command("lose-position", json!({}));
    bench.command("speak-version", json!({ "version": OTHER_VERSION }));
    bench.command(
        "show",
        json!({ "state": { "agvPosition": { "localizationScore": 0.1 }, "vendor": 7 } }),
    );
    let state = bench.state();
    assert_eq!(
        (
            &state["batteryState"]["batteryCharge"],
            &state["batteryState"]["charging"]
        ),
        (&json!(12.5), &json!(true))
    );
    assert_eq!(
        (&state["newBaseRequest"], &state["version"]),
        (&json!(true), &json!(OTHER_VERSION))
    );
    assert_eq!(
        (&state["agvPosition"]["localizationScore"], &state["vendor"]),
        (&json!(0.1), &json!(7))
    );
    assert_eq!(state["agvPosition"]["positionInitialized"], false);
    bench.order(order("o1", 0, 0, "n1 n2"));
    assert_eq!(bench.error_types(), ["noRouteError"]);
    bench.instant(
        "initPosition",
        "i",
        json!({ "x": 0.0, "y": 0.0, "theta": 0.0, "mapId": "hall", "lastNodeId": "n1" }),
    );
    assert_eq!(bench.state()["agvPosition"]["positionInitialized"], true);
    bench.command("show", json!({ "state": {} }));
    assert_eq!(bench.state()["vendor"], Value::Null);
    bench.command("well-behaved", json!({}));
    assert_eq!(
        (
            bench.state()["version"].clone(),
            bench.state()["newBaseRequest"].clone()
        ),
        (json!(VERSION), json!(false))
    );
}

#[test]
fn the_visualization_shows_what_it_is_told() {
    let mut site = config();
    site.visualization_interval = Some(Duration::from_secs(1));
    let mut bench = Bench::with(site, &[]);
    bench.command("show-visualization", json!({ "visualization": { "velocity": null } }));
    bench.wait(1.0);
    let messages = bench.messages("/visualization");
    assert!(messages[0].get("velocity").is_some());
    assert!(messages.last().unwrap().get("velocity").is_none());
}

#[test]
fn a_declared_factsheet_is_published_and_followed() {
    let mut bench = Bench::new();
    let patch = json!({
        "protocolLimits": { "maxArrayLens": { "order.nodes": 2, "node.actions": 1 }, "maxStringLens": { "idLen": 3 } },
        "protocolFeatures": { "agvActions": [{ "actionType": "cancelOrder", "actionScopes": ["INSTANT"] }] },
    });
    bench.command("declare", json!({ "factsheet": patch }));
    let last = bench.publications("/factsheet").last().map(|message| message.retain);
    assert_eq!(last, Some(true));
    let factsheet = bench.messages("/factsheet").pop().unwrap();
    assert_eq!(factsheet["protocolLimits"]["maxArrayLens"]["order.nodes"], 2);
    assert_eq!(factsheet["protocolFeatures"]["agvActions"].as_array().unwrap().len(), 1);
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    assert_eq!(bench.reference("orderId").as_deref(), Some("o1"));
    bench.order(order("o234", 0, 0, "n1"));
    assert!(bench.error_types().contains(&"validationError".to_owned()));
    let beep = action("beep", "a", "NONE", json!({}));
    bench.order(with(order("o2", 0, 0, "n1"), "/nodes/0/actions/-", beep));
    assert_eq!(bench.state()["orderId"], "");
    bench.command("declare", json!({ "factsheet": {} }));
    let factsheet = bench.messages("/factsheet").pop().unwrap();
    assert_eq!(factsheet["protocolLimits"]["maxArrayLens"]["order.nodes"], 200);
    bench.order(order("o234", 0, 0, "n1 n2 n3"));
    assert_eq!(bench.state()["orderId"], "o234");
}

#[test]
fn a_payload_is_published_once_and_a_retained_one_is_put_right() {
    let mut bench = Bench::new();
    let usual = bench.messages("/connection").len();
    bench.command(
        "publish",
        json!({ "topic": "connection", "payload": { "connectionState": "OFFLINE" } }),
    );
    let message = bench.messages("/connection").pop().unwrap();
    assert_eq!(
        (&message["connectionState"], &message["serialNumber"]),
        (&json!("OFFLINE"), &json!("agv-1"))
    );
    bench.command("publish", json!({ "topic": "state", "text": "{\"headerId\":" }));
    assert_eq!(
        bench.publications("/state").last().unwrap().payload,
        b"{\"headerId\":".as_slice()
    );
    bench.command("well-behaved", json!({}));
    assert_eq!(bench.messages("/connection").len(), usual + 2);
    assert_eq!(
        bench.messages("/connection").pop().unwrap()["connectionState"],
        "ONLINE"
    );
}
