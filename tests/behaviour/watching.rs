//! `watch`: live traffic is judged, recorded and counted, whatever becomes of the broker.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;

use serde_json::Value;

use crate::bench::{Bench, MANUFACTURER, SERIAL};
use crate::mosquitto::Mosquitto;
use crate::tool::{Running, run, run_in, tool};

/// A vehicle that says something five times a second.
fn talkative(bench: &Bench, broker: &str, faults: &[&str]) -> Running {
    let mut arguments = vec!["simulate", "agv", "--broker", broker, "--state-interval", "0.2"];
    arguments.extend(["--manufacturer", MANUFACTURER, "--serial", SERIAL]);
    arguments.extend(faults.iter().flat_map(|fault| ["--fault", fault]));
    Running::start(&mut tool(bench.path(), &arguments))
}

fn scraped(address: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(
        stream,
        "GET /metrics HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

/// Monitor, requirement and count of all findings of the vehicle, and the number of holes.
fn found(result: &Value) -> (Vec<(String, String, u64)>, u64) {
    let vehicle = &result["vehicles"][0];
    let sides = vehicle["sides"].as_array().unwrap().iter();
    let findings = sides.flat_map(|side| side["findings"].as_array().unwrap());
    let text = |finding: &Value, member: &str| finding[member].as_str().unwrap().to_owned();
    let found = findings.map(|finding| {
        let count = finding["count"].as_u64().unwrap();
        (text(finding, "monitor"), text(finding, "requirement"), count)
    });
    (found.collect(), vehicle["holes"].as_u64().unwrap())
}

#[test]
fn a_watch_outlives_its_broker_and_its_journal_is_judged_as_it_was() {
    let Some(mut mosquitto) = Mosquitto::start() else {
        return;
    };
    let bench = Bench::new();
    let broker = mosquitto.url();
    let arguments = [
        "watch",
        "--broker",
        &broker,
        "--record",
        "site.jsonl",
        "--format",
        "json",
    ];
    let more = ["--metrics", "127.0.0.1:0", "--rotate-size", "4K", "--every"];
    let mut watch = Running::start(&mut tool(bench.path(), &[&arguments[..], &more[..]].concat()));
    let metrics = watch.line("metrics are served at http://").replace("/metrics", "");
    watch.line("watching");
    let mut agv = talkative(&bench, &broker, &["timestamp-local"]);
    watch.until("a finding", |watch| watch.stdout().contains("\"HDR-03\"").then_some(()));
    let page = scraped(&metrics);
    assert!(page.contains("application/openmetrics-text"), "{page}");
    let counted = format!("vda5050_findings_total{{manufacturer=\"{MANUFACTURER}\",serial_number=\"{SERIAL}\"");
    assert!(
        page.contains(&counted) && page.contains("vda5050_broker_connected 1\n"),
        "{page}"
    );
    assert!(page.ends_with("# EOF\n"), "{page}");
    mosquitto.restart(|| {
        watch.until("the loss", |watch| {
            watch.stderr().contains("the connection is lost").then_some(())
        });
    });
    watch.until("the return", |watch| {
        watch.stderr().contains("connected again").then_some(())
    });
    let page = scraped(&metrics);
    assert!(page.contains("vda5050_broker_connection_lost_total 1\n"), "{page}");
    let before = watch.stdout().len();
    agv.kill();
    let mut other = talkative(&bench, &broker, &["timestamp-local"]);
    watch.until("more findings", |watch| (watch.stdout().len() > before).then_some(()));
    other.kill();
    watch.interrupt();
    let ended = watch.end().code(1);
    let result: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
    assert_eq!(result["kind"], "result");
    let (findings, holes) = found(&result);
    assert!(findings.iter().any(|(_, requirement, _)| requirement == "HDR-03") && holes > 0);
    let mut parts: Vec<String> = std::fs::read_dir(bench.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("site"))
        .collect();
    parts.sort();
    assert!(parts.len() > 1, "{parts:?}");
    let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
    let audited = run_in(bench.path(), &[&["audit", "--format", "json"], &parts[..]].concat()).code(1);
    assert_eq!(
        found(&serde_json::from_str(&audited.stdout).unwrap()),
        (findings, holes)
    );
}

#[test]
fn a_faultless_vehicle_is_accused_of_nothing_and_the_first_violation_of_another_ends_the_watch() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let broker = mosquitto.url();
    let mut agv = talkative(&bench, &broker, &[]);
    agv.line("1 simulated AGV(s) on ");
    let all = bench.run(&["watch", "--broker", &broker, "--for", "2s", "--summary", "1s"]);
    let all = all
        .code(0)
        .prints("0 violations, 0 warnings")
        .prints("PASS  the vehicle");
    assert!(all.stderr.contains("1 vehicle heard by now"), "{}", all.stderr);
    agv.kill();
    let mut agv = talkative(&bench, &broker, &["timestamp-local"]);
    agv.line("1 simulated AGV(s) on ");
    let found = bench.run(&["watch", "--broker", &broker, "--fail-fast"]).code(1);
    let lines: Vec<&str> = found.stdout.lines().collect();
    assert!(
        lines[0].contains(" FAIL ACME 0001, vehicle: HDR-03"),
        "{}",
        found.stdout
    );
    assert!(lines[1].contains("/state {\"headerId\":"), "{}", found.stdout);
}

#[test]
fn as_the_tap_it_judges_connections_too_and_so_does_the_audit_of_its_journal() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let broker = mosquitto.url();
    let arguments = [
        "watch",
        "--broker",
        &broker,
        "--listen",
        "127.0.0.1:0",
        "--record",
        "site.jsonl",
    ];
    let mut watch = Running::start(&mut tool(
        bench.path(),
        &[&arguments[..], &["--format", "json"]].concat(),
    ));
    let tap = watch.line("vehicles are expected at ");
    watch.line("watching");
    let mut agv = talkative(&bench, &tap, &["will-not-retained", "state-qos-1"]);
    agv.line("1 simulated AGV(s) on ");
    watch.until("states", |watch| {
        watch.stderr().contains("1 vehicle heard").then_some(())
    });
    std::thread::sleep(std::time::Duration::from_secs(2));
    agv.interrupt();
    agv.end();
    watch.until("a finding", |watch| {
        watch.stdout().contains("\"CONN-03\"").then_some(())
    });
    watch.interrupt();
    let ended = watch.end().code(1);
    let result: Value = serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap();
    assert_eq!(result["vehicles"][0]["vantage"], "tap");
    let (findings, holes) = found(&result);
    for wanted in ["CONN-03", "MQTT-07"] {
        let all = findings.iter().map(|(_, requirement, _)| requirement.as_str());
        assert!(
            all.clone().any(|requirement| requirement == wanted),
            "{:?}",
            all.collect::<Vec<_>>()
        );
    }
    let audited = run_in(bench.path(), &["audit", "--format", "json", "site.jsonl"]).code(1);
    assert_eq!(
        found(&serde_json::from_str(&audited.stdout).unwrap()),
        (findings, holes)
    );
}

/// A terminal that nobody looks at. It is closed when the test is over.
struct Tmux(String);

impl Tmux {
    /// Runs the program in it. Without tmux on this machine: nothing, which in CI is a failure.
    fn start(bench: &Bench, command: &str) -> Option<Self> {
        let this = Self(format!("tck-{}", std::process::id()));
        let size = ["-x", "150", "-y", "44"];
        let mut tmux = std::process::Command::new("tmux");
        tmux.args(["-L", &this.0, "-f", "/dev/null", "new-session", "-d"])
            .args(size)
            .arg(command);
        let Ok(status) = tmux.current_dir(bench.path()).env("TERM", "xterm-256color").status() else {
            assert!(
                std::env::var_os("CI").is_none(),
                "tmux is not installed, and CI must have it"
            );
            eprintln!("skipped: tmux is not installed");
            return None;
        };
        assert!(status.success());
        Some(this)
    }

    fn tmux(&self, arguments: &[&str]) -> String {
        let output = std::process::Command::new("tmux")
            .args(["-L", &self.0])
            .args(arguments)
            .output()
            .unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// What is on the screen, once this is seen on it.
    fn until(&self, seen: impl Fn(&str) -> bool) -> String {
        for _ in 0..600 {
            let screen = self.tmux(&["capture-pane", "-p"]);
            if seen(&screen) {
                return screen;
            }
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
        panic!("not on the screen:\n{}", self.tmux(&["capture-pane", "-p"]));
    }
}

impl Drop for Tmux {
    fn drop(&mut self) {
        self.tmux(&["kill-server"]);
    }
}

#[test]
fn on_a_terminal_vehicles_and_the_wrong_member_are_shown() {
    let Some(mosquitto) = Mosquitto::start() else { return };
    let bench = Bench::new();
    let broker = mosquitto.url();
    let program = env!("CARGO_BIN_EXE_vda5050-tck");
    let command = format!("{program} watch --broker {broker} && true; echo ended with $?; sleep 60");
    let Some(tmux) = Tmux::start(&bench, &command) else {
        return;
    };
    tmux.until(|screen| screen.contains("no vehicle was heard so far") && screen.contains("connected"));
    let mut agv = talkative(&bench, &broker, &["mode-lower-case"]);
    agv.line("1 simulated AGV(s) on ");
    let screen = tmux.until(|screen| screen.contains(">>   \"operatingMode\""));
    assert!(
        screen.contains(&format!("{MANUFACTURER} {SERIAL}")) && screen.contains("ONLINE"),
        "{screen}"
    );
    tmux.tmux(&[&["send-keys", "Tab", "Down"][..], &["PPage"; 12][..]].concat());
    tmux.until(|screen| screen.contains("\"headerId\""));
    tmux.tmux(&["send-keys", "q"]);
    let screen = tmux.until(|screen| screen.contains("ended with 1"));
    assert!(screen.contains("1 vehicle;"), "{screen}");
    agv.kill();
}

#[test]
fn without_a_broker_or_with_nonsense_it_does_not_begin() {
    run(&["watch", "--broker", "mqtt://127.0.0.1:1"])
        .code(5)
        .says("cannot listen on");
    run(&["watch", "--only", "no/such"]).code(2).says("no/such");
    run(&["watch", "--rotate-size", "1M"]).code(2).says("--record");
}
