//! RELEASE zones: what is asked for, granted, lost and given back.

use super::super::ZONE_TYPES;
use super::*;

/// A vehicle with a RELEASE zone from 1.5 to 4 m along its way, in force.
fn before_a_zone(loss: Option<&str>, faults: &[&str]) -> Bench {
    let mut config = config();
    let further = ["zones", "instantActionStates", "strictUpdates", "modesClear"];
    config.features.extend(further.map(str::to_owned));
    config.zone_types = ZONE_TYPES.map(str::to_owned).into();
    config.errors.release_lost = "lost".into();
    config.errors.release_loss = "leaves".into();
    let topic = "uagv/v7/Reference/agv-1/responses".to_owned();
    config.topics.insert("responses".to_owned(), topic);
    let mut bench = Bench::with(config, faults);
    let corner = |x: f64, y: f64| json!({ "x": x, "y": y });
    let mut zone = json!({
        "zoneId": "r", "zoneType": "RELEASE",
        "vertices": [corner(1.5, -1.0), corner(4.0, -1.0), corner(4.0, 1.0), corner(1.5, 1.0)],
    });
    if let Some(loss) = loss {
        zone["releaseLossBehavior"] = json!(loss);
    }
    let set = json!({ "zoneSet": { "mapId": "hall", "zoneSetId": "set", "zones": [zone] } });
    bench.send("zoneSet", set);
    bench.instant("enableZoneSet", "enable", json!({ "zoneSetId": "set" }));
    bench
}

/// Requests of the state: id and status.
fn requests(bench: &Bench) -> Vec<(String, String)> {
    let state = bench.state();
    let all = state["zoneRequests"].as_array().unwrap().iter();
    let text = |one: &Value, key: &str| one[key].as_str().unwrap().to_owned();
    all.map(|one| (text(one, "requestId"), text(one, "requestStatus")))
        .collect()
}

fn statuses(bench: &Bench) -> Vec<String> {
    requests(bench).into_iter().map(|(_, status)| status).collect()
}

/// Answers the last request.
fn answer(bench: &mut Bench, kind: &str) {
    let id = requests(bench).last().unwrap().0.clone();
    let answers = json!({ "responses": [{ "requestId": id, "grantType": kind }] });
    bench.send_raw("responses", answers.to_string().into_bytes());
}

fn x(bench: &mut Bench, seconds: f64) -> f64 {
    bench.wait(seconds);
    bench.agv.motion.pose(bench.now.moment).x
}

/// A vehicle that is inside, on n2, and may go on to n3.
fn inside(loss: Option<&str>, faults: &[&str]) -> Bench {
    let mut bench = before_a_zone(loss, faults);
    bench.order(order("o1", 0, 0, "n1 n2"));
    answer(&mut bench, "GRANTED");
    bench.wait(5.0);
    assert_eq!(
        (bench.state()["lastNodeId"].clone(), statuses(&bench)),
        (json!("n2"), vec!["GRANTED".to_owned()])
    );
    bench
}

#[test]
fn a_zone_is_asked_for_waited_for_gone_into_and_given_back() {
    let mut bench = before_a_zone(Some("STOP"), &[]);
    bench.order(order("o1", 0, 0, "n1 n2 n3"));
    assert_eq!(
        bench.state()["zoneRequests"][0],
        json!({
            "requestId": "request-1", "requestType": "ACCESS", "zoneId": "r", "zoneSetId": "set",
            "requestStatus": "REQUESTED",
        })
    );
    let waits = x(&mut bench, 5.0);
    assert!(waits < 1.0 && waits > 0.5, "{waits}");
    answer(&mut bench, "QUEUED");
    assert_eq!(statuses(&bench), ["QUEUED"]);
    assert!((x(&mut bench, 2.0) - waits).abs() < 1e-9);
    answer(&mut bench, "GRANTED");
    assert_eq!(statuses(&bench), ["GRANTED"]);
    bench.wait(10.0);
    assert!(requests(&bench).is_empty());
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn what_was_refused_or_taken_back_before_it_went_in_is_asked_for_anew() {
    let mut bench = before_a_zone(Some("STOP"), &[]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    answer(&mut bench, "REJECTED");
    assert!(requests(&bench).is_empty());
    bench.wait(1.0);
    assert_eq!(requests(&bench), [("request-2".to_owned(), "REQUESTED".to_owned())]);
    bench.instant("startPause", "pause", json!({}));
    answer(&mut bench, "GRANTED");
    answer(&mut bench, "REVOKED");
    assert!(requests(&bench).is_empty());
    bench.instant("stopPause", "go", json!({}));
    assert!(x(&mut bench, 5.0) < 1.0);
    assert_eq!(requests(&bench), [("request-3".to_owned(), "REQUESTED".to_owned())]);
}

#[test]
fn a_release_that_is_lost_inside_stops_it_until_it_is_granted_again() {
    for loss in [Some("STOP"), None] {
        let mut bench = inside(loss, &[]);
        answer(&mut bench, "REVOKED");
        assert_eq!(
            (statuses(&bench), bench.error_types()),
            (vec!["REVOKED".to_owned()], vec!["lost".to_owned()])
        );
        bench.order(order("o2", 0, 0, "n2 n3"));
        assert!((x(&mut bench, 3.0) - 3.0).abs() < 0.1, "it stays");
        assert_eq!(statuses(&bench), ["REVOKED", "REQUESTED"]);
        answer(&mut bench, "GRANTED");
        assert_eq!(
            (statuses(&bench), bench.error_types().len()),
            (vec!["GRANTED".to_owned()], 0)
        );
        bench.wait(5.0);
        assert_eq!(
            (bench.state()["lastNodeId"].clone(), requests(&bench).len()),
            (json!("n3"), 0)
        );
    }
}

#[test]
fn a_release_that_is_lost_inside_lets_it_go_on_where_the_zone_says_so() {
    for loss in ["CONTINUE", "EVACUATE"] {
        let mut bench = inside(Some(loss), &[]);
        answer(&mut bench, "REVOKED");
        bench.wait(2.0);
        assert_eq!(
            (statuses(&bench), bench.error_types()),
            (vec!["REVOKED".to_owned()], vec!["leaves".to_owned()])
        );
        bench.order(order("o2", 0, 0, "n2 n3"));
        bench.wait(5.0);
        assert_eq!(bench.state()["lastNodeId"], "n3");
        assert!(requests(&bench).is_empty() && bench.error_types().is_empty());
    }
}

#[test]
fn without_fleet_control_there_are_no_requests_and_afterwards_it_asks_before_it_drives() {
    let mut bench = inside(Some("STOP"), &[]);
    bench.command("set-mode", json!({ "mode": "INTERVENED" }));
    assert!(requests(&bench).is_empty());
    bench.command("set-mode", json!({ "mode": "AUTOMATIC" }));
    bench.order(order("o2", 0, 0, "n2 n3"));
    assert!((x(&mut bench, 3.0) - 3.0).abs() < 0.1);
    assert_eq!(statuses(&bench), ["REQUESTED"]);
    answer(&mut bench, "GRANTED");
    bench.wait(5.0);
    assert_eq!(bench.state()["lastNodeId"], "n3");
}

#[test]
fn with_its_order_its_requests_are_gone() {
    let mut bench = before_a_zone(Some("STOP"), &[]);
    bench.order(order("o1", 0, 0, "n1 n2"));
    assert_eq!(requests(&bench).len(), 1);
    bench.instant("cancelOrder", "cancel", json!({}));
    bench.wait(1.0);
    assert!(requests(&bench).is_empty());
}
