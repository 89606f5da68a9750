use super::super::ZONE_TYPES;
use super::*;

/// A vehicle that heeds zones.
fn robot(faults: &[&str]) -> Bench {
    let mut config = config();
    let further = ["zones", "instantActionStates", "strictUpdates"];
    config.features.extend(further.map(str::to_owned));
    config.zone_types = ZONE_TYPES.map(str::to_owned).into();
    config.errors.duplicate_zone_set = "duplicate".into();
    config.errors.blocked_zone = "blocked".into();
    config.errors.node_unreachable = "unreachable".into();
    Bench::with(config, faults)
}

/// A rectangle from x to x, across the way.
fn zone(id: &str, kind: &str, (from, to): (f64, f64), over: &Value) -> Value {
    let corner = |x: f64, y: f64| json!({ "x": x, "y": y });
    let mut zone = json!({
        "zoneId": id, "zoneType": kind,
        "vertices": [corner(from, -1.0), corner(to, -1.0), corner(to, 1.0), corner(from, 1.0)],
    });
    for (key, value) in over.as_object().unwrap() {
        zone[key] = value.clone();
    }
    zone
}

fn send(bench: &mut Bench, id: &str, zones: &[Value]) {
    bench.send(
        "zoneSet",
        json!({ "zoneSet": { "mapId": "hall", "zoneSetId": id, "zones": zones } }),
    );
}

/// Sends and enables a set.
fn in_force(bench: &mut Bench, id: &str, zones: &[Value]) {
    send(bench, id, zones);
    bench.instant("enableZoneSet", &format!("enable-{id}"), json!({ "zoneSetId": id }));
}

fn listed(bench: &Bench) -> Vec<String> {
    let state = bench.state();
    let sets = state["zoneSets"].as_array().unwrap().iter();
    let text = |set: &Value, key: &str| set[key].as_str().unwrap().to_owned();
    sets.map(|set| format!("{} {}", text(set, "zoneSetId"), text(set, "zoneSetStatus")))
        .collect()
}

fn zone_actions(bench: &Bench) -> Vec<String> {
    let state = bench.state();
    let actions = state["zoneActionStates"].as_array().unwrap().iter();
    actions
        .map(|action| {
            format!(
                "{} {}",
                action["actionId"].as_str().unwrap(),
                action["actionStatus"].as_str().unwrap()
            )
        })
        .collect()
}

fn x(bench: &Bench) -> f64 {
    bench.agv.motion.pose(bench.now.moment).x
}

#[test]
fn a_set_comes_in_disabled_and_enabling_it_disables_the_other_of_its_map() {
    let mut bench = robot(&[]);
    send(&mut bench, "one", &[]);
    send(&mut bench, "two", &[]);
    assert_eq!(listed(&bench), ["one DISABLED", "two DISABLED"]);
    bench.instant("enableZoneSet", "e1", json!({ "zoneSetId": "one" }));
    bench.instant("enableZoneSet", "e2", json!({ "zoneSetId": "two" }));
    assert_eq!(listed(&bench), ["one DISABLED", "two ENABLED"]);
    bench.instant("enableZoneSet", "e3", json!({ "zoneSetId": "three" }));
    assert_eq!(listed(&bench), ["one DISABLED", "two ENABLED"]);
    bench.instant("deleteZoneSet", "d", json!({ "zoneSetId": "one" }));
    assert_eq!(listed(&bench), ["two ENABLED"]);
}

#[test]
fn what_is_on_board_or_cannot_be_used_is_refused() {
    let mut bench = robot(&[]);
    send(&mut bench, "one", &[]);
    send(&mut bench, "one", &[zone("z", "BLOCKED", (9.0, 10.0), &json!({}))]);
    assert_eq!(
        (bench.error_types(), listed(&bench)),
        (vec!["duplicate".to_owned()], vec!["one DISABLED".to_owned()])
    );
    let line = json!({ "vertices": [{ "x": 0, "y": 0 }, { "x": 1, "y": 0 }] });
    let twice = [
        zone("z", "BLOCKED", (9.0, 10.0), &json!({})),
        zone("z", "BLOCKED", (9.0, 10.0), &json!({})),
    ];
    send(&mut bench, "bad", &[zone("z", "BLOCKED", (0.0, 1.0), &line)]);
    send(&mut bench, "twice", &twice);
    send(
        &mut bench,
        "far",
        &[zone("z", "COORDINATED_REPLANNING", (9.0, 10.0), &json!({}))],
    );
    bench.send(
        "zoneSet",
        json!({ "zoneSet": { "mapId": "moon", "zoneSetId": "map", "zones": [] } }),
    );
    bench.send_raw("zoneSet", "nothing");
    assert_eq!(listed(&bench), ["one DISABLED"]);
    assert_eq!(bench.error_types().len(), 6);
}

#[test]
fn a_set_is_fetched_and_has_to_be_the_one_that_was_asked_for() {
    let fetched = |file: &str| {
        let mut bench = robot(&[]);
        let link = json!({ "zoneSetId": "one", "zoneSetDownloadLink": "http://127.0.0.1:1/z" });
        bench.instant("downloadZoneSet", "d", link);
        bench.download(Download::Begun);
        bench.download(Download::Done(file.to_owned().into()));
        listed(&bench)
    };
    let set = json!({ "mapId": "hall", "zoneSetId": "one", "zones": [] });
    assert_eq!(fetched(&set.to_string()), ["one DISABLED"]);
    assert_eq!(fetched(&json!({ "zoneSet": set }).to_string()), ["one DISABLED"]);
    assert!(fetched(&set.to_string().replace("one", "two")).is_empty());
    assert!(fetched("no zones").is_empty());
}

#[test]
fn it_stops_before_a_blocked_zone_says_so_and_waits_for_a_new_order() {
    let mut bench = robot(&[]);
    in_force(&mut bench, "one", &[zone("z", "BLOCKED", (2.0, 4.0), &json!({}))]);
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    bench.wait(20.0);
    assert_eq!(
        (bench.error_types(), bench.reference("nodeId")),
        (vec!["unreachable".into()], Some("n2".into()))
    );
    assert!((1.3..1.4).contains(&x(&bench)), "{}", x(&bench));
    in_force(&mut bench, "two", &[]);
    bench.wait(20.0);
    assert_eq!(bench.error_types(), ["unreachable"], "it does not try again");
    assert!(x(&bench) < 1.4);
    bench.instant("cancelOrder", "c", json!({}));
    bench.wait(1.0);
    let place = json!({ "x": x(&bench), "y": 0.0, "mapId": "hall" });
    bench.order(with(order("o2", 0, 0, "n1 n2"), "/nodes/0/nodePosition", place));
    bench.wait(20.0);
    assert!(bench.error_types().is_empty());
    assert!((x(&bench) - 3.0).abs() < 1e-6);
}

#[test]
fn a_zone_that_is_closed_around_it_stops_it_until_it_is_opened() {
    let mut bench = robot(&[]);
    send(&mut bench, "one", &[zone("z", "BLOCKED", (-1.0, 4.0), &json!({}))]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.5);
    bench.instant("enableZoneSet", "e", json!({ "zoneSetId": "one" }));
    let there = x(&bench);
    assert_eq!(
        (bench.error_types(), bench.state()["driving"].clone()),
        (vec!["blocked".into()], json!(false))
    );
    bench.wait(5.0);
    assert!((x(&bench) - there).abs() < 1e-9 && there > 0.0);
    in_force(&mut bench, "two", &[]);
    bench.wait(5.0);
    assert!(bench.error_types().is_empty() && (x(&bench) - 3.0).abs() < 1e-6);
}

#[test]
fn the_speed_of_a_zone_is_kept_as_long_as_a_corner_is_inside() {
    let mut bench = robot(&[]);
    let slow = zone("z", "SPEED_LIMIT", (2.0, 4.0), &json!({ "maximumSpeed": 0.5 }));
    let fast = zone("y", "SPEED_LIMIT", (2.0, 4.0), &json!({ "maximumSpeed": 5.0 }));
    in_force(&mut bench, "one", &[slow, fast]);
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    for _ in 0..200 {
        bench.wait(0.05);
        let (x, speed) = (x(&bench), bench.agv.motion.velocity().vx);
        let inside = x > 1.4 && x < 4.6;
        assert!(!inside || speed <= 0.5 + 1e-6, "{speed} at {x}");
        assert!(
            inside || (1.3..4.7).contains(&x) || speed == 0.0 || speed > 1.9,
            "{speed} at {x}"
        );
    }
    assert_eq!(bench.trail().last().unwrap(), "n3/4");
}

#[test]
fn actions_of_a_zone_are_done_at_its_entry_inside_and_at_its_exit_with_ids_of_their_own() {
    let mut bench = robot(&[]);
    let acts = |blocking: &str| json!([{ "actionType": "beep", "blockingType": blocking }]);
    let actions = json!({ "entryActions": acts("HARD"), "duringActions": acts("NONE"), "exitActions": acts("NONE") });
    in_force(&mut bench, "one", &[zone("z", "ACTION", (1.5, 2.0), &actions)]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.wait(0.6);
    assert_eq!(zone_actions(&bench), ["zone-action-1 RUNNING", "zone-action-2 WAITING"]);
    assert_eq!(bench.state()["driving"], json!(false), "it waits for a HARD action");
    bench.wait(20.0);
    let done = |id: u32| format!("zone-action-{id} FINISHED");
    assert_eq!(zone_actions(&bench), [done(1), done(2), done(3)]);
    assert!(bench.state()["actionStates"].as_array().unwrap().is_empty());
    bench.order(order("o2", 0, 0, "n2 n1"));
    bench.wait(20.0);
    assert_eq!(zone_actions(&bench).len(), 6);
    bench.instant("clearZoneActions", "c", json!({}));
    assert!(zone_actions(&bench).is_empty());
}

#[test]
fn a_direction_is_kept_unless_a_trajectory_leads_against_it() {
    let directed = |kind: &str, over: &Value| {
        let mut bench = robot(&[]);
        in_force(&mut bench, "one", &[zone("z", kind, (1.0, 2.0), over)]);
        bench.order(order("o1", 0, 0, "n1 n2"));
        bench.wait(20.0);
        (x(&bench) * 10.0).round()
    };
    let along = |direction: f64, limitation: &str| json!({ "direction": direction, "directedLimitation": limitation });
    assert!(directed("DIRECTED", &along(0.2, "STRICT")) > 29.0);
    assert!(directed("DIRECTED", &along(3.1, "SOFT")) > 29.0);
    for (direction, limitation) in [(3.1, "RESTRICTED"), (1.0, "STRICT")] {
        assert!(
            (9.0..=10.0).contains(&directed("DIRECTED", &along(direction, limitation))),
            "{direction} {limitation}"
        );
    }
    let both = |direction: f64| json!({ "direction": direction, "bidirectedLimitation": "RESTRICTED" });
    assert!(directed("BIDIRECTED", &both(3.1)) > 29.0 && directed("BIDIRECTED", &both(1.5)) < 11.0);
}

#[test]
fn a_used_set_stays_and_a_power_cycle_forgets_none() {
    let mut bench = robot(&[]);
    in_force(&mut bench, "one", &[]);
    bench.order(order("o1", 0, 0, "n1 n2 | n3"));
    bench.instant("deleteZoneSet", "d", json!({ "zoneSetId": "one" }));
    assert_eq!(listed(&bench), ["one ENABLED"]);
    bench.command("power-cycle", json!({}));
    bench.give(Input::Connected);
    assert_eq!(listed(&bench), ["one ENABLED"]);
}
