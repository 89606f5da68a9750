//! `simulate`: vehicles at a broker of somebody else, and a master control that is tested like a foreign one.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::bench::{Bench, MANUFACTURER, SERIAL};
use crate::certificates;
use crate::https::Server;
use crate::mosquitto::{Mosquitto, free_port};
use crate::scripted::topic;
use crate::tool::{Ended, Running, run, tool};

/// What a topic says to somebody who comes late, until it is as wanted.
pub fn retained(port: u16, wanted: &str) -> Value {
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
    agv.line("1 simulated AGV(s) on ");
    let online = retained(mosquitto.port, "ONLINE");
    assert_eq!(
        (&online["manufacturer"], &online["serialNumber"]),
        (&MANUFACTURER.into(), &SERIAL.into())
    );
    agv.interrupt();
    agv.end().code(0);
    retained(mosquitto.port, "OFFLINE");
}

/// How an action that is sent to the vehicle ends.
fn end_of_action(port: u16, action: &Value) -> Value {
    let mut options = rumqttc::MqttOptions::new("commander", "127.0.0.1", port);
    options.set_max_packet_size(1 << 20, 1 << 20);
    let (client, mut connection) = rumqttc::Client::new(options, 10);
    client.subscribe(topic("state"), rumqttc::QoS::AtMostOnce).unwrap();
    let message = json!({
        "headerId": 1, "timestamp": "2026-01-01T08:00:00.00Z", "version": "2.1.0",
        "manufacturer": MANUFACTURER, "serialNumber": SERIAL, "actions": [action],
    });
    let message = message.to_string();
    client
        .publish(topic("instantActions"), rumqttc::QoS::AtMostOnce, false, message)
        .unwrap();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(30) {
        let Ok(Ok(event)) = connection.recv_timeout(Duration::from_secs(1)) else {
            continue;
        };
        let rumqttc::Event::Incoming(rumqttc::Packet::Publish(message)) = event else {
            continue;
        };
        let state: Value = serde_json::from_slice(&message.payload).unwrap();
        let mut actions = state["actionStates"].as_array().unwrap().iter();
        let shown = actions.find(|shown| shown["actionId"] == action["actionId"]);
        if let Some(shown) =
            shown.filter(|shown| shown["actionStatus"] == "FINISHED" || shown["actionStatus"] == "FAILED")
        {
            return json!([shown["actionStatus"], state["maps"]]);
        }
    }
    panic!("the action does not end");
}

#[test]
fn maps_are_fetched_over_https_where_the_given_authority_vouches_for_the_server() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    certificates::make(bench.path());
    let server = Server::start(bench.path());
    for (more, status) in [(&["--tls-ca", "ca.crt"][..], "FINISHED"), (&[], "FAILED")] {
        let mut agv = bench.agv_with(mosquitto.port, more);
        agv.line("1 simulated AGV(s) on ");
        let parameter = |key: &str, value: &str| json!({ "key": key, "value": value });
        let ended = end_of_action(
            mosquitto.port,
            &json!({
                "actionType": "downloadMap", "actionId": format!("fetch-{status}"), "blockingType": "NONE",
                "actionParameters": [
                    parameter("mapId", "hall"), parameter("mapVersion", "7"),
                    parameter("mapDownloadLink", &server.url("200/hall.map")),
                ],
            }),
        );
        assert_eq!(ended[0], status);
        let maps = ended[1].as_array().unwrap();
        assert_eq!(
            maps.iter().any(|map| map["mapId"] == "hall"),
            status == "FINISHED",
            "{maps:?}"
        );
        agv.interrupt();
        agv.end().code(0);
    }
    let asked = server.asked.lock().unwrap();
    assert_eq!(asked.len(), 1, "who is not trusted is not asked: {asked:?}");
    assert!(asked[0].starts_with("GET /200/hall.map "), "{asked:?}");
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

/// A profile of the simulated master control: the harness starts it, and asks it over HTTP.
fn commanded(more: &str) -> String {
    let tool = env!("CARGO_BIN_EXE_vda5050-tck");
    let hooks = [
        ("dispatch", "vehicle from to loadType action"),
        ("cancel", "vehicle"),
        ("request-state", "vehicle"),
    ];
    let hooks = hooks.map(|(name, parameters)| {
        let body: Vec<String> = parameters
            .split(' ')
            .map(|parameter| format!("\"{parameter}\": \"{{{parameter}}}\""))
            .collect();
        let url = format!("http://127.0.0.1:{{free-port}}/hooks/{name}");
        format!(
            "[hooks.{name}]\nhttp = {{ url = \"{url}\", body = '{{ {} }}' }}\n",
            body.join(", ")
        )
    });
    format!(
        r#"
[device]
role = "master-control"
manufacturer = "{MANUFACTURER}"
serial-number = "{SERIAL}"
command = [
  "{tool}", "simulate", "master-control", "--broker", "mqtt://{{broker-host}}:{{broker-port}}",
  "--hooks", "127.0.0.1:{{free-port}}", {more}
]
[bench]
listen = "127.0.0.1:0"
[time]
connect = "20 s"
drive = "20 s"
quiet = "500 ms"
settle = "300 ms"
reconnect = "1 s"
{}"#,
        hooks.concat()
    )
}

/// Runs these tests against the simulated master control.
pub fn judged(more: &str, tests: &[&str]) -> (Bench, Ended) {
    let bench = Bench::new();
    std::fs::write(bench.path().join("device.toml"), commanded(more)).unwrap();
    let ended = bench.run(&[&["run", "--profile", "device.toml"], tests].concat());
    (bench, ended)
}

#[test]
fn a_simulated_master_control_conforms_and_is_commanded_over_http() {
    let tests = [
        "dispatch/one-edge",
        "dispatch/two-in-a-row",
        "dispatch/while-busy",
        "instant-actions/as-asked[state]",
    ];
    let (bench, ended) = judged("", &tests);
    ended.code(0);
    let result = bench.result();
    assert_eq!(result["role"], "master-control");
    for test in result["tests"].as_array().unwrap() {
        assert_eq!(test["verdict"], "pass", "{}", test["id"]);
    }
}

/// The topics of which a broker keeps a message.
fn kept(port: u16) -> Vec<String> {
    let mut options = rumqttc::MqttOptions::new("keeper", "127.0.0.1", port);
    options.set_max_packet_size(1 << 20, 1 << 20);
    let (client, mut connection) = rumqttc::Client::new(options, 10);
    client.subscribe("#", rumqttc::QoS::AtLeastOnce).unwrap();
    let mut topics = Vec::new();
    while let Ok(Ok(event)) = connection.recv_timeout(Duration::from_millis(800)) {
        if let rumqttc::Event::Incoming(rumqttc::Packet::Publish(message)) = event
            && message.retain
        {
            topics.push(message.topic);
        }
    }
    topics.sort();
    topics
}

/// Lets a broker keep something on these topics.
fn keeps(port: u16, topics: &[&str]) {
    let options = rumqttc::MqttOptions::new("filler", "127.0.0.1", port);
    let (client, mut connection) = rumqttc::Client::new(options, 10);
    for topic in topics {
        client.publish(*topic, rumqttc::QoS::AtLeastOnce, true, "{}").unwrap();
    }
    let mut left = topics.len();
    while left > 0 {
        if let rumqttc::Event::Incoming(rumqttc::Packet::PubAck(_)) = connection.recv().unwrap().unwrap() {
            left -= 1;
        }
    }
}

#[test]
fn mock_vehicles_leave_nothing_behind_on_a_broker_of_somebody_else() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let (crashed, foreign) = (
        "uagv/v2/vda5050-tck/mock-7/connection",
        "uagv/v2/ACME/mock-7/connection",
    );
    keeps(mosquitto.port, &[crashed, foreign]);
    let bench = Bench::new();
    let broker = format!("broker = \"{}\"\ntap = false", mosquitto.url());
    let profile = commanded("").replace("listen = \"127.0.0.1:0\"", &broker);
    std::fs::write(bench.path().join("device.toml"), profile).unwrap();
    let run = ["run", "--profile", "device.toml", "dispatch/one-edge"];
    bench
        .run(&[&run[..], &["--plan"]].concat())
        .code(0)
        .prints("uagv/v2/vda5050-tck/mock-1/connection");
    assert_eq!(kept(mosquitto.port), [foreign, crashed], "a plan touches nothing");
    bench
        .run(&run)
        .code(0)
        .says("cleared what an earlier run has left on the broker: uagv/v2/vda5050-tck/mock-7/connection");
    assert_eq!(kept(mosquitto.port), [foreign]);
}

#[test]
fn a_simulated_master_control_with_a_fault_does_not_conform() {
    let (bench, ended) = judged(r#""--fault", "edge-missing""#, &["dispatch/one-edge"]);
    ended.code(1);
    let result = bench.result();
    let broken = result["requirements"].as_array().unwrap().iter();
    let broken: Vec<&Value> = broken.filter(|requirement| requirement["verdict"] == "fail").collect();
    assert!(
        broken.iter().any(|requirement| requirement["id"] == "ORD-02"),
        "{broken:?}"
    );
}

/// What a hook answers: the status line and everything.
fn answer(address: &str, request: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

fn post(address: &str, path: &str, body: &str) -> String {
    let length = body.len();
    let head = format!("POST {path} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n");
    answer(address, &format!("{head}content-length: {length}\r\n\r\n{body}"))
}

#[test]
fn hooks_say_what_there_is_and_what_is_wrong() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let url = mosquitto.url();
    let mut running = Running::start(&mut tool(
        bench.path(),
        &["simulate", "master-control", "--broker", &url],
    ));
    let address = running.line("hooks are served at http://");
    assert!(address.starts_with("127.0.0.1:"), "{address}");
    running.line("a reference master control of 2 vehicle(s) on ");

    let list = answer(
        &address,
        &format!("GET / HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n"),
    );
    assert!(
        list.starts_with("HTTP/1.1 200") && list.contains("POST /hooks/dispatch"),
        "{list}"
    );
    let done = post(
        &address,
        "/hooks/dispatch",
        r#"{"vehicle": "mock-1", "to": "A3", "from": ""}"#,
    );
    assert!(done.starts_with("HTTP/1.1 204"), "{done}");
    assert!(post(&address, "/hooks/cancel", "").starts_with("HTTP/1.1 204"));
    let unknown = post(&address, "/hooks/explode", "{}");
    assert!(
        unknown.starts_with("HTTP/1.1 404") && unknown.contains("POST /hooks/reroute"),
        "{unknown}"
    );
    let wrong = post(&address, "/hooks/dispatch", "[1]");
    assert!(
        wrong.starts_with("HTTP/1.1 400") && wrong.contains("not a JSON object"),
        "{wrong}"
    );

    running.interrupt();
    running.end().code(0);
}

#[test]
fn a_broker_that_says_nothing_is_5() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("mqtt://{}", silent.local_addr().unwrap());
    for what in ["agv", "master-control"] {
        run(&["simulate", what, "--broker", &url])
            .code(5)
            .says_one_error("it does not answer");
    }
}

#[test]
fn a_master_control_that_cannot_be_simulated_is_2() {
    let refused = |arguments: &[&str], why: &str| {
        run(&[&["simulate", "master-control"], arguments].concat())
            .code(2)
            .says(why);
    };
    refused(&["--vehicle", "ACME"], "a vehicle is written like ACME/0001");
    refused(&["--fault", "edges-missing"], "did you mean `edge-missing`?");
    refused(&["--layout", "nowhere.json"], "the layout nowhere.json cannot be read");
}

#[test]
fn an_awkward_vehicle_is_asked_for_by_a_word() {
    let refused = |word: &str, why: &str| {
        run(&["simulate", "agv", "--persona", word]).code(2).says(why);
    };
    refused("ignore-order", "did you mean `ignore-orders`?");
    refused("shutdown={\"when\": 1}", "`shutdown` has no parameters");
    refused("set-battery={\"percent\": 1}", "it has charge, charging");

    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let url = mosquitto.url();
    let arguments = [
        "simulate",
        "agv",
        "--broker",
        &url,
        "--manufacturer",
        MANUFACTURER,
        "--serial",
        SERIAL,
        "--persona",
        "shutdown",
    ];
    let mut agv = Running::start(&mut tool(bench.path(), &arguments));
    agv.line("1 simulated AGV(s) on ");
    agv.interrupt();
    agv.end().code(0);
}

#[test]
fn nobody_there_is_5_at_once() {
    let url = format!("mqtt://127.0.0.1:{}", free_port());
    run(&["simulate", "agv", "--broker", &url])
        .code(5)
        .says_one_error("not reachable");
    run(&["simulate", "master-control", "--broker", &url])
        .code(5)
        .says_one_error("not reachable");
    run(&["simulate", "agv", "--broker", "http://127.0.0.1"])
        .code(2)
        .says("mqtt://host:port");
}
