//! `simulate agv` at a broker of somebody else.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::bench::{Bench, MANUFACTURER, SERIAL};
use crate::mosquitto::{Mosquitto, free_port};
use crate::scripted::topic;
use crate::tool::{Running, run, tool};

/// What a topic says to somebody who comes late, until it is as wanted.
fn retained(port: u16, wanted: &str) -> Value {
    let last = Arc::new(Mutex::new(Value::Null));
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(20) {
        let mut options = rumqttc::MqttOptions::new("late", "127.0.0.1", port);
        options.set_keep_alive(Duration::from_secs(5));
        let (client, mut connection) = rumqttc::Client::new(options, 10);
        client
            .subscribe(topic("connection"), rumqttc::QoS::AtLeastOnce)
            .unwrap();
        while let Ok(Ok(event)) = connection.recv_timeout(Duration::from_millis(200)) {
            if let rumqttc::Event::Incoming(rumqttc::Packet::Publish(message)) = event {
                let value: Value = serde_json::from_slice(&message.payload).unwrap();
                *last.lock().unwrap() = value.clone();
                if message.retain && value["connectionState"] == wanted {
                    return value;
                }
            }
        }
    }
    panic!("{wanted} is not retained; last was {}", last.lock().unwrap());
}

#[test]
fn it_is_online_until_it_is_interrupted_and_offline_afterwards() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let mut agv = bench.agv(mosquitto.port, &[]);
    agv.line("1 reference AGV(s) on ");
    let online = retained(mosquitto.port, "ONLINE");
    assert_eq!(
        (&online["manufacturer"], &online["serialNumber"]),
        (&MANUFACTURER.into(), &SERIAL.into())
    );
    agv.interrupt();
    agv.end().code(0);
    retained(mosquitto.port, "OFFLINE");
}

#[test]
fn killed_it_leaves_its_last_will() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let mut agv = bench.agv(mosquitto.port, &[]);
    retained(mosquitto.port, "ONLINE");
    agv.kill();
    retained(mosquitto.port, "CONNECTIONBROKEN");
}

#[test]
fn a_fleet_has_numbers() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let url = mosquitto.url();
    // The device of `topic` is the second of three.
    let (base, number) = ("fleet", 2);
    let arguments = [
        "simulate",
        "agv",
        "--count",
        "3",
        "--broker",
        &url,
        "--manufacturer",
        MANUFACTURER,
        "--serial",
        base,
    ];
    let agvs = Running::start(&mut tool(bench.path(), &arguments));
    let mut options = rumqttc::MqttOptions::new("late", "127.0.0.1", mosquitto.port);
    options.set_keep_alive(Duration::from_secs(5));
    let (client, mut connection) = rumqttc::Client::new(options, 10);
    client
        .subscribe(
            topic("connection").replace(SERIAL, &format!("{base}-{number}")),
            rumqttc::QoS::AtLeastOnce,
        )
        .unwrap();
    let begun = Instant::now();
    loop {
        assert!(
            begun.elapsed() < Duration::from_secs(20),
            "the second of three does not come"
        );
        if let Ok(Ok(rumqttc::Event::Incoming(rumqttc::Packet::Publish(_)))) =
            connection.recv_timeout(Duration::from_millis(200))
        {
            break;
        }
    }
    agvs.interrupt();
    agvs.end().code(0);
}

#[test]
fn nobody_there_is_5_at_once() {
    let url = format!("mqtt://127.0.0.1:{}", free_port());
    run(&["simulate", "agv", "--broker", &url])
        .code(5)
        .says_one_error("not reachable");
    run(&["simulate", "agv", "--broker", "http://127.0.0.1"])
        .code(2)
        .says("mqtt://host:port");
}
