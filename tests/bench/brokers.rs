//! Brokers other than the embedded one.

use std::process::Stdio;
use std::time::{Duration, Instant};

use tokio::net::TcpStream;

use vda5050_tck::bench::LinkError;
use vda5050_tck::bench::endpoint::Access;
use vda5050_tck::journal::event::{Event, LinkFault};
use vda5050_tck::link::Link;
use vda5050_tck::link::mqtt::{BenchOptions, BrokerChoice, MqttBench};

use crate::rig::*;

struct Mosquitto {
    process: std::process::Child,
    url: String,
    _folder: tempfile::TempDir,
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

async fn mosquitto(extra: &str) -> Option<Mosquitto> {
    // mosquitto refuses port 0, so a free one is guessed; another test may be faster, hence several tries.
    for _ in 0..5 {
        let port = std::net::TcpListener::bind("127.0.0.1:0")
            .unwrap()
            .local_addr()
            .unwrap()
            .port();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mosquitto.conf");
        std::fs::write(
            &file,
            format!("listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\n{extra}\n"),
        )
        .unwrap();
        let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin:/usr/local/sbin";
        let mut process = std::process::Command::new("mosquitto")
            .env("PATH", path)
            .arg("-c")
            .arg(&file)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        for _ in 0..100 {
            tokio::time::sleep(Duration::from_millis(30)).await;
            if process.try_wait().unwrap().is_some() {
                break;
            }
            if TcpStream::connect(("127.0.0.1", port)).await.is_ok() {
                return Some(Mosquitto {
                    process,
                    url: format!("mqtt://127.0.0.1:{port}"),
                    _folder: folder,
                });
            }
        }
        let _ = process.kill();
        let _ = process.wait();
    }
    panic!("mosquitto does not start");
}

fn external(url: &str) -> BenchOptions {
    let broker = BrokerChoice::External {
        url: url.to_owned(),
        access: Access::default(),
    };
    BenchOptions {
        broker,
        ..BenchOptions::loopback(topics())
    }
}

#[tokio::test]
async fn mosquitto_serves_as_well_and_its_end_is_told_at_once() {
    let Some(mosquitto) = mosquitto("").await else {
        return missing("mosquitto");
    };
    let mut rig = rig_with(external(&mosquitto.url)).await;
    let device = rig.device().await;
    for qos in 0..=2 {
        device.send("d/state", "x", qos, false);
        let seen = rig.until("state", |o| is_message(o, "x")).await;
        assert!(matches!(&seen.last().unwrap().event, Event::Message { qos: q, .. } if *q == qos));
    }
    device.send("d/connection", "online", 1, true);
    rig.until("connection", |o| is_message(o, "online")).await;
    rig.link.fresh_subscriber("d/connection").await.unwrap();
    rig.until("retained", |o| matches!(&o.event, Event::Retained { retain: true, .. }))
        .await;
    rig.fault(LinkFault::Cut { reset: true }).await;
    rig.until("will", |o| is_message(o, "broken")).await;
    let killed = Instant::now();
    drop(mosquitto);
    let error = loop {
        let deadline = rig.link.now().after(Duration::from_secs(5)).moment;
        match rig.link.next(deadline).await {
            Ok(Some(_)) => {}
            Ok(None) => panic!("the end of the broker is not told"),
            Err(error) => break error,
        }
    };
    assert!(
        matches!(error, LinkError::Broker { .. }) && killed.elapsed() < Duration::from_secs(2),
        "{error}"
    );
    assert!(matches!(
        rig.link.publish(message("d/order", "x", 0, false)).await,
        Err(LinkError::Broker { .. })
    ));
    rig.link.stop().await;
}

#[tokio::test]
async fn a_broker_that_keeps_nothing_retained_is_refused_with_a_reason() {
    let Some(mosquitto) = mosquitto("retain_available false").await else {
        return missing("mosquitto");
    };
    let error = MqttBench::start(external(&mosquitto.url)).await.err().unwrap();
    assert!(
        matches!(error, LinkError::Setup(_) | LinkError::Broker { .. }),
        "{error}"
    );
}

#[tokio::test]
async fn a_broker_without_qos_2_is_used_and_the_report_says_so() {
    let Some(mosquitto) = mosquitto("max_qos 1").await else {
        return missing("mosquitto");
    };
    let (link, info) = MqttBench::start(external(&mosquitto.url)).await.unwrap();
    let limits = info.limits.concat();
    assert!(limits.contains("whoever publishes with QoS 2"), "{limits}");
    assert_eq!(info.limits.len(), 1, "{limits}");
    link.stop().await;
}

#[tokio::test]
async fn a_node_that_is_no_part_of_the_cluster_is_refused() {
    let (Some(one), Some(other)) = (mosquitto("").await, mosquitto("").await) else {
        return missing("mosquitto");
    };
    let options = BenchOptions {
        cluster: vec![other.url.clone()],
        ..external(&one.url)
    };
    let error = MqttBench::start(options).await.err().unwrap().to_string();
    assert!(
        error.contains(&format!("a message published at {}", other.url)),
        "{error}"
    );
    let alike = BenchOptions {
        cluster: vec![one.url.clone()],
        ..external(&one.url)
    };
    let (link, info) = MqttBench::start(alike).await.unwrap();
    assert_eq!(info.limits, Vec::<String>::new());
    link.stop().await;
}

#[tokio::test]
async fn a_broker_that_is_not_there_is_named() {
    let error = MqttBench::start(external("mqtt://127.0.0.1:1")).await.err().unwrap();
    assert!(
        matches!(&error, LinkError::Broker { broker, .. } if broker == "mqtt://127.0.0.1:1"),
        "{error}"
    );
}
