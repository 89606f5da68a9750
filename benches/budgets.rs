//! The budgets of this program, measured: `cargo bench`, or only some of them: `cargo bench --bench budgets -- tap vehicles`.
//! Each line says what was measured, and what is allowed; the end is a failure when one is missed. Nothing else should run on
//! the machine meanwhile. Tap and vehicles are measured beside mosquitto where it is installed, and the vehicles beside those of
//! the npm package where it is.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "what cannot be measured ends the bench"
)]

use std::io::Write as _;
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use vda5050_tck::bench::client::{Client, ClientEvent, ClientOptions};
use vda5050_tck::bench::endpoint::{Access, Endpoint};
use vda5050_tck::broker::EmbeddedBroker;
use vda5050_tck::device::Publication;
use vda5050_tck::explore::{Coverage, Exploration, Grammar};
use vda5050_tck::judge::judge;
use vda5050_tck::link::mqtt::{BenchOptions, BrokerChoice, MqttBench};
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

/// What measures one thing.
type Measure = fn() -> Vec<Measured>;

fn main() {
    // `cargo test --benches` only wants to know that it compiles.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let measures: [(&str, Measure); 6] = [
        ("start-up", start_up),
        ("virtual-suite", virtual_suite),
        ("exploration", exploration),
        ("tap", tap),
        ("vehicles", vehicles),
        ("audit", audit),
    ];
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with('-'))
        .collect();
    open_files();
    let mut missed = 0;
    for (name, measure) in measures {
        if !wanted.is_empty() && !wanted.iter().any(|wanted| wanted == name) {
            continue;
        }
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
        part: None,
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

/// A mosquitto on a port of its own, which ends with it.
struct Mosquitto {
    process: Child,
    url: String,
    _folder: tempfile::TempDir,
}

impl Mosquitto {
    /// Nothing where it is not installed.
    fn start() -> Option<Self> {
        let port = TcpListener::bind("127.0.0.1:0").ok()?.local_addr().ok()?.port();
        let folder = tempfile::tempdir().ok()?;
        let file = folder.path().join("mosquitto.conf");
        let rules = format!("listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\nlog_type none\n");
        std::fs::write(&file, rules).ok()?;
        let mut command = Command::new("mosquitto");
        // Debian has it where only the superuser looks.
        command.env(
            "PATH",
            format!("{}:/usr/sbin", std::env::var("PATH").unwrap_or_default()),
        );
        command.arg("-c").arg(&file).stdout(Stdio::null()).stderr(Stdio::null());
        let process = command.spawn().ok()?;
        for _ in 0..100 {
            if TcpStream::connect(("127.0.0.1", port)).is_ok() {
                break;
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(Self {
            process,
            url: format!("mqtt://127.0.0.1:{port}"),
            _folder: folder,
        })
    }
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// As many open files as the system allows, for this process and those it starts.
#[cfg(unix)]
fn open_files() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    let _ = setrlimit(Resource::Nofile, raised);
}

#[cfg(not(unix))]
fn open_files() {}

/// What the tap adds to the broker behind it, the embedded one and mosquitto.
fn tap() -> Vec<Measured> {
    let mut all = tap_before(
        BrokerChoice::Embedded,
        [
            "tap, a 3-KB message there and back, median over the broker alone",
            "tap, a 3-KB message there and back, p99 over the broker alone",
        ],
    );
    match Mosquitto::start() {
        Some(mosquitto) => {
            let url = mosquitto.url.clone();
            let access = Access::default();
            all.extend(tap_before(
                BrokerChoice::External { url, access },
                [
                    "tap, a 3-KB message there and back, median over mosquitto alone",
                    "tap, a 3-KB message there and back, p99 over mosquitto alone",
                ],
            ));
        }
        None => println!("       no mosquitto on this machine: the tap is not measured beside it"),
    }
    all
}

fn tap_before(broker: BrokerChoice, [at_the_median, at_p99]: [&'static str; 2]) -> Vec<Measured> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .unwrap();
    let (mut direct, mut tapped) = runtime.block_on(async {
        let options = BenchOptions {
            broker,
            ..BenchOptions::loopback(vec!["nobody".to_owned()])
        };
        let (link, info) = MqttBench::start(options).await.unwrap();
        let direct = there_and_back(&info.broker_address, &info.broker_address, 2_000).await;
        let tapped = there_and_back(&info.device_address, &info.broker_address, 2_000).await;
        link.stop().await;
        (direct, tapped)
    });
    runtime.shutdown_background();
    let mut shown = |part| (percentile(&mut direct, part), percentile(&mut tapped, part));
    let (median, p99) = (shown(0.5), shown(0.99));
    println!(
        "       without the tap {:.0} µs (p99 {:.0} µs), through it {:.0} µs (p99 {:.0} µs)",
        median.0, p99.0, median.1, p99.1
    );
    vec![
        at_most(at_the_median, median.1 - median.0, "µs", 40.0),
        at_most(at_p99, p99.1 - p99.0, "µs", 150.0),
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

/// What a process takes of one core, in percent, and memory in MB, once it has had so many seconds to begin.
fn costs(mut process: Child, begins: u64) -> Option<(f64, f64)> {
    const SECONDS: u64 = 20;
    std::thread::sleep(Duration::from_secs(begins));
    let before = used_by(process.id());
    std::thread::sleep(Duration::from_secs(SECONDS));
    let after = used_by(process.id());
    process.kill().unwrap();
    process.wait().unwrap();
    let ((begun, _), (ended, memory)) = (before?, after?);
    Some(((ended - begun) / SECONDS as f64 * 100.0, memory))
}

/// Mock AGVs with a state a second each.
fn mock_agvs(count: u32, broker: &str) -> Child {
    let count = count.to_string();
    let arguments = [
        "simulate",
        "agv",
        "--count",
        &count,
        "--state-interval",
        "1",
        "--broker",
        broker,
    ];
    program().args(arguments).spawn().unwrap()
}

/// Controllers of the npm package with a state a second each; nothing where it is not installed.
fn npm_agvs(count: u32, broker: &str) -> Option<Child> {
    if !std::path::Path::new("fixtures/devices/vda-5050-lib-agv/node_modules").is_dir() {
        return None;
    }
    let mut command = Command::new("node");
    command.args(["benches/npm_fleet/fleet.mjs", broker, &count.to_string()]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().ok()
}

/// Mock AGVs with a state a second, at mosquitto where it is installed, and at the embedded broker in this process elsewhere.
fn vehicles() -> Vec<Measured> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .unwrap();
    let mosquitto = Mosquitto::start();
    let embedded = match &mosquitto {
        Some(_) => None,
        None => Some(runtime.block_on(EmbeddedBroker::start()).unwrap()),
    };
    let url = match (&mosquitto, &embedded) {
        (Some(mosquitto), _) => mosquitto.url.clone(),
        (None, Some(embedded)) => format!("mqtt://{}", embedded.address()),
        (None, None) => return Vec::new(),
    };
    let beside = |what: &str, measured: Option<(f64, f64)>| match measured {
        Some((core, memory)) => println!("       {what}: {core:.1} % of one core, {memory:.0} MB"),
        None => println!("       {what}: not measured, it is not here or this machine has no /proc"),
    };
    beside("200 of ours", costs(mock_agvs(200, &url), 10));
    let theirs = npm_agvs(200, &url).and_then(|fleet| costs(fleet, 20));
    beside("200 AgvControllers of the npm package", theirs);
    let fleets: [(u32, u64, [&'static str; 2], [f64; 2]); 2] = [
        (
            1_000,
            15,
            [
                "1,000 mock AGVs at 1 Hz, of one core",
                "1,000 mock AGVs at 1 Hz, memory",
            ],
            [3.0, 48.0],
        ),
        (
            10_000,
            60,
            [
                "10,000 mock AGVs at 1 Hz, of one core",
                "10,000 mock AGVs at 1 Hz, memory",
            ],
            [50.0, 400.0],
        ),
    ];
    let mut all = Vec::new();
    for (count, begins, [of_core, of_memory], [most, largest]) in fleets {
        let Some((core, memory)) = costs(mock_agvs(count, &url), begins) else {
            println!("       no /proc on this machine: mock AGVs are not measured");
            break;
        };
        let each = f64::from(count);
        println!(
            "       {count}: {:.1} µs a vehicle and second, {:.1} KB a vehicle with its share of the program",
            core * 1e4 / each,
            memory * 1024.0 / each
        );
        all.push(at_most(of_core, core, "%", most));
        all.push(at_most(of_memory, memory, "MB", largest));
    }
    if let Some(embedded) = embedded {
        runtime.block_on(embedded.stop());
    }
    runtime.shutdown_background();
    all
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
