//! Short scripts that between them make every fault show.

use super::*;
use crate::agv::tests::{curves, guesses};

type Scenario = (AgvConfig, fn(&mut Bench));

/// All scripts, each with the vehicle it is for.
pub(super) fn all() -> Vec<Scenario> {
    let seen = AgvConfig {
        visualization_interval: Some(Duration::from_secs(1)),
        ..config()
    };
    let bound = AgvConfig {
        stops_between_nodes: false,
        ..config()
    };
    let stubborn = AgvConfig {
        interruptible: false,
        ..config()
    };
    let small = AgvConfig {
        max_nodes: 3,
        ..config()
    };
    let zoned = AgvConfig {
        zone_set: Some("zones".into()),
        ..config()
    };
    vec![
        (seen, day),
        (config(), updates),
        (config(), completed_order),
        (config(), busy_vehicle),
        (config(), refused_orders),
        (small, refused_orders),
        (config(), guesses::broken_orders),
        (config(), guesses::broken_instant_actions),
        (many_maps(), guesses::another_version),
        (config(), orders_at_the_start),
        (config(), cancelled_order),
        (bound, cancelled_order),
        (stubborn, cancelled_order),
        (many_maps(), orders_on_maps),
        (many_maps(), maps_on_board),
        (config(), ways),
        (curves::free(), curves::curved_ways),
        (curves::line_guided(), curves::branches),
        (config(), node_actions),
        (config(), instant_actions),
        (config(), held_by_hand),
        (stations(), at_stations),
        (config(), charging),
        (config(), edge_lists),
        (config(), modes),
        (config(), driven_by_hand),
        (config(), out_of_command),
        (config(), defects),
        (zoned, zones),
        (config(), broken_link),
        (many_maps(), asked_afterwards),
    ]
}

/// A little of everything.
pub(super) fn day(bench: &mut Bench) {
    let pick = action(
        "pick",
        "a1",
        "HARD",
        json!({ "stationType": "floor", "loadType": "EPAL" }),
    );
    let soft = action("beep", "a2", "SOFT", json!({}));
    let edge = action("beep", "a3", "NONE", json!({ "duration": 9 }));
    let order1 = with(order("o1", 0, 0, "n1 n2 n3 | n4 n5"), "/nodes/1/actions/-", pick);
    let order1 = with(with(order1, "/nodes/2/actions/-", soft), "/edges/0/actions/-", edge);
    bench.order(order1.clone());
    bench.order(order1);
    bench.order(order("o1", 1, 0, "n1 n2"));
    bench.wait(1.0);
    bench.instant("startPause", "p", json!({}));
    bench.wait(1.0);
    bench.instant("stopPause", "q", json!({}));
    bench.instant("fly", "f", json!({}));
    bench.give(Input::ConnectionLost);
    bench.wait(2.0);
    let _ = bench.options();
    bench.give(Input::Connected);
    bench.order(order("o1", 2, 4, "n3 n4 | n5"));
    bench.order(order("o2", 0, 0, "n3 n4"));
    bench.order(json!({ "orderId": "bad" }));
    bench.wait(20.0);
    bench.instant("cancelOrder", "c", json!({}));
    bench.wait(5.0);
    bench.order(order("o3", 0, 0, "n4 n5 n6"));
    bench.wait(0.7);
    bench.instant("cancelOrder", "d", json!({}));
    let map = json!({ "mapId": "new", "mapVersion": "1", "mapDownloadLink": "http://127.0.0.1/m", "mapHash": "00" });
    bench.instant("downloadMap", "m", map);
    bench.give(Input::Download {
        token: 0,
        progress: Download::Begun,
    });
    bench.give(Input::Download {
        token: 0,
        progress: Download::Done("x".into()),
    });
    bench.instant("enableMap", "e", json!({ "mapId": "new", "mapVersion": "1" }));
    bench.command("emergency-stop", json!({}));
    bench.wait(50.0);
    bench.command("release-emergency-stop", json!({}));
    bench.command("set-mode", json!({ "mode": "MANUAL" }));
    bench.command("power-cycle", json!({}));
    bench.command("shutdown", json!({}));
}

fn beep(id: &str, blocking: &str) -> Value {
    action("beep", id, blocking, json!({}))
}

fn updates(bench: &mut Bench) {
    bench.order(with(
        order("o1", 0, 0, "n1 n2 n3 n4 | n5"),
        "/nodes/4/actions/-",
        beep("h", "NONE"),
    ));
    bench.order(order("o1", 1, 6, "n4"));
    bench.wait(30.0);
    bench.order(order("o2", 0, 0, "n4 n5 n4 n5 | n6"));
    bench.order(order("o2", 1, 6, "n5 n6 | n1"));
    bench.wait(30.0);
    bench.order(order("o3", 0, 0, "n6 n1"));
    bench.wait(30.0);
}

fn completed_order(bench: &mut Bench) {
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(10.0);
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.order(order("o1", 1, 0, "n2 n3"));
    bench.order(order("o1", 2, 2, "n2 n3"));
    bench.wait(10.0);
}

fn busy_vehicle(bench: &mut Bench) {
    bench.order(order("o0", 3, 0, "n1 n2"));
    bench.order(order("o0", 2, 0, "n1 n2"));
    bench.wait(6.0);
    bench.order(order("back", 0, 0, "n2 n1"));
    bench.wait(6.0);
    let long = action("beep", "a", "NONE", json!({ "duration": 5 }));
    bench.order(with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", long));
    bench.order(order("o2", 0, 0, "n1 n2"));
    bench.wait(6.0);
    bench.order(order("o3", 0, 0, "n1 n2 | n3"));
    bench.wait(6.0);
    bench.order(order("o4", 0, 0, "n2 n3"));
    bench.wait(6.0);
}

fn refused_orders(bench: &mut Bench) {
    let place = |map: &str| json!({ "x": 3.0, "y": 0.0, "mapId": map });
    let route = || order("o", 0, 0, "n1 n2 n3 n4");
    let orders = [
        with(order("o", 0, 0, "n1 n2 | n3"), "/edges/1/released", json!(true)),
        order("o", 0, 0, "n5 n6"),
        with(route(), "/nodes/1/actions/-", action("fly", "x", "NONE", json!({}))),
        with(
            route(),
            "/nodes/1/actions/-",
            action("startPause", "x", "NONE", json!({})),
        ),
        with(route(), "/edges/0/trajectory", json!({})),
        with(route(), "/edges/0/orientation", json!(1.57)),
        with(route(), "/edges/0/maxHeight", json!(0.5)),
        with(route(), "/nodes/1/nodePosition", place("moon")),
        route(),
    ];
    for order in orders {
        bench.order(order);
        bench.wait(20.0);
    }
}

fn orders_at_the_start(bench: &mut Bench) {
    let near = json!({ "x": 1.0, "y": 0.0, "mapId": "hall", "allowedDeviationXY": 1.5 });
    bench.order(with(order("o1", 0, 0, "n1"), "/nodes/0/nodePosition", near));
    let here = json!({ "x": 0.0, "y": 0.0, "mapId": "hall" });
    bench.order(with(order("o2", 0, 0, "somewhere n2"), "/nodes/0/nodePosition", here));
    bench.wait(10.0);
}

fn cancelled_order(bench: &mut Bench) {
    let early = action("beep", "early", "NONE", json!({ "duration": 0.1 }));
    let run = action("beep", "run", "NONE", json!({ "duration": 3 }));
    let order1 = with(order("o1", 0, 0, "n1 n2 n3 | n4"), "/nodes/0/actions/-", early);
    let order1 = with(
        with(order1, "/nodes/0/actions/-", run),
        "/nodes/1/actions/-",
        beep("later", "NONE"),
    );
    bench.order(order1);
    bench.wait(0.5);
    bench.instant("cancelOrder", "c", json!({}));
    bench.wait(10.0);
    bench.instant("cancelOrder", "c2", json!({}));
    bench.wait(5.0);
    let state = bench.state();
    let position = json!({ "x": state["agvPosition"]["x"], "y": 0.0, "mapId": "hall" });
    let wait = action("waitForTrigger", "w", "HARD", json!({ "triggerType": "t" }));
    let order2 = with(order("o2", 0, 0, "here n3"), "/nodes/0/nodePosition", position);
    bench.order(with(order2, "/nodes/0/actions/-", wait));
    bench.wait(2.0);
    bench.instant("cancelOrder", "c3", json!({}));
    bench.wait(2.0);
}

fn orders_on_maps(bench: &mut Bench) {
    let place = |map: &str| json!({ "x": 3.0, "y": 0.0, "mapId": map });
    for map in ["yard", "loft"] {
        bench.order(with(order(map, 0, 0, "n1 n2"), "/nodes/1/nodePosition", place(map)));
        bench.wait(10.0);
    }
}

fn maps_on_board(bench: &mut Bench) {
    let pair = |map: &str, version: &str| json!({ "mapId": map, "mapVersion": version });
    let link = "http://127.0.0.1/m";
    let download = |map: &str, version: &str| json!({ "mapId": map, "mapVersion": version, "mapDownloadLink": link });
    bench.instant("downloadMap", "d0", download("hall", "2"));
    bench.instant("downloadMap", "d1", download("new", "1"));
    bench.download(Download::Begun);
    bench.download(Download::Done("map".into()));
    bench.instant("downloadMap", "d2", download("new", "2"));
    bench.instant("enableMap", "e1", pair("hall", "2"));
    bench.instant("enableMap", "e2", pair("hall", "9"));
    bench.command("enable-map", pair("yard", "1"));
    for (id, map, version) in [
        ("r1", "hall", "2"),
        ("r2", "hall", "1"),
        ("r3", "hall", "9"),
        ("r4", "loft", "1"),
    ] {
        bench.instant("deleteMap", id, pair(map, version));
    }
    let pose = json!({ "x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "moon", "lastNodeId": "here" });
    bench.instant("initPosition", "i", pose);
}

fn ways(bench: &mut Bench) {
    let turned = json!({ "x": 3.0, "y": 0.0, "theta": 1.5, "mapId": "hall" });
    let order1 = with(order("o1", 0, 0, "n1 n2 n3 n2"), "/nodes/1/nodePosition", turned);
    let order1 = with(
        with(order1, "/edges/0/maxSpeed", json!(0.5)),
        "/edges/1/orientation",
        json!(3.1),
    );
    bench.order(with(
        with(order1, "/edges/1/maxRotationSpeed", json!(0.5)),
        "/edges/1/rotationAllowed",
        json!(false),
    ));
    bench.wait(30.0);
}

fn node_actions(bench: &mut Bench) {
    let pick = |id| {
        action(
            "pick",
            id,
            "HARD",
            json!({ "stationType": "floor", "loadType": "EPAL" }),
        )
    };
    let wait = action("waitForTrigger", "w", "SOFT", json!({ "triggerType": "t" }));
    let detect = action("detectObject", "o", "NONE", json!({}));
    let list = json!([beep("a", "NONE"), beep("b", "SOFT"), pick("p"), pick("q"), detect, wait]);
    let order1 = with(order("o1", 0, 0, "n1 n2 | n3"), "/nodes/0/actions", list);
    let order1 = with(order1, "/nodes/2/actions/-", beep("z", "NONE"));
    bench.order(with(order1, "/edges/0/actions/-", beep("e", "NONE")));
    bench.wait(30.0);
    bench.command("trigger", json!({}));
    bench.wait(30.0);
}

fn instant_actions(bench: &mut Bench) {
    bench.instant("beep", "long", json!({ "duration": 60 }));
    bench.instant("startCharging", "s", json!({}));
    bench.wait(1.0);
    bench.instant("stateRequest", "r", json!({}));
    bench.instant("factsheetRequest", "f", json!({}));
    let log = action("logReport", "l", "NONE", json!({ "reason": "r" }));
    bench.send("instantActions", json!({ "actions": [beep("i1", "NONE"), log] }));
    bench.instant("startPause", "p1", json!({}));
    bench.instant("startPause", "p2", json!({}));
    bench.instant("stopPause", "p3", json!({}));
    bench.wait(1.0);
    let pose = json!({ "x": 1.0, "y": 2.0, "theta": 0.5, "mapId": "hall", "lastNodeId": "here" });
    bench.instant("initPosition", "i", pose);
    let here = json!({ "x": 1.0, "y": 2.0, "mapId": "hall" });
    bench.order(with(order("o1", 0, 0, "here n2"), "/nodes/0/nodePosition", here));
    bench.instant("startCharging", "lane", json!({}));
    bench.wait(20.0);
}

fn held_by_hand(bench: &mut Bench) {
    let beep = with(order("o1", 0, 0, "n1"), "/nodes/0/actions/-", beep("a", "NONE"));
    bench.order(beep);
    bench.command("enter-field", json!({}));
    bench.wait(1.0);
    bench.command("leave-field", json!({}));
    bench.command("press-pause", json!({}));
    bench.instant("stopPause", "s", json!({}));
    bench.wait(1.0);
    bench.command("release-pause", json!({}));
    bench.command("place-load", json!({ "loadId": "L", "loadType": "EPAL" }));
    bench.wait(1.0);
}

/// A load and a charger on n1, a load on n2, nothing on n3.
fn stations() -> AgvConfig {
    AgvConfig {
        stations: ["n1", "n2"].map(|node| (node.to_owned(), true)).into(),
        ..many_maps()
    }
}

fn at_stations(bench: &mut Bench) {
    let load = || json!({ "stationType": "floor", "loadType": "EPAL" });
    let plain = |name, id| action(name, id, "HARD", json!({}));
    let lights = action("warningLights", "l", "NONE", json!({}));
    let pick = action("pick", "p", "HARD", load());
    let order1 = with(order("o1", 0, 0, "n1 n2 n3"), "/nodes/0/actions/-", pick);
    let order1 = with(order1, "/edges/0/actions/-", lights);
    let order1 = with(order1, "/nodes/1/actions/-", plain("drop", "taken"));
    let list = json!([plain("detectObject", "o"), plain("finePositioning", "f")]);
    bench.order(with(order1, "/nodes/2/actions", list));
    bench.wait(30.0);
    let order2 = with(order("o2", 0, 0, "n3 n2 n1"), "/nodes/2/actions/-", plain("drop", "d"));
    bench.order(with(order2, "/nodes/1/actions/-", plain("detectObject", "found")));
    bench.wait(30.0);
    bench.order(with(
        order("o2b", 0, 0, "n1"),
        "/nodes/0/actions/-",
        plain("finePositioning", "held"),
    ));
    bench.command("enter-field", json!({}));
    bench.wait(1.0);
    bench.command("leave-field", json!({}));
    bench.wait(5.0);
    bench.command("block-pause", json!({}));
    bench.instant("startPause", "b", json!({}));
    bench.instant("startCharging", "s", json!({}));
    bench.wait(1.0);
    bench.instant("stopCharging", "e", json!({}));
    bench.wait(1.0);
    let pose = json!({ "x": 0.0, "y": 0.0, "theta": 0.0, "mapId": "loft", "lastNodeId": "up" });
    let ride = action("initPosition", "i", "HARD", pose);
    bench.order(with(order("o3", 0, 0, "n1"), "/nodes/0/actions/-", ride));
    bench.wait(1.0);
}

fn charging(bench: &mut Bench) {
    for (name, id) in [
        ("startCharging", "s1"),
        ("startCharging", "s2"),
        ("stopCharging", "e1"),
        ("stopCharging", "e2"),
        ("startCharging", "s3"),
    ] {
        bench.instant(name, id, json!({}));
        bench.wait(1.0);
    }
    bench.command("lock-charger", json!({}));
    bench.instant("stopCharging", "e3", json!({}));
    bench.wait(1.0);
    bench.command("unlock-charger", json!({}));
    bench.instant("stopCharging", "e4", json!({}));
    bench.wait(1.0);
}

fn edge_lists(bench: &mut Bench) {
    let list = json!([beep("a", "SOFT"), beep("b", "HARD")]);
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/edges/0/actions", list));
    bench.wait(10.0);
}

fn driven_by_hand(bench: &mut Bench) {
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(0.5);
    bench.command("set-mode", json!({ "mode": "MANUAL" }));
    bench.command("drive-manually", json!({}));
    bench.command("move-to", json!({ "nodeId": "n1" }));
    bench.command("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.wait(1.0);
    bench.order(order("o2", 0, 0, "n1 n2"));
    bench.wait(5.0);
}

fn modes(bench: &mut Bench) {
    bench.command("set-mode", json!({ "mode": "SEMIAUTOMATIC" }));
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.5);
    bench.command("set-mode", json!({ "mode": "MANUAL" }));
    bench.command("move-to", json!({ "x": 1.0 }));
    bench.wait(5.0);
}

fn out_of_command(bench: &mut Bench) {
    bench.command("set-mode", json!({ "mode": "TEACHIN" }));
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.command("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.wait(5.0);
}

fn defects(bench: &mut Bench) {
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.2);
    bench.command("provoke-error", json!({ "errorLevel": "FATAL" }));
    bench.wait(1.0);
    bench.instant("stateRequest", "r", json!({}));
    bench.command("clear-error", json!({}));
    bench.wait(5.0);
}

fn zones(bench: &mut Bench) {
    let with_zones = |id: &str, zones: &str| with(order(id, 0, 0, "n1"), "/zoneSetId", json!(zones));
    bench.order(with_zones("o1", "zones"));
    bench.order(with_zones("o2", "other zones"));
}

fn asked_afterwards(bench: &mut Bench) {
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(10.0);
    bench.instant("stateRequest", "r", json!({}));
    for (id, version) in [("e1", "2"), ("e2", "1")] {
        bench.instant("enableMap", id, json!({ "mapId": "hall", "mapVersion": version }));
    }
    let mut nameless = order("o2", 0, 0, "n2");
    nameless.as_object_mut().unwrap().remove("orderId");
    bench.order(nameless);
    bench.wait(1.0);
    bench.send_raw("order", "{");
    bench.wait(1.0);
    let here = json!({ "x": 3.0, "y": 0.0, "mapId": "hall" });
    bench.order(with(order("o3", 0, 0, "spot"), "/nodes/0/nodePosition", here));
    bench.wait(1.0);
}

fn broken_link(bench: &mut Bench) {
    bench.order(order("o1", 0, 0, "n1 n2 | n3"));
    bench.give(Input::ConnectionLost);
    bench.wait(20.0);
    bench.give(Input::Connected);
    bench.command("shutdown", json!({}));
}
