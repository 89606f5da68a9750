use super::*;

fn download(id: &str, map: &str, version: &str, hash: &str) -> Value {
    let mut parameters = json!({ "mapId": map, "mapVersion": version, "mapDownloadLink": "http://127.0.0.1:1/map" });
    if !hash.is_empty() {
        parameters["mapHash"] = json!(hash);
    }
    json!({ "actions": [action("downloadMap", id, "NONE", parameters)] })
}

fn listed(bench: &Bench) -> Vec<String> {
    let state = bench.state();
    let map = |map: &Value| {
        format!(
            "{} {} {}",
            map["mapId"].as_str().unwrap(),
            map["mapVersion"].as_str().unwrap(),
            map["mapStatus"].as_str().unwrap()
        )
    };
    state["maps"].as_array().unwrap().iter().map(map).collect()
}

fn pair(map: &str, version: &str) -> Value {
    json!({ "mapId": map, "mapVersion": version })
}

#[test]
fn a_downloaded_map_appears_disabled_when_it_is_ready() {
    let mut bench = Bench::new();
    bench.send("instantActions", download("d", "new", "3", ""));
    assert_eq!(bench.status("d"), "INITIALIZING");
    bench.download(Download::Begun);
    assert_eq!((bench.status("d"), listed(&bench).len()), ("RUNNING".into(), 1));
    bench.download(Download::Done("map".into()));
    assert_eq!(bench.status("d"), "FINISHED");
    assert_eq!(listed(&bench), ["hall 1 ENABLED", "new 3 DISABLED"]);
    bench.instant("enableMap", "e", pair("new", "3"));
    assert_eq!(listed(&bench), ["hall 1 ENABLED", "new 3 ENABLED"]);
}

#[test]
fn a_download_that_does_not_work_fails_and_changes_nothing() {
    let hash = "00".repeat(32);
    let outcomes: [fn(&mut Bench); 4] = [
        |bench| bench.download(Download::Failed("404".into())),
        |bench| bench.download(Download::Done("".into())),
        |bench| bench.download(Download::Done("wrong".into())),
        |bench| bench.wait(20.1),
    ];
    for act in outcomes {
        let mut bench = Bench::new();
        bench.send("instantActions", download("d", "new", "3", &hash));
        act(&mut bench);
        assert_eq!(bench.status("d"), "FAILED");
        assert_eq!(bench.error_types(), ["mapError"]);
        assert_eq!(bench.reference("actionId").as_deref(), Some("d"));
        assert_eq!(listed(&bench), ["hall 1 ENABLED"]);
    }
}

#[test]
fn a_map_on_board_or_under_way_is_not_downloaded_again() {
    let mut bench = Bench::with(many_maps(), &[]);
    let before = listed(&bench);
    bench.send("instantActions", download("d1", "hall", "2", ""));
    assert_eq!((bench.status("d1"), listed(&bench)), ("FAILED".into(), before));
    assert_eq!(bench.error_types(), ["mapError"]);
    bench.send("instantActions", download("d2", "new", "1", ""));
    bench.send("instantActions", download("d3", "new", "1", ""));
    assert_eq!(
        (bench.status("d2"), bench.status("d3")),
        ("INITIALIZING".into(), "FAILED".into())
    );
}

#[test]
fn a_full_store_is_reported() {
    let mut bench = Bench::with(
        AgvConfig {
            map_capacity: 1,
            ..config()
        },
        &[],
    );
    bench.send("instantActions", download("d", "new", "1", ""));
    assert_eq!((bench.status("d"), listed(&bench).len()), ("FAILED".into(), 1));
    assert!(
        bench.state()["errors"][0]["errorDescription"]
            .as_str()
            .unwrap()
            .contains("room")
    );
}

#[test]
fn enabling_switches_versions_of_one_map_in_one_state() {
    let mut bench = Bench::with(many_maps(), &[]);
    let before = bench.states().len();
    bench.instant("enableMap", "e", pair("hall", "2"));
    assert_eq!(bench.states().len(), before + 1);
    assert_eq!(
        listed(&bench),
        ["hall 1 DISABLED", "hall 2 ENABLED", "yard 1 DISABLED", "loft 1 ENABLED"]
    );
    bench.instant("enableMap", "e2", pair("hall", "2"));
    bench.instant("enableMap", "e3", pair("hall", "9"));
    assert_eq!(
        (bench.status("e"), bench.status("e2"), bench.status("e3")),
        ("FINISHED".into(), "FINISHED".into(), "FAILED".into())
    );
}

#[test]
fn deleting_removes_what_is_not_in_use() {
    let mut bench = Bench::with(many_maps(), &[]);
    for (id, map, version, status) in [
        ("d1", "hall", "2", "FINISHED"),
        ("d2", "hall", "2", "FAILED"),
        ("d3", "hall", "1", "FAILED"),
        ("d4", "loft", "1", "FINISHED"),
    ] {
        bench.instant("deleteMap", id, pair(map, version));
        assert_eq!(bench.status(id), status, "{id}");
    }
    assert_eq!(listed(&bench), ["hall 1 ENABLED", "yard 1 DISABLED"]);
}

#[test]
fn a_map_the_order_needs_is_in_use() {
    let mut bench = Bench::with(many_maps(), &[]);
    let upstairs = json!({ "x": 3.0, "y": 0.0, "mapId": "loft" });
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/1/nodePosition", upstairs));
    bench.instant("deleteMap", "d", pair("loft", "1"));
    assert_eq!(bench.status("d"), "FAILED");
}

#[test]
fn orders_need_an_enabled_map() {
    for map in ["yard", "moon"] {
        let mut bench = Bench::with(many_maps(), &[]);
        let there = json!({ "x": 3.0, "y": 0.0, "mapId": map });
        bench.order(with(order("o1", 0, 0, "n1 n2"), "/nodes/1/nodePosition", there));
        assert_eq!(bench.state()["orderId"], "", "{map}");
        assert_eq!(bench.reference("mapId").as_deref(), Some(map));
    }
}

#[test]
fn a_map_enabled_by_hand_is_reported() {
    let mut bench = Bench::with(many_maps(), &[]);
    bench.command("enable-map", pair("hall", "2"));
    assert_eq!(listed(&bench)[..2], ["hall 1 DISABLED", "hall 2 ENABLED"]);
}

#[test]
fn without_the_feature_there_are_no_maps_and_no_actions_for_them() {
    let mut bench = Bench::with(
        AgvConfig {
            features: std::collections::BTreeSet::new(),
            ..config()
        },
        &[],
    );
    assert!(bench.state().get("maps").is_none());
    let names = bench.agv.config.action_types();
    assert!(!names.contains(&"downloadMap") && !names.contains(&"factsheetRequest") && names.contains(&"cancelOrder"));
    bench.instant("enableMap", "e", pair("hall", "1"));
    assert_eq!(bench.status("e"), "FAILED");
}
