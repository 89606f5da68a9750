//! Who speaks on a broker, and a profile from that; nothing is sent.

use crate::bench::{Bench, MANUFACTURER, SERIAL};
use crate::mosquitto::Mosquitto;
use crate::simulating::retained;
use crate::tool::run;

#[test]
fn a_vehicle_is_found_and_its_profile_leads_to_a_plan() {
    let bench = Bench::new();
    let Some(mosquitto) = Mosquitto::start() else { return };
    let _device = bench.agv(mosquitto.port, &[]);
    retained(mosquitto.port, "ONLINE");
    let broker = format!("mqtt://127.0.0.1:{}", mosquitto.port);
    let listen = ["--broker", &broker, "--seconds", "2"];
    let found = bench
        .run(&[&["discover", "--format", "json"], &listen[..]].concat())
        .code(0);
    let found: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    let device = &found["devices"][0];
    assert_eq!(device["manufacturer"], MANUFACTURER);
    assert_eq!(device["serialNumber"], SERIAL);
    assert!(device["messages"]["connection"].as_u64().unwrap() > 0, "{found}");
    let topics = device["messageCoverage"]["topics"].as_array().unwrap();
    let connection = topics.iter().find(|topic| topic["topic"] == "connection").unwrap();
    assert!(connection["shown"].as_u64().unwrap() > 0, "{connection}");
    bench
        .run(&[&["init", "--serial", SERIAL], &listen[..]].concat())
        .code(0)
        .prints("device.toml is written");
    bench.run(&["validate", "device.toml"]).code(0).prints("valid profile");
    bench
        .run(&["run", "--profile", "device.toml", "--plan"])
        .code(0)
        .prints("[motion] allowed = true");
}

#[test]
fn nobody_and_no_broker_are_told_apart() {
    run(&["discover", "--broker", "mqtt://127.0.0.1:1", "--seconds", "2"])
        .code(5)
        .says("cannot listen on");
    run(&["init", "--broker", "ftp://x", "--seconds", "1"]).code(2);
    let bench = Bench::new();
    std::fs::write(bench.path().join("device.toml"), "mine").unwrap();
    bench.run(&["init", "--seconds", "1"]).code(2).says("is there already");
    let kept = std::fs::read_to_string(bench.path().join("device.toml")).unwrap();
    assert_eq!(kept, "mine");
}

#[test]
fn completions_and_manual_pages_come_from_the_command_line() {
    run(&["completions", "bash"]).code(0).prints("--fail-fast");
    run(&["man"]).code(0).prints(".TH vda5050-tck");
    let bench = Bench::new();
    bench.run(&["man", "--dir", "man"]).code(0);
    let page = std::fs::read_to_string(bench.path().join("man/vda5050-tck-run.1")).unwrap();
    assert!(page.contains("virtual"), "{page}");
    assert!(bench.path().join("man/vda5050-tck-simulate-agv.1").exists());
}
