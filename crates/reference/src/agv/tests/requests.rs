//! Corridors that have to be released: what is asked for, answered, lost and given back.

use super::curves::free;
use super::*;

fn asking() -> AgvConfig {
    let mut config = free();
    config.features.insert("corridorRelease".to_owned());
    let topic = "uagv/v7/Reference/agv-1/responses".to_owned();
    config.topics.insert("responses".to_owned(), topic);
    config
}

/// A vehicle with something before it, and an order over a corridor that has to be released.
fn before_an_obstacle(loss: Option<&str>, faults: &[&str]) -> Bench {
    let mut bench = Bench::with(asking(), faults);
    bench.command("place-obstacle", json!({ "edgeId": "n1-n2" }));
    let line =
        json!({ "degree": 1, "knotVector": [0, 0, 1, 1], "controlPoints": [{ "x": 0, "y": 0 }, { "x": 3, "y": 0 }] });
    let mut corridor = json!({ "leftWidth": 1.0, "rightWidth": 0.5, "releaseRequired": true });
    if let Some(loss) = loss {
        corridor["releaseLossBehavior"] = json!(loss);
    }
    let order = with(order("o1", 0, 0, "n1 n2"), "/edges/0/trajectory", line);
    bench.order(with(order, "/edges/0/corridor", corridor));
    bench
}

fn answer(bench: &mut Bench, answers: Value) {
    bench.send_raw("responses", json!({ "responses": answers }).to_string().into_bytes());
}

fn grant(bench: &mut Bench, kind: &str) {
    let id = requests(bench)[0].0.clone();
    answer(bench, json!([{ "requestId": id, "grantType": kind }]));
}

fn requests(bench: &Bench) -> Vec<(String, String)> {
    let state = bench.state();
    let all = state["edgeRequests"].as_array().unwrap().iter();
    let text = |one: &Value, key: &str| one[key].as_str().unwrap().to_owned();
    all.map(|one| (text(one, "requestId"), text(one, "requestStatus")))
        .collect()
}

fn status(bench: &Bench) -> Vec<String> {
    requests(bench).into_iter().map(|(_, status)| status).collect()
}

fn place(bench: &mut Bench, seconds: f64) -> (f64, f64) {
    bench.wait(seconds);
    let id = format!("look-{}", bench.header_id);
    bench.instant("stateRequest", &id, json!({}));
    let state = bench.state();
    let member = |name: &str| state["agvPosition"][name].as_f64().unwrap();
    (member("x"), member("y"))
}

#[test]
fn a_corridor_is_asked_for_waited_for_used_and_given_back() {
    let mut bench = before_an_obstacle(None, &[]);
    let asked = bench.state()["edgeRequests"][0].clone();
    assert_eq!(
        asked,
        json!({
            "requestId": "request-1", "requestType": "CORRIDOR", "edgeId": "n1-n2", "sequenceId": 1,
            "requestStatus": "REQUESTED",
        })
    );
    assert_eq!(place(&mut bench, 5.0), (0.0, 0.0));
    grant(&mut bench, "QUEUED");
    assert_eq!(status(&bench), ["QUEUED"]);
    grant(&mut bench, "GRANTED");
    assert_eq!(status(&bench), ["GRANTED"]);
    let (_, y) = place(&mut bench, 0.8);
    assert!(y > 0.5, "{y}");
    bench.wait(10.0);
    assert!(requests(&bench).is_empty());
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn a_rejected_request_goes_and_the_next_has_another_id() {
    let mut bench = before_an_obstacle(None, &[]);
    grant(&mut bench, "REJECTED");
    assert!(requests(&bench).is_empty());
    bench.wait(1.0);
    assert_eq!(requests(&bench), [("request-2".to_owned(), "REQUESTED".to_owned())]);
    bench.instant("cancelOrder", "c", json!({}));
    bench.wait(1.0);
    assert!(requests(&bench).is_empty());
}

#[test]
fn a_lost_release_stops_the_vehicle_or_sends_it_back() {
    for loss in [None, Some("STOP")] {
        let mut bench = before_an_obstacle(loss, &[]);
        grant(&mut bench, "GRANTED");
        let (x, y) = place(&mut bench, 0.8);
        grant(&mut bench, "REVOKED");
        assert_eq!(status(&bench), ["REVOKED"]);
        grant(&mut bench, "GRANTED");
        assert_eq!(status(&bench), ["REVOKED"], "what was lost does not come back");
        let (x2, y2) = place(&mut bench, 5.0);
        assert!((x - x2).hypot(y - y2) < 1e-9);
        bench.instant("cancelOrder", "c", json!({}));
        bench.wait(1.0);
        assert!(requests(&bench).is_empty());
        assert!(!bench.agv.holds.any());
    }
    let mut bench = before_an_obstacle(Some("RETURN"), &[]);
    grant(&mut bench, "GRANTED");
    place(&mut bench, 0.8);
    grant(&mut bench, "REVOKED");
    assert_eq!(status(&bench), ["REVOKED"]);
    let (x, y) = place(&mut bench, 10.0);
    assert!(x.hypot(y) < 0.03, "{x} {y}");
    assert_eq!(requests(&bench), [("request-2".to_owned(), "REQUESTED".to_owned())]);
    assert_eq!(bench.state()["lastNodeId"], "n1");
}

#[test]
fn a_lease_ends_when_it_says_unless_it_is_prolonged() {
    let mut bench = before_an_obstacle(None, &[]);
    bench.command("press-pause", json!({}));
    let until = |bench: &Bench, seconds: i64| (bench.now.utc + jiff::SignedDuration::from_secs(seconds)).to_string();
    let lease = |bench: &mut Bench, seconds: i64| {
        let (id, _) = requests(bench)[0].clone();
        let end = until(bench, seconds);
        answer(
            bench,
            json!([{ "requestId": id, "grantType": "GRANTED", "leaseExpiry": end }]),
        );
    };
    lease(&mut bench, 2);
    bench.wait(1.5);
    lease(&mut bench, 3);
    bench.wait(2.0);
    assert_eq!(requests(&bench), [("request-1".to_owned(), "GRANTED".to_owned())]);
    bench.wait(2.0);
    assert_eq!(requests(&bench), [("request-2".to_owned(), "REQUESTED".to_owned())]);
    bench.command("release-pause", json!({}));
    assert_eq!(place(&mut bench, 3.0), (0.0, 0.0));
    lease(&mut bench, -5);
    bench.wait(0.1);
    assert_ne!(status(&bench), ["GRANTED"], "a lease that is over grants nothing");
}

#[test]
fn an_obstacle_that_goes_and_one_that_comes_on_the_way() {
    let mut bench = before_an_obstacle(None, &[]);
    grant(&mut bench, "GRANTED");
    place(&mut bench, 0.6);
    bench.command("remove-obstacle", json!({ "edgeId": "n1-n2" }));
    for _ in 0..20 {
        if requests(&bench).is_empty() {
            break;
        }
        bench.wait(0.1);
    }
    assert!(requests(&bench).is_empty());
    bench.command("place-obstacle", json!({ "edgeId": "n1-n2" }));
    bench.wait(1.0);
    let (_, y) = place(&mut bench, 1.0);
    assert!(y.abs() < 0.05, "{y}");
    assert_eq!(requests(&bench), [("request-2".to_owned(), "REQUESTED".to_owned())]);
    grant(&mut bench, "GRANTED");
    bench.wait(10.0);
    assert_eq!(bench.state()["lastNodeId"], "n2");
}

#[test]
fn what_cannot_be_read_grants_nothing() {
    let mut bench = before_an_obstacle(None, &[]);
    for bad in [
        json!({ "requestId": "request-1" }),
        json!({ "requestId": "request-1", "grantType": "granted" }),
        json!({ "requestId": 1, "grantType": "GRANTED" }),
        json!({ "requestId": "request-7", "grantType": "GRANTED" }),
        json!({ "requestId": "request-1", "grantType": "GRANTED", "leaseExpiry": "soon" }),
        json!("request-1"),
    ] {
        answer(&mut bench, json!([bad]));
    }
    for raw in ["", "[]", "{\"responses\":{}}", "{\"responses\":[[[[[["] {
        bench.send_raw("responses", raw.as_bytes().to_vec());
    }
    assert_eq!(requests(&bench), [("request-1".to_owned(), "REQUESTED".to_owned())]);
    bench.command("power-cycle", json!({}));
    bench.give(Input::Connected);
    assert!(requests(&bench).is_empty());
}

#[test]
fn a_version_without_requests_leaves_their_members_aside() {
    let mut bench = Bench::with(free(), &[]);
    let line =
        json!({ "degree": 1, "knotVector": [0, 0, 1, 1], "controlPoints": [{ "x": 0, "y": 0 }, { "x": 3, "y": 0 }] });
    let corridor = json!({ "leftWidth": 1.0, "rightWidth": 0.5, "releaseRequired": "yes" });
    let order = with(order("o1", 0, 0, "n1 n2"), "/edges/0/trajectory", line);
    bench.order(with(order, "/edges/0/corridor", corridor));
    assert!(bench.error_types().is_empty());
    assert!(bench.state().get("edgeRequests").is_none());
}
