//! MQTT clients that real devices are built on, through the tap to the embedded broker: each in MQTT 3.1.1 and 5, over
//! TCP and TLS.

use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::time::Duration;

use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process::Command;

use vda5050_tck::link::Link;
use vda5050_tck::link::mqtt::BenchOptions;

use crate::rig::*;
use crate::surroundings::certificate;

/// As long as nobody has to wait for who is well.
const LIMIT: Duration = Duration::from_secs(60);
/// What the scripts of `fixtures/clients` print.
const STEPS: &str = "connect\nqos\nretained\nlarge\nkeep-alive\ntakeover\nwill\ndone\n";

/// Where a client connects to.
struct Address {
    port: String,
    /// Where TLS is spoken: the certificate to trust.
    authority: Option<PathBuf>,
}

#[tokio::test]
async fn every_client_does_everything_over_tcp() {
    let rig = rig().await;
    every_client(rig, None).await;
}

#[tokio::test]
async fn every_client_does_everything_over_tls() {
    let folder = tempfile::tempdir().unwrap();
    let Some(tls) = certificate(folder.path()) else {
        return missing("openssl");
    };
    let authority = tls.certificate.clone();
    let options = BenchOptions {
        tls: Some(tls),
        ..BenchOptions::loopback(topics())
    };
    every_client(rig_with(options).await, Some(authority)).await;
}

async fn every_client(mut rig: Rig, authority: Option<PathBuf>) {
    let (_, port) = rig.info.device_address.rsplit_once(':').unwrap();
    let address = Address {
        port: port.to_owned(),
        authority,
    };
    let all = async {
        tokio::join!(
            script(&address, "python3", "with_paho.py", "4"),
            script(&address, "python3", "with_paho.py", "5"),
            script(&address, "node", "with-mqtt.mjs", "4"),
            script(&address, "node", "with-mqtt.mjs", "5"),
            mosquitto(&address, "mqttv311"),
            mosquitto(&address, "mqttv5"),
            paho_c(&address, "311"),
            paho_c(&address, "5"),
        );
    };
    // What the tap reports is taken, as in a run.
    let recorded = async {
        loop {
            let deadline = rig.link.now().after(LIMIT).moment;
            let _ = rig.link.next(deadline).await.unwrap();
        }
    };
    tokio::select! {
        () = all => {}
        () = recorded => {}
    }
    rig.link.stop().await;
}

/// A program's end; `None` where it is not installed.
async fn ended(program: &str, command: &mut Command) -> Option<Output> {
    let command = command.stdin(Stdio::null()).kill_on_drop(true);
    let output = match tokio::time::timeout(LIMIT, command.output()).await {
        Ok(Ok(output)) => output,
        Ok(Err(_)) => {
            missing(program);
            return None;
        }
        Err(_) => panic!("{program} does not end"),
    };
    Some(output)
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/clients")
}

/// A script of `fixtures/clients`, which needs a package.
async fn script(address: &Address, program: &str, name: &str, level: &str) {
    let mut command = Command::new(program);
    command
        .current_dir(fixtures())
        .args([name, "localhost", &address.port, level]);
    command.args(&address.authority).env("PYTHONDONTWRITEBYTECODE", "1");
    let Some(output) = ended(program, &mut command).await else {
        return;
    };
    let complaint = String::from_utf8_lossy(&output.stderr);
    if complaint.contains("ModuleNotFoundError") || complaint.contains("ERR_MODULE_NOT_FOUND") {
        return missing(&format!("the package of {name}"));
    }
    let done = String::from_utf8_lossy(&output.stdout);
    assert_eq!(done, STEPS, "{name}, MQTT {level}:\n{complaint}");
}

/// Retained messages of every quality of service, and a large one, come out as they went in.
async fn mosquitto(address: &Address, version: &str) {
    let folder = tempfile::tempdir().unwrap();
    let large = folder.path().join("large");
    std::fs::write(&large, "0123456789".repeat(100_000)).unwrap();
    let command = |program: &str| {
        let mut command = Command::new(program);
        command.args(["-h", "localhost", "-p", &address.port, "-V", version]);
        if let Some(authority) = &address.authority {
            command.arg("--cafile").arg(authority);
        }
        command
    };
    for (name, qos) in [("0", "0"), ("1", "1"), ("2", "2"), ("large", "1")] {
        let mut publish = command("mosquitto_pub");
        publish.args(["-r", "-q", qos, "-t", &format!("{version}/{name}")]);
        publish.args(["--will-topic", "d/connection", "--will-payload", "broken"]);
        let publish = match name {
            "large" => publish.arg("-f").arg(&large),
            _ => publish.args(["-m", "kept"]),
        };
        let Some(output) = ended("mosquitto_pub", publish).await else {
            return;
        };
        assert!(output.status.success(), "{version}: {output:?}");
    }
    let mut subscribe = command("mosquitto_sub");
    subscribe.args(["-q", "2", "-C", "4", "-W", "30", "-F", "%t %q %r %l", "-t"]);
    let Some(output) = ended("mosquitto_sub", subscribe.arg(format!("{version}/#"))).await else {
        return;
    };
    let mut seen: Vec<String> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(str::to_owned)
        .collect();
    seen.sort();
    let expected = ["0 0 1 4", "1 1 1 4", "2 2 1 4", "large 1 1 1000000"].map(|line| format!("{version}/{line}"));
    assert_eq!(seen, expected, "{output:?}");
}

/// The clients of Eclipse Paho in C: what the one keeps at the broker, the other reads.
async fn paho_c(address: &Address, version: &str) {
    let scheme = if address.authority.is_some() { "ssl" } else { "tcp" };
    let topic = format!("paho-c/{version}");
    let command = |program: &str| {
        let mut command = Command::new(program);
        command.args(["-c", &format!("{scheme}://localhost:{}", address.port), "-V", version]);
        command.args(["-q", "2", "-t", &topic, "-i", &format!("{program}-{version}")]);
        if let Some(authority) = &address.authority {
            command.arg("--cafile").arg(authority);
        }
        command
    };
    let mut publish = command("paho_c_pub");
    let Some(output) = ended("paho_c_pub", publish.args(["-r", "-m", "kept"])).await else {
        return;
    };
    assert!(output.status.success(), "{version}: {output:?}");
    let mut subscribe = command("paho_c_sub");
    let subscribe = subscribe.stdin(Stdio::null()).stdout(Stdio::piped()).kill_on_drop(true);
    let Ok(mut subscribe) = subscribe.spawn() else {
        return missing("paho_c_sub");
    };
    let mut lines = BufReader::new(subscribe.stdout.take().unwrap()).lines();
    let line = tokio::time::timeout(LIMIT, lines.next_line()).await.unwrap().unwrap();
    assert_eq!(line.as_deref(), Some("kept"), "{version}");
    subscribe.kill().await.unwrap();
}
