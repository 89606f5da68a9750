//! The budgets of this program, measured: `cargo bench`. Each line says what was measured, and what is allowed; the end is a
//! failure when one is missed. Nothing else should run on the machine meanwhile.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what cannot be measured ends the bench"
)]

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use vda5050_tck::bench::client::{Client, ClientEvent, ClientOptions};
use vda5050_tck::bench::endpoint::{Access, Endpoint};
use vda5050_tck::device::Publication;
use vda5050_tck::explore::{Coverage, Exploration, Grammar};
use vda5050_tck::judge::judge;
use vda5050_tck::link::mqtt::{BenchOptions, MqttBench};
use vda5050_tck::pack::Role;
use vda5050_tck::run::{Selection, VirtualRun, run_silently};

/// What was measured.
struct Measured {
    what: &'static str,
    value: f64,
    unit: &'static str,
    /// The most that is allowed; with `at_least` the least.
    limit: f64,
    at_least: bool,
}

impl Measured {
    fn holds(&self) -> bool {
        if self.at_least {
            self.value >= self.limit
        } else {
            self.value <= self.limit
        }
    }
}

fn at_most(what: &'static str, value: f64, unit: &'static str, limit: f64) -> Measured {
    Measured {
        what,
        value,
        unit,
        limit,
        at_least: false,
    }
}

fn at_least(what: &'static str, value: f64, unit: &'static str, limit: f64) -> Measured {
    Measured {
        at_least: true,
        ..at_most(what, value, unit, limit)
    }
}

fn main() {
    // `cargo test --benches` only wants to know that it compiles.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let measures: [fn() -> Vec<Measured>; 6] = [start_up, virtual_suite, exploration, tap, vehicles, audit];
    let mut missed = 0;
    for measure in measures {
        for one in measure() {
            let word = if one.at_least { "at least" } else { "at most" };
            let verdict = if one.holds() { "ok    " } else { "missed" };
            missed += usize::from(!one.holds());
            println!(
                "{verdict} {:<64} {:>12.3} {}  ({word} {})",
                one.what, one.value, one.unit, one.limit
            );
        }
    }
    std::process::exit(i32::from(missed > 0));
}

fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vda5050-tck"));
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

fn percentile(all: &mut [f64], part: f64) -> f64 {
    all.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place in a list"
    )]
    let at = (all.len() as f64 * part) as usize;
    all[at.min(all.len() - 1)]
}

fn start_up() -> Vec<Measured> {
    let times = (0..20).map(|_| {
        let begun = Instant::now();
        assert!(program().arg("--help").status().unwrap().success());
        begun.elapsed().as_secs_f64() * 1e3
    });
    vec![at_most("--help", median(times.collect()), "ms", 20.0)]
}

fn virtual_suite() -> Vec<Measured> {
    let library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest();
    let begun = Instant::now();
    let request = VirtualRun::of_role(Role::Agv, &library, pack);
    let tests = request.tests.len();
    let finished = run_silently(&library, pack, request).unwrap();
    let run = begun.elapsed().as_secs_f64();
    let entries = finished.recorder.journal().entries();
    let begun = Instant::now();
    judge(&library.rules, entries).unwrap();
    let judged = begun.elapsed().as_secs_f64();
    println!("       {tests} tests, {} records", entries.len());
    vec![
        at_most("all AGV suites in virtual time", run, "s", 2.0),
        at_most(
            "judging one record again",
            judged / entries.len() as f64 * 1e6,
            "µs",
            100.0,
        ),
    ]
}

/// Conversations with the reference AGV: drawn, made tests, carried out and judged, on one core.
fn exploration() -> Vec<Measured> {
    const CONVERSATIONS: usize = 100;
    let mut library = vda5050_tck::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let pack = library.rules.packs.latest().clone();
    let grammar = Grammar::load(&library.assets, Role::Agv)
        .unwrap()
        .only(&pack, |_, _| true);
    let begun = Instant::now();
    let explore = Exploration {
        grammar,
        seed: 1,
        conversations: CONVERSATIONS,
        length: 12,
        at_once: 4,
        trials: 0,
        budget: None,
    };
    let drawn = explore.drawn(&explore.grammar, &mut Coverage::default());
    let stimuli: usize = drawn.iter().map(|(chain, _)| chain.stimuli().len()).sum();
    let files = drawn
        .iter()
        .map(|(_, file)| (file.place(explore.grammar.side()), file.text.clone()));
    let mut request = VirtualRun::of_role(Role::Agv, &library, &pack);
    let tests = library.add(&files.collect::<Vec<_>>());
    request.tests = Selection::some(tests.unwrap_or_else(|all| panic!("{}", all[0])));
    request.draw = None;
    run_silently(&library, &pack, request).unwrap();
    let seconds = begun.elapsed().as_secs_f64();
    vec![at_least(
        "stimuli of conversations: drawn, said and judged",
        stimuli as f64 / seconds,
        "a second",
        5_000.0,
    )]
}

/// Messages of 3 KB there and back, in µs.
async fn there_and_back(device: &str, harness: &str, times: usize) -> Vec<f64> {
    let open = async |address: &str, id: &str, topic: &str| {
        let (client, mut events) = Client::open(&ClientOptions {
            endpoint: Endpoint::parse(address, &Access::default()).unwrap(),
            client_id: id.to_owned(),
            keep_alive: Duration::from_secs(30),
            clean_session: true,
            will: None,
            subscriptions: vec![(topic.to_owned(), 0)],
        });
        assert_eq!(events.recv().await, Some(ClientEvent::Connected));
        (client, events)
    };
    let message = |topic: &str| Publication {
        topic: topic.to_owned(),
        payload: vec![b'x'; 3 << 10].into(),
        qos: 0,
        retain: false,
    };
    let (echo, mut asked) = open(device, "echo", "there").await;
    let (asking, mut answers) = open(harness, "asking", "back").await;
    let answering = tokio::spawn(async move {
        while let Some(ClientEvent::Message { .. }) = asked.recv().await {
            echo.publish(message("back"));
        }
    });
    let mut all = Vec::new();
    for round in 0..times + 200 {
        let begun = Instant::now();
        asking.publish(message("there"));
        answers.recv().await.unwrap();
        // The first ones warm everything up.
        if round >= 200 {
            all.push(begun.elapsed().as_secs_f64() * 1e6);
        }
    }
    answering.abort();
    all
}

/// What the tap adds to the broker behind it.
fn tap() -> Vec<Measured> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .unwrap();
    let (mut direct, mut tapped) = runtime.block_on(async {
        let (link, info) = MqttBench::start(BenchOptions::loopback(vec!["nobody".to_owned()]))
            .await
            .unwrap();
        let direct = there_and_back(&info.broker_address, &info.broker_address, 2_000).await;
        let tapped = there_and_back(&info.device_address, &info.broker_address, 2_000).await;
        link.stop().await;
        (direct, tapped)
    });
    runtime.shutdown_background();
    let added = |direct: &mut [f64], tapped: &mut [f64], part| percentile(tapped, part) - percentile(direct, part);
    vec![
        at_most(
            "tap, a 3-KB message there and back, median over the broker alone",
            added(&mut direct, &mut tapped, 0.5),
            "µs",
            40.0,
        ),
        at_most(
            "tap, a 3-KB message there and back, p99 over the broker alone",
            added(&mut direct, &mut tapped, 0.99),
            "µs",
            150.0,
        ),
    ]
}

/// Seconds of processor time, and memory in MB, of a process.
fn used_by(process: u32) -> Option<(f64, f64)> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks: f64 = fields.get(11)?.parse::<f64>().ok()? + fields.get(12)?.parse::<f64>().ok()?;
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let memory: f64 = memory.trim().split(' ').next()?.parse().ok()?;
    Some((ticks / 100.0, memory / 1024.0))
}

/// A thousand mock AGVs with a state a second, at a broker of their own.
fn vehicles() -> Vec<Measured> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .unwrap();
    let broker = runtime.block_on(vda5050_tck::broker::EmbeddedBroker::start()).unwrap();
    let url = format!("mqtt://{}", broker.address());
    let mut fleet = program()
        .args([
            "simulate",
            "agv",
            "--count",
            "1000",
            "--state-interval",
            "1",
            "--broker",
            &url,
        ])
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(15));
    let before = used_by(fleet.id());
    std::thread::sleep(Duration::from_secs(20));
    let after = used_by(fleet.id());
    fleet.kill().unwrap();
    fleet.wait().unwrap();
    runtime.block_on(broker.stop());
    runtime.shutdown_background();
    let (Some((begun, _)), Some((ended, memory))) = (before, after) else {
        println!("       no /proc on this machine: mock AGVs are not measured");
        return Vec::new();
    };
    vec![
        at_most(
            "1,000 mock AGVs at 1 Hz, of one core",
            (ended - begun) / 20.0 * 100.0,
            "%",
            3.0,
        ),
        at_most("1,000 mock AGVs at 1 Hz, memory", memory, "MB", 48.0),
    ]
}

/// States of 3 KB in a recording.
fn audit() -> Vec<Measured> {
    const STATES: usize = 100_000;
    let text = std::fs::read_to_string("fixtures/captures/two-versions.jsonl").unwrap();
    let state = text
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .find(|line| line["topic"].as_str().is_some_and(|topic| topic.ends_with("/state")))
        .expect("a state in the capture");
    let topic = state["topic"].clone();
    let mut payload: serde_json::Value = match &state["payload"] {
        serde_json::Value::String(text) => serde_json::from_str(text).unwrap(),
        other => other.clone(),
    };
    // Three kilobytes, as vehicles with a load and a route have them.
    payload["information"] =
        serde_json::json!([{ "infoType": "load", "infoLevel": "INFO", "infoDescription": "x".repeat(2_000) }]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture.jsonl");
    let mut file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    for number in 0..STATES {
        payload["headerId"] = number.into();
        let at = jiff::Timestamp::from_millisecond(1_780_000_000_000 + i64::try_from(number).unwrap() * 1_000).unwrap();
        payload["timestamp"] = format!("{at:.2}").into();
        // As mosquitto_sub writes it.
        let line = serde_json::json!({ "tst": format!("{at:.6}+0000"), "topic": topic, "payload": payload });
        writeln!(file, "{line}").unwrap();
    }
    drop(file);
    let begun = Instant::now();
    let status = program().arg("audit").arg(&path).status().unwrap();
    let taken = begun.elapsed().as_secs_f64();
    assert!(matches!(status.code(), Some(0 | 1 | 3)), "{status}");
    vec![at_least(
        "states of 3 KB that are audited in a second",
        STATES as f64 / taken,
        "/s",
        100_000.0,
    )]
}
