//! Ways through COORDINATED_REPLANNING zones: what is asked for, granted, driven, lost and given back.

use super::super::ZONE_TYPES;
use super::curves::free;
use super::*;

/// A freely navigating vehicle with such zones from 1.5 to 4 m along its way, in force.
fn before_zones(ids: &[&str], faults: &[&str]) -> Bench {
    let mut config = free();
    let further = ["zones", "instantActionStates", "strictUpdates", "modesClear"];
    config.features.extend(further.map(str::to_owned));
    config.zone_types = ZONE_TYPES.map(str::to_owned).into();
    config.zone_types.insert("COORDINATED_REPLANNING".to_owned());
    config.errors.release_loss = "lost".into();
    for name in ["responses", "zoneSet"] {
        let topic = format!("uagv/v7/Reference/agv-1/{name}");
        config.topics.insert(name.to_owned(), topic);
    }
    let mut bench = Bench::with(config, faults);
    let corner = |x: f64, y: f64| json!({ "x": x, "y": y });
    let zones = ids.iter().map(|id| {
        json!({
            "zoneId": id, "zoneType": "COORDINATED_REPLANNING",
            "vertices": [corner(1.5, -1.0), corner(4.0, -1.0), corner(4.0, 1.0), corner(1.5, 1.0)],
        })
    });
    let zones: Vec<Value> = zones.collect();
    let set = json!({ "zoneSet": { "mapId": "hall", "zoneSetId": "set", "zones": zones } });
    bench.send("zoneSet", set);
    bench.instant("enableZoneSet", "enable", json!({ "zoneSetId": "set" }));
    bench
}

fn requests(bench: &Bench) -> Vec<Value> {
    bench.state()["zoneRequests"].as_array().unwrap().clone()
}

fn statuses(bench: &Bench) -> Vec<String> {
    let text = |one: &Value| {
        format!(
            "{} {}",
            one["zoneId"].as_str().unwrap(),
            one["requestStatus"].as_str().unwrap()
        )
    };
    requests(bench).iter().map(text).collect()
}

/// Answers one of its requests.
fn answer(bench: &mut Bench, which: usize, kind: &str) {
    let id = requests(bench)[which]["requestId"].clone();
    let answers = json!({ "responses": [{ "requestId": id, "grantType": kind }] });
    bench.send_raw("responses", answers.to_string().into_bytes());
}

fn place(bench: &mut Bench, seconds: f64) -> (f64, f64) {
    bench.wait(seconds);
    let pose = bench.agv.motion.pose(bench.now.moment);
    (pose.x, pose.y)
}

/// The farthest it is from the straight line within some seconds.
fn farthest(bench: &mut Bench, seconds: u32) -> f64 {
    let places = (0..seconds * 10).map(|_| place(bench, 0.1).1.abs());
    places.fold(0.0, f64::max)
}

#[test]
fn two_ways_are_asked_for_and_the_one_that_is_granted_is_driven() {
    for (which, aside) in [(0, 0.0), (1, 0.5)] {
        let mut bench = before_zones(&["r"], &[]);
        bench.order(order("o1", 0, 0, "n1 n2"));
        assert_eq!(statuses(&bench), ["r REQUESTED", "r REQUESTED"]);
        let asked = requests(&bench);
        assert_eq!(asked[0]["requestType"], "REPLANNING");
        assert_ne!(asked[0]["trajectory"], asked[1]["trajectory"]);
        assert!(place(&mut bench, 5.0).0 < 0.1, "it waits outside");
        answer(&mut bench, which, "GRANTED");
        assert_eq!(statuses(&bench), ["r GRANTED"]);
        assert_eq!(requests(&bench)[0], {
            let mut granted = asked[which].clone();
            granted["requestStatus"] = json!("GRANTED");
            granted
        });
        assert!((farthest(&mut bench, 6) - aside).abs() < 0.05, "way {which}");
        assert_eq!(bench.state()["lastNodeId"], "n2");
        assert_eq!(statuses(&bench), ["r GRANTED"], "it is inside");
    }
}

#[test]
fn the_way_leads_as_far_as_the_base_and_its_requests_are_gone_behind_the_zone() {
    let mut bench = before_zones(&["r"], &[]);
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    assert_eq!(statuses(&bench), ["r REQUESTED"]);
    answer(&mut bench, 0, "GRANTED");
    bench.wait(10.0);
    assert_eq!(
        (bench.state()["lastNodeId"].clone(), requests(&bench).len()),
        (json!("n3"), 0)
    );
}

#[test]
fn a_base_that_grows_inside_leads_on_by_another_way() {
    let mut bench = before_zones(&["r"], &[]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    answer(&mut bench, 0, "GRANTED");
    bench.wait(5.0);
    bench.order(order("o2", 0, 0, "n2 n3"));
    assert_eq!(statuses(&bench)[..2], ["r GRANTED", "r REQUESTED"]);
    assert!((place(&mut bench, 3.0).0 - 3.0).abs() < 0.1);
    answer(&mut bench, 1, "GRANTED");
    assert_eq!(statuses(&bench), ["r GRANTED"]);
    bench.wait(5.0);
    assert_eq!(
        (bench.state()["lastNodeId"].clone(), requests(&bench).len()),
        (json!("n3"), 0)
    );
}

#[test]
fn what_an_edge_prescribes_is_what_is_asked_for() {
    let line =
        json!({ "degree": 1, "knotVector": [0, 0, 1, 1], "controlPoints": [{ "x": 0, "y": 0 }, { "x": 3, "y": 0 }] });
    let mut bench = before_zones(&["r"], &[]);
    bench.order(with(order("o1", 0, 0, "n1 n2"), "/edges/0/trajectory", line.clone()));
    let asked = requests(&bench);
    assert_eq!((asked.len(), &asked[0]["trajectory"]), (1, &line));
    answer(&mut bench, 0, "GRANTED");
    bench.wait(5.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn where_zones_overlap_the_way_is_granted_for_each_of_them() {
    let mut bench = before_zones(&["r", "s"], &[]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    assert_eq!(statuses(&bench).len(), 4);
    answer(&mut bench, 0, "GRANTED");
    assert_eq!(statuses(&bench), ["r GRANTED", "s REQUESTED", "s REQUESTED"]);
    assert!(place(&mut bench, 5.0).0 < 0.1);
    answer(&mut bench, 1, "GRANTED");
    bench.wait(5.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn a_grant_that_is_lost_inside_stops_it_until_another_way_is_granted() {
    let mut bench = before_zones(&["r"], &[]);
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    answer(&mut bench, 0, "GRANTED");
    while place(&mut bench, 0.1).0 < 1.5 {}
    answer(&mut bench, 0, "REVOKED");
    let (stopped, _) = place(&mut bench, 0.0);
    assert_eq!(
        (statuses(&bench), bench.error_types()),
        (vec!["r REVOKED".to_owned()], vec!["lost".to_owned()])
    );
    assert!((place(&mut bench, 3.0).0 - stopped).abs() < 0.1);
    assert_eq!(statuses(&bench)[..2], ["r REVOKED", "r REQUESTED"]);
    answer(&mut bench, 1, "GRANTED");
    assert_eq!(
        (statuses(&bench), bench.error_types().len()),
        (vec!["r GRANTED".to_owned()], 0)
    );
    bench.wait(8.0);
    assert_eq!(
        (bench.state()["lastNodeId"].clone(), requests(&bench).len()),
        (json!("n3"), 0)
    );
}

#[test]
fn what_is_taken_back_before_it_went_in_is_asked_for_anew() {
    let mut bench = before_zones(&["r"], &[]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    bench.instant("startPause", "pause", json!({}));
    answer(&mut bench, 0, "GRANTED");
    answer(&mut bench, 0, "REVOKED");
    assert!(requests(&bench).is_empty() && bench.error_types().is_empty());
    bench.instant("stopPause", "go", json!({}));
    assert!(place(&mut bench, 3.0).0 < 0.1);
    assert_eq!(statuses(&bench), ["r REQUESTED", "r REQUESTED"]);
}

#[test]
fn what_stands_in_the_way_inside_is_driven_round_once_that_is_granted() {
    let mut bench = before_zones(&["r"], &[]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    answer(&mut bench, 0, "GRANTED");
    while place(&mut bench, 0.1).0 < 1.2 {}
    bench.command("place-obstacle", json!({ "edgeId": "n1-n2" }));
    assert_eq!(statuses(&bench), ["r GRANTED", "r REQUESTED"]);
    assert!(farthest(&mut bench, 3) < 0.01);
    answer(&mut bench, 1, "GRANTED");
    assert_eq!(statuses(&bench), ["r GRANTED"]);
    assert!(farthest(&mut bench, 5) > 0.3);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}
