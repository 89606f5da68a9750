//! `--like`: no verdict changes by it, the report names the counterpart, and a simulated one has its habits on the wire.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::bench::Bench;
use crate::mosquitto::Mosquitto;
use crate::scripted::topic;
use crate::simulating::judged;
use crate::tool::run;

/// The names of the counterparts of a role.
fn names(role: &str) -> Vec<String> {
    let listed = run(&["list", "counterparts", "--role", role, "--format", "json"]).code(0);
    let all = listed.stdout.lines();
    all.map(|line| {
        let one: Value = serde_json::from_str(line).unwrap();
        assert_eq!(one["role"], role);
        one["name"].as_str().unwrap().to_owned()
    })
    .collect()
}

/// What a run of these tests finds, by requirement; and the bench with its report.
fn found(role: &str, tests: &[&str], like: Option<&str>) -> (Value, Bench) {
    let bench = Bench::new();
    let mut arguments = vec!["run", "--virtual", "--seed", "1", "--role", role];
    arguments.extend(like.into_iter().flat_map(|name| ["--like", name]));
    arguments.extend(tests);
    bench.run(&arguments).code(0);
    let result = bench.result();
    let verdicts: Vec<Value> = result["requirements"]
        .as_array()
        .unwrap()
        .iter()
        .map(|requirement| json!([requirement["id"], requirement["verdict"]]))
        .collect();
    (Value::Array(verdicts), bench)
}

/// The reference device of a role fares with every counterpart as without one.
fn fares_the_same(tested: &str, other_side: &str, tests: &[&str]) {
    let (usual, _) = found(tested, tests, None);
    let all = names(other_side);
    assert!(all.len() > 2, "{all:?}");
    for name in all {
        let (verdicts, bench) = found(tested, tests, Some(&name));
        assert_eq!(verdicts, usual, "{name}");
        let result = bench.result();
        let settings = result["settings"].as_array().unwrap();
        let setting = settings.iter().find(|one| one["name"] == "counterpart").unwrap();
        // One of which a run takes nothing says so.
        let value = setting["value"].as_str().unwrap();
        assert!(value == name || value == format!("{name} (no effect)"), "{setting}");
        assert_eq!(setting["origin"], "flag");
        let limit = format!("(counterpart {name})");
        let limits = result["limits"].as_array().unwrap().iter().filter_map(Value::as_str);
        assert_eq!(limits.filter(|text| text.contains(&limit)).count(), 1, "{name}");
        let read = |file: &str| std::fs::read_to_string(bench.bundle().join(file)).unwrap();
        assert!(read("report.html").contains(&limit), "{name}");
        let property = format!("<property name=\"counterpart\" value=\"{value}\"/>");
        assert!(read("junit.xml").contains(&property), "{name}");
    }
}

#[test]
fn a_vehicle_fares_the_same_with_every_master_control() {
    let tests = ["order-rejection/*", "instant-actions/*", "order-update/*"];
    fares_the_same("agv", "master-control", &tests);
}

#[test]
fn a_master_control_fares_the_same_with_every_vehicle() {
    let tests = ["dispatch/*", "connection/*", "instant-actions/*"];
    fares_the_same("master-control", "agv", &tests);
}

#[test]
fn the_harness_words_its_messages_like_a_master_control() {
    let (_, bench) = found("agv", &["instant-actions/factsheet-request"], Some("opentcs-0.34"));
    let journal = bench.journal();
    let mut own = journal.lines().filter(|line| line.contains("actionType"));
    assert!(own.any(|line| line.contains(r"\n  \")), "nothing is indented");
}

#[test]
fn one_that_is_not_known_or_of_the_wrong_side_is_refused() {
    run(&["run", "--virtual", "--like", "opentcs-0.35"])
        .code(2)
        .says("there is no counterpart `opentcs-0.35`")
        .says("did you mean `opentcs-0.3");
    run(&["run", "--virtual", "--like", "inorbit-connector"])
        .code(2)
        .says("is of role agv, and master-control is meant here");
    run(&["simulate", "agv", "--like", "opentcs-0.34"])
        .code(2)
        .says("list counterparts");
}

#[test]
fn a_simulated_vehicle_has_the_habits_of_its_counterpart() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let agv = bench.agv_with(
        mosquitto.port,
        &["--like", "isaac-ros-client", "--state-interval", "0.2"],
    );
    let mut options = rumqttc::MqttOptions::new("listener", "127.0.0.1", mosquitto.port);
    options.set_max_packet_size(1 << 20, 1 << 20);
    let (client, mut connection) = rumqttc::Client::new(options, 10);
    client.subscribe(topic("state"), rumqttc::QoS::AtMostOnce).unwrap();
    let mut states = Vec::new();
    let begun = Instant::now();
    while states.len() < 3 {
        assert!(begun.elapsed() < Duration::from_secs(30), "no states come");
        let next = connection.recv_timeout(Duration::from_millis(500));
        if let Ok(Ok(rumqttc::Event::Incoming(rumqttc::Packet::Publish(message)))) = next {
            states.push(serde_json::from_slice::<Value>(&message.payload).unwrap());
        }
    }
    for state in &states {
        assert_eq!(state["headerId"], states[0]["headerId"]);
        assert_eq!(state["version"], "2.0.0");
        let timestamp = state["timestamp"].as_str().unwrap();
        assert_eq!(timestamp.len(), "2026-11-27T09:16:24Z".len(), "{timestamp}");
    }
    agv.interrupt();
    agv.end().code(0);
}

#[test]
fn a_simulated_master_control_has_the_habits_of_its_counterpart() {
    let like = r#""--like", "opentcs-0.34", "--protocol", "2.1.0""#;
    let (bench, ended) = judged(like, &["dispatch/one-edge"]);
    ended.code(0);
    let result = bench.result();
    let mut requirements = result["requirements"].as_array().unwrap().iter();
    let time = requirements.find(|requirement| requirement["id"] == "HDR-03").unwrap();
    assert_eq!(time["verdict"], "warning", "nine digits are more than two");
}
